"""Fig. 4.11 of Iwatani 2017: a decay rate that switches, algFE2 (4.20), in admittance control of Setup A and of Joint 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.closed_loop import Record
from backdrive.thesis import _sensorless_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._release_admittance import CASES, SEEDS, axis, joint_0, measure, runs
from backdrive.thesis._sensorless import ADMITTANCE, CASCADE
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.scatter import clearly_less, less
from backdrive.thesis.setups import RATIO

OURS = "setup_a, m = 2, two filters"


def run(seed: int = 0, seeds: int = SEEDS, ratio: float = RATIO) -> Outcome:
    """Move Joint 0 and Setup A once by hand under admittance control with alpha_N, alpha_H and algFE2.

    Args:
        seed: of the first of the hands.
        seeds: number of hands.
        ratio: K_c by K [-].
    """
    screw = axis(seed, ratio)
    settings = {
        "setup_a": screw,
        "joint_0": joint_0(seed, ratio),
        OURS: replace(screw, admittance=ADMITTANCE, filter=CASCADE),
    }
    records = {name: runs(setting, seed, seeds) for name, setting in settings.items()}
    found = {name: measure(records[name], settings[name]) for name in settings}
    numbers = {
        f"{name}.{case}.{what}": float(np.mean(value))
        for name, by in found.items()
        for case, measured in by.items()
        for what, value in measured.items()
    }
    return Outcome(
        name="fig-4.11",
        title="A decay rate that switches, in admittance control",
        setting=(
            "A hand moves the joint once in 0.6 s, holds it for 0.6 s and lets go; rest is judged in the third second "
            "after. Setup A "
            "as printed: m = 1 kg, b = 15 N s/m, G = 10, H = 2, V_W = 0.01 m/s. Joint 0: V_W = 0.001 rad/s, put half a "
            "count above one count. The other numbers are not printed and were chosen: m = 0.12 kg m^2, b = 2 N m s/rad, "
            "K_p = 1e4 N m/rad, K_d = 60 N m s/rad, two "
            f"filters of 250 rad/s^2 and 750 rad/s^3. K_c = K on both. {seeds} hands."
        ),
        claims=(
            *(c for name, of in (("setup_a", "Setup A"),) for c in _statements(found[name], of)),
            *_beside(found),
            *(
                balance((r for some in records[name].values() for r in some), weightless=False)
                for name in ("setup_a", "joint_0")
            ),
        ),
        data={name: _figure_data(records[name]) for name in ("setup_a", "joint_0")},
        numbers=numbers,
    )


def _figure_data(records: Mapping[str, Sequence[Record]]) -> dict[str, Any]:
    some = next(iter(records.values()))[0]
    grip = some.scene.motion.grip > 0.0
    return {
        "time": some.time,
        "unit": some.scene.plant.unit,
        "released": float(some.time[grip][-1]),
        "cases": {c: {"position": 1.0 * r[0].load, "force": 1.0 * r[0].sensed} for c, r in records.items()},
    }


def _rests(by: Mapping[str, Mapping[str, np.ndarray]]) -> str:
    return (
        ", ".join(f"{case} {int(by[case]['rest'].sum())}" for case in CASES)
        + f" of {by[CASES[0]]['rest'].size}"
    )


def _peaks(by: Mapping[str, Mapping[str, np.ndarray]]) -> dict[str, float]:
    return {case: float(by[case]["peak"].mean()) for case in CASES}


def _list(values: Mapping[str, float], unit: str, digits: int = 2) -> str:
    return ", ".join(f"{case} {values[case]:.{digits}f}" for case in CASES) + f" {unit}"


def _statements(by: Mapping[str, Mapping[str, np.ndarray]], of: str) -> tuple[Claim, ...]:
    peak = {case: by[case]["peak"] for case in CASES}
    held = {case: by[case]["held"] for case in CASES}
    n, rests, peaks = by[CASES[0]]["rest"].size, _rests(by), _list(_peaks(by), "N")
    moving = _list({case: 1e3 * float(held[case].mean()) for case in CASES}, "mm/s")
    return (
        Claim(
            what=f"{of}: with the variable alpha the force peaks are smallest.",
            thesis="in the case with the variable alpha, the force peaks were smallest",
            ours=f"mean peaks {peaks}",
            gate="95 % interval of the paired difference below zero against alpha_N and alpha_H",
            holds=less(peak["algFE2"], peak["alpha_N"]) and less(peak["algFE2"], peak["alpha_H"]),
            why_not="The joint breaks away before the decay rate has gone up (0.1 s): algFE2 then is alpha_N.",
            statement="4.11-peaks",
        ),
        Claim(
            what=f"{of}: with the variable alpha the joint rests after the hand has let go.",
            thesis="after removing the external torque, the joint were in stationary state",
            ours=f"at rest: {rests}",
            gate="at rest with at least nine hands of ten",
            holds=int(by["algFE2"]["rest"].sum()) >= 0.9 * n,
            why_not="The printed filter shakes the joint, whatever the decay rate.",
            statement="4.11-rest",
        ),
        Claim(
            what=f"{of}: with alpha_N the joint is difficult to stop by hand.",
            thesis="once the joints began to move, it was difficult to stop the joints by hand",
            ours=f"RMS velocity in the hand after the stroke {moving}",
            gate="alpha_N above algFE2 and alpha_H, 95 % interval of the paired difference",
            holds=less(held["algFE2"], held["alpha_N"]) and less(held["alpha_H"], held["alpha_N"]),
            statement="4.11-nominal",
        ),
        Claim(
            what=f"{of}: with alpha_N the force peaks are almost those of the variable alpha.",
            thesis="the force peaks were almost equivalent to the case with the variable alpha",
            ours=f"mean peaks {peaks}",
            gate="means within 5 %",
            holds=abs(float(peak["algFE2"].mean() / peak["alpha_N"].mean()) - 1.0) < 0.05,
            statement="4.11-equal",
        ),
        Claim(
            what=f"{of}: with alpha_H the force peaks are larger.",
            thesis="the force peaks were larger than the other cases",
            ours=f"mean peaks {peaks}",
            gate="by more than 5 % against alpha_N and algFE2, 95 % interval of the paired difference above zero",
            holds=clearly_less(peak["alpha_N"], peak["alpha_H"])
            and clearly_less(peak["algFE2"], peak["alpha_H"]),
            statement="4.11-high",
        ),
    )


def _beside(found: Mapping[str, Mapping[str, Mapping[str, np.ndarray]]]) -> tuple[Claim, ...]:
    arm = found["joint_0"]
    moving = {case: 1e3 * float(arm[case]["held"].mean()) for case in CASES}
    return (
        Claim(
            what="Joint 0 with a virtual object, gains and filter that were chosen here.",
            thesis="mostly the same features in Setup A and Setup B",
            ours=f"at rest: {_rests(arm)}; mean peaks {_list(_peaks(arm), 'N m')}; RMS velocity in the hand after the stroke "
            f"{_list(moving, 'mrad/s')}",
            holds=None,
            why="The thesis does not print m, b and the gains of Joint 0.",
        ),
        Claim(
            what="Setup A with m = 2 kg and two filters in a row.",
            ours=f"at rest: {_rests(found[OURS])}; mean peaks {_list(_peaks(found[OURS]), 'N')}",
            holds=None,
            why="V_W lies above alpha_H F/K: algFE2 is alpha_N again before the contact lets go of anything.",
        ),
    )


TITLES = {"setup_a": "(a) Setup A", "joint_0": "(b) Setup B, Joint 0"}
NAMES = {"alpha_N": "α = 20 1/s", "alpha_H": "α = 500 1/s", "algFE2": "algFE2"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: a column a machine; position above, force below."""
    with house_style():
        figure, axes = own.sheet(2, 2, height=400.0, sharex="col")
        for column, (machine, title) in enumerate(TITLES.items()):
            data = outcome.data[machine]
            above, below = axes[:, column]
            factor, unit, force = (1e3, "mm", "N") if data["unit"] == "m" else (1.0, "rad", "N·m")
            for case, series in data["cases"].items():
                how: dict[str, Any] = {"color": own.COLORS[case], "linewidth": 1.4, "label": NAMES[case]}
                if case == "algFE2":
                    how["linestyle"] = own.DASHED
                above.plot(data["time"], factor * series["position"], **how)
                below.plot(data["time"], series["force"], **(how | {"linewidth": 1.0}))
            low, high = above.get_ylim()
            above.set_ylim(low, high + 0.15 * (high - low))
            own.release(above, data["released"], label="hand lets go")
            own.release(below, data["released"])
            own.level(below)
            own.name(above, title, y=f"position [{unit}]")
            own.name(below, x="time [s]", y=f"force sensor [{force}]")
            below.set_xlim(0.3, data["time"][-1])
        own.key(axes[0, 0], "lower right")
        for a in axes.flat:
            a.yaxis.label.set_color(LIGHT.ink)
    return figure
