"""Free motion and steps of a wrench of the independent six-axis arm, for `arm_contact`; its estimates are those of the package."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from _arm_bodies import kinematics, push, workspace
from _arm_scene import JOINTS, NAMES, TICK, TOOL, Arm, J, Record, free_motion, record

from backdrive import FrictionModel, Joint, Log, identify
from backdrive.external import JointForce
from backdrive.external.arm import ArmEstimate

EVERY = 4  # ticks from one logged instant to the next
LOOKS = 5  # steps of the simulator between two looks at the bodies: twice a tick
BLOCK = 300.0  # of free motion, each a log of its own [s]
COUNT = 13  # column of the encoder's step
IDENTIFIED = 150.0  # motion that the model is identified from [s]
SPACING, LENGTH = 3.0, 0.3  # of steps [s]
SMALL = (
    1e-3  # singular value of the wrenches, by the largest, below which nothing is asked of a direction [-]
)


def log_of(r: Record) -> Log:
    """Return what a user would have of a record."""
    joints = tuple(
        Joint(name=n, encoder_counts=1.0 / c) for n, c in zip(NAMES, JOINTS[:, COUNT], strict=False)
    )
    return Log(time=r.time, position=r.position, torque=r.torque, joints=joints)


def free(seed: int) -> Log:
    """Return a log of free motion."""
    rng = np.random.default_rng(seed)
    return log_of(record(Arm(), free_motion(BLOCK, rng), rng, every=EVERY, looks=LOOKS))


class Cell:
    """The arm's model, as a user would have it, and its estimates; made of its path in every process anew."""

    def __init__(self, folder: Path, how: dict | None = None):
        """Read the model of a folder; `how`: method and bandwidth of the estimates."""
        from backdrive import load_model

        self.folder, self.how = folder, how or {}
        self.estimate = ArmEstimate(load_model(folder / "model.json"), folder / "arm.urdf")

    def forces(self, log: Log) -> tuple[JointForce, ...]:
        """Return the estimates of a log, half as long numbers: hours of six joints are many."""
        joints, _ = self.estimate.forces(log, **self.how)
        small = ("force", "friction", "lower", "upper")
        return tuple(
            replace(j, **{name: getattr(j, name).astype(np.float32) for name in small}) for j in joints
        )


def identified(folder: Path, seed: int) -> FrictionModel:
    """Identify the arm by the package's own command and write model and description into a folder."""
    (folder / "arm.urdf").write_text(Arm().urdf())
    rng = np.random.default_rng(seed)
    log = log_of(record(Arm(), free_motion(IDENTIFIED, rng), rng, every=EVERY))
    model = identify(log, method="arm", urdf=str(folder / "arm.urdf")).model
    model.save(folder / "model.json")
    return model


def _free_forces(work: tuple[Path, dict, int]) -> tuple[JointForce, ...]:
    folder, how, seed = work
    return Cell(folder, how).forces(free(seed))


def free_forces(folder: Path, how: dict, seeds: range, jobs: int) -> Iterator[tuple[JointForce, ...]]:
    """Return the estimates of blocks of free motion, one a seed."""
    work = [(folder, how, seed) for seed in seeds]
    if jobs == 1:
        yield from map(_free_forces, work)
    else:
        with ProcessPoolExecutor(jobs) as pool:
            yield from pool.map(_free_forces, work)


def torques_of_wrenches(link: np.ndarray) -> np.ndarray:
    """Return the torque of each unit wrench at the tool on the joints, at a posture, (6 wrenches, 6 joints)."""
    bodies, (R, V) = Arm().bodies(), workspace(J)
    kinematics(bodies, link, R, V)
    rows = np.zeros((6, J))
    for i in range(6):
        push(R, V, J, np.array(TOOL), np.eye(6)[i], rows[i])
    return rows


def stepped(seed: int, seconds: float, heights: np.ndarray) -> tuple[Log, Log, list[tuple[float, int]]]:
    """Return a log of free motion, the same with steps of a wrench, and instant and joint of each step.

    Each step pushes along one joint so that it alone is pushed, where the posture allows that.

    Args:
        seed: of the motion.
        seconds: how long.
        heights: torque of a step, by joint [N.m], (6,).
    """
    reference = free_motion(seconds, np.random.default_rng(seed))
    dry = record(Arm(), reference, np.random.default_rng(seed + 1), every=EVERY, looks=LOOKS)
    rng = np.random.default_rng(seed + 2)
    hands, steps = np.zeros((reference.shape[0], 6)), []
    for begin in np.arange(3.0, seconds - 2.0, SPACING):
        t, j = begin + rng.uniform(0.0, 1.0), int(rng.integers(J))
        wanted = np.zeros(J)
        wanted[j] = heights[j] * rng.choice([-1.0, 1.0])
        at = round(t / (TICK * EVERY))
        rows = torques_of_wrenches(dry.link[at])
        wrench = np.linalg.lstsq(rows.T, wanted, rcond=SMALL)[0]
        if np.abs(wrench @ rows - wanted)[j] > 0.02 * abs(wanted[j]) or np.abs(wrench[:3]).max() > 200.0:
            continue
        hands[round(t / TICK) : round((t + LENGTH) / TICK)] = wrench
        steps.append((t, j))
    wet = record(Arm(), reference, np.random.default_rng(seed + 1), wrench=hands, every=EVERY, looks=LOOKS)
    return log_of(dry), log_of(wet), steps


def folder() -> tempfile.TemporaryDirectory:
    """Return a folder for the model that goes with the program."""
    return tempfile.TemporaryDirectory()
