"""Ticks of `speed`: a compensator, and the loop with all its guards around it, run in compiled loops along encoder readings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from _speed_laws import LINES, lines

from backdrive._assembly import assemble
from backdrive._jit import jit, part
from backdrive.control import assembly
from backdrive.control.compensators import compensator
from backdrive.control.compensators.catalog import alg_fc2
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.joint_loop import JointLoop
from backdrive.control.loop import Loop
from backdrive.control.loop_kernel import tick
from backdrive.control.table import TORQUE

STIFFNESS, SLOW, FAST, SWITCH, SHARE, COUNT = 1e4, 20.0, 500.0, 10.0, 0.8, 1e-5


@jit
def compensated(c, p, x, s, q, T, out):
    """Fill `out` with what a compensator pushes."""
    before = q[0]
    for k in range(q.size):
        dp, before = q[k] - before, q[k]
        push, wave = compensator.tick(
            c, 0, p, x, s, 0, q[k], dp, T, k * T, 0.0, 0.0, 0.0, (0.0, 0.0), 20.0, False
        )
        out[k] = push + wave


@jit
def guarded(A, o, g, codes, q, T, out):
    """Fill `out` with the torque of a loop of one joint along readings (n, 1)."""
    for k in range(out.size):
        tick(A, o, g, codes, part(q, k, 0, 1), T)
        out[k] = g[0, TORQUE]


def readings(q: np.ndarray) -> np.ndarray:
    """Return what an encoder reads."""
    return COUNT * np.round(q / COUNT)


def numbers(T: float) -> np.ndarray:
    """Return algFC2's numbers as the C reads them."""
    return np.array([SHARE, STIFFNESS, SLOW, FAST, SWITCH, 2.5 * COUNT / T, *lines(LINES)])


def ours(q: np.ndarray, T: float) -> dict[str, Callable[[], np.ndarray]]:
    """Return runs along readings by name: the compensator alone, the guarded loop, and that with an estimator."""
    made = alg_fc2(LINES, STIFFNESS, 2.5 * COUNT / T, SLOW, FAST, SWITCH, share=SHARE)
    law, out = made.friction.law, np.empty(q.size)
    alone_kernel = assemble(
        compensated, {compensator.tick: assembly.of_compensators(made.row(T)[None], law.row()[None])}
    )

    rows = made.row(T), law.row(), law.state(), made.start(float(q[0]))

    def alone() -> np.ndarray:
        alone_kernel(*(row.copy() for row in rows), q, T, out)
        return out

    def loop(external: ExternalForce | None) -> Callable[[], np.ndarray]:
        joint = JointLoop(compensator=made, external=external, limit=5.0, top_speed=10.0, encoder_count=COUNT)
        one = Loop(joint, interval=T)
        kernel = assemble(guarded, {tick: one._tick})

        def run() -> np.ndarray:
            one.reset(q[:1])
            kernel(*one._arrays, q[:, None], T, out)
            return out

        return run

    estimator = ExternalForce(inertia=0.5, friction=made.friction, method="momentum", bandwidth=50.0)
    return {"algFC2's tick": alone, "loop with guards": loop(None), "loop with estimator": loop(estimator)}
