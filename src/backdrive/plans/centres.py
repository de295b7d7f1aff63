"""Choice of the centers of several sweeps, which separate friction unequal in its directions from gravity.

About a center c the half sum of the two directions is S = a sin c + b cos c + a_0. It contains gravity and half the constant
difference of the directions. With weights w_i on the centers, sum w_i S_i equals a_0 for any a and b if

    sum w_i = 1,   sum w_i sin c_i = 0,   sum w_i cos c_i = 0,

and its standard error is sqrt(sum w_i^2 / n_i) times that of one sweep's S: the noise gain. Gravity rotated by an angle has the
same form, so only the distances of the centers matter. Inside a range of half width w, the least (sum |w_i|)^2 belongs to the
two ends and the middle. It is the squared noise gain for the effort of one sweep:

    w_end = 1 / (2 (1 - cos w)),   w_middle = -cos w / (1 - cos w),   sum |w_i| = cot^2(w/2)   for w <= pi/2

(Elfving, Annals of Mathematical Statistics 23, 1952: the constant lies on the boundary of the hull of what the centers show).
From w = pi/2 on, it belongs to two centers half a turn apart, with the weight 1/2 each. For small ranges the noise gain grows
as 4/w^2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from backdrive.errors import InvalidInput
from backdrive.plans.base import phrase
from backdrive.plans.limits import JointLimits
from backdrive.plans.sweep import Sweep

SHARE = 0.8  # samples faster than this share of a cycle's peak speed are used [-]
MOST_GAIN = 2.0  # target of the noise gain for the choice of centers [-]
WORST_GAIN = 20.0  # noise gain above which centers count as too close [-]
MOST_SWEEPS = 9
TIE = 1e-9  # relative difference of noise gains that counts as rounding [-]
UNSEEN = (
    0.02  # a component of gravity smaller than this share of the other one at the centers is left out [-]
)
_INWARD = (
    1e-9  # distance of centers from the ends of the range, so that rounding does not exceed a limit [rad]
)
WHAT_ELSE = (
    "Possible remedies: a wider range, for example in another posture of the arm; a second center half a turn from the "
    "first; or a posture in which the axis is vertical, so that gravity does not act on the joint."
)


@dataclass(frozen=True, kw_only=True)
class Separation:
    """Sweeps about several centers, and how well they separate the constant difference of the directions from gravity.

    Attributes:
        plans: one sweep a center.
        noise_gain: ratio of the standard error of half the constant difference to that of one sweep's half sum [-].
        condition: condition number of the equations that the identification will solve [-].
        duration: of all sweeps, without the motions between them [s].
    """

    plans: tuple[Sweep, ...]
    noise_gain: float
    condition: float
    duration: float

    @property
    def centers(self) -> tuple[float, ...]:
        """Middles of the strokes [rad]."""
        return tuple(p.center for p in self.plans)


def noise_gain(centers: Sequence[float] | np.ndarray) -> float:
    """Return the ratio of the standard error of half the constant difference to that of one sweep's half sum [-].

    Two centers within 2 degrees of half a turn count as half a turn apart, since the slope inside the strokes determines the
    remaining gravity.

    Args:
        centers: middles of the strokes, one entry a sweep [rad].

    Returns:
        Infinite if the centers do not separate the constant from gravity.
    """
    X = np.column_stack(
        [np.ones(len(centers)), _observable_columns(np.column_stack([np.sin(centers), np.cos(centers)]))]
    )
    one = np.eye(X.shape[1])[0]
    weights = np.linalg.lstsq(X.T, one, rcond=1e-9)[0]
    if np.abs(X.T @ weights - one).max() > 1e-6:
        return math.inf
    return float(np.linalg.norm(weights))


def condition(centers: Sequence[float] | np.ndarray, cycles: int, stroke: float) -> float:
    """Return the condition number of the equations of sweeps: friction at each speed by direction, and gravity [-].

    Args:
        centers: middles of the strokes, one entry a sweep [rad].
        cycles: of each sweep.
        stroke: A, full stroke [rad].
    """
    one, level = np.eye(cycles), mean_cosine(stroke)
    up, down = np.hstack([one, 0 * one]), np.hstack([0 * one, -one])
    X = np.vstack(
        [
            np.hstack([way, np.tile(level * np.array([math.sin(c), math.cos(c)]), (cycles, 1))])
            for c in centers
            for way in (up, down)
        ]
    )
    X = np.column_stack([X[:, :-2], _observable_columns(X[:, -2:])])
    singular = np.linalg.svd(X, compute_uv=False)
    return float(singular[0] / singular[-1]) if singular[-1] > 1e-12 * singular[0] else math.inf


def _observable_columns(gravity: np.ndarray) -> np.ndarray:
    """Return the columns of gravity, without a component that is nearly zero at all centers."""
    left, size, _ = np.linalg.svd(gravity, full_matrices=False)
    return gravity if size.size > 1 and size[1] >= UNSEEN * size[0] else left[:, :1] * size[0]


def mean_cosine(stroke: float) -> float:
    """Return the mean of cos(q - center) over the samples of a sweep that are used [-].

    Args:
        stroke: A, full stroke [rad].
    """
    phase = np.linspace(math.asin(SHARE), math.pi - math.asin(SHARE), 401)
    return float(np.mean(np.cos(0.5 * stroke * np.cos(phase))))


def sweeps_about(sweep: Sweep, centers: Sequence[float] | np.ndarray) -> Separation:
    """Return the sweeps about given centers.

    Args:
        sweep: the sweep; its own center is ignored.
        centers: middles of the strokes [rad].

    Raises:
        InvalidInput: the joint is linear, a center is not finite, or the centers do not separate the constant from gravity.
    """
    _refuse_linear(sweep)
    if len(centers) < 2 or not np.all(np.isfinite(centers)):
        raise InvalidInput(
            f"{len(centers)} centers do not separate unequal directions from gravity.",
            remedy=f"Give at least three, or two half a turn apart. {WHAT_ELSE}",
        )
    gain = noise_gain(centers)
    cond = condition(centers, sweep.speeds.size, sweep.stroke)
    if not gain <= WORST_GAIN:
        raise _too_little(centers, gain)
    plans = tuple(replace(sweep, center=float(c), start=0.0) for c in centers)
    return Separation(plans=plans, noise_gain=gain, condition=cond, duration=sum(p.duration for p in plans))


def _too_little(centers: Sequence[float] | np.ndarray, gain: float) -> InvalidInput:
    """Return why centers are insufficient, and a remedy."""
    least = (
        f"Three centers within {math.degrees(2 * width_for(WORST_GAIN)):.0f} deg are the least. {WHAT_ELSE}"
    )
    at = np.unique(np.round(np.mod(centers, 2 * math.pi), 6))
    if at.size <= 2:
        apart = math.degrees(abs(math.remainder(float(np.ptp(at)), 2 * math.pi)))
        which = f"Two centers {apart:.4g} deg apart" if at.size == 2 else "Sweeps about one center"
        return InvalidInput(
            f"{which} cannot separate the constant difference of the directions from gravity.",
            remedy="Add a third center between them, or take two that are half a turn (180 deg) apart."
            if math.radians(apart) >= 2 * width_for(WORST_GAIN)
            else least,
        )
    width = max(centers) - min(centers)
    near = width < 2 * width_for(WORST_GAIN)
    return InvalidInput(
        f"The centers are {'too near' if near else 'badly spread'}: over {math.degrees(width):.4g} deg, half the constant "
        "difference of the directions would come out "
        f"{'not at all' if math.isinf(gain) else f'{gain:.3g} times less sure than the half sum of one sweep'}.",
        remedy=least if near else "Put one at either end and one in the middle between them.",
    )


def width_for(gain: float) -> float:
    """Return the half width of a range in which three sweeps reach a noise gain [rad].

    Args:
        gain: [-].
    """
    low, high = 1e-3, 0.5 * math.pi
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if noise_gain([-middle, 0.0, middle]) > gain else (low, middle)
    return high


def choose_centers(
    sweep: Sweep, limits: JointLimits, *, sweeps: int | None = None, gain: float = MOST_GAIN
) -> Separation:
    """Choose the smallest number of sweeps, with their centers, that separates the constant from gravity within a noise gain.

    All sweeps take the same time, so the smallest number is the fastest. They are placed at the ends of the range and in its
    middle, in the proportion with the least noise gain. Other places improve the gain by less than 5 %. If the range permits
    it, they are placed half a turn apart.

    Args:
        sweep: what is swept; the centers lie about its own center where the range is wider than half a turn.
        limits: of the joint; a range that is not known counts as unlimited.
        sweeps: how many; None: as few as reach `gain`.
        gain: noise gain to reach [-].

    Raises:
        InvalidInput: the joint is linear, the stroke does not fit into the range, or the range is too small.
    """
    _refuse_linear(sweep)
    low, high = limits.lower + 0.5 * sweep.stroke, limits.upper - 0.5 * sweep.stroke
    if not low <= high:
        raise InvalidInput(
            f"A stroke of {phrase(sweep.stroke, 'rad')} does not fit into the range of joint '{limits.name}'.",
            remedy="Give a smaller --stroke-deg.",
        )
    low, high = low + _INWARD, high - _INWARD
    if sweeps is not None and not 2 <= sweeps <= MOST_SWEEPS:
        raise InvalidInput(f"{sweeps} centers.", remedy=f"Give 2 to {MOST_SWEEPS}, or `auto`.")
    half = min(max(0.5 * (high - low), 0.0), 0.5 * math.pi)
    middle = min(max(sweep.center, low + half), high - half)
    found: tuple[float, list[float]] = (math.inf, [])
    for count in [sweeps] if sweeps else range(2, MOST_SWEEPS + 1):
        found = _best(_arrangements(middle, half, count))
        if found[0] <= gain:
            break
    if not found[0] <= WORST_GAIN:
        few = f"{sweeps} sweeps" if sweeps else f"Even {MOST_SWEEPS} sweeps"
        raise InvalidInput(
            f"{few} within the range of joint '{limits.name}' do not separate unequal directions from gravity. The centers can "
            f"be {math.degrees(2 * half):.4g} deg apart, which gives a noise gain of {found[0]:.3g}.",
            remedy="Two would have to be half a turn (180 deg) apart: give three, or `auto`."
            if sweeps == 2
            else f"Three centers within {math.degrees(2 * width_for(WORST_GAIN)):.0f} deg are the least. {WHAT_ELSE}",
        )
    return sweeps_about(sweep, found[1])


def _best(arrangements: list[list[float]]) -> tuple[float, list[float]]:
    """Return the least noise gain and its centers. Among arrangements equal up to rounding, the most even one is chosen, and
    of two mirror images the one with fewer centers at the lower end.
    """
    gains = [noise_gain(c) for c in arrangements]
    alike = [c for c, g in zip(arrangements, gains, strict=True) if g <= min(gains) * (1.0 + TIE)]
    best = min(alike, key=lambda c: (abs(c.count(c[0]) - c.count(c[-1])), c.count(c[0])))
    return gains[arrangements.index(best)], best


def _arrangements(middle: float, half: float, count: int) -> list[list[float]]:
    """Return ways to spread sweeps over the ends and the middle of a range."""
    result = []
    for ends in range(1, count):
        for inner in range(count - ends + 1):
            if (rest := count - ends - inner) >= 1:
                places = [middle - half] * ends + [middle] * inner + [middle + half] * rest
                result.append([round(c, 9) + 0.0 for c in places])
    return result


def _refuse_linear(sweep: Sweep) -> None:
    if sweep.unit != "rad":
        raise InvalidInput(
            f"Joint '{sweep.joint}' is linear: gravity does not change along it, so no centers can separate it from unequal "
            f"directions.",
            remedy="Sweep once; a horizontal axis has no gravity to separate.",
        )
