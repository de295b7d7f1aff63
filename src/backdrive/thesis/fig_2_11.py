"""Fig. 2.11: velocity and hand torque over time of joints moved by hand; Iwatani 2017, 2.5.1."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._balance import balance
from backdrive.thesis._manual import (
    AMPLITUDE,
    CONTACT,
    FREQUENCY,
    SHARE,
    HandRecord,
    by_hand,
)
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.scatter import ALIKE
from backdrive.thesis.setups import RATIO

SHOWN = 4.0, 10.0  # of the motion by hand, in the picture [s]
LENGTH = 4.0  # of each panel [s]
SETTING = (
    "Joints of Setup B, compliant with friction on the load's side; compensator (2.22) with "
    f"K = {CONTACT:g} N.m/rad, R = {SHARE:g} and the curve that a sweep of 20 deg identified on the same joint; gravity held. "
    f"The hand follows ±{AMPLITUDE:g} rad at {FREQUENCY:g} Hz, ten cycles judged. Joint 4 is assumed but for ratio and torque "
    "limit."
)


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Move Joints 0, 1, 2 and 4 by hand and return velocity and torque over time."""
    firm, soft, reaching = by_hand(seed, ratio)
    claims = [
        Claim(
            what=f"{_name(m)}: with compensation the hand's torque is smaller and ahead.",
            thesis="the lowered magnitudes and the forward-shifted phase",
            ours=f"{m.torques[0]:.2f} to {m.torques[1]:.2f} N.m, {m.forward:+.0f} deg; soft hand at the same speed "
            f"{s.torques[0]:.2f} to {s.torques[1]:.2f} N.m, {s.forward:+.0f} deg",
            gate="smaller and ahead, by the firm hand and by the soft one",
            holds=min(m.reduction, s.reduction) > 0.0 and min(m.forward, s.forward) > 0.0,
            why="Friction is in phase with velocity, inertia leads it by 90 deg. Joint 1 has the largest inertia: with a soft "
            "hand it sticks and jumps, and the jump needs additional torque.",
            statement="2.11-torque",
        )
        for m, s in zip(firm, soft, strict=False)
    ]
    claims += [
        Claim(
            what=f"{_name(m)}: the velocity does not differ between the two cases.",
            thesis="no significant difference",
            ours=f"a soft hand that intends the same motion {m.speed_change:+.1f} %; one that reaches as far as the velocity takes "
            f"{s.speed_change:+.1f} %",
            gate=f"within {100 * ALIKE:g} % by a soft hand that intends the same motion",
            holds=abs(m.speed_change) <= 100.0 * ALIKE,
            why_not="With less friction, the same intended motion moves the joint faster. So the person in the thesis must "
            "have controlled the visible motion.",
            statement="2.11-velocity",
        )
        for m, s in zip(reaching, soft, strict=False)
    ]
    claims.append(
        Claim(
            what="The most that the hand feels after a reversal, by the friction at rest",
            ours="; ".join(f"{_name(m)} {_peak(m):.1f} times" for m in firm) + " the friction at rest",
            holds=None,
            why=f"The contact of {CONTACT:g} N.m/rad pushes along the old direction over 2 F/K of motion: (1 + R) F for "
            "a moment, and the jump after it costs inertia.",
        )
    )
    claims.append(balance(r for m in (*firm, *soft) for r in (m.before, m.after)))
    return Outcome(
        name="fig-2.11",
        title="Joints moved by hand, without and with friction compensation",
        setting=SETTING,
        claims=tuple(claims),
        data={
            m.joint.name: {"firm": _columns(m), "soft": _columns(s)} for m, s in zip(firm, soft, strict=False)
        },
        numbers={f"{m.joint.name}_forward": m.forward for m in firm}
        | {f"{m.joint.name}_speed_change": m.speed_change for m in firm}
        | {f"{s.joint.name}_forward_soft": s.forward for s in soft},
    )


def _name(m: HandRecord) -> str:
    return m.joint.name.replace("_", " ").capitalize()


def _peak(m: HandRecord) -> float:
    """Return the largest torque of the hand with compensation by the Coulomb friction [1]."""
    return float(np.abs(m.after.force[m.after.time > 1.0]).max() / m.joint.law.torque(1e-6))


def _columns(m: HandRecord) -> dict[str, np.ndarray]:
    part = (m.after.time >= SHOWN[0]) & (m.after.time < SHOWN[1])
    columns = {"time": m.after.time[part]}
    for when, record in (("before", m.before), ("after", m.after)):
        columns[f"velocity_{when}"] = record.load_velocity[part]
        columns[f"torque_{when}"] = record.sensed[part]
    return columns


def draw(outcome: Outcome) -> Any:
    """Return the figure: a row a joint; velocity, torque of the firm hand, torque of the soft hand."""
    with house_style():
        figure, axes = own.sheet(4, 3, width=760.0, height=560.0, sharex=True)
        for row, (joint, hands) in zip(axes, outcome.data.items(), strict=False):
            for a, (hand, column) in zip(
                row, (("firm", "velocity"), ("firm", "torque"), ("soft", "torque")), strict=False
            ):
                d = hands[hand]
                part = d["time"] < d["time"][0] + LENGTH
                t = d["time"][part] - d["time"][0]
                for when, color, label in (
                    ("before", own.BEFORE, "none"),
                    ("after", own.AFTER, "compensated"),
                ):
                    a.plot(
                        *own.thin(t, d[f"{column}_{when}"][part], 6), color=color, linewidth=1.1, label=label
                    )
            own.name(row[0], own.joint_title(joint), y="velocity [rad/s]")
            own.name(row[1], "firm hand" if joint == "joint_0" else "", y="torque [N·m]")
            own.name(row[2], "soft hand, same speed" if joint == "joint_0" else "")
        for a in axes[-1]:
            a.set_xlabel("time [s]", color=LIGHT.ink)
        own.key(axes[0, 0], "lower left", 2, bbox_to_anchor=(0.25, 1.0))
    return figure
