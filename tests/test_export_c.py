"""Laws and parts as C: the numbers that the kernels give here, bit for bit."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from _c import compiled, run, runs
from backdrive.control.admittance import Admittance
from backdrive.control.admittance import tick as admittance_tick
from backdrive.control.compensators.catalog import alg_fc2
from backdrive.control.compensators.compensator import Compensator
from backdrive.control.compensators.compensator import tick as compensator_tick
from backdrive.control.compensators.dither import Dither
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators.external import METHODS, ExternalForce
from backdrive.control.estimators.external import tick as external_tick
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, ct, ha
from backdrive.control.estimators.friction import tick as friction_tick
from backdrive.control.estimators.sliding_mode import WAYS, MotionFilter
from backdrive.engine.tick import Tick
from backdrive.export import parts
from backdrive.laws import ELEMENTS, RATES, Growth, Law, LuGre, Polyline, StribeckGauss, by_direction

N, DT = 300, 1e-3
KNOTS = dict(velocity=(0.01, 0.1, 0.5, 2.0), positive=(5.0, 4.0, 4.5, 6.0), negative=(4.5, 4.2, 4.4, 5.0))


def motion(seed: int) -> np.ndarray:
    """Increments with rests, reversals, strokes and a few that are far too large."""
    random = np.random.default_rng(seed)
    dp = 1e-3 * np.sin(np.arange(N) / 9.0) * np.exp(random.normal(0.0, 1.0, N))
    dp[random.random(N) < 0.15] = 0.0
    dp[random.random(N) < 0.01] *= 1e4
    return dp


def every_law() -> list[Law]:
    laws = []
    for rate, element in product(RATES.values(), ELEMENTS.values()):
        if element.NAME == "none" or (rate.NAME == "stribeck-gauss" and not rate.SMOOTH):
            laws.append(Law(rate=rate(**rate.EXAMPLE), element=element(**element.EXAMPLE)))
    return laws


def test_every_law_gives_the_same_bits(tmp_path):
    laws = every_law()
    laws.append(
        Law(rate=Polyline(**KNOTS), growth=Growth(load_driving=0.1, load_driven=0.05, load_carried=2.0))
    )
    laws.append(
        Law(rate=by_direction(StribeckGauss(**StribeckGauss.EXAMPLE), StribeckGauss(**StribeckGauss.EXAMPLE)))
    )
    named = {f"law_{i}": parts.of_law(law) for i, law in enumerate(laws)}
    library = compiled(tmp_path, runs(named))
    random = np.random.default_rng(5)
    load, temperature = random.normal(0.0, 5.0, (N, 2)), 35.0
    dp = np.stack([motion(i) for i in range(len(laws))], axis=1)
    tick = Tick(laws, dt=DT)
    tick.temperature[:] = temperature
    expected = np.empty(dp.shape)
    for k in range(N):
        tick.load[:] = load[k]
        expected[k] = tick.tick(np.ascontiguousarray(dp[k]))
    for i, law in enumerate(laws):
        inputs = np.column_stack([dp[:, i], np.full(N, DT), load, np.full(N, temperature)])
        got = run(library, f"law_{i}", inputs)[:, 0]
        assert np.array_equal(got, expected[:, i]), law.name


@pytest.mark.parametrize("single", [False, True])
def test_parts_give_the_same_numbers(tmp_path, single):
    """Every estimator, filter, compensator and the admittance, against the kernels on their rows."""
    law = Law(rate=Polyline(**KNOTS))
    gauss = StribeckGauss(**StribeckGauss.EXAMPLE)
    lugre = FrictionEstimator(law=Law(rate=gauss, element=LuGre(**LuGre.EXAMPLE)))
    fc2 = alg_fc2(law, 8e3, 0.0155, 20.0, 500.0, 10.0, None, 0.8)
    dithers = [Dither(mode=m, count=1e-5, frequency=23.0) for m in ("fixed", "reset", "adaptive")]
    compensators = [
        fc2,
        *(Compensator(friction=alg_fe(law, 8e3), dither=d) for d in dithers),
        Compensator(friction=alg_fe(law, 8e3), extra=Pulses(height=3.0)),
        Compensator(friction=lugre, extra=BristleObserver(gain=0.1, adaptation=0.01)),
        Compensator(friction=alg_fe(law, 8e3), extra=DisturbanceObserver(inertia=0.5, limit=4.0)),
    ]
    externals = [
        ExternalForce(inertia=0.5, friction=ha(law, 8e3), method=m, gravity_sin=2.0, offset=0.1)
        for m in METHODS
    ]
    named = {f"comp_{i}": parts.of_compensator(c, DT) for i, c in enumerate(compensators)}
    named |= {f"ext_{i}": parts.of_external(e, DT) for i, e in enumerate(externals)}
    named |= {f"fric_{i}": parts.of_friction(f) for i, f in enumerate((ct(law, 0.0155), fc2.friction, lugre))}
    named |= {f"filt_{w}": parts.of_filter(MotionFilter(way=w)) for w in WAYS}
    named["admit"] = parts.of_admittance(
        Admittance(inertia=0.4, viscosity=2.0, proportional=500.0, derivative=20.0, limit=9.0)
    )
    library = compiled(tmp_path, runs(named, single=single))
    random = np.random.default_rng(3)
    dp = np.round(motion(1) / 1e-5) * 1e-5
    dp = np.clip(dp, -0.01, 0.01)
    q = np.cumsum(dp)
    columns = {
        "q": q,
        "dp": np.diff(q, prepend=0.0),
        "dt": np.full(N, DT),
        "t": DT * np.arange(1, N + 1),
        "error": 1e-3 * random.normal(size=N),
        "slope": 0.1 * random.normal(size=N),
        "u": random.normal(size=N),
        "known": random.normal(size=N),
        "load_motor": random.normal(size=N),
        "load_external": random.normal(size=N),
        "temp": np.full(N, 30.0),
        "level": np.full(N, 0.9),
        "idle": (np.arange(N) % 50 > 40).astype(float),
        "tau_e": random.normal(size=N),
    }
    if single:
        columns |= {n: v.astype(np.float32).astype(float) for n, v in columns.items() if n not in ("q", "t")}
    of_name = {
        "comp": compensator_tick,
        "ext": external_tick,
        "fric": friction_tick,
        "admit": admittance_tick,
    }
    header = parts.PartsHeader(named, "bd", single)
    for name, part in named.items():
        kernel = of_name.get(name.split("_")[0]) or part.kernel
        inputs = np.column_stack([columns[n] for _, n in header.signature(name)])
        fields = header.steps[name].fields if header.steps[name].result.endswith("_result") else []
        kept = [i for i, f in enumerate(fields) if len(f) == 3]
        expected = reference(part, kernel, columns, kept)
        got = run(library, name, inputs, max(len(kept), 1))
        if not single:
            assert np.array_equal(got, expected), name
        elif not name.startswith(("ext", "filt")):  # what differences twice magnifies what a float rounds
            assert np.abs(got - expected).max() <= 1e-4 * np.abs(expected).max(), name


def reference(part: parts.Part, kernel, columns, kept) -> np.ndarray:
    """Run a kernel along the columns."""
    arrays = {n: v.copy() for n, v in (part.constants | part.states).items()}
    out = []
    for k in range(N):
        given = []
        for a in part.arguments:
            if isinstance(a, int):
                given.append(a)
            elif a in arrays:
                given.append(arrays[a])
            elif a == "load":
                given.append((columns["load_motor"][k], columns["load_external"][k]))
            else:
                given.append(bool(columns[a][k]) if a == "idle" else columns[a][k])
        result = kernel(*given)
        out.append([result[i] for i in kept] if kept else [result])
    return np.array(out)
