"""Fig. 3.6 of Iwatani 2017: displacement of Setup A by dither alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from backdrive.control.compensators import Dither, dither
from backdrive.laws import CoulombViscous, Law
from backdrive.report.pictures.canvas import LIGHT, house_style
from backdrive.simulation.joint import JointSimulation
from backdrive.simulation.open_loop import drive
from backdrive.thesis import _hand_guiding_plots as own
from backdrive.thesis.fig_3_3 import COMPENSATOR, PHASES, encoder_counts
from backdrive.thesis.fig_3_4 import intercepts
from backdrive.thesis.outcome import Claim, Outcome
from backdrive.thesis.setups import RATIO, setups

PERIOD = 1e-3  # s
DURATION = 0.6  # s
SETTLED = 0.2  # counted from here on [s]
FREQUENCY = 15.0  # of the dither [Hz]
SHARE = 1.0  # R_d of the thesis on Setup A
SUBSTEP = 2e-5  # of the integration [s]
WANTED = 2.0  # counts in each direction
TITLES = {"K_c = 2K": "twice as stiff: K_c = 2K", "F_n = F_p": "equal friction: F_n = F_p"}


def wave(plant: JointSimulation, time: np.ndarray) -> np.ndarray:
    """Return the dither of a joint that stays stuck [N], (n,): Iwatani 2017, (3.26)."""
    F_p, F_n = intercepts(plant.law.rate)
    row, state = Dither(share=SHARE).row(), np.zeros(dither.STATES)
    return np.array([dither.tick(row, 0, state, 0, True, -F_n, F_p, 0.0, PERIOD, t, False) for t in time])


def dither_alone(plant: JointSimulation) -> dict[str, Any]:
    """Let dither alone act on a stuck joint, and show what the encoder sees from many resting places within a count.

    Args:
        plant: Setup A, or one like it.

    Returns:
        `time` [s], `dither` [N], `motor` [m] (true displacement), (n,) each; `counts` (places, n) and `reach` (places, 2), the
        largest displacement shown in each direction, in counts; `moved`, the load's travel [m].
    """
    time = PERIOD * np.arange(round(DURATION / PERIOD))
    force = wave(plant, time)
    target = np.stack([force, np.zeros_like(force)], axis=1)
    out, _ = drive(plant.replace(encoder_count=0.0), target, closed=False, period=PERIOD, substep=SUBSTEP)
    shown = np.array([encoder_counts(out[:, 0], plant.encoder_count, phase) for phase in PHASES])
    after = shown[:, round(SETTLED / PERIOD) :]
    return {
        "time": time,
        "dither": force,
        "motor": out[:, 0],
        "moved": float(PERIOD * np.abs(out[:, 3]).sum()),
        "counts": shown,
        "reach": np.stack([after.max(axis=1), -after.min(axis=1)], axis=1),
        "count": plant.encoder_count,
        "swing": _swing(plant, out[round(SETTLED / PERIOD) :, 0], force),
    }


def _swing(plant: JointSimulation, motor: np.ndarray, force: np.ndarray) -> float:
    """Return the amplitude of the motor by that of an undamped mass on K_c under the same sine [-]."""
    below = 1.0 - (2.0 * np.pi * FREQUENCY) ** 2 * plant.motor_inertia / plant.stiffness
    return float(np.ptp(motor) / np.ptp(force) * plant.stiffness * below)


def variants(ratio: float = RATIO) -> dict[str, JointSimulation]:
    """Return Setup A with K_c twice as stiff, as it is, and with equal friction of 12 N."""
    soft = setups(ratio)["setup_a"]
    plant = soft.replace(stiffness=2.0 * COMPENSATOR)
    equal = CoulombViscous(
        coulomb_positive=12.0, coulomb_negative=12.0, viscous_positive=20.0, viscous_negative=20.0
    )
    return {
        "K_c = 2K": plant,
        "Setup A": soft,
        "F_n = F_p": soft.replace(law=Law(rate=equal)),
    }


def run(seed: int = 0, ratio: float = RATIO) -> Outcome:
    """Let dither act on Setup A.

    Args:
        seed: not used; nothing here is random.
        ratio: K_c by K [-].
    """
    del seed
    found = {name: dither_alone(plant) for name, plant in variants(ratio).items()}
    for one in found.values():
        both = np.all(one["reach"] >= WANTED, axis=1)
        one["share"] = float(np.mean(both))
        one["shown"] = int(np.median(np.flatnonzero(both))) if both.any() else PHASES.size // 2
        one["span"] = one["reach"].sum(axis=1)
    return Outcome(
        name="fig-3.6",
        title="Displacement of Setup A by dither alone",
        setting=(
            "Dither (3.26) with R_d = 1 and 15 Hz alone on Setup A at rest, F_p = 12 N, F_n = 8 N, no hand, no compensation, "
            f"from {PHASES.size} resting places within a count of 5 um. Transmission: K_c = K = 1.2e6 N/m, beside it 2.4e6 N/m."
        ),
        claims=_claims(found),
        data=found,
        numbers={f"{name}.share": one["share"] for name, one in found.items()},
    )


def _claims(found: dict[str, dict[str, Any]]) -> tuple[Claim, ...]:
    stiff, soft, equal = found.values()
    swings = [one["swing"] for one in found.values()]

    def travel(one: dict[str, Any]) -> str:
        high, low = 1e6 * one["motor"].max(), 1e6 * one["motor"].min()
        return f"{high:+.1f}/{low:+.1f} um"

    def reach(one: dict[str, Any]) -> str:
        plus, minus = one["reach"].mean(axis=0)
        return f"{plus:.1f} and {minus:.1f} counts on average"

    return (
        Claim(
            what="Dither displaces Setup A by two counts in each direction.",
            thesis="two counts in each direction",
            ours=(
                f"{travel(soft)}: {reach(soft)}; two in both directions from {100 * soft['share']:.0f} % of resting places, "
                f"{soft['span'].min():.0f} to {soft['span'].max():.0f} counts from end to end"
            ),
            gate="two counts in each direction from at least half of the resting places",
            holds=soft["share"] >= 0.5,
            statement="3.6-counts",
            why_not=(
                "12 and 8 N stretch 1.2e6 N/m by 10 and 6.7 um, 2 and 1.3 counts; which edges lie inside depends on the "
                "resting place."
            ),
        ),
        Claim(
            what="The same with a transmission twice as stiff (K_c = 2K).",
            thesis="two counts in each direction",
            ours=f"{travel(stiff)}: {reach(stiff)}; two in both directions from {100 * stiff['share']:.0f} % of places",
            holds=None,
            why=(
                "The dither may not exceed the friction, and two counts each "
                "way are four edges, 15 um at least: K_c <= (F_p + F_n)/15 um = 1.33e6 N/m."
            ),
        ),
        Claim(
            what="With equal friction of 12 N in both directions and K_c = K.",
            ours=f"{travel(equal)}: {reach(equal)}; two in both directions from {100 * equal['share']:.0f} % of places",
            holds=None,
            why="A dither bounded by equal friction reaches equally far both ways.",
        ),
        Claim(
            what="The end-effector does not move: the dither stays below the friction.",
            thesis="maintains the system on the verge of the static friction state",
            ours=f"the load moves by at most {1e6 * max(one['moved'] for one in found.values()):.2f} um",
            gate="below one count",
            holds=max(one["moved"] / one["count"] for one in found.values()) < 1.0,
        ),
        Claim(
            what="The motor swings by the dither's amplitude over K_c, a little more below its resonance: the closed form",
            ours=", ".join(f"{100 * (s - 1):+.2f} %" for s in swings) + " off",
            gate="within 3 %",
            holds=max(abs(s - 1.0) for s in swings) <= 0.03,
        ),
    )


def draw(outcome: Outcome) -> Any:
    """Return the figure: dither above, displacement below; a column a transmission."""
    with house_style():
        figure, axes = own.sheet(2, len(outcome.data), width=760.0, height=340.0, sharex=True, sharey="row")
        for column, (label, found) in zip(axes.T, outcome.data.items(), strict=False):
            count, place = found["count"], found["shown"]
            column[0].plot(found["time"], found["dither"], color=LIGHT.ink, linewidth=1.2)
            column[1].plot(
                found["time"],
                found["motor"] / count,
                color=LIGHT.muted,
                linewidth=0.9,
                linestyle=own.DASHED,
                label="true",
            )
            column[1].step(
                found["time"],
                found["counts"][place],
                where="post",
                color=LIGHT.fitted,
                linewidth=1.3,
                label="encoder",
            )
            own.name(column[0], TITLES.get(label, label))
            own.name(column[1], "", "time [s]")
            column[1].set_yticks(np.arange(-3, 4))
        first = next(iter(outcome.data))
        own.name(axes[0, 0], TITLES.get(first, first), "", "dither [N]")
        own.name(axes[1, 0], "", "time [s]", "displacement [counts of 5 µm]")
        axes[0, 0].set_xlim(0.0, 0.5)
        own.key(axes[1, 0], "upper right", 2)
    return figure
