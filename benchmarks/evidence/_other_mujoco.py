"""MuJoCo's system identification (`mujoco.sysid`) of a single axis: inertia, gravity, offset, damping and friction loss.

As in its examples, the log is cut into windows. Each is simulated from its measured start under the logged torque, and the
positions are fitted by least squares.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from mujoco import sysid

WINDOW = 0.5  # length of a simulated window [s]
ROUNDS = 20  # iterations of the optimizer, at most
FINEST = 1 / 250  # shortest step of the simulation; of a log with more samples every few are used [s]
XML = """
<mujoco><option timestep="{step}" integrator="implicitfast" gravity="0 0 -1e5"><flag contact="disable"/></option><worldbody>
<body name="arm"><inertial pos="0 0 0" mass="1e-5" diaginertia="1e-8 1e-8 1e-8"/>
<joint name="axis" type="hinge" axis="0 -1 0"/></body>
</worldbody><actuator><general name="torque" joint="axis" biastype="affine"/></actuator>
<sensor><jointpos name="position" joint="axis"/></sensor></mujoco>
"""


def _inertia(spec, p) -> None:
    spec.joint("axis").armature = float(p.value[0])


def _gravity(spec, p) -> None:
    """Place a weight of 1 N, nearly without mass, so that its torque is a sin q + b cos q, a and b being its coordinates [m]."""
    spec.body("arm").ipos = [float(p.value[1]), 0.0, -float(p.value[0])]


def _offset(spec, p) -> None:
    bias = np.array(spec.actuator("torque").biasprm)
    bias[0] = -float(p.value[0])
    spec.actuator("torque").biasprm = bias


def _damping(spec, p) -> None:
    spec.joint("axis").damping = [float(p.value[0]), 0.0, 0.0]


def _friction(spec, p) -> None:
    spec.joint("axis").frictionloss = float(p.value[0])


def fit(
    t: np.ndarray, q: np.ndarray, v: np.ndarray, tau: np.ndarray, start: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the parameters by name.

    Args:
        t: uniform time [s], (n,).
        q: position [rad], (n,).
        v: velocity, of which only that at the start of a window is used [rad/s], (n,).
        tau: torque [N.m], (n,).
        start: of inertia, gravity's two, offset, damping and friction loss [SI], (6,).
    """
    thin = max(1, round(FINEST / (t[1] - t[0])))
    t, q, v, tau = (x[::thin] for x in (t, q, v, tau))
    spec = mujoco.MjSpec.from_string(XML.format(step=t[1] - t[0]))
    model = spec.compile()
    width = round(WINDOW / (t[1] - t[0]))
    states, controls, sensors = [], [], []
    for first in range(0, t.size - width, width):
        rows = slice(first, first + width)
        states.append(sysid.create_initial_state(model, q[first : first + 1], v[first : first + 1]))
        times = t[rows] - t[first]
        controls.append(sysid.TimeSeries.from_control_names(times, tau[rows, None], model))
        sensors.append(sysid.TimeSeries.from_names(times, q[rows, None], model))
    logs = sysid.ModelSequences("axis", spec, [str(k) for k in range(len(states))], states, controls, sensors)
    wanted = sysid.ParameterDict()
    for name, value, low, high, change in (
        ("inertia", start[0], 1e-3, 10.0, _inertia),
        ("gravity", start[1:3], [-50.0] * 2, [50.0] * 2, _gravity),
        ("offset", start[3], -20.0, 20.0, _offset),
        ("damping", max(start[4], 1e-3), 0.0, 20.0, _damping),
        ("friction", max(start[5], 1e-3), 0.0, 50.0, _friction),
    ):
        wanted.add(sysid.Parameter(name, value, low, high, modifier=change))
    found, _ = sysid.optimize(
        wanted, sysid.build_residual_fn(models_sequences=[logs]), verbose=False, max_iters=ROUNDS
    )
    return {
        name: np.array(found[name].value) for name in ("inertia", "gravity", "offset", "damping", "friction")
    }


Torque = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def model_of(p: dict[str, np.ndarray]) -> tuple[Callable[[np.ndarray], np.ndarray], Torque]:
    """Return friction by velocity, and torque by position, velocity and acceleration."""

    def friction(v: np.ndarray) -> np.ndarray:
        return p["damping"][0] * v + p["friction"][0] * np.sign(v)

    def torque(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        pull = p["gravity"][0] * np.sin(q) + p["gravity"][1] * np.cos(q)
        return p["inertia"][0] * a + pull + p["offset"][0] + friction(v)

    return friction, torque
