"""Laws as pure functions on arrays, and draws from what was identified."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from backdrive import load_model
from backdrive.engine.tick import Tick
from backdrive.errors import InvalidInput
from backdrive.export import array_functions, arrays
from backdrive.laws import ELEMENTS, RATES, Growth, Law, LuGre, Polyline, StribeckGauss, by_direction
from backdrive.model import Covariance, FrictionModel

DT, N, B = 1e-3, 60, 12
GAUSS = StribeckGauss(**StribeckGauss.EXAMPLE)
KNOTS = dict(velocity=(0.01, 0.1, 0.5, 2.0), positive=(5.0, 4.0, 4.5, 6.0), negative=(4.5, 4.2, 4.4, 5.0))


def every_law() -> list[Law]:
    laws = [Law(rate=rate(**rate.EXAMPLE)) for rate in RATES.values()]
    laws += [Law(rate=GAUSS, element=e(**e.EXAMPLE)) for e in ELEMENTS.values()]
    laws.append(
        Law(rate=Polyline(**KNOTS), growth=Growth(load_driving=0.1, load_driven=0.05, load_carried=2.0))
    )
    return [*laws, Law(rate=by_direction(GAUSS, GAUSS))]


def motion() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(1)
    dp = 1e-3 * np.sin(np.arange(N) / 5.0)[:, None] * np.exp(random.normal(0.0, 1.0, B))
    dp[random.random((N, B)) < 0.1] = 0.0
    return dp, random.normal(0.0, 4.0, (N, B, 2))


@pytest.mark.parametrize("law", every_law(), ids=lambda law: law.name)
def test_every_law_gives_the_kernels_numbers(law):
    dp, load = motion()
    f, tick = arrays.law(law), Tick([law] * B, dt=DT)
    tick.temperature[:] = 35.0
    x, expected, got = f.init(B), [], []
    for k in range(N):
        tick.load[:] = load[k]
        expected.append(tick.tick(dp[k]).copy())
        torque, x = f.step(x, dp[k], DT, load[k], 35.0)
        got.append(torque)
    assert np.abs(np.array(got) - expected).max() <= 1e-12 * np.abs(expected).max()


def test_parameters_may_differ_from_lane_to_lane():
    laws = [
        Law(rate=replace(GAUSS, coulomb=c), element=LuGre(stiffness=k, damping=5.0))
        for c, k in ((3.0, 8e3), (4.0, 2e4))
    ]
    dp, _ = motion()
    f, tick = arrays.law(laws[0]), Tick(laws, dt=DT)
    x, rows = f.init(2), np.array([law.row() for law in laws])
    for k in range(N):
        torque, x = f.step(x, dp[k, :2], DT, row=rows)
        assert np.allclose(torque, tick.tick(dp[k, :2].copy()), rtol=0.0, atol=1e-12)


def test_jax_agrees_and_its_gradients_are_finite():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    dp, load = motion()
    dp[5] = 0.0
    for law in (Law(rate=GAUSS, element=LuGre(**LuGre.EXAMPLE)), Law(rate=Polyline(**KNOTS))):
        plain, f = arrays.law(law), arrays.law(law, xp=jax.numpy)
        step = jax.jit(f.step)
        x, y = plain.init(B), f.init(B)
        for k in range(20):
            a, x = plain.step(x, dp[k], DT, load[k])
            b, y = step(y, dp[k], DT, load[k])
            assert np.allclose(a, b, rtol=0.0, atol=1e-11)

        def total(increments, row, f=f):
            z, out = f.init(B), 0.0
            for k in range(2):
                torque, z = f.step(z, increments[k], DT, row=row)
                out += (torque**2).sum()
            return out

        slopes = jax.jit(jax.grad(total, argnums=(0, 1)))(
            jax.numpy.asarray(dp[4:6]), jax.numpy.asarray(law.row())
        )
        assert all(bool(np.isfinite(s).all()) for s in slopes)


@pytest.mark.parametrize("law", every_law(), ids=lambda law: law.name)
def test_torch_agrees_and_its_gradients_are_finite(law):
    torch = pytest.importorskip("torch")
    dp, load = motion()
    dp[5] = 0.0
    plain, f = arrays.law(law), arrays.law(law, xp=torch)
    x, y, expected, got = plain.init(B), f.init(B), [], []
    for k in range(N):
        a, x = plain.step(x, dp[k], DT, load[k], 35.0)
        b, y = f.step(y, torch.asarray(dp[k]), DT, torch.asarray(load[k]), 35.0)
        expected.append(a)
        got.append(b.numpy())
    assert np.abs(np.array(got) - expected).max() <= 1e-12 * np.abs(expected).max()

    increments, row = (torch.asarray(a).requires_grad_() for a in (dp[4:7], law.row()))
    z, total = f.init(B), 0.0
    for k in range(3):
        torque, z = f.step(z, increments[k], DT, row=row)
        total += (torque**2).sum()
    total.backward()
    assert all(bool(torch.isfinite(each.grad).all()) for each in (increments, row))


def identified() -> FrictionModel:
    model = load_model("preset:mx106/m6")
    names = ("coulomb", "viscous")
    matrix = ((0.04, 0.03), (0.03, 0.09))
    friction = replace(
        model.joints[0],
        law=Law(rate=RATES["m1"](coulomb=5.0, viscous=2.0)),
        standard_errors={"coulomb": 0.2, "viscous": 0.3},
        covariance=Covariance(names=names, matrix=matrix),
    )
    return replace(model, joints=(friction,))


def test_draws_have_the_mean_and_the_covariance_that_was_identified():
    rows = identified().sample(4000, seed=3)
    drawn = rows[:, [1, 5]]
    assert np.allclose(drawn.mean(axis=0), [5.0, 2.0], atol=0.02)
    assert np.allclose(np.cov(drawn.T), [[0.04, 0.03], [0.03, 0.09]], atol=0.006)
    assert np.array_equal(rows, identified().sample(4000, seed=3))


def test_draws_stay_inside_bounds_that_are_near():
    model = identified()
    friction = replace(model.joints[0], law=Law(rate=RATES["m1"](coulomb=5.0, viscous=0.01)), covariance=None)
    rows = replace(model, joints=(friction,)).sample(500)
    assert rows[:, 5].min() >= 0.0
    assert rows[:, 5].max() > 0.3


def test_what_cannot_be_drawn_is_refused():
    model = load_model("preset:mx106/m6")
    with pytest.raises(InvalidInput, match="has no errors"):
        model.sample(3)
    with pytest.raises(InvalidInput, match="draws is 0"):
        identified().sample(0)
    with pytest.raises(InvalidInput, match="joints"):
        FrictionModel(
            joints=(*model.joints, replace(model.joints[0], joint=replace(model.joints[0].joint, name="b")))
        ).sample(3)


def test_drawn_models_differ_joint_by_joint_and_are_the_same_for_the_same_seed():
    one = identified().joints[0]
    model = replace(identified(), joints=(one, replace(one, joint=replace(one.joint, name="other"))))
    first, second = model.draw(2, seed=4)
    assert first == model.draw(3, seed=4)[0]
    laws = [f.law for drawn in (first, second) for f in drawn.joints]
    assert len({law.row().tobytes() for law in laws}) == 4
    assert first.names == model.names


def test_a_state_of_another_shape_is_named():
    f = arrays.law(identified())
    with pytest.raises(InvalidInput, match="tuple of"):
        f.step(np.zeros((3, 1)), np.zeros(3), 1e-3)


def test_a_shorter_way_at_one_number_does_not_hide_a_parameter_from_gradients():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    law = Law(rate=RATES["degressive"](coulomb=4.0, growth=1.5, exponent=0.5))
    f = arrays.law(law, xp=jax.numpy)
    by_row = jax.grad(lambda row: f.step(f.init(()), 2e-4, DT, row=row)[0])(law.row())
    assert by_row[3] == pytest.approx(1.5 * 0.2**0.5 * np.log(0.2), rel=1e-9)  # k v^n ln v


def test_a_search_on_jax_ends_where_that_of_the_kernel_does():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    dp, _ = motion()
    law = Law(rate=GAUSS, element=ELEMENTS["elastoplastic"](**ELEMENTS["elastoplastic"].EXAMPLE))
    plain, f = arrays.law(law), arrays.law(law, xp=jax.numpy)
    assert sum(name == "search" for _, name, _ in f._operations) == 2
    step = jax.jit(f.step)
    x, y = plain.init(B), f.init(B)
    for each in dp[:20]:
        a, x = plain.step(x, each, DT)
        b, y = step(y, each, DT)
        assert np.allclose(a, b, rtol=0.0, atol=1e-11)


def test_exponential_power_and_sine_of_jax_arrays_are_those_of_numpy():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    jnp, random = jax.numpy, np.random.default_rng(2)
    x = random.uniform(-700.0, 0.0, 2000)
    assert np.abs(array_functions.exponential(jnp, jnp.asarray(x)) - np.exp(x)).max() < 1e-15
    x = random.uniform(-3.0, 300.0, 2000)
    assert np.allclose(array_functions.exponential(jnp, jnp.asarray(x)), np.exp(x), rtol=1e-13, atol=0.0)
    x, y = 10.0 ** random.uniform(-9.0, 3.0, 2000), random.uniform(-2.0, 4.0, 2000)
    assert np.allclose(array_functions.power(jnp, jnp.asarray(x), y), x**y, rtol=1e-13, atol=0.0)
    ends = np.asarray(array_functions.exponential(jnp, jnp.array([0.0, -np.inf, np.nan])))
    assert ends[0] == 1.0
    assert ends[1] < 1e-300
    assert np.isnan([ends[2], *np.asarray(array_functions.power(jnp, jnp.array([np.nan, -1.0]), 1.7))]).all()
    x = random.uniform(-9.0, 9.0, 2000)
    assert np.abs(array_functions.sine(jnp, jnp.asarray(x)) - np.sin(x)).max() < 1e-15
    assert jax.grad(lambda x: array_functions.sine(jnp, x))(2.0) == pytest.approx(np.cos(2.0), rel=1e-12)
    single = jnp.ones(3, dtype=jnp.float32)  # of which the bits are others
    assert array_functions.exponential(jnp, single).dtype == jnp.float32
    by_x, by_y = jax.grad(lambda x, y: array_functions.power(jnp, x, y), (0, 1))(0.3, 1.7)
    assert by_x == pytest.approx(1.7 * 0.3**0.7, rel=1e-12)
    assert by_y == pytest.approx(0.3**1.7 * np.log(0.3), rel=1e-12)
