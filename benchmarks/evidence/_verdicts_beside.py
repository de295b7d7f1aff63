"""Planted trouble in what is logged beside a joint: the plan it was run along, another joint; and torque ramps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from _independent import STEP, Record, multisine, ramp_to_break_away, ramps, record
from _verdicts_scenes import Scene

from backdrive.plans import ConstantVelocity, Multisine, Sweep

DECIMALS = 6  # of printed positions [-]
NOISE = 2e-7  # of a fine encoder [rad]


def plan_of(scene: Scene) -> Any:
    """Return a plan of the package that a joint could be run along: one of three kinds."""
    kind, seed = scene.seed // 5 % 3, scene.seed
    if kind == 0:
        return Multisine(1.6, 0.15, 1.2, 12.0, periods=2, seed=seed)
    if kind == 1:
        return Sweep(0.8, scene.top, 8)
    return ConstantVelocity(1.6, tuple((scene.top * np.arange(1, 7) / 6.0).tolist()))


def along_plan(scene: Scene, clock: float) -> list[Record]:
    """Return the log of a plan whose clock runs so many times as fast."""
    plan = plan_of(scene)
    t = np.arange(round(plan.duration / STEP)) * STEP
    made = replace(scene, references=(plan.position(t),)).logs()
    return [replace(one, time=clock * one.time) for one in made]


def beside_another(scene: Scene, pull: float) -> list[Record]:
    """Return logs of two joints that move at once, the second pulling on the first by its acceleration."""
    rng = scene.rng()
    logs = []
    for made in scene.logs():
        wanted = multisine(made.time[-1] + STEP, 1.0, rng, 0.11)
        other = record(scene.joint, wanted, scene.logger, rng)
        n = min(made.time.size, other.time.size)
        made, other = made.rows(slice(n)), other.rows(slice(n))
        force = pull * scene.joint.coulomb * other.motion[2] / np.abs(other.motion[2]).max()
        logs.append(replace(made, torque=made.torque + force, other=other))
    return logs


def printed_ramps(scene: Scene, height: float) -> list[Record]:
    """Return ramps up and down past break-away by so much, positions printed with six decimals."""
    joint = replace(scene.joint, gravity=(0.0, 0.0), offset=0.0)
    force = ramps(height * joint.coulomb, 20.0, 2)
    return [_printed(replace(scene, joint=joint), force)]


def monotone_ramp(scene: Scene, height: float) -> list[Record]:
    """Return ramps that only rise, one each way, to past break-away by so much."""
    joint = replace(scene.joint, gravity=(0.0, 0.0), offset=0.0)
    force = ramp_to_break_away(0.2 * joint.coulomb, height * joint.coulomb)
    return [_printed(replace(scene, joint=joint), sign * force) for sign in (1.0, -1.0)]


def _printed(scene: Scene, force: np.ndarray) -> Record:
    rng = scene.rng()
    made = record(scene.joint, np.zeros(force.size), scene.logger, rng, torque=force)
    position = np.round(made.motion[0] + NOISE * rng.standard_normal(made.time.size), DECIMALS)
    return replace(made, position=position)
