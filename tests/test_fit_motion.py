import numpy as np
import pytest

from backdrive.engine import Axis, DriveModel, forward
from backdrive.errors import InvalidInput, NotIdentifiable, UnknownName
from backdrive.identification.dynamic.motion import MotionLog, MotionProblem, fit_motion
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.laws import M1, Coulomb, CoulombViscous, GearLoad, Law, kernels

DT = 2e-3
TIME = DT * np.arange(1000)
PENDULUM = Axis(
    law=Law(
        rate=GearLoad(coulomb=0.006, load=0.25, driving=0.2, driven=0.1, stribeck_velocity=0.4, viscous=0.007)
    ),
    inertia=0.0015,
    load_inertia=0.005,
    gravity_sin=0.48,
    drive=DriveModel(
        controller="position",
        actuator="motor",
        limit=1.0,
        supply=7.4,
        torque_constant=0.4,
        resistance=3.0,
        delay=0.004,
    ),
)
GAINS = (0.3, 0.6, 1.2)
GOALS = (
    np.sin(5 * TIME),
    np.where(TIME < 1.0, 1.5, -0.5),
    0.8 * np.sin(3 * TIME) + 0.5 * np.sin(9 * TIME**1.5),
)


def pendulum() -> list[MotionLog]:
    axes = [PENDULUM.replace(drive=PENDULUM.drive.replace(proportional=k)) for k in GAINS]
    motion = forward(axes, np.array(GOALS), dt=DT)
    return [
        MotionLog(position=p, drive_input=g, dt=DT, start=0.0, proportional=k, name=f"gain {k}")
        for p, g, k in zip(motion.position, GOALS, GAINS, strict=True)
    ]


def driven(n=2500) -> tuple[Axis, MotionLog]:
    t = DT * np.arange(n)
    force = 60.0 * np.sign(np.sin(4.0 * t)) * (0.6 + 0.4 * np.sin(1.3 * t)) + 0.05 * t
    axis = Axis(
        law=Law(
            rate=CoulombViscous(
                coulomb_positive=20, coulomb_negative=16, viscous_positive=160, viscous_negative=230
            )
        ),
        inertia=95.0,
        offset=-2.0,
        drive=DriveModel(),
    )
    motion = forward(axis, force, dt=DT, velocity=0.02)
    log = MotionLog(
        position=motion.position[0],
        velocity=motion.velocity[0],
        drive_input=force - 0.05 * t,
        dt=DT,
        start=0.015,
        shapes={"drift": t},
    )
    return axis, log


def test_a_servo_and_its_gears_are_found_from_positions_alone():
    truth = {
        "load": 0.25,
        "coulomb": 0.006,
        "viscous": 0.007,
        "inertia": 0.0015,
        "drive.torque_constant": 0.4,
    }
    fit = fit_motion(
        pendulum(),
        LawShape.from_name("gear-load", fixed={"driving": 0.2, "driven": 0.1, "stribeck_velocity": 0.4}),
        axis=PENDULUM.replace(law=Law(rate=M1(coulomb=0.0)), inertia=1e-3),
        free={
            "load": (1e-3, 0.9, (0.1, 0.5)),
            "coulomb": (1e-4, 0.1, (2e-3, 2e-2)),
            "viscous": (1e-4, 0.1, (2e-3, 2e-2)),
            "inertia": (1e-4, 1e-2, (5e-4, 4e-3)),
            "drive.torque_constant": (0.1, 1.5, (0.2, 0.7)),
            "drive.delay": (0.0, 0.02, 0.01),
        },
        loss="absolute",
        begin=32,
        descend=2,
        finish=1,
        iterations=15,
    )
    assert fit.mean_absolute < 1e-4
    for name, expected in truth.items():
        assert fit.values[name] == pytest.approx(expected, rel=0.03)
    assert fit.values["drive.delay"] == pytest.approx(0.004, abs=2e-4)
    assert not fit.at_bound
    assert fit.axis.drive.torque_constant == fit.values["drive.torque_constant"]
    assert fit.law.rate.values()["driving"] == 0.2
    other = [
        MotionLog(position=log.position, drive_input=log.drive_input, dt=DT, start=0.0, proportional=GAINS[0])
        for log in pendulum()[:1]
    ]
    assert np.abs(fit.errors(other)[0]).max() < 2e-3


def test_an_axis_under_force_is_found_with_its_start_and_its_drift():
    axis, log = driven()
    fit = fit_motion(
        [log],
        "coulomb-viscous",
        axis=axis.replace(inertia=80.0),
        free={
            "coulomb_positive": (1.0, 60.0, 12.0),
            "coulomb_negative": (1.0, 60.0, 12.0),
            "viscous_positive": (10.0, 800.0, 100.0),
            "viscous_negative": (10.0, 800.0, 100.0),
            "inertia": (60.0, 130.0, 80.0),
            "start.velocity": (-0.02, 0.02, 0.0),
            "shape.drift": (-0.5, 0.5, 0.0),
        },
        unit="m",
        begin=1,
        iterations=20,
    )
    assert fit.rms < 3e-6
    assert fit.values["inertia"] == pytest.approx(95.0, rel=1e-3)
    assert fit.values["viscous_negative"] == pytest.approx(230.0, rel=1e-2)
    assert fit.values["coulomb_negative"] == pytest.approx(16.0, rel=1e-2)
    assert fit.values["start.velocity[0]"] == pytest.approx(0.005, abs=1e-4)
    assert fit.values["shape.drift"] == pytest.approx(0.05, rel=0.02)
    assert all(np.isfinite(e) and e >= 0.0 for e in fit.standard_errors.values())
    assert np.abs(fit.errors()[0]).max() < 1e-5


def test_the_batch_is_what_the_engine_gives():
    logs = pendulum()
    problem = MotionProblem(
        LawShape.from_name("gear-load"), logs, PENDULUM, {"drive.proportional_factor": (0.5, 2.0)}
    )
    values = {**PENDULUM.law.rate.values(), "drive.proportional_factor": 1.0}
    same, twice = problem.predict([values, {**values, "drive.proportional_factor": 2.0}])[1]
    assert same == pytest.approx(logs[1].position, abs=1e-12)
    axis = PENDULUM.replace(drive=PENDULUM.drive.replace(proportional=2 * GAINS[1]))
    assert twice == pytest.approx(forward(axis, GOALS[1], dt=DT).position[0], abs=1e-12)
    nonsense, alone = problem.predict([{**values, "coulomb": np.nan}, values])[
        1
    ]  # what no law has spoils no other
    assert np.all(np.isnan(nonsense)) and np.array_equal(alone, same)
    point = problem.point(values)
    assert problem.values(point) == pytest.approx(values)
    assert problem.residuals(point[None]).shape == (1, problem.size)


def test_the_same_seed_gives_the_same_fit_and_progress_is_told():
    axis, log = driven(600)
    told = []
    free = {"coulomb": (1.0, 60.0), "viscous": (10.0, 800.0)}
    options = {"axis": axis, "free": free, "unit": "m", "begin": 16, "descend": 2, "iterations": 3}
    fits = [fit_motion([log], "m1", tick=lambda *now: told.append(now), **options) for _ in range(2)]
    assert fits[0].values == fits[1].values
    assert {stage for stage, _, _ in told} == {"short", "descent", "refined"}
    assert told[-1][2] == pytest.approx(fits[1].rms)


def test_an_interruption_keeps_the_best_so_far():
    axis, log = driven(600)

    def stop(stage, iteration, error):
        if stage == "descent":
            raise KeyboardInterrupt

    fit = fit_motion([log], "m1", axis=axis, free={"coulomb": (1.0, 60.0, 5.0)}, unit="m", begin=1, tick=stop)
    assert fit.interrupted
    assert any("interrupted" in sentence for sentence in fit.warnings)


def test_what_a_motion_does_not_show_is_said():
    n = 800
    force = np.full(n, 40.0)
    axis = Axis(law=Law(rate=M1(coulomb=5.0, viscous=2.0)), inertia=50.0)
    log = MotionLog(position=forward(axis, force, dt=DT).position[0], drive_input=force, dt=DT)
    free = {"coulomb": (0.1, 30.0, 4.0), "viscous": (0.1, 50.0, 2.0), "offset": (-20.0, 20.0, 0.0)}
    fit = fit_motion([log], "m1", axis=axis, free=free, unit="m", begin=1, iterations=10)
    assert "coulomb" in fit.unseen
    assert "offset" in fit.unseen["coulomb"]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_gears_resist_more_where_the_motor_drives(way):
    rate = GearLoad(coulomb=1.0, load=0.1, driving=0.3, driven=0.05, stribeck_velocity=0.1, viscous=2.0)
    row = Law(rate=rate).row()
    lo, hi, _ = kernels.limits(rate.KIND, row, 0.0, (0.0, -way * 10.0), 20.0)
    driving, driven_back = (hi, -lo) if way > 0 else (-lo, hi)
    assert driving == pytest.approx(1.0 + (0.1 + 0.3) * 10.0)
    assert driven_back == pytest.approx(1.0 + (0.1 + 0.05) * 10.0)
    fast = kernels.limits(rate.KIND, row, way * 5.0, (0.0, -way * 10.0), 20.0)
    assert max(fast[1], -fast[0]) == pytest.approx(1.0 + 0.1 * 10.0)
    assert fast[2] == way * 10.0


def test_windows_start_where_the_motion_was():
    _, log = driven(1000)
    pieces = log.windows(0.5)
    assert log.velocity is not None
    assert sum(len(p.position) for p in pieces) == 1000
    assert [p.launch for p in pieces] == pytest.approx([0.015, *log.velocity[250::250]])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"free": {"coulom": (0.0, 1.0)}}, "Did you mean 'coulomb'"),
        ({"free": {"drive.resistence": (0.1, 1.0)}}, "Did you mean 'drive.resistance'"),
        ({"free": {"coulomb": (1.0, 0.5)}}, "lower bound below"),
        ({"free": {"coulomb": (0.5, 1.0, 2.0)}}, "start between"),
        ({"free": {"coulomb": "wide"}}, "is not a range"),
        ({"free": {"inertia": (-1.0, 1.0)}}, "inertia"),
        ({"axis": None}, "Axis"),
        ({"signal": "velocity"}, "No velocity"),
        ({"logs": []}, "at least one log"),
    ],
)
def test_bad_input_is_answered_in_words(change, words):
    axis = Axis(law=Law(rate=Coulomb(coulomb=1.0)), inertia=1.0)
    log = MotionLog(position=TIME**2, drive_input=np.ones_like(TIME), dt=DT)
    given = {"logs": [log], "axis": axis, "law": "m1", **change}
    with pytest.raises(InvalidInput, match=words):
        fit_motion(given.pop("logs"), given.pop("law"), **given)


def test_logs_that_show_nothing_are_refused():
    axis = Axis(law=Law(rate=Coulomb(coulomb=1.0)), inertia=1.0)
    still = MotionLog(position=np.zeros(100), drive_input=np.ones(100), dt=DT)
    with pytest.raises(NotIdentifiable, match="never moves"):
        fit_motion([still], "m1", axis=axis)
    short = MotionLog(position=np.linspace(0, 1, 20), drive_input=np.ones(20), dt=DT)
    with pytest.raises(NotIdentifiable, match="too few"):
        fit_motion([short], "m1", axis=axis)
    with pytest.raises(InvalidInput, match="one length"):
        MotionLog(position=np.zeros(5), drive_input=np.zeros(4), dt=DT)
    with pytest.raises(UnknownName):
        fit_motion([short], "m7", axis=axis)
