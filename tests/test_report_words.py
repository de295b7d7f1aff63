"""Numbers, units and sentences of the report as printed, and colours that can be read."""

from __future__ import annotations

import math
import re

import pytest

from backdrive.report.entries import bounds
from backdrive.report.sheet import CSS
from backdrive.report.words import esc, number, prose, quantity, sentence, symbol, with_error


def luminance(colour):
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("scheme", [0, 1], ids=["light", "dark"])
def test_contrast_suffices(scheme):
    blocks = re.findall(r":root\{([^}]*--panel[^}]*)\}", CSS)
    colours = dict(re.findall(r"--([a-z-]+):(#[0-9a-f]{6})", blocks[scheme]))
    for ground in ("paper", "panel"):
        for front, least in {
            **dict.fromkeys(("ink", "muted", "good", "care", "poor", "accent"), 4.5),
            **dict.fromkeys(("fitted", "held-out", "truth", "band"), 3.0),
        }.items():
            a, b = sorted((luminance(colours[front]), luminance(colours[ground])), reverse=True)
            assert (a + 0.05) / (b + 0.05) >= least, (ground, front)


@pytest.mark.parametrize(
    ("value", "error", "expected"),
    [
        (12.3456, 0.0234, "12.346 ± 0.023"),
        (-0.04123, 0.011, "\u22120.041 ± 0.011"),
        (12345.6, 123.0, "12350 ± 120"),
        (203968.0, 33963.0, "204000 ± 34000"),
        (9.97, 0.0996, "9.970 ± 0.100"),
        (1.25, math.nan, "1.250"),
        (1.25, None, "1.250"),
        (0.0, 0.5, "0.00 ± 0.50"),
        (2.0, 0.0, "2.000 (fixed)"),
        (math.nan, 0.1, "—"),
        (4.2e-5, 1.1e-6, "(4.20 ± 0.11)e\u22125"),
        (3.4e7, 2e5, "(3.400 ± 0.020)e7"),
    ],
)
def test_measured(value, error, expected):
    assert with_error(value, error) == expected


def test_words():
    assert number(0.000012345) == "1.23e\u221205"
    assert number(1234567.0) == "1.23e+06"
    assert number(15.0) == "15.0"
    assert number(0.0) == "0"
    assert number(52183.0, 2) == "52000"
    assert number(math.inf) == "—"
    assert bounds(0.0, math.inf) == "≥ 0"
    assert bounds(-math.inf, math.inf) == "free"
    assert bounds(0.0, 1.0) == "0 … 1.00"
    assert symbol("sigma_p") == "<i>σ</i><sub>p</sub>"
    assert esc("<\"'&\x07\n") == "&lt;&quot;&#x27;&amp;\ufffd\n"
    assert prose("It is 3 N.m at 2 rad/s.") == "It is 3\u00a0N·m at 2\u00a0rad/s."
    assert prose("column N.mean, 4 N.m.") == "column N.mean, 4\u00a0N·m."
    assert sentence("the log holds no position ") == "The log holds no position."
    assert sentence("") == ""
    assert quantity(1.53e-5, "N.m") == "15.3 µN·m"
    assert quantity(7.25, "N") == "7.25 N"
    assert quantity(math.nan, "N") == "—"
