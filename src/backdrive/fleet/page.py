"""One HTML page of a fleet that needs no network.

It shows a small picture of each joint, the worst first. A click opens the history of the joint.
"""

from __future__ import annotations

import base64
import html
import json
import os
import re
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from backdrive._files import write_whole
from backdrive._visible import visible
from backdrive.fleet.drift import Drift
from backdrive.fleet.history import History, number_of
from backdrive.fleet.population import Outlier

POINTS = 120  # of a history at most
NOTHING = 255  # a point without a value


def write_page(
    path: str | os.PathLike,
    drifts: Sequence[Drift],
    outliers: Sequence[Outlier] = (),
    *,
    silent: Mapping[str, str] | None = None,
    sentences: Sequence[str] = (),
    reports: Mapping[str, str] | None = None,
    title: str = "Fleet",
) -> Path:
    """Write the page.

    Args:
        path: of the file.
        drifts: the test result of every joint.
        outliers: joints that are unlike their siblings.
        silent: joints without a result in the last time, by `ROBOT/JOINT`, with a sentence (`silent_joints`).
        sentences: on the whole fleet.
        reports: of joints by `ROBOT/JOINT`: path of a report relative to the page.
        title: of the page.

    Raises:
        WriteError: it cannot be written.
    """
    apart: dict[str, str] = {}
    for one in outliers:
        apart.setdefault(f"{one.robot}/{one.joint}", one.sentence)
    silent = silent or {}
    order = sorted(drifts, key=lambda one: _rank(one, silent, apart))
    data = {"points": POINTS, "joints": [_joint(one, silent, apart, reports or {}) for one in order]}
    text = (
        json.dumps(data, ensure_ascii=True, separators=(",", ":"))
        .replace("<", "\\u003c")
        .replace("&", "\\u0026")
    )
    named = sum(one.named for one in drifts)
    head = [*sentences, f"{named} joints have changed; {len(apart)} are unlike their siblings."]
    if silent:
        head.append(f"{len(silent)} joints have no result of the last days, while others have.")
    folder = Path(__file__).parent
    page = (folder / "page.html").read_text(encoding="utf-8")
    parts = {
        "TITLE": html.escape(visible(title)),
        "SENTENCES": "".join(f"<p>{html.escape(visible(s))}</p>" for s in head),
        "DATA": text,
        "SCRIPT": (folder / "page.js").read_text(encoding="utf-8"),
    }
    return write_whole(Path(path), re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], page))


def _rank(one: Drift, silent: Mapping[str, str], apart: Mapping[str, str]) -> tuple:
    """Order: changed, the largest first; without results now; unlike its siblings; the rest by probability."""
    name = one.history.name
    size = -abs(one.size) if one.named else 0.0
    return (
        not one.named,
        size,
        name not in silent,
        name not in apart,
        one.p if np.isfinite(one.p) else 2.0,
        one.history.name,
    )


def _joint(
    one: Drift, silent: Mapping[str, str], apart: Mapping[str, str], reports: Mapping[str, str]
) -> dict[str, Any]:
    history = one.history
    first, last = int(history.day[0]), int(history.day[-1])
    low, high, points = _points(history)
    name = visible(history.name)
    about = {
        "n": name,
        "k": 2 if one.named else 3 if history.name in silent else 1 if history.name in apart else 0,
        "d": [first, last],
        "r": [_short(low), _short(high)],
        "y": points,
        "u": "N.m" if history.unit == "rad" else "N",
        "v": _short(history.speed),
        "s": one.sentence,
        "l": [_short(float(history.constant[-1])), _short(float(history.viscous[-1]))],
    }
    if one.onset is not None and one.interval is not None and one.named:
        about["o"] = [_day(one.onset), _day(one.interval[0]), _day(one.interval[1])]
    if history.name in silent:
        about["z"] = silent[history.name]
    if history.name in apart:
        about["a"] = apart[history.name]
    if one.named or history.name in apart or history.name in silent:
        about["p"] = visible(history.path[-1]) if len(history.path) else ""
    if history.name in reports:
        about["h"] = reports[history.name]
    return about


def _day(day: date) -> int:
    return number_of(day)


def _points(history: History) -> tuple[float, float, str]:
    """Return the range of the level and its course in bytes, 0 to 254 over the range, bins of equal time, in base 64."""
    day, level = history.day, history.level
    count = int(min(POINTS, max(day[-1] - day[0] + 1, 1)))
    bins = np.minimum(((day - day[0]) / max(day[-1] - day[0], 1) * count).astype(int), count - 1)
    total, number = np.bincount(bins, level, count), np.bincount(bins, minlength=count)
    low, high = float(level.min()), float(level.max())
    mean = np.divide(total, number, out=np.zeros(count), where=number > 0)
    scaled = np.clip(np.round((mean - low) / max(high - low, 1e-300) * 254), 0, 254)
    scaled[number == 0] = NOTHING
    return low, high, base64.b64encode(scaled.astype(np.uint8).tobytes()).decode()


def _short(value: float) -> float:
    return float(f"{value:.4g}") if np.isfinite(value) else 0.0
