"""Maxwell-slip elements from slow reversals, against the elements that made the torque."""

import numba as nb
import numpy as np
import pytest
from backdrive.identification.dynamic.maxwell import fit_maxwell, stretches

from backdrive.engine import rollout
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.laws import GMS, Coulomb, Dahl, Law, LuGre, MaxwellSlip, StribeckGauss

JIT = not nb.config.DISABLE_JIT
SEEDS = 20
PER = 750 if JIT else 100  # samples of a reversal to and fro
compiled = pytest.mark.skipif(not JIT, reason="takes minutes without a compiler")

K, D = np.array([1.2e4, 5e3, 2e3]), np.array([1e-4, 4e-4, 1.5e-3])
F = float(K @ D)
TRUTH = Law(rate=Coulomb(coulomb=F), element=MaxwellSlip(stiffness=tuple(K), share=tuple(K * D / F)))
DT = 1e-3


def reversals(*amplitudes, per=PER, size=4e-3):
    """Return one period of a sine for every amplitude."""
    return np.concatenate([a * size * np.sin(2 * np.pi * np.arange(per) / per) for a in amplitudes])


MANY = reversals(1.0, 0.2, 0.5, 0.1, 0.8, 0.3, 1.0, 0.6)
FULL = reversals(1.0, 0.5, 0.8, 0.6)


def coloured(seed, n, size=0.05, memory=0.8):
    """Return noise that is correlated in time."""
    white = np.random.default_rng(seed).normal(size=n) * size
    for i in range(1, n):
        white[i] += memory * white[i - 1]
    return white


def torque(law, q, seed=0, size=0.02):
    return rollout(law, q=q, dt=DT) + size * np.random.default_rng(seed).normal(size=q.size)


def error(law, other, q):
    true = rollout(law, q=q, dt=DT)
    return np.linalg.norm(rollout(other, q=q, dt=DT) - true) / np.linalg.norm(true)


def test_a_stretch_is_the_position_within_its_bounds():
    q = np.array([0.0, 1.0, 3.0, 2.5, 0.0, -4.0, -3.0])
    assert stretches(q, np.array([2.0, 10.0])) == pytest.approx(
        np.array([[0, 0], [1, 1], [2, 3], [1.5, 2.5], [-1, 0], [-2, -4], [-1, -3]])
    )
    assert stretches(q[:2], np.array([2.0]), -1.0)[:, 0] == pytest.approx([-2.0, -1.0])


def test_the_virgin_curve_gives_its_slopes_and_bends():
    q = np.linspace(0.0, 4e-3, 2000 if JIT else 400)
    slopes = np.diff(np.interp([0.0, *D, 4e-3], q, rollout(TRUTH, q=q, dt=DT))) / np.diff([0.0, *D, 4e-3])
    found = fit_maxwell(q, rollout(TRUTH, q=q, dt=DT), dt=DT, relaxed=True, offset=False, elements=3)
    assert found.stiffness == pytest.approx(slopes[:-1] - slopes[1:], rel=0.02)
    assert found.stiffness == pytest.approx(K, rel=1e-4)
    assert found.breakaway == pytest.approx(D, rel=1e-4)
    assert found.coulomb == pytest.approx(F, rel=1e-5)
    assert any("no reversal" in w for w in found.warnings)


@compiled
@pytest.mark.parametrize("relaxed", [True, False])
@pytest.mark.parametrize("count", [0.0, 5e-6])
def test_three_elements_are_recovered_within_their_errors(relaxed, count):
    clean = rollout(TRUTH, q=MANY, dt=DT) + 0.3
    q = np.round(MANY / count) * count if count else MANY
    apart = []
    for seed in range(SEEDS):
        found = fit_maxwell(q, clean + coloured(seed, q.size), dt=DT, elements=3, relaxed=relaxed)
        assert len(found.stiffness) == 3
        apart.append(
            [
                *(np.array(found.stiffness) - K) / found.stiffness_error,
                *(np.array(found.breakaway) - D) / found.breakaway_error,
                (found.coulomb - F) / found.coulomb_error,
            ]
        )
        assert found.stiffness == pytest.approx(K, rel=0.1)
        assert found.offset == pytest.approx(0.3, abs=0.1)
        assert sum(found.share) == pytest.approx(1.0)
    assert np.max(np.abs(apart)) < 4.0
    size = np.sqrt(np.mean(np.square(apart), axis=0))
    assert np.all((size > 0.5) & (size < 1.7))


@compiled
def test_the_start_need_not_be_relaxed():
    law, q = TRUTH, np.concatenate([reversals(0.9, per=PER // 2)[: PER // 8], MANY + 3e-3])
    y = torque(law, q)[PER // 8 :]
    q = q[PER // 8 :]
    found = fit_maxwell(q, y, dt=DT, elements=3)
    assert found.stiffness == pytest.approx(K, rel=0.05)
    assert found.samples < q.size


@compiled
def test_the_number_of_elements_is_found():
    for seed in range(3):
        found = fit_maxwell(MANY, rollout(TRUTH, q=MANY, dt=DT) + coloured(seed, MANY.size), dt=DT)
        assert len(found.stiffness) == 3
        assert not found.warnings


@compiled
def test_gms_elements_are_recovered_and_given_back():
    law = Law(
        rate=StribeckGauss(coulomb=0.8 * F, breakaway=F, stribeck_velocity=0.1),
        element=GMS(stiffness=tuple(K), share=tuple(K * D / F), attraction=100.0),
    )
    found = fit_maxwell(MANY, torque(law, MANY), dt=DT, elements=3, relaxed=True)
    assert found.stiffness == pytest.approx(K, rel=0.03)
    assert found.breakaway == pytest.approx(D, rel=0.03)
    assert found.coulomb == pytest.approx(F, rel=0.03)
    element = found.element("gms", attraction=100.0)
    assert isinstance(element, GMS)
    assert element.stiffness == found.stiffness
    with pytest.raises(InvalidInput):
        found.element("gms")
    with pytest.raises(InvalidInput):
        found.element("dahl")  # type: ignore[arg-type]


SMOOTH = {
    "dahl": Law(rate=Coulomb(coulomb=6.0), element=Dahl(stiffness=1.2e4)),
    "lugre": Law(
        rate=StribeckGauss(coulomb=6.0, breakaway=6.6, stribeck_velocity=0.05),
        element=LuGre(stiffness=1.2e4, damping=20.0),
    ),
}


@compiled
@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("elements", [4, 8, 12])
def test_a_smooth_curve_is_predicted_on_another_motion(name, elements):
    """Within 5 % where strokes go through break-away; these laws do not follow Masing's rule inside a loop."""
    law = SMOOTH[name]
    found = fit_maxwell(FULL, torque(law, FULL), dt=DT, elements=elements)
    assert error(law, found.law(), reversals(1.0, 0.75, 0.9, per=1100, size=3e-3)) < 0.05
    t = np.arange(8000)
    nested = 2.5e-3 * np.sin(2 * np.pi * t / 2000) + 1.5e-3 * np.sin(2 * np.pi * t / 733)
    assert error(law, found.law(), nested) < 0.09


def said(found, *words):
    return any(all(w in warning for w in words) for warning in found.warnings)


@compiled
def test_what_the_motion_did_not_show_is_said():
    small = reversals(*[1.0] * 4, size=3e-4)
    for relaxed in (True, False):
        found = fit_maxwell(small, torque(TRUTH, small), dt=DT, elements=2, relaxed=relaxed)
        assert found.held
        assert said(found, "never reached break-away", "at least")
        assert said(found, "All reversals are 0.0006 apart")
        assert 3.0 < found.coulomb < 3.6  # F at 0.3 mm
    coarse = np.round(MANY / 3e-4) * 3e-4
    assert said(fit_maxwell(coarse, torque(TRUTH, MANY), dt=DT, elements=2), "encoder is too coarse")
    few = slice(0, MANY.size, MANY.size // 20)
    assert said(fit_maxwell(MANY[few], torque(TRUTH, MANY)[few], dt=DT), "samples are few")
    noise = np.random.default_rng(0).normal(size=MANY.size)
    assert said(fit_maxwell(MANY, noise, dt=DT, elements=1), "not explained")
    shaken = MANY + 5e-6 * noise
    assert said(fit_maxwell(shaken, torque(TRUTH, MANY), dt=DT, elements=3), "jitters")
    assert said(fit_maxwell(MANY, torque(TRUTH, MANY), dt=DT, elements=12), "fewer elements than the 12")


@compiled
def test_a_low_pass_on_the_position_takes_its_bias_away():
    shaken = MANY + 3e-6 * np.random.default_rng(1).normal(size=MANY.size)
    y = torque(TRUTH, MANY)
    rough = fit_maxwell(shaken, y, dt=DT, elements=3)
    smooth = fit_maxwell(shaken, y, dt=DT, elements=3, cutoff=40.0)
    assert abs(smooth.stiffness[0] - K[0]) < 0.3 * abs(rough.stiffness[0] - K[0])


@compiled
def test_torques_that_are_missing_are_left_out():
    y = torque(TRUTH, MANY)
    y[PER // 2 : PER] = np.nan
    found = fit_maxwell(MANY, y, dt=DT, elements=3)
    assert said(found, f"{PER - PER // 2} torques are not finite")
    assert found.stiffness == pytest.approx(K, rel=0.05)


def test_a_spring_breaks_never():
    found = fit_maxwell(MANY, 1e3 * MANY, dt=DT)
    assert found.held
    assert found.stiffness[-1] == pytest.approx(1e3, rel=1e-3)
    assert np.isnan(found.breakaway_error[-1])


@pytest.mark.parametrize(
    ("q", "y", "kind"),
    [
        (MANY, np.full(MANY.size, 3.0), NotIdentifiable),
        (np.zeros(MANY.size), MANY, NotIdentifiable),
        (MANY[:9], MANY[:9], NotIdentifiable),
        (MANY, -1e3 * MANY, NotIdentifiable),
        (MANY, np.full(MANY.size, np.nan), NotIdentifiable),
        (np.where(np.arange(MANY.size) == 5, np.nan, MANY), MANY, InvalidInput),
        (MANY, MANY[:-1], InvalidInput),
        (MANY[:, None], MANY[:, None], InvalidInput),
    ],
)
def test_what_cannot_be_identified_is_refused(q, y, kind):
    with pytest.raises(kind) as refused:
        fit_maxwell(q, y, dt=DT)
    assert refused.value.remedy


def test_settings_are_checked():
    for wrong in ({"dt": 0.0}, {"dt": DT, "elements": 0}):
        with pytest.raises(InvalidInput):
            fit_maxwell(MANY, MANY, **wrong)
