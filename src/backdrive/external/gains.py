"""Which gains of an arm's drives a payload shows: each, where its mass is known; their ratios, where it is not.

A gain is what the log's torque must be divided by. With an unknown mass, all gains and the mass may grow together: only ratios can
be told, to what most of three joints or more agree on, since of two that differ nobody knows which one is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from backdrive.external.payload_fit import PayloadFit
from backdrive.identification.regression import NORMAL

CLAIMED = 0.05  # half width of the 95 % interval of a gain that is stated [-]
FEWEST = 3  # joints whose ratios are stated
OFF = (0.02, 3.0)  # by which a gain differs from 1: so much, and so many standard errors


@dataclass(frozen=True, kw_only=True)
class Gain:
    """The gain of one drive.

    Attributes:
        value: by which the log's torque is too large; divide by it [-].
        error: standard error [-].
    """

    value: float
    error: float


@dataclass(frozen=True, kw_only=True)
class Gains:
    """What a payload shows of the drives' gains.

    Attributes:
        kind: `absolute` by a known mass, `ratio` to the mean of the joints that are stated, or `none`.
        by_joint: those that are known to 5 %.
        remarks: sentences.
    """

    kind: Literal["absolute", "ratio", "none"]
    by_joint: dict[str, Gain]
    remarks: tuple[str, ...]


def absolute_gains(joints: Sequence[str], fit: PayloadFit) -> Gains:
    """Return the gains that a known mass shows."""
    J = len(joints)
    error = np.sqrt(np.diag(fit.covariance)[-J:])
    told = NORMAL * error < CLAIMED
    gains = {
        n: Gain(value=1.0 + float(fit.gains[j]), error=float(error[j]))
        for j, n in enumerate(joints)
        if told[j]
    }
    open_ = [n for n, known in zip(joints, told, strict=True) if not known]
    remarks = _remarks(gains, "the known mass")
    if open_:
        remarks.append(
            f"The known mass does not show the gain of {', '.join(open_)} to {100 * CLAIMED:.0f} %."
        )
    return Gains(kind="absolute" if gains else "none", by_joint=gains, remarks=tuple(remarks))


def gain_ratios(joints: Sequence[str], fit: PayloadFit) -> Gains:
    """Return the ratios of the gains that an unknown mass shows."""
    J = len(joints)
    covariance = fit.covariance[-J:, -J:]
    kept = list(range(J))
    while len(kept) >= FEWEST:
        center = np.eye(len(kept)) - 1.0 / len(kept)
        error = np.sqrt(np.diag(center @ covariance[np.ix_(kept, kept)] @ center))
        if np.all(NORMAL * error < CLAIMED):
            break
        del kept[int(np.argmax(error))]
    if len(kept) < FEWEST:
        return Gains(
            kind="none",
            by_joint={},
            remarks=(
                f"Nothing is claimed of the drives' gains: the payload does not load {FEWEST} joints enough to compare them to "
                f"{100 * CLAIMED:.0f} %.",
            ),
        )
    value = 1.0 + fit.gains[kept]
    alike = np.abs(value - np.median(value)) <= 0.5 * CLAIMED  # the most of them, if one is off
    middle = float(value[alike].mean()) if alike.any() else float(np.median(value))
    weight = np.eye(len(kept)) - alike / max(np.count_nonzero(alike), 1)
    error = np.sqrt(np.maximum(np.diag(weight @ covariance[np.ix_(kept, kept)] @ weight.T), 0.0)) / middle
    gains = {
        joints[j]: Gain(value=float(v / middle), error=float(e))
        for j, v, e in zip(kept, value, error, strict=True)
    }
    remarks = _remarks(gains, "the others")
    remarks.append(
        "The gains are ratios between joints: a factor that all have in common goes with the mass, and only a known mass tells it."
    )
    return Gains(kind="ratio", by_joint=gains, remarks=tuple(remarks))


def _remarks(gains: dict[str, Gain], beside: str) -> list[str]:
    """Return a sentence for each gain that is off."""
    least, sure = OFF
    return [
        f"Joint '{name}': the drive's gain is {g.value:.3f} +- {NORMAL * g.error:.2g} by {beside}: its torque reads "
        f"{100 * abs(g.value - 1.0):.0f} % too {'large' if g.value > 1.0 else 'small'}."
        for name, g in gains.items()
        if abs(g.value - 1.0) > max(least, sure * g.error)
    ]
