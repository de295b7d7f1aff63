"""Fig. 2.3: data of a sweep, and the windows around its velocity peaks; Iwatani 2017, (2.7)."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.identification.function_a import SHARE
from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.thesis import _sweep_plots as own
from backdrive.thesis._sweeps import CYCLES, SETTING, TOP_SPEED, plan, sweep
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import arm

STROKE = 20.0  # A [deg]
SHOWN = 7  # cycle of the lower panel, as the thesis' n-th


def run(seed: int = 0) -> Outcome:
    """Sweep Joint 1 and return velocity and torque with the samples that (2.7) uses."""
    joint = arm()[1]
    done = sweep(joint, STROKE, seed=seed)
    log, knots = done.log, done.knots["literal"]
    t, f = log.time, done.torque
    v = np.diff(done.position, prepend=done.position[0]) / log.period
    windows = plan(STROKE).windows()
    speeds = TOP_SPEED * np.arange(1, CYCLES + 1) / CYCLES
    used = np.zeros(t.size, dtype=int)
    for (begin, end), speed in zip(windows, speeds, strict=False):
        inside = (t >= begin) & (t < end)
        used[inside & (v >= SHARE * speed)] = 1
        used[inside & (v <= -SHARE * speed)] = -1
    ratio = knots.V / speeds
    reached = np.array([np.abs(v[(t >= a) & (t < b)]).max() for a, b in windows]) / speeds
    tops = np.sqrt(reached**2 - SHARE**2) / np.arccos(
        SHARE / reached
    )  # mean of a sine's top above c, by nV/N
    level = float(joint.weight(0.0))
    error = knots.F - joint.law.torque(knots.V)
    claims = (
        Claim(
            what="The controller only has to reach the top speed of each cycle",
            thesis="enough to realize V",
            ours=f"{100 * reached.min():.1f} to {100 * reached.max():.1f} % of nV/N",
            gate="at least 98 %",
            holds=bool(reached.min() > 0.98),
        ),
        Claim(
            what="V_n is not nV/N but the mean of a sine's top above c",
            thesis="V_n = average, c = 0.8",
            ours=f"{ratio.min():.4f} to {ratio.max():.4f} of nV/N; sines of the speeds that were reached give "
            f"{tops.min():.4f} to {tops.max():.4f}",
            gate="within 1 % in each cycle",
            holds=bool(np.all(np.abs(ratio / tops - 1) < 0.01)),
            why="The top 7 % of the range of speeds is therefore extrapolated.",
        ),
        Claim(
            what="Half the sum of the directions is gravity and leaves F_n",
            thesis="(2.13), (2.14)",
            ours=f"{knots.bias:.2f} N.m; put in: {level:.2f} N.m",
            gate="within 0.3 N.m",
            holds=bool(abs(knots.bias - level) < 0.3),
        ),
        Claim(
            what="F_n is the friction at V_n",
            thesis="(2.14)",
            ours=f"errors {error.min():+.2f} to {error.max():+.2f} N.m of {joint.law.torque(2.0):.1f} N.m",
            gate="within 0.5 N.m",
            holds=bool(np.abs(error).max() < 0.5),
            why="The remaining error grows with speed: a backward difference gives the velocity of an instant before that of "
            "the paired torque, so inertia does not cancel.",
        ),
    )
    return Outcome(
        name="fig-2.3",
        title="Data of a sweep and the windows around its velocity peaks",
        setting=f"{SETTING} Joint 1, A = {STROKE:g} deg, c = {SHARE:g}.",
        claims=claims,
        data={
            "time": t,
            "velocity": v,
            "torque": f,
            "used": used,
            "windows": windows,
            "speeds": speeds,
            "V": knots.V,
            "F_pos": knots.F_pos,
            "F_neg": knots.F_neg,
            "share": SHARE,
            "shown": SHOWN,
        },
        numbers={f"F_{n + 1}": float(x) for n, x in enumerate(knots.F)},
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: (a) the whole sweep, (b) one cycle with its windows, (c) torque over velocity with the pairs."""
    d = outcome.data
    t, v, f, used = d["time"], d["velocity"], d["torque"], d["used"]
    n = int(d["shown"])
    begin, end = d["windows"][n - 1]
    cycle = (t >= begin) & (t < end)
    threshold = d["share"] * d["speeds"][n - 1]
    with house_style():
        figure, axes = own.sheet(2, 3, height=360.0, width=760.0, width_ratios=(1.2, 1.0, 1.1))
        for row, y, label in ((0, v, "velocity [rad/s]"), (1, f, "torque [N·m]")):
            whole, one = axes[row, 0], axes[row, 1]
            whole.plot(*own.thin(t, y, 4), color=LIGHT.muted, linewidth=0.7)
            one.plot(t[cycle], y[cycle], color=LIGHT.muted, linewidth=0.9)
            for sign, color in ((1, LIGHT.fitted), (-1, LIGHT.held_out)):
                part = used == sign
                whole.plot(t[part], y[part], ".", color=color, markersize=1.2, rasterized=True)
                one.plot(t[part & cycle], y[part & cycle], ".", color=color, markersize=2.0, rasterized=True)
            own.name(whole, "(a) whole sweep" if row == 0 else "", "time [s]" if row else "", label)
            own.name(one, f"(b) cycle n = {n}" if row == 0 else "", "time [s]" if row else "")
        for sign in (1, -1):
            axes[0, 1].axhline(sign * threshold, color=LIGHT.ink, linewidth=0.8, linestyle=own.DASHED)
        axes[0, 1].annotate(
            "cnV/N",
            (end, threshold),
            xytext=(0, 3),
            textcoords="offset points",
            ha="right",
            fontsize=own.SMALL,
        )
        for sign, F in ((1, d["F_pos"][n - 1]), (-1, -d["F_neg"][n - 1])):
            axes[1, 1].axhline(F, color=LIGHT.ink, linewidth=0.8, linestyle=own.DASHED)
            axes[1, 1].annotate(
                "F⁺" if sign > 0 else "F⁻",
                (end, F), xytext=(0, 3), textcoords="offset points", ha="right", fontsize=own.SMALL,
            )  # fmt: skip
        for a in axes[:, 2]:
            a.remove()
        plane = figure.add_subplot(axes[0, 0].get_gridspec()[:, 2])
        plane.grid(True, color=LIGHT.grid, linewidth=0.7)
        for side in ("top", "right", "left"):
            plane.spines[side].set_visible(False)
        plane.tick_params(colors=LIGHT.muted, labelsize=own.SMALL)
        plane.plot(*own.thin(v, f, 2), ",", color=LIGHT.band, rasterized=True)
        for sign, color, label in (
            (1, LIGHT.fitted, "used, along +q"),
            (-1, LIGHT.held_out, "used, along −q"),
        ):
            plane.plot(
                v[used == sign],
                f[used == sign],
                ".",
                color=color,
                markersize=1.5,
                label=label,
                rasterized=True,
            )
        V = np.concatenate([d["V"], -d["V"]])
        plane.plot(
            V,
            np.concatenate([d["F_pos"], -d["F_neg"]]),
            "o",
            color=LIGHT.paper,
            mec=LIGHT.ink,
            ms=5,
            label="averages",
        )
        own.name(plane, "(c) torque over velocity", "velocity [rad/s]", "torque [N·m]")
        own.key(plane, "upper left")
    return figure
