"""The residual of a model, pooled over stretches, files or left-out blocks, and the grade in one word."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from backdrive.identification.delay import sliding_in_step
from backdrive.identification.dynamics import predict
from backdrive.identification.residual import Part
from backdrive.identification.signals import Signals
from backdrive.logs.filters import low_pass_rows, means
from backdrive.model import JointFriction, Quality

JUDGED_BELOW = 5.0  # cutoff frequency of the zero-phase low pass on both torques [Hz]
LEAST_SHARE = 0.2  # least sum of the low pass's weights inside the mask that is normalised to 1 [-]
FINE = 50.0  # rate of the means that are low-passed, relative to the cutoff frequency of the low pass [-]
FEWEST = 8  # least number of means of a stretch
WHERE_SLIDING = ", where the joint slides"  # end of the method's name of a fit that is judged there alone
LONG = 200_000  # largest number of samples of series that are low-passed together, which is faster but takes memory
GOOD, FAIR = 15.0, 35.0  # largest residual of a result that is good, or usable with care [%]


def judge(pairs: Iterable[tuple[np.ndarray, np.ndarray, float, np.ndarray]]) -> Quality:
    """Return the relative residual over all pairs.

    Args:
        pairs: measured torque, predicted torque [N.m or N], sampling rate [Hz] and the mask of judged samples, each (n,).
    """
    return _qualities(((tau, [tau_hat], rate, mask) for tau, tau_hat, rate, mask in pairs), 1)[0]


def _qualities(
    stretches: Iterable[tuple[np.ndarray, Sequence[np.ndarray], float, np.ndarray]], predictions: int
) -> list[Quality]:
    """Return the relative residual of each prediction over all stretches.

    Args:
        stretches: measured torque, predicted torques [N.m or N], sampling rate [Hz] and the mask of judged samples, each (n,).
        predictions: number of predictions of each stretch.
    """
    total, count = np.zeros((2, 1 + predictions)), 0
    for tau, hats, rate, mask in stretches:
        if not mask.any():
            continue
        inside, share = mask.astype(float), None
        every = [None, *hats]
        at_once = len(every) if tau.size <= LONG else 1
        for first in range(0, len(every), at_once):
            group = slice(first, first + at_once)
            series = [tau if hat is None else tau - hat for hat in every[group]]
            masked = [x * inside for x in series]
            total[1, group] += [np.einsum("n,n", x, x) for x in masked]
            slow, share, weight = _slow(masked, inside, rate, share)
            total[0, group] += [np.einsum("n,n,n", x, weight, x) for x in slow]
        count += int(np.count_nonzero(mask))
    (below, *above), (raw_below, *raw_above) = total.tolist()
    return [
        Quality(
            residual=_percent(slow, below),
            residual_raw=_percent(raw, raw_below),
            rms=math.sqrt(raw / count) if count else math.nan,
            samples=count,
        )
        for slow, raw in zip(above, raw_above, strict=True)
    ]


def _slow(
    masked: Sequence[np.ndarray], inside: np.ndarray, rate: float, share: np.ndarray | None
) -> tuple[list[np.ndarray], np.ndarray | None, np.ndarray]:
    """Return low-passed means of series without the contribution of samples outside a mask, (m,) each, the share of the low pass
    that is left, (m,), and how many samples of each mean are inside, (m,).

    Args:
        masked: series of one stretch, 0 outside the mask, (n,) each.
        inside: 1 for samples inside the mask, 0 outside, (n,).
        rate: sampling rate [Hz].
        share: sum of the low pass's weights inside the mask [-], (m,), from an earlier call; None: computed.
    """
    width = max(1, min(int(rate // (FINE * JUDGED_BELOW)), inside.size // FEWEST))
    rows, inner = [means(x, width) for x in masked], means(inside, width)
    if inside.all():
        return list(low_pass_rows(rows, JUDGED_BELOW, rate / width)), None, width * inner
    if share is None:
        lowest, *slow = low_pass_rows([inner, *rows], JUDGED_BELOW, rate / width)
        share = np.maximum(lowest, LEAST_SHARE)
    else:
        slow = list(low_pass_rows(rows, JUDGED_BELOW, rate / width))
    for x in slow:
        x /= share
    return slow, share, width * inner


def _percent(above: float, below: float) -> float:
    return 100.0 * math.sqrt(above / below) if below > 0 else math.nan


def assess(friction: JointFriction, stretches: Iterable[Signals]) -> Quality:
    """Return the quality of a joint's predicted torque, all terms of the dynamics included, where it slides.

    Raises:
        InvalidInput: the model needs a channel that the log does not hold.
    """
    return judge(
        (s.torque, predict(friction, s), s.rate, sliding_in_step(s, friction.delay)) for s in stretches
    )


def assess_parts(parts: Iterable[Part]) -> Quality:
    """Return the result of `assess` for stretches with predicted torque."""
    return judge((s.torque, predicted, s.rate, s.sliding) for s, _, predicted, _ in parts)


def assess_both(parts: Sequence[Part], others: Sequence[np.ndarray]) -> tuple[Quality, Quality]:
    """Return the result of `assess_parts`, and that for other predictions of each part, (n,), faster than two calls."""
    both = zip(parts, others, strict=True)
    first, second = _qualities(((s.torque, [p, q], s.rate, s.sliding) for (s, _, p, _), q in both), 2)
    return first, second


@dataclass(frozen=True, kw_only=True)
class Grade:
    """A joint's grade in one word; the limits of the grades are defined in this module only.

    Attributes:
        level: for programs and colours.
        word: for people.
    """

    level: Literal["good", "care", "poor", "unknown"]
    word: str


def credible(friction: JointFriction) -> bool:
    """Return whether friction opposes motion at every velocity in the data, and the inertia is not significantly negative."""
    inertia = friction.dynamics.get("inertia")
    dissipates = friction.driving(friction.validity.lowest_speed or 0.0) is None
    if inertia is None:
        return dissipates
    slack = 2 * inertia.standard_error if math.isfinite(inertia.standard_error) else 0.0
    return dissipates and inertia.value >= -slack


def grade(friction: JointFriction) -> Grade:
    """Return the grade of a joint, by plausibility and by its residual, on held-out data if there are any."""
    quality, allowed = friction.held_out or friction.fitted, friction.verdict
    if quality is None or not math.isfinite(quality.residual):
        return Grade(level="unknown", word="not judged")
    if not credible(friction):
        return Grade(level="poor", word="not credible")
    if quality.residual > FAIR:
        return Grade(level="poor", word="poor")
    if allowed is not None and allowed.grade in ("poor", "unknown"):
        return Grade(level=allowed.grade, word="not credible" if allowed.grade == "poor" else "cannot tell")
    if quality.residual > GOOD or (allowed is not None and allowed.grade == "care"):
        return Grade(level="care", word="usable with care")
    return Grade(level="good", word="good, with a remark" if friction.warnings else "good")
