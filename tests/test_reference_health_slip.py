"""How torque and motion hang together: filtered terms, friction's sign and a slip of time, by plain regressions."""

import numpy as np
import pytest
from scipy.signal import lfilter

from _health import about, log_of
from backdrive import Joint, Log
from backdrive.logs.health import time_slip, torque_sign
from backdrive.logs.health._exam import Exam
from backdrive.logs.health._motion import motion, normal_equations, running, solvable
from backdrive.logs.health.time_slip import Slip
from backdrive.logs.resolution import white_noise

# ------------------------------------------------------------------------------------- what is regressed


def box(x, width):
    """Three running means of a signal."""
    for _ in range(3):
        x = np.convolve(x, np.ones(width) / width, mode="valid")
    return x


def odd(samples):
    return max(3, round(samples)) | 1


def path_by_hand(log, j, part):
    """Smoothed position, velocity and acceleration of a joint on a part of the log."""
    t = log.time[part] - log.time[part][0]
    light = odd(0.01 / np.median(np.diff(log.time)))
    if log.position is not None:
        x = log.position[part, j]
    else:
        v = log.velocity[part, j]
        x = np.array([np.sum(0.5 * (v[1 : k + 1] + v[:k]) * np.diff(t)[:k]) for k in range(v.size)])
    q, s = box(x, light), box(t, light)
    v = np.gradient(q, s)
    return q, v, np.gradient(v, s)


def motion_by_hand(log, j, reach, parts):
    period = np.median(np.diff(log.time))
    light, heavy = odd(0.01 / period), odd(0.03 / period)
    paths = {k: [path_by_hand(log, k, part) for part in parts] for k in range(len(log.joints))}
    q, v = (np.concatenate([p[k] for p in paths[j]]) for k in (0, 1))
    top, middle, span = np.quantile(np.abs(v), 0.99), 0.5 * (q.max() + q.min()), q.max() - q.min()
    terms, torque, fast, bends = [], [], [], []
    for number, part in enumerate(parts):
        q, v, a = paths[j][number]
        raw = log.torque[part, j]
        columns = [a, np.sign(v), v, np.ones(v.size)]
        if log.joints[j].unit == "rad" and span > 0.5:
            columns += [np.sin(q - middle), np.cos(q - middle)]
        elif span > 0:
            columns += [q - middle]
        plain = len(columns)
        columns += [v * np.abs(v), np.sign(v) * np.exp(-np.abs(v) / (0.05 * top))]
        columns += [paths[k][number][2] for k in paths if k != j]
        filtered = np.column_stack([box(c, heavy) for c in columns])
        smooth = box(box(raw, light), heavy)
        for row in range(reach, filtered.shape[0] - reach, heavy // 2):
            terms.append(filtered[row])
            torque.append(smooth[row - reach : row + reach + 1])
            fast.append(np.all(np.abs(v[row : row + 3 * (heavy - 1) + 1]) >= 0.1 * top))
        bends.append(np.abs(raw[2:] - 2 * raw[1:-1] + raw[:-2]))
    kernel = np.ones(1)
    for width in (light, heavy):
        for _ in range(3):
            kernel = np.convolve(kernel, np.ones(width) / width)
    noise = (np.median(np.concatenate(bends)) / 0.6745) ** 2 / 6 * np.sum(kernel**2)
    fold = np.array([12 * k // len(terms) for k in range(len(terms))])
    return np.array(terms), plain, np.array(torque), np.array(fast), noise, fold


def moved(kind, n, dt, begin):
    generator = np.random.default_rng(n)
    t = begin + dt * np.arange(n)
    s = t - begin
    size = {"wide": 1.0, "narrow": 0.2, "linear": 1.0, "speed": 1.0, "two": 1.0, "gaps": 1.0}[kind]
    q = size * np.column_stack([np.sin(2.0 * s) + 0.4 * np.sin(5.3 * s) + 1.7, 0.5 * np.sin(3.1 * s + 1.0)])
    v = size * np.column_stack([2.0 * np.cos(2.0 * s) + 2.12 * np.cos(5.3 * s), 1.55 * np.cos(3.1 * s + 1.0)])
    tau = 3.0 * np.sign(v) + v + 0.5 * generator.standard_normal((n, 2))
    wide = 2 if kind == "two" else 1
    joints = tuple(Joint(name=name, unit="m" if kind == "linear" else "rad") for name in "ab"[:wide])
    known = {"velocity": v[:, :wide]} if kind == "speed" else {"position": q[:, :wide]}
    return Log(time=t, joints=joints, torque=tau[:, :wide], **known)


@pytest.mark.parametrize("kind", ["wide", "narrow", "linear", "speed", "two", "gaps"])
@pytest.mark.parametrize(("n", "dt", "begin"), [(2500, 2e-3, 0.0), (1200, 0.02, 1.7e9)])
def test_the_terms_of_a_motion_are_those_of_its_definition(kind, n, dt, begin):
    log = moved(kind, n, dt, begin)
    light, heavy = odd(0.01 / dt), odd(0.03 / dt)
    parts = [slice(0, n)]
    if kind == "gaps":  # the second piece is one sample too short, the third just long enough
        least = 3 * (light + heavy) + 12
        edges = [0, n // 2, n // 2 + least - 1, n // 2 + 2 * least - 1, n]
        time = np.array(log.time)
        for edge in edges[1:-1]:
            time[edge:] += 1.0
        log = log.replace(time=time)
        parts = [slice(a, b) for a, b in zip(edges, edges[1:], strict=False) if b - a >= least]
    for j in range(len(log.joints)):
        m = motion(Exam(log), j, 7)
        terms, plain, torque, fast, noise, fold = motion_by_hand(log, j, 7, parts)
        assert m is not None and m.plain == plain and m.terms.shape == terms.shape
        assert m.terms == pytest.approx(terms, rel=1e-6, abs=1e-6 * np.abs(terms).max())
        assert np.array_equal(m.velocity, m.terms[:, 2]) and m.shifts.tolist() == list(range(-7, 8))
        assert m.torque == pytest.approx(torque, rel=1e-9, abs=1e-9)
        assert np.array_equal(m.fast, fast) and 0 < fast.sum() < fast.size
        assert m.noise == pytest.approx(noise, rel=1e-9)
        kernel = np.pad(box(np.pad(box(np.pad([1.0], 3 * light), light), 3 * heavy), heavy), 1)
        assert m.rough / m.noise == pytest.approx(
            np.sum(np.gradient(kernel) ** 2) / np.sum(kernel**2), rel=1e-9
        )
        assert np.array_equal(m.fold, fold)


@pytest.mark.parametrize(("span", "columns"), [(0.48, 5), (0.52, 6)])
def test_a_position_that_goes_through_half_a_radian_is_wide(span, columns):
    t = 1e-3 * np.arange(6000)
    for unit, wanted in (("rad", columns), ("m", 5)):
        log = log_of(6000, unit=unit, position=0.5 * span * np.sin(3.0 * t), torque=np.sin(t))
        assert motion(Exam(log), 0, 3).plain == wanted


def test_a_motion_needs_48_instants_a_torque_and_a_clock():
    """An instant every 15 samples of 1 ms, after 120 are lost to the means and 6 to the reach."""
    for n, told in ((126 + 15 * 47, False), (126 + 15 * 47 + 1, True)):
        x = np.sin(1e-3 * np.arange(n) * 9.0)
        m = motion(Exam(log_of(n, position=x, torque=x)), 0, 3)
        assert (m is not None) is told and (m is None or m.terms.shape[0] == 48)
    t = 1e-3 * np.arange(3000)
    assert motion(Exam(log_of(3000, position=np.sin(t))), 0, 3) is None
    assert motion(Exam(log_of(3000, position=np.sin(t), torque=np.sin(t), time=np.zeros(3000))), 0, 3) is None
    holed = np.where(t == t[7], np.nan, np.sin(t))
    assert motion(Exam(log_of(3000, position=holed, torque=np.sin(t))), 0, 3) is None
    by_speed = motion(Exam(log_of(3000, position=holed, velocity=np.cos(t), torque=np.sin(t))), 0, 3)
    assert by_speed is not None and by_speed.velocity == pytest.approx(
        np.cos(t[60:-60])[3::15][: by_speed.velocity.size], abs=0.05
    )
    still = motion(Exam(log_of(3000, position=np.full(3000, 0.7), torque=np.sin(t))), 0, 3)
    assert still is not None and still.plain == 4
    short = motion(Exam(log_of(120, position=np.sin(t[:120]), torque=np.sin(t[:120]))), 0, 3)
    assert short is None


def test_normal_equations_are_solvable_with_a_billionth_more():
    gram = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, 0.0]])
    more = solvable(gram)
    assert more - gram == pytest.approx(np.diag([4e-9, 9e-9, 0.0]), rel=1e-5, abs=1e-20)
    assert np.linalg.solve(more, [6.0, 19.0, 0.0]) == pytest.approx([1.0, 2.0, 0.0], rel=1e-7)
    x = np.arange(6.0).reshape(3, 2)
    assert normal_equations(x, x, np.array([2, 2, 5]))[0] == pytest.approx(
        np.stack([x[:2].T @ x[:2], x[2:].T @ x[2:]])
    )
    assert running(x + 7.0, 1) == pytest.approx(x + 7.0)


# ----------------------------------------------------------------------------------------- friction's sign


def test_friction_is_told_from_sixty_moving_instants():
    seen = set()
    for n in range(1050, 1250, 4):
        t = 1e-3 * np.arange(n)
        exam = Exam(log_of(n, position=np.sin(9.0 * t), torque=np.sign(np.cos(9.0 * t))))
        m = motion(exam, 0, time_slip.REACH)
        count = int(np.count_nonzero(np.abs(m.velocity) > 0.05 * np.quantile(np.abs(m.velocity), 0.99)))
        assert (torque_sign.friction(exam, 0) is not None) is (count >= 60)
        seen.add(count)
    assert {59, 60} <= seen


@pytest.mark.parametrize(("parts", "told"), [(3, False), (4, True)])
def test_friction_and_slip_are_told_from_motion_in_four_stretches_of_twelve(parts, told):
    n = 24000
    t = 1e-3 * np.arange(n)
    stop = 24.0 * parts / 12.0 - 0.3
    v = np.where(t < stop, 2.0 * np.cos(5.0 * t) + np.cos(13.0 * t), 0.0)
    q = np.cumsum(v) * 1e-3
    exam = Exam(log_of(n, position=q, torque=np.sign(v) + 0.3 * v + 0.1 * np.gradient(v, t)))
    assert (torque_sign.friction(exam, 0) is not None) is told
    assert (time_slip.estimate(exam, 0) is not None) is told


@pytest.mark.parametrize(("share", "told"), [(0.09, False), (0.11, True), (0.89, True), (0.91, False)])
def test_friction_is_told_where_a_tenth_of_the_motion_goes_either_way(share, told):
    n, dt = 12000, 2e-3
    t = dt * np.arange(n)
    forth = (t % 2.0) < 2.0 * share
    v = np.convolve(np.where(forth, 1.0, -1.0), np.ones(9) / 9.0, "same") * (1.0 + 0.2 * np.sin(7.0 * t))
    exam = Exam(log_of(n, dt, position=np.cumsum(v) * dt, torque=3.0 * np.sign(v) + 0.5 * np.gradient(v, dt)))
    m = motion(exam, 0, time_slip.REACH)
    moving = np.abs(m.velocity) > 0.05 * np.quantile(np.abs(m.velocity), 0.99)
    assert np.mean(m.velocity[moving] > 0.0) == pytest.approx(share, abs=0.009)
    assert (torque_sign.friction(exam, 0) is not None) is told


# --------------------------------------------------------------------------------------------- a slip of time


def slip_by_hand(log, scale=1.0):
    """Least squares at every shift, with all instants and without one stretch at a time."""
    m = motion(Exam(log), 0, 20)
    X, Y, fold = m.terms[m.fast], m.torque[m.fast], m.fold[m.fast]

    def misfits(keep):
        theta = np.linalg.lstsq(X[keep], Y[keep], rcond=None)[0]
        return np.sum((Y[keep] - X[keep] @ theta) ** 2, axis=0)

    def lowest(y):
        k = int(np.argmin(y))
        if k in (0, 40):
            return k - 20.0
        a, _, c = np.polyfit([-1.0, 0.0, 1.0], y[k - 1 : k + 2], 2)
        b = 0.5 * (y[k + 1] - y[k - 1])
        return k - 20.0 - b / (2.0 * a) + 0.0 * c

    total = misfits(np.ones(fold.size, bool))
    left = np.array([lowest(misfits(fold != f)) for f in np.unique(fold)])
    error = np.sqrt((left.size - 1) / left.size * np.sum((left - left.mean()) ** 2))
    now, then = total[20] / fold.size, total.min() / fold.size
    noise = min(0.5 * m.noise, 0.9 * then)
    variance = np.var(Y[:, 20])
    return (
        lowest(total),
        error,
        (then - noise) / (now - noise),
        np.sqrt(then / variance),
        np.sqrt((now - then) / variance),
    )


@pytest.mark.parametrize(
    ("late", "noise", "unknown", "scale"),
    [
        (6.0, 0.1, 0.0, 1.0),
        (-9.0, 0.5, 0.0, 1.0),
        (3.3, 0.02, 0.5, 1.0),
        (0.4, 0.5, 0.2, 1e-3),
        (30.0, 0.1, 0.0, 1.0),
        (4.0, 0.0, 0.05, 1.0),
    ],
)
@pytest.mark.parametrize("joints", [1, 2])
def test_a_slip_is_that_of_regressions_at_every_shift(late, noise, unknown, scale, joints):
    n, dt = 10000, 2e-3
    t = dt * np.arange(n)
    generator = np.random.default_rng(3)

    def moving(t):
        return (
            np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t), 2.0 * np.cos(2.0 * t) + 2.12 * np.cos(5.3 * t),
            -4.0 * np.sin(2.0 * t) - 11.236 * np.sin(5.3 * t),
        )  # fmt: skip

    _, v, a = moving(t - late * dt)
    tau = np.sign(v) + v + 0.8 * a + unknown * np.sin(31.0 * t) + noise * generator.standard_normal(n)
    q = moving(t)[0]
    still = np.zeros(n)  # another joint that does not move explains nothing
    log = log_of(
        n,
        dt,
        position=np.column_stack([q, still][:joints]),
        torque=scale * np.column_stack([tau, still][:joints]),
    )
    slip = time_slip.estimate(Exam(log), 0)
    wanted = slip_by_hand(log)
    assert (slip.samples, slip.error, slip.left, slip.misfit, slip.effect) == pytest.approx(
        wanted, rel=1e-4, abs=1e-5
    )


def test_no_timing_is_read_from_an_uneven_clock_or_a_rough_torque():
    n, dt = 8000, 2e-3
    t = dt * np.arange(n)
    v = 2.0 * np.cos(2.0 * t) + 2.12 * np.cos(5.3 * t)
    q = np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t)
    tau = np.sign(v) + 3.0 * v
    for share, told in ((0.098, True), (0.102, False)):
        steps = dt * (1.0 + share * np.sqrt(1.5) * np.resize([1.0, -1.0, 0.0], n - 1))
        time = np.concatenate([[0.0], np.cumsum(steps)])
        time[5000:] += 0.5  # a gap is no unevenness, and neither is one interval of twice the length
        time[6000:] += 1.1 * dt
        assert np.std(np.diff(time)[np.diff(time) < 2 * dt]) == pytest.approx(share * dt, rel=1e-3)
        exam = Exam(log_of(n, time=time, position=q, torque=tau))
        assert (time_slip.estimate(exam, 0) is not None) is told
    rough = (-1.0) ** np.arange(n)
    sizes = np.linspace(0.05, 2.0, 400)
    share = np.array([white_noise(tau + s * rough) / np.std(tau + s * rough) for s in sizes])
    for wanted, told in ((0.29, True), (0.31, False)):
        size = sizes[np.argmin(np.abs(share - wanted))]
        assert (
            time_slip.estimate(Exam(log_of(n, dt, position=q, torque=tau + size * rough)), 0) is not None
        ) is told
    assert time_slip.estimate(Exam(log_of(n, dt, position=q)), 0) is None
    assert time_slip.estimate(Exam(log_of(n, dt, position=q, torque=np.ones(n))), 0) is None


@pytest.mark.parametrize(("back", "told"), [(1.0, False), (-1.0, True)])
def test_no_timing_is_read_from_motion_in_one_direction(back, told):
    n, rate = 3000, 200.0
    t = np.arange(n) / rate
    v = np.convolve(np.where(t % 4.0 < 2.0, 1.0, 0.4 * back), np.ones(60) / 60, "same")
    tau = np.roll(0.3 * np.gradient(v, 1.0 / rate) + np.sign(v) + 0.3 * v, 6)
    exam = Exam(log_of(n, 1.0 / rate, position=np.cumsum(v) / rate, torque=tau))
    assert (time_slip.estimate(exam, 0) is not None) is told


def test_a_slip_needs_a_hundred_fast_instants():
    for n in range(2300, 3300, 100):
        t = 1e-3 * np.arange(n)
        exam = Exam(log_of(n, position=np.sin(5.0 * t), torque=np.cos(5.0 * t - 0.1) + 0.3 * np.sin(5.0 * t)))
        m = motion(exam, 0, time_slip.REACH)
        assert (time_slip.estimate(exam, 0) is not None) is bool(m.fast.sum() >= 100)
    assert m.fast.sum() > 100


def slipped(period=1e-3, known=True, unit="rad", **slip):
    """Return what is said of a slip."""
    n = 500
    x = np.sin(period * np.arange(n))
    exam = Exam(log_of(n, period, unit=unit, torque=x, **({"position": x} if known else {"velocity": x})))
    exam.shared[time_slip.estimate, 0] = Slip(
        **({"samples": 10.0, "error": 0.1, "left": 0.1, "misfit": 0.1, "effect": 0.1} | slip)
    )
    exam.shared[motion, 0, time_slip.REACH] = None  # nothing else speaks of it
    return time_slip.find(exam)


@pytest.mark.parametrize(
    ("slip", "severity"),
    [
        ({}, "spoils"),
        ({"samples": -10.0}, "spoils"),
        ({"samples": 3.1}, "spoils"),
        ({"samples": 2.9}, None),
        ({"samples": -3.1}, "spoils"),
        ({"samples": -2.9}, None),
        ({"samples": 1.6, "period": 0.01}, "spoils"),
        ({"samples": 1.4, "period": 0.01}, None),
        ({"samples": 18.9}, "spoils"),
        ({"samples": 19.1}, None),
        ({"samples": -19.1}, None),
        ({"known": False, "samples": 10.0, "period": 5e-3}, "spoils"),
        ({"known": False, "samples": 7.9, "period": 0.01}, None),
        ({"known": False, "samples": 8.1, "period": 0.01}, "spoils"),
        ({"known": False, "samples": 11.4, "period": 3.5e-3}, None),
        ({"known": False, "samples": 11.5, "period": 3.5e-3}, "spoils"),
        ({"error": 1.6, "left": 0.3}, "spoils"),
        ({"error": 1.7, "left": 0.3}, None),
        ({"samples": -10.0, "error": 1.6, "left": 0.3}, "spoils"),
        ({"left": 0.44}, "spoils"),
        ({"left": 0.46}, None),
        ({"error": 4.9, "left": 0.19}, "spoils"),
        ({"error": 4.9, "left": 0.21}, None),
        ({"error": 5.1, "left": 0.19}, None),
        ({"misfit": 0.24}, "spoils"),
        ({"misfit": 0.26}, None),
        ({"effect": 0.051}, "spoils"),
        ({"effect": 0.049}, "warn"),
        ({"effect": 0.016}, "warn"),
        ({"effect": 0.014}, None),
    ],
)
def test_what_slip_is_worth_a_word(slip, severity):
    found = slipped(**slip)
    assert [f.severity for f in found] == ([] if severity is None else [severity])
    if found:
        one = severity == "warn" or slip.get("left", 0.0) <= 0.1  # a shift of the whole log can be taken back
        assert about(found[0]) == ("j0", "torque", severity, slip.get("samples", 10.0), None, one)


def test_a_slip_is_told_in_samples_and_milliseconds():
    (found,) = slipped(samples=-7.64, error=0.12, effect=0.1234, period=2e-3)
    assert found.sentence == (
        "torque of j0 comes 7.6 samples (15.3 ms) early against its motion (standard error 0.1); "
        "its effect is 12.3 % of the torque."
    )
    assert found.remedy.startswith("Shift torque by 8 samples")
    assert "10.0 samples (10.0 ms) late against" in slipped()[0].sentence


@pytest.mark.parametrize("by", [[3.4, 0.0], [-2.6, 4.0], [5.0, 2.0], [-4.0, -1.0]])
def test_a_slip_is_taken_out_by_whole_samples_and_never_across_a_gap(by):
    n = 200
    time = 1e-3 * np.arange(n)
    time[[*range(80, n)]] += 1.0
    tau = np.column_stack([np.arange(n), 1000.0 + np.arange(n)])
    log = log_of(n, time=time, position=np.column_stack([time, time]), torque=tau)
    exam = Exam(log)
    found = [
        slipped(samples=10.0)[0].__class__(**{**vars(slipped()[0]), "joint": f"j{k}", "value": b})
        for k, b in enumerate(by)
    ]
    mended = time_slip.repair(exam, found)
    rows, torque = [], []
    for row in range(n):
        sources = [row + round(b) for b in by]
        piece = range(0, 80) if row < 80 else range(80, n)
        if all(s in piece for s in sources):
            rows.append(row)
            torque.append([tau[s, k] for k, s in enumerate(sources)])
    assert mended.rows.tolist() == rows and mended.log.torque.tolist() == torque
    assert np.array_equal(mended.log.position, log.position[rows])
    assert mended.log.notes == (
        f"torque of j0 was shifted by {-round(by[0])} samples.", f"torque of j1 was shifted by {-round(by[1])} samples.",
        "Rows at the ends that lost their torque by the shift were dropped.",
    )  # fmt: skip


def late_log(how, by, bend=0.0, rate=500.0):
    """Return a log of a joint under gravity whose torque is late by a time: shifted, or behind a low pass of first order."""
    rng = np.random.default_rng(5)
    t = np.arange(round(20.0 * rate)) / rate
    waves = ((0.8, 1.1, 0.0), (0.4, 2.9, 1.0), (0.1, 6.3, 2.0))
    q, v, a = (sum(f(k, w * t + p) * w**d for k, w, p in waves) for d, f in enumerate((
        lambda k, x: k * np.sin(x), lambda k, x: k * np.cos(x), lambda k, x: -k * np.sin(x),
    )))  # fmt: skip
    friction, z = np.sign(v), 0.0
    if bend:
        for k, step in enumerate(np.diff(q, prepend=q[0])):
            z = float(np.clip(z + step, -bend, bend))
            friction[k] = z / bend
    tau = 0.1 * a + friction + 0.3 * v + 2.0 * np.sin(q)
    if how == "shift":
        tau = np.interp(t - by, t, tau)
    else:
        gain, late = 1.0 - np.exp(-1.0 / (by * rate)), tau[0]
        for k, x in enumerate(tau.copy()):
            late += gain * (x - late)
            tau[k] = late
    return Log(
        time=t,
        joints=(Joint(name="j0", unit="rad"),),
        position=q,
        torque=tau + 0.02 * rng.standard_normal(t.size),
    )


@pytest.mark.parametrize(("by", "bend"), [(0.02, 0.0), (0.02, 2e-3), (0.03, 0.0)])
def test_torque_behind_a_low_pass_is_no_slip_that_a_shift_mends(by, bend):
    (shifted,) = time_slip.find(Exam(late_log("shift", by, bend)))
    assert shifted.repairable and "low pass" not in shifted.sentence
    assert shifted.value == pytest.approx(by * 500.0, abs=0.5)
    (passed,) = time_slip.find(Exam(late_log("low pass", by, bend)))
    assert (
        not passed.repairable and "low pass" in passed.sentence and "no shift can repair it" in passed.remedy
    )


def drawn_log(seed, how, rate):
    """Return a log of a joint that moves in three drawn waves, with torque shifted by whole samples or behind a low pass."""
    rng = np.random.default_rng(seed)
    late = int(rng.integers(max(2, np.ceil(3e-3 * rate)), 19)) if how == "shift" else 0
    before = round(rate)  # the low pass has settled when the log begins
    t = np.arange(-before, round(20.0 * rate)) / rate
    w, p = rng.uniform(1.0, 10.0, 3), rng.uniform(0.0, 6.0, 3)
    k = rng.uniform(0.1, 0.6, 3) / w
    x = np.outer(t, w) + p
    v = np.cos(x) @ (k * w)
    tau = 0.2 * (-np.sin(x) @ (k * w * w)) + 0.4 * np.sign(v) + 0.2 * v
    if how == "low pass":
        keep = np.exp(-1.0 / (rate * rng.uniform(0.01, 0.03)))
        tau = lfilter([1.0 - keep], [1.0, -keep], tau)
    noise = rng.choice([3e-4, 1e-3] if how == "low pass" else [3e-4, 3e-3, 0.02])
    return log_of(
        t.size - before,
        1.0 / rate,
        position=1e-4 * np.round(1e4 * (np.sin(x) @ k))[before:],
        torque=tau[before - late : tau.size - late] + noise * rng.standard_normal(t.size - before),
    )


@pytest.mark.parametrize(("rate", "share"), [(200.0, 0.6), (500.0, 0.7), (1000.0, 0.3)])
def test_a_shift_by_whole_samples_is_no_low_pass_and_most_low_passes_are_found(rate, share):
    """Coarse counts of the position, noise and speed change what remains of either, but not which of them it was."""
    shifts, passes = (
        [f for seed in range(30) for f in time_slip.find(Exam(drawn_log(seed, how, rate)))]
        for how in ("shift", "low pass")
    )
    assert len(shifts) >= 15 and all("low pass" not in f.sentence for f in shifts)
    assert len(passes) >= 6 and np.mean(["low pass" in f.sentence for f in passes]) > share


@pytest.mark.parametrize("rate", [600.0, 1433.0])
def test_a_slip_is_told_at_rates_whose_samples_are_taken_some_apart(rate):
    """Every third and every seventh sample is taken there, and the first of them is not the first of the log."""
    t = np.arange(round(20.0 * rate)) / rate
    q, v, a = (
        0.3 * w1 * f(3.0 * t) + 0.1 * w2 * f(8.0 * t + 1.0)
        for f, w1, w2 in ((np.sin, 1.0, 1.0), (np.cos, 3.0, 8.0), (np.sin, -9.0, -64.0))
    )
    noise = 0.01 * np.random.default_rng(0).standard_normal(t.size)
    exam = Exam(
        log_of(
            t.size, 1.0 / rate, position=q, torque=np.roll(0.2 * a + 0.4 * np.sign(v) + 0.2 * v + noise, 8)
        )
    )
    assert time_slip.estimate(exam, 0).samples == pytest.approx(8.0, abs=0.1)
