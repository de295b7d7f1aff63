"""Tests for fitting/ without torque: `fit` and its command from the drive's input, and the intervals of what was found."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from backdrive.cli import app
from backdrive.engine import Axis, DriveModel, forward
from backdrive.errors import InvalidInput, UnknownName
from backdrive.identification import identify
from backdrive.identification.dynamic.drive_stretch import model_of
from backdrive.laws import CoulombViscous, Law, StribeckGauss
from backdrive.logs.log import Drive, Joint, Log

DT = 1e-3
TIME = DT * np.arange(6000)
CURVE = {"coulomb": 1.0, "breakaway": 1.5, "stribeck_velocity": 0.05, "viscous": 0.4}
SERVO = {"proportional": 60.0, "derivative": 3.0}
GOAL = 0.6 * np.sin(2 * np.pi * 0.31 * TIME) + 0.2 * np.sin(2 * np.pi * 1.3 * TIME)


def recorded(axis, given, drive, noise=2e-5, seed=0) -> Log:
    motion = forward(axis, given, dt=DT)
    position = motion.position[0] + noise * np.random.default_rng(seed).standard_normal(len(given))
    return Log(
        time=DT * np.arange(len(given)),
        joints=(Joint(name="elbow", encoder_counts=1e5),),
        position=position[:, None],
        drive_input=given[:, None],
        drive=drive,
    )


def servo_axis(**gains) -> Axis:
    drive = DriveModel(controller="position", delay=0.002, **(SERVO | gains))
    return Axis(law=Law(rate=StribeckGauss(**CURVE)), inertia=0.05, drive=drive, gravity_sin=1.2)


@pytest.fixture(scope="module")
def servo_log():
    return recorded(servo_axis(), GOAL, Drive(law="position", gains=SERVO))


@pytest.fixture(scope="module")
def found(servo_log):
    return identify(servo_log, law="coulomb-viscous,stribeck-gauss")


def test_a_servo_log_without_torque_gives_law_inertia_gravity_and_delay(found):
    (friction,) = found.model.joints
    assert found.choice().chosen == "stribeck-gauss"
    assert found.choice().unit == "rad"
    assert found.choice().candidate().held_out < 5e-5
    for name, value in CURVE.items():
        assert getattr(friction.law.rate, name) == pytest.approx(value, rel=0.03)
        low, high = found.intervals["elbow"][name]
        assert low < getattr(friction.law.rate, name) < high
    values = {n: e.value for n, e in friction.dynamics.items()}
    assert values["inertia"] == pytest.approx(0.05, rel=0.02)
    assert values["gravity_sin"] == pytest.approx(1.2, rel=0.01)
    assert values["drive.delay"] == pytest.approx(0.002, abs=1e-4)
    assert "drive's input" in friction.method


# the second log begins with a jump of the goal: its velocity at the start has to be sought
def test_logs_with_different_gains_are_one_fit_and_a_known_inertia_is_not_sought(servo_log, found):
    stiff = {"proportional": 120.0, "derivative": 3.0}
    other = recorded(servo_axis(**stiff), GOAL[::-1].copy(), Drive(law="position", gains=stiff), seed=1)
    result = identify([servo_log, other], law="stribeck-gauss", known={"inertia": 0.05, "offset": 0.0})
    (friction,) = result.model.joints
    assert friction.law.rate.coulomb == pytest.approx(1.0, rel=0.02)
    assert "inertia" not in result.intervals["elbow"]
    assert friction.dynamics["inertia"].value == 0.05
    smaller = recorded(servo_axis(), -0.7 * GOAL, Drive(law="position", gains=SERVO), seed=2)
    judged = identify(servo_log, law="stribeck-gauss", held_out=[smaller])
    assert judged.choice().candidate().held_out < 1e-4
    soft = recorded(
        servo_axis(), GOAL, Drive(law="position", gains={"proportional": 60.0, "derivative": 2.0})
    )
    with pytest.raises(InvalidInput, match="different drives"):
        identify([servo_log, soft], law="stribeck-gauss")


def test_an_axis_on_a_voltage_is_fitted_in_windows_with_its_resistance_sought():
    motor = {"torque_constant": 0.5, "resistance": 2.0}
    law = Law(
        rate=CoulombViscous(
            coulomb_positive=0.4, coulomb_negative=0.3, viscous_positive=0.05, viscous_negative=0.05
        )
    )
    axis = Axis(law=law, inertia=0.02, drive=DriveModel(actuator="motor", **motor))
    volts = 6.0 * np.sign(np.sin(2 * np.pi * 0.9 * TIME)) * (0.6 + 0.4 * np.sin(2 * np.pi * 0.23 * TIME))
    log = recorded(axis, volts, Drive(law="voltage", gains={"torque_constant": 0.5}), noise=1e-5)
    result = identify(
        log,
        law="coulomb-viscous",
        gravity=False,
        known={"inertia": 0.02, "offset": 0.0},
        bounds={"drive.resistance": (0.5, 8)},
    )
    (friction,) = result.model.joints
    assert friction.dynamics["drive.resistance"].value == pytest.approx(2.0, rel=0.03)
    assert friction.dynamics["drive.resistance"].unit == "ohm"
    assert friction.law.rate.coulomb_positive == pytest.approx(0.4, abs=0.03)


@pytest.mark.parametrize(
    ("drive", "says"),
    [
        (Drive(law="voltage", gains={"resistance": 2.0}), "torque_constant"),
        (Drive(law="duty", gains={"resistance": 2.0, "torque_constant": 1.0}), "supply"),
        (Drive(law="position"), "proportional"),
    ],
)
def test_a_drive_whose_numbers_are_missing_is_named(drive, says):
    with pytest.raises(InvalidInput, match=says):
        model_of(drive)
    assert model_of(drive, (says, "resistance")).controller in ("open", "position")


def test_bad_requests_are_answered_in_words(servo_log):
    silent = servo_log.replace(drive=None)
    with pytest.raises(InvalidInput, match="does not name the law of its drive"):
        identify(silent, law="coulomb-viscous")
    with pytest.raises(InvalidInput, match="neither"):
        identify(servo_log, law="coulomb-viscous", bounds={"stiffness_of_mind": (1.0, 2.0)})
    with pytest.raises(UnknownName, match="gains"):
        model_of(Drive(law="torque", gains={"gains": 1.0}))
    with pytest.raises(UnknownName, match="interval"):
        identify(servo_log, law="coulomb-viscous", interval="guess")
    with pytest.raises(UnknownName, match="mass"):
        identify(servo_log, law="coulomb-viscous", known={"mass": 1.0})


@pytest.mark.parametrize("kind", ["profile", "bootstrap"])
def test_profile_and_bootstrap_intervals_agree_with_the_covariance(kind, servo_log, found):
    result = identify(servo_log, law="stribeck-gauss", interval=kind)
    for name, (low, high) in found.intervals["elbow"].items():
        if name in CURVE:
            ends = np.array(result.intervals["elbow"][name])
            assert ends == pytest.approx([low, high], abs=(high - low))
            assert ends[0] < ends[1]


def test_a_profile_of_absolute_deviations_is_refused(servo_log):
    with pytest.raises(InvalidInput, match="bootstrap"):
        identify(servo_log, law="coulomb-viscous", loss="absolute", interval="profile")


def test_the_command_fits_from_the_goal_of_a_servo(servo_log, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table = np.column_stack([servo_log.time, servo_log.position, servo_log.drive_input])
    np.savetxt("log.csv", table, delimiter=",", header="t,q,goal", comments="")
    asked = ["identify", "log.csv", "--map", "u=goal", "--law", "stribeck-gauss", "--counts", "100000"]
    named = [*asked, "--drive", "position,proportional=60,derivative=3", "--known", "offset=0"]
    run = CliRunner().invoke(app, [*named, "--json", "-o", "m.json"])
    assert run.exit_code == 0, run.output
    document = json.loads(run.output)
    (choice,) = document["choices"].values()
    assert choice["unit"] == "rad"
    ((_, numbers),) = document["intervals"].items()
    assert numbers["coulomb"][0] < 1.0 < numbers["coulomb"][1] + 0.02
    table = CliRunner().invoke(app, [*named, "--report", "r.html"])
    assert table.exit_code == 0, table.output
    assert "95 % interval" in table.output
    for bad in ("position,proportional=a", "gravity", "torque,colour=1"):
        assert CliRunner().invoke(app, [*asked, "--drive", bad]).exit_code != 0
    assert CliRunner().invoke(app, asked).exit_code != 0


def test_the_evidence_shows_the_torque_of_the_drive_not_its_input(found):
    samples = found.evidence[0].samples
    assert "the drive's torque that was held out" in found.evidence[0].verdict
    wanted = SERVO["proportional"] * (np.interp(samples.time, TIME + 0.002, GOAL) - samples.position)
    wanted += SERVO["derivative"] * (
        np.interp(samples.time, TIME + 0.002, np.gradient(GOAL, DT)) - samples.velocity
    )
    inner = slice(50, -50)
    error = samples.torque[inner] - wanted[inner]
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.sqrt(np.mean(wanted[inner] ** 2))


def test_the_reference_is_the_input_of_a_position_controller(servo_log, found):
    goal = servo_log.replace(drive_input=None, drive=None, reference=servo_log.drive_input)
    drive = DriveModel(controller="position", **SERVO)
    result = identify(
        goal, law="stribeck-gauss", drive=drive, joints="elbow", bounds={"drive.delay": (0.0, 0.03)}
    )
    assert result.model.joints[0].law.rate.coulomb == pytest.approx(
        found.model.joints[0].law.rate.coulomb, rel=0.02
    )
    assert any("reference" in note and "input of the drive" in note for note in result.notes)
    with pytest.raises(InvalidInput, match="drive_input"):
        identify(goal, law="coulomb", drive=DriveModel(controller="velocity", proportional=1.0))


def continuous(seed):
    """Return goal and position of a servo that acts every 20 us on a goal 4 ms old, integrated here, at 500 Hz."""
    h, every, late, random = 2e-5, 100, 200, np.random.default_rng(seed)
    t = h * np.arange(round(8.0 / h))
    goal = 0.6 * np.sin(2 * np.pi * 0.31 * t + random.uniform(0, 6)) + 0.2 * np.sin(
        2 * np.pi * 1.3 * t + random.uniform(0, 6)
    )
    rate = np.gradient(goal, h)
    q, v, out = goal[0], 0.0, np.empty(t.size)
    for k in range(t.size):
        out[k] = q
        i = max(k - late, 0)
        free = v + h / 0.05 * (60.0 * (goal[i] - q) + 0.8 * (rate[i] - v) - 0.4 * v)
        most = h / 0.05 * (1.0 + 0.5 * np.exp(-((v / 0.05) ** 2)))
        v = 0.0 if abs(free) <= most else free - np.copysign(most, free)
        q += h * v
    return goal[::every], out[::every] + 2e-5 * random.standard_normal(t.size // every)


def test_what_depends_on_the_step_of_the_controller_is_said():
    """The 1 ms of the simulation take 0.03 N.m.s/rad and 0.0004 kg.m^2 from a servo that acts every 20 us."""
    goal, position = continuous(0)
    gains = {"proportional": 60.0, "derivative": 0.8}
    log = Log(
        time=2e-3 * np.arange(goal.size),
        joints=(Joint(name="elbow"),),
        position=position[:, None],
        drive_input=goal[:, None],
        drive=Drive(law="position", gains=gains),
    )
    wide, close = (identify(log, law="stribeck-gauss", step=step).model.joints[0] for step in (None, 1e-4))
    assert wide.law.rate.viscous == pytest.approx(0.43, abs=0.005)
    assert close.law.rate.viscous == pytest.approx(0.403, abs=0.005)
    assert wide.dynamics["inertia"].value == pytest.approx(0.0504, abs=1e-4)
    assert close.dynamics["inertia"].value == pytest.approx(0.05004, abs=1e-4)
    (said,) = [w for w in wide.warnings if "controller" in w]
    assert (
        "every 1 ms" in said
        and "viscous friction by up to 0.03 N.m.s/rad (3.8 % of" in said
        and "--step SECONDS" in said
    )
    assert wide.verdict.grade == "care" and not any("controller" in w for w in close.warnings)
