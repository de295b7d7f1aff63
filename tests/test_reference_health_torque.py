"""Torques at their limit, silent torques and dead channels: by hand, and from both sides of every threshold."""

import numpy as np
import pytest

from _health import about, log_of, named
from backdrive.logs.health import gate, saturation, silent_torque, stuck
from backdrive.logs.health._exam import Exam
from backdrive.logs.resolution import white_noise

N = 2000
T = 1e-3 * np.arange(N)


def noise(n=N, seed=3):
    """Between -1 and 1, never the same twice."""
    return np.random.default_rng(seed).uniform(-1.0, 1.0, n)


def put(x, *runs):
    """Return a copy with values held: (row, length, value)."""
    x = np.array(x)
    for row, length, value in runs:
        x[row : row + length] = value
    return x


# ------------------------------------------------------------------------------------------- saturation


def limits(x, channel="torque", moving=False, unit="rad"):
    position = np.sin(3.0 * T[: x.size]) if moving else np.full(x.size, 0.5)
    return saturation.find(Exam(log_of(x.size, unit=unit, position=position, **{channel: x})))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("runs", "near", "found"),
    [
        ([9], 0, False),
        ([10], 0, True),
        ([5, 5], 0, True),
        ([4, 4, 4, 4, 4], 0, False),
        ([20], 5, True),
        ([20], 6, False),
        ([1, 12, 7], 5, True),
        ([1, 12, 7], 6, False),
    ],
)
def test_a_limit_is_ten_samples_five_in_a_row_and_four_times_those_just_below(side, runs, near, found):
    """The joint stands, so that only the counts tell; just below is a fiftieth of the range, here 0.06."""
    x, row, rows = noise(), 100, []
    for length in runs:
        x[row : row + length] = 2.0
        rows += range(row, row + length)
        row += 100
    x[1500 : 1500 + 2 * near : 2] = 2.0 - 0.02 * 3.0 * np.linspace(0.1, 0.97, near)
    x[1800:1830:2] = 2.0 - 0.02 * 3.0 * np.linspace(1.05, 1.5, 15)  # further below are more
    x[0] = -1.0
    got = limits(side * x)
    assert bool(got) is found
    if found:
        (finding,) = got
        assert about(finding) == ("j0", "torque", "warn", 2.0 * side, rows, False)
        end = "upper" if side > 0 else "lower"
        assert (
            finding.sentence
            == f"torque of j0 is flat at its {end} end, {2 * side:.4g} N.m, for {len(rows)} samples."
        )


@pytest.mark.parametrize(("steps", "found"), [(3, False), (4, True)])
def test_just_below_is_three_and_a_half_steps_of_a_coarse_channel(steps, found):
    """The range is 12 steps, of which a fiftieth is none."""
    x = np.rint(4.0 * noise())
    x[(x > 3.5) | (x < -3.5)] = 1.0
    x = put(x, (100, 12, 8.0), (500, 6, 8.0 - steps), (1, 1, -4.0))
    x[510:530:3] = 8.0 - steps
    assert bool(limits(0.5 * x)) is found


@pytest.mark.parametrize(("longest", "found"), [(7, False), (8, True)])
def test_eight_in_a_row_are_a_limit_where_the_torque_is_lively_and_the_joint_moves(longest, found):
    x = put(noise(), (100, longest, 2.0), (300, 5, 2.0), (400, 4, 2.0))
    x[500:1000:2] = 1.99  # far more just below
    assert bool(limits(x, moving=True)) is found
    assert not limits(x, moving=False)


def test_the_longest_stretch_at_the_limit_has_to_be_one_of_motion():
    x = put(noise(), (100, 12, 2.0), (1200, 20, 2.0))
    x[500:1000:2] = 1.99
    for rest, found in ((100, True), (1200, False)):
        q = np.sin(3.0 * T)
        q[rest - 5 : rest + 25] = q[rest - 5]
        assert bool(saturation.find(Exam(log_of(position=q, torque=x)))) is found


@pytest.mark.parametrize(("spread", "found"), [(1.45, False), (1.55, True)])
def test_a_torque_is_lively_where_its_neighbours_differ_by_one_and_a_half_steps(spread, found):
    """Whole steps at random among pauses, as many as bring their standard deviation so close."""
    generator = np.random.default_rng(8)
    steps, dice = generator.integers(0, 5, N), generator.random(N)
    tried = [put(np.where(dice < share, steps, 2.0), (100, 10, 5.0)) for share in np.linspace(0.05, 1.0, 200)]
    x = min(tried, key=lambda x: abs(np.std(np.diff(x)) - spread))
    assert np.std(np.diff(x)) == pytest.approx(spread, abs=0.03) and np.count_nonzero(x == 4.0) > 10
    assert bool(limits(0.25 * x, moving=True)) is found


def test_both_ends_and_both_channels_are_looked_at_but_no_constant_and_no_zero():
    x = put(noise(), (100, 20, 2.0), (300, 30, -1.5))
    found = limits(x, "drive_input", unit="m")
    assert [(f.channel, f.value, f.where.size) for f in found] == [
        ("drive_input", 2.0, 20),
        ("drive_input", -1.5, 30),
    ]
    assert "flat at its upper end, 2 of the drive input's unit, for 20 samples" in found[0].sentence
    assert "flat at its lower end, -1.5 N, for 30" in limits(x, unit="m")[1].sentence
    assert limits(np.full(N, 2.0)) == []
    assert limits(put(noise() + 1.0, (100, 30, 0.0))) == []  # one way only, and off
    assert limits(put(noise(), (100, 30, np.nan))) == []
    two = log_of(position=np.full((N, 2), 0.5), torque=np.column_stack([noise(), x]))
    assert [f.joint for f in saturation.find(Exam(two))] == ["j1", "j1"]


# ----------------------------------------------------------------------------------------- silent torque


def test_a_torque_of_nothing_but_zeros_spoils_and_a_drive_input_warns():
    q = np.column_stack([np.sin(3.0 * T)] * 3)
    x = np.column_stack([noise(), np.zeros(N), np.full(N, 3.0)])
    found = silent_torque.find(Exam(log_of(position=q, torque=x, drive_input=x)))
    assert [about(f) for f in found] == [
        ("j1", "torque", "spoils", 0.0, None, False),
        ("j1", "drive_input", "warn", 0.0, None, False),
    ]
    assert found[0].sentence == "torque of j1 is zero throughout."
    assert silent_torque.find(Exam(log_of(position=q))) == []
    for level in (-1.0, 1.0):  # it is at zero most of the time, but not throughout
        assert (
            silent_torque.find(Exam(log_of(position=np.full(N, 0.5), torque=put(np.zeros(N), (3, 2, level)))))
            == []
        )
    assert silent_torque.find(Exam(log_of(position=q[:, 0], torque=put(np.zeros(N), (3, 2, np.nan))))) == []


def test_stretches_of_zeros_are_silent_and_of_anything_else_stuck():
    x = put(noise(), (200, 30, 0.0), (600, 50, 0.4), (900, 21, 0.0), (1300, 25, -0.3))
    log = log_of(position=np.sin(3.0 * T), torque=x)
    (silent,) = silent_torque.find(Exam(log))
    rows = [*range(200, 230), *range(900, 921)]
    assert about(silent) == ("j0", "torque", "warn", 51, rows, False)
    assert "is exactly zero at 51 samples while the joint moves, first at sample 200." in silent.sentence
    (held,) = stuck.find(Exam(log))
    rows = [*range(601, 650), *range(1301, 1325)]
    assert about(held) == ("j0", "torque", "spoils", 50, rows, True)
    assert held.sentence == (
        "torque of j0 is frozen while the joint moves: 73 samples in 2 places. The longest is from sample 600 to 649."
    )
    mended = stuck.repair(Exam(log), [held])
    assert mended.rows.tolist() == np.delete(np.arange(N), rows).tolist()
    assert mended.log.notes == ("73 samples of frozen channels were dropped.",)
    # an external torque of zero is held like any other
    other = log_of(position=np.sin(3.0 * T), external_torque=put(noise(), (200, 30, 0.0)))
    assert stuck.find(Exam(other))[0].value == 30 and silent_torque.find(Exam(other)) == []


@pytest.mark.parametrize(
    ("length", "severity", "repairable"),
    [(21, "warn", True), (22, "spoils", True), (1000, "spoils", True), (1001, "spoils", False)],
)
def test_frozen_samples_spoil_from_a_hundredth_of_the_log_on_and_are_dropped_below_a_half(
    length, severity, repairable
):
    log = log_of(position=np.sin(9.0 * T), torque=put(noise(), (200, length, 0.4)))
    (found,) = stuck.find(Exam(log))
    assert (found.value, found.severity, found.repairable) == (length, severity, repairable)


# ------------------------------------------------------------------------------------------ dead channels


@pytest.mark.parametrize(
    ("channel", "level", "others", "severity", "other"),
    [
        ("torque", 2.5, ("position",), "spoils", "position"),
        ("torque", -2.5, ("velocity",), "spoils", "velocity"),
        ("torque", 2.5, ("position", "velocity"), "spoils", "position"),
        ("torque", 0.0, ("position",), None, None),
        ("drive_input", 0.5, ("position",), "note", "position"),
        ("drive_input", 0.0, ("position",), None, None),
        ("external_torque", 0.0, ("velocity",), "note", "velocity"),
        ("position", 0.25, ("velocity",), "spoils", "velocity"),
        ("position", 0.0, ("torque",), None, None),
        ("velocity", 0.25, ("position",), "spoils", "position"),
        ("velocity", 0.0, ("position",), "spoils", "position"),
        ("velocity", 0.25, ("torque",), None, None),
        ("second_encoder", 0.25, ("position",), "note", "position"),
        ("second_encoder", 0.25, ("velocity",), "note", "velocity"),
        ("second_encoder", 0.25, ("position", "velocity"), "note", "position"),
        ("load", 0.25, ("position",), None, None),
    ],
)
def test_a_channel_that_never_changes_is_dead_where_another_tells_of_motion(
    channel, level, others, severity, other
):
    arrays = {name: np.sin(3.0 * T) for name in others}
    log = log_of(**arrays, **{channel: np.full(N, level)})
    found = [f for f in stuck.find(Exam(log)) if f.channel == channel]
    assert len(found) == (severity is not None)
    if found:
        assert about(found[0]) == ("j0", channel, severity, level, None, channel == "velocity")
        assert found[0].sentence == f"{channel} of j0 is {level:.5g} throughout, while {other} changes."


@pytest.mark.parametrize(("span", "moves"), [(0.9e-3, False), (1.1e-3, True)])
def test_a_millirad_is_a_motion(span, moves):
    by_position = log_of(position=span * np.linspace(0.0, 1.0, N) ** 1.5, torque=np.full(N, 2.0))
    speed = span / T[-1] * (1.0 + 1e-6 * np.sin(np.arange(N) ** 2))
    for log in (by_position, log_of(velocity=speed, torque=np.full(N, 2.0))):
        assert bool(stuck.find(Exam(log))) is moves


@pytest.mark.parametrize(("counts", "moves"), [(10, False), (11, True)])
def test_and_more_than_ten_counts(counts, moves):
    q = 2.0**-7 * np.rint(counts * np.linspace(0.0, 1.0, N))
    assert bool(stuck.find(Exam(log_of(position=q, torque=np.full(N, 2.0))))) is moves


@pytest.mark.parametrize(("times", "moves"), [(0.95, False), (1.05, True)])
def test_and_six_times_what_the_noise_of_a_velocity_adds_up_to(times, moves):
    """A velocity that trembles from sample to sample adds up to nothing, but could to sqrt(n) times its noise."""
    tremble = 0.05 * (-1.0) ** np.arange(N)
    drift = times * 6.0 * np.sqrt(N) * 1e-3 * white_noise(tremble) / T[-1]
    assert bool(stuck.find(Exam(log_of(velocity=drift + tremble, torque=np.full(N, 2.0))))) is moves


@pytest.mark.parametrize(("pause", "moves"), [(7.0e-3, False), (7.4e-3, True)])
def test_a_path_is_reckoned_with_the_intervals_of_the_clock(pause, moves):
    """At 0.1 rad/s over 1998 intervals of 1.4 us and one pause: a millirad takes 10 ms."""
    time = 1.4e-6 * np.arange(N) + pause * (np.arange(N) > 1000)
    log = log_of(time=time, velocity=0.1 + 1e-9 * np.arange(N), torque=np.full(N, 2.0))
    assert bool(stuck.find(Exam(log))) is moves


def test_a_dead_velocity_is_left_out_and_frozen_rows_are_dropped_together():
    q = np.column_stack([np.sin(3.0 * T)] * 2)
    v = np.column_stack([3.0 * np.cos(3.0 * T), np.full(N, 0.2)])
    tau = np.column_stack([put(noise(), (200, 30, 0.4)), noise(seed=4)])
    log = log_of(position=q, velocity=v, torque=tau)
    assert [(f.joint, f.channel) for f in named(log, "stuck")] == [("j1", "velocity"), ("j0", "torque")]
    mended = gate(log, repair=True)
    assert mended.velocity is None and len(mended) == N - 29
    assert mended.notes == (
        "velocity was left out: it never changes while the joint moves.", "29 samples of frozen channels were dropped.",
    )  # fmt: skip
    alone = stuck.repair(Exam(log), [f for f in named(log, "stuck") if f.channel == "velocity"])
    assert alone.rows is None and len(alone.log) == N
