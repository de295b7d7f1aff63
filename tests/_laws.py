"""Random laws on random motions, many side by side, for the contract tests of laws/.

A law is drawn from a point of the unit cube, so that hypothesis can shrink it (towards lower bounds and few elements) and a
seeded generator can draw a great many. A `Batch` holds laws and motions, one of each a lane; a property is a function of a
batch and a random generator.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

from backdrive._jit import jit
from backdrive.laws import ELEMENTS, RATES, Law, Rigid, kernels
from backdrive.laws.base import Parameter, Rows
from backdrive.logs.log import Joint
from backdrive.model import FrictionModel, JointFriction, Validity
from backdrive.model.file import decode, encode

JIT = hasattr(kernels.step, "py_func")
MOST = 4  # knots or elements side by side, of a drawn law
CARRIED = [name for name, rate in RATES.items() if not rate.SMOOTH]  # by presliding elements
EXAMPLES = 20 if JIT else 3  # laws drawn by hypothesis, for one property of one name
LANES = 50 if JIT else 3  # motions of each: 10^3 cases in all
LONG = 100 if JIT else 1  # batches, with -m long
WIDTH, EACH = (
    (1000, 10) if JIT else (4, 2)
)  # lanes of a batch, and of them motions of the same law: 10^5 cases in all
TICKS = 40 if JIT else 16  # of a motion
SPEEDS = np.concatenate([[0.0], np.geomspace(1e-9, 1e6, 61 if JIT else 16)])

#: Smallest and largest magnitude that is drawn, by unit; other units have their bounds alone.
RANGES = {
    "force": (1e-2, 1e2),
    "force/length": (1e2, 1e6),
    "force.s/length": (1e-2, 1e2),
    "force.(s/length)^n": (1e-2, 1e2),
    "force/s": (1.0, 1e5),
    "force/degC": (1e-4, 1e-1),
    "length": (1e-5, 1e-1),
    "length/s": (1e-3, 1e1),
    "length/s/degC": (1e-5, 1e-2),
    "s/length": (1.0, 1e3),
    "s": (1e-4, 1e-1),
    "1/s": (1e-1, 1e3),
    "1/force": (1e-5, 1e-1),
    "degC": (5.0, 100.0),
}


# ----------------------------------------------------------------------------------------------- drawing


def number(parameter: Parameter, u: float) -> float:
    """Return a value for u in [0, 1]: 0, where that is a bound, for the first tenth, negative below a fifth."""
    if parameter.unit not in RANGES:
        low, high = parameter.lower, min(parameter.upper, max(10.0, 100.0 * parameter.lower))
        return low * (high / low) ** u if low > 0.0 and high / low >= 100.0 else low + u * (high - low)
    low, high = RANGES[parameter.unit]
    if parameter.lower < 0.0 and u < 0.2:
        return -low * (high / low) ** (5.0 * u)
    if parameter.lower == 0.0 and u < 0.1:
        return 0.0
    low, high = max(low, parameter.lower), min(high, parameter.upper)
    return min(max(low * (high / low) ** u, low), high)


def size(cls: type[Rows]) -> int:
    """Return the dimension of the cube that `drawn` wants."""
    return 1 + sum(MOST if p.many else 1 for p in cls.PARAMETERS.values())


def drawn(cls: type[Rows], u: Sequence[float]) -> Any:
    """Return a rate law or an element for a point of the unit cube."""
    n, at, values = 1 + min(int(u[0] * MOST), MOST - 1), 1, {}
    for name, parameter in cls.PARAMETERS.items():
        if parameter.many:
            values[name] = [number(parameter, x) for x in u[at : at + n]]
            at += MOST
        else:
            values[name] = number(parameter, u[at])
            at += 1
    if "share" in values:
        share = np.array(values["share"]) + 0.02
        values["share"] = share / share.sum()
    if cls.NAME == "polyline":
        values = sections(**values)
    return cls(**values)


def sections(velocity, positive, negative) -> dict:
    """Return knots that are apart, and torques within a factor of two that rise in the last section."""
    curves = {}
    for side, torque in (("positive", np.array(positive)), ("negative", np.array(negative))):
        torque = (abs(torque[0]) + 0.01) * (1.0 + np.log10(np.abs(torque) + 1.0) / 2.0)
        torque[-1] = max(torque[-2:])
        curves[side] = torque
    return {"velocity": np.cumsum(np.array(velocity) + 0.05), **curves}


@dataclass
class Condition:
    """What is drawn beside a law: load, temperature, sampling time and the size of the motion's steps."""

    load: tuple[float, float]
    temperature: float
    dt: float
    magnitude: float

    @staticmethod
    def drawn(u: Sequence[float]) -> Condition:
        return Condition(
            (40.0 * (u[0] - 0.5), 40.0 * (u[1] - 0.5)),
            30.0 + 50.0 * u[2],
            10.0 ** (-5.0 + 3.0 * u[3]),
            10.0 ** (-3.0 + 5.0 * u[4]),
        )


def motions(random: np.random.Generator, lanes: int, n: int) -> np.ndarray:
    """Return increments of order 1, (lanes, n): noise, strokes, steps or bursts, with pauses."""
    white = random.standard_normal((lanes, n))
    phase = 2.0 * np.pi * random.random((lanes, 1)) * np.arange(n) / 12.0 + 6.3 * random.random((lanes, 1))
    strokes = np.sin(phase) * np.exp(random.normal(0.0, 2.0, (lanes, 1)))
    steps = np.repeat(random.standard_normal((lanes, (n + 6) // 7)), 7, axis=1)[:, :n]
    bursts = white * np.exp(3.0 * random.standard_normal((lanes, n)))
    out = np.choose(random.integers(0, 4, (lanes, 1)), [white, strokes, steps, bursts])
    return np.where(random.random((lanes, n)) < 0.05, 0.0, out)


# ----------------------------------------------------------------------------------------------- lanes


@jit
def _run(rates, elements, P, X, DP, DT, load, temp, out):
    for i in range(DP.shape[0]):
        pair = (load[i, 0], load[i, 1])
        for k in range(DP.shape[1]):
            out[i, k] = kernels.step(rates[i], elements[i], P[i], X[i], DP[i, k], DT[i], pair, temp[i])


@jit
def _limits(rates, P, V, load, temp, out):
    for i in range(V.shape[0]):
        pair = (load[i, 0], load[i, 1])
        for k in range(V.shape[1]):
            out[0, i, k], out[1, i, k], out[2, i, k] = kernels.limits(rates[i], P[i], V[i, k], pair, temp[i])


class Batch:
    """Laws side by side, each with its motion, sampling time, load and temperature.

    Attributes:
        laws: one a lane, (B,).
        dp: increments, (B, n).
        dt: sampling times, (B,).
        load: motor-side and external torque, (B, 2).
        temperature: (B,).
        states: columns of the elements' state.
        bound: largest Coulomb torque over all speeds, (B,).
        weakest: smallest one, (B,).
        falls: whether the viscous part falls with speed anywhere, (B,).
        stretch: a distance within which the element forgets, in multiples of e, (B,).
    """

    def __init__(self, laws: Sequence[Law], dp, dt, load, temperature):
        self.laws, self.dp, self.dt = list(laws), np.asarray(dp), np.asarray(dt, dtype=np.float64)
        self.load, self.temperature = (
            np.asarray(load, dtype=np.float64),
            np.asarray(temperature, dtype=np.float64),
        )
        self.unique = {id(law): law for law in self.laws}
        self.advice = {}
        rows = {key: law.row() for key, law in self.unique.items()}
        self.rows = np.zeros((len(self.laws), max(row.size for row in rows.values())))
        for i, law in enumerate(self.laws):
            row = rows[id(law)]
            self.rows[i, : row.size] = row
        self.rates = np.array([law.rate.KIND for law in self.laws])
        self.elements = np.array([law.element.KIND for law in self.laws])
        self.states = max(max(law.element.states(), 1) for law in self.unique.values())
        grid = np.tile(np.concatenate([-SPEEDS, SPEEDS]), (len(self.laws), 1))
        lo, hi, viscous = self.limits(grid)
        bounds = np.where(grid > 0.0, hi, -lo)
        self.bound, self.weakest = bounds.max(axis=1), bounds.min(axis=1)
        self.falls = (viscous * np.sign(grid) < 0.0).any(axis=1)
        self.stretch = np.maximum(
            self.value("distance", 1e-9), self.bound / self.value("stiffness", np.inf, np.min)
        )

    def value(self, name: str, default: float = 0.0, of: Callable = float) -> np.ndarray:
        """Return a parameter of the elements, (B,)."""
        known = {key: float(of(getattr(law.element, name, default))) for key, law in self.unique.items()}
        return np.array([known[id(law)] for law in self.laws])

    def fresh(self) -> np.ndarray:
        return np.zeros((len(self.laws), 2 * self.states))

    def run(self, dp=None, *, load=None, temperature=None):
        """Return the torque along the motions from rest, (B, n), and the states at their ends."""
        dp = self.dp if dp is None else np.ascontiguousarray(dp)
        load = self.load if load is None else load
        temperature = self.temperature if temperature is None else temperature
        state, out = self.fresh(), np.empty(dp.shape)
        with np.errstate(all="ignore"):
            _run(self.rates, self.elements, self.rows, state, dp, self.dt, load, temperature, out)
        return out, state

    def limits(self, velocity, *, load=None, temperature=None) -> np.ndarray:
        """Return lo, hi and viscous of the rate laws at velocities (B, m); (3, B, m)."""
        load = self.load if load is None else load
        temperature = self.temperature if temperature is None else temperature
        out = np.empty((3, *velocity.shape))
        with np.errstate(all="ignore"):
            _limits(self.rates, self.rows, np.ascontiguousarray(velocity), load, temperature, out)
        return out

    def steady(self, velocity, **other) -> np.ndarray:
        """Return the torque of the rate laws at velocities (B, m)."""
        lo, hi, viscous = self.limits(velocity, **other)
        return np.where(velocity > 0.0, hi, np.where(velocity < 0.0, lo, 0.0)) + viscous

    def viscous(self) -> np.ndarray:
        """Return the viscous part along the motions, (B, n)."""
        return self.limits(self.dp / self.dt[:, None])[2]

    def taken(self, lanes) -> Batch | None:
        """Return the batch of some lanes, by a mask; None where there are none."""
        at = np.flatnonzero(lanes)
        if at.size == 0:
            return None
        return Batch(
            [self.laws[i] for i in at], self.dp[at], self.dt[at], self.load[at], self.temperature[at]
        )

    def advised(self) -> np.ndarray:
        """Return whether the element has advice on the rate law, (B,)."""
        found = []
        for law, load, temperature in zip(
            self.laws, self.load.tolist(), self.temperature.tolist(), strict=True
        ):
            key = (id(law), *load, temperature)
            if key not in self.advice:
                with np.errstate(all="ignore"):
                    self.advice[key] = law.element.advice(law.rate, tuple(load), temperature) != ""
            found.append(self.advice[key])
        return np.array(found)

    def step(self, i, state: np.ndarray, dp: float) -> float:
        """Return the torque of one tick of lane i from a state (2 S,), which is advanced."""
        law = self.laws[i]
        with np.errstate(all="ignore"):
            return kernels.step(
                law.rate.KIND, law.element.KIND, self.rows[i], state, dp, self.dt[i], tuple(self.load[i]),
                self.temperature[i],
            )  # fmt: skip

    def solve(self, i, state: np.ndarray, v_free: float, soft: float) -> float:
        """Return the velocity of a mass in lane i; `soft` is dt/m."""
        law = self.laws[i]
        with np.errstate(all="ignore"):
            return kernels.solve(
                law.rate.KIND, law.element.KIND, self.rows[i], state, v_free, self.dt[i], soft,
                tuple(self.load[i]), self.temperature[i],
            )  # fmt: skip


def follow(law: Law, dp, dt: float, *, load=(0.0, 0.0), temperature: float = 20.0, state: bool = False):
    """Return the torque of one law along a motion from rest, (n,), or the element's state at its end, (S,)."""
    b = Batch([law], np.atleast_2d(np.asarray(dp, dtype=np.float64)), [dt], [load], [temperature])
    torque, states = b.run()
    return states[0, : b.states] if state else torque[0]


def batch(laws: Sequence[Law], conditions: Sequence[Condition], random: np.random.Generator) -> Batch:
    """Return laws under conditions on random motions whose size goes with the element's presliding."""
    made = Batch(
        laws,
        motions(random, len(laws), TICKS),
        [c.dt for c in conditions],
        [c.load for c in conditions],
        [c.temperature for c in conditions],
    )
    scale = np.array([c.magnitude for c in conditions]) * np.maximum(made.stretch, 1e-9)
    made.dp *= np.minimum(scale, 1e3 * made.dt)[:, None]
    return made


# ----------------------------------------------------------------------------------------------- the two runs


def law_of(name: str, rate: str, u: Sequence[float]) -> Law:
    """Return the rate law `name` by itself, or the element `name` on the rate law `rate`."""
    if name in RATES:
        return Law(rate=drawn(RATES[name], u), element=Rigid())
    at = size(RATES[rate])
    return Law(rate=drawn(RATES[rate], u[:at]), element=drawn(ELEMENTS[name], u[at:]))


def cube(name: str, rate: str) -> int:
    return size(RATES[name]) if name in RATES else size(RATES[rate]) + size(ELEMENTS[name])


@st.composite
def batches(draw, name: str):
    """Return a strategy for a batch of one law on many motions, and the generator that made them.

    The point of the cube is drawn as bytes, which hypothesis makes and shrinks a good deal faster than so many numbers.
    """
    rate = name if name in RATES else draw(st.sampled_from(CARRIED))
    n = cube(name, rate)
    *u, seed = [byte / 255.0 for byte in draw(st.binary(min_size=n + 6, max_size=n + 6))]
    law, condition = law_of(name, rate, u[:n]), Condition.drawn(u[n:])
    random = np.random.default_rng(int(255.0 * seed))
    return batch([law] * LANES, [condition] * LANES, random), random


def many(name: str):
    """Yield batches of the long run and their generators."""
    for seed in range(LONG):
        random = np.random.default_rng(seed)
        laws, conditions = [], []
        for _ in range(WIDTH // EACH):
            rate = name if name in RATES else CARRIED[random.integers(len(CARRIED))]
            laws += [law_of(name, rate, random.random(cube(name, rate)).tolist())] * EACH
            shared = random.random(3).tolist()  # load and temperature
            conditions += [Condition.drawn(shared + u) for u in random.random((EACH, 2)).tolist()]
        yield batch(laws, conditions, random), random


def survives_the_model_file(laws):
    """What is written is what is read, every parameter and the kernels' row to the last bit."""
    joints = tuple(
        JointFriction(joint=Joint(name=f"j{i}"), law=law, validity=Validity(velocity=(-1.0, 1.0)))
        for i, law in enumerate(laws)
    )
    read = decode(encode(FrictionModel(joints=joints)))
    for law, joint in zip(laws, read.joints, strict=True):
        assert joint.law == law
        assert joint.law.row().tobytes() == law.row().tobytes()
