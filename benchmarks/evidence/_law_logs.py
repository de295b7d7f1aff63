"""Simulated logs that show a friction law: the motions, the truth that is put in, and what a robot would have recorded.

A motion is a velocity on a grid of 0.1 ms, smoothed to 25 Hz. The torque is that of the law along the true positions; it is
recorded 1.7 ms later than the motion, with white noise; the position is recorded in encoder steps. `Case.read` gives what a
fit sees, through the same door as a log of a real robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from backdrive.engine import rollout
from backdrive.identification.dynamic.stretch import Stretch, stretch
from backdrive.identification.signals import prepare
from backdrive.laws import Law, Makkar
from backdrive.laws.examples import example
from backdrive.logs.filters import low_pass
from backdrive.logs.log import Joint, Log

FINE = 1e-4  # s: grid of the motion
DT = 1e-3  # s: sampling time of the log
DELAY = 1.7e-3  # s: by which torque is recorded later than motion
INERTIA = 0.3  # kg.m^2
SMOOTH = 25.0  # Hz: of the motion
CUTOFF = 60.0  # Hz: of the low pass that the fit's motion gets


def sines(*pairs: tuple[float, float]) -> list[np.ndarray]:
    """Return a period of sinusoidal velocity for each (top speed [rad/s], period [s])."""
    return [v * np.sin(2 * np.pi * np.arange(0, T, FINE) / T) for v, T in pairs]


def loops(*triples: tuple[float, float, int]) -> list[np.ndarray]:
    """Return triangles for each (stroke [rad], speed [rad/s], cycles)."""
    made = []
    for stroke, speed, cycles in triples:
        t = np.arange(0, cycles * 2 * stroke / speed, FINE) * speed / (2 * stroke)
        made.append(speed * np.where(t % 1.0 < 0.5, 1.0, -1.0))
    return made


def wobble(mean: float, depth: float, frequency: float, seconds: float) -> list[np.ndarray]:
    """Return a velocity that varies about a mean [rad/s] by a share of it, without reversing."""
    t = np.arange(0, seconds, FINE)
    return [mean * (1 + depth * np.sin(2 * np.pi * frequency * t))]


def shaking(amplitude: float, frequency: float, seconds: float) -> list[np.ndarray]:
    """Return a vibration of that amplitude [rad] that swells and fades."""
    t = np.arange(0, seconds, FINE)
    w = 2 * np.pi * frequency
    return [amplitude * w * np.cos(w * t) * np.sin(np.pi * t / seconds)]


def rest(seconds: float) -> list[np.ndarray]:
    """Return a dwell."""
    return [np.zeros(round(seconds / FINE))]


SWEEP = sines((0.02, 1.5), (0.05, 1.0), (0.1, 0.8), (0.2, 0.7), (0.5, 0.8), (1.0, 1.0))
CREEP = sines((0.02, 1.5), (0.03, 2.0), (0.1, 1.0), (0.2, 0.7), (1.0, 1.0))
SHORT = sines((0.03, 0.8), (0.1, 0.6), (0.4, 0.6))
#: Sliding, slow reversals, and loops that shrink within presliding.
SLOW = [
    *sines((0.15, 0.6), (0.6, 0.8)),
    *loops((4e-3, 0.02, 1), (2e-3, 6e-3, 1), (1e-3, 4e-3, 1), (7e-4, 3e-3, 1), (5e-4, 3e-3, 1)),
    *loops((3.5e-4, 3e-3, 2), (2e-4, 3e-3, 2)),
]
#: Dwells, quick changes of speed in sliding, and vibration within presliding.
QUICK = [
    *rest(0.3),
    *wobble(0.06, 0.9, 6.0, 0.8),
    *wobble(-0.04, 0.9, 11.0, 0.7),
    *rest(0.1),
    *shaking(2.5e-4, 18.0, 0.9),
]
PATH_ONLY = (
    "dahl",
    "bliman-sorine",
    "hayward-armstrong",
    "maxwell-slip",
    "smoothed-maxwell-slip",
)  # speed does not matter


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One law with its truth and the logs that show it.

    Attributes:
        name: of the rate law or element.
        law: the truth.
        motions: velocity of each log on the fine grid [rad/s].
        loads: motor-side and external torque of each log as two constants and two amplitudes [N.m].
        temperatures: of each log [degC].
        count: encoder step [rad].
        noise: of the torque, standard deviation [N.m].
        fine: simulation steps a sample.
    """

    name: str
    law: Law
    motions: Sequence[np.ndarray]
    loads: Sequence[tuple[float, float, float, float]] = ()
    temperatures: Sequence[float] = ()
    count: float = 1e-6
    noise: float = 0.15
    fine: int = 1
    kept: dict = field(default_factory=dict)

    def exact(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray | None]]:
        """Return true position at the samples, torque as it would be recorded without noise, and the load, a log each."""
        if "exact" not in self.kept:
            self.kept["exact"] = [self._one(i) for i in range(len(self.motions))]
        return self.kept["exact"]

    def _one(self, i: int):
        v = low_pass(np.concatenate([np.zeros(500), self.motions[i], np.zeros(500)]), SMOOTH, 1 / FINE)
        q = np.cumsum(v) * FINE
        a = np.gradient(v, FINE)
        every, late = round(DT / FINE), round(DELAY / FINE)
        n = (len(q) - late) // every
        at = every * np.arange(n)
        step = every // self.fine
        ticks = np.maximum(step * np.arange(self.fine * (n - 1) + 1) - late, 0)
        load = temperature = loads = None
        if self.loads:
            loads = self._load(i, np.arange(len(q)) * FINE)
            load = loads[ticks]
        if self.temperatures:
            temperature = self.temperatures[i]
        torque = rollout(
            self.law, q=q[ticks], dt=DT / self.fine, load=load, temperature=temperature, workers=1
        )
        torque = torque[:: self.fine] + INERTIA * a[np.maximum(at - late, 0)]
        return q[at], torque, None if loads is None else loads[at]

    def _load(self, i: int, t: np.ndarray) -> np.ndarray:
        m, e, dm, de = self.loads[i]
        return np.stack([m + dm * np.sin(2 * np.pi * 0.9 * t), e + de * np.cos(2 * np.pi * 0.7 * t)], axis=1)

    def read(self, seed: int | None) -> list[Stretch]:
        """Return what a fit sees; without a seed the exact positions and torque."""
        rng = np.random.default_rng(seed)
        found = []
        for i, (q, torque, load) in enumerate(self.exact()):
            if seed is not None:
                q = (np.round(q / self.count + rng.uniform()) - 0.5) * self.count
                torque = torque + self.noise * rng.standard_normal(len(torque))
            log = Log(
                time=np.arange(len(q)) * DT,
                joints=(Joint(name="j", encoder_counts=1.0 / self.count),),
                position=q[:, None],
                torque=torque[:, None],
            )
            (signals,) = prepare(log, 0, cutoff=CUTOFF)
            warmth = np.array([self.temperatures[i]]) if self.temperatures else None
            found.append(stretch(signals, load=load, temperature=warmth))
        return found

    def truth(self) -> dict[str, float]:
        """Return what a fit seeks, by name; elements side by side are sorted, the stiffest first."""
        values: dict[str, float] = {"inertia": INERTIA, "delay": DELAY}
        given = {**self.law.rate.values(), **self.law.element.values()}
        if "share" in given:
            order = np.argsort(given["stiffness"])[::-1]
            k, w = np.array(given.pop("stiffness"))[order], np.array(given.pop("share"))[order]
            values |= {f"stiffness[{i}]": float(x) for i, x in enumerate(k)}
            values |= {f"share[{i}]": float(np.log(x / w[-1])) for i, x in enumerate(w[:-1])}
        for name in ("positive", "negative"):
            values |= {f"{name}[{i}]": x for i, x in enumerate(given.pop(name, ()))}
        return values | given


def case(name: str, **changes) -> Case:
    """Return the case of a rate law by itself, or of an element carried by Gauss' Stribeck curve."""
    law = example(name)
    settings: dict = {"name": name, "law": law, "motions": [np.concatenate(SWEEP)]}
    if name == "dead-zone":
        settings["motions"] = [np.concatenate(CREEP)]
    elif law.element.states():
        settings["motions"] = [np.concatenate(SLOW if name in PATH_ONLY else SLOW + QUICK)]
    if name == "makkar":  # the example's rise and steepness are equal, which no motion can tell apart
        settings["law"] = Law(
            rate=Makkar(stribeck=2.0, rise=150.0, fall=15.0, coulomb=4.0, steepness=50.0, viscous=1.0)
        )
    if name == "smoothed-maxwell-slip":  # the example's slip sets in too sharply to tell how sharply
        settings["law"] = Law(rate=law.rate, element=replace(law.element, sharpness=30.0, margin=0.9))
    if "load" in law.rate.NEEDS:
        settings["motions"] = [np.concatenate(SHORT)] * 6
        settings["loads"] = [
            (0.0, 0.0, 0.0, 0.0),
            (20.0, 0.0, 8.0, 0.0),
            (0.0, 20.0, 0.0, 8.0),
            (20.0, -8.0, 6.0, 4.0),
            (8.0, -20.0, 6.0, 5.0),
            (12.0, 15.0, 6.0, 5.0),
        ]
    if "temperature" in law.rate.NEEDS:
        settings["temperatures"] = [15.0, 25.0, 40.0, 80.0, 5.0, 60.0]
    return Case(**(settings | changes))
