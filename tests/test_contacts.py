"""Bands and contacts by free motion: on noise whose truth is known, on one joint and several, and from the command line."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import genpareto

from backdrive import Joint, Log, identify
from backdrive.cli import main
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.external import ForceEstimate, JointForce, estimate_force
from backdrive.external.calibrate import calibrate
from backdrive.external.contacts import mark_contacts, score, thresholds_of, with_contacts
from backdrive.external.tail import clusters, tail

DT = 0.01
REST = 3.0  # half the band at rest


def noise(n, rng, smooth=20, heavy=False):
    """Return coloured noise of standard deviation 1, whose tail is Gaussian or that of Student's t."""
    white = rng.standard_t(3, n + smooth) if heavy else rng.standard_normal(n + smooth)
    x = np.convolve(white, np.ones(smooth) / np.sqrt(smooth), "valid")[:n]
    return x / x.std()


def force(seconds, rng, name="j1", sigma=0.2, push=None, heavy=False, states=True):
    """Return an estimate as an estimator makes it: in motion noise, every tenth second reversing with three times the noise."""
    n = round(seconds / DT)
    t = np.arange(n) * DT
    state = np.where((t % 10.0 < 1.0) & states, 1, np.where((t % 50.0 > 48.0) & states, 2, 0)).astype(np.int8)
    x = sigma * noise(n, rng, heavy=heavy) * np.where(state == 1, 3.0, 1.0)
    x = x if push is None else x + push(t)
    return JointForce(
        joint=Joint(name=name),
        time=t,
        force=x,
        friction=np.zeros(n),
        lower=np.where(state == 2, x - REST, np.nan),
        upper=np.where(state == 2, x + REST, np.nan),
        state=state,
        method="momentum",
        bandwidth=60.0,
        lag=0.02,
    )


def calibrated(names, seconds, rng, push=None, **how):
    """Return an estimate of some joints with bands by free motion, not yet with contacts."""
    bands = {name: calibrate([force(seconds, rng, name, **how)]) for name in names}
    joints = tuple(bands[name].apply(force(600.0, rng, name, push=push)) for name in names)
    return ForceEstimate(joints=joints, calibrations=bands)


def test_faster_than_the_free_motion_a_band_is_wider_with_the_square_of_the_speed():
    rng = np.random.default_rng(8)
    slow, fast = (force(600.0, rng) for _ in range(2))
    bands = calibrate([replace(slow, speed=np.full(slow.time.size, 2.0))])
    speed = np.where(fast.time < 300.0, 1.0, 3.0)
    wide, usual = bands.apply(replace(fast, speed=speed)), bands.apply(fast)
    ratio = (wide.upper - wide.lower) / (usual.upper - usual.lower)
    assert ratio == pytest.approx(np.where((speed > 2.0) & (fast.state != 2), 2.25, 1.0))
    (sentence,) = bands.faster(wide)
    assert "'j1' reaches 3 rad/s" in sentence and "only 2 rad/s. In 50 %" in sentence
    other = bands.apply(
        replace(fast, speed=speed), np.full(speed.size, 2.0)
    )  # a joint of an arm, of which another is faster
    ratio = (other.upper - other.lower) / (usual.upper - usual.lower)
    assert ratio == pytest.approx(np.where(fast.state != 2, 4.0, 1.0))
    assert bands.faster(usual) == bands.faster(replace(fast, speed=np.minimum(speed, 2.0))) == []


def test_bands_hold_their_share_of_unseen_motion_and_state_their_error():
    rng = np.random.default_rng(1)
    bands = calibrate([force(1000.0, rng), force(1000.0, rng)])
    for band, sigma, state in ((bands.moving, 0.2, 0), (bands.reversing, 0.6, 1)):
        assert band.half_width == pytest.approx(1.96 * sigma, rel=0.05)
        assert band.interval[0] <= band.half_width <= band.interval[1] < 1.3 * band.half_width
        assert band.samples / 40 < band.events < band.samples / 4  # 20 samples are alike, in the tail fewer
        assert 0.85 < band.held_out[0] <= 0.95 <= band.held_out[1] <= 1.0
        other = bands.apply(force(1000.0, rng))
        assert 0.93 < np.mean(~other.outside[other.state == state]) < 0.97
    rest = other.state == 2
    assert np.allclose((other.upper - other.lower)[rest], 2.0 * REST)
    assert bands.remarks() == []


def test_few_events_widen_a_band_and_are_remarked_on():
    rng = np.random.default_rng(2)
    short, long = calibrate([force(12.0, rng)]), calibrate([force(2000.0, rng)])
    spread = [b.moving.interval[1] / b.moving.interval[0] for b in (short, long)]
    assert spread[0] > spread[1] and short.reversing.events < 20.0
    assert any("reversing" in line and "independent events" in line for line in short.remarks())
    steady = calibrate([force(100.0, rng, states=False)])
    assert steady.reversing is None and "does not contain this state" in steady.remarks()[0]
    used = steady.apply(force(20.0, rng))
    assert np.allclose((used.upper - used.lower)[used.state == 1], 2.0 * steady.moving.half_width)


def test_free_motion_of_another_kind_is_refused():
    rng = np.random.default_rng(3)
    one = force(50.0, rng)
    for other in (replace(one, bandwidth=20.0), replace(one, method="kalman"), force(50.0, rng, "j2")):
        with pytest.raises(InvalidInput, match="one joint"):
            calibrate([one, other])
        with pytest.raises(InvalidInput, match="same joint, method and bandwidth"):
            calibrate([one]).apply(other)
    with pytest.raises(InvalidInput):
        calibrate([])
    still = replace(one, state=np.full(one.time.size, 2, dtype=np.int8))
    with pytest.raises(InvalidInput, match="free"):
        calibrate([still])


@pytest.mark.parametrize("shape", [-0.2, 0.0, 0.3])
def test_a_level_is_passed_at_about_its_rate(shape):
    rng = np.random.default_rng(4)
    passed = []
    for _ in range(20):
        z, t = np.full(20_000, -1.0), np.arange(20_000) * 1.0
        z[::50] = genpareto.rvs(shape, size=400, random_state=rng)
        found = tail([(z, t)], 20_000.0, 0.25)
        level = found.level(1.0 / 20_000.0)
        low, high = found.interval(1.0 / 20_000.0)
        assert low <= level <= 1.5 * high and found.peaks >= 100
        passed.append(400 * genpareto.sf(level, shape))
    assert 0.3 < np.mean(passed) < 2.0


def test_groups_are_apart_in_time_and_few_peaks_are_no_tail():
    t = np.array([0.0, 0.1, 0.2, 0.3, 1.0, 1.1, 1.2])
    z = np.array([2.0, 0.0, 2.0, 0.0, 3.0, np.nan, 0.0])
    assert clusters(z, t, 1.0, 0.25).tolist() == [[0, 3], [4, 5]]
    assert clusters(z, t, 1.0, 0.15).tolist() == [[0, 1], [2, 3], [4, 5]]
    assert clusters(z, t, 5.0, 0.15).size == 0
    with pytest.raises(NotIdentifiable, match="peaks"):
        tail([(np.ones(50), np.arange(50.0))], 50.0, 0.25)


def test_every_threshold_beyond_the_free_motion_is_named():
    rng = np.random.default_rng(12)
    short = with_contacts(calibrated(["j1", "j2"], 60.0, rng, heavy=True), 0.1)
    (line,) = [one for one in short.remarks if "hardly determines these thresholds" in one]
    for t in short.thresholds:
        poor = t.bands > 3.0 * t.highest or t.interval[1] > 2.0 * t.interval[0]
        assert (f"'{t.joint}' {t.state}: {t.bands:.3g} bands" in line) == bool(t.peaks and poor)
        above = f"likely between {t.interval[0]:.3g} and {t.interval[1]:.3g}, and the threshold deliberately above"
        if t.peaks and poor and t.bands > t.interval[1]:
            assert above in line
    long = with_contacts(calibrated(["j1"], 7200.0, rng), 1.0)
    assert not any("hardly determines" in one for one in long.remarks)


def test_a_push_is_a_contact_with_its_joint_sign_and_time():
    rng = np.random.default_rng(5)

    def push(t):
        return np.where((t > 102.0) & (t < 103.0), -4.0, 0.0) + np.where((t > 305.0) & (t < 306.0), 3.0, 0.0)

    estimate = with_contacts(calibrated(["j1"], 3600.0, rng, push), 1.0)
    assert [c.joints for c in estimate.contacts] == [("j1",), ("j1",)]
    first, second = estimate.contacts
    assert (first.begin, first.end) == (pytest.approx(102.0, abs=0.05), pytest.approx(103.0, abs=0.05))
    assert first.forces["j1"] == pytest.approx(-4.0, abs=0.8) and second.forces["j1"] > 2.0
    one = estimate.joint("j1")
    assert one.contact.sum() == pytest.approx(200, abs=10)
    assert {t.state for t in estimate.thresholds} == {"moving", "reversing", "rest"}
    assert all(t.bands >= 1.0 and t.interval[0] <= t.interval[1] for t in estimate.thresholds)


def test_joints_share_the_false_alarms_and_a_push_on_two_is_one_contact():
    rng = np.random.default_rng(6)

    def push(t):
        return np.where((t > 102.0) & (t < 103.0), 5.0, 0.0)

    pair = with_contacts(calibrated(["j1", "j2"], 3600.0, rng, push), 1.0)
    assert [set(c.joints) for c in pair.contacts] == [{"j1", "j2"}]
    alone = thresholds_of(pair.calibrations["j1"], 1.0)
    assert pair.thresholds[0].bands > alone[0].bands
    again = mark_contacts(replace(pair, contacts=None), pair.thresholds)
    assert again.contacts == pair.contacts


def test_heavy_tails_need_more_bands_and_keep_the_rate():
    rng = np.random.default_rng(7)
    plain = thresholds_of(calibrate([force(7200.0, rng)]), 1.0)
    bands = calibrate([force(7200.0, rng, heavy=True)])
    heavy = thresholds_of(bands, 1.0)
    assert heavy[0].bands > 1.5 * plain[0].bands > 1.5
    unseen = ForceEstimate(joints=(bands.apply(force(7200.0, rng, heavy=True)),))
    assert len(mark_contacts(unseen, heavy).contacts) <= 8


def test_what_free_motion_cannot_support_is_said():
    rng = np.random.default_rng(8)
    short = with_contacts(calibrated(["j1"], 300.0, rng), 1.0)
    assert any("too short" in line and "extrapolated" in line for line in short.remarks)
    assert max(t.extrapolation for t in short.thresholds if np.isfinite(t.extrapolation)) > 12.0
    with pytest.raises(NotIdentifiable, match="free"):
        with_contacts(ForceEstimate(joints=(force(50.0, rng),)), 1.0)
    with pytest.raises(NotIdentifiable, match="too few peaks"):
        with_contacts(calibrated(["j1"], 3.0, rng), 1.0)


def test_at_rest_the_score_counts_the_friction_interval():
    rng = np.random.default_rng(9)
    one = force(100.0, rng)
    held = replace(one, force=np.where(one.state == 2, 0.5 * REST, one.force))
    held = calibrate([force(600.0, rng)]).apply(
        replace(
            held,
            lower=np.where(one.state == 2, -0.5 * REST, np.nan),
            upper=np.where(one.state == 2, 1.5 * REST, np.nan),
        )
    )
    assert score(held)[held.state == 2] == pytest.approx(0.5)


M, F, B = 0.8, 3.0, 1.5


def motion(seconds, seed, push=0.0, top=1.0):
    """Return a log of a joint with smooth Coulomb and viscous friction, pushed from 4 s to 6 s."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 2e-3)
    w, A = 2.0 * np.pi * top * np.array([0.31, 0.7, 1.3]), np.array([0.5, 0.3, 0.15])
    phase = w * t[:, None] + rng.uniform(0.0, 6.0, 3)
    q, dq, ddq = np.sin(phase) @ A, np.cos(phase) @ (A * w), -np.sin(phase) @ (A * w**2)
    pushed = np.where((t > 4.0) & (t < 6.0), push, 0.0)
    tau = M * ddq + F * np.tanh(dq / 0.02) + B * dq + 0.05 * rng.standard_normal(t.size) - pushed
    return Log(time=t, position=q[:, None], torque=tau[:, None], joints=(Joint(name="elbow"),))


@pytest.fixture(scope="module")
def model():
    return identify(motion(20.0, 1)).model


def test_the_estimate_calibrates_itself_by_logs_of_free_motion(model):
    free = [motion(120.0, 2), motion(60.0, 3, top=0.8)]
    found = estimate_force(model, motion(10.0, 4, push=5.0), free=free, false_alarms=1.0)
    one, bands = found.joint("elbow"), found.calibrations["elbow"]
    assert bands.method == one.method and bands.bandwidth == one.bandwidth >= 60.0
    assert bands.duration == pytest.approx(180.0, rel=0.02)
    assert [c.joints for c in found.contacts] == [("elbow",)]
    assert found.contacts[0].begin == pytest.approx(4.0, abs=0.1)
    unseen = estimate_force(model, motion(60.0, 5), free=free, method=one.method, bandwidth=one.bandwidth)
    assert unseen.contacts is None and unseen.joint("elbow").outside.mean() < 0.08
    same = estimate_force(model, free[0], method=one.method, bandwidth=one.bandwidth)
    assert same.calibrations == {} and same.joints[0].contact is None


def test_what_contacts_need_is_asked_for(model):
    log = motion(10.0, 6)
    with pytest.raises(NotIdentifiable, match="free"):
        estimate_force(model, log, false_alarms=1.0)
    for wrong in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InvalidInput, match="false contacts"):
            estimate_force(model, log, free=[motion(10.0, 7)], false_alarms=wrong)
    other = motion(10.0, 8).replace(joints=(Joint(name="wrist"),))
    with pytest.raises(InvalidInput, match="no log of free motion"):
        estimate_force(model, log, free=[other])


def test_the_command_lists_contacts_and_writes_a_report(model, tmp_path, monkeypatch, capsys):
    model.save(tmp_path / "m.json")
    for name, log in (("push", motion(10.0, 9, push=-5.0)), ("free", motion(120.0, 10))):
        np.savez(tmp_path / f"{name}.npz", t=log.time, q=log.position[:, 0], tau=log.torque[:, 0])

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["backdrive", "estimate", *(str(w) for w in words)])
        with pytest.raises(SystemExit) as stopped:
            main()
        captured = capsys.readouterr()
        return stopped.value.code or 0, captured.out + captured.err

    start = [tmp_path / "m.json", tmp_path / "push.npz", "--names", "elbow"]
    calibration = ["--free", tmp_path / "free.npz", "--contact"]
    code, out = run(*start, *calibration, "-o", tmp_path / "f.csv", "--report", tmp_path / "r.html")
    assert (
        code == 0 and "1 contact, at thresholds for a false-alarm rate of 1/h" in out and "too short" in out
    )
    head, *rows = (tmp_path / "f.csv").read_text().splitlines()
    assert head.endswith("elbow_state,elbow_contact") and {r.rsplit(",", 1)[1] for r in rows} == {"0", "1"}
    text = (tmp_path / "r.html").read_text()
    assert (
        "1 contact" in text and text.index("Remarks") < text.index('<svg viewBox="0 0 3') and "//" not in text
    )
    code, out = run(*start, *calibration, "--false-alarms", "0.5", "--json")
    told = json.loads(out)
    assert code == 0 and told["false_alarms_per_hour"] == 0.5 and len(told["thresholds"]) == 3
    assert told["contacts"][0]["joints"] == ["elbow"] and told["contacts"][0]["forces"]["elbow"] < -4.0
    assert told["joints"]["elbow"]["calibration"]["moving"]["events"] > 20
    code, out = run(*start, "--contact")
    assert code != 0 and "--free" in out
    code, out = run(*start, "--false-alarms", "2")
    assert code != 0 and "--contact" in out
    code, out = run(*start, *calibration, "--report", tmp_path / "push.npz")
    assert code != 0 and "push.npz" in out
