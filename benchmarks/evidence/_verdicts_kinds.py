"""Thirty kinds of planted trouble, and what no log can show by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from _independent import Record, multisine, sweep
from _verdicts_beside import along_plan, beside_another, monotone_ramp, plan_of, printed_ramps
from _verdicts_scenes import MOTIONS, Scene, steps

Plant = Callable[[Scene, float], list[Record]]


class Kind(NamedTuple):
    """One kind of trouble.

    Attributes:
        name: of it.
        size: that must be caught.
        unit: of the size, in words.
        plant: returns the logs with a size of it.
        motions: it is planted in.
        options: of `identify`.
        gravity: the joint carries some; None: a coin decides.
        rate: of sampling [Hz]; None: drawn from 200 to 1000 Hz.
        smaller: share of the size that is printed beside it, not required; 0: a kind without sizes.
        none: size at which nothing is planted; None: the scene itself is the clean twin.
        plan: returns the plan that is given along with the logs; None: none is.
        shows: in the residual; a log in which it does so with a noncentrality below 6 is drawn again.
        genuine: nothing is the matter, and no answer is no way out.
        says: words that count as a remark though the clean twin rightly has them too.
    """

    name: str
    size: float
    unit: str
    plant: Plant
    motions: tuple[str, ...] = MOTIONS
    options: dict = {}
    gravity: bool | None = None
    rate: float | None = None
    smaller: float = 0.5
    none: float | None = None
    plan: Callable[[Scene], Any] | None = None
    says: str = ""
    shows: bool = True
    genuine: bool = False

    def at(self, level: float) -> float:
        """Return a size: the required one at 0, the smaller one at 1, and so on by equal factors."""
        return self.size * self.smaller**level if level else self.size


def torques(change: Callable[[Record, float, np.random.Generator], np.ndarray]) -> Plant:
    """Return a plant that changes the torque of every log."""

    def plant(scene: Scene, size: float) -> list[Record]:
        rng = scene.rng()
        return [replace(made, torque=change(made, size, rng)) for made in scene.logs()]

    return plant


def half(made: Record, before: float, after: float) -> np.ndarray:
    """Return one factor for the first half of the samples and one for the rest, (n,)."""
    return np.where(np.arange(made.time.size) < made.time.size // 2, before, after)


def low_pass_torque(made: Record, size: float, rng: np.random.Generator) -> np.ndarray:
    """Return the torque through a causal filter of first order with a time constant [s]."""
    from scipy.signal import lfilter

    gain = 1.0 - np.exp(-1.0 / (size * made.logger.rate))
    return lfilter([gain], [1.0, gain - 1.0], made.torque, zi=[(1.0 - gain) * made.torque[0]])[0]


def spiked(made: Record, size: float, rng: np.random.Generator) -> np.ndarray:
    """Return the torque with a share of wild samples."""
    wild = rng.random(made.time.size) < size
    return made.torque + wild * rng.choice([-1.0, 1.0], made.time.size) * 20.0 * made.joint.coulomb


def pulled(made: Record, size: float, rng: np.random.Generator) -> np.ndarray:
    """Return the torque with the pull of another joint that moves in its own way."""
    other = multisine(made.time[-1] + 1.0, 1.0, rng, 0.11)
    pull = np.interp(made.time, np.arange(other.size) * 1e-4, np.gradient(np.gradient(other, 1e-4), 1e-4))
    return made.torque + size * made.joint.coulomb * pull / np.abs(pull).max()


def dead(made: Record, size: float, rng: np.random.Generator) -> np.ndarray:
    """Return the torque held at its last value for a share of the log."""
    n = made.time.size
    held = made.torque.copy()
    held[n // 2 : n // 2 + round(size * n)] = held[n // 2]
    return held


def stepped(made: Record, size: float, rng: np.random.Generator) -> np.ndarray:
    """Return the torque in steps."""
    step = size * made.joint.coulomb
    return step * np.round(made.torque / step)


def pushed(scene: Scene, size: float) -> list[Record]:
    push = np.zeros(max(r.size for r in scene.references))
    push[steps(4.0) : steps(7.0)] = size * scene.joint.coulomb
    return scene.logs(push=push)


def with_velocity(made: Record) -> Record:
    """Return the log with a velocity channel of its own, with little noise."""
    rng = np.random.default_rng(3)
    return replace(made, velocity=made.motion[1] + 0.002 * rng.standard_normal(made.time.size))


def fast_clock(scene: Scene, size: float) -> list[Record]:
    return [replace(with_velocity(made), time=(1.0 + size) * made.time) for made in scene.logs()]


def degrees(scene: Scene, size: float) -> list[Record]:
    return [replace(with_velocity(made), position=size * made.position) for made in scene.logs()]


def mirrored(scene: Scene, size: float) -> list[Record]:
    return [replace(with_velocity(made), position=size * made.position) for made in scene.logs()]


def milliseconds(scene: Scene, size: float) -> list[Record]:
    return [replace(made, time=size * made.time) for made in scene.logs()]


def lost(scene: Scene, size: float) -> list[Record]:
    logs = []
    for made in scene.logs():
        n, gap = made.time.size, round(size * made.logger.rate)
        kept = np.ones(n, dtype=bool)
        speed = np.abs(made.motion[1])
        for first in (n // 4, n // 2, 3 * n // 4):
            at = first + int(np.argmax(speed[first : first + n // 6] > 0.3 * speed.max()))  # while it moves
            kept[at : at + gap] = False
        part = made.rows(np.flatnonzero(kept))
        logs.append(replace(part, position=part.position, time=np.arange(part.time.size) / made.logger.rate))
    return logs


def torque_lost(scene: Scene, size: float) -> list[Record]:
    logs = []
    for made in scene.logs():
        at, by = made.time.size // 2, round(size * made.logger.rate)
        slipped = np.concatenate([made.torque[: at + by], made.torque[at:-by]])
        logs.append(replace(made, torque=slipped))
    return logs


def jumped(scene: Scene, size: float) -> list[Record]:
    return [replace(made, position=made.position + half(made, 0.0, size)) for made in scene.logs()]


def share_of_known(scene: Scene, known: float, gain: float) -> list[Record]:
    logs = []
    for made in scene.logs():
        a, b = made.joint.gravity
        pull = a * np.sin(made.motion[0]) + b * np.cos(made.motion[0])
        logs.append(replace(made, known=known * pull, torque=gain * made.torque))
    return logs


def starting(scene: Scene, size: float) -> list[Record]:
    """Return ten logs of one speed each with a start-up [s], and single samples that run backwards."""
    joint = replace(scene.joint, gravity=(0.0, 0.0))
    runs = []
    for k in range(10):
        speed = (1.0 if k % 2 == 0 else -1.0) * scene.top * (1 + k // 2) / 5.0
        t = np.arange(steps(3.0)) * 1e-4
        runs.append(speed * np.where(t < size, 0.5 * t * t / size, t - 0.5 * size))
    rng = scene.rng()
    rate = float(rng.choice((50.0, 100.0, 200.0, 500.0, 1000.0)))
    made = replace(scene, joint=joint, references=tuple(runs)).logged(rate=rate, counts=4096.0).logs()
    return [replace(m, position=m.position + 2e-3 * rng.standard_normal(m.time.size)) for m in made]


def one_way(scene: Scene, size: float) -> list[Record]:
    """Return a log that goes forwards at all speeds and creeps back."""
    speeds = scene.top * np.array([0.3, 0.6, 1.0, 0.8])
    v = np.concatenate([np.r_[np.full(steps(0.8), s), np.full(steps(2.0), -0.4 * s)] for s in speeds])
    v = np.convolve(v, np.ones(2000) / 2000, "same")
    return replace(scene, references=(np.cumsum(np.where(v < 0.0, size * v, v)) * 1e-4,)).logs()


def small_stroke(scene: Scene, size: float) -> list[Record]:
    """Return a log of a joint with an offset alone whose stroke is so small that gravity looks the same."""
    scene = scene.of(gravity=(0.0, 0.0), offset=3.0 * scene.joint.coulomb, ripple=(0.15, 40.0))
    return replace(scene, references=(sweep(0.3, 0.5 * size, 0.5 * scene.top, 14),)).logs()


def far_centers(scene: Scene, size: float) -> list[Record]:
    """Return logs about centers that span 3.2 rad, each moving by less than half a radian."""
    rng = scene.rng()
    parts = []
    for center in (-0.5 * size, 0.0, 0.5 * size):
        q = multisine(8.0, scene.top, rng, 0.6)
        parts.append(center + 0.22 * q / np.abs(q).max())
    return replace(scene, references=tuple(parts)).logs()


def searched_peak(scene: Scene, size: float) -> list[Record]:
    """Return a log with a Stribeck peak that the motion shows."""
    return scene.of(peak=size * scene.joint.coulomb, peak_speed=0.25 * scene.top).logs()


def unseen_peak(scene: Scene, size: float) -> list[Record]:
    """Return sweeps of a joint whose Stribeck peak lies below the slowest speed that was swept."""
    return scene.of(peak=size * scene.joint.coulomb, peak_speed=0.03 * scene.top).logs()


KINDS = (
    Kind(
        "sign flipped midway",
        1,
        "whole torque",
        torques(lambda m, x, r: m.torque * half(m, 1.0, -x)),
        smaller=0.0,
    ),
    Kind("gain changed midway", 0.12, "more gain", torques(lambda m, x, r: m.torque * half(m, 1.0, 1.0 + x))),
    Kind(
        "drift",
        1.0,
        "Coulomb over the log",
        torques(lambda m, x, r: m.torque + x * m.joint.coulomb * np.linspace(0, 1, m.time.size)),
    ),
    Kind("torque far too late", 0.05, "s", lambda s, x: s.logged(late=x).logs()),
    Kind("delay at its edge", 0.02, "s", lambda s, x: s.logged(late=x).logs()),
    Kind(
        "saturated",
        0.8,
        "of the largest",
        torques(lambda m, x, r: np.clip(m.torque, -x * np.abs(m.torque).max(), x * np.abs(m.torque).max())),
        smaller=1.1,
    ),
    Kind("torque held", 0.1, "of the log", torques(dead)),
    Kind("torque low-passed", 0.025, "s, causal, first order", torques(low_pass_torque)),
    Kind("torque in steps", 0.8, "Coulomb", torques(stepped)),
    Kind("wild samples", 0.01, "of 20 Coulomb", torques(spiked)),
    Kind(
        "cogging",
        0.3,
        "Coulomb, 31 a turn",
        torques(lambda m, x, r: m.torque + x * m.joint.coulomb * np.sin(31.0 * m.position)),
    ),
    Kind("torque sign", 1, "whole torque", torques(lambda m, x, r: -x * m.torque), smaller=0.0, shows=False),
    Kind("pull of another joint", 0.5, "Coulomb at most", torques(pulled)),
    Kind("pull of a joint in the log", 0.5, "Coulomb at most", beside_another, none=0.0),
    Kind("a hand pushes", 1.0, "Coulomb for 3 s", pushed),
    Kind("friction over position", 0.3, "of it, once a radian", lambda s, x: s.of(ripple=(x, 6.3)).logs()),
    Kind(
        "friction over load",
        0.1,
        "of gravity",
        lambda s, x: s.of(load_growth=x).logs(),
        gravity=True,
        says="of the load that the joint carries",
    ),
    Kind("friction warms up", -0.12, "of it", lambda s, x: s.of(warming=x).logs()),
    Kind(
        "peak below the slowest speed",
        0.4,
        "Coulomb",
        unseen_peak,
        ("sweep", "sweeps"),
        says="friction is unknown",
        shows=False,
    ),
    Kind("time in ms", 1000.0, "", milliseconds, smaller=0.0, shows=False),
    Kind("clock against velocity", 0.1, "faster", fast_clock, shows=False),
    Kind(
        "clock against the plan",
        1.1,
        "times as fast",
        along_plan,
        ("sines",),
        smaller=0.96,
        none=1.0,
        plan=plan_of,
        shows=False,
    ),
    Kind("degrees against velocity", 57.29578, "", degrees, smaller=0.0, shows=False),
    Kind("position mirrored", -1.0, "against velocity", mirrored, smaller=0.0, shows=False),
    Kind("samples lost, time goes on", 0.2, "s, three times", lost),
    Kind("torque slips by samples", 0.1, "s from the middle on", torque_lost),
    Kind("position jumps", 0.15, "rad", jumped, gravity=True),
    Kind(
        "coarse encoder",
        400.0,
        "counts at 200 Hz",
        lambda s, x: s.logged(counts=x).logs(),
        rate=200.0,
        smaller=3.0,
    ),
    Kind(
        "known torque too small",
        0.6,
        "of it",
        lambda s, x: share_of_known(s, x, 1.0),
        gravity=True,
        smaller=1.4,
        shows=False,
    ),
    Kind(
        "gain against a known mass",
        1.07,
        "",
        lambda s, x: share_of_known(s, 1.0, x),
        gravity=True,
        smaller=0.8,
    ),
    Kind("start-up in each run", 0.3, "s, samples run backwards", starting, ("speeds",)),
    Kind("fast one way, creeping back", 0.02, "of the speed", one_way, ("speeds",)),
)

RAMP: dict[str, Any] = {"options": {"method": "ramp"}, "none": 1.2, "smaller": 0.0, "genuine": True}

#: Cases of section 1 in which the answer must be right, or said not to be: nothing is the matter with the log.
RIGHT = (
    Kind("stroke too small for gravity", 0.18, "rad", small_stroke, ("sweep",), smaller=0.0),
    Kind("ramps printed with six decimals", 1.2, "break-away", printed_ramps, ("sines",), **RAMP),
    Kind("ramps that only rise", 1.2, "break-away", monotone_ramp, ("sines",), **RAMP),
    Kind(
        "Stribeck peak, law auto",
        0.5,
        "Coulomb",
        searched_peak,
        ("sines",),
        {"law": "auto"},
        smaller=0.0,
    ),
    Kind(
        "Stribeck peak, law named",
        0.5,
        "Coulomb",
        searched_peak,
        options={"law": "stribeck-gauss"},
        smaller=0.0,
    ),
)

#: What no log shows by itself, and sound logs that a search has called poor: they must be called good.
HIDDEN = (
    Kind("constant gain", 1.5, "", torques(lambda m, x, r: x * m.torque)),
    Kind("uniform clock", 1.1, "", lambda s, x: [replace(m, time=x * m.time) for m in s.logs()]),
    Kind(
        "both signs",
        -1.0,
        "",
        lambda s, x: [replace(m, position=x * m.position, torque=x * m.torque) for m in s.logs()],
    ),
    Kind(
        "far centers, small strokes",
        3.2,
        "rad",
        far_centers,
        ("sines",),
        {"law": "coulomb-viscous"},
        gravity=True,
        smaller=0.0,
    ),
    Kind("Stribeck peak that is shown", 0.5, "Coulomb", searched_peak, smaller=0.0),
)
