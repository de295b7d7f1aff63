"""A single joint's free motion and steps of force for `arm_contact`: friction, integration and motion of `_independent`."""

from __future__ import annotations

import numpy as np
from _independent import STEP, Joint, Logger, Record, multisine, record, rested, sweep

from backdrive import Joint as LogJoint
from backdrive import Log

NAME = "j1"
TRUTH = Joint(
    inertia=0.15,
    coulomb=1.5,
    viscous=0.4,
    peak=0.4,
    peak_speed=0.1,
    gravity=(2.0, 0.5),
    offset=0.1,
    ripple=(0.06, 9.0),
    load_growth=0.03,
)
LOGGER = Logger(rate=500.0, noise=0.08, counts=2.0**17, late=1e-3)
BLOCK = 600.0  # of free motion, each a log of its own [s]
TOP = 1.2  # [rad/s]
SPACING, LENGTH = 3.0, 0.5  # of steps [s]


def log_of(r: Record) -> Log:
    """Return what a user would have of a record."""
    joints = (LogJoint(name=NAME, encoder_counts=r.logger.counts / (2.0 * np.pi)),)
    return Log(time=r.time, position=r.position[:, None], torque=r.torque[:, None], joints=joints)


def identification(rng: np.random.Generator) -> Log:
    """Return the sweep that the model is identified from."""
    return log_of(record(TRUTH, sweep(0.0, 0.6, TOP), LOGGER, rng))


def free(rng: np.random.Generator, seconds: float = BLOCK) -> Log:
    """Return a log of free motion at a random pace, with rests."""
    reference = multisine(seconds, TOP * rng.uniform(0.5, 1.0), rng)
    return log_of(record(TRUTH, rested(reference, max(1, round(seconds / 100.0)), 1.0), LOGGER, rng))


def stepped(rng: np.random.Generator, seconds: float, heights: np.ndarray | None) -> tuple[Log, np.ndarray]:
    """Return a log of motion with steps of force, and their instants [s], (k,).

    Args:
        rng: of the motion.
        seconds: how long.
        heights: of the steps in turn [N.m], (k,); None: no force, the same motion.
    """
    reference = multisine(seconds, TOP * rng.uniform(0.5, 1.0), rng)
    instants = np.arange(2.0, seconds - 2.0, SPACING) + rng.uniform(
        0.0, 1.0, len(np.arange(2.0, seconds - 2.0, SPACING))
    )
    push = np.zeros(reference.size)
    if heights is not None:
        for t, height in zip(instants, heights, strict=False):
            push[round(t / STEP) : round((t + LENGTH) / STEP)] = height
    return log_of(record(TRUTH, reference, LOGGER, rng, push=push)), instants
