"""The response of a friction law in four experiments: constant velocity, presliding, a mass on a spring, an oscillating
velocity.

Velocities and torques follow from the law, rounded to 1, 2 or 5 times a power of ten. So the examples of
`backdrive.laws.examples` go through the same experiments and can be compared by eye.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from backdrive.laws import REFERENCE, Law, kernels

#: Turning points of the presliding motion, in units of the break-away distance: three nested loops.
TURNS = (0.0, 3.0, 1.2, 2.2, 1.6, 3.0, -3.0, -1.2, -2.2, -1.6, -3.0, 3.0)
TICKS = 250  # of the presliding motion per stretch
SPEEDS = 48  # velocities of a steady curve
SETTLED = 400  # largest number of ticks until a constant velocity gives a constant torque
FREQUENCIES = (1.0, 10.0)  # of the oscillating velocity [Hz]
PERIOD = 600  # ticks of one of its periods
INERTIA = 1.0  # of the pulled mass [kg.m^2]
PULL = 4000  # ticks
LOADS = ((0.0, 0.0), (20.0, -10.0), (20.0, -30.0))  # motor's and external torque [N.m]
TEMPERATURES = (20.0, 40.0, 60.0)  # [degC]
CARRIED = (20.0, -20.0)  # load at those [N.m]


Curve = tuple[np.ndarray, np.ndarray]  # abscissas and ordinates, (n,) each


@dataclass(frozen=True, kw_only=True)
class Condition:
    """The load and the temperature at which a law is shown.

    Attributes:
        label: in words.
        load: motor's and external torque [N.m], (2,).
        temperature: [degC].
    """

    label: str
    load: tuple[float, float] = (0.0, 0.0)
    temperature: float = REFERENCE


@dataclass(frozen=True, kw_only=True)
class Scene:
    """The sizes of the four experiments.

    Attributes:
        velocity: near which the Stribeck effect has fallen to half [rad/s].
        torque: typical friction while the joint slides [N.m].
        stretch: distance of presliding [rad].
        spring: that pulls the mass [N.m/rad].
        speed: of the spring's other end [rad/s].
        duration: of the pull [s].
    """

    velocity: float
    torque: float
    stretch: float
    spring: float
    speed: float
    duration: float


def conditions(law: Law) -> list[Condition]:
    """Return one condition, or three loads or temperatures where the law depends on them."""
    if "temperature" in law.rate.NEEDS:
        return [Condition(label=f"{t:g} °C", load=CARRIED, temperature=t) for t in TEMPERATURES]
    if "load" in law.rate.NEEDS:
        return [
            Condition(label=f"{motor:g}, {external:g} N·m".replace("-", "\u2212"), load=(motor, external))
            for motor, external in LOADS
        ]
    return [Condition(label="")]


def scene(law: Law) -> Scene:
    """Return sizes at which the law's features are visible."""
    rate, element = law.rate.values(), law.element.values()
    v_s = rate.get("stribeck_velocity", 0.0) + REFERENCE * rate.get("stribeck_velocity_temperature", 0.0)
    velocity = _round(v_s if v_s > 0.0 else 0.05)
    torque = _round(float(np.mean(np.abs(law.torque(velocity * np.array([10.0, -10.0]))))))
    breakaway = max(law.coulomb()) or torque
    if "stiffness" in element:
        share = np.asarray(element.get("share", 1.0))
        stretch = float(np.max(share * breakaway / np.asarray(element["stiffness"])))
    else:
        stretch = element.get("distance", 0.01 * velocity)
    spring = (
        0.1 * torque / velocity
    ) ** 2 / INERTIA  # after break-away the mass reaches a few times `velocity`
    strongest = max(_hold(law, at) for at in conditions(law))
    return Scene(
        velocity=velocity,
        torque=torque,
        stretch=stretch,
        spring=spring,
        speed=0.4 * velocity,
        duration=_round(2.5 * max(strongest, torque) / (0.4 * velocity * spring)),
    )


def _hold(law: Law, at: Condition) -> float:
    """Return the torque at which a joint at rest breaks away [N.m]."""
    limits = kernels.of_kinds(kernels.limits, law.rate.KIND)
    lo, hi, _ = limits(law.rate.KIND, law.row(), 0.0, at.load, at.temperature)
    return max(-lo, hi)


def _round(x: float) -> float:
    """Return the nearest of 1, 2, 5 times a power of ten, 1 for 0."""
    if not x > 0.0:
        return 1.0
    ten = 10.0 ** np.floor(np.log10(x))
    steps = np.array([1.0, 2.0, 5.0, 10.0]) * ten
    return float(f"{steps[np.argmin(np.abs(np.log(steps / x)))]:.3g}")


def run(law: Law, increments: np.ndarray, period: float, at: Condition) -> np.ndarray:
    """Return the torque of a prescribed motion, starting at rest with a relaxed element.

    Args:
        law: friction.
        increments: of the position, tick by tick [rad], (n,).
        period: of a tick [s].
        at: load and temperature.

    Returns:
        Friction torque [N.m], (n,).
    """
    rate, element, p, x = law.rate.KIND, law.element.KIND, law.row(), law.state()
    load, step = at.load, kernels.of_kinds(kernels.step, rate, element)
    return np.array(
        [step(rate, element, p, x, dp, period, load, at.temperature) for dp in increments.tolist()]
    )


def steady(law: Law, velocity: np.ndarray, at: Condition) -> np.ndarray:
    """Return the steady torque at constant velocities, after the presliding transient [N.m], (n,).

    Args:
        law: friction.
        velocity: [rad/s], (n,).
        at: load and temperature.
    """
    rate, element, p = law.rate.KIND, law.element.KIND, law.row()
    load, size, out = at.load, scene(law), np.empty(velocity.size)
    step = kernels.of_kinds(kernels.step, rate, element)
    for i, v in enumerate(velocity.tolist()):
        x, before, torque = law.state(), np.inf, 0.0
        dt = max(0.25 * size.stretch / abs(v), 5e-3)
        for _ in range(SETTLED):
            torque = step(rate, element, p, x, v * dt, dt, load, at.temperature)
            if abs(torque - before) <= 1e-9 * abs(torque):
                break
            before = torque
        out[i] = torque
    return out


def speeds(law: Law) -> np.ndarray:
    """Return the speeds of a steady curve [rad/s], (n,), at equal ratios, from 1/50 to 30 times the speed of the scene."""
    return scene(law).velocity * np.geomspace(0.02, 30.0, SPEEDS)


def presliding(law: Law, mean_speed: float, at: Condition) -> Curve:
    """Return torque over position along nested reversals, each leg half a cosine.

    Args:
        law: friction.
        mean_speed: of every leg [rad/s].
        at: load and temperature.
    """
    stretch, parts = scene(law).stretch, [np.zeros(1)]
    for a, b in zip(TURNS[:-1], TURNS[1:], strict=False):
        u = np.arange(1, round(TICKS * abs(b - a)) + 1) / round(TICKS * abs(b - a))
        parts.append(stretch * (a + (b - a) * 0.5 * (1.0 - np.cos(np.pi * u))))
    position = np.concatenate(parts)
    torque = run(law, np.diff(position), stretch / (TICKS * mean_speed), at)
    return position[1:], torque


def spring_end(law: Law) -> Curve:
    """Return the time of the pull [s] and the position of the spring's driven end, which moves at constant speed [rad]."""
    size = scene(law)
    time = size.duration / PULL * np.arange(1, PULL + 1)
    return time, size.speed * time


def pull(law: Law, at: Condition) -> np.ndarray:
    """Return the positions of a mass pulled by a spring [rad], (n,), integrated implicitly in all forces."""
    rate, element, p, x = law.rate.KIND, law.element.KIND, law.row(), law.state()
    size, load = scene(law), at.load
    solve = kernels.of_kinds(kernels.solve, rate, element)
    step = kernels.of_kinds(kernels.step, rate, element)
    dt, position = size.duration / PULL, np.empty(PULL)
    soft = (
        dt / INERTIA / (1.0 + dt * dt * size.spring / INERTIA)
    )  # velocity per force of a tick, with the spring's reaction
    q = v = 0.0
    for i, target in enumerate(spring_end(law)[1].tolist()):
        v_free = soft * (INERTIA * v / dt + size.spring * (target - q))
        v = solve(rate, element, p, x, v_free, dt, soft, load, at.temperature)
        step(rate, element, p, x, v * dt, dt, load, at.temperature)
        q += v * dt
        position[i] = q
    return position


def lag(law: Law, frequency: float, at: Condition) -> Curve:
    """Return torque over velocity for a positive velocity that oscillates about the scene's: the last of four periods.

    Args:
        law: friction.
        frequency: of the velocity [Hz].
        at: load and temperature.
    """
    dt = 1.0 / (frequency * PERIOD)
    velocity = scene(law).velocity * (1.1 + np.sin(2.0 * np.pi * np.arange(4 * PERIOD + 1) / PERIOD))
    torque = run(law, velocity * dt, dt, at)
    return velocity[-PERIOD - 1 :], torque[-PERIOD - 1 :]
