"""What is asked of an identification and how it is answered: logs, joints, methods, options, and a model judged on logs."""

import importlib
from dataclasses import replace

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.errors import InvalidInput, NotIdentifiable, UnhealthyLog, UnknownName
from backdrive.identification import validate
from backdrive.identification.auto import METHODS, choose_method, moving_joints, own_turn
from backdrive.identification.log_set import (
    apart,
    attach_plan,
    external_torque_notes,
    in_order,
    move_together,
    slow_clock,
)
from backdrive.identification.options import APPLIES, Options
from backdrive.identification.repairs import healthy
from backdrive.identification.result import Curve, JointEvidence, Samples
from backdrive.laws import CoulombViscous, Law
from backdrive.logs.log import Drive, Source
from backdrive.model import Estimate, FrictionModel, JointFriction, Prior, Quality, Validity
from backdrive.plans import ConstantVelocity, InTurn, Multisine, Sweep, TorqueRamp, plan_to_dict

LINE = CoulombViscous(coulomb_positive=5.0, coulomb_negative=4.0, viscous_positive=1.0, viscous_negative=2.0)


def line(v):
    return np.where(v > 0.0, 5.0 + v, -4.0 + 2.0 * v)


def log_of(*names, n=200, rate=100.0, units=None, begin=0.0, source=None, **channels):
    given = {"position": np.zeros((n, len(names))), "torque": np.ones((n, len(names)))} | channels
    joints = tuple(Joint(name=k, unit=u) for k, u in zip(names, units or ["rad"] * len(names), strict=True))
    sources = () if source is None else (Source(path=f"{source}.csv", sha256=source),)
    return Log(time=begin + np.arange(n) / rate, joints=joints, sources=sources, **given)


# ------------------------------------------------------------------------------------------- the request


def test_logs_are_brought_into_one_order_of_joints():
    first, other = log_of("a", "b"), log_of("b", "a", position=np.tile([1.0, 2.0], (200, 1)))
    got = in_order(other, first)
    assert got.names == ("a", "b") and got.position[0].tolist() == [2.0, 1.0]
    assert in_order(first, first) is first
    with pytest.raises(InvalidInput, match="different joints: a, b and a, c"):
        in_order(log_of("a", "c"), first)
    with pytest.raises(InvalidInput, match="'b' is in rad in one log and in m"):
        in_order(log_of("a", "b", units=("rad", "m")), first)


def test_a_part_of_a_file_is_fitted_once_and_judges_nothing_that_is_fitted():
    one, two = log_of("a", source="x"), log_of("a", source="x", begin=1.99)  # they share an instant
    apart([one, two], [log_of("a", source="y")])
    apart([two, one], [])
    apart([log_of("a", source="x", n=0), one, log_of("a", source="z")], [])
    apart([log_of("a"), log_of("a")], [log_of("a")])
    for again in (one, log_of("a", source="x", begin=1.98), log_of("a", source="x", begin=-1.98)):
        with pytest.raises(InvalidInput, match=r"x.csv and x.csv are the same log"):
            apart([one, log_of("a", source="z"), again], [])
    with pytest.raises(InvalidInput, match=r"x.csv is held out and also fitted \(x.csv\)"):
        apart([one], [log_of("a", source="y"), log_of("a", source="x", begin=50.0)])


def test_plans_are_one_for_all_or_one_each():
    logs, plan = [log_of("a"), log_of("a", source="x").replace(plan=Sweep(0.5, 1.0, 3))], Sweep(0.5, 2.0, 4)
    assert attach_plan(logs, None) == logs
    assert [log.plan for log in attach_plan(logs, plan)] == [plan, plan]
    for kind in (list, tuple):
        assert [log.plan for log in attach_plan(logs, kind([plan, None]))] == [plan, None]
    with pytest.raises(InvalidInput, match="3 plans for 2 logs"):
        attach_plan(logs, [plan] * 3)


FOR = {
    "law": ("motion", "constant-velocity", "dynamic"), "gravity": ("motion", "dynamic"), "literal": ("sweep",),
    "timing": ("sweep",), "payloads": ("sweep",), "cutoff": ("motion", "arm", "dynamic"),
    "joints": ("sweep", "constant-velocity", "motion", "ramp", "dynamic"), "urdf": ("arm",), "delay": ("dynamic",),
    "bounds": ("dynamic",),
    "known": ("motion", "sweep", "arm", "dynamic"), "drive": ("dynamic",), "loss": ("dynamic",), "interval": ("dynamic",),
    "step": ("dynamic",), "seed": ("dynamic",), "symmetric": ("sweep", "constant-velocity", "motion", "ramp", "arm", "dynamic"),
    "prior": ("sweep", "constant-velocity", "motion", "dynamic"),
}  # fmt: skip
PRIOR = Prior(
    joint="a", unit="rad", source="siblings", names=("friction",), units=("N.m",), velocity=np.ones(1), weights=np.eye(1),
    mean=np.ones(1), covariance=np.eye(1),
)  # fmt: skip
SET = {
    "law": "polyline", "gravity": True, "literal": True, "timing": "sample", "payloads": [(1.0, 2.0)], "cutoff": 9.0,
    "joints": ["a"], "urdf": "r.urdf", "delay": False, "bounds": {"inertia": (1.0, 2.0)}, "known": {"delay": 0.004},
    "drive": Drive(law="torque"), "loss": "linear", "interval": "profile", "step": 1e-3, "seed": 3, "symmetric": True,
    "prior": (PRIOR,),
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("option", FOR)
def test_an_option_is_for_some_methods_and_refused_by_the_others(option, method):
    assert set(APPLIES) == set(FOR)
    values = [SET[option], *([False] if option in ("gravity", "symmetric") else [])]
    for value in values:
        if method in FOR[option]:
            Options(**{option: value}).applicable(method)
        else:
            reason = f"'{option}' does not apply to the method '{method}'"
            if option == "known":
                reason = f"The method '{method}' has no delay that could be known"
            with pytest.raises(InvalidInput, match=reason):
                Options(**{option: value}).applicable(method)
    usual = getattr(Options(), option)
    for nothing in (usual, *((None, [], ()) if usual is None else ())):
        Options(**{option: nothing}).applicable(method)


def test_options_that_do_not_go_together_are_refused():
    paid = {"payloads": [(1.0, 2.0)]}
    Options(**paid, symmetric=None).applicable("sweep")
    Options(**paid, literal=False).applicable("sweep")
    Options(literal=True).applicable("sweep")
    for other in ("literal", "symmetric"):
        with pytest.raises(InvalidInput, match=f"'{other}' does not go with a payload"):
            Options(**paid, **{other: True}).applicable("sweep")
    for name in ("cutoff", "step"):
        for value in (0.0, -1.0, float("nan"), float("inf")):
            with pytest.raises(InvalidInput, match=f"{name} = "):
                Options(**{name: value}).check()
        Options(**{name: 0.1}).check()
    for seed in (-1, 1.5, True):
        with pytest.raises(InvalidInput, match="seed = "):
            Options(seed=seed).check()
    Options(seed=0).check()


def test_a_model_remembers_what_was_asked_and_not_the_defaults():
    assert Options().record("motion", None, []) == {"method": "motion"}
    assert Options().record("dynamic", None, []) == {"method": "dynamic", "seed": 0, "loss": "huber"}
    asked = Options(
        law=("m1", "m2"),
        bounds={"inertia": (1, 2)},
        known={"offset": 0},
        payloads=[(1.0, 2.0)],
        gravity=False,
    )
    plan = Sweep(0.5, 2.0, 4)
    held = log_of("a", source="x")
    memory = asked.record("sweep", [plan, plan], [held], reading={}, more=3)
    assert memory == {
        "method": "sweep", "law": ["m1", "m2"], "bounds": {"inertia": [1.0, 2.0]}, "known": {"offset": 0.0},
        "payloads": [[1.0, 2.0]], "gravity": False, "plan": [plan_to_dict(plan)] * 2, "more": 3,
        "held_out": [{"path": held.sources[0].path, "sha256": held.sources[0].sha256}],
    }  # fmt: skip
    assert asked.record("sweep", plan, [])["plan"] == plan_to_dict(plan)


def test_a_clock_below_fifty_hertz_is_said():
    assert slow_clock([log_of("a", rate=50.5), log_of("a", rate=1000.0)]) == []
    (said,) = slow_clock([log_of("a", rate=1000.0), log_of("a", rate=40.0)])
    assert said.startswith("A log has 40 samples a second: below 50 Hz")
    (said,) = slow_clock([log_of("a", rate=0.5)])
    assert "0.5 samples a second" in said and "t=0.001*COLUMN for milliseconds" in said
    assert slow_clock([log_of("a", n=1), log_of("a", n=0)]) == []
    assert slow_clock([log_of("a").replace(time=np.zeros(200))]) == []


def test_a_torque_that_a_method_does_not_look_at_is_said():
    known = log_of("a", model_torque=np.ones((200, 1)))
    assert (
        external_torque_notes([known], "motion") == [] and external_torque_notes([log_of("a")], "sweep") == []
    )
    (said,) = external_torque_notes([log_of("a"), known], "sweep")
    assert said.startswith("The method 'sweep' does not use the torque known from elsewhere")
    assert external_torque_notes([known], "dynamic") == []
    assert external_torque_notes([known], "dynamic", driven=True) == [said.replace("sweep", "dynamic")]


def test_joints_move_together_where_more_than_a_fifth_of_the_samples_have_two_moving():
    n = 1000

    def pair(share, second=1.0, names=("a", "b"), **more):
        speed = np.zeros((n, 3))
        speed[:, 0], speed[: round(n * share), 1], speed[n - 100 :, 1] = 1.0, second, 1.0
        speed[:, 2] = 0.0
        return log_of("a", "b", "c", n=n, position=None, torque=None, velocity=speed, **more)

    assert move_together([pair(0.11)], ["a", "b"]) and not move_together([pair(0.09)], ["a", "b"])
    assert move_together([pair(0.5, second=0.06)], ["a", "b"])  # of the top speed, from a twentieth on
    assert not move_together([pair(0.5, second=0.04)], ["a", "b"])
    assert not move_together([pair(0.5)], ["a"]) and not move_together([pair(0.5)], ["a", "c"])
    assert not move_together([pair(0.5, model_torque=np.zeros((n, 3)))], ["a", "b"])
    assert move_together([pair(0.05), pair(0.5), pair(0.5)], ["a", "b"])
    assert not move_together([pair(0.5).rows(slice(0, 1))], ["a", "b"])
    together = np.cumsum(pair(0.5).velocity, axis=0)
    assert move_together([log_of("a", "b", "c", n=n, position=together)], ["a", "b"])
    apart_ = np.column_stack([np.minimum(np.arange(n), 500), np.maximum(np.arange(n), 500)])
    assert not move_together([log_of("a", "b", n=n, position=apart_)], ["a", "b"])
    assert not move_together([], ["a", "b"])


def moving_log(n=600, source=None, **more):
    t = np.arange(n) / 100.0
    v = 0.9 * np.cos(1.5 * t)[:, None]
    given = {
        "position": 0.6 * np.sin(1.5 * t)[:, None],
        "torque": line(v) + 0.01 * np.random.default_rng(0).standard_normal((n, 1)),
    } | more
    return log_of("a", n=n, source=source, **given)


def test_health_names_the_file_and_what_is_suspect_joins_the_warnings():
    log, warnings = moving_log(source="x"), ["before"]
    assert healthy(log, (), False, warnings) is log and warnings == ["before"]
    holed = np.where(np.arange(600)[:, None] == 50, np.nan, log.position)
    broken = log.replace(position=holed)
    with pytest.raises(UnhealthyLog, match=r"x.csv: The log would spoil the result: \[nan\]") as error:
        healthy(broken, (), False, [])
    assert "--accept nan" in error.value.remedy and error.value.data["findings"][0]["name"] == "nan"
    with pytest.raises(UnhealthyLog, match="^The log would spoil"):
        healthy(broken.replace(sources=()), (), False, [])
    assert np.isnan(healthy(broken, ["nan"], False, []).position).any()
    assert np.isfinite(healthy(broken, (), True, []).position).all()
    gap = moving_log(source="y")
    gap = gap.replace(time=gap.time + np.where(np.arange(600) > 300, 0.5, 0.0))
    for sources, begin in ((gap.sources, "y.csv: [gap"), ((), "[gap")):
        said = ["before"]
        healthy(gap.replace(sources=sources), (), False, said)
        assert len(said) == 2 and said[0] == "before" and said[1].startswith(begin)


# --------------------------------------------------------------------------------- joints and methods


def test_joints_that_travel_a_fiftieth_of_the_busiest_of_their_kind_are_identified():
    ramp = np.linspace(0.0, 1.0, 1001)[:, None]
    size = np.array([1.0, 0.021, 0.019, 1e-4, 1e-6, 0.0])
    log = log_of(
        *"abcdef",
        n=1001,
        units=["rad", "rad", "rad", "m", "m", "m"],
        position=ramp * size,
        torque=np.ones((1001, 6)),
    )
    assert moving_joints([log], None) == (["a", "b", "d"], ["c", "e", "f"])
    assert moving_joints([log], ["f", "a"]) == (["f", "a"], [])
    assert moving_joints([log], []) == (["a", "b", "d"], ["c", "e", "f"])
    assert moving_joints([log.rows(slice(0, 2)), log], None)[0] == ["a", "b", "d"]
    with pytest.raises(UnknownName, match="'q' is not a joint"):
        moving_joints([log], ["q"])
    with pytest.raises(NotIdentifiable, match="No joint"):
        moving_joints([log_of("a", "b")], None)
    # what travels as far as an arm's joint is not idle beside a wheel
    far = log_of(*"ab", n=1001, position=ramp * [500.0, 0.13], torque=np.ones((1001, 2)))
    assert moving_joints([far], None) == (["a", "b"], [])
    still = log_of(*"ab", n=1001, position=ramp * [500.0, 0.12], torque=np.ones((1001, 2)))
    assert moving_joints([still], None) == (["a"], ["b"])
    # single samples do not count as travel
    wild = np.zeros((1001, 2))
    wild[:, 0], wild[500, 1], wild[600, 1] = ramp[:, 0], 5.0, -5.0
    assert moving_joints([log_of("a", "b", n=1001, position=wild, torque=np.ones((1001, 2)))], None) == (
        ["a"],
        ["b"],
    )
    holes = np.where(np.arange(1001)[:, None] == 7, np.nan, ramp * [1.0, 0.1])
    assert moving_joints([log_of("a", "b", n=1001, position=holes, torque=np.ones((1001, 2)))], None)[0] == [
        "a",
        "b",
    ]


def test_travel_without_position_is_the_speed_times_the_duration():
    speeds = np.tile([1.0, -0.03, 0.01], (500, 1))
    long = log_of("a", "b", "c", n=500, position=None, velocity=speeds, torque=np.ones((500, 3)))
    assert moving_joints([long], None) == (["a", "b"], ["c"])
    # of two logs the longer way counts: 1 rad/s for 5 s, 0.01 rad/s for 20 s
    slow = log_of("a", "b", "c", n=2000, position=None, velocity=np.tile([0.0, 0.0, 0.01], (2000, 1)),
                  torque=np.ones((2000, 3)))  # fmt: skip
    assert moving_joints([long, slow], None)[0] == ["a", "b", "c"]
    wild = np.zeros((500, 2))
    wild[:, 0], wild[:4, 1] = 1.0, 90.0  # fewer than one in a hundred
    wild_log = log_of("a", "b", n=500, position=None, velocity=wild, torque=np.ones((500, 2)))
    assert moving_joints([wild_log], None) == (["a"], ["b"])


def turns(pause=1.5, start=2.0):
    plans = Sweep(0.6, 1.5, 3, joint="a"), Sweep(0.8, 2.0, 3, center=0.3, joint="b")
    return InTurn(plans, pause=pause, start=start)


def in_turn_log(plan, late=0.0, rate=200.0, rest=3.0):
    t = np.arange(0.0, plan.start + plan.duration + rest, 1.0 / rate)
    q = plan.position(t)
    return Log(
        time=t + late, joints=tuple(Joint(name=n) for n in plan.joints), position=q, torque=q, plan=plan
    )


@pytest.mark.parametrize("late", [0.0, 40.0, -3.0])
def test_the_turn_of_a_joint_is_the_middle_of_its_motion_whatever_the_clock(late):
    plan = turns()
    log = in_turn_log(plan, late)
    for joint in ("a", "b"):
        wanted = plan.plan_of(joint)
        own = own_turn(log, joint)
        assert own.plan.joint == joint and own.plan.kind == "sweep"
        assert own.plan.start == pytest.approx(wanted.start + late, abs=0.3)
        speed = np.abs(wanted.velocity(log.time - late))
        fast = np.flatnonzero(speed > 0.05 * np.percentile(speed, 99.5))
        middle = log.time[fast[[0, -1]]].mean()
        assert own.plan.start == pytest.approx(middle - 0.5 * wanted.duration, abs=0.02)
        begin = min(log.time[fast[0]], own.plan.start) - 0.5
        end = max(log.time[fast[-1]], own.plan.start + wanted.duration) + 0.5
        assert (own.time[0], own.time[-1]) == (
            pytest.approx(max(begin, log.time[0]), abs=0.02),
            pytest.approx(end, abs=0.02),
        )
    without = log.replace(position=None, velocity=plan.velocity(log.time - late))
    assert own_turn(without, "b").plan.start == pytest.approx(own_turn(log, "b").plan.start, abs=0.02)


def test_a_log_without_turns_is_left_as_it_is():
    plan = turns()
    log = in_turn_log(plan)
    single = log.select("a").replace(plan=plan.plan_of("a"))
    assert own_turn(single, "a") is single and own_turn(log.replace(plan=None), "a").plan is None
    other = log.replace(joints=(Joint(name="x"), Joint(name="b")))
    assert own_turn(other, "x") is other
    still = log.replace(position=np.zeros_like(log.position))
    assert own_turn(still, "a").plan == plan.plan_of("a") and len(own_turn(still, "a")) == len(log)
    # a turn whose motion is longer than its plan is kept whole, and half a second around it
    t = log.time
    q = np.where((t > 2.5) & (t < 30.0), np.sin(t), 0.0)
    long = in_turn_log(turns(), rest=20.0)
    q = np.where((long.time > 2.5) & (long.time < 26.0), np.sin(3.0 * long.time), np.sin(7.5))
    q = np.where(long.time >= 26.0, np.sin(78.0), q)
    got = own_turn(long.replace(position=np.column_stack([q, 0.0 * q])), "a")
    assert (got.time[0], got.time[-1]) == (pytest.approx(2.0, abs=0.03), pytest.approx(26.5, abs=0.03))


def steady(v, n=200):
    return log_of("a", n=n, position=(v * np.arange(n) / 100.0)[:, None])


def test_the_method_is_that_of_the_description_the_plan_or_the_motion():
    wave = moving_log()
    assert choose_method([wave], ["a"], "r.urdf") == ("arm", "a robot description was given")
    for plan, kind in (
        (Sweep(0.5, 1.0, 3, joint="a"), "sweep"),
        (ConstantVelocity(1.5, (0.5, 1.0), joint="a"), "constant-velocity"),
        (TorqueRamp(9.0, 2.0, joint="a"), "ramp"),
    ):
        method, reason = choose_method([wave, wave.replace(plan=plan)], ["a"], None)
        assert method == kind and reason == f"the logs are linked to a plan of the kind '{kind}'"
    anything = wave.replace(plan=Multisine(1.0, 0.2, 1.0, 5.0, joint="a"))
    assert choose_method([anything], ["a"], None)[0] == "motion"
    assert choose_method([wave], ["a"], None) == ("motion", "the logs hold motion of no special kind")
    runs = [steady(v) for v in (0.2, 0.5, -0.2, -0.5)]
    assert choose_method(runs, ["a"], None) == (
        "constant-velocity",
        "every log keeps one velocity throughout",
    )
    assert choose_method(runs[:3], ["a"], None)[0] == "motion"
    assert choose_method([*runs, wave], ["a"], None)[0] == "motion"
    other = wave.replace(plan=Sweep(0.5, 1.0, 3, joint="a"))
    with pytest.raises(InvalidInput, match=r"different ways \(sweep, ramp\)"):
        choose_method([other, wave.replace(plan=TorqueRamp(9.0, 2.0, joint="a")), other], ["a"], None)
    with pytest.raises(InvalidInput, match="holds no torque"):
        choose_method([wave.replace(torque=None)], ["a"], None)


@pytest.mark.parametrize(("cycles", "method"), [(3, "motion"), (4, "sweep"), (5, "sweep")])
def test_four_cycles_of_growing_speed_are_a_sweep(cycles, method):
    plan = Sweep(0.7, 2.0, cycles)
    t = np.arange(0.0, plan.duration, 0.005)
    log = Log(time=t, joints=(Joint(name="a"),), position=plan.position(t), torque=np.sign(plan.velocity(t)))
    assert choose_method([log], ["a"], None)[0] == method
    assert choose_method([log.replace(position=None, velocity=plan.velocity(t))], ["a"], None)[0] == "motion"
    assert choose_method([log, moving_log()], ["a"], None)[0] == "motion"
    assert choose_method([log.rows(slice(0, 20))], ["a"], None)[0] == "motion"


def test_turns_of_one_kind_choose_the_method_together():
    plan = turns()
    assert choose_method([in_turn_log(plan)], ["a", "b"], None)[0] == "sweep"
    mixed = InTurn((plan.plans[0], Multisine(0.4, 0.3, 1.0, 5.0, joint="b")))
    assert choose_method([in_turn_log(mixed)], ["a"], None)[0] == "sweep"
    with pytest.raises(InvalidInput, match=r"different ways \(sweep, multisine\)"):
        choose_method([in_turn_log(mixed)], ["a", "b"], None)


# ------------------------------------------------------------------------------------- model on logs


def friction(
    name="a", unit="rad", method="motion", residual=5.0, velocity=(-1.5, 1.5), held_out=None, **terms
):
    return JointFriction(
        joint=Joint(name=name, unit=unit), law=Law(rate=LINE), validity=Validity(velocity=velocity), method=method,
        dynamics={k: Estimate(value=v, unit="", standard_error=0.1) for k, v in terms.items()},
        fitted=Quality(residual=residual, residual_raw=residual, rms=1.0, samples=9), held_out=held_out,
    )  # fmt: skip


def test_a_model_is_judged_joint_by_joint_on_all_logs():
    logs = [moving_log(), moving_log(n=400)]
    model = FrictionModel(joints=(friction("b"), friction("a")))
    (name,) = got = validate(model, logs)
    assert name == "a" and 800 < got["a"].samples < 1000  # but reversals and ends
    assert got["a"].rms == pytest.approx(0.01, rel=0.6) or got["a"].rms < 0.4  # reversals
    off = [log.replace(torque=log.torque + 1.0) for log in logs]
    v = logs[0].time * 1.5
    size = np.sqrt(np.mean((line(0.9 * np.cos(v)) + 1.0) ** 2))
    assert validate(model, off)["a"].residual_raw == pytest.approx(100.0 / size, rel=0.05)
    both = [log_of("a", "b", n=600, position=np.tile(logs[0].position, 2), torque=np.tile(logs[0].torque, 2))]
    assert set(validate(model, both)) == {"a", "b"}
    remarks: list[str] = []
    narrow = FrictionModel(joints=(friction("a", velocity=(-0.5, 0.7)),))
    validate(narrow, logs, remarks=remarks)
    assert len(remarks) == 1 and "outside the validity range, -0.5 to 0.7" in remarks[0]
    validate(model, logs, remarks=remarks)
    assert len(remarks) == 1
    with pytest.raises(InvalidInput, match=r"Model \(b, a\) and logs \(x\) share no joint"):
        validate(model, [log_of("x")])
    with pytest.raises(InvalidInput, match="share no joint"):
        validate(model, [logs[0], log_of("x")])
    with pytest.raises(InvalidInput, match="measured in m in the model and in rad in the logs"):
        validate(FrictionModel(joints=(friction("a", unit="m"),)), logs)
    with pytest.raises(
        InvalidInput, match="holds no torque of joint 'a', and here a model is judged by torque"
    ):
        validate(model, [logs[0].replace(torque=None, drive_input=np.ones((600, 1)))])
    with pytest.raises(InvalidInput, match="The log holds no torque"):
        validate(model, [logs[0].replace(torque=None)])


def test_motion_is_low_passed_as_in_the_fit():
    n = 1200
    t = np.arange(n) / 100.0
    log = log_of("a", n=n, position=(np.sin(t) + 0.01 * np.sin(2 * np.pi * 6.0 * t))[:, None],
                 torque=line(np.cos(t) + 0.01 * 12.0 * np.pi * np.cos(2 * np.pi * 6.0 * t))[:, None])  # fmt: skip
    one = friction("a", velocity=(-2.0, 2.0))

    def rms(**options):
        return validate(FrictionModel(joints=(one,), options=options), [log])["a"].rms

    usual, low, high = rms(), rms(cutoff=2.0), rms(cutoff=30.0)
    assert low > 1.02 * usual > 1.02 * high or len({usual, low, high}) == 3
    assert rms(joints={"a": {"cutoff": 2.0}}) == low and rms(joints={"b": {"cutoff": 2.0}}) == usual
    assert rms(joints={"a": {"cutoff": 2.0}}, cutoff=30.0) == low and rms(joints={"a": {}}, cutoff=2.0) == low
    for wrong in (0.0, -2.0, "2", None):
        assert rms(cutoff=wrong) == usual
    assert rms(joints=["a"], cutoff=2.0) == low and rms(joints={"a": 2.0}) == usual


def test_a_model_of_runs_is_judged_by_mean_torques():
    speeds = (0.3, 0.8, -0.3, -0.8)
    logs = [
        log_of(
            "a", position=None, velocity=np.full((200, 1), v), torque=np.full((200, 1), float(line(v)) + 0.5)
        )
        for v in speeds
    ]
    model = FrictionModel(joints=(friction(method="constant-velocity", offset=0.5),))
    got = validate(model, logs)["a"]
    assert got.samples == 4 and got.rms == pytest.approx(0.0, abs=1e-9)
    remarks: list[str] = []
    without = FrictionModel(joints=(friction(method="constant-velocity", velocity=(-0.5, 0.5)),))
    got = validate(without, logs, remarks=remarks)["a"]
    assert got.samples == 4 and got.rms == pytest.approx(0.5) and len(remarks) == 1
    size = np.sqrt(np.mean([(line(v) + 0.5) ** 2 for v in speeds]))
    assert got.residual == pytest.approx(100.0 * 0.5 / size)
    for judged in (friction(method="constant-velocity", inertia=1e-9), friction(method="motion")):
        got = validate(FrictionModel(joints=(judged,)), logs)["a"]
        assert got.samples == 688  # without 14 at each end of four: twice the period of the low pass at 15 Hz
    located = [log.replace(position=np.cumsum(log.velocity, axis=0) / 100.0) for log in logs]
    assert validate(model, located)["a"].samples == 688
    with pytest.raises(NotIdentifiable, match="No joint of this log moves"):
        validate(model, [logs[0].replace(velocity=np.zeros((200, 1)))])


# ------------------------------------------------------------------------------------------- identify


class Recorder:
    """Stands in for the fits and remembers what they were asked."""

    def __init__(self, monkeypatch):
        self.calls = []
        for place, name in (
            ("motion", "identify_motion"), ("sweep", "identify_sweep"), ("sweep_payload", "identify_payload"),
            ("constant_velocity", "identify_constant_velocity"), ("presliding", "identify_ramp"), ("arm", "identify_arm"),
        ):  # fmt: skip
            if place == "arm":
                pytest.importorskip("pinocchio")
            module = importlib.import_module(f"backdrive.identification.{place}")
            monkeypatch.setattr(module, name, self.fit(name))

    def fit(self, kind):
        def one(logs, *rest, **options):
            self.calls.append((kind, logs, rest, options))
            name = "a" if kind == "identify_arm" else rest[0]
            if name == "bad":
                raise NotIdentifiable("It is bad.", remedy="Mend it.")
            empty = np.empty(0)
            samples = Samples(
                time=empty,
                position=empty,
                velocity=empty,
                torque=empty + 3.0,
                friction=empty,
                predicted=empty,
                fitted=empty,
            )
            found = friction(name, method="constant-velocity" if "constant" in kind else "motion")
            shown = JointEvidence(
                joint=name, samples=samples, curve=Curve(velocity=empty, torque=empty, standard_error=empty),
                verdict="So it is. The model explains all but 5.0 % of the torque it was fitted to: good. Indeed.",
            )  # fmt: skip
            if kind == "identify_arm":
                return (found,), (shown,), None
            return found, shown

        return one


@pytest.fixture
def asked(monkeypatch):
    return Recorder(monkeypatch)


def wave(*names, phase=2.0, **more):
    n = 600
    t = np.arange(n)[:, None] / 100.0
    shift = phase * np.arange(len(names))
    v = 0.9 * np.cos(1.5 * t + shift)
    noise = 0.01 * np.random.default_rng(0).standard_normal((n, len(names)))
    return log_of(*names, n=n, position=0.6 * np.sin(1.5 * t + shift), torque=line(v) + noise, **more)


def test_options_reach_the_method_that_they_are_for(asked):
    log = wave("a")
    held = [wave("a", source="h")]
    given = {"cutoff": 8.0, "gravity": False, "symmetric": True, "law": "polyline"}
    identify(log, method="motion", held_out=held, **given)
    kind, logs, rest, options = asked.calls.pop()
    assert (kind, rest) == ("identify_motion", ("a",)) and len(logs) == 1
    assert {k: options[k] for k in given} == given and len(options["held_out"]) == 1
    identify([log], method="sweep", literal=True, symmetric=False, timing="sample")
    assert asked.calls.pop()[0::3] == (
        "identify_sweep",
        {"literal": True, "symmetric": False, "timing": "sample", "delay": None},
    )
    identify([log], method="sweep", payloads=[(1.0, 2.0)], timing="command")
    kind, _, rest, options = asked.calls.pop()
    assert (kind, rest) == ("identify_payload", ("a",))
    assert options == {"payloads": [(1.0, 2.0)], "timing": "command", "delay": None}
    identify([log], method="constant-velocity", symmetric=True, law="coulomb-viscous")
    assert asked.calls.pop()[0::3] == (
        "identify_constant_velocity",
        {"symmetric": True, "law": "coulomb-viscous"},
    )
    identify([log], method="ramp")
    assert asked.calls.pop()[0::3] == ("identify_ramp", {})
    identify([log], method="arm", urdf="r.urdf", cutoff=7.0, held_out=held)
    kind, _, rest, options = asked.calls.pop()
    assert (kind, rest, options["cutoff"], len(options["held_out"])) == ("identify_arm", ("r.urdf",), 7.0, 1)
    with pytest.raises(InvalidInput, match="needs the robot's description"):
        identify([log], method="arm")
    with pytest.raises(InvalidInput, match="There is no log"):
        identify([])
    with pytest.raises(InvalidInput, match="are the same log"):
        identify([*held, *held], method="motion")
    with pytest.raises(InvalidInput, match="is held out and also fitted"):
        identify(held, method="motion", held_out=held)
    with pytest.raises(InvalidInput, match="different joints"):
        identify(log, method="motion", held_out=[wave("b")])
    with pytest.raises(UnknownName, match="'swep' is not a method"):
        identify(log, method="swep")


def test_what_was_asked_is_remembered_and_what_was_not_is_left_out(asked):
    log = replace(wave("a", source="x"), notes=("read so", "read so"))
    plain = identify(log, method="motion")
    assert plain.model.options == {"method": "motion"}
    assert (plain.method, plain.reason, plain.notes) == ("motion", "as requested", ("read so",))
    assert [s.path for s in plain.model.sources] == ["x.csv"] and plain.model.version
    plan = Sweep(0.6, 1.5, 3, joint="a")
    for given, wanted in (
        (plan, {"kind": "sweep"}), ([plan], [{"kind": "sweep"}]),
    ):  # fmt: skip
        got = identify(log, method="motion", plan=given, accept=["plan-mismatch"]).model.options["plan"]
        first = got if isinstance(wanted, dict) else got[0]
        assert isinstance(got, type(wanted)) and first["kind"] == "sweep" and first["stroke"] == 0.6
    got = identify(
        log, method="motion", joints=["a"], gravity=False, symmetric=True, cutoff=9.0, repair=True, accept=["jitter"],
        held_out=[wave("a", source="h")], reading={"unit": "rad"}, law="polyline",
    ).model.options  # fmt: skip
    assert got == {
        "method": "motion", "joints": ["a"], "gravity": False, "symmetric": True, "cutoff": 9.0, "repair": True,
        "accept": ["jitter"], "held_out": [{"path": "h.csv", "sha256": "h"}], "reading": {"unit": "rad"}, "law": "polyline",
    }  # fmt: skip
    assert identify(log, method="sweep", payloads=[(1.0, 2.0)]).model.options == {
        "method": "sweep",
        "payloads": [[1.0, 2.0]],
    }
    assert identify(log, method="sweep", literal=True, timing="sample").model.options == {
        "method": "sweep",
        "literal": True,
        "timing": "sample",
    }
    assert identify(log).reason == "the logs hold motion of no special kind"


def test_joints_that_cannot_be_identified_are_left_out_with_a_word(asked):
    log = wave("a", "bad")
    got = identify(log, method="motion")
    assert got.model.names == ("a",) and [e.joint for e in got.evidence] == ["a"]
    assert any(w.startswith("Joint 'bad' was left out: It is bad.") for w in got.warnings)
    for call in (lambda: identify(log, method="motion", joints=["a", "bad"]), lambda: identify(wave("bad"))):
        with pytest.raises(NotIdentifiable, match=r"^It is bad\."):
            call()
    still = log_of("a", "b", n=600, position=np.hstack([wave("a").position, np.zeros((600, 1))]),
                   torque=np.hstack([wave("a").torque, np.ones((600, 1))]))  # fmt: skip
    hardly = "Joint 'b' hardly moves and was left out."
    assert hardly in identify(still, method="motion").warnings
    assert hardly not in identify(still, method="arm", urdf="r").warnings
    steps: list[str] = []
    identify(log, method="motion", progress=steps.append)
    assert steps == [
        "Checking the logs",
        "Identifying a (motion), joint 1 of 2",
        "Identifying bad (motion), joint 2 of 2",
    ]


def test_no_joint_left_is_an_error(asked, monkeypatch):
    from backdrive.identification import pipeline as package

    monkeypatch.setattr(package, "moving_joints", lambda logs, joints: (["bad", "bad"], []))
    with pytest.raises(NotIdentifiable, match="No joint could be identified"):
        identify(wave("bad"), method="sweep")


def test_warnings_of_a_whole_request(asked):
    def warned(word, log, method="motion", **more):
        return any(word in w for w in identify(log, method=method, **more).warnings)

    pulls = "Several joints move at once"
    assert warned(pulls, wave("a", "b")) and not warned(pulls, wave("a"))
    assert not warned(pulls, wave("a", "b"), "sweep") and not warned(
        pulls, wave("a", "b", model_torque=np.zeros((600, 2)))
    )
    slow = wave("a", rate=100.0)
    slow = slow.replace(time=slow.time * 2.5)
    for method, said in (("motion", True), ("sweep", True), ("ramp", False), ("constant-velocity", False)):
        assert warned("samples a second", slow, method) is said
    assert warned("samples a second", slow, "arm", urdf="r")
    known = wave("a", model_torque=np.zeros((600, 1)))
    assert warned("does not use the torque known", known, "sweep") and not warned(
        "does not use the torque", known
    )
    assert len(set(identify(wave("a", "b")).warnings)) == len(identify(wave("a", "b")).warnings)


def test_the_temperatures_that_the_logs_saw_are_the_validity(asked):
    warm = np.linspace(20.0, 31.5, 600)[:, None].copy()
    warm[5] = np.nan
    cool = np.full((600, 1), 17.0)
    logs = [wave("a"), wave("a", temperature=warm), wave("a", temperature=cool)]
    validity = identify(logs, method="motion", accept=["nan"]).model.joints[0].validity
    assert validity.temperature == (17.0, pytest.approx(31.5)) and validity.velocity == (-1.5, 1.5)
    assert identify(logs[:1], method="motion").model.joints[0].validity.temperature is None


def test_methods_that_do_not_judge_are_judged_on_the_logs_held_out(asked):
    held = [wave("a", source="h")]
    steps: list[str] = []
    got = identify(wave("a"), method="sweep", held_out=held, progress=steps.append)
    wanted = validate(got.model, held)["a"]
    assert got.model.joints[0].held_out == wanted and steps[-1] == "Judging on the held-out logs"
    said = got.evidence[0].verdict
    assert said.startswith("So it is. ") and said.endswith(" Indeed.")
    assert f"all but {wanted.residual:.1f} % of torque that was held out" in said and "fitted to" not in said
    for method, more in (("motion", {}), ("arm", {"urdf": "r"})):
        assert identify(wave("a"), method=method, held_out=held, **more).model.joints[0].held_out is None
    alone = identify(wave("a"), method="sweep")
    assert alone.model.joints[0].held_out is None and "fitted to" in alone.evidence[0].verdict
    assert alone.evidence[0].samples.residual.size == 0


def test_residuals_are_measured_less_predicted():
    one = np.ones(2)
    shown = Samples(
        time=one,
        position=one,
        velocity=one,
        torque=np.array([3.0, 1.0]),
        friction=one,
        predicted=np.array([1.0, 4.0]),
        fitted=one,
    )
    assert shown.residual.tolist() == [2.0, -3.0]
