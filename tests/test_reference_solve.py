"""A mass held by every law, roots that are sought in few trials, and rollouts as the loop of steps that they stand for."""

import os
from math import copysign, inf, isnan, nan

import numba as nb
import numpy as np
import pytest

from _kinds import one_of_a_kind
from backdrive.engine import Axis, DriveModel, Motions, Servo, forward, rollout
from backdrive.engine.axis import advance, gravity, implicit_velocity
from backdrive.engine.cores import available, spread
from backdrive.engine.drives import along
from backdrive.engine.drives import torque as drive_torque
from backdrive.engine.series import Lanes, increments
from backdrive.engine.servo import tick as servo_tick
from backdrive.engine.tick import Tick
from backdrive.errors import InvalidInput
from backdrive.laws import (
    GMS,
    BlimanSorine,
    Coulomb,
    CoulombViscous,
    Dahl,
    DeadZone,
    Decaying,
    Elastoplastic,
    HaywardArmstrong,
    Law,
    Leuven,
    LoadTemperature,
    LuGre,
    MaxwellSlip,
    Polyline,
    ResetIntegrator,
    SmoothedMaxwellSlip,
    StribeckGauss,
    XiongKikuuweMulti,
    kernels,
)
from backdrive.laws.elements import elastoplastic, leuven, smoothed_maxwell_slip
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES
from backdrive.logs.log import Joint
from backdrive.model import FrictionModel, JointFriction, Validity

PLAIN = pytest.mark.skipif(not nb.config.DISABLE_JIT, reason="runs with NUMBA_DISABLE_JIT=1, as .ci/run does")
SIDES = CoulombViscous(coulomb_positive=5.0, coulomb_negative=3.0, viscous_positive=1.0, viscous_negative=2.0)
CURVE = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0)
NONE = (0.0, 0.0)


def stepped(law, x, dp, dt, load=NONE, T=20.0):
    return kernels.step(law.rate.KIND, law.element.KIND, law.row(), x, dp, dt, load, T)


def of(kernel, law):
    """Return a kernel for one law, as the package itself runs it."""
    return kernels.of_kinds(kernel, law.rate.KIND, law.element.KIND)


def solved(law, x, v_free, dt, soft, load=NONE, T=20.0):
    return kernels.solve(law.rate.KIND, law.element.KIND, law.row(), x, v_free, dt, soft, load, T)


# ------------------------------------------------------------------------------------------------ held masses


SMOOTH = ["dahl", "lugre", "elastoplastic", "visco-elastoplastic", "xiong-kikuuwe", "xiong-kikuuwe-multi", "maxwell-slip",
          "leuven", "smoothed-maxwell-slip", "bliman-sorine", "hayward-armstrong", "decaying"]  # fmt: skip


@pytest.mark.parametrize("name", SMOOTH)
def test_a_held_mass_is_in_balance_at_the_end_of_its_step(name):
    """v + dt/m f(v dt) = v_free, f by a step from the same state, which stays as it is."""
    generator = np.random.default_rng(4)
    for rate in (SIDES, CURVE):
        law, dt = Law(rate=rate, element=ELEMENT_EXAMPLES[name]), 1e-3
        for trial in range(18):
            x = law.state()
            for dp in generator.normal(0.0, 3e-4, 4):
                stepped(law, x, dp, dt)
            soft = 10.0 ** generator.uniform(-4.0, -1.5)
            v_free = copysign(10.0 ** generator.uniform(-3.5, 0.5), 0.5 - trial % 2)
            before = x.copy()
            v = solved(law, x, v_free, dt, soft)
            n = x.size // 2
            assert x[:n].tolist() == before[:n].tolist()
            balance = v + soft * stepped(law, x.copy(), v * dt, dt) - v_free
            assert abs(balance) <= 1e-9 * (abs(v_free) + soft * 6.0)


def test_a_mass_under_set_valued_friction_rests_up_to_its_bounds():
    """Held where lo <= m/dt v_free <= hi, both ends included; beyond, v = (v_free - dt/m hi)/(1 + dt/m viscous)."""
    for element in (ELEMENT_EXAMPLES["none"], DeadZone(threshold=0.3)):
        law, soft = Law(rate=SIDES, element=element), 0.5
        for v_free, wanted in ((2.5, 0.0), (-1.5, 0.0), (0.0, 0.0), (2.6, 0.1 / 1.5), (-1.6, -0.1 / 2.0), (12.5, 10.0 / 1.5),
                               (-21.5, -20.0 / 2.0)):  # fmt: skip
            assert solved(law, law.state(), v_free, 1e-3, soft) == pytest.approx(wanted, rel=1e-12, abs=1e-15)
    free = Law(rate=Coulomb(coulomb=0.0))
    assert solved(free, free.state(), 0.7, 1e-3, 0.5) == 0.7
    for element in (ELEMENT_EXAMPLES["none"], Dahl(stiffness=1e3)):
        law = Law(rate=SIDES, element=element)
        for wild in (nan, inf, -inf):
            assert isnan(solved(law, law.state(), wild, 1e-3, 0.5))
    law = Law(rate=SIDES, element=Dahl(stiffness=1e3))
    assert solved(law, law.state(), 0.0, 1e-3, 0.5) == 0.0
    assert isnan(solved(law, np.array([nan, 0.0]), 0.1, 1e-3, 0.5))
    assert solved(law, np.array([2.0, 0.0]), 1.0, 1e-3, 0.5) == 0.0  # what it holds is what drives it
    pushed = solved(law, np.array([2.0, 0.0]), 0.0, 1e-3, 1e-3)  # a stretched bristle drives it back
    F, v = -3.0, pushed
    assert v < 0.0
    assert v + 1e-3 * (F + (2.0 - F) * np.exp(-1e3 * v * 1e-3 / F) + 2.0 * v) == pytest.approx(0.0, abs=1e-12)


def test_a_slipping_element_that_jumps_at_rest_ends_beside_the_jump():
    """GMS creeping on in slip: no v balances; the mass stays next to rest, on the side that it is pulled to."""
    law = Law(rate=SIDES, element=GMS(stiffness=(1e4,), share=(1.0,), attraction=1e3))
    x = law.state()
    x[:2] = 2.0, 1.0  # slipping forwards at 2 of 5
    v = solved(law, x, 2.5e-3, 1e-3, 1e-3)  # f jumps from 2 at rest to 2 + 0.5 and more in motion
    assert 0.0 <= v <= 1e-3
    assert x[:2].tolist() == [2.0, 1.0]


@PLAIN
@pytest.mark.parametrize("name", [*SMOOTH, "none"])
def test_a_held_mass_is_found_in_few_trials(monkeypatch, name):
    """Straight curves in a handful, bent ones in hardly more. The first is at rest."""
    law, tried = Law(rate=CURVE, element=ELEMENT_EXAMPLES[name]), []
    real = kernels._friction_at
    monkeypatch.setattr(kernels, "_friction_at", lambda *a: tried.append(1) or real(*a))
    straight = Law(rate=SIDES)
    for v_free in (0.1, -0.2, 5.0):
        tried.clear()
        solved(straight, straight.state(), v_free, 1e-3, 1e-3)
        assert len(tried) - 1 <= 3
    counts = []
    for v_free in np.r_[np.geomspace(1e-3, 3.0, 25), -np.geomspace(1e-3, 3.0, 25)]:
        for soft in (1e-4, 1e-3, 1e-2):
            tried.clear()
            solved(law, law.state(), v_free, 1e-3, soft)
            counts.append(len(tried) - 1)
    assert max(counts) <= 10 and np.mean(counts) <= 5.0


# ---------------------------------------------------------------------------------- roots within an element


@PLAIN
def test_the_root_of_a_step_is_found_in_few_trials(monkeypatch):
    counted = []
    for module, name in (
        (elastoplastic, "plastic"),
        (leuven, "pull_bristle"),
        (smoothed_maxwell_slip, "gate"),
    ):
        real = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, real=real: counted.append(1) or real(*a))
    generator = np.random.default_rng(2)
    most = {"elastoplastic": (14, 4.5), "leuven": (20, 8.5), "smoothed-maxwell-slip": (3 * 20, 3 * 8.0)}
    for element, (worst, usual) in most.items():
        law, dt, counts = Law(rate=SIDES, element=ELEMENT_EXAMPLES[element]), 1e-3, []
        x = law.state()
        for k in range(300):
            dp = generator.normal() * 10.0 ** generator.uniform(-6.0, -2.5)
            counted.clear()
            stepped(law, x, dp if k % 60 < 50 else 1e-4, dt)
            counts.append(len(counted))
        assert max(counts) <= worst and np.mean(counts) <= usual


def bisected(f, low, high):
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if f(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_an_elastoplastic_bristle_from_anywhere(way):
    """u = g + R (1 - a(u) u/S), from torques beyond the bound, within the elastic share, against the motion, over any path."""
    law = Law(rate=Coulomb(coulomb=5.0), element=Elastoplastic(stiffness=1e4, elastic=0.6))
    for g in (-30.0, -5.0, -2.0, 0.0, 2.9, 3.0, 4.0, 4.9, 5.0, 6.0, 30.0):
        for R in (1e-6, 0.01, 0.1, 1.0, 7.0, 60.0, 1e5, 1e20):
            x = law.state()
            x[0] = way * g
            got = way * stepped(law, x, way * R / 1e4, 1e-3)

            def a(u):
                w = (u / 5.0 - 0.6) / 0.4
                return 0.0 if w <= 0.0 else 1.0 if w >= 1.0 else 0.5 - 0.5 * np.cos(np.pi * w)

            wanted = bisected(
                lambda u, g=g, R=R: (u - g) / (1.0 + R) - R / (1.0 + R) * (1.0 - a(u) * u / 5.0), -40.0, 40.0
            )
            if g + R <= 3.0:
                wanted = g + R
            assert got == pytest.approx(wanted, rel=1e-8, abs=1e-8), (g, R)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_smoothed_elements_from_anywhere(way):
    """u = r + path (1 - h(u) u): from beyond the bound, against the motion, over any path."""
    for sharp, margin, reversal in ((100.0, 0.95, 10.0), (3.0, 0.5, 1.0), (8.0, 0.2, 2.0)):
        e = SmoothedMaxwellSlip(
            stiffness=(1e4,), share=(1.0,), sharpness=sharp, margin=margin, reversal=reversal
        )
        law = Law(rate=Coulomb(coulomb=5.0), element=e)

        def gate(u, l=sharp, b=margin, c=reversal):  # noqa: E741
            return (
                (1.0 - 0.5 * np.tanh(l * (u + b)) + 0.5 * np.tanh(l * (u - b))) * 0.5 * (1.0 + np.tanh(c * u))
            )

        for r in (-4.0, -1.0, -0.4, 0.0, 0.3, 0.9, 1.0, 1.5, 7.0):
            for path in (1e-5, 0.01, 0.3, 1.0, 2.0, 30.0, 1e4, 1e14, 1e18):
                x = law.state()
                x[0] = way * 5.0 * r
                got = way * stepped(law, x, way * 5.0 * path / 1e4, 1e-3) / 5.0

                def residual(u, r=r, path=path, gate=gate):
                    return (u - r - path * (1.0 - gate(u) / gate(1.0) * u)) / (1.0 + path)

                assert min(r, 1.0) - 1e-12 <= got <= max(r, 1.0) + 1e-12
                assert residual(got) == pytest.approx(0.0, abs=1e-9) or path > 1e13


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_leuven_bristle_from_anywhere(way):
    """u = path (1 - sgn |F/s|^n): sharpness of any size, loaded either way, within the bound and beyond."""
    for n in (0.5, 1.0, 2.0, 7.5):
        e = Leuven(stiffness=(1e4, 3e3), share=(0.6, 0.4), sharpness=n)
        law = Law(rate=Coulomb(coulomb=5.0), element=e)
        for first, second in (
            (0.0, 0.0),
            (1.0, -1.0),
            (-3.0, -2.0),
            (2.9, 1.9),
            (3.0, 2.0),
            (-2.0, 1.5),
            (-9.0, -8.0),
        ):
            for path in (1e-7, 1e-5, 1e-4, 4e-4, 3e-3, 1.0, 1e4):
                x = law.state()
                x[:2] = way * first, way * second
                got = way * stepped(law, x, way * path, 1e-3)

                def pulled(dz, first=first, second=second):
                    return sum(
                        min(max(f + k * dz, -w), w) for f, k, w in ((first, 1e4, 3.0), (second, 3e3, 2.0))
                    )

                def residual(u, pulled=pulled, path=path, n=n):
                    F = pulled(u * path) / 5.0
                    return u - 1.0 + copysign(abs(F) ** n, F)

                u = bisected(residual, 0.0, 3.0) if residual(0.0) < 0.0 else 0.0
                assert got == pytest.approx(pulled(u * path), rel=1e-7, abs=1e-7), (first, second, path)


# ------------------------------------------------------------------------------- bounds of nothing, and beyond


EVERY = [e for e in ELEMENT_EXAMPLES.values() if e.states()]


@pytest.mark.parametrize("element", EVERY, ids=lambda e: e.NAME)
def test_under_bounds_of_nothing_nothing_is_carried(element):
    """F = 0 along +q, 3 along -q: what was stretched backwards lets go in forward motion, and stays let go of."""
    law = Law(rate=CoulombViscous(coulomb_positive=0.0, coulomb_negative=3.0), element=element)
    x = law.state()
    for _ in range(600):
        torque = stepped(law, x, -1e-4, 1e-3)
    assert torque == pytest.approx(-3.0, rel=0.2)
    for _ in range(40):
        torque = stepped(law, x, 1e-2, 1e-3)
    assert torque == pytest.approx(0.0, abs=1e-9)
    none = Law(rate=Coulomb(coulomb=0.0), element=element)
    x = none.state()
    for dp in (1e-4, 0.0, -1e-4, 1e-2):
        assert stepped(none, x, dp, 1e-3) == pytest.approx(0.0, abs=1e-12)
    for row in (law, none):
        assert isnan(stepped(row, row.state(), nan, 1e-3))


@pytest.mark.parametrize("element", EVERY, ids=lambda e: e.NAME)
def test_a_speed_beyond_all_measure_counts_as_the_fastest_that_does(element):
    law = Law(rate=Coulomb(coulomb=5.0), element=element)
    for way in (1.0, -1.0):
        one, other = law.state(), law.state()
        fast = stepped(law, one, way * 1e97, 1e-3)
        assert stepped(law, other, way * 1e250, 1e-3) == pytest.approx(fast) and np.isfinite(fast)
        assert other == pytest.approx(one)
    rigid = Law(
        rate=CoulombViscous(
            coulomb_positive=1.0, coulomb_negative=1.0, viscous_positive=1.0, viscous_negative=2.0
        )
    )
    assert stepped(rigid, rigid.state(), 1e250, 1e-3) == pytest.approx(1e100)
    assert stepped(rigid, rigid.state(), -1e250, 1e-3) == pytest.approx(-2e100)
    assert stepped(rigid, rigid.state(), 1e90, 1e-3) == pytest.approx(1e93)


def test_long_pulls_slip_whatever_the_stiffness():
    """Far beyond the bound every spring slips: the torque is the bound's."""
    many = {"stiffness": (1e4, 1e3), "share": (0.7, 0.3)}
    every = (
        LuGre(stiffness=1e5), Dahl(stiffness=1e5), MaxwellSlip(**many), SmoothedMaxwellSlip(**many),
        HaywardArmstrong(stiffness=1e5),
        GMS(**many, attraction=10.0), Leuven(**many), Elastoplastic(stiffness=1e5), XiongKikuuweMulti(**many),
        BlimanSorine(distance=1e-3), ResetIntegrator(stiffness=1e5), Decaying(stiffness=1e5, decay_rate=0.0),
    )  # fmt: skip
    for element in every:
        law = Law(rate=CoulombViscous(coulomb_positive=5.0, coulomb_negative=3.0), element=element)
        for dp in (10.0, 1e13, 1e40):
            for way, F in ((1.0, 5.0), (-1.0, -3.0)):
                x = law.state()
                assert stepped(law, x, way * dp, 1e-3) == pytest.approx(F, rel=2e-3 if dp < 1e3 else 1e-9)


# ------------------------------------------------------------------------------------------ rollouts and lanes


WARM = LoadTemperature(
    coulomb=3.0,
    coulomb_load=0.3,
    stribeck=1.0,
    stribeck_temperature=0.05,
    stribeck_velocity=0.2,
    viscous=0.5,
    viscous_temperature=3.0,
)
DP = np.stack([2e-3 * np.sin(np.arange(40) / 5.0), 1e-3 * np.cos(np.arange(40) / 3.0)], axis=1)


def by_steps(law, dp, dt, load=None, T=None):
    x, n = law.state(), len(dp)
    load = np.zeros((n, 2)) if load is None else load
    T = np.broadcast_to(20.0 if T is None else T, (n,))
    return np.array([stepped(law, x, dp[k], dt, tuple(load[k]), T[k]) for k in range(n)])


def test_a_rollout_is_its_steps_in_every_shape():
    dt, n = 2e-3, len(DP)
    one, two = (
        Law(rate=WARM, element=Dahl(stiffness=1e3)),
        Law(rate=CURVE, element=MaxwellSlip(stiffness=(1e3,), share=(1.0,))),
    )
    Q, V = 0.3 + np.cumsum(DP, axis=0) - DP[0], DP / dt
    dQ = np.vstack([np.zeros(2), DP[1:]])  # the first position is where it rests
    load = np.stack([np.sin(np.arange(n)), np.cos(np.arange(n))], axis=1)
    loads = np.stack([load, 2.0 * load], axis=1)
    T = 20.0 + 30.0 * np.sin(np.arange(n) / 9.0)
    assert rollout(one, dt=dt, dq=V[:, 0]) == pytest.approx(by_steps(one, DP[:, 0], dt))
    assert rollout(one, dt=dt, q=Q[:, 1]) == pytest.approx(by_steps(one, dQ[:, 1], dt))
    got = rollout(one, dt=dt, dq=V, load=load, temperature=T)
    assert got.shape == (n, 2)
    for j in range(2):
        assert got[:, j] == pytest.approx(by_steps(one, DP[:, j], dt, load, T))
    got = rollout([one, two, one], dt=dt, q=Q, load=loads, temperature=35.0, workers=2)
    assert got.shape == (3, n, 2)
    for b, law in enumerate((one, two, one)):
        for j in range(2):
            assert got[b, :, j] == pytest.approx(by_steps(law, dQ[:, j], dt, loads[:, j], 35.0))
    model = FrictionModel(
        joints=tuple(
            JointFriction(joint=Joint(name=f"j{k}"), law=law, validity=Validity(velocity=(-1.0, 1.0)))
            for k, law in enumerate((one, two))
        )
    )
    got = rollout([model], dt=dt, dq=V)
    assert got.shape == (1, n, 2)
    assert rollout(model, dt=dt, dq=V) == pytest.approx(got[0], abs=0.0)
    for j, law in enumerate((one, two)):
        assert got[0, :, j] == pytest.approx(by_steps(law, DP[:, j], dt))
    fast = np.array([1e-3, 0.6e100 * dt, -1e-3, 1e200, nan])[:4]
    assert rollout(one, dt=dt, dq=fast / dt) == pytest.approx(by_steps(one, fast, dt))


def test_a_rollout_says_what_is_wrong_and_where():
    law = Law(rate=CURVE)
    q = np.zeros((4, 2))
    bad = q.copy()
    bad[2, 1], bad[3, 0] = nan, inf
    for arguments, named in (
        ({"q": q, "dq": q}, "either"), ({}, "either"), ({"q": q, "dt": 0.0}, "dt"), ({"q": q, "dt": inf}, "dt"),
        ({"q": q, "dt": "1"}, "dt"), ({"q": q, "dt": -1.0}, "dt"), ({"q": bad}, r"q\[2, 1\] = nan"),
        ({"dq": bad}, r"dq\[2, 1\] = nan"),
        ({"q": [["a", "b"]]}, "no number"), ({"q": np.zeros(0)}, "shape"), ({"q": np.zeros((2, 2, 2))}, "shape"),
        ({"q": 1.0}, "shape"), ({"q": q, "load": np.zeros((3, 2))}, "load"), ({"q": q, "load": np.full((4, 2), nan)}, "load"),
        ({"q": q, "load": np.zeros((4, 3, 2))}, "load"), ({"q": q, "temperature": np.zeros(3)}, "temperature"),
        ({"q": q, "temperature": nan}, "temperature"), ({"q": q, "workers": 0}, "workers"),
    ):  # fmt: skip
        with pytest.raises(InvalidInput, match=named):
            rollout(law, **({"dt": 1e-3} | arguments))
    for model, named in (([], "no model"), ("coulomb", "str"), ([law, 3], "int"), (CURVE, "StribeckGauss")):
        with pytest.raises(InvalidInput, match=named):
            rollout(model, dt=1e-3, q=q)
    model = FrictionModel(
        joints=(JointFriction(joint=Joint(name="a"), law=law, validity=Validity(velocity=(-1.0, 1.0))),)
    )
    with pytest.raises(InvalidInput, match="1 joints, the motion 2"):
        rollout(model, dt=1e-3, q=q)
    for dt in (np.float64(0.5), 1, np.int64(1)):
        assert increments(None, np.array([2.0]), dt).tolist() == [[2.0 * dt]]
    with pytest.raises(InvalidInput, match="2 motions for 1 lanes"):
        Lanes([law]).torque(np.zeros(2), np.zeros((1, 3)), 1e-3)


def test_lanes_of_many_laws_keep_their_places_and_their_states():
    laws = [Law(rate=RATE_EXAMPLES[name]) for name in one_of_a_kind(RATE_EXAMPLES)]
    laws += [Law(rate=CURVE, element=ELEMENT_EXAMPLES[name]) for name in one_of_a_kind(ELEMENT_EXAMPLES)]
    laws.append(laws[1])
    lanes, dt = Lanes(laws), 1e-3
    assert lanes.rates.tolist() == [law.rate.KIND for law in laws]
    assert lanes.elements.tolist() == [law.element.KIND for law in laws]
    assert lanes.states == 2 * max(law.element.states() for law in laws)
    for row, law in zip(lanes.rows, laws, strict=True):
        assert row[: law.row().size].tolist() == law.row().tolist() and not row[law.row().size :].any()
    motion = np.arange(len(laws)) % 2
    state = np.zeros((len(laws), lanes.states))
    for workers in (1, 3, None):
        state[:] = 0.0
        first = lanes.torque(motion, np.ascontiguousarray(DP[:25].T), dt, state=state, workers=workers)
        rest = lanes.torque(motion, np.ascontiguousarray(DP[25:].T), dt, state=state, workers=workers)
        got = np.concatenate([first, rest], axis=1)
        for i, law in enumerate(laws):
            assert got[i] == pytest.approx(by_steps(law, DP[:, motion[i]], dt), rel=1e-12, abs=1e-12)
    assert Lanes([Law(rate=CURVE)]).states == 2


def test_the_cores_of_this_process_are_counted(monkeypatch):
    for cores, wanted in (({0, 3, 5}, 3), ({1}, 1), (set(), 1)):
        monkeypatch.setattr(os, "sched_getaffinity", lambda who, cores=cores: cores, raising=False)
        assert available() == wanted
    monkeypatch.delattr(os, "sched_getaffinity")
    for count, wanted in ((6, 6), (1, 1), (None, 1)):
        monkeypatch.setattr(os, "cpu_count", lambda count=count: count)
        assert available() == wanted


def test_work_is_cut_into_pieces_that_cover_it():
    assert available() >= 1
    for count in (0, 1, 2, 5, 23):
        for workers in (None, 1, 2, 3, 50):
            pieces = []
            spread(lambda a, b, pieces=pieces: pieces.append((a, b)), count, workers)
            pieces.sort()
            assert [k for a, b in pieces for k in range(a, b)] == list(range(count))
            threads = min(available() if workers is None else workers, count)
            assert len(pieces) == (min(count, 2 * threads) if threads > 1 else min(count, 1))
    for wrong in (0, -1):
        with pytest.raises(InvalidInput, match="workers"):
            spread(lambda a, b: None, 3, wrong)

    def fails(a, b):
        raise KeyError("no")

    with pytest.raises(KeyError):
        spread(fails, 3, 2)


# --------------------------------------------------------------------------------------------- axes and drives


def test_the_state_of_an_axis_after_a_step():
    """p, w, q, v and what the transmission carries: of a rigid axis gravity and what accelerates the load."""
    law = Law(
        rate=CoulombViscous(
            coulomb_positive=1.0, coulomb_negative=1.0, viscous_positive=0.5, viscous_negative=0.5
        )
    )
    axis, h, u = Axis(law=law, inertia=0.4, load_inertia=0.6, gravity_cos=2.0, offset=0.3), 1e-2, 9.0
    s = axis.at(0.2, 0.7)
    assert s == pytest.approx([0.2, 0.7, 0.2, 0.7, 2.0 * np.cos(0.2) + 0.3])
    x = law.state()
    of(advance, law)(axis.row(), s, law.rate.KIND, 0, law.row(), x, u, h, 20.0)
    middle = 0.2 + 0.5 * h * 0.7
    g = 2.0 * np.cos(middle) + 0.3
    w = (0.7 + h * (u - g) - h * 1.0) / (1.0 + h * 0.5)
    assert s == pytest.approx([middle + 0.5 * h * w, w, middle + 0.5 * h * w, w, g + 0.6 * (w - 0.7) / h])
    soft = axis.replace(stiffness=50.0, gravity_sin=-1.0)
    q = bisected(lambda q: 50.0 * (q - 0.2) + 2.0 * np.cos(q) - np.sin(q) + 0.3, -1.0, 1.0)
    assert soft.at(0.2) == pytest.approx([0.2, 0.0, q, 0.0, 50.0 * (0.2 - q)])
    assert gravity(axis.row(), 0.5) == pytest.approx(2.0 * np.cos(0.5) + 0.3)
    assert gravity(axis.replace(gravity_cos=0.0, gravity_sin=3.0).row(), 0.5) == pytest.approx(
        3.0 * np.sin(0.5) + 0.3
    )
    assert gravity(axis.replace(gravity_cos=0.0).row(), 0.5) == 0.3
    assert axis.row().tolist() == [0.4, 0.6, 0.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.3]
    other = soft.replace(friction_side="load", damping=0.7, load_dependence=0.1)
    assert other.row().tolist() == [0.4, 0.6, 50.0, 0.7, -1.0, 2.0, 0.0, 1.0, 0.1, 0.3]
    assert Axis(law=law, inertia=1.0, load_dependence=0.0, damping=0.0).drive == DriveModel()


def test_an_element_on_an_axis_is_advanced_by_what_the_axis_moved():
    for element in (
        Dahl(stiffness=1e3),
        GMS(stiffness=(1e3,), share=(1.0,), attraction=50.0),
        ELEMENT_EXAMPLES["none"],
        DeadZone(threshold=1.0),
    ):
        law, h = Law(rate=SIDES, element=element), 1e-3
        x, y = law.state(), law.state()
        known, kinds = of(implicit_velocity, law), (law.rate.KIND, element.KIND)
        v = known(*kinds, law.row(), x, 0.3, h, 1e-3, 0.0, NONE, 20.0)
        assert v == solved(law, law.state(), 0.3, h, 1e-3)
        stepped(law, y, v * h, h)
        n = max(element.states(), 1)
        assert x[:n] == pytest.approx(y[:n])
        for wide, v_free in ((1e2, 0.1), (1e2, -0.1), (1e2, 0.3), (1e2, -0.3)):
            v = known(*kinds, law.row(), law.state(), v_free, h, 1e-3, wide, NONE, 20.0)
            less = copysign(max(abs(v_free) - 0.1, 0.0), v_free)
            assert v == pytest.approx(solved(law, law.state(), less, h, 1e-3), abs=1e-15)


@pytest.mark.parametrize("name", ["lugre", "gms", "decaying", "leuven"])
def test_the_last_trial_leaves_the_very_state_of_a_step(name):
    """Whether the last trial is kept or stepped anew, which depends on how v dt/dt is rounded, no bit of the state shows."""
    law, h, kept = Law(rate=CURVE, element=ELEMENT_EXAMPLES[name]), 1.0 / 3000.0, 0
    x, y, n = law.state(), law.state(), max(law.element.states(), 1)
    known, kinds = of(implicit_velocity, law), (law.rate.KIND, law.element.KIND)
    for v_free in np.random.default_rng(5).uniform(-0.5, 0.5, 60):
        v = known(*kinds, law.row(), x, v_free, h, 2.0 * h, 0.0, NONE, 20.0)
        stepped(law, y, v * h, h)
        kept += v * h / h == v
        assert x[:n].tolist() == y[:n].tolist()
    assert 0 < kept < 60


def test_what_a_law_on_an_axis_sees_is_the_motors_torque_and_what_is_carried():
    """F = 1 + |K_m tau_m - K_e tau_e|: tau_m the drive's torque, tau_e the negative of what the transmission carries."""
    rate = RATE_EXAMPLES["m5"]
    for axis in (
        Axis(law=Law(rate=rate), inertia=0.4, gravity_cos=9.0),
        Axis(law=Law(rate=rate), inertia=0.4, load_inertia=0.5, gravity_cos=9.0, stiffness=1e3),
        Axis(
            law=Law(rate=rate),
            inertia=0.4,
            load_inertia=0.5,
            gravity_cos=9.0,
            stiffness=1e3,
            friction_side="load",
        ),
    ):
        s, h, u, law = axis.at(0.1, 0.8), 1e-3, 5.0, axis.law
        M = 0.4 if axis.friction_side == "motor" else 0.5
        at, load = s.copy(), (u, -s[4])
        of(advance, law)(axis.row(), s, rate.KIND, 0, law.row(), law.state(), u, h, 20.0)
        middle, middle_q = at[0] + 0.5 * h * at[1], at[2] + 0.5 * h * at[3]
        c = 1e3 * (middle - middle_q) if np.isfinite(axis.stiffness) else 9.0 * np.cos(middle)
        net = u - c if axis.friction_side == "motor" else c - 9.0 * np.cos(middle_q)
        v = solved(
            law, law.state(), at[1 if axis.friction_side == "motor" else 3] + h / M * net, h, h / M, load
        )
        assert s[1 if axis.friction_side == "motor" else 3] == pytest.approx(v, rel=1e-12)


def test_small_errors_at_a_small_limit_do_not_wind_up():
    """The integral stands still at the limit, however small both are, and goes on where it leads back."""
    d = DriveModel(controller="velocity", proportional=10.0, integral=50.0, limit=0.01)
    s, h = np.zeros(4), 1e-3
    for _ in range(50):
        assert drive_torque(d.row(), s, 2e-3, nan, 0.0, 0.0, h) == 0.01
    assert s[0] == 0.0
    s[0] = 0.01
    assert (
        drive_torque(d.row(), s, -0.02, nan, 0.0, 0.0, h) == 0.01
    )  # 0.5 - 0.2 against an error that leads back
    assert s[0] == pytest.approx(0.01 - 2e-5)
    s[0] = 0.01
    assert drive_torque(d.row(), s, -0.9, nan, 0.0, 0.0, h) == -0.01
    assert s[0] == pytest.approx(0.01)
    servo = Servo(proportional=10.0, derivative=0.0, integral=50.0)
    s = np.zeros(3)
    for _ in range(50):
        assert servo_tick(servo.row(), 0, s, h, 2e-3, 0.0, 0.0, 0.01) == 0.01
    assert s[0] == 0.0
    s[0] = 0.01
    assert servo_tick(servo.row(), 0, s, h, -0.02, 0.0, 0.0, 0.01) == 0.01
    assert s[0] == pytest.approx(0.01 - 2e-5)


def test_a_drive_along_a_motion_begins_where_that_begins():
    """The reference stands before the log, late or not; velocity and reference begin without a step."""
    n, dt = 30, 2e-3
    r, q = 1.0 + 0.5 * np.sin(np.arange(n) / 4.0), 0.7 + 0.1 * np.cos(np.arange(n) / 5.0)
    for delay in (0.0, 5e-3):
        d = DriveModel(
            controller="position",
            proportional=3.0,
            derivative=0.5,
            integral=2.0,
            filter_time=3e-3,
            delay=delay,
        )
        out = np.empty(n)
        along(d.row(), np.zeros(4), r, np.array([nan]), q, np.zeros(n), dt, out)
        total, v, before, last = 0.0, 0.0, q[0], r[0]
        for k in range(n):
            asked = float(np.interp(k - delay / dt, np.arange(n), r))
            v += dt / (dt + 3e-3) * ((q[k] - before) / dt - v)
            total += dt * (asked - q[k])
            assert out[k] == pytest.approx(
                3.0 * (asked - q[k]) + 0.5 * ((asked - last) / dt - v) + 2.0 * total
            )
            before, last = q[k], asked
    duty = DriveModel(actuator="motor", torque_constant=2.0, resistance=4.0)
    supply = 10.0 + np.arange(n)
    along(duty.row(), np.zeros(4), r, supply, q, np.full(n, 0.5), dt, out)
    assert out == pytest.approx(2.0 * (supply * r - 1.0) / 4.0)
    assert DriveModel().row().tolist() == [0, 1.0, 0, 0, 0, 0, inf, 0, 1.0, 1.0, 1.0, 0, 0, 0, 0]
    full = DriveModel(
        controller="velocity", actuator="motor", gain=2.0, proportional=3.0, derivative=4.0, integral=5.0, filter_time=6.0,
        limit=7.0, supply=8.0, torque_constant=9.0, resistance=10.0, supply_resistance=11.0, saturation=12.0, delay=13.0, hold=True,
    )  # fmt: skip
    assert full.row().tolist() == [2, 2, 3, 4, 5, 6, 7, 1, 8, 9, 10, 11, 12, 13, 1]
    for wrong in ({"controller": "torque"}, {"actuator": "servo"}):
        with pytest.raises(InvalidInput):
            DriveModel(**wrong)


def test_forward_takes_one_start_or_one_an_input_and_channels_of_its_shape():
    axis, n = Axis(law=Law(rate=WARM), inertia=0.2), 6
    r = np.stack([np.full(n, 6.0), np.full(n, -6.0)])
    same = forward([axis] * 2, r, dt=1e-2, position=0.3, velocity=0.1)
    for start in ([0.3], [0.3, 0.3]):
        again = forward([axis] * 2, r, dt=1e-2, position=start, velocity=np.full(len(start), 0.1))
        assert again.position == pytest.approx(same.position, abs=0.0)
    assert isinstance(same, Motions) and same.position.shape == same.velocity.shape == same.torque.shape == (
        2,
        n,
    )
    assert same.torque.tolist() == r.tolist()
    # 20 degC where nothing is said, and the sample's own where it is
    T = np.stack([np.full(n, 20.0), np.linspace(-10.0, 70.0, n)])
    got = forward([axis] * 2, r, dt=1e-2, position=0.3, velocity=0.1, temperature=T, workers=1)
    assert got.position[0] == pytest.approx(same.position[0], abs=0.0)
    v = 0.1
    for k in range(n):
        assert got.velocity[1, k] == pytest.approx(v)
        load = (-6.0, 0.0)
        v = solved(
            axis.law, axis.law.state(), v - 6.0 * 1e-2 / 0.2, 1e-2, 1e-2 / 0.2, (load[0], -0.0), T[1, k]
        )
    assert forward(axis, r[0], dt=1e-2).position.shape == (1, n)
    assert forward(axis, r[0], dt=1e-2).position[0, 0] == 0.0
    assert forward(axis, r[0], dt=1e-2).velocity[0, 0] == 0.0


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_joints_of_a_tick_begin_at_rest_at_20_degrees():
    tick = Tick([Law(rate=WARM), Law(rate=CURVE, element=Dahl(stiffness=1e3))], dt=1e-3)
    assert [x.tolist() for x in (tick.torque, tick.codes, tick.temperature)] == [
        [0.0] * 2,
        [0] * 2,
        [20.0] * 2,
    ]
    assert tick.load.tolist() == [[0.0] * 2] * 2 and tick._states.tolist() == [[0.0] * 2] * 2
    dp = np.array([1e-3, 2e-3])
    for k in range(4):
        got = tick.tick(dp)
        for j, law in enumerate((Law(rate=WARM), Law(rate=CURVE, element=Dahl(stiffness=1e3)))):
            assert got[j] == pytest.approx(by_steps(law, np.full(k + 1, dp[j]), 1e-3)[-1])
    one = Tick(Law(rate=CURVE), dt=1e-3)
    assert one.torque.shape == (1,)
    wild = Tick(
        Law(
            rate=Polyline(velocity=(1.0, 2.0), positive=(1.0, 1e308), negative=(1.0, 2.0)),
            element=Dahl(stiffness=1e3),
        ),
        dt=1e-3,
    )
    wild.tick(np.array([1e-4]))
    before, state = wild.torque.copy(), wild._states[0, 0]
    wild.tick(np.array([1.0]))  # 1000 rad/s: the curve overflows
    assert wild.codes[0] != 0 and wild.torque == before and wild._states[0, 0] == state
