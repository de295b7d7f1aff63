"""Gains of an arm's drives from a payload: each gain if the mass is known, their ratios if it is not.

The log's torque has to be divided by the gain. With an unknown mass, a common factor of all gains and the mass is not
identifiable. Only ratios are, relative to the value on which most of at least three joints agree. With two joints it is
unknown which one is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from backdrive.external.payload_fit import PayloadFit
from backdrive.identification.regression import NORMAL

CLAIMED = 0.05  # largest half width of the 95 % interval of a gain that is reported [-]
FEWEST = 3  # least number of joints for ratios
OFF = (
    0.02,
    3.0,
)  # a gain differs from 1 if both limits are exceeded: difference [-], and difference in standard errors


@dataclass(frozen=True, kw_only=True)
class Gain:
    """The gain of one drive.

    Attributes:
        value: factor by which the log's torque is too large; divide the torque by it [-].
        error: standard error [-].
    """

    value: float
    error: float


@dataclass(frozen=True, kw_only=True)
class Gains:
    """The drives' gains, identified from a payload.

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
                f"The drives' gains are not reported: the payload loads fewer than {FEWEST} joints enough to "
                f"compare their gains to "
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
        "The gains are ratios between joints. A common factor of all gains cannot be separated from the mass; only "
        "a known mass determines it."
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
