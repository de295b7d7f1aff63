"""Bands from the estimator's output on free motion: without contact, the estimate is its own error.

The estimator filters the torque residual, so bands are calibrated on its output, for each state of motion and for the method
and bandwidth of the estimate. Half the band is the quantile of |estimate| that contains one further independent event with 95
% probability,

    half = Q(0.95 (1 + 1/n)),      n = p (1 - p) N^2 / Var(sum over N samples of 1{|estimate| > half}),   p = 0.05

so that few events give a wider band (as in split conformal prediction, Lei et al., JASA 113, 2018). At rest friction is
undetermined within its bounds, whatever free motion showed, so that band is kept. Where the force changes abruptly the band is
wider (`JointForce.abrupt`); |estimate| counts beyond that.

A joint that moves faster than free motion did, by a factor r of its top speed, has a band r^2 times as wide. The reason:
errors of the viscous part grow with the speed, errors of the bodies with its square, and there are no data at such speeds.
Since bodies couple the joints of an arm, the largest r of all joints is used for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.external.result import STATES, JointForce
from backdrive.identification.regression import long_run

SHARE = 0.95  # of the samples, that a band holds
ERRORS = 2.0  # standard errors of the share, to the ends of a half width's interval
FEW = 20.0  # number of independent events below which a band gets a remark
LEAST = 20  # number of samples below which a state has no band
FOLDS = 5  # contiguous parts of the free motion for cross-validation of the bands
MEMORY = 2.0  # least correlation time of the errors [s]
FASTER = 1.02  # ratio to the free motion's top speed above which a log gets a remark [-]
JUMP = 3.5  # sampling intervals from which on a series is broken [-]


@dataclass(frozen=True, kw_only=True)
class StateBand:
    """The band of one state of motion.

    Attributes:
        half_width: half the 95 % band [N.m or N].
        interval: of the half width, by two standard errors of the share [N.m or N].
        samples: of free motion in this state.
        events: equivalent number of independent events.
        held_out: lowest and highest share of a held-out fifth of the free motion within the band of the other four fifths
            [-]; NaN if there are too few data.
    """

    half_width: float
    interval: tuple[float, float]
    samples: int
    events: float
    held_out: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Calibration of an estimator on one joint by free motion.

    Attributes:
        joint: name.
        method: of the estimator.
        bandwidth: L [1/s].
        duration: of the free motion [s].
        moving: band in motion; None where free motion did not show it.
        reversing: close to a change of direction.
        forces: the estimates themselves, their bands calibrated.
        top_speed: of the free motion [rad/s or m/s]; infinite where it is not known.
    """

    joint: str
    method: str
    bandwidth: float
    duration: float
    moving: StateBand | None
    reversing: StateBand | None
    forces: tuple[JointForce, ...]
    top_speed: float = np.inf

    def apply(self, one: JointForce, faster: np.ndarray | None = None) -> JointForce:
        """Return an estimate with these bands in motion; at rest it keeps its own.

        Args:
            one: estimate.
            faster: speed relative to the free motion's top speed, (n,): for an arm the largest of all joints, since bodies
                couple them; None: the joint's own.

        Raises:
            InvalidInput: it is of another joint, method or bandwidth.
        """
        own, other = (self.joint, self.method, self.bandwidth), (one.joint.name, one.method, one.bandwidth)
        if own[:2] != other[:2] or not np.isclose(own[2], other[2], rtol=1e-6):
            raise InvalidInput(
                f"A band of {own[0]}, {own[1]}, {own[2]:.4g} 1/s for an estimate of {other[0]}, {other[1]}, {other[2]:.4g} 1/s.",
                remedy="Estimate free motion with the same joint, method and bandwidth.",
            )
        if faster is None and one.speed is not None:
            faster = one.speed / self.top_speed
        return _with_bands(one, self.moving, self.reversing, faster)

    def faster(self, one: JointForce) -> list[str]:
        """Return a sentence if a joint is faster than in the free motion by more than the factor `FASTER`."""
        if one.speed is None or not one.speed.max() > FASTER * self.top_speed:
            return []
        share, unit = float(np.mean(one.speed > self.top_speed)), one.joint.unit
        return [
            f"Joint '{self.joint}' reaches {one.speed.max():.3g} {unit}/s, but free motion only {self.top_speed:.3g} {unit}/s. "
            f"In {100 * share:.3g} % of the time bands and thresholds are extrapolated; they grow with the square of the "
            f"speed. Record free motion at this speed."
        ]

    def remarks(self) -> list[str]:
        """Return sentences on what the free motion does not determine."""
        lines = []
        for name, state in (("moving", self.moving), ("reversing", self.reversing)):
            start = f"Joint '{self.joint}', {name}: "
            if state is None:
                lines.append(
                    start
                    + "the free motion does not contain this state; the band of the other state is used."
                )
            elif state.events < FEW:
                lines.append(
                    start
                    + f"the free motion contains only {state.events:.0f} independent events: its 95 % band is rough, "
                    f"half of it {state.interval[0]:.3g} to {state.interval[1]:.3g}."
                )
        return lines


def calibrate(free: Sequence[JointForce]) -> Calibration:
    """Return the bands that estimates of free motion support.

    Args:
        free: estimates of one joint where nothing touched it, of one method and bandwidth.

    Raises:
        InvalidInput: there are none, of several joints, methods or bandwidths, or too few samples in motion.
    """
    kinds = {(f.joint.name, f.method, f.bandwidth) for f in free}
    if len(kinds) != 1:
        raise InvalidInput(
            f"Free motion of {len(kinds)} kinds of estimate.",
            remedy="Give estimates of one joint, by one method at one bandwidth.",
        )
    name, method, bandwidth = kinds.pop()
    bands = [_state_band(free, state) for state in (0, 1)]
    if bands == [None, None]:
        raise InvalidInput(
            f"Joint '{name}': the free motion has fewer than {LEAST} samples in motion.",
            remedy="Give a longer log of free motion (--free).",
        )
    speeds = [f.speed.max() for f in free if f.speed is not None]
    return Calibration(
        joint=name,
        top_speed=float(max(speeds)) if speeds else np.inf,
        method=method,
        bandwidth=bandwidth,
        duration=float(sum(f.time.size * period(f.time) for f in free)),
        moving=bands[0],
        reversing=bands[1],
        forces=tuple(_with_bands(f, bands[0], bands[1]) for f in free),
    )


def period(time: np.ndarray) -> float:
    """Return the sampling interval of instants that may have gaps [s]."""
    return float(np.median(np.diff(time)))


def _with_bands(
    one: JointForce, moving: StateBand | None, reversing: StateBand | None, faster: np.ndarray | None = None
) -> JointForce:
    """Return an estimate with other bands in motion; a state without one takes the other's."""
    widths = [np.nan if b is None else b.half_width for b in (moving, reversing)]
    widths = [np.nanmax(widths) if np.isnan(w) else w for w in widths]
    half = np.where(one.state == 0, widths[0], widths[1])
    if faster is not None:
        half = half * np.maximum(faster, 1.0) ** 2
    if one.abrupt is not None:
        half = half + one.abrupt
    rest = one.state == STATES.index("rest")
    return replace(
        one,
        lower=np.where(rest, one.lower, one.force - half),
        upper=np.where(rest, one.upper, one.force + half),
    )


def _error(f: JointForce) -> np.ndarray:
    """Return the size of an estimate on free motion beyond the band's part for abrupt changes [N.m or N], (n,)."""
    size = np.abs(f.force)
    return size if f.abrupt is None else np.maximum(size - f.abrupt, 0.0)


def _state_band(free: Sequence[JointForce], state: int) -> StateBand | None:
    errors = [_error(f)[(f.state == state) & np.isfinite(f.force)] for f in free]
    pooled = np.concatenate(errors)
    if pooled.size < LEAST:
        return None
    plain = float(np.quantile(pooled, SHARE))
    events = _events(free, state, plain)
    slack = ERRORS * np.sqrt(SHARE * (1.0 - SHARE) / events)
    level = min(SHARE * (1.0 + 1.0 / events), 1.0)
    ends = np.quantile(pooled, np.clip([SHARE - slack, level + slack], 0.0, 1.0))
    return StateBand(
        half_width=float(np.quantile(pooled, level)),
        interval=(float(ends[0]), float(ends[1])),
        samples=pooled.size,
        events=events,
        held_out=_cross_check(pooled),
    )


def _events(free: Sequence[JointForce], state: int, half: float) -> float:
    """Return the equivalent number of independent events of a state's samples, from how often |estimate| exceeds a half
    width.
    """
    samples, variance, windows = 0, 0.0, 0.0
    for f in free:
        inside = (f.state == state) & np.isfinite(f.force)
        beyond = np.where(inside, (_error(f) > half) - (1.0 - SHARE), 0.0)
        dt = period(f.time)
        breaks = np.flatnonzero(np.diff(f.time) > JUMP * dt) + 1
        for part in np.split(beyond, breaks):
            width = int(max(np.sqrt(part.size), MEMORY / dt)) + 1
            variance += float(long_run(part[None], min(width, part.size))[0, 0])
        samples += int(np.count_nonzero(inside))
        windows += np.count_nonzero(inside) / width
    variance *= windows / max(windows - 1.0, 1e-9)  # the share within the band is that of these samples
    return float(np.clip(SHARE * (1.0 - SHARE) * samples**2 / max(variance, 1e-12), 1.0, samples))


def _cross_check(pooled: np.ndarray) -> tuple[float, float]:
    """Return the lowest and the highest share of a fifth within the quantile of the others; the fifths are contiguous in
    time.
    """
    parts = np.array_split(pooled, FOLDS)
    if min(part.size for part in parts) < LEAST:
        return np.nan, np.nan
    shares = [
        np.mean(part <= np.quantile(np.concatenate(parts[:k] + parts[k + 1 :]), SHARE))
        for k, part in enumerate(parts)
    ]
    return float(min(shares)), float(max(shares))
