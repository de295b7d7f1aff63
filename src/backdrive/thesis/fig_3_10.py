"""Fig. 3.10 of Iwatani 2017: force peaks of a hand that guides three joints of Setup B, under five compensators."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import house_style
from backdrive.simulation.hand import Hand
from backdrive.thesis import _guided
from backdrive.thesis import _guided_plots as own
from backdrive.thesis._guided import Guidance, Peaks
from backdrive.thesis.fig_3_4 import JOINTS, identified, setups
from backdrive.thesis.fig_3_8 import claims
from backdrive.thesis.outcome import Claim, Outcome

STIFFNESS = 5e4  # K of the thesis [N.m/rad]
CYCLES = 30  # of the figure
SEEDS, SHORT = 20, 2  # hands for the share, and cycles of each
VARIED = 3  # cycles of a variant
ARM = JOINTS[1:]
#: Name -> K_c by K, R.
VARIANTS: dict[str, tuple[float, float]] = {
    "literal R = 1, K_c = 2K": (2.0, 1.0),
    "K_c = K": (1.0, 0.9),
}
SETTING = (
    "Joints 0, 1 and 2 of Setup B (simulated), each on its own: the thesis moves them together along a square. Friction on the "
    "load's side, F = 6.85, 9.56 and 3.15 N.m, K_c = 1e5 N.m/rad = 2K, one tick of delay, gravity compensated. Hand of "
    "120 N.m/rad and 6 N.m.s/rad, strokes of 0.2 rad in 0.7 s every 0.75 s, 5 % variation, sensor noise 0.02 N.m. "
    "Compensators: K = 5e4 N.m/rad, alpha = 20 1/s, dither 15 Hz with R_d = 0.3, R = 0.9, the joint's own curve with the thesis' F."
)


def guidance(name: str) -> Guidance:
    """Return a joint of Setup B with K_c = 2K and a hand of 120 N.m/rad and 6 N.m.s/rad.

    Args:
        name: `joint_0`, `joint_1` or `joint_2`.
    """
    plant = setups()[name]
    return Guidance(
        plant=plant,
        rate=plant.law.rate,
        stiffness=STIFFNESS,
        hand=Hand(stiffness=120.0, damping=6.0, noise=0.02),
        stroke=0.2,
        dither=0.3,
    ).with_transmission(2.0)


def run(seed: int = 0) -> Outcome:
    """Guide each joint for 30 cycles in each case, then with 20 other hands, then with other transmissions and R = 1.

    Args:
        seed: of the first hand; the others follow.
    """
    bases = {name: guidance(name) for name in ARM}
    runs, labels = [], []
    for name, base in bases.items():
        runs.append((base, CYCLES, seed))
        labels.append((name, "long"))
        for i in range(SEEDS):
            runs.append((base, SHORT, 100 * (seed + 1) + i))
            labels.append((name, "hand"))
        for variant, changed in _varied(base).items():
            runs.append((changed, VARIED, seed))
            labels.append((name, variant))
    found: dict[tuple[str, str], list[Peaks]] = {}
    for label, records, (_, cycles, _) in zip(labels, _guided.guide(runs), runs):
        found.setdefault(label, []).append(_guided.peaks(records, cycles))
    judged: list[Claim] = []
    panels, numbers = {}, {}
    for name in ARM:
        long = found[name, "long"][0]
        low = np.array([_guided.smallest(one) for one in found[name, "hand"]])
        panels[name] = {"unit": "N.m", "share": low.mean(axis=0), **_guided.bars(long, seed)}
        judged += claims(long, low, "N.m", seed, name)
        judged.append(_dither(long, name))
        numbers |= {f"{name}.PD{s}": float(v) for s, v in zip(_guided.SIDES, _guided.means(long)[-1])}
    names = [label for _, label in labels if label not in ("long", "hand")]
    variants = {v: {name: _guided.means(found[name, v][0]) for name in ARM} for v in dict.fromkeys(names)}
    judged += [_variant(v, {name: found[name, v][0] for name in ARM}) for v in variants]
    return Outcome(
        name="fig-3.10",
        title="Mean and standard deviation of the force peaks, Setup B",
        setting=SETTING
        + f" {CYCLES} cycles; the share of hands from {SEEDS} seeds with {SHORT} cycles each.",
        claims=tuple(judged),
        data={"panels": panels, "variants": variants},
        numbers=numbers,
    )


def _varied(base: Guidance) -> dict[str, Guidance]:
    own = setups()[base.plant.name]
    made = {
        name: base.with_transmission(ratio).replace(share=share) for name, (ratio, share) in VARIANTS.items()
    }
    made["curve from the sweep"] = base.replace(rate=identified(own))
    return made


def _dither(found: Peaks, name: str) -> Claim:
    pairs = {case: _guided.against(found, case, case + "D") for case in ("C", "P")}
    return Claim(
        what=f"{name}: dither makes the peaks smaller.",
        thesis="the same features as Setup A",
        ours="; ".join(
            f"{case} - {case}D: " + ", ".join(f"{c.difference:+.2f} N.m (p = {c.p:.1g})" for c in pair)
            for case, pair in pairs.items()
        ),
        gate="in both directions",
        holds=all(c.difference > 0.0 for pair in pairs.values() for c in pair),
    )


def _variant(variant: str, found: dict[str, Peaks]) -> Claim:
    return Claim(
        what=f"{variant}: which case is smallest.",
        thesis="smallest with PD" if "literal" in variant else "",
        ours="; ".join(
            f"{name}: {_guided.in_words(_guided.means(one), 'N.m')}"
            + (" (PD smallest)" if all(_guided.smallest(one)) else " (PD not smallest in both)")
            for name, one in found.items()
        ),
        holds=None,
        why=(
            "The compensator then cancels the whole stiffness that holds the motor. With dither the joint never sticks, the "
            "decay rate no longer matters, and CD and PD are the same."
            if variant == "K_c = K"
            else ""
        ),
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: a panel a joint, bars of five cases along +q and -q, with Student's t-test against PD."""
    panels = outcome.data["panels"]
    with house_style():
        figure, axes = own.sheet(1, len(panels), width=900.0, height=330.0)
        for a, (joint, panel) in zip(axes[0], panels.items()):
            own.peak_bars(a, panel)
            own.name(
                a, own.title(joint), "\n", "peak of the external torque [N·m]" if joint == "joint_0" else ""
            )
            a.tick_params(axis="x", labelsize=own.SMALL - 2.0)
    return figure
