"""Units as log files spell them, and what turns them into SI."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """A unit of a column.

    Attributes:
        kind: what it measures: `time`, `angle`, `angle rate`, `length`, `speed`, `torque`, `force`, `temperature`, or
            `raw` for what has no place in a log before a factor is known (percent, ampere, volt).
        factor: SI value of one unit [SI/unit].
        offset: SI value of zero [SI].
    """

    kind: str
    factor: float = 1.0
    offset: float = 0.0


_DEG = math.pi / 180
_REV = 2 * math.pi

_TABLE: dict[str, Unit] = {
    **{
        key: Unit("time", factor)
        for key, factor in {"s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0}.items()
    },
    **{"ms": Unit("time", 1e-3), "msec": Unit("time", 1e-3), "millis": Unit("time", 1e-3)},
    **{
        "us": Unit("time", 1e-6),
        "usec": Unit("time", 1e-6),
        "ns": Unit("time", 1e-9),
        "nsec": Unit("time", 1e-9),
    },
    **{"min": Unit("time", 60.0), "h": Unit("time", 3600.0)},
    **{"rad": Unit("angle"), "rads": Unit("angle"), "radian": Unit("angle"), "radians": Unit("angle")},
    **{"mrad": Unit("angle", 1e-3), "deg": Unit("angle", _DEG), "degs": Unit("angle", _DEG)},
    **{"degree": Unit("angle", _DEG), "degrees": Unit("angle", _DEG), "°": Unit("angle", _DEG)},
    **{
        "rev": Unit("angle", _REV),
        "revs": Unit("angle", _REV),
        "turn": Unit("angle", _REV),
        "turns": Unit("angle", _REV),
    },
    **{"rad/s": Unit("angle rate"), "rad/sec": Unit("angle rate"), "mrad/s": Unit("angle rate", 1e-3)},
    **{
        "deg/s": Unit("angle rate", _DEG),
        "deg/sec": Unit("angle rate", _DEG),
        "°/s": Unit("angle rate", _DEG),
    },
    **{
        "dps": Unit("angle rate", _DEG),
        "degree/s": Unit("angle rate", _DEG),
        "degrees/s": Unit("angle rate", _DEG),
    },
    **{
        "rpm": Unit("angle rate", _REV / 60),
        "rev/min": Unit("angle rate", _REV / 60),
        "1/min": Unit("angle rate", _REV / 60),
        "u/min": Unit("angle rate", _REV / 60),
        "r/min": Unit("angle rate", _REV / 60),
    },
    **{
        "rps": Unit("angle rate", _REV),
        "rev/s": Unit("angle rate", _REV),
        "turn/s": Unit("angle rate", _REV),
    },
    **{
        "m": Unit("length"),
        "mm": Unit("length", 1e-3),
        "cm": Unit("length", 1e-2),
        "um": Unit("length", 1e-6),
    },
    **{
        "m/s": Unit("speed"),
        "mm/s": Unit("speed", 1e-3),
        "cm/s": Unit("speed", 1e-2),
        "mm/min": Unit("speed", 1e-3 / 60),
    },
    **{
        "nm": Unit("torque"),
        "n.m": Unit("torque"),
        "n*m": Unit("torque"),
        "n-m": Unit("torque"),
        "n m": Unit("torque"),
    },
    **{
        "mnm": Unit("torque", 1e-3),
        "mn.m": Unit("torque", 1e-3),
        "mn*m": Unit("torque", 1e-3),
        "knm": Unit("torque", 1e3),
    },
    **{"ncm": Unit("torque", 1e-2), "n.cm": Unit("torque", 1e-2)},
    **{"n": Unit("force"), "mn": Unit("force", 1e-3), "kn": Unit("force", 1e3)},
    **{
        "degc": Unit("temperature"),
        "°c": Unit("temperature"),
        "c": Unit("temperature"),
        "celsius": Unit("temperature"),
    },
    **{"k": Unit("temperature", 1.0, -273.15), "kelvin": Unit("temperature", 1.0, -273.15)},
    **{"degf": Unit("temperature", 5 / 9, -160 / 9), "°f": Unit("temperature", 5 / 9, -160 / 9)},
    **{
        key: Unit("raw")
        for key in ("%", "a", "ma", "v", "mv", "counts", "count", "inc", "qc", "w", "1", "-", "promille", "‰")
    },
}

#: Units that a column name may end with, after an underscore: `pos_deg`, `time_ms`.
_SUFFIXES = {
    **{
        key: key
        for key in (
            "deg",
            "rad",
            "rpm",
            "ms",
            "us",
            "ns",
            "s",
            "nm",
            "mnm",
            "mm",
            "m",
            "n",
            "degc",
            "mrad",
            "ma",
            "rev",
            "sec",
        )
    },
    **{
        "deg_s": "deg/s",
        "deg_per_s": "deg/s",
        "degps": "deg/s",
        "rad_s": "rad/s",
        "rad_per_s": "rad/s",
        "radps": "rad/s",
    },
    **{
        "m_s": "m/s",
        "m_per_s": "m/s",
        "mm_s": "mm/s",
        "mm_per_s": "mm/s",
        "a": "a",
        "v": "v",
        "percent": "%",
    },
}

#: A longer name is nobody's abbreviation, and is not taken apart.
LONGEST = 120

_INVERSE = re.compile(r"^(?:(.+?)[ .*])?(s|min)\^?-1$")  # rad s^-1, min-1

_BRACKETS = re.compile(r"\s*[\[(]\s*([^\[\]()]*)\s*[\])]\s*$")

_OF_JOINTS = re.compile(
    r"(q|dq|qd|tau|pos|vel|speed|eff|torque|angle|(joint|axis|motor)_?(pos|vel|eff|tor))", re.IGNORECASE
)


def parse(text: str) -> Unit | None:
    """Return the unit a text spells, or None if it spells none."""
    key = text.strip().strip("[]()").strip()
    if key in ("mN", "MN"):  # the only pair that differs by its capital alone
        return Unit("force", 1e-3 if key == "mN" else 1e6)
    key = (
        key.lower().replace("·", ".").replace("⋅", ".").replace("μ", "u").replace("µ", "u").replace("º", "°")
    )
    key = key.replace(" / ", "/").replace("newton", "n").replace("meter", "m").replace("⁻¹", "^-1")
    key = (
        _INVERSE.sub(lambda match: f"{match[1] or 1}/{match[2]}", key)
        if "/" not in key
        else key.replace("^-1", "")
    )
    return _TABLE.get(key)


def split(name: str) -> tuple[str, str]:
    """Split a header such as `q [deg]`, `tau (N.m)` or `q/rad` into the bare name and its unit ('' if none)."""
    if len(name) > LONGEST:
        return name, ""
    match = _BRACKETS.search(name)
    # q[1] is the second of several and so is position [1], duty [1] is a ratio
    if match and match[1].isdigit() and (match[0][0] in "[(" or _OF_JOINTS.match(name)):
        return name.strip(), ""
    if match and parse(match[1]) and match.start() > 0:
        return name[: match.start()].strip(), match[1].strip()
    if "/" in name:
        bare, _, unit = name.partition("/")
        if bare.strip() and parse(unit) and not unit.strip().isdigit():
            return bare.strip(), unit.strip()
    return name.strip(), ""


def split_suffix(name: str) -> tuple[str, str]:
    """Split a name such as `pos_deg` or `vel_deg_per_s` into the bare name and its unit ('' if none)."""
    lower = name.lower() if len(name) <= LONGEST else ""
    for ending in sorted(_SUFFIXES, key=len, reverse=True):
        if lower.endswith("_" + ending) and len(name) > len(ending) + 1:
            return name[: -len(ending) - 1], _SUFFIXES[ending]
    return name, ""
