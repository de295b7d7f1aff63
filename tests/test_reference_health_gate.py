"""What the gate stops, says and mends; holes, plans, and joints that stand: by hand, and from both sides."""

import numpy as np
import pytest

from _health import about, log_of, named, smooth
from backdrive import Joint, Log, check
from backdrive.errors import UnhealthyLog
from backdrive.logs.health import (
    few_samples,
    gate,
    no_friction,
    no_motion,
    plan_mismatch,
    screen,
    torque_sign,
)
from backdrive.logs.health._exam import Exam
from backdrive.logs.health._finding import Finding, count_of, keep_rows, with_columns

N = 1000


def moving(n=N, **channels):
    """A log that nothing is the matter with."""
    t = 1e-3 * np.arange(n)
    return log_of(n, position=np.sin(3.0 * t), **channels)


def rough(n=N, seed=5):
    t = 1e-3 * np.arange(n)
    return 4.0 * np.sign(np.cos(3.0 * t)) + 0.2 * np.random.default_rng(seed).standard_normal(n)


def with_nan(x, rows):
    x = np.array(x, dtype=float)
    x[rows] = np.nan
    return x


# --------------------------------------------------------------------------------------------- findings


def test_a_finding_lists_a_thousand_rows_and_counts_all():
    finding = Finding(
        name="nan",
        severity="warn",
        sentence="s",
        remedy="r",
        value=2,
        joint="j",
        channel="torque",
        where=np.arange(5, 1006),
    )
    assert finding.to_dict() == {
        "name": "nan", "joint": "j", "channel": "torque", "severity": "warn", "sentence": "s", "remedy": "r", "value": 2.0,
        "count": 1001, "where": list(range(5, 1005)), "repairable": False,
    }  # fmt: skip
    whole = Finding(name="nan", severity="warn", sentence="s", remedy="r", value=2).to_dict()
    assert (whole["count"], whole["where"], whole["joint"], whole["channel"]) == (None, None, None, None)


def test_rows_are_kept_by_mask_or_index_and_columns_replaced():
    log = log_of(5, position=np.arange(10.0).reshape(5, 2), torque=-np.arange(10.0).reshape(5, 2)).with_note(
        "before"
    )
    mask = keep_rows(log, np.array([True, False, True, True, False]), "kept")
    assert mask.rows.tolist() == [0, 2, 3] and mask.log.time == pytest.approx([0.0, 2e-3, 3e-3])
    assert mask.log.position.tolist() == [[0, 1], [4, 5], [6, 7]] and mask.log.torque.tolist() == [
        [0, -1],
        [-4, -5],
        [-6, -7],
    ]
    assert mask.log.notes == ("before", "kept")
    index = keep_rows(log, np.array([4, 0]), "turned")
    assert index.rows.tolist() == [4, 0] and index.log.position.tolist() == [[8, 9], [0, 1]]
    other = with_columns(log, {("position", 1): np.full(5, 7.0), ("torque", 0): np.ones(5)}, ["a", "b"])
    assert other.position.tolist() == [[0, 7], [2, 7], [4, 7], [6, 7], [8, 7]]
    assert other.torque.tolist() == [[1, -1], [1, -3], [1, -5], [1, -7], [1, -9]]
    assert other.notes == ("before", "a", "b") and log.position[0, 1] == 1.0
    assert [count_of(k, "run") for k in (0, 1, 2)] == ["0 runs", "1 run", "2 runs"]


# --------------------------------------------------------------------------------------------- the gate


def test_the_gate_stops_what_could_be_mended_unless_it_is_asked_to_mend():
    log = moving(torque=with_nan(rough(), [500]))
    for stop in (gate, screen):
        with pytest.raises(UnhealthyLog) as stopped:
            stop(log)
        said = stopped.value.message
        assert (
            "The log would spoil the result: [nan] torque of j0 is NaN at 1 of 1000 samples, first at sample 500."
            in said
        )
        assert "more." not in said
        assert stopped.value.remedy == "Use --repair, or --accept nan to continue anyway."
        (told,) = stopped.value.data["findings"]
        assert (told["name"], told["where"]) == ("nan", [500])
    assert len(gate(log, repair=True)) == len(screen(log, repair=True)[0]) == 999


@pytest.mark.parametrize(("joints", "words"), [(4, ""), (5, " And 1 more."), (7, " And 3 more.")])
def test_four_findings_are_told_and_the_others_counted(joints, words):
    t = 1e-3 * np.arange(N)
    q = np.sin(3.0 * t)[:, None] * np.ones(joints)
    log = log_of(N, position=q, torque=with_nan(np.ones((N, joints)) * rough()[:, None], 7))
    with pytest.raises(UnhealthyLog) as stopped:
        gate(log)
    said = stopped.value.message
    assert said.count("[nan]") == 4 and "torque of j3" in said and "torque of j4" not in said
    assert ("more." in said) is bool(words) and words in said
    assert len(stopped.value.data["findings"]) == joints


def test_a_remedy_offers_repair_only_where_all_can_be_mended():
    dead = with_nan(rough(), slice(None))
    log = moving(torque=dead, velocity=with_nan(3.0 * np.cos(3e-3 * np.arange(N)), [3]))
    assert {f.channel: f.repairable for f in named(log, "nan")} == {"torque": False, "velocity": True}
    with pytest.raises(UnhealthyLog) as stopped:
        gate(log)
    assert stopped.value.remedy == "Use --accept nan to continue anyway."
    with pytest.raises(UnhealthyLog) as stopped:
        gate(log, repair=True)
    assert (
        stopped.value.remedy == "Use --accept nan to continue anyway."
        and len(stopped.value.data["findings"]) == 1
    )
    jumped = np.sin(3e-3 * np.arange(N)) + (np.arange(N) > 700)
    with pytest.raises(UnhealthyLog) as stopped:
        gate(log_of(N, position=jumped, torque=with_nan(rough(), [5])))
    assert stopped.value.remedy == "Use --accept nan --accept position-jump to continue anyway."


def test_what_warns_is_handed_on_unless_it_was_accepted_or_mended():
    tau = rough()
    tau[400] += 5.0  # worth a word, not twice the range of the others
    time = 1e-3 * np.arange(N)
    time[600:] += 0.1
    log = log_of(N, time=time, position=np.sin(3.0 * time), torque=tau).with_note("read")
    assert {f.name: (f.severity, f.repairable) for f in check(log)} == {
        "gaps": ("warn", False),
        "outlier": ("warn", True),
    }
    kept, left = screen(log)
    assert kept is log and [f.name for f in left] == ["gaps", "outlier"]
    kept, left = screen(log, accept=["gaps"])
    assert kept is log and [f.name for f in left] == ["outlier"]
    kept, left = screen(log, repair=True)
    assert [f.name for f in left] == ["gaps"] and abs(kept.torque[400, 0]) < 5.0
    assert kept.notes == ("read", "torque of j0: 1 outlier replaced by the mean of the neighbours.")
    kept, left = screen(log, accept=["outlier"], repair=True)
    assert [f.name for f in left] == ["gaps"] and kept.torque[400, 0] == tau[400] and kept.notes == ("read",)


def test_what_spoils_and_is_accepted_is_noted():
    log = moving(torque=with_nan(rough(), [3, 4])).with_note("read")
    kept, left = screen(log, accept=["nan"], repair=True)
    (found,) = named(log, "nan")
    assert kept.notes == ("read", f"Accepted [nan]: {found.sentence}") and left == [] and len(kept) == N


def test_rows_are_those_of_the_log_as_it_was_given_after_two_repairs():
    """Two rows dropped, then all sorted: what is named behind is at its old place, in order."""
    n = 2000
    order = np.arange(n)
    order[[1500, 1501]] = order[[1501, 1500]]
    q = smooth(n)
    tau = np.linspace(0.0, 1.0, n) ** 1.5
    tau[1501] += 9.0
    tau[1900] -= 9.0
    log = log_of(n, position=q, torque=tau).rows(order)
    torque = log.torque.copy()
    torque[[40, 50]] = np.nan
    velocity = np.gradient(q, 1e-3)[order]
    velocity[70] = np.inf
    found = {
        f.name: f.where.tolist()
        for f in check(log.replace(torque=torque, velocity=velocity))
        if f.where is not None
    }
    assert found == {"nan": [40, 50], "infinite": [70], "unsorted-time": [1501], "outlier": [1500, 1900]}


def test_below_twenty_samples_nothing_else_is_looked_at():
    short = log_of(19, position=with_nan(smooth(19), [2]))
    (found,) = check(short)
    assert about(found) == (None, None, "spoils", 19, None, False)
    assert found.sentence == "The log has 19 samples; at least 20 are needed."
    assert [f.sentence for f in few_samples.find(Exam(log_of(0, position=np.zeros(0))))] == [
        "The log is empty."
    ]
    assert "1 sample;" in few_samples.find(Exam(log_of(1, position=np.zeros(1))))[0].sentence
    # and so it is where a repair leaves fewer: 31 samples, of which some are dropped
    for holes, looked in ((11, True), (12, False)):
        log = log_of(31, position=with_nan(np.zeros(31), slice(0, holes)))
        assert [f.name for f in check(log)] == (["nan", "no-motion"] if looked else ["nan"])


# -------------------------------------------------------------------------------------------------- holes


@pytest.mark.parametrize(
    ("hole", "name", "word"),
    [(np.nan, "nan", "NaN"), (np.inf, "infinite", "infinite"), (-np.inf, "infinite", "infinite")],
)
def test_holes_in_the_clock(hole, name, word):
    for count, repairable in ((1, True), (499, True), (500, False)):
        time = 1e-3 * np.arange(N)
        time[200 : 200 + count] = hole
        log = log_of(N, time=time, position=smooth(N))
        (found,) = named(log, name)
        assert about(found) == (None, None, "spoils", count, list(range(200, 200 + count)), repairable)
        many = "1 sample" if count == 1 else f"{count} samples"
        assert found.sentence == f"The clock is {word} at {many}, first at sample 200."
    time = 1e-3 * np.arange(N)
    time[[0, 999]] = hole
    mended = gate(log_of(N, time=time, position=smooth(N)), repair=True)
    assert mended.time == pytest.approx(1e-3 * np.arange(1, 999)) and mended.notes == (
        f"2 samples with {name} were dropped.",
    )


@pytest.mark.parametrize(
    ("channel", "others", "repairable"),
    [
        ("torque", ("position",), False),
        ("position", ("torque",), False),
        ("velocity", ("torque",), False),
        ("position", ("velocity",), True),
        ("velocity", ("position",), True),
        ("load", ("position",), True),
        ("reference", ("position", "torque"), True),
        ("drive_input", ("position",), True),
    ],
)
def test_a_channel_of_holes_is_left_out_where_it_can_be_done_without(channel, others, repairable):
    arrays = {name: smooth(N) for name in others}
    log = log_of(N, **arrays, **{channel: with_nan(smooth(N), slice(499, None))})
    (found,) = named(log, "nan")
    assert about(found) == ("j0", channel, "spoils", 501, list(range(499, N)), repairable)
    assert found.sentence == f"{channel} of j0 is NaN at 501 of 1000 samples, first at sample 499."
    assert found.remedy.startswith("Leave the channel out")
    if repairable:
        mended = gate(log, accept=["stuck"], repair=True)
        assert getattr(mended, channel) is None and len(mended) == N
        assert mended.notes[0] == f"{channel} was left out: it is mostly nan."
    few = log_of(
        N, **arrays, **{channel: with_nan(smooth(N), slice(500, None))}
    )  # half of it is damaged, not empty
    (found,) = named(few, "nan")
    assert found.repairable and found.remedy.startswith("Drop those samples")


def test_without_a_clock_nothing_more_is_told():
    for hole, name in ((np.nan, "nan"), (np.inf, "infinite")):
        time = 1e-3 * np.arange(N)
        time[:700] = hole
        log = log_of(N, time=time, position=smooth(N))
        assert [f.name for f in check(log)] == [name]
        with pytest.raises(UnhealthyLog):
            gate(log, repair=True)
        time = 1e-3 * np.arange(N)
        time[7] = hole
        kept = gate(log.replace(time=time), accept=[name])
        assert len(kept) == N and kept.notes[0].startswith(f"Accepted [{name}]")


def test_holes_are_told_by_joint_and_one_empty_channel_leaves_the_rows_of_others_to_be_dropped():
    q = np.column_stack([smooth(N), with_nan(smooth(N), [9, 10]), with_nan(smooth(N), [11])])
    load = np.column_stack([with_nan(smooth(N), slice(0, 700)), smooth(N), with_nan(smooth(N), [800])])
    log = log_of(N, position=q, load=load)
    assert [(f.joint, f.channel, f.value) for f in named(log, "nan")] == [
        ("j1", "position", 2), ("j2", "position", 1), ("j0", "load", 700), ("j2", "load", 1),
    ]  # fmt: skip
    mended = gate(log, repair=True)
    assert mended.load is None and len(mended) == N - 3
    assert mended.notes[:2] == ("load was left out: it is mostly nan.", "3 samples with nan were dropped.")


# -------------------------------------------------------------------------------------- plans and standstill


class Plan:
    stroke, duration = 2.0, 4.0


class Stroke:
    stroke = 2.0


class Duration:
    duration = 4.0


def test_a_plan_is_compared_by_what_it_says():
    short = log_of(3000, position=0.5 * np.sin(np.linspace(0.0, 6.28, 3000)))
    time, stroke = plan_mismatch.find(Exam(short, Plan()))
    assert about(time) == (None, None, "warn", pytest.approx(2.999), None, False)
    assert time.sentence == "The log is 3.0 s long, its plan 4.0 s."
    assert about(stroke) == ("j0", "position", "warn", pytest.approx(1.0, rel=1e-5), None, False)
    assert stroke.sentence == "j0 moves over 1 rad, its plan over 2 rad."
    assert [f.joint for f in plan_mismatch.find(Exam(short, Stroke()))] == ["j0"]
    assert [f.joint for f in plan_mismatch.find(Exam(short, Duration()))] == [None]
    assert plan_mismatch.find(Exam(short)) == []
    assert len(plan_mismatch.find(Exam(short.replace(plan=Plan())))) == 2
    assert (
        plan_mismatch.find(Exam(short.replace(plan=Plan()), Duration()))[0].joint is None
    )  # the one given counts
    without = log_of(3000, velocity=np.sin(np.linspace(0.0, 6.28, 3000)))
    assert [f.joint for f in plan_mismatch.find(Exam(without, Plan()))] == [None]
    empty = log_of(3000, position=with_nan(np.zeros(3000), slice(None)))
    assert plan_mismatch.find(Exam(empty, Stroke()))[0].value == 0.0


def test_the_stroke_of_a_plan_is_that_of_the_nearest_of_all_joints():
    wave = np.sin(np.linspace(0.0, 2.0 * np.pi, 4001))
    log = log_of(4001, unit="m", position=np.column_stack([4.0 * wave, 1.3 * wave, 0.2 * wave]))
    (found,) = plan_mismatch.find(Exam(log, Plan()))
    assert (found.joint, found.value) == (
        "j1",
        pytest.approx(2.6),
    ) and "j1 moves over 2.6 m" in found.sentence
    holed = log_of(4001, position=np.column_stack([with_nan(0.5 * wave, 5), 1.5 * wave]))
    assert [f.joint for f in plan_mismatch.find(Exam(holed, Plan()))] == ["j1"]


def still():
    return np.full(N, 0.3)


def noise():
    return np.random.default_rng(1).standard_normal(N)


@pytest.mark.parametrize(
    ("position", "torque", "severities"),
    [
        ([still(), still()], [noise(), noise()], ["spoils", "spoils"]),
        ([still(), smooth(N)], [noise(), noise()], ["note"]),
        (
            [still(), still()],
            [noise(), np.linspace(0.0, 3.0, N)],
            ["note", "note"],
        ),  # a ramp that breaks nothing away
        ([still(), still()], [np.zeros(N), np.zeros(N)], ["spoils", "spoils"]),
        ([smooth(N), smooth(N)], [noise(), noise()], []),
    ],
)
def test_joints_that_stand_are_a_remark_while_another_moves_or_torque_is_applied(
    position, torque, severities
):
    log = log_of(N, position=np.column_stack(position), torque=np.column_stack(torque))
    found = no_motion.find(Exam(log))
    assert [f.severity for f in found] == severities
    for k, finding in enumerate(found):
        assert about(finding) == (f"j{k}", None, severities[k], 0.0, None, False)
        assert finding.sentence == f"j{k} does not move in this log."
        assert ("--joint" in finding.remedy) is (severities[k] == "note")


@pytest.mark.parametrize(("values", "moves"), [(1, False), (2, False), (3, True)])
@pytest.mark.parametrize("channel", ["position", "velocity"])
def test_a_joint_moves_if_it_has_three_places_or_speeds(values, moves, channel):
    log = log_of(N, **{channel: 0.1 * (np.arange(N) % values)})
    assert bool(no_motion.find(Exam(log))) is not moves
    other = "velocity" if channel == "position" else "position"
    log = log_of(N, **{channel: 0.1 * (np.arange(N) % values), other: still()})
    assert bool(no_motion.find(Exam(log))) is not moves
    assert not no_motion.find(
        Exam(log_of(N, **{channel: with_nan(still(), 3)}))
    )  # of what is unknown nothing is said


@pytest.mark.parametrize(("angle", "pushed"), [(0.31, True), (0.33, False)])
def test_a_torque_is_applied_where_steps_are_small_beside_its_scatter(angle, pushed):
    """Of a sine the mean square step is (2 sin(angle / 2))^2 of its mean square: a tenth at 0.318 rad."""
    log = log_of(N, position=still(), torque=np.sin(angle * np.arange(N)))
    assert no_motion.find(Exam(log))[0].severity == ("note" if pushed else "spoils")
    assert no_motion.find(Exam(log_of(N, position=still())))[0].severity == "spoils"


# ---------------------------------------------------------------------------------- friction of each joint


def judged(find, *estimates, torque=True, unit="rad"):
    """Return what is found where the friction of joints is estimated so (mean, standard error, scatter)."""
    x = np.ones((100, 1)) * np.arange(len(estimates)) + np.arange(100)[:, None]
    exam = Exam(log_of(100, unit=unit, position=x, **({"torque": x % 7.0} if torque else {})))
    for j, estimate in enumerate(estimates):
        exam.shared[torque_sign.friction, j] = estimate
    return find(exam)


@pytest.mark.parametrize(
    ("estimate", "said"),
    [
        ((0.0, 0.0, 1.0), True),
        ((0.019, 0.0, 1.0), True),
        ((0.021, 0.0, 1.0), False),
        ((-0.019, 0.0, 1.0), True),
        ((-0.021, 0.0, 1.0), False),
        ((0.005, 0.0049, 1.0), True),
        ((0.005, 0.0051, 1.0), False),
        ((0.19, 0.01, 11.1), True),
        ((0.19, 0.01, 10.9), False),
        (None, False),
    ],
)
def test_no_friction_is_seen_where_it_is_surely_below_a_fiftieth_of_the_scatter(estimate, said):
    found = judged(no_friction.find, None, estimate)
    assert [f.joint for f in found] == ["j1"] * said
    if said:
        assert about(found[0]) == ("j1", "torque", "note", estimate[0], None, False)
    found = judged(no_friction.find, (0.012, 0.0011, 1.234), unit="m")
    assert (
        found[0].sentence
        == "torque of j0 shows no friction: 0.012 N (standard error 0.001) in a torque that scatters by 1.23 N."
    )


@pytest.mark.parametrize(
    ("estimates", "inverted"),
    [
        ([(-0.401, 0.1, 1.0)], [0]),
        ([(-0.399, 0.1, 1.0)], []),
        ([(-0.051, 0.001, 1.0)], [0]),
        ([(-0.049, 0.001, 1.0)], []),
        ([(0.5, 0.01, 1.0)], []),
        ([(-0.5, 0.01, 1.0), (-0.5, 0.01, 1.0), None], [0, 1, 2]),
        ([(-0.5, 0.01, 1.0), (-0.5, 0.01, 1.0), (-0.01, 0.1, 1.0)], [0, 1, 2]),
        ([(-0.5, 0.01, 1.0), (-0.5, 0.01, 1.0), (0.01, 0.1, 1.0)], [0, 1]),
        ([(-0.5, 0.01, 1.0), (-0.5, 0.01, 1.0), (0.5, 0.01, 1.0), None], [0, 1]),
        ([(-0.5, 0.01, 1.0), None, None], [0]),
        ([None, None], []),
    ],
)
def test_which_torques_are_taken_to_be_inverted(estimates, inverted):
    found = judged(torque_sign.find, *estimates)
    assert [f.joint for f in found] == [f"j{k}" for k in inverted]
    for finding in found:
        estimate = estimates[int(finding.joint[1])]
        value = pytest.approx(estimate[0] if estimate else np.nan, nan_ok=True)
        assert about(finding) == (finding.joint, "torque", "spoils", value, None, True)
        if estimate is None:
            assert finding.sentence.endswith(
                "is assumed to have the opposite sign like the other joints'; its own motion does not show it."
            )
        elif estimate[0] < -0.04:
            push = f"friction would drive it with {-estimate[0]:.3g} N.m (standard error {estimate[1]:.2g})"
            assert (
                finding.sentence == f"torque of {finding.joint} has the opposite sign of its motion: {push}."
            )
        else:
            assert (
                "has the opposite sign like the other joints', though less surely: friction would drive it with 0.01"
                in finding.sentence
            )


def test_a_joint_without_torque_is_not_turned_with_the_others():
    x = np.ones((100, 3)) * np.arange(100.0)[:, None]
    torque = x.copy()
    torque[5, 2] = np.nan
    joints = tuple(Joint(name=name) for name in "abc")
    exam = Exam(Log(time=1e-3 * np.arange(100), joints=joints, position=x, torque=torque))
    exam.shared[torque_sign.friction, 0] = exam.shared[torque_sign.friction, 1] = (-0.5, 0.01, 1.0)
    exam.shared[torque_sign.friction, 2] = None
    found = torque_sign.find(exam)
    assert [f.joint for f in found] == ["a", "b"]
    mended = torque_sign.repair(exam, found[1:])
    assert mended.rows is None and np.array_equal(mended.log.torque[:, 1], -torque[:, 1])
    assert np.array_equal(mended.log.torque[:, 0], torque[:, 0])
    assert mended.log.notes == ("torque of b was multiplied by -1.",)
