"""Fig. 2.13: saw-tooth tracking over time with four compensations; Iwatani 2017, 2.5.2."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.identification.metrics import mean_magnitude, tracking_error
from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._manual import PERIOD
from backdrive.thesis._tracking import CASES, SETTING, TEETH, TOOTH, by_joint, lag_check
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO

EVERY = 20  # tick of the picture


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Track saw-teeth with all joints and return position and error over time."""
    done = by_joint(seed, ratio)
    claims = []
    for joint, cases in done.items():
        by_speed = {case: _by_speed(record.wanted - record.reading) for case, record in cases.items()}
        behind = max(by_speed["MOP"][v] / min(by_speed[case][v] for case in CASES) - 1.0 for v in TEETH)
        whole = {case: tracking_error(record.wanted, record.reading) for case, record in cases.items()}
        claims.append(
            Claim(
                what=f"{joint.replace('_', ' ').capitalize()}: over all teeth the tracking is most accurate with MOP.",
                thesis="the tracking accuracy is overall highest with MOP",
                ours=", ".join(f"{case} {1e3 * whole[case]:.2f}" for case in CASES) + " mrad RMS",
                gate="MOP below each of the others",
                holds=whole["MOP"] < min(whole[case] for case in CASES if case != "MOP"),
                statement="2.13-overall",
            )
        )
        claims.append(
            Claim(
                what=f"{joint.replace('_', ' ').capitalize()}: the error of MOP by the smallest, speed by speed",
                ours=f"at most {100 * behind:.1f} % above the smallest; "
                + "; ".join(
                    f"{v:g} rad/s: "
                    + ", ".join(f"{case} {1e3 * by_speed[case][v]:.1f}" for case in CASES)
                    + " mrad"
                    for v in TEETH
                ),
                holds=None,
                why="A curve and a straight line through the same F_0 lie the closer, the lower the speed; the swing after the "
                "corners grows with it.",
            )
        )
    claims.append(lag_check(done))
    return Outcome(
        name="fig-2.13",
        title="Saw-tooth tracking with four compensations",
        setting=SETTING,
        claims=tuple(claims),
        data={
            joint: {
                "time": cases["NC"].time[::EVERY],
                "wanted": cases["NC"].wanted[::EVERY],
                **{case: record.reading[::EVERY] for case, record in cases.items()},
            }
            for joint, cases in done.items()
        },
        numbers={
            f"{joint}_{case}_largest": float(np.abs(record.wanted - record.reading).max())
            for joint, cases in done.items()
            for case, record in cases.items()
        },
    )


def _by_speed(e: np.ndarray) -> dict[float, float]:
    """Return the root mean square of an error during the teeth of each speed [rad]."""
    found, begin = {}, 0
    for speed, count in TEETH.items():
        end = begin + 2 * count * round(TOOTH / speed / PERIOD)
        found[speed] = mean_magnitude(e[begin:end])
        begin = end
    return found


COLORS = {"NC": LIGHT.muted, "MO": "#b3261e", "MOL": "#d9730d", "MOP": "#2a78b8"}


def draw(outcome: Outcome) -> Any:
    """Return the figure: a row a joint; position left, error right."""
    with house_style():
        figure, axes = own.sheet(
            len(outcome.data), 2, width=760.0, height=155.0 * len(outcome.data), sharex=True
        )
        for (left, right), (joint, d) in zip(axes, outcome.data.items(), strict=False):
            left.plot(
                d["time"], d["wanted"], color=LIGHT.ink, linewidth=0.9, linestyle=own.DASHED, label="desired"
            )
            for case, color in COLORS.items():
                left.plot(d["time"], d[case], color=color, linewidth=0.9, label=case)
                right.plot(d["time"], 1e3 * (d["wanted"] - d[case]), color=color, linewidth=0.9, label=case)
            largest = 1e3 * float(np.abs(d["wanted"] - d["NC"]).max())
            right.set_ylim(-1.25 * largest, 1.25 * largest)
            own.name(left, own.joint_title(joint), y="position [rad]")
            own.name(right, y="error [mrad]")
        for a in axes[-1]:
            a.set_xlabel("time [s]", color=LIGHT.ink)
        own.key(axes[0, 0], "lower left", 5, bbox_to_anchor=(0.2, 1.0))
    return figure
