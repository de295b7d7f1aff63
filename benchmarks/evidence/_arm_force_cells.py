"""One drawn arm through `arm_force`: logs, models of different knowledge, and errors of torques and wrenches by state of motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from _arm_guided_hand import guided
from _arm_scene import NAMES, TICK, Arm, Record, drawn, free_motion, pushes, record

from backdrive import FrictionModel, Log, identify
from backdrive.control.estimators.arm import ArmForce
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, ct, ha
from backdrive.external import ForceEstimate, estimate_force
from backdrive.laws import Coulomb, CoulombViscous, Law, Polyline
from backdrive.logs.log import Joint
from backdrive.robot import Robot, parse_robot

EVERY = 2  # ticks from one logged instant to the next
BANDWIDTH = 40.0  # L of every method [1/s]
STATES = ("moving", "reversing", "rest")
METHODS = ("direct", "momentum", "disturbance", "extended", "kalman")
RISE = 0.15  # of a push [s]
BEND = 1.2e-3  # to break away, of the elastoplastic estimators [rad]
DEAD = 0.01  # zone of velocity of CT [rad/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Logs:
    """What one arm gave."""

    arm: Arm
    robot: Robot
    train: Log
    free: Log
    contact: Record
    loaded: Record


def log_of(r: Record) -> Log:
    """Return the log of a record; what the hand did is not in it."""
    joints = tuple(Joint(name=name) for name in NAMES)
    return Log(time=r.time, position=r.position, torque=r.torque, joints=joints)


def logs_of(seed: int, short: bool) -> Logs:
    """Return an arm, a motion to identify it by, one to calibrate by, one with pushes, and one with an unknown payload."""
    rng = np.random.default_rng(seed)
    arm = drawn(rng)
    train, free, contact = (60.0, 60.0, 24.0) if short else (150.0, 240.0, 40.0)

    def logged(a: Arm, seconds: float, hand: bool) -> Record:
        wrench = pushes(seconds, rng, rise=RISE) if hand else None
        return record(a, free_motion(seconds, rng), rng, wrench=wrench, every=EVERY)

    return Logs(
        arm=arm,
        robot=parse_robot(arm.urdf()),
        train=log_of(logged(arm, train, False)),
        free=log_of(logged(arm, free, False)),
        contact=logged(arm, contact, True),
        loaded=logged(replace(arm, payload=(1.0, (0.06, 0.0, 0.02))), contact, True),
    )


def models_of(nominal: FrictionModel) -> dict[str, FrictionModel]:
    """Return models that know less and less of friction, bodies and motors as identified."""
    lines, plain, none = [], [], []
    for one in nominal.joints:
        rate = one.law.rate
        assert isinstance(rate, Polyline)
        bare = replace(one, standard_errors={}, covariance=None, at_bound=())
        v = np.array(rate.velocity[1:])
        size = 0.5 * (np.array(rate.positive[1:]) + np.array(rate.negative[1:]))
        slope, rise = np.polyfit(v, size, 1)
        dry, wet = float(max(rise, 0.0)), float(max(slope, 0.0))
        line = CoulombViscous(
            coulomb_positive=dry, coulomb_negative=dry, viscous_positive=wet, viscous_negative=wet
        )
        lines.append(replace(bare, law=Law(rate=line)))
        plain.append(replace(bare, law=Law(rate=rate)))
        none.append(replace(bare, law=Law(rate=Coulomb(coulomb=0.0))))
    return {
        "none": replace(nominal, joints=tuple(none)),
        "Coulomb and viscous": replace(nominal, joints=tuple(lines)),
        "curve": replace(nominal, joints=tuple(plain)),
        "curve and load": nominal,
    }


def wrong_models(nominal: FrictionModel) -> dict[str, FrictionModel]:
    """Return the nominal model with 20 % too much friction, and with inertias 5 % too large."""
    assert nominal.arm is not None
    more, heavier = [], []
    for one in nominal.joints:
        rate = one.law.rate
        assert isinstance(rate, Polyline)
        bare = replace(one, standard_errors={}, covariance=None, at_bound=())
        curve = replace(
            rate,
            positive=tuple(1.2 * x for x in rate.positive),
            negative=tuple(1.2 * x for x in rate.negative),
        )
        growth = None if one.law.growth is None else one.law.growth.scale(1.2)
        more.append(replace(bare, law=Law(rate=curve, growth=growth)))
        motor = one.dynamics["inertia"]
        dynamics = dict(one.dynamics) | {"inertia": replace(motor, value=1.05 * motor.value)}
        heavier.append(replace(bare, dynamics=dynamics))
    bodies = replace(nominal.arm, parameters=tuple(1.05 * x for x in nominal.arm.parameters))
    return {
        "friction 20 % too large": replace(nominal, joints=tuple(more)),
        "inertia 5 % too large": replace(nominal, joints=tuple(heavier), arm=bodies),
    }


def states_of(estimate: ForceEstimate) -> np.ndarray:
    """Return the arm's state: 0 all joints move, 2 all rest, 1 anything between, (n,)."""
    state = np.stack([one.state for one in estimate.joints])
    return np.where((state == 0).all(axis=0), 0, np.where((state == 2).all(axis=0), 2, 1))


def true_along(r: Record, series: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return a series of a record at other instants, (n, 6)."""
    return np.column_stack([np.interp(time, r.time, column) for column in series.T])


def errors_of(estimate: ForceEstimate, r: Record) -> dict[str, tuple[float, float, int]]:
    """Return sums of squares of the errors of force [N^2] and moment [(N.m)^2], and samples, by the arm's state."""
    assert estimate.wrench is not None
    error = estimate.wrench.wrench - true_along(r, r.wrench, estimate.wrench.time)
    state = states_of(estimate)
    return {
        name: (
            float(np.sum(error[state == i, :3] ** 2)),
            float(np.sum(error[state == i, 3:] ** 2)),
            int(np.sum(state == i)),
        )
        for i, name in enumerate(STATES)
    }


def covered(
    estimate: ForceEstimate, r: Record, arm: Arm
) -> Iterator[tuple[str, str, int, int, float, float]]:
    """Yield joint, state, samples, samples inside the band, the band's width by friction at rest, and events of its calibration."""
    push = true_along(r, r.push, estimate.joints[0].time)
    carried = true_along(r, r.torque - r.friction, estimate.joints[0].time)
    for j, one in enumerate(estimate.joints):
        row = arm.joints[j]
        rest = 0.5 * (row[3] + row[4]) + row[6] + row[10] * np.abs(carried[:, j])
        inside = (one.lower <= push[:, j]) & (push[:, j] <= one.upper)
        made = estimate.calibrations[one.joint.name]
        for i, name in enumerate(STATES):
            k = one.state == i
            if k.any():
                band = getattr(made, name, None)
                width = float(np.median((one.upper - one.lower)[k] / rest[k]))
                yield (
                    one.joint.name,
                    name,
                    int(k.sum()),
                    int(inside[k].sum()),
                    width,
                    0.0 if band is None else band.events,
                )


def thesis_of(logs: Logs, nominal: FrictionModel, seed: int) -> dict[str, np.ndarray]:
    """Return, by estimator of friction, RMS errors of force held by a hand, and just before the end of every hands-off [N]."""
    g = guided(logs.arm, np.random.default_rng(seed), 3)
    base = ArmForce.from_model(nominal, logs.robot, method="disturbance", bandwidth=BANDWIDTH, frame="tool")
    off = np.flatnonzero(np.diff(g.held.astype(int), append=1) > 0)
    off = np.concatenate([np.arange(max(k - 200, 0), k) for k in off])
    late = round(base.lag(TICK) / TICK)
    told = {}
    for name in ("algFE", "CT", "HA"):
        frictions = []
        for one in nominal.joints:
            rate = Law(rate=one.law.rate, growth=one.law.growth)
            stiffness = max(one.law.coulomb()[0], 0.1) / BEND
            frictions.append(_estimator(name, rate, stiffness))
        out = replace(base, friction=tuple(frictions)).run(g.position, g.torque, TICK)
        error = np.linalg.norm(out.force[late:] - g.push[: g.time.size - late], axis=1)
        wrench = np.linalg.norm(out.wrench[late:, :3] - g.wrench[: g.time.size - late, :3], axis=1)
        held = g.held[: error.size].copy()
        held[:500] = False
        told[name] = np.array(
            [np.sqrt(np.mean(x**2)) for x in (wrench[held], error[held], error[off[off < error.size]])]
        )
    return told


def _estimator(name: str, rate: Law, stiffness: float) -> FrictionEstimator:
    if name == "CT":
        return ct(rate, DEAD)
    return alg_fe(rate, stiffness) if name == "algFE" else ha(rate, stiffness)


def nominal_of(logs: Logs) -> FrictionModel:
    """Return the arm's model by the package's own command, from its free motion."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "arm.urdf")
        path.write_text(logs.arm.urdf())
        return identify(logs.train, method="arm", urdf=str(path)).model


def estimated(model: FrictionModel, logs: Logs, r: Record, method: str = "extended", **more) -> ForceEstimate:
    """Return the estimate along a record at the tool."""
    return estimate_force(
        model, log_of(r), robot=logs.robot, frame="tool", method=method, bandwidth=BANDWIDTH, **more
    )
