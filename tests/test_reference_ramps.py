"""Torque ramps: a spring that holds up to break-away and then gives way, in closed form, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification import presliding as module
from backdrive.identification.presliding import identify_ramp
from backdrive.identification.ramp import Presliding, presliding
from backdrive.logs.log import Joint, Log

RATE, STIFF = 1000.0, 1e5
NAN = float("nan")


def ramp(*corners, slope=8.0, rate=RATE, before=300):
    """Torque that rests at the first corner and then goes straight from corner to corner [N.m]."""
    pieces = [np.full(before, corners[0])]
    for a, b in zip(corners, corners[1:], strict=False):
        n = round(abs(b - a) / slope * rate)
        pieces.append(a + (b - a) * np.arange(n) / n)
    return np.concatenate([*pieces, [corners[-1]]])


def logged(torque, position, count=1e-9, rate=RATE, unit="rad", **more):
    joint = Joint(name="a", unit=unit, encoder_counts=None if count is None else 1.0 / count, **more)
    return Log(time=np.arange(torque.size) / rate, joints=(joint,), position=position, torque=torque)


def yielding(torque, up=6.0, down=5.0, stiffness=STIFF, rate=RATE):
    """Position of a spring behind friction: beyond break-away it slides with the square of what is in excess."""
    excess = np.maximum(torque - up, 0.0) ** 2 - np.maximum(-torque - down, 0.0) ** 2
    return torque / stiffness + np.cumsum(excess) / rate


# ---------------------------------------------------------------------------------------- what is found


def test_a_spring_without_slip_is_seen_in_every_branch():
    u = ramp(0.0, 8.0, -8.0, 8.0, -8.0)
    got = presliding([logged(u, u / STIFF)], 0)
    assert [b.direction for b in got.branches] == [1, -1, 1, -1] and got.break_away == (None, None)
    assert [np.ptp(b.torque) for b in got.branches] == pytest.approx([8.0, 16.0, 16.0, 16.0], rel=0.03)
    assert got.stiffness is not None and got.tangent is not None and got.is_resolved
    assert got.stiffness[0] == pytest.approx(STIFF, rel=1e-3) and got.tangent[0] == pytest.approx(
        STIFF, rel=0.02
    )
    assert got.displacement == pytest.approx(16.0 / STIFF, rel=1e-6) and got.count == pytest.approx(1e-9)
    assert got.largest == (8.0, -8.0) and got.rest == 0.0
    assert got.slip_speed == pytest.approx(30.0 * 8.0 / STIFF, rel=0.1)
    assert got.width == pytest.approx(0.0, abs=2e-7) and got.area == pytest.approx(0.0, abs=2e-6)
    # with coarse counts it slips from ten of them in a period of the low pass of 20 Hz on
    coarse = presliding([logged(u, u / STIFF, count=4e-5)], 0)
    assert coarse.slip_speed == pytest.approx(10.0 * 4e-5 * 20.0) and not coarse.is_resolved
    slow = ramp(0.0, 8.0, -8.0, 8.0, slope=0.8, rate=100.0, before=30)
    slow = presliding([logged(slow, slow / STIFF, count=4e-5, rate=100.0)], 0)
    assert slow.slip_speed == pytest.approx(10.0 * 4e-5 * 10.0)  # a tenth of the rate


def test_a_branch_covers_a_fifth_of_the_torque_and_a_stretch_of_it_a_tenth():
    for dip, directions in ((0.22, [1, -1, 1, -1]), (0.18, [1, -1])):
        u = ramp(0.0, 8.0, 8.0 - 16.0 * dip, 8.0, -8.0)
        assert [b.direction for b in presliding([logged(u, u / STIFF)], 0).branches] == directions
    u = ramp(0.0, 8.0, -8.0)
    for at, count in (
        (7.5, 2),
        (4.0, 3),
    ):  # it gives way there for a moment, and what is left of the branch is short
        burst = np.cumsum((np.abs(u - at) < 0.1) & (np.arange(u.size) < u.argmax())) * 1e-5
        got = presliding([logged(u, u / STIFF + burst)], 0)
        assert len(got.branches) == count and got.branches[0].torque.max() < at


def test_steps_of_rounding_are_no_counts():
    u = ramp(0.0, 8.0, -8.0, 8.0)
    x = 1e-6 * np.round(u / STIFF / 1e-6)
    rounded = x * (1.0 + 1e-15 * (np.arange(u.size) % 2))
    for position in (x, rounded, rounded + 1e-19 * (np.arange(u.size) % 2)):
        assert presliding([logged(u, position, count=None)], 0).count == pytest.approx(1e-6)


@pytest.mark.parametrize(("counts", "resolved"), [(4.9, False), (5.1, True)])
def test_five_counts_are_a_displacement(counts, resolved):
    u = ramp(0.0, 8.0, -8.0, 8.0)
    got = presliding([logged(u, u / STIFF, count=16.0 / STIFF / counts)], 0)
    assert got.is_resolved is resolved is (got.stiffness is not None) is (got.tangent is not None)
    # torque over displacement and one count
    assert got.bound == pytest.approx(16.0 / (16.0 / STIFF + got.count), rel=0.02)


@pytest.mark.parametrize(("ratio", "spring"), [(2.9, True), (3.1, False)])
def test_a_stiffness_is_known_to_half_of_itself_or_none(ratio, spring):
    """Two ramps of compliance 1 and r: the mean is (1 + r) / 2, its error |1 - r| / 2."""
    u = ramp(0.0, 8.0, slope=2.0)
    logs = [logged(u, u / STIFF, 4e-6), logged(u, ratio * u / STIFF, 4e-6)]
    third = presliding([*logs[:1], logged(u, 1.3 * u / STIFF, 4e-6), logged(u, 1.6 * u / STIFF, 4e-6)], 0)
    assert third.stiffness is not None  # three of compliance 1, 1.3 and 1.6
    assert third.stiffness[1] / third.stiffness[0] == pytest.approx(0.3 / np.sqrt(3.0) / 1.3, rel=0.02)
    if spring:
        got = presliding(logs, 0)
        assert got.stiffness is not None
        assert got.stiffness[0] == pytest.approx(2.0 * STIFF / (1.0 + ratio), rel=0.01)
        assert got.stiffness[1] / got.stiffness[0] == pytest.approx((ratio - 1.0) / (ratio + 1.0), rel=0.01)
        assert len(got.branches) == 2
    else:
        with pytest.raises(NotIdentifiable, match="not like a spring"):
            presliding(logs, 0)
    with pytest.raises(NotIdentifiable, match="not like a spring"):
        presliding([logged(u, -u / STIFF)], 0)


def test_break_away_in_both_directions_about_the_torque_at_rest():
    u = ramp(0.5, 8.0, -8.0, 8.0, -8.0)
    got = presliding([logged(u, yielding(u))], 0)
    up, down = got.break_away
    assert up is not None and down is not None
    assert up[0] == pytest.approx(6.0, abs=0.1) and down[0] == pytest.approx(-5.0, abs=0.1)
    assert 0.0 < up[1] < 0.3 and got.rest == pytest.approx(0.5) and got.largest == (8.0, -8.0)
    assert got.stiffness is not None and got.stiffness[0] == pytest.approx(STIFF, rel=0.02)
    stuck = [b for b in got.branches if b.break_away is not None]
    assert [b.direction for b in stuck] == [1, -1, 1, -1]
    assert all(b.torque.min() > -5.3 and b.torque.max() < 6.3 for b in got.branches)
    assert np.isnan([got.width, got.area]).all()  # no loop is free of slip
    # the low pass lets a slip shine 50 ms into its neighbourhood, which is left out
    first = stuck[0]
    assert first.torque[-1] == pytest.approx(6.0 - 0.05 * 8.0, abs=0.12)
    # several logs: the finest is not believed, extremes are of all, rests are averaged
    v = ramp(-0.1, 9.0, -7.0)
    both = presliding([logged(u, yielding(u)), logged(v, yielding(v), count=3e-9)], 0)
    assert (
        both.count == pytest.approx(3e-9) and both.largest == (9.0, -8.0) and both.rest == pytest.approx(0.2)
    )
    assert both.slip_speed == max(
        presliding([x], 0).slip_speed for x in (logged(u, yielding(u)), logged(v, yielding(v), 3e-9))
    )


def test_what_is_no_ramp_is_refused():
    u = ramp(0.0, 8.0, -8.0)
    log = logged(u, u / STIFF)
    for wrong in (log.replace(torque=None), log.replace(position=None, velocity=np.zeros(u.size))):
        with pytest.raises(InvalidInput, match="'a': a ramp needs torque and position"):
            presliding([wrong], "a")
    with pytest.raises(NotIdentifiable, match="no stretch in which the torque ramps"):
        presliding([log.replace(torque=np.full(u.size, 2.0))], "a")
    with pytest.raises(InvalidInput, match="no log"):
        identify_ramp([], "a")
    # torque of the motor's side counts as that of the joint
    geared = logged(u / 50.0, u / STIFF, torque_side="motor", gear_ratio=50.0)
    assert presliding([geared], "a").largest == pytest.approx((8.0, -8.0))


def test_a_loop_in_which_it_slips_one_way_is_none():
    from backdrive.identification.ramp import hysteresis_loop as loop

    t = np.arange(4000) / RATE
    u = 4.0 * np.sin(2.0 * t) + 3.0
    for sign in (1.0, -1.0):
        x = sign * (
            1e-3 * np.sin(2.0 * t) - 2e-4 * np.cos(2.0 * t) - 0.01 * np.clip(np.sin(4.0 * t) - 0.9, 0.0, 1.0)
        )
        speed = np.abs(np.gradient(x, t))
        log = logged(u, x)
        assert np.isfinite(loop([log], [1.2 * speed.max()])).all()
        assert np.isnan(loop([log], [0.8 * speed.max()])).all()
    wide, narrow = (logged(u, 1e-3 * np.sin(2.0 * t) - a * np.cos(2.0 * t)) for a in (2e-4, 1e-4))
    assert loop([wide, narrow], [1.0, 1.0])[0] == pytest.approx(2e-4, rel=0.02)  # the last one
    assert loop([wide, narrow], [1.0, 1e-9])[0] == pytest.approx(4e-4, rel=0.02)
    for peak, closed in (
        (0.93, True),
        (0.88, False),
    ):  # branches that differ by more than a tenth close no loop
        corners = ramp(0.0, 8.0, -8.0, -8.0 + 16.0 * peak)
        found = presliding([logged(corners, corners / STIFF)], 0)
        assert np.isfinite(found.width) == closed


# -------------------------------------------------------------------------------------- what is made of it

FOUND = Presliding(
    branches=(), count=1e-6, displacement=8e-5, stiffness=(1e5, 400.0), tangent=(1.2e5, 700.0), bound=7e4,
    break_away=((6.5, 0.05), (-5.5, 0.04)), largest=(8.0, -7.5), rest=0.1, width=3e-5, area=2e-4, slip_speed=0.002,
)  # fmt: skip


def identified(monkeypatch, found=FOUND, unit="rad", logs=None):
    monkeypatch.setattr(module, "presliding", lambda logs, joint: found)
    u = ramp(0.0, 8.0, -8.0)
    return identify_ramp(logs or [logged(u, yielding(u), unit=unit)], "a")


def test_the_law_of_a_ramp_is_break_away_less_the_torque_at_rest(monkeypatch):
    got, shown = identified(monkeypatch)
    assert got.law.rate.values() == pytest.approx(
        {"coulomb_positive": 6.4, "coulomb_negative": 5.6, "viscous_positive": 0.0, "viscous_negative": 0.0}
    )
    assert (got.standard_errors["coulomb_positive"], got.standard_errors["coulomb_negative"]) == (0.05, 0.04)
    assert np.isnan([got.standard_errors["viscous_positive"], got.standard_errors["viscous_negative"]]).all()
    assert (got.at_bound, got.method, got.joint.name) == ((), "ramp", "a")
    assert got.validity.velocity == (-0.002, 0.002) and got.validity.load == (-7.5, 8.0)
    terms = {k: (e.value, e.unit, e.standard_error) for k, e in got.dynamics.items()}
    assert terms["offset"][:2] == (0.1, "N.m") and terms["presliding_stiffness"] == (1e5, "N.m/rad", 400.0)
    assert terms["presliding_stiffness_tangent"] == (1.2e5, "N.m/rad", 700.0)
    assert terms["hysteresis_width"] == (3e-5, "rad", pytest.approx(1e-6 / np.sqrt(6.0)))
    assert terms["hysteresis_area"][:2] == (2e-4, "J") and len(terms) == 5
    assert shown.joint == "a" and shown.verdict == (
        "It begins to slip (breaks away) at 6.4 N.m along +q and 5.6 N.m along -q. Before that it yields with 1e+05 +- 4e+02 "
        "N.m/rad (1.2e+05 at the beginning of a branch), with a hysteresis 3e-05 rad wide."
    )
    assert shown.curve.standard_error[shown.curve.velocity > 0] == pytest.approx(0.05)
    assert shown.curve.standard_error[shown.curve.velocity < 0] == pytest.approx(0.04)
    # friction that would push is none
    pulled, _ = identified(monkeypatch, replace(FOUND, rest=7.0))
    assert pulled.law.rate.values()["coulomb_positive"] == 0.0
    pulled, _ = identified(monkeypatch, replace(FOUND, rest=-7.0))
    assert pulled.law.rate.values()["coulomb_negative"] == 0.0


def test_what_the_encoder_does_not_resolve_is_a_bound(monkeypatch):
    coarse = replace(FOUND, stiffness=None, tangent=None, width=NAN, area=NAN, count=2e-5)
    got, shown = identified(monkeypatch, coarse, unit="m")
    terms = {k: (e.value, e.unit) for k, e in got.dynamics.items()}
    assert terms == {"offset": (0.1, "N"), "presliding_stiffness_bound": (7e4, "N/m")}
    assert shown.verdict == (
        "It begins to slip (breaks away) at 6.4 N along +q and 5.6 N along -q. The displacement before that is below the "
        "encoder's resolution; the presliding stiffness is at least 7e+04 N/m."
    )
    assert got.warnings[0].startswith(
        "Joint 'a': before break-away it moves by 4 counts of 2e-05 m, which is below"
    )
    plain, shown = identified(monkeypatch, replace(FOUND, tangent=None, width=0.9e-6))
    assert set(plain.dynamics) == {"offset", "presliding_stiffness", "hysteresis_width", "hysteresis_area"}
    assert shown.verdict.endswith("yields with 1e+05 +- 4e+02 N.m/rad.")


def test_a_direction_that_did_not_break_away_is_bounded_by_the_largest_torque(monkeypatch):
    got, shown = identified(monkeypatch, replace(FOUND, break_away=(None, (-5.5, 0.04))))
    assert got.at_bound == ("coulomb_positive",) and np.isnan(got.standard_errors["coulomb_positive"])
    assert got.law.rate.values()["coulomb_positive"] == pytest.approx(7.9)
    assert got.warnings == (
        "Joint 'a' did not break away along +q up to 8 N.m: the value given is a lower bound of its friction.",
    )
    assert "at more than 7.9 N.m along +q and 5.6 N.m along -q." in shown.verdict
    got, shown = identified(monkeypatch, replace(FOUND, break_away=(None, None)))
    assert got.at_bound == ("coulomb_positive", "coulomb_negative")
    assert (
        got.law.rate.values()["coulomb_negative"] == pytest.approx(7.6)
        and "up to -7.5 N.m" in got.warnings[1]
    )
    assert "and more than 7.6 N.m along -q" in shown.verdict and len(got.warnings) == 2


@pytest.mark.parametrize(
    ("apart", "error", "said"),
    [(0.17, 0.01, False), (0.19, 0.01, True), (-0.19, 0.01, True),
     (0.79, 0.2 / np.sqrt(2.0), False), (0.81, 0.2 / np.sqrt(2.0), True)],
)  # fmt: skip
def test_break_away_torques_that_differ_are_named(monkeypatch, apart, error, said):
    """By three hundredths of the smaller one, which is 6, and four standard errors."""
    up, down = (6.0 + apart, 6.0) if apart > 0 else (6.0, 6.0 - apart)
    found = replace(FOUND, rest=0.0, break_away=((up, error), (-down, error)))
    warnings = identified(monkeypatch, found)[0].warnings
    assert len(warnings) == said
    if said:
        assert warnings[0].startswith(f"Joint 'a': the break-away torques differ by {abs(apart):.3g} N.m;")


@pytest.mark.parametrize(("rest", "said"), [(0.17, False), (0.184, True), (-0.17, False), (-0.184, True)])
def test_a_torque_at_rest_is_named(monkeypatch, rest, said):
    """From three hundredths of the smaller break-away torque on, which is about 5.9 here."""
    found = replace(FOUND, rest=rest, break_away=((6.0 + rest, 0.1), (-6.0 + rest, 0.1)))
    warnings = identified(monkeypatch, found)[0].warnings
    assert len(warnings) == said
    assert not said or warnings[0].startswith(f"Joint 'a': the torque of {rest:.3g} N.m before the ramp")


def test_samples_and_the_loop_that_are_shown(monkeypatch):
    n = 5000
    t = np.arange(n) / RATE
    u = 8.0 * np.sin(2.0 * t)
    x = 1e-4 * np.sin(2.0 * t) + 2e-3 * np.clip(t - 2.0, 0.0, 1.0) + 0.7
    log = logged(u, x)
    got, shown = identified(monkeypatch, logs=[log, log.rows(slice(0, 3500))])
    v = np.gradient(x, 1.0 / RATE)
    slides = np.abs(v) > 0.002
    v, slides, u2, x2, t2 = (
        np.r_[z, z[:3500]][::3] for z in (v, slides, u, x, t)
    )  # 8500 samples, at most 4000 kept
    s = shown.samples
    assert np.array_equal(s.time, t2) and np.array_equal(s.position, x2)
    assert s.velocity[:-1] == pytest.approx(v[:-1])
    assert np.array_equal(s.torque, u2) and s.friction == pytest.approx(u2 - 0.1) and s.fitted.all()
    assert s.predicted[slides] == pytest.approx(np.where(v > 0, 6.4, -5.6)[slides] + 0.1)
    assert (
        np.isnan(s.predicted[~slides]).all() and 0.05 < slides.mean() < 0.9 and s.fitted.size == s.time.size
    )
    assert shown.presliding is not None
    assert shown.presliding == pytest.approx(np.column_stack([x2 - 0.7, u2]))
    exact = log.rows(slice(0, 4000))
    assert identified(monkeypatch, logs=[exact])[1].samples.time.size == 4000
    assert len(identified(monkeypatch, logs=[exact])[1].presliding) == 4000
    assert got.joint.torque_unit == "N.m"
