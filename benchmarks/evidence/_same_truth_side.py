"""One side of `same_truth`, run with its own PYTHONPATH: identify logs, or take the time; JSON on standard output.

It speaks both interfaces: that of before the one door (`fit`, `backdrive.simulate`), and that of after.
"""

from __future__ import annotations

import inspect
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
from _same_truth_logs import SPEEDS

import backdrive
from backdrive import identify, read_log, rollout
from backdrive.laws import CoulombViscous, Law, LuGre, StribeckGauss

try:
    from backdrive.fitting import fit as search  # type: ignore[import-not-found]
except ImportError:
    search = identify


def numbers(friction: Any) -> Iterator[tuple[str, float, float]]:
    """Yield name, value and standard error of everything that was identified of a joint."""
    for part in (friction.law.rate, friction.law.element):
        for name in part.PARAMETERS:
            values = np.ravel(np.asarray(getattr(part, name), dtype=np.float64))
            errors = np.ravel(np.asarray(friction.standard_errors.get(name, np.nan), dtype=np.float64))
            errors = np.broadcast_to(errors, values.shape) if errors.size == 1 else errors
            for k, (value, error) in enumerate(zip(values, errors, strict=False)):
                yield name if values.size == 1 else f"{name}[{k}]", float(value), float(error)
    for name, estimate in friction.dynamics.items():
        yield name, float(estimate.value), float(estimate.standard_error)


def identified(job: dict[str, Any]) -> dict[str, Any]:
    """Return what a log says of each of its joints."""
    log = read_log(job["path"], **job["reading"])
    function: Callable = search if job["law"] else identify
    options = dict(job["options"])
    if job["law"]:
        options["law"] = job["law"]
    known = inspect.signature(function).parameters
    result = function(log, **{name: value for name, value in options.items() if name in known})
    return {
        f.joint.name: {
            "law": f.law.name,
            "numbers": {n: (v, e) for n, v, e in numbers(f)},
            "curve": f.law.torque(np.concatenate([SPEEDS, -SPEEDS])).tolist(),
        }
        for f in result.model.joints
    }


def seconds(work: Callable[[], Any], repeats: int) -> float:
    """Return the least processor time of a call [s]."""
    took = []
    for _ in range(repeats):
        begun = time.process_time()
        work()
        took.append(time.process_time() - begun)
    return min(took)


def started(*words: str) -> float:
    """Return the processor time of a process [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


@cache
def works(path: str) -> dict[str, Callable[[], float]]:
    """Return what is timed, compiled: names and functions that return a processor time [s]."""
    try:
        from backdrive.control.compensators import by_law
    except ImportError:
        from backdrive.compensate import by_law  # type: ignore[import-not-found]
    from backdrive.control import JointLoop, Loop

    rate = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0)
    law = Law(rate=rate, element=LuGre(stiffness=1e4, damping=20.0, fading=0.05))
    joint = JointLoop(compensator=by_law(law), limit=7.0, top_speed=3.0, encoder_count=1e-6)
    loop = Loop([joint] * 6, interval=1e-3)
    rows, applied = list(0.2 * np.sin(3e-3 * np.arange(4000)[:, None] + np.arange(6))), np.zeros(6)

    def ticks() -> None:
        for row in rows:
            loop.update(row, applied)

    q = 0.2 * np.sin(3e-3 * np.arange(200_000))
    log = read_log(path)
    plain = Law(rate=CoulombViscous(coulomb_positive=4.0, coulomb_negative=4.0))
    found: dict[str, Callable[[], float]] = {
        "tick": lambda: seconds(ticks, 5) / len(rows),
        "rollout": lambda: seconds(lambda: rollout(law, dt=1e-3, q=q, workers=1), 5),
        "rollout without presliding": lambda: seconds(lambda: rollout(plain, dt=1e-3, q=q, workers=1), 5),
        "identify": lambda: seconds(lambda: identify(log), 2),
        "import": lambda: started("-c", "import backdrive"),
        "help": lambda: started("-m", "backdrive", "--help"),
    }
    for work in found.values():
        work()
    return found


def main() -> None:
    """Read jobs, a line each, and answer each with a line."""
    where = backdrive.__file__
    for line in sys.stdin:
        job = json.loads(line)
        begun = time.perf_counter()
        try:
            if job["what"] == "time":
                answer = {name: work() for name, work in works(job["path"]).items() if name == job["name"]}
            else:
                answer = identified(job)
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps({"side": where, "wall": time.perf_counter() - begun, "answer": answer}), flush=True)


if __name__ == "__main__":
    main()
