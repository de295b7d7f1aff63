"""The choice among several fitted laws, by their errors on held-out windows or logs, with the reason in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import stdtrit

from backdrive._catalog import lookup
from backdrive.errors import InvalidInput
from backdrive.identification.dynamic.fit import Fit
from backdrive.identification.dynamic.stretch import Stretch
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.identification.signals import spans

WINDOWS = 15  # number of windows of time, every third of which is held out
FEWEST = 9  # least number of windows; for a slow motion, they are shorter than its period
WORTH = 0.02  # least relative decrease of the held-out error that justifies a richer law [-]
LEAST = 0.002  # least relative decrease of the held-out error if it is significant over the windows [-]
CLEAR = 0.999  # one-sided confidence level at which a decrease over the windows is significant [-]
LOST = 0.1  # if few windows contain a law's gain: largest loss in the others, relative to the gain [-]

#: Laws that `auto` tries, as far as the data can support them.
CURVES = ("coulomb-viscous", "stribeck-gauss", "stribeck-tustin", "degressive")
PRESLIDING = ("stribeck-gauss+hayward-armstrong", "stribeck-gauss+lugre", "stribeck-gauss+elastoplastic")
LOADED = ("m3", "m4", "m5")
WARM = ("load-temperature",)


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """One law of a choice.

    Attributes:
        name: of the law.
        parameters: number of estimated parameters.
        error: RMS error on the fitted data [N.m or N; rad or m where motion was fitted]; NaN if the fit failed.
        held_out: RMS error on the held-out data [the same unit].
        aic: Akaike's information criterion, minus the smallest one of the choice.
        seconds: duration of the fit [s].
        remark: why the fit failed, or the parameters that it does not determine.
        fit: None if it failed.
        windows: mean squared error of each held-out window, for paired comparison.
        shown: False if the law has presliding that the data do not determine, or breaks away below Coulomb friction, which is
            impossible; then another law is preferred.
    """

    name: str
    parameters: int = 0
    error: float = np.nan
    held_out: float = np.nan
    aic: float = np.nan
    seconds: float
    remark: str = ""
    fit: Fit | None = None
    windows: np.ndarray | None = None
    shown: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """The laws tried on one joint, and the chosen one.

    Attributes:
        joint: its name.
        candidates: sorted by number of parameters.
        chosen: name of the law to use.
        reason: why this law, and why no richer one.
        unit: of the errors.
    """

    joint: str
    candidates: tuple[Candidate, ...]
    chosen: str
    reason: str
    unit: str = "N.m"

    def candidate(self, name: str | None = None) -> Candidate:
        """Return a candidate by name; the chosen one for None.

        Raises:
            UnknownName: no such law was tried.
        """
        return lookup(name or self.chosen, {c.name: c for c in self.candidates}, "law that was tried")


def shortlist(words: str | Sequence[str], *, presliding: bool, load: bool, warm: bool) -> list[str]:
    """Return the names of the laws to try.

    Args:
        words: `auto`, a name, names with commas between, or a sequence of names.
        presliding: the motion shows presliding, resolved by the encoder.
        load: the log holds the load, and it varies.
        warm: the log holds the temperature, and it varies.
    """
    if words != "auto":
        parts: Any = words.split(",") if isinstance(words, str) else words
        found: list[Any] = list(parts) if isinstance(parts, (list, tuple)) else [parts]
        if strange := [w for w in found if not isinstance(w, str)]:
            raise InvalidInput(
                f"A law to fit is a {type(strange[0]).__name__}.",
                remedy="Name it: 'stribeck-gauss', or 'stribeck-gauss+lugre'; its numbers are what a fit finds.",
            )
        found = [w.strip() for w in found if w.strip()]
        if not found:
            raise InvalidInput(
                f"No law is named: {words!r}.", remedy="Name one, or 'auto'; `backdrive laws` lists them."
            )
        return found
    return [
        *CURVES,
        *(PRESLIDING if presliding else ()),
        *(LOADED if load else ()),
        *(WARM if warm and load else ()),
    ]


def windows(lengths: Sequence[int], period: float = 0.0) -> list[np.ndarray]:
    """Return a mask of the held-out samples of each stretch: every third window of time.

    Args:
        lengths: number of samples of each stretch.
        period: of the motion [sample]; a window is at least as long, unless fewer than `FEWEST` would remain.
    """
    total = sum(lengths)
    most = float(np.clip(total / max(period, 1.0), FEWEST, WINDOWS))
    masks = []
    for n in lengths:
        count = max(3, round(most * n / total))
        masks.append((np.arange(n) * count // n) % 3 == 1)
    return masks


def without(stretches: Sequence[Stretch], masks: Sequence[np.ndarray]) -> list[Stretch]:
    """Return stretches whose masked samples do not count. The motion stays complete, since the law's states depend on it."""
    return [replace(s, judged=s.judged & ~mask) for s, mask in zip(stretches, masks, strict=True)]


def held_out_errors(fit: Fit, records: Sequence[Any], masks: Sequence[np.ndarray]) -> np.ndarray:
    """Return the mean squared error of each held-out window [unit of the measurement, squared], (W,).

    Args:
        fit: a fit that has not seen the windows.
        records: stretches or motion logs.
        masks: held-out samples of each record, (n,).
    """
    found = []
    for (_, counts), miss, mask in zip(fit.problem.series(records), fit.misses(records), masks, strict=True):
        found += squares(miss**2, mask, counts)
    return np.array(found)


def squares(squared: np.ndarray, mask: np.ndarray, counts: np.ndarray) -> list[float]:
    """Return the mean squared error of each run of a mask, over the samples that count."""
    runs = [squared[a:b][counts[a:b]] for a, b in spans(mask)]
    return [float(run.mean()) for run in runs if run.size]


def training_error(fit: Fit, stretches: Sequence[Stretch]) -> tuple[float, int]:
    """Return the mean squared error on the fitted data [N.m or N, squared], rests included, and the number of samples."""
    squared = [(miss**2)[s.judged] for s, miss in zip(stretches, fit.misses(stretches), strict=True)]
    joined = np.concatenate(squared)
    return float(joined.mean()), joined.size


def shows_presliding(shape: LawShape, unseen: Iterable[str], at_bound: Iterable[str]) -> bool:
    """Return whether a fit determines a law's presliding: its stiffness, or else the first number of its element.

    Args:
        shape: of the law.
        unseen: numbers that the motion does not determine.
        at_bound: numbers that ended at a bound.
    """
    hidden = {n.partition("[")[0] for n in (*unseen, *at_bound)}
    main = [n for n in shape.element.PARAMETERS if n != "share"]
    first = "stiffness" if "stiffness" in main else (main or [""])[0]
    return first not in hidden


def remark(unseen: Iterable[str], possible: bool = True) -> str:
    """Return the parameters that a fit does not determine, and whether its law is impossible, in a few words."""
    plain = list(dict.fromkeys(n.partition("[")[0] for n in unseen))
    hidden = [f"not determined: {', '.join(plain)}"] if plain else []
    return "; ".join([*([] if possible else ["impossible: break-away below Coulomb friction"]), *hidden])


def choose(
    joint: str, candidates: Sequence[Candidate], unit: str, size: float, what: str = "torque"
) -> Choice:
    """Return the choice: the simplest law, unless a richer one lowers the held-out error enough.

    Args:
        joint: its name.
        candidates: fitted laws with their held-out errors.
        unit: of the errors.
        size: root mean square of the measured quantity, for percentages.
        what: name of the measured quantity, for the sentence.
    """
    alive = sorted(
        (c for c in candidates if np.isfinite(c.held_out)),
        key=lambda c: (c.parameters, _comparable_error(c), c.name),
    )
    least = min((c.aic for c in candidates if np.isfinite(c.aic)), default=0.0)
    table = tuple(
        replace(c, aic=c.aic - least) for c in sorted(candidates, key=lambda c: (c.parameters, c.name))
    )
    if any(c.shown for c in alive):
        alive = [c for c in alive if c.shown]
    best = min(alive, key=_comparable_error)
    simple = next(c for c in alive if not _worth(c, best))
    share = 100.0 / size if size > 0 else float("nan")
    reason = (
        f"'{simple.name}' leaves {simple.held_out:.3g} {unit} ({share * simple.held_out:.1f} %) of {what} that was "
        f"held out, with {simple.parameters} parameters."
    )
    richer = [c for c in alive if c.parameters > simple.parameters]
    if richer:
        c = min(richer, key=_comparable_error)
        gain = 100.0 * (1.0 - c.held_out / simple.held_out)
        reason += f" '{c.name}' with {c.parameters} parameters leaves {c.held_out:.3g} {unit}" + (
            f", only {gain:.1f} % less; the simpler law is kept."
            if gain > 0
            else ", no less; the simpler law is kept."
        )
    poorer = [c for c in alive if c.parameters < simple.parameters]
    if poorer:
        c = min(poorer, key=_comparable_error)
        reason += f" The simpler '{c.name}' leaves {c.held_out:.3g} {unit}."
    return Choice(joint=joint, candidates=table, chosen=simple.name, reason=reason, unit=unit)


def ties(choice: Choice) -> list[Fit]:
    """Return the fits of the laws that explain the held-out data as well as the chosen one."""
    one = choice.candidate()
    others = [c for c in choice.candidates if c is not one and c.shown and np.isfinite(c.held_out)]
    return [c.fit for c in others if c.fit is not None and not _worth(c, one) and not _worth(one, c)]


def _comparable_error(candidate: Candidate) -> float:
    """Return the held-out error to six digits, so that rounding does not decide between two forms of one law."""
    return float(f"{candidate.held_out:.6g}")


def _worth(simple: Candidate, best: Candidate) -> bool:
    """Return whether the best law's gain over a simpler one justifies it.

    The gain must be significant over the windows. Or it must be large, and either exceed its standard error or nearly spare
    every window a loss.
    """
    enough = best.held_out < (1.0 - WORTH) * simple.held_out
    if simple.windows is None or best.windows is None or len(simple.windows) != len(best.windows):
        return enough
    gain = simple.windows - best.windows
    mean, count = float(gain.mean()), len(gain)
    if not mean > 0.0 or best.held_out >= (1.0 - LEAST) * simple.held_out:
        return False
    error = float(gain.std(ddof=1) / np.sqrt(count)) if count > 1 else 0.0
    clear = count > 1 and mean > error * float(stdtrit(count - 1, CLEAR))
    steady = float(np.maximum(-gain, 0.0).sum()) < LOST * float(gain.sum())  # the gain of slow windows alone
    return clear or (enough and (mean > error or steady))
