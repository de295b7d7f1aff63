"""Fig. 3.10 of Iwatani 2017: force peaks of a hand that leads the arm around a square, under five compensators."""

from __future__ import annotations

from typing import Any

from backdrive.report.pictures.canvas import house_style
from backdrive.thesis import _hand_guiding, _square
from backdrive.thesis import _hand_guiding_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._square import ARM, AXES, SETTING
from backdrive.thesis.fig_3_8 import claims
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO

ROUNDS = 10  # squares of the figure
STROKES = 10  # cycles of the single strokes
PACES = {2.0: "two sides a beat, as on Setup A", 4.0: "a square a beat"}  # beside a side a beat
FEW = 4  # squares at another pace


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Lead the arm around squares in each case, and each joint by single strokes.

    Args:
        seed: of the hand.
        ratio: K_c by K [-].
    """
    cases = _square.by_case(seed, ratio, ROUNDS)
    judged: list[Claim] = []
    panels, numbers = {}, {}
    for i, axis in enumerate(AXES):
        found = _square.peaks(cases, i, ROUNDS)
        panels[axis] = {"unit": "N", "axis": axis, **_hand_guiding.bars(found, seed)}
        judged += claims(found, "N", "3.10", seed, axis)
        numbers |= {
            f"{axis}{side}.{case}": float(v)
            for case, pair in zip(_hand_guiding.CASES, _hand_guiding.means(found), strict=False)
            for side, v in zip(_hand_guiding.SIDES, pair, strict=False)
        }
    judged.append(_paces(seed, ratio))
    single = _hand_guiding.guide([(g, STROKES, seed) for g in _square.guidances(ratio).values()])
    for name, records in zip(ARM, single, strict=False):
        found = _hand_guiding.peaks(records, STROKES)
        panels[name] = {"unit": "N.m", **_hand_guiding.bars(found, seed)}
        numbers |= {
            f"{name}.PD{s}": float(v)
            for s, v in zip(_hand_guiding.SIDES, _hand_guiding.means(found)[-1], strict=False)
        }
        judged.append(
            Claim(
                what=f"{own.title(name)} alone, by single strokes of 0.2 rad: mean peaks",
                ours=_hand_guiding.in_words(_hand_guiding.means(found), "N.m"),
                holds=None,
            )
        )
    return Outcome(
        name="fig-3.10",
        title="Mean and standard deviation of the force peaks, Setup B",
        setting=f"{SETTING} {ROUNDS} squares. Beside it each joint alone, {STROKES} strokes back and forth as on Setup A.",
        claims=(*judged, _square.work_check(cases), balance(r for some in single for r in some.values())),
        data={"panels": panels},
        numbers=numbers,
    )


def _paces(seed: int, ratio: float) -> Claim:
    """Return the mean peaks at the other paces that the thesis' words allow."""
    words = []
    for pace, name in PACES.items():
        cases = _square.by_case(seed, ratio, FEW, pace)
        for i, axis in enumerate(AXES):
            found = _square.peaks(cases, i, FEW, pace)
            words.append(f"{name}, {axis}: {_hand_guiding.in_words(_hand_guiding.means(found), 'N')}")
    return Claim(
        what="The same at other paces: the thesis prints a metronome of 0.667 Hz, and not what is moved at a beat",
        ours="; ".join(words),
        holds=None,
        why="Faster sides need more torque for inertia, which no friction compensator reduces.",
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: above the square, along and against x and y; below single joints along +q and -q; tests against PD."""
    panels = outcome.data["panels"]
    with house_style():
        figure, axes = own.sheet(2, 6, width=900.0, height=640.0)
        grid = axes[0, 0].get_gridspec()
        for a in axes.flat:
            a.remove()
        places = {name: grid[0, 3 * i : 3 * i + 3] for i, name in enumerate(AXES)}
        places |= {name: grid[1, 2 * i : 2 * i + 2] for i, name in enumerate(ARM)}
        for (name, place), letter in zip(places.items(), "abcde", strict=False):
            a = own.panel(figure, place)
            own.peak_bars(a, panels[name])
            square = name in AXES
            title = f"square, along {name}" if square else f"{own.title(name)} alone"
            force = "force [N]" if square else "torque [N·m]"
            own.name(a, f"({letter}) {title}", "\n", f"peak of the external {force}")
            a.tick_params(axis="x", labelsize=own.SMALL - (0.0 if square else 2.0))
    return figure
