"""Fig. 2.2: the desired trajectory of the sweep and its derivative; Iwatani 2017, (2.2)-(2.4), (2.15)."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._sweeps import RATE, TOP_SPEED, plan
from backdrive.thesis.outcome import Claim, Outcome

STROKE, CYCLES = 20.0, 5  # of the picture: A [deg], N


def run(seed: int = 0) -> Outcome:
    """Return the printed trajectory, its smooth form, and what (2.2)-(2.4) and (2.15) promise of it."""
    sweep = plan(STROKE, cycles=CYCLES)
    smooth = type(sweep)(sweep.stroke, TOP_SPEED, CYCLES)
    data = {}
    for name, motion in (("literal", sweep), ("smooth", smooth)):
        t = np.arange(int(motion.duration * RATE)) / RATE
        v = motion.velocity(t)
        data[name] = {
            "time": t,
            "position": motion.position(t) - motion.position_range[0],
            "velocity": v,
            "acceleration": motion.acceleration(t),
            "windows": motion.windows(),
            "speeds": motion.speeds,
        }
    t, p, v = (data["literal"][k] for k in ("time", "position", "velocity"))
    peaks = [np.abs(v[(t >= a) & (t < b)]).max() for a, b in sweep.windows()]
    slip = np.abs(np.gradient(p, 1.0 / RATE)[1:-1] - v[1:-1]).max() / TOP_SPEED
    full = plan(STROKE)
    series = np.pi * full.stroke * full.cycles / TOP_SPEED * np.sum(1.0 / np.arange(1, full.cycles + 1))
    top = {A: plan(A).peak_acceleration for A in (5.0, 10.0, 20.0, 50.0)}
    jump = _jump(data["literal"]["acceleration"]), _jump(data["smooth"]["acceleration"])
    claims = (
        Claim(
            what="Every cycle covers the same stroke A",
            thesis="A fixed",
            ours=f"{np.rad2deg(np.ptp(p)):.3f} deg for A = {STROKE:g} deg",
            gate="within 0.01 deg",
            holds=bool(abs(np.rad2deg(np.ptp(p)) - STROKE) < 0.01),
        ),
        Claim(
            what="The top speed of the n-th cycle is n V/N",
            thesis="nV/N",
            ours=", ".join(f"{x:.3f}" for x in peaks) + " rad/s",
            gate="within 0.1 %",
            holds=bool(np.allclose(peaks, sweep.speeds, rtol=1e-3)),
        ),
        Claim(
            what="(2.4) is the derivative of (2.2)",
            thesis="(2.2), (2.4)",
            ours=f"largest difference {100 * slip:.2f} % of V",
            gate="below 1 %",
            holds=bool(slip < 0.01),
        ),
        Claim(
            what="The duration is that of (2.15), for A = 20 deg, V = 2 rad/s, N = 10",
            thesis="(2.15)",
            ours=f"{full.duration:.2f} s; (2.15) gives {series:.2f} s",
            gate="equal",
            holds=bool(abs(full.duration - series) < 1e-9),
            statement="2.2-duration",
        ),
        Claim(
            what="The acceleration grows with V^2/A, which bounds A from below",
            thesis="proportional to V^2/A",
            ours=", ".join(f"A = {A:g} deg: {a:.1f} rad/s^2" for A, a in top.items()),
            gate="2 V^2/A",
            holds=bool(all(abs(a * np.deg2rad(A) - 2 * TOP_SPEED**2) < 1e-9 for A, a in top.items())),
            why="A is the full stroke here, so the amplitude is A/2 and the peak is 2 V^2/A.",
        ),
        Claim(
            what="Largest jump of the acceleration from one tick to the next: printed, and with the rate gliding between cycles",
            ours=f"{jump[0]:.1f} and {jump[1]:.1f} rad/s^2",
            holds=None,
            why="The printed trajectory starts and changes its frequency with a jump of acceleration at each turning point; "
            "plans of this package glide there by default. The experiments of this chapter use the printed one.",
        ),
    )
    return Outcome(
        name="fig-2.2",
        title="Desired trajectory of the sweep",
        setting=f"A = {STROKE:g} deg, V = {TOP_SPEED:g} rad/s; N = {CYCLES} cycles in the picture.",
        claims=claims,
        data=data,
        numbers={
            "duration": full.duration,
            "acceleration_jump": jump[0],
            "acceleration_jump_smooth": jump[1],
        },
    )


def _jump(acceleration: np.ndarray) -> float:
    """Return the largest change from tick to tick, the start from rest included [rad/s^2]."""
    return float(np.abs(np.diff(acceleration, prepend=0.0)).max())


def draw(outcome: Outcome) -> Any:
    """Return the figure: position above, velocity below, cycles marked."""
    data = outcome.data["literal"]
    t, windows = data["time"], data["windows"]
    edges = np.append(windows[:, 0], windows[-1, 1])
    with house_style():
        figure, axes = own.sheet(2, 1, height=330.0, sharex=True)
        (top,), (below,) = axes
        top.plot(*own.thin(t, np.rad2deg(data["position"]), 5), color=LIGHT.ink, linewidth=1.4)
        below.plot(*own.thin(t, data["velocity"], 5), color=LIGHT.ink, linewidth=1.4)
        for (begin, end), speed in zip(windows, data["speeds"], strict=False):
            for sign in (1, -1):
                below.plot(
                    [begin, end], [sign * speed] * 2, color=LIGHT.fitted, linewidth=1.0, linestyle=own.DASHED
                )
        for a in (top, below):
            for n, edge in enumerate(edges, start=1):
                a.axvline(edge, color=LIGHT.muted, linewidth=0.6, zorder=1)
                if a is top:
                    a.annotate(
                        f"T{n}", (edge, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 2),
                        textcoords="offset points", ha="center", color=LIGHT.muted, fontsize=own.SMALL,
                    )  # fmt: skip
        own.name(top, y="position p_d [deg]")
        own.name(below, x="time [s]", y="velocity v_d [rad/s]")
        below.plot([], [], color=LIGHT.fitted, linewidth=1.0, linestyle=own.DASHED, label="±nV/N")
        own.key(below, "lower left")
    return figure
