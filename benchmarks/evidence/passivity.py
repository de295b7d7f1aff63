"""Energy that a decaying friction compensator and the joint's own friction give to it: the bound of docs/theory/stability.md.

    E(t) <= R F^2/(2 K) + 2 alpha R F^2 t/K - (F_c - R F) (path slid)        if F/K >= F_c/K_c

The compensator is the package's own kernel, run tick by tick, its torque held for the tick that follows; the joint's friction is an
elastic Coulomb contact whose work is integrated here in closed form along eight straight pieces a tick. Each cell draws motions at
random (steps, walks, strokes between the two stretches, rests), then climbs from the worst of them. Ratio: largest energy by the
bound over all instants. Where R F <= F_c or F/K >= F_c/K_c is dropped, energy is divided by its first two terms, which is
what passivity would allow. Two ticks are searched, not claimed.

Units: F_c = K_c = 1, so that a motion of 1 is the friction's stretch.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import product

import numpy as np
from _common import Judge, first_seed, parser
from numba import njit

from backdrive.control.estimators.friction import FrictionEstimator, tick
from backdrive.laws import CoulombViscous, Decaying, Law

SAMPLING = (
    1e-3,
    1e-5,
)  # times between readings; the second leaves a leak little time between two strokes [s]
TICKS, PIECES = 200, 8  # of a motion, of a tick
MUTATIONS = 20_000  # of the search from the worst, in each cell
ROUNDING = 1e-9


@dataclass(frozen=True)
class Cell:
    """A compensator against a friction of 1 over 1.

    Attributes:
        law: `decaying`, `switching` (in motion its rate goes up to ten times alpha), or `unequal` (backwards 0.7 of forwards, of
            the friction as well).
        alpha: decay rate [1/s].
        share: R.
        stiffness: K/K_c.
        force: F/F_c.
        ticks: that pass from a reading until its torque ends.
        period: of the ticks [s].
    """

    law: str
    alpha: float
    share: float
    stiffness: float
    force: float
    ticks: int
    period: float

    @property
    def claimed(self) -> bool:
        """Whether the bound is claimed."""
        return self.share * self.force <= 1.0 and self.force >= self.stiffness and self.ticks == 1

    @property
    def backwards(self) -> float:
        """Friction backwards, by that forwards."""
        return 0.7 if self.law == "unequal" else 1.0

    def estimator(self) -> FrictionEstimator:
        """Return the package's friction that is added to the motor."""
        rate = CoulombViscous(coulomb_positive=self.force, coulomb_negative=self.force * self.backwards)
        law = Law(rate=rate, element=Decaying(stiffness=self.stiffness, decay_rate=self.alpha))
        if self.law != "switching":
            return FrictionEstimator(law=law)
        return FrictionEstimator(law=law, fast_decay=10.0 * self.alpha, switch_rate=50.0, threshold=5.0)


@njit
def friction_work(e, dp, back):
    """Return stretch, slid path and work of an elastic Coulomb contact (1 forwards, `back` backwards) along a straight piece."""
    trial = e + dp
    after = min(max(trial, -back), 1.0)
    slid = trial - after
    force = 1.0 if slid > 0.0 else -back
    return after, slid, 0.5 * (after * after - e * e) + force * slid


@njit
def ratio(c, p, start, force, share, stiffness, back, delay, T, whole, motion):
    """Return the largest energy by its bound along a motion, (n, PIECES) increments; `whole`: less what sliding takes."""
    p, x, s = p.copy(), start.copy(), np.zeros(2)
    held = np.zeros(3)
    e, energy, slid, leak, worst = 0.0, 0.0, 0.0, 0.0, 0.0
    first = share * force * force / (2.0 * stiffness)
    for k in range(motion.shape[0]):
        moved, taken = 0.0, 0.0
        for i in range(motion.shape[1]):
            e, path, work = friction_work(e, motion[k, i], back)
            moved += motion[k, i]
            taken += work
            slid += (1.0 - share * force) * (path if path > 0.0 else -back * path)
        energy += share * held[delay - 1] * moved - taken
        held[2], held[1] = held[1], held[0]
        held[0] = tick(c, 0, p, x, s, 0, moved, T, (0.0, 0.0), 20.0)
        alpha = p[int(c[2])] if c[2] > 0.0 else c[3]
        leak += 2.0 * alpha * share * force * force * T / stiffness
        gained = energy + slid if whole else energy
        worst = max(worst, gained / (first + leak))
    return worst


@njit
def draw(rng, motion, kind, size, yields):
    """Fill a motion at random: 0 walk, 1 strokes of random amplitude, 2 strokes about where contacts yield, 3 steps and
    rests, 4 even strokes of a few ticks.
    """
    n, m = motion.shape
    flat = motion.reshape(n * m)
    if kind == 0:
        for k in range(flat.size):
            flat[k] = size * rng.standard_normal() / m
    elif kind == 4:
        length = m * (1 + int(rng.random() * 6))
        amplitude = size * rng.random()
        for k in range(flat.size):
            flat[k] = (1.0 if k // length % 2 == 0 else -1.0) * amplitude / length
    elif kind == 3:
        k = 0
        while k < flat.size:
            length = 1 + int(rng.random() * 10 * m)
            rate = 0.0 if rng.random() < 0.3 else size * rng.standard_normal() / m
            flat[k : k + length] = rate
            k += length
    else:
        way, k = 1.0, 0
        while k < flat.size:
            amplitude = size * 10.0 * rng.random() if kind == 1 else 2.0 * yields * (0.5 + 0.7 * rng.random())
            length = 1 + int(rng.random() * 6 * m)
            flat[k : k + length] = way * amplitude / length
            k += length
            way = -way


@njit
def worst_of(c, p, start, numbers, whole, count, mutations, rng):
    """Return the worst ratio of random motions, and of those climbed to from it."""
    force, share, stiffness, back, delay, T = numbers
    delay = int(delay)
    motion, worst_motion = np.zeros((TICKS, PIECES)), np.zeros((TICKS, PIECES))
    worst = -1.0
    for i in range(count):
        draw(rng, motion, i % 5, 10.0 ** (-2.0 + 2.5 * rng.random()), max(1.0, force / stiffness))
        value = ratio(c, p, start, force, share, stiffness, back, delay, T, whole, motion)
        if value > worst:
            worst, worst_motion = value, motion.copy()
    climbed = worst
    for i in range(mutations):
        motion[:] = worst_motion
        begin = int(rng.random() * TICKS)
        end = min(TICKS, begin + 1 + int(rng.random() * 20))
        what = i % 4
        if what == 0:
            motion[begin:end] *= 1.0 + 0.3 * rng.standard_normal()
        elif what == 1:
            motion[begin:end] += 0.1 * rng.standard_normal() / PIECES
        elif what == 2:
            motion[begin:end] = -motion[begin:end]
        else:
            other = int(rng.random() * (TICKS - (end - begin)))
            motion[begin:end] = worst_motion[other : other + end - begin].copy()
        value = ratio(c, p, start, force, share, stiffness, back, delay, T, whole, motion)
        if value > climbed:
            climbed, worst_motion = value, motion.copy()
    return worst, climbed


def search(cell: Cell, count: int, mutations: int, seed: int) -> tuple[float, float]:
    """Return the worst ratio of random motions and of the directed search."""
    estimator = cell.estimator()
    numbers = (cell.force, cell.share, cell.stiffness, cell.backwards, float(cell.ticks), cell.period)
    row, law = estimator.row(), estimator.law
    whole = cell.share * cell.force <= 1.0 and cell.force >= cell.stiffness
    return worst_of(
        row, law.row(), law.state(), numbers, whole, count, mutations, np.random.default_rng(seed)
    )


def cells() -> list[Cell]:
    """Return what is claimed, what is dropped, and what is searched."""
    made = []
    for law, period in product(("decaying", "switching", "unequal"), SAMPLING):
        for alpha in (2.0, 20.0, 50.0) if law == "switching" else (0.0, 20.0, 500.0):
            kinds = [(share, K, 1.0, 1) for share in (0.5, 1.0) for K in (0.3, 1.0)]
            kinds += [(0.8, 1.0, 1.25, 1)]  # both conditions are met, one with equality
            kinds += [(0.8, 1.5, 1.0, 1)]  # yields earlier than the friction
            kinds += [(1.0, 1.0, 1.25, 1)]  # gives more than the friction
            kinds += [(0.8, K, 1.0, 2) for K in (0.3, 1.0)]
            made += [Cell(law, alpha, *kind, period) for kind in kinds]
    return made


def main() -> None:
    """Search every cell."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int, help="of the first cell; fresh without it")
    options.add_argument("--count", type=int, help="motions a cell")
    asked = options.parse_args()
    count = asked.count or (1500 if asked.short else 100_000)
    mutations = 1000 if asked.short else MUTATIONS
    seed = first_seed(asked.seed)
    judge, every, shown = Judge(), cells(), time.perf_counter()
    print(f"{len(every)} cells, {count} motions and {mutations} steps of a search in each")
    print("law         alpha     R   K/K_c  F/F_c  ticks  period   random   search")
    outcome = {}
    for i, cell in enumerate(every):
        outcome[cell] = search(cell, count, mutations, seed + i)
        random, climbed = outcome[cell]
        numbers = f"{cell.alpha:6g} {cell.share:5g} {cell.stiffness:7g} {cell.force:6g} {cell.ticks:6d} {cell.period:7g}"
        claim = "" if cell.claimed else "   not claimed"
        print(f"{cell.law:10s} {numbers} {random:8.3f} {climbed:8.3f}{claim}", flush=True)
    print(f"searched in {time.perf_counter() - shown:.0f} s")
    claimed = max(v[1] for c, v in outcome.items() if c.claimed)
    judge.at_most("largest energy by its bound where it is claimed", claimed, 1.0 + ROUNDING)
    for what, drops in (
        ("R F <= F_c", lambda c: c.share * c.force > 1.0),
        ("F/K >= F_c/K_c", lambda c: c.force < c.stiffness),
    ):
        by: dict[tuple[str, float], float] = {}
        for cell, value in outcome.items():
            if cell.ticks == 1 and drops(cell):
                key = cell.law, cell.alpha
                by[key] = max(by.get(key, 0.0), value[1])
        least, most = min(by.values()), max(by.values())
        judge.that(f"above 1 without {what}, by law and alpha: {least:.3g} to {most:.3g}", least > 1.0)
    for K in (0.3, 1.0):
        late = max(
            (v[1], c.law, c.alpha, c.period) for c, v in outcome.items() if c.ticks == 2 and c.stiffness == K
        )
        at = f"{late[1]}, {late[2]:g} 1/s, every {late[3]:g} s"
        print(f"  two ticks, K = {K:g} K_c, searched and not claimed: at most {late[0]:.3g} ({at})")
    judge.end()


if __name__ == "__main__":
    main()
