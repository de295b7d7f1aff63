"""Friction of many parameter sets along one motion by JAX on one core, in double precision: a program of its own.

It reads the sets and the motion from a file and prints, for each law, the processor time of a call [s] (median) and the torque's
largest distance from ours. The sets are batched, every parameter varies, time is a scan.
"""

from __future__ import annotations

import os
import statistics
import sys
import time

import numpy as np

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import jax
import jax.numpy as jnp

jax.config.update("jax_enable_x64", True)
TURNS = 15


def curve(p, v):
    """Return the bound of a Stribeck curve."""
    r = v * p[3]
    return p[0] + (p[1] - p[0]) * jnp.exp(-r * r)


def stribeck(p, dp, dt):
    """Return the torque, (n, B); p: F_c, F_s, sigma_2, 1/v_s."""

    def tick(z, d):
        v = d / dt
        return z, jnp.sign(d) * curve(p, v) + p[2] * v

    return jax.lax.scan(tick, jnp.zeros(()), dp)[1]


def lugre(p, dp, dt):
    """Return the torque, (n, B); p: F_c, F_s, sigma_2, 1/v_s, sigma_0, sigma_1, 1/v_d."""
    by = 1.0 / (p[4] * dt)

    def tick(z, d):
        v = d / dt
        s = jnp.where(d < 0.0, -1.0, 1.0) * curve(p, v)
        reach = p[4] * d
        after = (z + reach) * (s / (s + reach))
        r = v * p[6]
        return after, after + p[5] * jnp.exp(-r * r) * (after - z) * by + p[2] * v

    return jax.lax.scan(tick, jnp.zeros(p.shape[1]), dp)[1]


def main() -> None:
    """Time both laws on the sets of a file."""
    given = np.load(sys.argv[1])
    dp, dt = jnp.asarray(given["dp"]), float(given["dt"])
    for name, law in (("stribeck", stribeck), ("lugre", lugre)):
        rows = given[name].T
        order = [0, 1, 3, 2, 4, 5, 6][: len(rows)]
        p = rows[order].copy()
        p[3] = 1.0 / p[3]
        if name == "lugre":
            p[6] = 1.0 / p[6]
        run, sets = jax.jit(law, static_argnums=2), jnp.asarray(p)
        out = np.asarray(run(sets, dp, dt))
        apart = float(np.abs(out[:, : given["some"].shape[1]] - given[f"{name}_torque"]).max())
        times = []
        for _ in range(TURNS):
            begun = time.process_time()
            run(sets, dp, dt).block_until_ready()
            times.append(time.process_time() - begun)
        print(name, statistics.median(times), apart)


if __name__ == "__main__":
    main()
