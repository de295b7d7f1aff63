"""Momentum balance of a joint that a hand moves, from the simulator's true values: a check of the force-sensor readings in
the figures.

Over some ticks in which the load moves one way all the time,

    int f_h dt = [M p' + L q'] + int f_f(q') dt - int u dt

with motor M, load L, friction f_f of the load and torque u of the motor, which acts later by the drive's delay and is held for a
tick. The left side is measured, the right side is true. A straight line through zero must have a slope of 1.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from backdrive.simulation.closed_loop import Record
from backdrive.thesis.outcome import Claim

WITHIN = 0.05  # of the force
SPAN = 10  # ticks of a balance


def impulses(record: Record, force: np.ndarray, weightless: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Return measured and true impulses of the hand over `SPAN` ticks each, while the load moves in one direction [N.m.s or
    N.s], (m,) each.

    Args:
        record: of the scene.
        force: of the hand, as it was measured [N.m or N], (n,).
        weightless: the command holds the joint's weight, so that only the compensation and the noise-free motion count.
    """
    plant, T = record.scene.plant, record.scene.period
    late = round((plant.delay + record.scene.delay) / T)
    u = record.compensation if weightless else record.command
    acting = np.concatenate([np.zeros(late), u[: len(u) - late]])
    momentum = plant.motor_inertia * record.motor_velocity + plant.load_inertia * record.load_velocity
    friction = plant.law.torque(record.load_velocity)
    edges = np.arange(0, len(force) - SPAN, SPAN)
    at = edges[:, None] + np.arange(SPAN + 1)  # (m, SPAN + 1): both ends
    one_way = np.abs(np.sign(record.load_velocity)[at].sum(axis=1)) == SPAN + 1
    at = at[one_way]
    weights = np.full(SPAN + 1, T)
    weights[[0, -1]] = 0.5 * T  # trapezoids
    due = (
        np.diff(momentum[at[:, [0, -1]]], axis=1)[:, 0]
        + friction[at] @ weights
        - T * acting[at[:, :-1]].sum(axis=1)
    )
    return force[at] @ weights, due


def slope(records: Iterable[Record], weightless: bool = True) -> float:
    """Return the slope of measured over due impulses through zero [-]."""
    pairs = [impulses(r, r.sensed, weightless) for r in records]
    measured, due = (np.concatenate(part) for part in zip(*pairs, strict=False))
    return float(measured @ due / (due @ due))


def balance(records: Iterable[Record], weightless: bool = True) -> Claim:
    """Return the claim that the hand's measured force agrees with the momentum balance.

    Args:
        records: of a figure, whose force sensor is looked at.
        weightless: as in `impulses`.
    """
    found = slope(records, weightless)
    return Claim(
        what="The measured force of the hand is that of the balance of momentum, by the simulator's truth",
        ours=f"{100 * (found - 1):+.2f} % off",
        gate=f"within {100 * WITHIN:g} %",
        holds=abs(found - 1.0) <= WITHIN,
    )
