"""Numbers, units, names and grades in readable form."""

from __future__ import annotations

import html
import math
import re
from typing import Any

from backdrive.errors import BackdriveError
from backdrive.laws import rate_law
from backdrive.laws.direction import plain as without_direction
from backdrive.model import Estimate, JointFriction
from backdrive.report.alike import ALIKE, is_alike
from backdrive.report.pictures.canvas import pretty_unit
from backdrive.report.pictures.sizes import readable

NOTHING = "—"
MINUS = "\u2212"

#: Terms of the inverse dynamics and parameters in words; an unknown one is shown by its name.
TERMS = {
    "inertia": "inertia",
    "time_slip": "delay of the logged torque behind the motion",
    "delay": "delay of the logged torque behind the motion",
    "offset": "constant offset",
    "gravity_sin": "gravity, sin q part",
    "gravity_cos": "gravity, cos q part",
    "model_torque": "scale factor of the modelled torque",
    "load_carried": "load at which the curve holds",
    "load_driving": "friction per carried load, lifting",
    "load_driven": "friction per carried load, driven back",
    "transition": "speed of the transition at rest",
    "coulomb_positive": "Coulomb friction along +q",
    "coulomb_negative": "Coulomb friction along \u2212q",
    "viscous_positive": "viscous coefficient along +q",
    "viscous_negative": "viscous coefficient along \u2212q",
    "presliding_stiffness": "presliding stiffness, secant up to the slip",
    "presliding_stiffness_tangent": "presliding stiffness, where a branch begins",
    "positive": "along +q",
    "negative": "along \u2212q",
}

_UNITS = re.compile(r"\b(?:N\.m(?:\.s/rad)?|N\.s/m|kg\.m\^2|degC)(?![\w.^])|\bN\.m(?=\.\s|\.$)")
_HELD = re.compile(r"(?<=\d) (?=(?:N·m|N|kg|m|rad|s|°C|%)(?:[\s./,;:·²]|$))")
_BLANKS = "\n\t\u00a0\u202f"
_GREEK = {
    "sigma": "σ",
    "mu": "µ",
    "tau": "τ",
    "alpha": "α",
    "beta": "β",
    "delta": "δ",
    "theta": "θ",
    "phi": "φ",
}


def plain(text: object) -> str:
    """Return text that can be displayed anywhere: characters that cannot be printed or encoded become U+FFFD."""
    encodable = str(text).encode("utf-8", "replace").decode("utf-8")
    return "".join(c if c.isprintable() or c in _BLANKS else "\ufffd" for c in encodable)


def prose(text: str) -> str:
    """Return a sentence with its units in printed form, joined to their numbers by spaces that do not break."""
    return _HELD.sub("\u00a0", _UNITS.sub(lambda match: pretty_unit(match.group()), text))


def sentence(text: str) -> str:
    """Return a clause as a sentence: a capital first, a full stop last."""
    text = text.strip()
    return f"{text[:1].upper()}{text[1:]}" + ("" if text.endswith((".", "!", "?")) or not text else ".")


def esc(text: object) -> str:
    """Return text for HTML, in an element or an attribute."""
    return html.escape(plain(text))


def number(x: float | None, digits: int = 3) -> str:
    """Return a number with some significant digits, or a dash for an unknown one."""
    if x is None or not math.isfinite(x):
        return NOTHING
    if x == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(x)))
    if -4 <= magnitude < 6:
        text = _round(x, digits - 1 - magnitude)
    else:
        text = f"{x:.{digits - 1}e}"
    return text.replace("-", MINUS)


def _round(x: float, decimals: int) -> str:
    return f"{round(x, decimals):.{max(decimals, 0)}f}"


def with_error(value: float, error: float | None, *, signed: bool = False) -> str:
    """Return `value ± error`, the value to the second significant digit of its error.

    Args:
        value: the estimate [any].
        error: its standard error [the same]; ± is left out if it is None or NaN (unknown); 0 means fixed.
        signed: write a plus, too.
    """
    plus = "+" if signed and value > 0 else ""
    if not math.isfinite(value):
        return NOTHING
    if error is None or not math.isfinite(error):
        return plus + number(value, 4)
    if error == 0:
        return f"{plus}{number(value, 4)} (fixed)"
    largest = max(abs(value), error)
    shift = 0
    if largest and not 1e-3 <= largest < 1e6:
        shift = math.floor(math.log10(largest))
    v, e = value / 10.0**shift, error / 10.0**shift
    decimals = min(1 - math.floor(math.log10(e)), 9)
    text = f"{_round(v, decimals)} ± {_round(e, decimals)}"
    text = plus + text if not shift else f"({plus}{text})e{shift}"
    return text.replace("-", MINUS)


def quantity(x: float, unit: str, digits: int = 3) -> str:
    """Return a number with the prefixed unit that makes it readable: 1.53e-5 N.m becomes `15.3 µN·m`.

    Args:
        x: the number [unit].
        unit: SI, as a model file writes it.
        digits: significant ones.
    """
    if not math.isfinite(x):
        return NOTHING
    factor, prefixed = readable(abs(x), pretty_unit(unit))
    return f"{number(x * factor, digits)} {prefixed}"


def percent(x: float | None) -> str:
    """Return a percentage, or a dash."""
    return NOTHING if x is None or not math.isfinite(x) else f"{number(x)} %"


def term(name: str) -> str:
    """Return a dynamics term or a parameter in words."""
    if without_direction(name) != name:
        return f"{term(without_direction(name))}, along {MINUS}q"
    return TERMS.get(name, name.replace("_", " "))


def dynamics(friction: JointFriction) -> list[tuple[str, Estimate]]:
    """Return the dynamics terms of a joint, the usual ones first."""
    order = list(TERMS)
    known = len(order)
    return sorted(
        friction.dynamics.items(), key=lambda kv: (order.index(kv[0]) if kv[0] in order else known, kv[0])
    )


def law_name(name: str, rate: Any = None) -> str:
    """Return a rate law in words.

    Args:
        name: of the law.
        rate: with its numbers, to say where both directions are alike.
    """
    try:
        words = rate_law(name).WORDS or name
    except BackdriveError:
        return name
    by = ", by direction"
    return f"{words.removesuffix(by)}, {ALIKE}" if words.endswith(by) and is_alike(rate) else words


def symbol(text: str) -> str:
    """Return a symbol of the papers as HTML: `sigma_p` becomes a sigma with a subscript; `F_p = F_n` stays an equation."""
    if " = " in text:
        return " = ".join(symbol(one) for one in text.split(" = "))
    text, _, way = text.partition("^")
    head, _, tail = text.partition("_")
    head = _GREEK.get(head, head)
    way = f"<sup>{esc(way).replace('-', MINUS)}</sup>" if way else ""
    return f"<i>{esc(head)}</i>" + (f"<sub>{esc(tail)}</sub>" if tail else "") + way


def count_of(n: int, one: str, many: str | None = None) -> str:
    """Return `1 warning` or `3 warnings`."""
    return f"{n} {one if n == 1 else many or one + 's'}"
