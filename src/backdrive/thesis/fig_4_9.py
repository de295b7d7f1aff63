"""Fig. 4.9 of Iwatani 2017: with HA inside, an admittance-controlled joint comes to rest with its actuator pushing."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.closed_loop import Record, play
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._sensorless import (
    ADMITTANCE,
    CASCADE,
    CASES,
    LITERAL,
    PERIOD,
    PRINTED,
    REST,
    admittance_scene,
    estimators,
    in_words,
    metronome,
)
from backdrive.thesis.fig_3_4 import identify_rate
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO, setups

SEEDS, CYCLES = 6, 4
PAUSE = 1.5  # between the beginnings of strokes [s]
HOLD, FREE = 1.0, 2.0  # at the end [s]
DWELL = 0.1  # for which a joint has not moved when it counts as resting [s]
SHOWN = 6.0  # of the figure [s]
MEASURES = ("external", "command", "friction", "balance", "free", "share")
OURS = "m = 2, two filters"
SETTINGS = {"as printed": (PRINTED, LITERAL), OURS: (ADMITTANCE, CASCADE)}


def run(seed: int = 0, seeds: int = SEEDS, cycles: int = CYCLES, ratio: float = RATIO) -> Outcome:
    """Guide the admittance-controlled Setup A with pauses at both ends, and look at it at rest.

    Args:
        seed: of the first of the hands.
        seeds: number of hands.
        cycles: back and forth.
        ratio: K_c by K [-].
    """
    plant = setups(ratio)["setup_a"]
    friction = estimators(plant, identify_rate(plant, seed))
    motions = [metronome(cycles, seed + i, hold=HOLD, free=FREE, interval=PAUSE) for i in range(seeds)]
    scenes = [
        admittance_scene(plant, motion, friction[case], seed + i, admittance=admittance, filter=filter_)
        for admittance, filter_ in SETTINGS.values()
        for case in CASES
        for i, motion in enumerate(motions)
    ]
    records = iter(play(scenes))
    runs = {name: {case: [next(records) for _ in motions] for case in CASES} for name in SETTINGS}
    found = {name: {c: np.array([_measure(r) for r in by[c]]) for c in CASES} for name, by in runs.items()}
    means = {
        name: {m: {c: float(by[c][:, i].mean()) for c in CASES} for i, m in enumerate(MEASURES)}
        for name, by in found.items()
    }
    record = runs["as printed"]["HA"][0]
    at = slice(0, round(SHOWN / PERIOD))
    return Outcome(
        name="fig-4.9",
        title="Equilibrium of admittance control with a friction estimate that does not decay",
        setting=(
            "Setup A under the admittance control of Fig. 4.8 as printed (m = 1 kg, G = 10, H = 2), and with m = 2 kg "
            "and two filters "
            f"in a row, guided with a stroke every {PAUSE:g} s, {cycles} cycles with each of {seeds} hands, held and "
            "let go. At rest: "
            f"slower than 0.1 mm/s for {DWELL:g} s."
        ),
        claims=(
            *_claims(found, means),
            balance((r for by in runs.values() for some in by.values() for r in some), weightless=False),
        ),
        data={
            "time": record.time[at],
            "position": 1.0 * record.load[at],
            "external": 1.0 * record.estimate[at],
            "friction": 1.0 * record.friction[at],
            "command": 1.0 * record.command[at],
            "rest": resting(record)[at],
            "balance": means[OURS],
        },
        numbers={
            f"{name}.{m}.{c}": x for name, b in means.items() for m, by in b.items() for c, x in by.items()
        },
    )


def resting(record: Record) -> np.ndarray:
    """Return when the load has not moved for a while, (n,)."""
    n = round(DWELL / PERIOD)
    slow = np.cumsum(np.concatenate([[0], np.abs(record.load_velocity) < REST]))
    rest = np.zeros(record.time.size, dtype=bool)
    rest[n - 1 :] = slow[n:] - slow[:-n] == n
    return rest


def _measure(record: Record) -> tuple[float, ...]:
    """Return the numbers of `MEASURES`: mean magnitudes at rest in the hand, and of the command without the hand [N]; "
    "0 without rest.
    """
    grip = record.scene.motion.grip > 0.0
    rest, held = resting(record), grip & (record.time > 1.0)
    free = rest & ~grip & (record.time > record.time[grip][-1] + 1.0)
    at = rest & held
    if not at.any():
        return (0.0,) * len(MEASURES)
    size = [np.abs(x[at]).mean() for x in (record.estimate, record.command, record.friction)]
    balance = np.abs(record.friction - record.command)[at].mean()
    alone = np.abs(record.command[free]).mean() if free.any() else 0.0
    return (*map(float, size), float(balance), float(alone), float(at.sum() / held.sum()))


def _claims(
    found: dict[str, dict[str, np.ndarray]], means: dict[str, dict[str, dict[str, float]]]
) -> tuple[Claim, ...]:
    def column(name: str, measure: str) -> np.ndarray:
        return found[name]["HA"][:, MEASURES.index(measure)]

    def at_rest(name: str) -> str:
        m = means[name]
        return (
            f"HA at rest {100 * m['share']['HA']:.0f} % of the time in the hand, there external "
            f"{m['external']['HA']:.2f} N, actuator "
            f"{m['command']['HA']:.1f} N, friction {m['friction']['HA']:.1f} N, the last two {m['balance']['HA']:.3f} N apart"
        )

    def equilibrium(name: str) -> bool:
        return bool(
            np.all(column(name, "share") > 0.05)
            and column(name, "external").max() < 0.5
            and column(name, "command").min() > 2.0
        )

    why = (
        "The virtual object rests where the estimate is zero, and there the estimated friction is what the actuator "
        "gives. The printed "
        "filter's output shakes the joint, so that there is no static friction state to be in."
    )
    gate = "at rest for more than 5 % of the time with every hand, external below 0.5 N, actuator above 2 N"
    return (
        Claim(
            what="With HA the estimated external force is almost zero at rest while the actuator's is not.",
            thesis="the estimated external force is almost zero in the static friction state, friction and actuator force are not",
            ours=at_rest("as printed"),
            gate=gate,
            holds=equilibrium("as printed"),
            why_not=why,
            statement="4.9-equilibrium",
        ),
        Claim(
            what="The same with m = 2 kg and two filters in a row.",
            ours=at_rest(OURS),
            gate=gate,
            holds=equilibrium(OURS),
        ),
        Claim(
            what="With P the actuator's force fades at rest (m = 2 kg, two filters in a row).",
            ours=f"actuator at rest in the hand {in_words(means[OURS]['command'], 'N', digits=2)}, without a hand "
            f"{in_words(means[OURS]['free'], 'N', digits=2)}",
            gate="P below HA with every hand",
            holds=bool(np.all(found[OURS]["P"][:, 1] < found[OURS]["HA"][:, 1])),
            why=(
                "The estimated friction decays at 20 1/s. The remaining actuator force then counts as external force and moves "
                "the virtual object until it vanishes."
            ),
        ),
    )


FORCES = {
    "external": "estimated external force",
    "friction": "estimated friction",
    "command": "actuator force",
}
BARS = {"external": "external", "friction": "friction", "command": "actuator", "free": "actuator,\nlet go"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: position and forces with HA over time, rest shaded; means at rest by estimator."""
    data = outcome.data
    t = data["time"]
    with house_style():
        figure, axes = own.sheet(4, 1, height=620.0)
        top, *rows = axes[:, 0]
        series = {
            "position": 1e3 * data["position"],
            "external": data["external"],
            "friction": data["friction"],
        }
        series["command"] = data["command"]
        for a, (what, values) in zip((top, rows[0], rows[1]), list(series.items()), strict=False):
            own.shade(a, t, data["rest"])
            a.set_xlim(t[0], t[-1])
            color = own.COLORS["HA"] if what == "external" else LIGHT.ink
            a.plot(t, values, color=color, linewidth=1.2, label=FORCES.get(what))
        rows[1].plot(
            t,
            data["command"],
            color=own.COLORS["CT"],
            linewidth=1.4,
            linestyle=own.DASHED,
            label=FORCES["command"],
        )
        own.name(top, "(a) HA; shaded: at rest", y="position [mm]")
        for a in rows[:2]:
            own.level(a)
            own.name(a, y="force [N]")
            own.key(a, "upper right", 2)
            low, high = a.get_ylim()
            a.set_ylim(low, high + 0.3 * (high - low))
        own.name(rows[1], x="time [s]", y="force [N]")
        below = rows[2]
        cases = tuple(data["balance"]["external"])
        for i, case in enumerate(cases):
            heights = [data["balance"][what][case] for what in BARS]
            places = [k + 0.25 * (i - 1) for k in range(len(BARS))]
            below.bar(places, heights, 0.22, color=own.COLORS[case], label=case, zorder=2)
        below.set_xticks(range(len(BARS)), list(BARS.values()))
        below.grid(False, axis="x")
        own.name(below, "(b) mean magnitudes at rest, m = 2 kg and two filters", y="force [N]")
        own.key(below, "upper left", 3)
    return figure
