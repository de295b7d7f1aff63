"""Windows of a long log are looked at first, and all of it at the end."""

import numpy as np
import pytest

from backdrive import Log, identify
from backdrive.identification import motion
from backdrive.identification.dynamic import law_fit
from backdrive.identification.dynamic.stretch import Stretch
from backdrive.identification.windows import windows_of


def _stretch(n: int, seed: int = 0) -> Stretch:
    t, rng = 1e-3 * np.arange(n), np.random.default_rng(seed)
    q = 0.5 * np.sin(2.0 * np.pi * 0.4 * t) + 0.2 * np.sin(2.0 * np.pi * 1.1 * t)
    v, a = np.gradient(q, 1e-3), np.gradient(np.gradient(q, 1e-3), 1e-3)
    torque = 0.3 * a + 2.0 * np.tanh(v / 1e-3) + 0.8 * v + 0.05 * rng.standard_normal(n)
    return Stretch(
        dp=np.diff(q, prepend=q[0]),
        position=q,
        acceleration=a,
        torque=torque,
        dt=1e-3,
        judged=np.ones(n, dtype=bool),
    )


def test_few_samples_have_no_windows():
    assert windows_of([_stretch(law_fit.ENOUGH)], law_fit.ENOUGH) is None


def test_windows_are_spread_over_all_stretches():
    each = [_stretch(50_000), _stretch(90_000)]
    part = windows_of(each, law_fit.ENOUGH)
    assert part is not None
    assert sum(len(s.torque) for s in part) <= law_fit.ENOUGH
    assert np.array_equal(part[0].torque[:10], each[0].torque[:10])
    assert np.array_equal(part[-1].torque[-10:], each[1].torque[-10:])
    assert all(len(s.dp) == len(s.torque) == len(s.judged) and len(s.load) == 1 for s in part)


def test_a_long_log_gives_what_all_of_its_samples_say(monkeypatch):
    log = _stretch(100_000)
    quick = law_fit.fit_law("coulomb-viscous", [log])
    assert quick.problem.size > law_fit.ENOUGH
    monkeypatch.setattr(law_fit, "ENOUGH", 10**9)
    whole = law_fit.fit_law("coulomb-viscous", [log])
    for name, error in whole.standard_errors.items():
        assert abs(quick.values[name] - whole.values[name]) <= 0.1 * error, name


def test_windows_at_rest_are_not_used():
    still = _stretch(100_000)
    span = slice(0, 99_000)
    for series in (still.dp, still.acceleration):
        series[span] = 0.0
    still.torque[span] = 0.01 * still.torque[span]
    found = law_fit.fit_law("coulomb-viscous", [still])
    assert found.values["coulomb_positive"] == pytest.approx(2.0, abs=0.1)


def _log(rest: int = 0) -> Log:
    s = _stretch(60_000)
    position = s.position if not rest else np.where(np.arange(60_000) < rest, s.position[rest], s.position)
    torque = np.where(np.arange(60_000) < rest, 0.0, s.torque)
    return Log.from_arrays(time=1e-3 * np.arange(60_000), position=position, torque=torque)


@pytest.mark.parametrize("rest", [0, 45_000])
def test_a_first_look_at_windows_leaves_the_numbers_of_a_long_log_as_they_are(rest, monkeypatch):
    log = _log(rest)
    whole = identify(log, method="motion").model.joints[0]
    monkeypatch.setattr(motion, "ENOUGH", 12_000)
    looked = []
    monkeypatch.setattr(motion, "windows_of", lambda *a: looked.append(windows_of(*a)) or looked[-1])
    quick = identify(log, method="motion").model.joints[0]
    assert sum(len(s.torque) for s in looked[0]) <= 12_000
    assert quick.law.name == whole.law.name and set(quick.dynamics) == set(whole.dynamics)
    for name, one in whole.dynamics.items():
        assert abs(quick.dynamics[name].value - one.value) <= 0.2 * one.standard_error, name
    for name, error in whole.standard_errors.items():
        assert abs(getattr(quick.law.rate, name) - getattr(whole.law.rate, name)) <= 0.2 * error, name
