"""A curve drawn with characters, for a terminal without pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # Braille: four rows of two dots a character
_BLANK = 0x2800


def plot_lines(
    branches: Sequence[tuple[np.ndarray, np.ndarray]],
    *,
    x_unit: str,
    y_unit: str,
    width: int = 56,
    height: int = 11,
    braille: bool = True,
) -> list[str]:
    """Return the lines of a small plot, its axes through zero.

    Args:
        branches: curves that are not joined, x and y of each, (m,) and (m,).
        x_unit: SI.
        y_unit: SI.
        width: of the drawing [characters].
        height: of the drawing [lines].
        braille: draw with Braille dots, eight a character; otherwise with `*`.
    """
    pairs = [(np.asarray(x, float), np.asarray(y, float)) for x, y in branches]
    pairs = [(x[ok], y[ok]) for x, y in pairs if np.any(ok := np.isfinite(x) & np.isfinite(y))]
    if not pairs:
        return []
    left, right = _span(np.concatenate([x for x, _ in pairs]))
    low, high = _span(np.concatenate([y for _, y in pairs]))
    columns, rows = (2 * width, 4 * height) if braille else (width, height)
    mask = np.zeros((rows, columns), dtype=bool)
    for x, y in pairs:
        fine = np.linspace(0.0, len(x) - 1.0, 8 * columns)
        at = np.arange(len(x))
        column = (np.interp(fine, at, x) - left) / (right - left) * (columns - 1)
        row = (high - np.interp(fine, at, y)) / (high - low) * (rows - 1)
        mask[np.rint(row).astype(int), np.rint(column).astype(int)] = True
    zero_row = round(high / (high - low) * (height - 1))
    zero_column = round(-left / (right - left) * (width - 1))
    cells = _braille(mask) if braille else [["*" if m else " " for m in line] for line in mask]
    for i, line in enumerate(cells):
        for j, cell in enumerate(line):
            if cell == " ":
                line[j] = _axis(i == zero_row, j == zero_column, braille)
    labels = {0: f"{high:.3g}", height - 1: f"{low:.3g}", zero_row: "0"}
    margin = max(len(y_unit), *(len(label) for label in labels.values()))
    drawn = [f"{labels.get(i, ''):>{margin}} {''.join(line)}".rstrip() for i, line in enumerate(cells)]
    below = [" "] * width
    for text, place in ((f"{left:.3g}", 0), (f"{right:.3g}", width), ("0", zero_column)):
        start = min(max(place - len(text) // 2, 0), width - len(text))
        if all(c == " " for c in below[max(start - 1, 0) : start + len(text) + 1]):
            below[start : start + len(text)] = text
    drawn.append(f"{'':>{margin}} {''.join(below)} {x_unit}".rstrip())
    return [f"{y_unit:>{margin}}", *drawn]


def _span(values: np.ndarray) -> tuple[float, float]:
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    return (low, high) if high > low else (-1.0, 1.0)


def _axis(horizontal: bool, vertical: bool, braille: bool) -> str:
    marks = " │─┼" if braille else " |-+"
    return marks[2 * horizontal + vertical]


def _braille(mask: np.ndarray) -> list[list[str]]:
    height, width = mask.shape[0] // 4, mask.shape[1] // 2
    code = np.zeros((height, width), dtype=int)
    for i, pair in enumerate(_DOTS):
        for j, bit in enumerate(pair):
            code += bit * mask[i::4, j::2]
    return [[chr(_BLANK + c) if c else " " for c in line] for line in code]
