"""Friction laws on arrays: the kernel's numbers on numpy and jax, gradients, time beside a Coulomb actuator, draws.

- Every law on 100 random motions: numpy 1,000 steps each (1e5 in all), jax 1e5 steps each (`--short`: 100 and 1,000), by the
  largest torque of the compiled kernel.
- Gradients of the sum of torques over 50 steps by every parameter and every increment, against central differences of the
  kernel at two widths; where these two disagree, the law is not smooth there and the place is counted, not judged. Every gradient
  is finite.
- Time of a jitted step of 4096 environments of 7 joints, by that of a Coulomb actuator as learning environments have it,
  tau = F tanh(v/v_0) + B v, and by F sgn(v) + B v; interleaved, medians of CPU time. LuGre is judged, all are printed. Much of
  a single step of two results is memory that jax asks for anew: beside it LuGre in a jitted rollout of 60 steps is printed.
- 1e5 drawn parameter sets: mean and covariance where bounds are far; inside them where they are near.

torch is tried where it is installed.

    python benchmarks/evidence/arrays.py [--short] [--seed N]
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
from _common import Judge, first_seed, parser

from backdrive import load_model
from backdrive.engine.tick import Tick
from backdrive.export import arrays
from backdrive.laws import Law
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES, example
from backdrive.model import Covariance

B, DT, WARM = 100, 1e-3, 35.0
CLOSE, SMOOTH, TIMES = 1e-12, 1e-5, 3.0
SEARCHES = ("elastoplastic", "leuven", "smoothed-maxwell-slip")  # a step takes a hundred times that of others
FEW = ("coulomb-viscous", "polyline", "m6", "lugre", "gms", "decaying", "elastoplastic")


def motions(random: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return increments and loads of random motions that stick, slide and reverse, (n, B) and (n, B, 2)."""
    t = np.arange(n)[:, None] * DT
    speed = sum(
        random.uniform(0.0, 0.4, B)
        * np.sin(2 * np.pi * random.uniform(0.1, 8.0, B) * t + random.uniform(0, 6, B))
        for _ in range(4)
    )
    speed *= random.uniform(0.01, 1.0, B)
    speed[random.random(speed.shape) < 0.02] = 0.0
    return speed * DT, random.normal(0.0, 3.0, (n, B, 2))


def by_kernel(law: Law, dp: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Return the torque of the compiled kernel, (n, B)."""
    tick = Tick([law] * dp.shape[1], dt=DT)
    tick.temperature[:] = WARM
    torque = np.empty(dp.shape)
    for k in range(len(dp)):
        tick.load[:] = load[k]
        torque[k] = tick.tick(dp[k])
    return torque


def along(g: arrays.ArrayLaw) -> Callable:
    """Return the torque of a law along motions, as one program."""
    import jax

    def one(x, now):
        torque, after = g.step(x, now[0], DT, now[1], WARM)
        return after, torque

    return lambda dp, load: jax.lax.scan(one, g.init(B), (dp, load))[1]


def alike(judge: Judge, names: list[str], random: np.random.Generator, short: bool) -> None:
    """Judge the numbers of numpy and jax by those of the kernel."""
    import jax

    steps, long = (100, 1000) if short else (1000, 100_000)
    worst = {"numpy": (0.0, ""), "jax": (0.0, "")}
    for name in names:
        law = example(name)
        dp, load = motions(random, long)
        expected = by_kernel(law, dp, load)
        largest = np.abs(expected).max()
        f = arrays.law(law)
        x, error = f.init(B), 0.0
        for k in range(steps):
            torque, x = f.step(x, dp[k], DT, load[k], WARM)
            error = max(error, float(np.abs(torque - expected[k]).max()))
        if error / largest >= worst["numpy"][0]:
            worst["numpy"] = error / largest, name
        g = arrays.law(law, xp=jax.numpy)

        torque = np.asarray(jax.jit(along(g))(dp, load))
        error = float(np.abs(torque - expected).max()) / largest
        if error >= worst["jax"][0]:
            worst["jax"] = error, name
    for library, (error, name) in worst.items():
        judge.at_most(
            f"{library}, {len(names)} laws: worst by the law's largest torque ({name})", error, CLOSE
        )


def gradients(judge: Judge, names: list[str], random: np.random.Generator) -> None:
    """Judge gradients by central differences of the kernel."""
    import jax

    infinite, worst, places, rough = [], (0.0, ""), 0, 0
    for name in names:
        law = example(name)
        f = arrays.law(law, xp=jax.numpy)
        n = 50
        dp = motions(random, n)[0][:, :1] + 1e-6

        def total(row, d, f=f):
            def one(x, now):
                torque, after = f.step(x, now, DT, row=row)
                return after, torque

            return jax.lax.scan(one, f.init(1), d)[1].sum()

        slopes = jax.jit(jax.grad(total, argnums=(0, 1)))
        by_row, by_way = (np.asarray(g) for g in slopes(law.row(), dp))
        at_rest = slopes(
            law.row(), np.where(np.arange(n)[:, None] % 3 == 0, 0.0, dp)
        )  # where powers have poles
        if not all(np.isfinite(g).all() for g in (by_row, by_way, *at_rest)):
            infinite.append(name)
        fixed = set(arrays.counts(law))
        for kind, values, gradient in (("row", law.row(), by_row), ("way", dp[:, 0], by_way[:, 0])):
            for i in range(values.size):
                if kind == "row" and (i in fixed or values[i] == 0.0 or not np.isfinite(values[i])):
                    continue
                found = []
                for width in (1e-6, 3e-7):
                    h = width * max(abs(values[i]), 1e-5 if kind == "way" else 0.0)
                    ends = []
                    for sign in (1.0, -1.0):
                        moved = values.copy()
                        moved[i] += sign * h
                        row, way = (moved, dp[:, 0]) if kind == "row" else (law.row(), moved)
                        ends.append(summed(law, row, way))
                    found.append((ends[0] - ends[1]) / (2.0 * h))
                scale = max(abs(found[0]), abs(gradient).max() * 1e-3, 1e-12)
                places += 1
                if abs(found[0] - found[1]) > 3e-6 * scale:
                    rough += 1
                    continue
                error = abs(gradient[i] - found[0]) / scale
                if error > worst[0]:
                    worst = error, f"{name}, {kind} {i}"
    print(f"gradients: {places} places of {len(names)} laws, {rough} not smooth or lost in rounding")
    rest = f": not of {', '.join(infinite)}" if infinite else ""
    judge.that(f"gradients are finite, at rest too{rest}", not infinite)
    judge.at_most(f"worst gradient ({worst[1]})", worst[0], SMOOTH)
    judge.that(f"smooth places: {places - rough} of {places} (at least two thirds)", rough <= places / 3)


def summed(law: Law, row: np.ndarray, way: np.ndarray) -> float:
    """Return the sum of the kernel's torques along a motion, with another row of parameters."""
    from backdrive.laws import REFERENCE, kernels

    x, total = law.state(), 0.0
    for step in way:
        total += kernels.step(
            law.rate.KIND, law.element.KIND, row, x, float(step), DT, law.usual_load, REFERENCE
        )
    return total


def timed(judge: Judge, names: list[str], random: np.random.Generator, short: bool) -> None:
    """Judge the time of a step."""
    import jax
    import jax.numpy as jnp

    dp = jnp.asarray(random.normal(0.0, 1e-4, (4096, 7)))
    smooth = jax.jit(lambda d: 2.0 * jnp.tanh(d / DT / 0.01) + 0.3 * d / DT)
    sharp = jax.jit(lambda d: 2.0 * jnp.sign(d) + 0.3 * d / DT)
    calls = {"Coulomb, tanh": lambda: smooth(dp), "Coulomb, sgn": lambda: sharp(dp)}
    for name in names:
        f = arrays.law(example(name), xp=jnp)
        step, x = jax.jit(lambda x, d, f=f: f.step(x, d, DT)), f.init((4096, 7))
        calls[name] = lambda step=step, x=x: step(x, dp)
    clock = time.process_time if jax.default_backend() == "cpu" else time.perf_counter
    rows: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        jax.block_until_ready(call())
    for _ in range(15):
        for name, call in calls.items():
            times = 2 if name in SEARCHES else 20 if short else 60
            begun = clock()
            for _ in range(times):
                jax.block_until_ready(call())
            rows[name].append((clock() - begun) / times * 1e6)
    medians = {name: float(np.median(r)) for name, r in rows.items()}
    plain = medians["Coulomb, tanh"]
    print(f"a jitted step of 4096 x 7, jax on {jax.default_backend()}:")
    for name, t in medians.items():
        print(f"  {name:24s} {t:8.0f} us {t / plain:6.2f} of tanh {t / medians['Coulomb, sgn']:6.2f} of sgn")
    judge.at_most("LuGre by the Coulomb actuator", medians["lugre"] / plain, TIMES)
    slow = [name for name, t in medians.items() if t > TIMES * plain]
    print(f"  above {TIMES:g}: {', '.join(slow) or 'none'}")
    rolled(random, clock)


def rolled(random: np.random.Generator, clock: Callable[[], float]) -> None:
    """Print the time of a step in a jitted rollout, where the state needs no new memory every step."""
    import jax
    import jax.numpy as jnp

    dp, f = jnp.asarray(random.normal(0.0, 1e-4, (60, 4096, 7))), arrays.law(example("lugre"), xp=jnp)

    def smooth(total, d):
        return total + 2.0 * jnp.tanh(d / DT / 0.01) + 0.3 * d / DT, None

    def lugre(carry, d):
        torque, x = f.step(carry[1], d, DT)
        return (carry[0] + torque, x), None

    zero, medians = jnp.zeros((4096, 7)), []
    for step, begin in ((smooth, zero), (lugre, (zero, f.init((4096, 7))))):
        run = jax.jit(lambda carry, d, step=step: jax.lax.scan(step, carry, d)[0])
        times: list[float] = []
        for _ in range(16):
            begun = clock()
            jax.block_until_ready(run(begin, dp))
            times.append((clock() - begun) / len(dp) * 1e6)
        medians.append(float(np.median(times[1:])))
    print(
        f"in a jitted rollout: Coulomb, tanh {medians[0]:.0f} us, LuGre {medians[1]:.0f} us, {medians[1] / medians[0]:.2f} of it"
    )


def draws(judge: Judge, seed: int, short: bool) -> None:
    """Judge parameters drawn from a covariance."""
    n = 4000 if short else 100_000
    preset = load_model("preset:mx106/m6")
    law = example("lugre")
    names = ("coulomb", "breakaway", "viscous", "stiffness")
    values = {k: v for part in law.parts for k, v in part.values().items()}
    mean = np.array([values[k] for k in names])
    root = np.diag(mean * np.array([0.02, 0.03, 0.05, 0.04]))
    mixed = root @ np.array([[1, 0.5, 0, 0], [0.5, 1, 0.2, 0], [0, 0.2, 1, -0.3], [0, 0, -0.3, 1]]) @ root
    for near in (False, True):
        spread = mixed * (400.0 if near else 1.0)
        friction = replace(
            preset.joints[0],
            law=law,
            covariance=Covariance(names=names, matrix=tuple(map(tuple, spread.tolist()))),
            standard_errors=dict(zip(names, np.sqrt(np.diag(spread)).tolist(), strict=False)),
        )
        model = replace(preset, joints=(friction,))
        rows = model.sample(n, seed=seed)
        rows = np.asarray(rows[next(iter(rows))] if isinstance(rows, dict) else rows)
        at = [1 + int(np.flatnonzero(law.row()[1:] == v)[0]) for v in mean]
        got = rows[:, at]
        if near:
            judge.that(f"{n} draws with wide errors: all at least 0", bool((got >= 0.0).all()))
            continue
        error = np.abs(got.mean(axis=0) - mean) / np.sqrt(np.diag(spread) / n)
        judge.at_most("mean of draws, in its own errors", float(error.max()), 4.5)
        scale = np.sqrt(np.outer(np.diag(spread), np.diag(spread)))
        error = np.abs(np.cov(got.T) - spread) / scale * np.sqrt(n)
        judge.at_most("covariance of draws, in 1/sqrt(n) of its scale", float(error.max()), 6.5)


def by_torch(judge: Judge, names: list[str], random: np.random.Generator) -> None:
    """Judge torch where it is installed."""
    if find_spec("torch") is None:
        print("torch is not installed: not tried")
        return
    import torch

    for device in ("cpu", "cuda") if torch.cuda.is_available() else ("cpu",):
        worst = (0.0, "")
        for name in names:
            law = example(name)
            dp, load = motions(random, 200)
            expected = by_kernel(law, dp, load)
            f = arrays.law(law, xp=torch)
            x = tuple(each.to(device) for each in f.init(B))
            for k in range(len(dp)):
                now, carries = (torch.asarray(a[k], device=device) for a in (dp, load))
                torque, x = f.step(x, now, DT, carries, WARM)
                error = float(np.abs(torque.cpu().numpy() - expected[k]).max() / np.abs(expected).max())
                worst = max(worst, (error, name))
        judge.at_most(
            f"torch {torch.__version__} on {device}, {len(names)} laws ({worst[1]})", worst[0], CLOSE
        )
        infinite = []
        for name in names:
            f, way = arrays.law(example(name), xp=torch), motions(random, 4)[0]
            way[2] = 0.0
            row, dp = (torch.asarray(a, device=device).requires_grad_() for a in (f.row, way))
            x, total = tuple(each.to(device) for each in f.init(B)), 0.0
            for now in dp:
                torque, x = f.step(x, now, DT, row=row)
                total = total + torque.sum()
            total.backward()
            if not all(torch.isfinite(each.grad).all() for each in (row, dp)):
                infinite.append(name)
        rest = f": not of {', '.join(infinite)}" if infinite else ""
        judge.that(f"torch on {device}: gradients are finite, at rest too{rest}", not infinite)


def main() -> None:
    """Run all parts."""
    made = parser(__doc__)
    made.add_argument("--seed", type=int, help="of all random numbers; a fresh one by default")
    asked = made.parse_args()
    import jax

    jax.config.update("jax_enable_x64", True)
    judge, seed = Judge(), first_seed(asked.seed)
    random = np.random.default_rng(seed)
    names = list(FEW) if asked.short else [*RATE_EXAMPLES, *ELEMENT_EXAMPLES]
    quick = [name for name in names if not (asked.short and name == "elastoplastic")]
    alike(judge, names, random, asked.short)
    gradients(judge, quick, random)
    timed(judge, quick, random, asked.short)
    draws(judge, seed, asked.short)
    by_torch(judge, names, random)
    judge.end()


if __name__ == "__main__":
    main()
