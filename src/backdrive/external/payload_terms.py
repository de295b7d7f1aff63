"""Terms of a joint that may have changed since its identification, beside the payload."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from backdrive.identification.arm_terms import Terms
from backdrive.laws import Law
from backdrive.model import JointFriction

OWN = 6  # columns of a joint beside the bodies
DAY = 2  # of these, friction that may differ between two logs: curve, viscous
AGAIN = 0.3  # relative standard deviation of friction from the model's [-]
CHANGE = 0.1  # relative standard deviation of friction between two logs [-]
GROWTH = 0.03  # growth of friction with load that a model without growth may have missed [-]


@dataclass(frozen=True, kw_only=True, eq=False)
class Corrections(Terms):
    """Regression columns of one joint's terms that may have changed since its identification.

    Attributes:
        law: friction without load.
    """

    law: Law

    @property
    def size(self) -> int:
        """Number of columns: offset, inertia, curve, sign, viscous, load."""
        return OWN

    def columns(self, velocity: np.ndarray, acceleration: np.ndarray, load: np.ndarray | None) -> np.ndarray:
        """Return the columns, (n, 6); see `Terms.columns`."""
        slides = np.tanh(velocity / self.transition)
        growth = np.zeros_like(velocity) if load is None else np.abs(load) * slides
        curve = np.abs(slides) * self.law.torque(velocity)
        return np.column_stack([np.ones_like(velocity), acceleration, curve, slides, velocity, growth])


def corrections(friction: JointFriction) -> Corrections:
    """Return the columns of a joint."""
    top = max(abs(v) for v in friction.validity.velocity)
    transition = friction.dynamics["transition"].value if "transition" in friction.dynamics else 0.002 * top
    return Corrections(knots=np.array([0.0, top]), top=top, transition=transition, law=friction.law)


def of_the_day(columns: np.ndarray, loaded: bool) -> np.ndarray:
    """Return columns of a joint with those of the friction by which a loaded log differs from an unloaded one, (n, 8).

    Args:
        columns: the joint's own, (n, 6).
        loaded: whether they are of the loaded log.
    """
    return np.hstack([columns, columns[:, (2, 4)] * float(loaded)])


def own_prior(friction: JointFriction, both: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the prior mean and standard deviation of a joint's own coefficients, (6,), or of both logs, (8,)."""
    top = max(abs(v) for v in friction.validity.velocity)
    mean = float(np.mean(np.abs(friction.law.torque(np.linspace(-top, top, 21))))) or 1.0
    value = {term: friction.dynamics[term].value for term in ("offset", "inertia")}
    growth = friction.law.growth.mean if friction.law.growth else 0.0
    expected = np.array([value["offset"], value["inertia"], 1.0, 0.0, 0.0, growth])
    spread = np.array(
        [
            AGAIN * mean,
            AGAIN * abs(value["inertia"]) + 1e-6,
            AGAIN,
            AGAIN * mean,
            AGAIN * mean / top,
            GROWTH,
        ]
    )
    if both:
        expected = np.r_[expected, np.zeros(DAY)]
        spread = np.r_[spread, CHANGE, CHANGE * mean / top]
    return expected, spread
