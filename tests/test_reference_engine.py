"""Forward dynamics against the same equations in plain Python: drives, controllers, one mass and two, friction that sticks."""

from math import cos, sin

import numpy as np
import pytest

from backdrive.engine import Axis, DriveModel, forward
from backdrive.engine.drives import along, input_at
from backdrive.engine.servo import Servo
from backdrive.engine.servo import tick as servo_tick
from backdrive.engine.tick import Tick
from backdrive.errors import InvalidInput
from backdrive.laws import CoulombViscous, GearLoad, HaywardArmstrong, Law
from backdrive.status import Status

DT, N = 2e-3, 400
F_P, F_N, S_P, S_N = 3.0, 2.0, 0.7, 0.4
RATE = CoulombViscous(coulomb_positive=F_P, coulomb_negative=F_N, viscous_positive=S_P, viscous_negative=S_N)
T = DT * np.arange(N)
INPUT = 0.4 * np.sin(9.0 * T) + 0.1 * np.sin(40.0 * T)


def clip(x, limit):
    return min(max(x, -limit), limit)


def late(r, t, hold):
    """Input at a time in samples, interpolated or held, its ends going on."""
    t = min(max(t, 0.0), len(r) - 1.0)
    return r[int(t)] if hold else float(np.interp(t, np.arange(len(r)), r))


class Drive:
    """The equations of `engine.drives`, written out."""

    def __init__(self, d: DriveModel, q, r):
        self.d, self.sum, self.q, self.v, self.r = d, 0.0, q, 0.0, r

    def torque(self, r, q, v, h, supply=None):
        d, before = self.d, self.r
        self.r = r
        if d.controller == "open":
            y = clip(d.gain * r, d.limit)
        else:
            if d.controller == "position":
                e = r - q
                self.v += h / (h + d.filter_time) * ((q - self.q) / h - self.v)
                self.q = q
                rest = d.derivative * ((r - before) / h - self.v)
            else:
                e, rest = r - v, 0.0
            y = d.proportional * e + rest + d.integral * (self.sum + h * e)
            if abs(y) <= d.limit or y * e <= 0.0:  # the integral stands still at the limit
                self.sum += h * e
            y = clip(y, d.limit)
        if d.actuator == "torque":
            return y
        i = ((d.supply if supply is None else supply) * y - d.torque_constant * v) / (
            d.resistance + d.supply_resistance * y * y
        )
        return d.torque_constant * i / (1.0 + d.saturation * abs(i))


def held(v_free, soft, widening=0.0):
    """v + soft (F sgn(v) + sigma v) contains v_free, the bounds wider by `widening`."""
    up, down = soft * (F_P + widening), soft * (F_N + widening)
    if v_free > up:
        return (v_free - up) / (1.0 + soft * S_P)
    if v_free < -down:
        return (v_free + down) / (1.0 + soft * S_N)
    return 0.0


def simulate(axis: Axis, r, q, v, substeps, supply=None, enabled=None):
    """Drift half a step, kick, drift half a step: positions, velocities and torques at the samples."""
    h, d = DT / substeps, axis.drive
    drive = Drive(d, q, late(r, -d.delay / DT, d.hold))
    g = lambda x: axis.gravity_sin * sin(x) + axis.gravity_cos * cos(x) + axis.offset  # noqa: E731
    mu, M, L = axis.load_dependence, axis.inertia, axis.load_inertia
    rigid = np.isinf(axis.stiffness)
    p, w, carried = q, v, g(q)
    if not rigid:
        for _ in range(200):
            q = p - g(q) / axis.stiffness
        carried = g(q)
    out = []
    for k in range(len(r)):
        on = enabled is None or enabled[k] > 0.0
        for i in range(substeps):
            u = 0.0
            if on:
                u = drive.torque(
                    late(r, k + i / substeps - d.delay / DT, d.hold),
                    p,
                    w,
                    h,
                    None if supply is None else supply[k],
                )
            if i == 0:
                out.append((p, w, u))
            middle = p + 0.5 * h * w
            if rigid:
                before, soft = w, h / (M + L)
                w = held(w + soft * (u - g(middle)), soft, mu * abs(carried))
                p = middle + 0.5 * h * w
                carried = g(middle) + L * (w - before) / h
                continue
            middle_q = q + 0.5 * h * v
            c = axis.stiffness * (middle - middle_q) + axis.damping * (w - v)
            w_free, v_free = w + h / M * (u - c), v + h / L * (c - g(middle_q))
            if axis.friction_side == "load":
                w, v = w_free, held(v_free, h / L, mu * abs(carried))
            else:
                w, v = held(w_free, h / M, mu * abs(carried)), v_free
            p, q, carried = middle + 0.5 * h * w, middle_q + 0.5 * h * v, c
    return np.array(out)


PID = {"proportional": 300.0, "derivative": 9.0, "integral": 900.0}
DRIVES = {
    "open": DriveModel(gain=25.0, limit=8.0),
    "late": DriveModel(gain=25.0, delay=7.3e-3),
    "held": DriveModel(gain=25.0, delay=7.3e-3, hold=True),
    "position": DriveModel(controller="position", **PID, filter_time=3e-3, limit=14.0),
    "velocity": DriveModel(controller="velocity", proportional=30.0, integral=200.0, limit=9.0),
    "motor": DriveModel(
        actuator="motor", gain=1.8, limit=0.9, supply=24.0, torque_constant=2.5, resistance=1.5,
        supply_resistance=0.4, saturation=0.03,
    ),
    "servo": DriveModel(
        controller="position", actuator="motor", **PID, limit=12.0, torque_constant=1.5, resistance=1.2, delay=2e-3
    ),
}  # fmt: skip
AXES = {
    "one mass": Axis(law=Law(rate=RATE), inertia=0.5),
    "loaded": Axis(
        law=Law(rate=RATE), inertia=0.3, load_inertia=0.4, gravity_sin=4.0, gravity_cos=-2.0, offset=0.5, load_dependence=0.15
    ),
    "yielding": Axis(
        law=Law(rate=RATE), inertia=0.3, load_inertia=0.4, stiffness=900.0, damping=2.0, gravity_sin=4.0, gravity_cos=1.0,
        offset=-0.5, load_dependence=0.1,
    ),
    "yielding, friction outside": Axis(
        law=Law(rate=RATE), inertia=0.3, load_inertia=0.4, stiffness=900.0, damping=2.0, gravity_cos=3.0, friction_side="load",
        load_dependence=0.2,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", AXES)
@pytest.mark.parametrize("drive", DRIVES)
def test_an_axis_moves_as_its_equations_say(drive, name):
    axis = AXES[name].replace(drive=DRIVES[drive])
    for substeps in (1, 3):
        got = forward(axis, INPUT, dt=DT, position=0.2, velocity=-0.3, substeps=substeps)
        wanted = simulate(axis, INPUT, 0.2, -0.3, substeps)
        for channel, column in zip((got.position, got.velocity, got.torque), wanted.T, strict=True):
            assert channel[0] == pytest.approx(column, rel=1e-7, abs=1e-9)


def test_supplies_and_switches_are_those_of_the_sample():
    axis = AXES["loaded"].replace(drive=DRIVES["motor"])
    supply, enabled = 20.0 + 4.0 * np.sin(30.0 * T), (np.arange(N) % 90 < 60).astype(float)
    got = forward([axis, axis], INPUT, dt=DT, supply=supply, enabled=enabled, position=0.1)
    wanted = simulate(axis, INPUT, 0.1, 0.0, 1, supply, enabled)
    assert got.torque[1] == pytest.approx(wanted[:, 2], rel=1e-8, abs=1e-10)
    assert got.position[0] == pytest.approx(wanted[:, 0], rel=1e-8)
    assert np.all(got.torque[0][enabled == 0.0] == 0.0)


def test_lanes_run_on_their_logs():
    axes = [AXES["one mass"].replace(drive=DRIVES["open"]), AXES["loaded"].replace(drive=DRIVES["held"])]
    inputs = np.stack([INPUT, -0.5 * INPUT[::-1]])
    got = forward(axes * 2, inputs, dt=DT, position=[0.1, 0.4], velocity=[0.2, -0.1], log=[0, 1, 1, 0])
    for lane, (axis, m) in enumerate(zip(axes * 2, (0, 1, 1, 0), strict=True)):
        wanted = simulate(axis, inputs[m], (0.1, 0.4)[m], (0.2, -0.1)[m], 1)
        assert got.position[lane] == pytest.approx(wanted[:, 0], rel=1e-8, abs=1e-10)


def test_the_torque_along_a_given_motion():
    for name in ("position", "velocity", "motor", "late"):
        d = DRIVES[name]
        q, v, out = 0.3 * np.cos(5.0 * T), -1.5 * np.sin(5.0 * T), np.empty(N)
        along(d.row(), np.zeros(4), INPUT, np.array([np.nan]), q, v, DT, out)
        drive = Drive(d, q[0], late(INPUT, -d.delay / DT, d.hold))
        wanted = [drive.torque(late(INPUT, k - d.delay / DT, d.hold), q[k], v[k], DT) for k in range(N)]
        assert out == pytest.approx(np.array(wanted), rel=1e-9, abs=1e-12)
    r = np.array([1.0, 3.0, 2.0])
    for t, wanted, kept in (
        (-0.1, 1.0, 1.0),
        (0.0, 1.0, 1.0),
        (0.25, 1.5, 1.0),
        (1.5, 2.5, 3.0),
        (2.0, 2.0, 2.0),
        (7.0, 2.0, 2.0),
    ):
        assert input_at(r, t, 0.0) == pytest.approx(wanted) and input_at(r, t, 1.0) == kept


def test_the_servo_tick_by_tick():
    servo = Servo(proportional=50.0, derivative=3.0, integral=80.0, filter_time=4e-3)
    d = DriveModel(
        controller="position", proportional=50.0, derivative=3.0, integral=80.0, filter_time=4e-3, limit=6.0
    )
    g, s, drive = np.r_[0.0, servo.row()], np.zeros(3), Drive(d, 0.0, 0.0)
    before = 0.0
    for k in range(200):
        r, q = 0.3 * sin(0.05 * k), 0.2 * sin(0.05 * k - 0.4)
        got = servo_tick(g, 1, s, DT, r, (r - before) / DT, q, 6.0)
        assert got == pytest.approx(drive.torque(r, q, 0.0, DT), rel=1e-9, abs=1e-12)
        before = r
    tuned = Servo.from_bandwidth(2.0, 30.0, filter_time=1e-3)
    assert tuned.gains() == {
        "proportional": 1800.0,
        "derivative": 120.0,
        "integral": 5400.0,
        "filter_time": 1e-3,
    }


def test_a_tick_of_several_joints_keeps_what_it_cannot_believe():
    laws = [
        Law(rate=RATE, element=HaywardArmstrong(stiffness=1e3)),
        Law(rate=RATE),
        Law(rate=GearLoad(coulomb=1.0, load=0.5)),
    ]
    tick = Tick(laws, dt=DT)
    tick.load[2], tick.temperature[:] = (3.0, -4.0), 35.0
    assert tick.tick(np.array([1e-3, 2e-3, -1e-3])) == pytest.approx([1.0, F_P + S_P * 1.0, -3.0])
    assert tick.tick(np.array([np.nan, -2e-3, 0.0])) == pytest.approx([1.0, -F_N - S_N * 1.0, 0.0])
    assert tick.codes.tolist() == [Status.NOT_FINITE, Status.OK, Status.OK]
    assert tick.tick(np.zeros(2)) == pytest.approx([1.0, -F_N - S_N * 1.0, 0.0])
    assert tick.codes.tolist() == [Status.NOT_FINITE] * 3
    assert tick.tick(np.array([0.5e-3, 0.0, 1e-3])) == pytest.approx([1.5, 0.0, 3.0])
    tick.reset()
    assert tick.torque.tolist() == [0.0] * 3 and tick.tick(np.array([1e-3, 0.0, 0.0]))[0] == pytest.approx(
        1.0
    )
    for wrong in (lambda: Tick([], dt=DT), lambda: Tick(laws, dt=0.0), lambda: Tick(laws, dt=np.inf)):
        with pytest.raises(InvalidInput):
            wrong()


@pytest.mark.parametrize(
    ("name", "zero", "negative"),
    [("limit", False, False), ("supply", False, False), ("torque_constant", False, False), ("resistance", False, False),
     ("proportional", True, False), ("derivative", True, False), ("integral", True, False), ("filter_time", True, False),
     ("supply_resistance", True, False), ("saturation", True, False), ("gain", True, True), ("delay", True, True)],
)  # fmt: skip
def test_what_a_drive_may_be(name, zero, negative):
    for value, fine in ((2, True), (0.0, zero), (-1.0, negative), (np.nan, False)):
        if fine:
            kept = getattr(DriveModel(**{name: value}), name)
            assert kept == value and isinstance(kept, float)
        else:
            with pytest.raises(InvalidInput, match=name):
                DriveModel(**{name: value})


def test_what_an_axis_and_a_servo_may_be():
    good = {"law": Law(rate=RATE), "inertia": 1.0}
    for wrong in ({"inertia": 0.0}, {"load_inertia": -1.0}, {"load_inertia": np.inf}, {"stiffness": 0.0}, {"damping": -1.0},
                  {"damping": np.inf}, {"gravity_sin": np.nan}, {"gravity_cos": np.inf}, {"offset": np.nan},
                  {"load_dependence": -0.1}, {"load_dependence": np.inf}, {"friction_side": "both"},
                  {"stiffness": 10.0}):  # fmt: skip
        with pytest.raises(InvalidInput):
            Axis(**(good | wrong))
    for name in ("proportional", "derivative", "integral", "filter_time"):
        for value in (-1.0, np.inf, np.nan):
            with pytest.raises(InvalidInput, match=name):
                Servo(**({"proportional": 1.0, "derivative": 1.0} | {name: value}))
    axis = Axis(**good)
    for wrong in ({"dt": 0.0}, {"dt": np.inf}, {"substeps": 0}, {"position": [0.0, 1.0]}, {"position": np.nan},
                  {"velocity": np.inf}, {"log": [1]},
                  {"log": [-1]}, {"log": [0, 0]}, {"supply": np.ones(3)}, {"enabled": np.full(4, np.nan)},
                  {"temperature": np.ones((2, 4))}):  # fmt: skip
        with pytest.raises(InvalidInput):
            forward(axis, np.ones(4), **({"dt": DT} | wrong))
    for axes, inputs in (
        ([], np.ones(4)),
        ([axis] * 3, np.ones((2, 4))),
        (axis, np.array([np.nan])),
        (axis, np.zeros(0)),
        ("axis", np.ones(4)),
    ):
        with pytest.raises(InvalidInput):
            forward(axes, inputs, dt=DT)
