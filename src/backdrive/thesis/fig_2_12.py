"""Fig. 2.12: mean magnitudes (2.23) of velocity and hand torque of joints moved by hand; Iwatani 2017, 2.5.1."""

from __future__ import annotations

from typing import Any

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation import JointSimulation
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._manual import SOFT, HandRecord, by_hand, joints, move_by_hand
from backdrive.thesis.fig_2_11 import SETTING
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO

AMPLITUDES = (0.2, 0.3)  # besides [rad]


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Move Joints 0, 1, 2 and 4 by a firm hand and a soft hand."""
    chosen = joints(ratio)
    firm, soft, reaching = by_hand(seed, ratio)
    rows = {
        "firm hand": firm,
        "soft hand, same reach": reaching,
        "soft hand, same speed": soft,
    }
    claims = [
        Claim(
            what=f"{_name(m.joint)}: the hand's torque is smaller by 60 to 80 %.",
            thesis="smaller by 60 to 80 percent",
            ours=f"{m.torques[0]:.2f} to {m.torques[1]:.2f} N.m: {m.reduction:.1f} % less; by a soft hand of the same speed "
            f"{s.reduction:.1f} %",
            gate="60 to 80 %, firm hand",
            holds=60.0 <= m.reduction <= 80.0,
            why_not="The remaining torque of Joint 1 is mostly inertia, which no friction compensation reduces.",
            statement="2.12-reduction",
        )
        for m, s in zip(firm, soft, strict=False)
    ]
    claims.append(
        Claim(
            what="The share of inertia in the remaining torque",
            ours="; ".join(
                f"{_name(m.joint)} {m.inertia_torque:.2f} of {m.torques[1]:.2f} N.m is inertia, the rest fell by "
                f"{m.reduction_beside_inertia:.0f} %"
                for m in firm
            ),
            holds=None,
            why="No friction compensation reduces inertia.",
        )
    )
    for amplitude in AMPLITUDES:
        other = move_by_hand(
            chosen, seed=seed, amplitudes=[(amplitude, amplitude)] * len(chosen), ratio=ratio
        )
        claims.append(
            Claim(
                what=f"The same for ±{amplitude:g} rad",
                ours=_reductions(other),
                holds=None,
            )
        )
    claims.append(
        Claim(
            what=f"A soft hand of {SOFT:g} N.m/rad that intends the same motion",
            ours="; ".join(
                f"{_name(m.joint)} {m.reduction:.0f} %, velocity {m.speed_change:+.0f} %"
                for m in rows["soft hand, same reach"]
            ),
            holds=None,
            why="Such a hand moves a joint with less friction faster, which needs more torque for inertia.",
        )
    )
    claims.append(
        Claim(
            what=f"A soft hand of {SOFT:g} N.m/rad that keeps the velocity of the firm one",
            ours=_reductions(rows["soft hand, same speed"]),
            holds=None,
            why="A soft hand cannot break a joint away at its own instant: a joint that sticks at a reversal jumps, and the jump "
            "is inertia.",
        )
    )
    claims.append(balance(r for m in (*firm, *soft) for r in (m.before, m.after)))
    return Outcome(
        name="fig-2.12",
        title="Mean magnitudes of velocity and hand torque",
        setting=SETTING,
        claims=tuple(claims),
        data={
            row: {
                m.joint.name: {"speeds": m.speeds, "torques": m.torques, "inertia": m.inertia_torque}
                for m in many
            }
            for row, many in rows.items()
        },
        numbers={f"{m.joint.name}, {row}": m.reduction for row, many in rows.items() for m in many},
    )


def _name(joint: JointSimulation) -> str:
    return joint.name.replace("_", " ").capitalize()


def _reductions(many: list[HandRecord]) -> str:
    return "; ".join(f"{_name(m.joint)} {m.reduction:.1f} %" for m in many)


ROWS = ("firm hand", "soft hand, same speed")


def draw(outcome: Outcome) -> Any:
    """Return the figure: velocities above, torques below, by kind of hand; the part of inertia in lighter bars."""
    colors = {"none": own.BEFORE, "compensated": own.AFTER, "of that, inertia": LIGHT.held_out}
    with house_style():
        figure, axes = own.sheet(2, 2, height=420.0, sharex="col", sharey="row")
        for column, row in enumerate(ROWS):
            found = outcome.data[row]
            groups = [own.joint_title(joint) for joint in found]
            speeds = {"none": [d["speeds"][0] for d in found.values()]}
            speeds["compensated"] = [d["speeds"][1] for d in found.values()]
            torques = {"none": [d["torques"][0] for d in found.values()]}
            torques["compensated"] = [d["torques"][1] for d in found.values()]
            torques["of that, inertia"] = [d["inertia"] for d in found.values()]
            own.bars(axes[0, column], groups, speeds, colors)
            own.bars(axes[1, column], groups, torques, colors)
            own.name(axes[0, column], row.capitalize())
            for i, (before, after) in enumerate(zip(torques["none"], torques["compensated"], strict=False)):
                axes[1, column].annotate(
                    f"−{100 * (1 - after / before):.0f} %",
                    (i, max(before, after)),
                    xytext=(0, 3),
                    textcoords="offset points",
                    ha="center",
                    color=LIGHT.ink,
                    fontsize=own.SMALL,
                )
        axes[0, 0].set_ylabel("V_s [rad/s]", color=LIGHT.ink)
        axes[1, 0].set_ylabel("F_s [N·m]", color=LIGHT.ink)
        own.key(axes[1, 0], "upper right")
    return figure
