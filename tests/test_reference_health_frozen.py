"""Channels that stand while the joint moves: every rule by plain loops on random logs, and thresholds from both sides."""

import numpy as np
import pytest

from _health import log_of
from backdrive.logs.health._exam import Exam
from backdrive.logs.health._runs import standstill_runs
from backdrive.logs.health._velocity_fit import velocity_fit
from backdrive.logs.resolution import white_noise


class Rules:
    """What the rules for frozen runs say, one sample after the other; resolution and fit are tested on their own."""

    def __init__(self, log):
        self.exam, self.t, self.dt = Exam(log), log.time, float(np.median(np.diff(log.time)))
        self.c = {name: a[:, 0] for name, a in log.channels.items()}
        self.step = {name: self.exam.quantum(name, 0) for name in self.c}
        if "velocity" in self.c:
            self.top = np.quantile(np.abs(self.c["velocity"]), 0.99)
            self.wander = 6.0 * self.dt * white_noise(self.c["velocity"])
        fit = velocity_fit(self.exam, 0)
        self.agree = (
            fit is not None
            and 0.85 < fit.scale < 1.15
            and fit.residual < 0.3
            and abs(fit.delay) < max(6.0 * self.dt, 0.03)
        )

    def runs(self, channel):
        x, begin, found = self.c[channel], 0, []
        for k in range(1, x.size + 1):
            if k == x.size or x[k] != x[begin]:
                if k - begin >= 20:
                    rule = self.position if channel in ("position", "second_encoder") else self.signal
                    if rule(channel, x, begin, k):
                        found.append((begin, k))
                begin = k
        return [] if np.ptp(x) == 0 else found

    @staticmethod
    def biggest(x, a, b, reach):
        """Steps within so many samples before and behind a run."""
        before = [x[k + 1] - x[k] for k in range(max(0, a - reach), a - 1)]
        after = [x[k + 1] - x[k] for k in range(b, min(x.size, b + reach) - 1)]
        return np.array(before + after)

    def noise(self, x, a, b):
        steps = self.biggest(x, a, b, 12)
        return np.abs(steps).max() if steps.size else np.inf

    def position(self, channel, x, a, b):
        release = abs(x[b] - x[b - 1]) if b < x.size else np.inf
        step, noise = self.step[channel], self.noise(x, a, b)
        if self.agree:
            v, t = self.c["velocity"][a:b], self.t[a:b]
            long = t[-1] - t[0]
            moved = abs(sum(0.5 * (v[k] + v[k + 1]) * (t[k + 1] - t[k]) for k in range(b - a - 1)))
            late = abs(np.median(v[(b - a) // 2 :])) * long
            least = [
                5 * step,
                4 * noise,
                self.wander * np.sqrt(b - a),
                0.1 * self.top * long,
                3 * self.step["velocity"] * long,
            ]
            return min(moved, late) > max(least) and release > 0.4 * moved
        before, after = x[max(0, a - 6) : a + 1], x[b : b + 7]
        speed = sum((y[-1] - y[0]) / (y.size - 1) if y.size > 1 else 0.0 for y in (before, after)) / 2.0
        led = abs(speed) * (b - a)
        return release > 6 * step and release > 8 * noise and 0.3 * led < release < 3 * led

    def signal(self, channel, x, a, b):
        if not self.moving(channel, a, b):
            return False
        step, n, long = self.step[channel], x.size, b - a
        if channel in ("torque", "drive_input") and x[a] != 0 and (x[a] == x.max() or x[a] == x.min()):
            return False
        release = abs(x[b] - x[b - 1]) if b < n else 0.0
        around = self.biggest(x, a, b, 100)
        if around.size >= 20:
            alive = [s for s in around if s != 0]
            turns = (
                np.mean([p * q < 0 for p, q in zip(alive, alive[1:], strict=False)])
                if len(alive) > 10
                else 0.0
            )
            equal = max(0.02, np.mean(around == 0))
            elsewhere = np.count_nonzero(np.diff(x) == 0) * n / (n - 1) - (long - 1)
            if step == 0 and elsewhere < 0.02 * n and equal < 0.03:
                return True
            lively, chance = np.std(around) > 2 * step, n * equal ** (long - 1)
            if lively and turns > 0.15 and chance < 1e-6:
                return True
            if channel == "velocity" and "position" not in self.c:
                return False
            if lively and chance < 1e-9 and release > max(6 * step, 4 * np.median(np.abs(around))):
                return True
        if x[a] == 0 and a > 0:
            release = max(release, abs(x[a] - x[a - 1]))
        return release > max(6 * step, 4 * self.noise(x, a, b))

    def moving(self, channel, a, b):
        t, v = self.t[a:b], self.c.get("velocity")
        if "position" in self.c:
            q, count = self.c["position"][a:b], self.step["position"]
            if channel != "velocity":
                least = max(2 * count, 1e-4 * np.ptp(self.c["position"]))
                return all(np.ptp(part) >= least and np.ptp(part) > 0.0 for part in np.array_split(q, 3))
            if not self.agree:
                return False
            left = max(abs(q[k] - q[0] - v[a] * (t[k] - t[0])) for k in range(b - a))
            if np.abs(np.diff(q)).max() > 0.5 * left:
                return False
            long = t[-1] - t[0]
            least = [
                3 * self.step["velocity"] * long, 0.05 * self.top * long,
                0.5 * count / min(self.dt, 1e-3) * long,
            ]  # fmt: skip
            return left > max(least) and np.ptp(q) > max(least)
        if channel != "velocity" and v is not None:
            return np.quantile(np.abs(v[a:b]), 0.1) > 0.05 * self.top
        return channel == "velocity" and abs(v[a]) > 0.05 * self.top and b - a >= 100


def rounded(x, step):
    return step * np.rint(x / step) if step else x


def compare(log, channel, seed):
    wanted = Rules(log).runs(channel)
    assert standstill_runs(Exam(log), channel, 0) == wanted, seed
    return len(wanted)


def about_one(generator, spread=2.0):
    """A factor on either side of one: a rule is met or missed by up to so much."""
    return spread ** generator.uniform(-1.0, 1.0)


def sines(t, generator):
    """Position and velocity of two sines."""
    w, p = generator.uniform(2.0, 9.0, 2), generator.uniform(0.0, 6.0, 2)
    return np.sin(w[0] * t + p[0]) + 0.4 * np.sin(w[1] * t + p[1]), w[0] * np.cos(w[0] * t + p[0]) + 0.4 * w[
        1
    ] * np.cos(w[1] * t + p[1])


def torque_log(generator, kind):
    """A torque that is held for a while, near one of the rules."""
    n = 1200
    t = 1e-3 * np.arange(n)
    q, v = sines(t, generator)
    a, long = int(generator.integers(150, 900)), int(generator.integers(20, 200))
    b = a + long
    x = generator.standard_normal(n)
    if kind == "rounded noise":  # the chance that it repeats itself so often
        step = generator.uniform(0.3, 2.5)
        x = rounded(x, step)
        equal = np.mean(np.diff(x) == 0)
        long = int(
            np.clip(1 + about_one(generator, 1.5) * np.log(1e-6 / n) / np.log(max(equal, 0.02)), 20, 250)
        )
        b = a + long
        x[a:b] = x[a]
    elif kind == "slope":  # how often it turns, and how far it leaps in the end
        x = 0.01 * x * about_one(generator, 4.0) + np.cumsum(0.02 * np.sign(np.sin(9.0 * t)))
        x = rounded(x, generator.choice([0.0, 0.002, 0.02]))
        x[a:b] = x[a]
        x[b:] += generator.choice([0.0, 0.3, 1.0]) * 0.3 * about_one(generator, 4.0)
    elif kind == "repeats":  # the share of equal neighbours elsewhere
        for k in np.flatnonzero(generator.random(n) < generator.uniform(0.0, 0.06)):
            x[k] = x[k - 1]
        x[a:b] = x[a]
    elif kind == "leap":  # a smooth and rounded torque that comes out of a level stretch by several steps
        step = generator.choice([0.0, 0.01, 0.05])
        x = rounded(3.0 * np.sin(2.5 * t), step)
        x[a:b] = x[a]
        x[b:] += max(6 * step, 4 * 7.5e-3) * about_one(generator) * generator.choice([-1.0, 1.0])
        x = rounded(x, step)
    elif kind == "to zero":
        step = generator.choice([0.0, 0.01, 0.05])
        x = 3.0 + rounded(1.5 * np.sin(2.5 * t), step)
        x -= x[a - 1] - generator.choice([-1.0, 1.0]) * max(6 * step, 4 * 4e-3) * about_one(generator)
        x[a:b] = 0.0
        x[b:] = generator.choice([0.0, 1.0]) * (x[b:] - x[b])
    elif kind == "at the limit":
        x = np.clip(x, -1.5, 1.5)
        x[a:b] = generator.choice([-1.5, 1.5, 1.4, 0.0])
    elif kind == "little else":  # fewer than twenty steps are left of a log of one run
        a, b = int(generator.integers(0, 14)), n - int(generator.integers(0, 14))
        x[a:b] = x[a] = 0.5
        x[b:] += generator.choice([0.0, 20.0])
    drive = generator.choice(
        ["position", "stops", "counts", "velocity", "none"], p=[0.4, 0.2, 0.15, 0.2, 0.05]
    )
    channel = str(generator.choice(["torque", "drive_input", "external_torque"]))
    more: dict = {channel: x}
    if drive == "velocity":
        slow = v.copy()
        rest = int(generator.uniform(0.0, 0.25) * long)
        slow[a : a + rest] *= 0.01
        slow[a:b] += 0.0
        if generator.random() < 0.5:
            slow[a:b] = 0.05 * np.quantile(np.abs(v), 0.99) * about_one(generator)
        more["velocity"] = slow
    elif drive == "none":
        more["second_encoder"], more["velocity"] = q, np.zeros(n)
        more["velocity"][3] = np.nan
    else:
        if drive == "stops":
            at = a + int(generator.integers(0, max(1, long - 5)))
            wait = int(generator.uniform(0.1, 0.6) * long)
            q[at : at + wait] = q[at] + 1e-4 * np.ptp(q) * about_one(generator) * np.linspace(
                0.0, 1.0, q[at : at + wait].size
            )
        if drive == "counts":
            q = rounded(q, 0.5 * np.abs(np.diff(q)[a:b]).mean() * long / 3.0 * about_one(generator))
        more["position"] = q
    return log_of(n, **more), channel


@pytest.mark.parametrize(
    "kind", ["rounded noise", "slope", "repeats", "leap", "to zero", "at the limit", "little else"]
)
def test_a_held_torque_is_frozen_as_the_rules_say(kind):
    seen = 0
    for seed in range(120):
        log, channel = torque_log(np.random.default_rng(seed), kind)
        seen += compare(log, channel, seed)
    assert seen > 5


@pytest.mark.parametrize(
    "kind", ["release", "creep", "steps", "wander", "counts", "speed counts", "dies", "end"]
)
def test_a_held_position_is_frozen_as_its_velocity_says(kind):
    seen = 0
    for seed in range(80):
        generator = np.random.default_rng(seed)
        dt = generator.choice([1e-3, 4e-3])
        n = 1600
        t = dt * np.arange(n)
        q, v = sines(t, generator)
        a, long = int(generator.integers(300, 1000)), int(generator.integers(20, 150))
        b = a + long
        x, share = q.copy(), 1.0
        if kind == "creep":
            top = np.quantile(np.abs(v), 0.99)
            slow = 0.1 * top * about_one(generator)
            v[a:b] = slow
            x = np.r_[q[:a], q[a] + slow * (t[a:b] - t[a]), q[b:] - q[b] + q[a] + slow * (t[b] - t[a])]
        if kind == "speed counts":
            v = rounded(v, abs(v[a]) / 3.0 * about_one(generator))
        if kind == "wander":
            v = v + generator.uniform(0.0, 0.7) * np.abs(v).max() * (-1.0) ** np.arange(n)
        if kind == "release":
            share = 0.4 * about_one(generator)
        if kind == "steps":
            x = x + 0.25 * abs(q[b] - q[a]) * about_one(generator) * 0.5 * (-1.0) ** np.arange(n)
        if kind == "dies":
            v[a + int(generator.uniform(0.3, 0.7) * long) : b] *= generator.choice([0.0, 0.2, 0.6])
        if kind == "end":
            b = n
            a = b - long
        after = share * (x[min(b, n - 1)] - x[a])
        x[b:] += x[a] + after - x[min(b, n - 1)]
        x[a:b] = x[a]
        if kind == "counts":
            x = rounded(x, abs(after) / 5.0 * about_one(generator))
            x[a:b] = x[a]
        if kind == "end":
            v[a:] *= generator.choice([1.0, 0.05])
        log = log_of(n, time=t, position=x, velocity=v)
        seen += compare(log, "position", seed)
    assert seen > 5


@pytest.mark.parametrize("kind", ["release", "steps", "counts", "edge"])
def test_a_held_position_without_a_velocity_is_frozen_where_it_comes_back_to_its_path(kind):
    seen = 0
    for seed in range(80):
        generator = np.random.default_rng(seed)
        n = 1000
        t = 1e-3 * np.arange(n)
        q, _ = sines(t, generator)
        a, long = int(generator.integers(100, 700)), int(generator.integers(20, 150))
        if kind == "edge":
            a = int(generator.choice([0, 1, 3, n - long - 4, n - long - 1, n - long]))
        b = a + long
        share = about_one(generator, 4.0) if kind in ("release", "edge") else 1.0
        led = 0.5 * long * abs(np.diff(q)[max(a - 3, 0)] + np.diff(q)[min(b + 3, n - 2)])
        if kind == "release":
            share = generator.choice([0.3, 3.0]) * about_one(generator)
        x = q.copy()
        if b < n:
            x[b:] += x[a] - x[b] + share * led * generator.choice([-1.0, 1.0])
        x[a:b] = x[a]
        if kind == "steps":
            x = x + led / 16.0 * about_one(generator) * (-1.0) ** np.arange(n)
            x[a:b] = x[a]
        if kind == "counts":
            x = rounded(x, led / 6.0 * about_one(generator))
        if generator.random() < 0.3:  # a second encoder is judged like a position
            seen += compare(log_of(n, position=q, second_encoder=x), "second_encoder", seed)
        else:
            seen += compare(log_of(n, position=x), "position", seed)
    assert seen > 5


@pytest.mark.parametrize("kind", ["line", "speed counts", "slack", "leaps", "stands", "alone", "disagree"])
def test_a_held_velocity_is_frozen_where_the_position_leaves_its_line(kind):
    seen = 0
    for seed in range(100):
        generator = np.random.default_rng(seed)
        dt = generator.choice([2e-4, 1e-3, 4e-3])
        n = 1600
        t = dt * np.arange(n)
        q, v = sines(t, generator)
        q, v = q / dt * 1e-3, v / dt * 1e-3
        a, long = int(generator.integers(300, 1000)), int(generator.integers(20, 150))
        b = a + long
        x = v + 0.01 * generator.standard_normal(n) * np.abs(v).max()
        if kind == "alone":
            b = a + int(generator.integers(80, 250))
            x = rounded(x, generator.choice([0.0, 0.005, 0.02, 0.1]) * np.abs(v).max())
        x[a:b] = x[a]
        left = np.abs(q[a:b] - q[a] - x[a] * (t[a:b] - t[a])).max()
        if kind == "slack":
            q = rounded(q, left / (0.5 * (b - a) * max(1.0, dt / 1e-3)) * about_one(generator))
        if kind == "speed counts":
            x = rounded(v, left / 3.0 / (t[b - 1] - t[a]) * about_one(generator))
            x[a:b] = x[a]
        if kind == "leaps":
            at = int(generator.integers(a + 2, b - 2))
            q[at:] += 0.5 * left * about_one(generator)
        if kind == "stands":
            q[a:b] = q[a] + 0.05 * np.quantile(np.abs(v), 0.99) * long * dt * about_one(
                generator
            ) * np.linspace(0.0, 1.0, long)
            q[b:] += q[b - 1] - q[b]
        if kind == "disagree":
            fault = generator.choice(["scale", "delay", "noise"])
            if fault == "scale":
                q = q * (1.0 + 0.15 * about_one(generator) * generator.choice([-1.0, 1.0]))
            if fault == "delay":
                shift = int(max(6.0, 0.03 / dt) * about_one(generator))
                q = np.roll(q, -shift * int(generator.choice([-1, 1])))
            if fault == "noise":
                q = (
                    q
                    + 0.3
                    * about_one(generator)
                    * np.std(q[100:] - q[:-100])
                    * generator.standard_normal(n)
                    * 0.7
                )
        channels = {"velocity": x} if kind == "alone" else {"velocity": x, "position": q}
        seen += compare(log_of(n, time=t, **channels), "velocity", seed)
    assert seen > 5


def test_a_channel_that_never_changes_and_one_with_holes_are_another_matter():
    t = 1e-3 * np.arange(1000)
    x = np.full(1000, 2.0)
    assert standstill_runs(Exam(log_of(1000, position=np.sin(t), torque=x)), "torque", 0) == []
    x[7] = np.nan
    assert standstill_runs(Exam(log_of(1000, position=np.sin(t), torque=x)), "torque", 0) == []


def test_a_torque_that_is_held_where_the_joint_never_moves_is_none_of_its_faults():
    x = np.random.default_rng(1).standard_normal(1000)
    x[500:600] = x[500]
    assert standstill_runs(Exam(log_of(1000, position=np.full(1000, 0.5), torque=x)), "torque", 0) == []
    assert standstill_runs(Exam(log_of(1000, position=1e-3 * np.arange(1000), torque=x)), "torque", 0) == [
        (500, 600)
    ]


def test_of_many_runs_the_two_hundred_longest_are_looked_at():
    """Every run stands at 5 while all else is small; the shortest of 201 is passed over, and the order is that of the log."""
    n = 201 * 50
    x = 0.01 * np.sin(np.arange(n) ** 2)
    for k in range(201):
        x[50 * k + 10 : 50 * k + 30 + (k != 100)] = 5.0
    x[-1] = 9.0  # so that 5 is no limit
    runs = standstill_runs(Exam(log_of(n, position=np.sin(1e-2 * np.arange(n)), torque=x)), "torque", 0)
    assert runs == [(50 * k + 10, 50 * k + 31) for k in range(201) if k != 100]
    x[50 * 7 + 12] = 4.0
    assert (
        len(standstill_runs(Exam(log_of(n, position=np.sin(1e-2 * np.arange(n)), torque=x)), "torque", 0))
        == 200
    )
