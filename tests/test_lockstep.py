"""Axes in lockstep take the steps that each takes alone: the same numbers, bit for bit, with and without the compiler."""

import numpy as np
import pytest

from _kinds import of_a_kind
from backdrive.engine import Axis, DriveModel, forward
from backdrive.engine.forward import loop_of
from backdrive.engine.series import Lanes
from backdrive.laws import Law, MaxwellSlip
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES, example
from backdrive.laws.growth import Growth

DT, N, COUNT = 1e-3, 160, 11  # of which three fill a part of a group
TIME = DT * np.arange(N)
INPUT = 0.3 * np.sin(2.0 * np.pi * 3.0 * TIME) * (TIME > 0.02)
POSITION = dict(controller="position", proportional=900.0, derivative=20.0)
DRIVES = {
    "torque": dict(gain=60.0),
    "position": dict(**POSITION, limit=30.0, delay=0.0027, hold=True),
    "motor": dict(
        controller="velocity", proportional=3.0, integral=9.0, actuator="motor", supply=24.0, resistance=2.0
    ),
}


def axes(law, drive="torque", **changes):
    rng = np.random.default_rng(5)
    own = dict(
        inertia=0.08, gravity_sin=3.0, offset=0.2, load_inertia=0.05, drive=DriveModel(**DRIVES[drive])
    )
    result = [Axis(law=law, **(own | changes)) for _ in range(COUNT)]
    return [axis.replace(inertia=axis.inertia * rng.uniform(0.5, 2.0)) for axis in result]


def same(several, alone_too=(0, 5, 7, 8, 10), **options):
    inputs = np.array([INPUT * scale for scale in np.linspace(-2.0, 2.0, COUNT)])  # the sixth stays at rest
    together = forward(several, inputs, dt=DT, **options)
    assert np.ptp(together.position[0]) > 0.0
    for i in alone_too:
        given = {n: x[i : i + 1] if isinstance(x, np.ndarray) else x for n, x in options.items()}
        alone = forward(several[i], inputs[i], dt=DT, **given)
        for name in ("position", "velocity", "torque"):
            assert getattr(alone, name)[0].tobytes() == getattr(together, name)[i].tobytes()


@pytest.mark.parametrize("name", of_a_kind([*RATE_EXAMPLES, *ELEMENT_EXAMPLES]))
def test_axes_in_lockstep_are_each_by_itself(name):
    same(axes(example(name)))


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"stiffness": 4e3, "damping": 1.5},
        {"stiffness": 4e3, "friction_side": "load", "load_dependence": 0.1},
    ],
    ids=["rigid", "elastic", "on the load"],
)
def test_drives_and_transmissions(drive, changes):
    same(axes(example("lugre"), drive, **changes), substeps=2)


def test_channels_and_starts_of_each_axis():
    rng = np.random.default_rng(1)
    same(
        axes(example("m6"), "motor"),
        supply=20.0 + rng.uniform(size=(COUNT, N)),
        enabled=(rng.uniform(size=(COUNT, N)) < 0.9).astype(float),
        temperature=rng.uniform(10.0, 60.0, (COUNT, N)),
        position=rng.uniform(-1.0, 1.0, COUNT),
        velocity=rng.uniform(-1.0, 1.0, COUNT),
    )


@pytest.mark.parametrize("inertia", [1e-9, 1e300])
def test_masses_far_from_any(inertia):
    same(axes(example("lugre"), load_inertia=0.0, inertia=inertia, gravity_sin=0.0))


def test_what_has_a_loop_in_lockstep():
    def loop(laws, **fewest):
        lanes = Lanes(laws)
        return loop_of(lanes.rates, lanes.elements, lanes.rows, **fewest).__name__

    lugre, growing = (
        example("lugre"),
        Law(rate=example("lugre").rate, growth=Growth(load_driving=0.1, load_driven=0.1)),
    )
    rows = Law(rate=lugre.rate, element=MaxwellSlip(**MaxwellSlip.EXAMPLE))
    assert loop([lugre] * 8) == loop([lugre], fewest=1) == "together"
    for others in (
        [lugre] * 7,
        [lugre] * 7 + [example("m6")],
        [growing] * 8,
        [rows] * 8,
        [example("polyline")] * 8,
    ):
        assert loop(others) != "together"
