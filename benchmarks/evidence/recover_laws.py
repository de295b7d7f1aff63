"""Every friction law from simulated logs: are the parameters found, and are their intervals honest?

The truth of each rate law and of each presliding element, which Gauss' Stribeck curve carries, is put into logs of a motion that
shows it (`_law_logs`): 1 kHz, position in encoder steps, white noise on the torque, torque 1.7 ms later than the motion. A fit
that knows neither truth nor delay is run on each of many noises. The search starts from what it reads off the data.

A parameter counts as shown where its Cramer-Rao bound is below 10 % of its value (for a share: of its ratio to the last one's).
The bound is that of the law, inertia and delay together, from derivatives at the truth along the true motion under the true noise.
Required: such a parameter lies in its 95 % interval in 85 of 100 seeds; 92 to 98 % over all of them; 95 of 100
intervals are at most 2.5 times the bound's; and every other parameter is named, in words, as one that the motion does not show.

Three things to know:

- The truth runs at the sampling time of the log, along positions between whose samples it moves at a constant velocity. A truth
  that runs five times finer differs by half a sample between velocity and state, which moves damping and lag by some standard
  errors; the last column says by how many at most, and of which parameter.
- The torque of a dead zone jumps at its threshold, so that there is no bound by a derivative. The model's edge is as soft as the
  speed is uncertain, and the bound of the threshold has the encoder's steps in it.
- A polyline's knots are given; a fit refuses to choose them.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one thread a process, before numpy asks
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import multiprocessing
import time
import zlib
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache

import numpy as np
from _common import Judge, parser
from _law_logs import Case, case

from backdrive.identification.dynamic.law_fit import fit_law
from backdrive.identification.dynamic.search import Search
from backdrive.identification.dynamic.starts import scales
from backdrive.identification.dynamic.torque import TorqueProblem
from backdrive.identification.dynamic.uncertainty import inverse
from backdrive.identification.dynamic.unknowns import LawShape
from backdrive.laws import ELEMENTS, RATES

SHOWN = 0.10  # bound by value below which a parameter counts as shown
HELD = 0.85  # of the seeds in which it must lie in its interval
POOLED = (0.92, 0.98)  # of all seeds and parameters
WIDEST = 2.5  # interval by that of the bound
NAMES = (*RATES, *(n for n in ELEMENTS if n != "none"))
#: Starts that are screened, and how many of them descend, for laws that one guess may lead astray.
STARTS = {"makkar": (64, 2), "load-temperature": (96, 5), "decaying": (16, 2), "leuven": (32, 3)}
FINER = 5  # steps a sample of the finer truth

SHORT = ("coulomb", "coulomb-viscous", "dahl")  # and their first noises

known = lru_cache(maxsize=None)(case)


def shape_of(it: Case) -> LawShape:
    """Return what is sought: with as many elements as there are, and a curve at its knots."""
    law = it.law
    if law.name == "polyline":
        knots = law.rate.values()["velocity"]
        return LawShape.from_name("polyline", count=len(knots), fixed={"velocity": knots})
    return LawShape.from_name(law.name, count=len(law.element.values().get("share", ())) or 4)


def bound(it: Case) -> tuple[list, dict[str, float], np.ndarray]:
    """Return the law's unknowns, the bound's standard error by name, and the search coordinates that a finer truth moves by."""
    stretches = it.read(None)
    sizes = scales(stretches, ("inertia",), "rad", 1.0 / it.count)
    problem = TorqueProblem(shape_of(it), stretches, sizes, terms=("inertia",), delay=True)
    search = Search(problem.residuals, problem.lower, problem.upper)
    point = problem.point(it.truth())
    at = problem.residuals(point[None])
    J = search.jacobian(point, at[0])
    size = np.linalg.norm(J, axis=0)
    acts = size * 1e4 > it.noise
    J = J[:, acts] / size[acts]
    bread = inverse(J.T @ J)
    error = np.full(size.size, np.inf)
    variance = it.noise**2 * np.diag(bread)
    names = np.array(problem.names)[acts]
    if "threshold" in problem.names:
        steps = np.mean((problem.encoder(point) @ J @ bread) ** 2, axis=0)
        variance = variance + np.where(names == "threshold", steps, 0.0)
    error[acts] = np.sqrt(variance) / size[acts]
    finer = TorqueProblem(
        problem.shape, case(it.name, fine=FINER).read(None), sizes, terms=("inertia",), delay=True
    )
    moves = np.zeros(size.size)
    moves[acts] = -bread @ (J.T @ (finer.residuals(point[None])[0] - at[0])) / np.sqrt(variance)
    of_law = [u for u in problem.unknowns if u.name not in ("inertia", "delay")]
    bounds = {u.name: float(error[i]) for i, u in enumerate(problem.unknowns)}
    return of_law, bounds, moves


def fits(name: str, seeds: range) -> tuple[float, list[tuple[dict[str, float], dict[str, float], set[str]]]]:
    """Return the processor time of fits to noises of these seeds [s], and values, errors and what was not seen of each."""
    it = known(name)
    begun, found = time.process_time(), []
    for seed in seeds:
        one = fit_law(
            shape_of(it),
            it.read(1000 * zlib.crc32(name.encode()) + seed),
            counts=1.0 / it.count,
            terms=("inertia",),
            begin=STARTS.get(name, (1, 1))[0],
            descend=STARTS.get(name, (1, 1))[1],
            seed=seed,
        )
        ends = {k: one.interval(k) for k in one.values}
        said = {k for k, sentence in one.unseen.items() if "not identifiable from this motion" in sentence}
        found.append((dict(one.values), ends, said))
    return time.process_time() - begun, found


def pinned(cores) -> None:
    """Keep this process on one core, so that compiled code does not spread."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {cores.get()})


def judged(judge: Judge, name: str, found: list, spent: float) -> tuple[int, int]:
    """Print a law's table and return in how many of how many cases a shown parameter lay in its interval."""
    it = known(name)
    unknowns, bounds, moves = bound(it)
    truth, n = it.truth(), len(found)
    hits, cases = 0, 0
    worst = int(np.argmax(np.abs(moves[: len(unknowns)])))
    print(
        f"{name}: {len(it.exact())} logs, {sum(len(q) for q, _, _ in it.exact()) * 1e-3:.1f} s, "
        f"noise {it.noise:g} N.m, encoder {it.count:.2g} rad, {spent / n:.2f} s a fit; "
        f"a {FINER} times finer truth: {unknowns[worst].name} {moves[worst]:+.1f} standard errors"
    )
    for u in unknowns:
        value, error = truth[u.name], bounds[u.name]
        share = error if u.ratio or u.log else error * u.scale / abs(value)
        inside = sum(ends[u.name][0] <= value <= ends[u.name][1] for _, ends, _ in found)
        named = sum(u.name in said for _, _, said in found)
        if share >= SHOWN:
            print(
                f"    {u.name:30s} {value:10.4g}  bound {100 * share:8.3g} %  named as not shown {named}/{n}"
            )
            judge.that(f"{name}: '{u.name}' is not shown, and {named} of {n} fits say so", named == n)
            continue
        widths = [np.ptp(u.inward(np.array(ends[u.name]))) / (2 * 1.96 * error) for _, ends, _ in found]
        off = [float(u.inward(v[u.name]) - u.inward(value)) / error for v, _, _ in found]
        hits, cases = hits + inside, cases + n
        print(
            f"    {u.name:30s} {value:10.4g}  bound {100 * share:8.3g} %  inside {inside}/{n}  mean error {np.mean(off):+.2f}  "
            f"scatter {np.std(off):.2f}  interval {np.median(widths):.2f}, to {max(widths):.2f} bounds"
        )
        wide = float(np.quantile(widths, 0.95))
        if inside < HELD * n or wide > WIDEST:
            judge.that(
                f"{name}: '{u.name}' inside its interval in {inside} of {n}, 95 % of them within {wide:.2f} bounds",
                False,
            )
    return hits, cases


def main() -> None:
    """Fit every law to every noise and judge the intervals."""
    made = parser("Recover every friction law from simulated logs.")
    made.add_argument("names", nargs="*", help="rate laws and elements; all where none is given")
    made.add_argument("--seeds", type=int, help="noises of each law; 100, or 10 where shortened")
    asked = made.parse_args()
    names = asked.names or list(SHORT if asked.short else NAMES)
    asked.seeds = asked.seeds or (10 if asked.short else 100)
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [0, 1]
    judge, begun = Judge(), time.time()
    hits, cases, processor = 0, 0, 0.0
    with multiprocessing.Manager() as manager:
        queue = manager.Queue()
        for core in cores:
            queue.put(core)
        with ProcessPoolExecutor(len(cores), initializer=pinned, initargs=(queue,)) as pool:
            pieces = max(1, asked.seeds // 10)
            cuts = [range(i, asked.seeds, pieces) for i in range(pieces)]
            work = {name: [pool.submit(fits, name, cut) for cut in cuts] for name in names}
            for name, done in work.items():
                results = [d.result() for d in done]
                spent = sum(s for s, _ in results)
                a, b = judged(judge, name, [one for _, part in results for one in part], spent)
                hits, cases, processor = hits + a, cases + b, processor + spent
    print(f"{processor:.0f} s of fits, {time.time() - begun:.0f} s in all on {len(cores)} cores")
    share = hits / max(cases, 1)
    judge.that(
        f"every shown parameter of {len(names)} laws lies in its interval in {100 * HELD:.0f} % of {asked.seeds} seeds, "
        f"which are at most {WIDEST:g} times the bound's",
        not judge.short,
    )
    room = 0.0 if len(names) > len(SHORT) else 3.0 * (0.95 * 0.05 / max(cases, 1)) ** 0.5  # of few
    low, high = POOLED[0] - room, min(POOLED[1] + room, 1.0)
    judge.that(
        f"over all of them {100 * share:.1f} % of {cases} ({100 * low:.0f} to {100 * high:.0f})",
        low <= share <= high,
    )
    judge.end()


if __name__ == "__main__":
    main()
