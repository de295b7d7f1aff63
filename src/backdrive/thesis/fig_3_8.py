"""Fig. 3.8 of Iwatani 2017: force peaks of a hand that guides Setup A, under five compensators."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from backdrive.report.pictures.canvas import house_style
from backdrive.simulation.hand import Hand
from backdrive.thesis import _hand_guiding
from backdrive.thesis import _hand_guiding_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._hand_guiding import CASES, Comparison, Guidance, Peaks
from backdrive.thesis.fig_3_4 import identify_rate
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import K_A, RATIO, setups

CYCLES = 30  # of the figure


def guidance(ratio: float = RATIO) -> Guidance:
    """Return Setup A, the curve that its sweep finds, and a hand of 800 N/m and 40 N.s/m.

    Args:
        ratio: K_c by K [-].
    """
    plant = setups(ratio)["setup_a"]
    return Guidance(
        plant=plant,
        rate=identify_rate(plant),
        stiffness=K_A,
        hand=Hand(stiffness=800.0, damping=40.0, noise=0.05),
        stroke=0.06,
        dither=1.0,
        share=1.0,
    )


SETTING = (
    "Setup A (simulated): friction 12/8 N on the load's side, K_c = K = 1.2e6 N/m, counts of 5 um, one tick of delay. "
    "Hand of 800 N/m and 40 N.s/m, strokes of 0.06 m in 0.7 s every 0.75 s, 5 % variation, force sensor with 0.05 N of noise. "
    "Compensators as printed: alpha = 20 1/s, dither 15 Hz with R_d = 1, no factor R, curve as identified by the sweep."
)


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Guide Setup A for 30 cycles in each case.

    Args:
        seed: of the hand.
        ratio: K_c by K [-].
    """
    (records,) = _hand_guiding.guide([(guidance(ratio), CYCLES, seed)])
    found = _hand_guiding.peaks(records, CYCLES)
    return Outcome(
        name="fig-3.8",
        title="Mean and standard deviation of the force peaks, Setup A",
        setting=SETTING + f" {CYCLES} cycles.",
        claims=(*claims(found, "N", "3.8", seed), by_direction(found, seed), balance(records.values())),
        data={"panels": {"setup_a": {"unit": "N", **_hand_guiding.bars(found, seed)}}, "peaks": found},
        numbers={
            f"mean.{case}{side}": float(value)
            for case, pair in zip(CASES, _hand_guiding.means(found), strict=False)
            for side, value in zip(_hand_guiding.SIDES, pair, strict=False)
        },
    )


def claims(found: Peaks, unit: str, figure: str, seed: int, joint: str = "") -> tuple[Claim, ...]:
    """Judge what the thesis says of the mean peaks; a difference counts where its 95 % interval leaves out zero.

    Args:
        found: peaks by case.
        unit: of the force.
        figure: `3.8` or `3.10`, before the statement's name.
        seed: of the bootstrap.
        joint: named in the sentences, if several are judged.
    """
    of = f"{joint}: " if joint else ""
    tests = {case: _hand_guiding.against(found, case, seed=seed) for case in CASES if case != "PD"}
    dithered = {case: _hand_guiding.against(found, case, case + "D", seed) for case in ("C", "P")}
    gate = "PD below each of the others along +q and -q, 95 % interval of the difference above zero"
    return (
        Claim(
            what=f"{of}The mean peak is smallest with PD.",
            thesis="the average value is smallest in the case of PD",
            ours=f"{_hand_guiding.in_words(_hand_guiding.means(found), unit)}; above PD by {_pairs(tests, unit)}",
            gate=gate,
            holds=all(c.low > 0.0 for pair in tests.values() for c in pair),
            why_not="CD dithers after every stop as PD does, once equality in (3.27e) counts as stuck, and does what PD does.",
            statement=f"{figure}-smallest",
        ),
        Claim(
            what=f"{of}Dither makes the mean peaks smaller.",
            thesis="smaller with dither, P against PD and C against CD",
            ours=f"by {_pairs(dithered, unit)}",
            gate="95 % interval of the difference above zero, along +q and -q",
            holds=all(c.low > 0.0 for pair in dithered.values() for c in pair) if figure == "3.8" else None,
            statement="3.8-dither" if figure == "3.8" else "",
        ),
        Claim(
            what=f"{of}PD differs from each other case by Student's t-test.",
            thesis="*** (p < 0.1 %)" if figure == "3.8" else "***, and ns",
            ours="; ".join(
                f"{case} p = " + ", ".join(f"{c.p:.2g}" for c in pair) for case, pair in tests.items()
            ),
            gate="p < 0.1 % against every case, in both directions" if figure == "3.8" else "",
            holds=max(c.p for pair in tests.values() for c in pair) < _hand_guiding.SIGNIFICANT
            if figure == "3.8"
            else None,
            why="Simulated hands vary by 5 %, people by more, so that p is smaller here than in the thesis.",
            statement="3.8-test" if figure == "3.8" else "",
        ),
    )


def by_direction(found: Peaks, seed: int) -> Claim:
    """Judge whether the mean peaks differ in the two directions, in every case."""
    apart = {case: _hand_guiding.compare(pair[:, 0], pair[:, 1], seed) for case, pair in found.items()}
    return Claim(
        what="The mean peaks along +q and -q differ.",
        thesis="averages and standard deviations are different in each direction",
        ours=", ".join(f"{case} {c.difference:+.2f} [{c.low:.2f}, {c.high:.2f}]" for case, c in apart.items())
        + " N",
        gate="95 % interval of the difference without zero, in every case",
        holds=all(c.low * c.high > 0.0 for c in apart.values()),
        why_not="The friction of 12 and 8 N is compensated for each direction, so the remaining forces need not differ.",
        statement="3.8-direction",
    )


def _pairs(tests: Mapping[str, tuple[Comparison, Comparison]], unit: str) -> str:
    return (
        "; ".join(
            f"{case} " + ", ".join(f"{c.difference:+.2f} [{c.low:.2f}, {c.high:.2f}]" for c in pair)
            for case, pair in tests.items()
        )
        + f" {unit}"
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: bars of five cases along +q and -q, with Student's t-test against PD."""
    with house_style():
        figure, axes = own.sheet(1, 1, width=480.0, height=330.0)
        own.peak_bars(axes[0, 0], outcome.data["panels"]["setup_a"])
        own.name(axes[0, 0], "Setup A", "\n", "peak of the external force [N]")
    return figure
