"""A whole arm identified on motion whose torque is the textbook's two-link arm, and the pieces of the fit by brute force."""

from dataclasses import replace

import numpy as np
import pytest

from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.logs.log import Joint, Log

pytest.importorskip("pinocchio")

from backdrive.identification import arm_errors, arm_forecast, arm_signals, arm_solve, arm_terms, regression
from backdrive.identification.arm import identify_arm
from backdrive.identification.arm_checks import beyond_range, remarks
from backdrive.identification.arm_predict import predict_arm, torque_parts, validate_arm
from backdrive.model import FrictionModel
from backdrive.robot import Range, parse_robot

G, L1 = 9.81, 0.5
M = (4.0, 2.5)  # kg
C = (0.22, 0.18)  # m, from joint to center of mass
I = (0.08, 0.04)  # kg.m^2 about it  # noqa: E741
MOTOR = (0.3, 0.15)  # kg.m^2 that the motors add
OFFSET = (0.6, -0.4)
LOAD = (0.08, 0.05)
NAMES = ("lift", "bend")


def link(name, mass, com, inertia):
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><origin xyz="{com} 0 0"/>'
        f'<inertia ixx="0.01" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name, parent, child, x):
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{x} 0 0"/>'
        '<axis xyz="0 -1 0"/><limit effort="1" velocity="1" lower="-9" upper="9"/></joint>'
    )


def description(scale=1.0):
    """A planar arm in the vertical plane, angles from the horizontal; `scale`: by how much its masses are believed."""
    return (
        '<robot name="r"><link name="base"/>' + link("one", M[0] * scale, C[0], I[0] * scale)
        + link("two", M[1] * scale, C[1], I[1] * scale) + joint("lift", "base", "one", 0) + joint("bend", "one", "two", L1)
        + "</robot>"
    )  # fmt: skip


def bodies(q, dq, ddq):
    """Torque of the two-link arm, as textbooks print it, (n, 2)."""
    q1, q2 = q.T
    d1, d2 = dq.T
    a1, a2 = ddq.T
    h = M[1] * L1 * C[1]
    m22 = I[1] + M[1] * C[1] ** 2
    m11 = I[0] + M[0] * C[0] ** 2 + m22 + M[1] * L1**2 + 2.0 * h * np.cos(q2)
    m12 = m22 + h * np.cos(q2)
    g2 = M[1] * C[1] * G * np.cos(q1 + q2)
    g1 = (M[0] * C[0] + M[1] * L1) * G * np.cos(q1) + g2
    one = m11 * a1 + m12 * a2 - h * np.sin(q2) * (2.0 * d1 * d2 + d2**2) + g1
    two = m12 * a1 + m22 * a2 + h * np.sin(q2) * d1**2 + g2
    return np.column_stack([one, two])


def curve(j, v):
    """Friction by direction: a falling start, then viscous."""
    speed = np.abs(v)
    F = (4.0, 2.0)[j] + (1.5, 0.8)[j] * np.exp(-speed / 0.15) + (2.0, 1.0)[j] * speed
    return F * np.sign(v)


def made(seconds=50.0, rate=100.0, noise=0.05, seed=0, sign=1.0, order=(0, 1), gear=None, load=LOAD):
    t = np.arange(round(seconds * rate)) / rate
    q, dq, ddq = np.zeros((3, t.size, 2))
    tones = (
        ((0.11, 0.7, 0.3), (0.29, 0.35, 1.0), (0.83, 0.08, 2.0)),
        ((0.17, 0.8, 0.9), (0.41, 0.3, 0.1), (1.1, 0.06, 0.7)),
    )
    for j, of in enumerate(tones):
        for hertz, size, phase in of:
            w = 2.0 * np.pi * hertz
            q[:, j] += size * np.sin(w * t + phase)
            dq[:, j] += size * w * np.cos(w * t + phase)
            ddq[:, j] -= size * w * w * np.sin(w * t + phase)
    rigid = bodies(q, dq, ddq)
    tau = rigid + np.array(MOTOR) * ddq + OFFSET
    for j in range(2):
        tau[:, j] += curve(j, dq[:, j]) + load[j] * np.abs(rigid[:, j]) * np.sign(dq[:, j])
    tau += noise * np.random.default_rng(seed).standard_normal(tau.shape)
    joints = tuple(
        Joint(name=NAMES[j], torque_side="motor" if gear else "joint", gear_ratio=gear or 1.0) for j in order
    )
    return Log(time=t, joints=joints, position=q[:, order], torque=sign * tau[:, order] / (gear or 1.0))


@pytest.fixture(scope="module")
def robot():
    return parse_robot(description())


@pytest.fixture(scope="module")
def found(robot):
    return identify_arm(made(), robot)


def test_the_description_is_the_textbooks_arm(robot):
    q, dq, ddq = np.random.default_rng(1).uniform(-2.0, 2.0, (3, 30, 2))
    assert robot.inverse_dynamics(q, dq, ddq) == pytest.approx(bodies(q, dq, ddq), abs=1e-9)


def test_friction_of_a_whole_arm_comes_back(found):
    frictions, _, arm = found
    for j, friction in enumerate(frictions):
        v = np.array([0.1, 0.3, 0.6, 1.0, -0.1, -0.3, -0.6, -1.0]) * (1.0, 1.1)[j]
        assert friction.law.torque(v) == pytest.approx(curve(j, v), rel=0.05)
        value = {name: e.value for name, e in friction.dynamics.items()}
        error = {name: e.standard_error for name, e in friction.dynamics.items()}
        value, error = value | friction.law.growth.values(), error | dict(friction.standard_errors)
        assert value["load_driven"] == value["load_driving"] and value["load_carried"] == 0.0
        for name, truth in (("inertia", MOTOR[j]), ("offset", OFFSET[j]), ("load_driving", LOAD[j])):
            assert abs(value[name] - truth) < max(5.0 * error[name], 0.02), name
            if (j, name) != (
                0,
                "inertia",
            ):  # which is that of the first link as well, and no motion tells them apart
                assert 0.0 < error[name] < 0.2 * max(abs(truth), 0.2), name
        assert friction.held_out.residual < 3.5 and friction.fitted.residual < 3.5
        assert 0.2 < friction.held_out.samples / (friction.held_out.samples + friction.fitted.samples) < 0.35
        assert (friction.joint.name, friction.method, friction.dynamics["inertia"].unit) == (
            NAMES[j],
            "arm",
            "kg.m^2",
        )
        assert friction.dynamics["transition"].value == pytest.approx(
            0.002 * friction.validity.velocity[1], rel=1e-6
        )
    assert arm.condition < 100.0 and len(arm.parameters) == 20


def test_what_an_arm_predicts_is_the_textbook_again(found, robot):
    frictions, shown, arm = found
    model = FrictionModel(joints=frictions, arm=arm)
    fresh = made(seconds=20.0, seed=9)
    predicted = predict_arm(model, fresh, robot)
    inner = slice(100, -100)
    off = (predicted - fresh.torque)[inner]
    assert np.all(
        np.sqrt(np.mean(off**2, axis=0)) < (0.35, 0.3)
    )  # reversals, of which the filters see little, included
    assert np.median(np.abs(off), axis=0) == pytest.approx([0.05, 0.05], abs=0.03)
    judged = validate_arm(model, [fresh], robot)
    assert all(judged[name].residual < 5.0 and judged[name].samples == 2000 for name in NAMES)
    (s,) = arm_signals.prepare_arm(fresh, robot)
    total, rest = torque_parts(s, robot, arm, frictions)
    rigid = bodies(s.position, s.velocity, s.acceleration)
    for j in range(2):
        v, a = s.velocity[:, j], s.acceleration[:, j]
        wanted = rigid[:, j] + MOTOR[j] * a + OFFSET[j] + LOAD[j] * np.abs(rigid[:, j]) * np.sign(v)
        assert np.abs(rest[:, j] - wanted)[inner].mean() < 0.2
        smooth = np.abs(np.tanh(v / frictions[j].dynamics["transition"].value))
        assert (total - rest)[:, j] == pytest.approx(smooth * frictions[j].law.torque(v))
    still = replace(s, velocity=np.zeros_like(s.velocity))
    held = torque_parts(still, robot, arm, frictions)
    assert np.isfinite(held[0]).all() and held[0] == pytest.approx(held[1])  # at rest no friction is expected
    samples = shown[0].samples
    assert samples.fitted.mean() == pytest.approx(0.7, abs=0.1) and np.abs(samples.friction).max() < 12.0
    for broken, said in (
        (replace(model, arm=None), "whole arm"), (replace(model, arm=replace(arm, urdf_sha256="0" * 64)), "another robot"),
        (replace(model, arm=replace(arm, parameters=arm.parameters[:10])), "10 rigid-body"),
    ):  # fmt: skip
        with pytest.raises(InvalidInput, match=said):
            predict_arm(broken, fresh, robot)


def test_the_order_of_joints_the_side_of_the_gear_and_a_wrong_description_do_not_matter(found):
    other, _, _ = identify_arm(
        [made(order=(1, 0), gear=50.0)], parse_robot(description(1.3)), held_out=[made(seconds=10.0, seed=4)]
    )
    assert [f.joint.name for f in other] == ["bend", "lift"]
    for friction, j in zip(other, (1, 0), strict=True):
        v = np.array([0.3, 0.8, -0.3, -0.8])
        assert friction.law.torque(v) == pytest.approx(curve(j, v), rel=0.06)
        assert friction.held_out.samples == 1000 and friction.held_out.residual < 5.0
    without, _, _ = identify_arm(made(), parse_robot(description()), load_friction=False)
    assert all(f.law.growth is None for f in without)


def test_what_is_no_arm_is_refused(robot):
    log = made(seconds=10.0)
    with pytest.raises(NotIdentifiable, match="lift, bend"):
        identify_arm(made(sign=-1.0), robot)
    whole = made()
    one = whole.replace(torque=whole.torque * [1.0, -1.0])
    with pytest.raises(NotIdentifiable, match="push instead of brake in bend:"):
        identify_arm(one, robot)
    with pytest.raises(InvalidInput, match="needs torque"):
        identify_arm(log.replace(torque=None), robot)
    with pytest.raises(InvalidInput, match="no log"):
        identify_arm([], robot)
    with pytest.raises(InvalidInput, match="is in m in the log"):
        identify_arm(log.replace(joints=tuple(replace(j, unit="m") for j in log.joints)), robot)
    with pytest.raises(InvalidInput, match="NaN"):
        identify_arm(log.replace(torque=np.where(np.arange(1000)[:, None] == 7, np.nan, log.torque)), robot)
    with pytest.raises(InvalidInput, match="does not increase"):
        identify_arm(log.replace(time=np.where(np.arange(1000) == 7, 0.0, log.time)), robot)
    with pytest.raises(InvalidInput, match=r"\[50, 100\] Hz"):
        identify_arm([made(), made(rate=50.0)], robot)
    with pytest.raises(NotIdentifiable, match="too few for"):
        identify_arm(log.rows(slice(0, 150)), robot)
    with pytest.raises(NotIdentifiable, match="No stretch"):
        identify_arm(log.rows(slice(0, 90)), robot)


# -------------------------------------------------------------------------------------------- signals


def test_signals_of_an_arm_on_a_thinned_clock(robot):
    (s,) = arm_signals.prepare_arm(made(seconds=10.0, rate=500.0, noise=0.0), robot)
    t = s.time
    assert s.rate == pytest.approx(125.0) and t.size == 1250
    q = (
        0.7 * np.sin(2 * np.pi * 0.11 * t + 0.3)
        + 0.35 * np.sin(2 * np.pi * 0.29 * t + 1.0)
        + 0.08 * np.sin(2 * np.pi * 0.83 * t + 2.0)
    )
    inner = slice(60, -60)
    assert s.position[inner, 0] == pytest.approx(q[inner], abs=2e-5)
    assert np.gradient(q, t)[inner] == pytest.approx(s.velocity[inner, 0], abs=2e-3)
    assert np.gradient(s.velocity[:, 0], t)[inner] == pytest.approx(s.acceleration[inner, 0], abs=2e-2)
    log = made(seconds=10.0, noise=0.0)
    time = log.time.copy()
    time[400:] += 0.0245  # 3.45 periods: still one stretch
    time[700:] += 0.03
    pieces = arm_signals.prepare_arm(log.replace(time=time), robot)
    assert [p.time.size for p in pieces] == [702, 300]
    time[905:] += 0.5  # what follows is too short, and left out
    assert [p.time.size for p in arm_signals.prepare_arm(log.replace(time=time), robot)] == [702, 205]
    jittered = time[:400] + 0.001 * np.sin(np.arange(400))
    exact = lambda x: 0.7 * np.sin(2 * np.pi * 0.11 * x + 0.3) + 0.35 * np.sin(2 * np.pi * 0.29 * x + 1.0)  # noqa: E731
    position = np.column_stack([exact(jittered), exact(jittered)])
    (s,) = arm_signals.prepare_arm(log.rows(slice(0, 400)).replace(time=jittered, position=position), robot)
    assert s.position[50:-50, 0] == pytest.approx(exact(s.time)[50:-50], abs=1e-5)
    pushed = log.replace(external_torque=np.full((1000, 2), 2.5))
    assert arm_signals.prepare_arm(pushed, robot)[0].torque == pytest.approx(log.torque + 2.5)


def test_a_quarter_is_held_out_with_seams(robot):
    (s,) = arm_signals.hold_out_blocks(arm_signals.prepare_arm(made(seconds=16.0, noise=0.0), robot))
    n, seam = 1600, 50  # half a second
    held = (np.arange(n) * 8 // n) % 4 == 3
    near = np.array([held[max(i - seam, 0) : i + seam + 1].any() for i in range(n)])
    assert np.array_equal(s.held_out, held) and np.array_equal(s.fitted, ~near)
    (all_,) = arm_signals.hold_out_all([s])
    assert all_.held_out.all() and not all_.fitted.any()


def test_rests_are_marked_with_a_margin():
    rate, v = 100.0, np.ones((1000, 2))
    v[200:219, 0], v[400:421, 0], v[950:, 1] = 0.009, 0.009, -0.0099  # 0.19 s, 0.21 s, up to the end
    v[600:700, 1] = 0.011
    got = arm_signals.resting(v, np.array([1.0, 1.0]), rate)
    assert np.flatnonzero(got[:, 0]).tolist() == list(range(390, 431))
    assert np.flatnonzero(got[:, 1]).tolist() == list(range(940, 1000))


# ---------------------------------------------------------------------------------------- terms and rows


def test_knots_lie_at_quantiles_raised_to_a_power():
    speed = np.random.default_rng(3).uniform(0.0, 2.0, 20000)
    t = arm_terms.terms_of(speed)
    assert t.knots == pytest.approx(np.r_[0.0, np.quantile(speed, 0.99 * (np.arange(1, 8) / 7.0) ** 1.3)])
    assert (t.top, t.transition, t.size) == (speed.max(), 0.002 * speed.max(), 19)
    bunched = arm_terms.terms_of(np.r_[np.full(9000, 0.5), np.full(600, 0.504), np.full(400, 1.0)])
    assert bunched.knots.tolist() == [0.0, 0.5, 1.0] and bunched.top == pytest.approx(1.001)
    still = arm_terms.terms_of(np.empty(0))
    assert (still.knots.tolist(), still.top, still.transition) == ([0.0, 1.0], 1.1, 0.002)


def test_columns_of_a_joint_written_out():
    t = arm_terms.Terms(knots=np.array([0.0, 0.5, 1.0]), top=1.2, transition=0.01)
    v, a, load = (
        np.array([0.25, -0.75, 1.1, 0.0, 0.005]),
        np.array([1.0, 2.0, 3.0, 4.0, 5.0]),
        np.array([-3.0, 2.0, 1.0, 5.0, -4.0]),
    )
    got = t.columns(v, a, load)
    sign = np.tanh(v / 0.01)
    F = np.array([3.0, 1.0, 2.0])
    up = np.interp(np.abs(v), t.knots, F)  # constant above the last knot
    assert got[:, :3] @ F == pytest.approx(up * np.maximum(sign, 0.0))
    assert got[:, 3:6] @ F == pytest.approx(up * np.minimum(sign, 0.0))
    assert got[:, 6:] == pytest.approx(np.column_stack([np.ones(5), a, np.abs(load) * sign]))
    assert not t.columns(v, a, None)[:, -1].any()


def test_rows_of_a_fit_are_the_filtered_columns_thinned(robot, monkeypatch):
    from backdrive.logs.filters import low_pass

    (s,) = arm_signals.prepare_arm(made(seconds=60.0), robot)
    terms = [arm_terms.terms_of(np.abs(s.velocity[:, j])) for j in range(2)]
    regressor = arm_terms.Regressor(robot, [s])
    assert arm_terms.steps_of([s]) == 5  # 100 Hz to 20 Hz
    rows = arm_terms.build(regressor, terms)
    beta = robot.base.relation @ robot.parameters
    assert rows.rate == pytest.approx(20.0) and rows.torque.shape == (1200, 2)
    rigid = bodies(s.position, s.velocity, s.acceleration)
    wanted = low_pass(rigid, 5.0, s.rate)[::5]
    assert rows.bodies @ beta == pytest.approx(wanted, abs=1e-6)
    assert rows.torque == pytest.approx(low_pass(s.torque, 5.0, s.rate)[::5])
    assert regressor.bodies(0, beta) == pytest.approx(rigid, abs=1e-8)
    arm_terms.fill_load(rows, regressor, terms, beta)
    for j in range(2):
        own = terms[j].columns(s.velocity[:, j], s.acceleration[:, j], rigid[:, j])
        assert rows.friction[j] == pytest.approx(low_pass(own, 5.0, s.rate)[::5], abs=1e-6)
    use = np.ones(6000, bool)
    use[:25] = use[-25:] = False
    rest = arm_signals.resting(s.velocity, np.array([t.top for t in terms]), s.rate)
    assert np.array_equal(rows.weight, (use[:, None] & ~rest)[::5])
    monkeypatch.setattr(arm_terms, "CHUNK", 1700)  # in pieces with margins: the same
    pieces = arm_terms.build(arm_terms.Regressor(robot, [s]), terms)
    for a, b in ((pieces.bodies, rows.bodies), (pieces.friction[1][:, :-1], rows.friction[1][:, :-1])):
        assert a == pytest.approx(b, abs=1e-3)
    arm_terms.fill_load(pieces, arm_terms.Regressor(robot, [s]), terms, beta)
    assert pieces.friction[0][:, -1] == pytest.approx(rows.friction[0][:, -1], abs=1e-2)


# ------------------------------------------------------------------------------------------- the solver


def quadratic(seed, n=6):
    generator = np.random.default_rng(seed)
    root = generator.standard_normal((20, n)) * 10.0 ** generator.uniform(-2, 2, n)
    return root.T @ root, root.T @ generator.standard_normal(20)


def test_a_bounded_minimum_is_the_best_of_all_sets_of_active_bounds():
    for seed in range(6):
        gram, moment = quadratic(seed, 4)
        free = np.linalg.solve(gram, moment)
        low, high = (
            np.where([True, False, True, False], 0.0, -np.inf),
            np.where(np.arange(4) == 3, 0.4 * abs(free[3]), np.inf),
        )
        got = arm_solve._minimise_within(gram, moment, low, high)
        best, cost = None, np.inf
        for code in range(3**4):
            held = [(code // 3**i) % 3 for i in range(4)]
            at = np.array([np.nan if h == 0 else low[i] if h == 1 else high[i] for i, h in enumerate(held)])
            if np.isinf(at).any():
                continue
            open_ = np.isnan(at)
            x = np.where(open_, 0.0, at)
            if open_.any():
                x[open_] = np.linalg.solve(
                    gram[np.ix_(open_, open_)], moment[open_] - gram[np.ix_(open_, ~open_)] @ x[~open_]
                )
            value = 0.5 * x @ gram @ x - moment @ x
            if np.all(x >= low - 1e-9) and np.all(x <= high + 1e-9) and value < cost:
                best, cost = x, value
        assert got == pytest.approx(best, rel=1e-5, abs=1e-8)


def refits(X, y, block, held, start, kept):
    """Return ridge fits of some columns without each block, and that of all rows, by plain loops, (B + 1, k)."""
    fits = []
    for out in [*range(block.max() + 1), -1]:
        rows = block != out
        gram = X[rows].T @ X[rows] + held
        moment = X[rows].T @ (y[rows] - X[rows] @ start)
        inner = np.ix_(kept, kept)
        offset = np.where(kept, 0.0, -start)  # what is at a bound stays at zero
        step = np.linalg.solve(gram[inner], (moment - gram @ offset)[kept])
        fits.append(start[kept] + step)
    return np.array(fits)


def brute_force_errors(X, y, block, held, start, free):
    """Return covariance of the free coefficients, and error and pull of each that is at the bound of zero and let go alone."""
    p, B = X.shape[1], block.max() + 1
    fits = refits(X, y, block, held, start, free)
    change, total = fits[:-1] - fits[-1], X.T @ X + held
    widen = (B - 1) / B * (1.0 + 1.22 / (B - 1)) ** 2
    jack, V = widen * change.T @ change, np.linalg.inv(total[np.ix_(free, free)])
    gram = (X.T @ X)[np.ix_(free, free)]
    even = np.trace(np.linalg.inv(V) @ jack) / np.trace(V @ gram)
    covariance = 0.8 * jack + 0.2 * even * V @ gram @ V + V @ held[np.ix_(free, free)] @ V
    errors, pushed = np.zeros(p), np.zeros(p)
    for i in np.flatnonzero(~free):
        loose = free.copy()
        loose[i] = True
        place = int(loose[:i].sum())
        own = refits(X, y, block, held, start, loose)[:, place]
        V = np.linalg.inv(total[np.ix_(loose, loose)])
        rest = (V @ (0.2 * even * X.T @ X + held)[np.ix_(loose, loose)] @ V)[place, place]
        errors[i] = np.sqrt(0.8 * widen * np.sum((own[:-1] - own[-1]) ** 2) + rest)
        pushed[i] = max(-own[-1] / errors[i], 0.0)
    return covariance, errors, pushed


@pytest.mark.parametrize("bound", [(), (2, 5)])
def test_errors_are_those_of_refits_without_a_block_each(bound):
    generator = np.random.default_rng(3)
    X, block = generator.standard_normal((240, 6)), np.arange(240) // 24
    X[:, 4] += 3.0 * X[:, 1]
    y = X @ [1.0, -2.0, 0.0, 0.5, 1.0, 0.0] + np.repeat(generator.standard_normal(60), 4)
    held, start = np.diag(np.arange(1.0, 7.0)), np.array([0.5, 0.0, 0.0, 0.0, 0.2, 0.0])
    free = ~np.isin(np.arange(6), bound)
    x = np.zeros(6)
    x[free] = refits(X, y, block, held, start, free)[-1]
    left = y - X @ x
    blocks = regression.accumulate(X, left, np.ones(240), block, 10)
    got = arm_errors.errors_of_fit(blocks, held, held @ (start - x), free)
    covariance, errors, pushed = brute_force_errors(X, y, block, held, start, free)
    assert got.covariance[np.ix_(free, free)] == pytest.approx(covariance, rel=1e-6, abs=1e-12)
    assert not got.covariance[~free].any() and not got.covariance[:, ~free].any()
    assert got.loose == pytest.approx(errors, rel=1e-6) and got.pushed == pytest.approx(
        pushed, rel=1e-6, abs=1e-9
    )
    assert np.count_nonzero(errors) == len(bound) and np.linalg.eigvalsh(covariance)[0] > 0.0


def test_blocks_are_five_seconds_and_neither_few_nor_many():
    assert np.bincount(arm_errors.blocks_of(2000, 20.0)).tolist() == [100] * 20
    assert arm_errors.blocks_of(100, 20.0).max() == 7 and arm_errors.blocks_of(10**6, 20.0).max() == 127


def wandering(seed, seconds=60.0):
    """A log whose friction wanders by 5 % within 3 s, as it does with temperature and grease."""
    log, generator = (
        made(seconds=seconds, noise=0.02, seed=seed, load=(0.0, 0.0)),
        np.random.default_rng(seed + 500),
    )
    level, keep = np.zeros((len(log), 2)), np.exp(-1.0 / 300.0)
    for k in range(1, len(log)):
        level[k] = keep * level[k - 1] + np.sqrt(1.0 - keep**2) * generator.standard_normal(2)
    velocity = np.gradient(log.position, log.time, axis=0)
    friction = np.column_stack([curve(j, velocity[:, j]) for j in range(2)])
    return log.replace(torque=log.torque + 0.05 * level * friction)


def test_stated_errors_hold_what_friction_that_wanders_does(robot):
    """By the scatter of what comes out over logs, not by any formula."""
    values, errors = [], []
    for seed in range(24):
        frictions, shown, _ = identify_arm(wandering(seed), robot, load_friction=False)
        said = [p for one in shown for p in one.precision]
        errors.append([p.achieved for p in said])
        own = []
        for rate in (f.law.rate for f in frictions):
            v = np.array(rate.velocity)
            pick = np.flatnonzero(v[:-1] >= 0.05 * v[-1])  # where the joint slides
            mean = 0.5 * (np.array(rate.positive) + np.array(rate.negative))[pick]
            own.append(np.polyfit(v[pick], mean, 1)[::-1])
        values.append([dict(coulomb=own[j][0], viscous=own[j][1], offset=f.dynamics["offset"].value)[name]
                       for j, f in enumerate(frictions) for name in ("coulomb", "viscous", "offset")])  # fmt: skip
    names = [p.name for one in shown for p in one.precision]
    stated = np.sqrt(np.mean(np.square(errors), axis=0))[
        [n in ("coulomb", "viscous", "offset") for n in names]
    ]
    scatter = np.std(values, axis=0, ddof=1)
    assert np.all(scatter < 1.5 * stated) and np.all(scatter > 0.3 * stated), scatter / stated
    assert np.mean(scatter / stated) > 0.55  # with the long-run variance of the residual, offsets were 0.47


def test_correlated_residuals_count_for_less():
    generator = np.random.default_rng(4)
    error = np.convolve(generator.standard_normal(400), np.ones(4) / 4.0, "same")
    lags = 20  # two seconds at 10 Hz
    c = [float(error[: 400 - k] @ error[k:]) for k in range(lags + 1)]
    expected = 1.0 + 2.0 * sum((1.0 - k / (lags + 1.0)) * c[k] / c[0] for k in range(1, lags + 1))
    assert arm_solve.correlation_length(error, 10.0) == pytest.approx(expected, rel=1e-9)
    assert arm_solve.correlation_length(np.tile([1.0, -1.0], 50), 10.0) == 1.0
    assert arm_solve.correlation_length(np.zeros(50), 10.0) == 1.0
    to_and_fro = np.tile([1.0, -0.1], 50)  # neighbours disagree, and what is two apart agrees
    c = [float(to_and_fro[: 100 - k] @ to_and_fro[k:]) for k in range(21)]
    expected = 1.0 + 2.0 * sum((1.0 - k / 21.0) * c[k] / c[0] for k in range(1, 21))
    assert (
        arm_solve.correlation_length(to_and_fro, 10.0) == pytest.approx(expected)
        and expected > 2.0
        and c[1] < 0.0
    )
    few = np.array([1.0, 2.0, 1.0, 0.5])
    short = 1.0 + 2.0 * sum((1.0 - k / 4.0) * (few[: 4 - k] @ few[k:]) / (few @ few) for k in range(1, 4))
    assert arm_solve.correlation_length(few, 10.0) == pytest.approx(short) and short > 1.5
    slow = np.array([1.0, 1.0, 1.0, 0.5, 0.2])
    assert arm_solve.correlation_length(slow, 0.1) == pytest.approx(
        1.0 + 2.0 * 0.5 * (slow[:-1] @ slow[1:]) / (slow @ slow)
    )
    assert arm_solve._noise(np.array([1.0, -2.0, 3.0, 50.0]), np.array([1.0, 1, 1, 0]), 7.0) == pytest.approx(
        1.4826 * 2.0
    )
    assert arm_solve._noise(np.zeros(4), np.ones(4), 7.0) == pytest.approx(7e-6)
    assert arm_solve._noise(np.zeros(4), np.zeros(4), 7.0) == 7.0
    assert arm_solve._rms(np.array([3.0, 4.0, 9.0]), np.array([1.0, 1.0, 0.0])) == pytest.approx(
        np.sqrt(12.5)
    )
    assert arm_solve._rms(np.ones(2), np.zeros(2)) == arm_solve._rms(np.zeros(2), np.ones(2)) == 1.0


def rows_for(robot):
    (s,) = arm_signals.prepare_arm(made(seconds=20.0), robot)
    terms = [arm_terms.terms_of(np.abs(s.velocity[:, j])) for j in range(2)]
    return arm_terms.build(arm_terms.Regressor(robot, [s]), terms), terms


def test_normal_equations_and_priors_written_out(robot):
    rows, terms = rows_for(robot)
    b = rows.bodies.shape[2]
    sizes = [t.size for t in terms]
    first = b + np.array([0, sizes[0], sum(sizes)])
    start, precision = arm_solve._prior(rows, robot, terms, np.array([5.0, 2.0]))
    weight = np.random.default_rng(5).uniform(0.0, 1.0, rows.weight.shape) * rows.weight
    gram, moment = np.zeros_like(precision), np.zeros(first[-1])
    for j in range(2):
        X = np.zeros((rows.torque.shape[0], first[-1]))
        X[:, :b], X[:, first[j] : first[j + 1]] = rows.bodies[:, j], rows.friction[j]
        W = X * weight[:, j, None]
        own = W.T @ X, W.T @ (rows.torque[:, j] - X @ start)
        gram, moment = gram + own[0], moment + own[1]
        assert arm_solve._predict(rows, first, start + 0.1)[:, j] == pytest.approx(X @ (start + 0.1))
    got = arm_solve._normal(rows, first, weight, start)
    assert got[0] == pytest.approx(gram, rel=1e-9, abs=1e-9) and got[1] == pytest.approx(
        moment, rel=1e-9, abs=1e-9
    )
    relation = robot.base.relation
    assert start[:b] == pytest.approx(relation @ robot.parameters) and not start[b:].any()
    mass, length = M[0] + M[1], 0.5 * (0.0 + L1)
    spread = np.tile(mass * length ** np.array([0.0, 1, 1, 1, 2, 2, 2, 2, 2, 2]), 2)
    assert arm_solve.spread_of(robot) == pytest.approx(spread)
    assert np.linalg.inv(precision[:b, :b]) == pytest.approx(
        (relation * spread**2) @ relation.T, rel=1e-6, abs=1e-12
    )
    for j, (t, scale) in enumerate(zip(terms, (5.0, 2.0), strict=True)):
        k, own = t.knots.size, precision[first[j] : first[j + 1], first[j] : first[j + 1]]
        F = np.random.default_rng(6).standard_normal(t.size)
        cost = 0.0
        for side in (F[:k], F[k : 2 * k]):
            slope = np.diff(side) / np.diff(t.knots)
            bend, width = np.diff(slope), 0.5 * (t.knots[2:] - t.knots[:-2])
            cost += np.sum(bend**2 * width) * t.knots[-1] / 0.3**2 + np.sum(side**2) / 3.0**2
        cost += np.sum((F[:k] - F[k : 2 * k]) ** 2) / 0.05**2
        used = rows.weight[:, j] > 0
        brisk = np.sqrt(np.mean(rows.friction[j][used, 2 * k + 1] ** 2))
        cost = (
            cost / scale**2
            + F[2 * k] ** 2 / scale**2
            + (brisk * F[2 * k + 1] / scale) ** 2
            + (F[2 * k + 2] / 0.3) ** 2
        )
        assert F @ own @ F == pytest.approx(cost, rel=1e-8)
        alike = arm_solve._alike(gram, first, terms)[first[j] : first[j + 1], first[j] : first[j + 1]]
        strong = 1e4 * np.diag(gram)[first[j] : first[j] + 2 * k].sum()
        slides = np.flatnonzero(t.knots >= 0.05 * t.top)
        apart = F[slides].mean() - F[k + slides].mean()
        assert F @ alike @ F == pytest.approx(strong * apart**2, rel=1e-8)
    low, high = arm_solve._bounds(b, terms, np.array([True, False]))
    assert np.isinf(low[:b]).all() and np.isinf(high[:-1][:b]).all()
    for j, most in ((0, 1.0), (1, 1e-12)):
        own_low, own_high = low[first[j] : first[j + 1]], high[first[j] : first[j + 1]]
        assert own_low[-3] == -np.inf and not np.delete(own_low, -3).any()
        assert own_high[-1] == most and np.isinf(own_high[:-1]).all()


def test_remarks_name_what_is_suspect(robot):
    rows, terms = rows_for(robot)
    b = rows.bodies.shape[2]
    k = terms[0].knots.size

    def said(j=0, weight=None, own=None, pushed=None, told=None, condition=10.0, of=terms, with_robot=robot):
        good = [np.r_[np.full(2 * t.knots.size, 4.0), 0.1, 0.2, 0.1] for t in terms]
        none = [np.zeros(t.size) for t in terms]
        solution = arm_solve.Solution(
            beta=np.zeros(b), own=[good[0] if own is None else own, good[1]], errors=none,
            pushed=[none[0] if pushed is None else pushed, none[1]], told=np.ones(b) if told is None else told, condition=condition,
        )  # fmt: skip
        return remarks(with_robot, of, rows if weight is None else replace(rows, weight=weight), solution)[j]

    assert said() == () and said(1) == ()
    theta = np.where(np.arange(robot.parameters.size) < 10, robot.parameters, 0.0)
    empty = replace(robot)
    empty.__dict__["parameters"] = theta
    assert said(with_robot=empty) == () and "no mass or inertia" in said(1, with_robot=empty)[0]
    own = np.r_[np.full(2 * k, 4.0), 0.1, 0.2, 0.1]
    for offset, count in ((1.19, 0), (1.21, 1), (-1.21, 1)):
        changed = own.copy()
        changed[2 * k] = offset
        assert len(said(own=changed)) == count
    for place in (0, 2 * k - 1, 2 * k + 1):
        for size, count in ((2.9, 0), (3.1, 1)):
            pushed = np.zeros(own.size)
            pushed[place] = size
            assert len(said(pushed=pushed)) == count
    full = own.copy()
    full[-1] = 1.0
    assert "100 %" in said(own=full)[0]
    assert (
        "excites the bodies poorly" in said(condition=1001.0)[0]
        and said(condition=999.0) == ()
        and said(1, condition=1e9) == ()
    )
    guess = np.where(np.arange(b) == 0, 0.49, 1.0)
    column = int(robot.base.columns[0] // 10)
    assert "1 of" in said(column, told=guess)[0] and said(1 - column, told=guess) == ()
    still = rows.weight.copy()
    still[:, 0] = 0.0
    assert "never moves" in said(weight=still)[0]
    one_way = rows.weight.copy()
    one_way[rows.friction[0][:, :k].sum(axis=1) < 0.0, 0] = 0.0
    one_way[rows.friction[0][:, k : 2 * k].sum(axis=1) < 0.0, 0] = 0.0
    assert any("one direction" in w for w in said(weight=one_way))
    for share, count in ((0.09, 1), (0.11, 0)):  # of the moving time
        either = np.zeros((rows.weight.shape[0], terms[0].size))
        either[:, 0], either[: round(share * len(either)), 0] = 1.0, 0.0
        either[: round(share * len(either)), k] = -1.0
        for columns in (either, np.hstack([-either[:, k : 2 * k], -either[:, :k], either[:, 2 * k :]])):
            moved = replace(rows, friction=[columns, rows.friction[1]], weight=np.ones_like(rows.weight))
            good = np.r_[np.full(2 * k, 4.0), 0.1, 0.2, 0.1]
            other = np.r_[np.full(2 * terms[1].knots.size, 4.0), 0.1, 0.2, 0.1]
            solution = arm_solve.Solution(
                beta=np.zeros(b), own=[good, other], errors=[good, other], condition=10.0,
                pushed=[0.0 * good, 0.0 * other], told=np.ones(b),
            )  # fmt: skip
            assert sum("one direction" in w for w in remarks(robot, terms, moved, solution)[0]) == count
    for share, count in ((0.019, 1), (0.021, 0)):
        slow = [replace(terms[0], top=share * terms[1].top), terms[1]]
        assert sum("no more than" in w for w in said(of=slow)) == count


def test_errors_of_a_whole_fit_are_those_of_refits_at_its_solution(robot):
    """Huber's weights and each joint's noise as they are where the rounds end, and a refit without each block."""
    rows, terms = rows_for(robot)
    b, sizes = rows.bodies.shape[2], [t.size for t in terms]
    first = b + np.array([0, sizes[0], sum(sizes)])
    got = arm_solve.solve_arm(rows, robot, terms, lambda beta: None, np.array([True, True]))
    x = np.concatenate([got.beta, *got.own])
    scale = np.array([np.sqrt(np.mean(rows.torque[rows.weight[:, j] > 0, j] ** 2)) for j in range(2)])
    start, precision = arm_solve._prior(rows, robot, terms, scale)
    columns, torques = [], []
    for j in range(2):
        X = np.zeros((rows.torque.shape[0], first[-1]))
        X[:, :b], X[:, first[j] : first[j + 1]] = rows.bodies[:, j], rows.friction[j]
        left, used = rows.torque[:, j] - X @ x, rows.weight[:, j] > 0
        noise = 1.4826 * np.median(np.abs(left[used]))
        root = np.sqrt(rows.weight[:, j] * np.minimum(1.0, 2.0 * noise / np.abs(left))) / noise
        columns.append(X * root[:, None])
        torques.append(rows.torque[:, j] * root)
    both, torque, block = (
        np.vstack(columns),
        np.concatenate(torques),
        np.tile(arm_errors.blocks_of(len(rows.torque), 20.0), 2),
    )
    gram = both.T @ both
    held = precision + arm_solve._alike(gram, first, terms)
    low, high = arm_solve._bounds(b, terms, np.array([True, True]))
    free = (x > low) & (x < high)
    inner = np.ix_(free, free)
    bread = np.linalg.inv((gram + held)[inner])
    slope = both.T @ (torque - both @ x) - held @ (x - start)
    covariance = np.zeros_like(gram)
    covariance[inner], loose, pushed = brute_force_errors(both, torque, block, held, start, free)
    deviation = np.sqrt(np.diag(covariance))
    errors = np.concatenate(got.errors)
    assert errors[free[b:]] == pytest.approx(deviation[b:][free[b:]], rel=3e-2)
    for j in range(2):
        own = slice(first[j], first[j + 1])
        assert np.sqrt(np.diag(got.covariance(j))) == pytest.approx(deviation[own], rel=3e-2, abs=1e-12)
        assert not got.pushed[j][free[own]].any() and got.pushed[j].size == sizes[j]
    for i in np.flatnonzero(~free):
        assert errors[i - b] == pytest.approx(loose[i], rel=3e-2)
        assert np.concatenate(got.pushed)[i - b] == pytest.approx(pushed[i], rel=0.1, abs=0.1)
    # the sum of squares does not fall along any free direction
    assert np.abs(bread @ slope[free]).max() < 0.05 * deviation[free].max()
    prior = np.diag(np.linalg.inv(precision[:b, :b]))
    assert got.told == pytest.approx(1.0 - np.diag(covariance)[:b] / prior, abs=1e-3)
    unit = np.sqrt(np.diag(gram)[:b])
    assert got.condition == pytest.approx(
        np.sqrt(np.linalg.cond(gram[:b, :b] / np.outer(unit, unit))), rel=1e-2
    )
    assert (~free).sum() <= 6


def test_the_numbers_of_an_arm_stand_where_they_belong(found):
    frictions, shown, arm = found
    log = made()
    for j, friction in enumerate(frictions):
        top = friction.validity.velocity[1]
        law = friction.law.rate
        assert friction.validity.velocity[0] == -top == -law.velocity[-1] and law.velocity[0] == 0.0
        for name in ("positive", "negative"):
            assert getattr(law, name)[-1] == getattr(law, name)[-2]  # level beyond the top knot
            assert friction.standard_errors[name][-1] == friction.standard_errors[name][-2] > 0.0
            assert len(friction.standard_errors[name]) == len(law.velocity)
        assert (friction.joint.torque_side, friction.warnings, friction.at_bound) == ("joint", (), ())
        assert {n: e.unit for n, e in friction.dynamics.items()} == {
            "inertia": "kg.m^2", "offset": "N.m", "transition": "rad/s",
        }  # fmt: skip
        assert np.isnan(friction.dynamics["transition"].standard_error)
        low, high = friction.validity.load
        assert low == pytest.approx(log.torque[:, j].min(), abs=3.5) and low > log.torque[:, j].min() - 0.5
        assert high == pytest.approx(log.torque[:, j].max(), abs=3.5) and high < log.torque[:, j].max() + 0.5
        band = shown[j].curve
        for way, name in ((1.0, "positive"), (-1.0, "negative")):
            knots = np.array(law.velocity[1:-1])
            side = band.velocity * way > 0
            order = np.argsort(np.abs(band.velocity[side]))
            at = np.interp(knots, np.abs(band.velocity[side])[order], band.standard_error[side][order])
            assert at == pytest.approx(friction.standard_errors[name][1:-1], rel=0.25)
        s = shown[j].samples
        assert shown[j].joint == friction.joint.name and s.fitted.any() and not s.fitted.all()
        clean = made(noise=0.0)
        assert np.median(np.abs(s.torque - np.interp(s.time, clean.time, clean.torque[:, j]))) < 0.1
        assert np.median(np.abs(s.friction - curve(j, s.velocity))) < 0.25
        assert np.median(np.abs(s.predicted - s.torque)) < 0.1
    assert arm.condition > 1.0


def test_load_friction_that_is_not_there_is_zero_with_its_error(robot):
    one, other = identify_arm(made(load=(0.1, 0.0)), robot)[0]
    assert one.law.growth.load_driving == pytest.approx(0.1, abs=0.02)
    assert other.law.growth.load_driving == other.law.growth.load_driven == 0.0
    assert 0.0 < other.standard_errors["load_driving"] < 0.1


def test_an_arm_needs_two_rows_a_coefficient(robot):
    """An offset of the torque does not change how many rows there are."""
    for samples in (260, 280, 300, 320, 340, 360, 380, 400, 420, 440):
        log = made().rows(slice(0, samples))
        (s,) = arm_signals.hold_out_blocks(arm_signals.prepare_arm(log, robot))
        top = np.quantile(np.abs(s.velocity), 0.999, axis=0)
        moves = ~arm_signals.resting(s.velocity, top, s.rate) & s.fitted[:, None]
        terms = [arm_terms.terms_of(np.abs(s.velocity[moves[:, j], j])) for j in range(2)]
        count = int(np.count_nonzero(arm_terms.build(arm_terms.Regressor(robot, [s]), terms).weight))
        unknown = robot.base.columns.size + sum(t.size for t in terms)
        try:
            identify_arm(log, robot)
            enough = True
        except NotIdentifiable as error:
            enough = f"{count} rows of moving joints are too few for {unknown} coefficients" not in str(error)
        assert enough is (count >= 2 * unknown), samples


def test_what_is_too_short_to_be_prepared_is_not_predicted(found, robot):
    frictions, _, arm = found
    log = made(seconds=6.0, rate=500.0)
    time = log.time.copy()
    time[2800:] += 0.012  # 0.4 s beyond a gap, where the stretch before ends at every fourth sample
    predicted = predict_arm(FrictionModel(joints=frictions, arm=arm), log.replace(time=time), robot)
    assert np.isfinite(predicted[:2800]).all() and np.isnan(predicted[2800:]).all()


def test_a_joint_that_does_not_move(robot):
    still = made(seconds=30.0)
    position = still.position.copy()
    position[:, 1] = 0.4
    dq = np.gradient(position[:, 0], still.time)
    speed, turn = np.column_stack([dq, 0.0 * dq]), np.column_stack([np.gradient(dq, still.time), 0.0 * dq])
    torque = bodies(position, speed, turn) + np.array(MOTOR) * turn + OFFSET
    torque[:, 0] += curve(0, dq)
    frictions, _, _ = identify_arm(still.replace(position=position, torque=torque), robot)
    assert frictions[1].warnings == ("It never moves: its friction is unknown and set to zero.",)
    assert not frictions[1].law.torque(np.array([0.5, -0.5])).any()
    v = np.array([0.3, 0.8, -0.3, -0.8])
    assert frictions[0].law.torque(v) == pytest.approx(curve(0, v), rel=0.15)


def test_coulomb_and_viscous_friction_are_of_sliding_and_hold_the_curve_that_is_no_line(robot):
    """By numpy alone: the knots near zero take no part, and the scatter of the others about the line is in the errors."""
    knots = np.array([0.0, 0.02, 0.1, 0.3, 0.6, 1.0])
    terms = [arm_terms.Terms(knots=knots, top=1.1, transition=0.002)] * 2
    assert terms[0].sliding.tolist() == [False, False, True, True, True, True]
    table, names = arm_forecast._combinations(robot, terms)
    first = robot.base.columns.size
    at = [n["name"] for n in names].index("coulomb")
    curve = np.array([0.0, 99.0, 2.5, 2.0, 2.4, 3.0])
    own = np.r_[curve, curve, 0.1, 0.2, 0.0]
    row = np.zeros(table.shape[1])
    row[first : first + own.size] = own
    slope, level = np.polyfit(knots[2:], curve[2:], 1)
    assert table[at : at + 4] @ row == pytest.approx([level, slope, 0.1, 0.2])
    A = np.column_stack([np.ones(4), knots[2:]])
    left = curve[2:] - A @ [level, slope]
    wanted = left @ left / 2 * np.diag(np.linalg.inv(A.T @ A))
    nothing = np.zeros((own.size, own.size))
    assert arm_forecast._lack_of_fit(terms[0], own, nothing) == pytest.approx(wanted)
    # knots as uncertain as they scatter are explained by their errors
    assert arm_forecast._lack_of_fit(terms[0], own, np.eye(own.size)) == pytest.approx([0.0, 0.0])
    bare = arm_terms.Terms(knots=np.array([0.0, 1.0]), top=1.1, transition=0.002)
    assert bare.sliding.tolist() == [True, True]
    assert arm_forecast._lack_of_fit(bare, np.ones(7), nothing[:7, :7]).tolist() == [0.0, 0.0]


def test_a_joint_beyond_the_range_of_its_description_is_named(robot):
    n = 50
    still, every = np.zeros((n, 2)), np.ones(n, dtype=bool)
    signals = arm_signals.ArmSignals(
        time=np.arange(n) / 100.0, position=np.linspace([-0.5, -1.0], [0.5, 30.0], n), velocity=still, acceleration=still,
        torque=still, rate=100.0, fitted=every, held_out=~every,
    )  # fmt: skip
    known = replace(robot, ranges=(Range(lower=-2.0, upper=2.0), Range(lower=-3.0, upper=3.0)))
    first, second = beyond_range(known, [signals])
    assert first == () and "-1 to 30 rad, beyond its range of -3 to 3" in second[0]
    assert beyond_range(replace(robot, ranges=()), [signals]) == [(), ()]
    assert beyond_range(replace(robot, ranges=(Range(), Range())), [signals]) == [(), ()]
    near = replace(known, ranges=(Range(lower=-0.49, upper=2.0), Range(lower=-3.0, upper=31.0)))
    assert beyond_range(near, [signals]) == [(), ()]  # zeros of encoders are not exact
