"""Fig. 2.14: tracking errors (2.26) of four compensations, and the gains at which their order breaks; Iwatani 2017, 2.5.2."""

from __future__ import annotations

from typing import Any

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._manual import curves
from backdrive.thesis._tracking import (
    CASES,
    DAMPINGS,
    SETTING,
    by_damping,
    by_joint,
    error,
    lag_check,
    pd,
    saw_teeth,
    track,
    viscosity,
)
from backdrive.thesis.fig_2_13 import COLORS
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO, wrist

WEAK = 10.0  # a gain with which Joint 4 hardly moves against its friction [N.m/rad]


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Return the tracking errors of all joints, and their order by damping ratio."""
    done = by_joint(seed, ratio)
    E = {joint: {case: error(r) for case, r in cases.items()} for joint, cases in done.items()}
    claims = [
        Claim(
            what=f"{_name(joint)}: the tracking error is smallest with MOP.",
            thesis="MOP provides smaller tracking error than MOL, MO, and NC",
            ours=", ".join(f"{case} {1e3 * e[case]:.2f}" for case in reversed(CASES)) + " mrad",
            gate="MOP below each of the others",
            holds=e["MOP"] < min(e["MOL"], e["MO"], e["NC"]),
            statement="2.14-smallest",
        )
        for joint, e in E.items()
    ]
    ratios = by_damping(seed, ratio)
    ordered = {
        joint: {r: e["MOP"] < e["MOL"] < e["MO"] for r, e in found.items()} for joint, found in ratios.items()
    }
    damped = [r for r in DAMPINGS if r >= 0.5]
    claims.append(
        Claim(
            what="MOP < MOL < MO at every damping ratio from 0.5 on",
            ours="; ".join(
                f"{_name(j)}: " + ", ".join(f"{r:g}" for r in DAMPINGS if ordered[j][r]) for j in ratios
            ),
            gate=f"on every joint at {', '.join(f'{r:g}' for r in damped)}",
            holds=all(ordered[j][r] for j in ratios for r in damped),
        )
    )
    claims.append(
        Claim(
            what="Where it fails: a PD that is little damped itself",
            ours="; ".join(
                f"{_name(j)} at {DAMPINGS[0]:g}: "
                + ", ".join(f"{c} {1e3 * e[DAMPINGS[0]][c]:.1f}" for c in CASES[1:])
                + " mrad"
                for j, e in ratios.items()
            ),
            gate="the order breaks on Joints 0, 1 and 2",
            holds=all(not ordered[j][DAMPINGS[0]] for j in ("joint_0", "joint_1", "joint_2")),
            why="The joint's own viscous friction damps such a loop, and its compensation removes that damping. So the better "
            "the compensation, the longer the joint oscillates after each corner.",
        )
    )
    joint = wrist(4)
    held = float(joint.law.torque(0.5)) / WEAK
    weak = {
        case: error(r)
        for case, r in track([(joint, pd(joint, WEAK))], seed=seed, target=saw_teeth(), ratio=ratio)[
            0
        ].items()
    }
    claims.append(
        Claim(
            what=f"Beside it a gain so low ({WEAK:g} N.m/rad on Joint 4) that friction holds the joint {held:.2f} rad off",
            ours=", ".join(f"{case} {1e3 * weak[case]:.0f}" for case in CASES) + " mrad",
            holds=None,
            why="Such a slow loop lags behind the faster teeth with or without friction, and has less damping without it.",
        )
    )
    claims.append(lag_check(done))
    return Outcome(
        name="fig-2.14",
        title="Tracking errors of four compensations",
        setting=SETTING,
        claims=tuple(claims),
        data={"errors": E, "ratios": ratios},
        numbers={f"{j}_{case}": E[j][case] for j in E for case in CASES}
        | {f"{j}_viscosity": viscosity(law) for j, law in curves(seed, ratio).items()},
    )


def _name(joint: str) -> str:
    return joint.replace("_", " ").capitalize()


def draw(outcome: Outcome) -> Any:
    """Return the figure: bars of E_s by joint, and below E_s by that of MO over the damping ratio of the PD."""
    errors, ratios = outcome.data["errors"], outcome.data["ratios"]
    with house_style():
        figure, axes = own.sheet(2, 4, width=760.0, height=420.0, sharey="row")
        for a in axes[0]:
            a.remove()
        top = own.panel(figure, axes[0, 0].get_gridspec()[0, :])
        series = {case: [1e3 * e[case] for e in errors.values()] for case in COLORS}
        own.bars(top, [own.joint_title(joint) for joint in errors], series, COLORS)
        own.name(top, "(a) at a damping ratio of 0.5", y="E_s [mrad]")
        own.key(top, "upper right", 4)
        for i, (a, (joint, by_ratio)) in enumerate(zip(axes[1], ratios.items(), strict=False)):
            for case in ("MO", "MOL", "MOP"):
                relative = [e[case] / e["MO"] for e in by_ratio.values()]
                a.plot(
                    list(by_ratio),
                    relative,
                    "o-",
                    color=COLORS[case],
                    markersize=3,
                    linewidth=1.2,
                    label=case,
                )
            a.axvspan(0.5, 1.0, color=LIGHT.grid, alpha=0.45, zorder=0, linewidth=0)
            a.set_xlim(0.0, 1.02)
            own.name(
                a, f"(b) {own.joint_title(joint)}" if i == 0 else own.joint_title(joint), "damping ratio"
            )
        axes[1, 0].set_ylabel("E_s by that of MO", color=LIGHT.ink)
    return figure
