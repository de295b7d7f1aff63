"""The torque loop against its rules, tick by tick in plain Python: readings, push while standing, watch, latch, limits, level.

What a compensator and an estimator give is looked up in `test_reference_control.py`; here each has a state of its own, which knows
nothing of an encoder that counts from another zero: where the loop moves positions, this one moves its own zero.
"""

import copy
import pickle
import warnings
from math import copysign, exp, inf, isfinite, nan, tanh

import numba as nb
import numpy as np
import pytest

from _loops import Bench, guarded
from backdrive.control import Admittance, BareLoop, JointLoop, Loop, torque_limit
from backdrive.control.compensators import (
    Dither,
    alg_fc,
    alg_fc2,
    by_law,
    disturbance_observer,
    impulsive,
    lugre_observer,
    nothing,
)
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators.extras import BristleObserver, DisturbanceObserver, Pulses
from backdrive.control.estimators import external as external_
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.control.estimators.level import Adaptation, learn
from backdrive.control.joint_loop import friction_of
from backdrive.errors import InvalidInput, LimitWarning
from backdrive.laws import (
    Coulomb,
    CoulombViscous,
    Decaying,
    Law,
    LuGre,
    Makkar,
    MaxwellSlip,
    Sigmoid,
    StribeckGauss,
)
from backdrive.status import Status

pytestmark = pytest.mark.skipif(
    not nb.config.DISABLE_JIT, reason="runs with NUMBA_DISABLE_JIT=1, as .ci/run does"
)
T, TOP, COUNT = 1e-3, 3.0, 1e-4
RATE = CoulombViscous(coulomb_positive=7.0, coulomb_negative=5.0, viscous_positive=3.0, viscous_negative=2.0)
GOOD = (Status.OK, Status.LATE, Status.NO_MOTION)


class ByHand:
    """One joint of a loop, by the rules that its modules state."""

    def __init__(self, joint, T=T):
        self.joint, self.T = joint, T
        self.zero, self.begun, self.clock, self.cause, self.stopped = 0.0, False, 0.0, None, False
        self.since = self.torque = self.cap = self.faulty = 0.0
        self.bad, self.elsewhere, self.fast, self.slid = 0, None, False, 0.0
        self.level = 1.0 if joint.adaptation is None else joint.adaptation.start
        self.rest(0.0)

    def rest(self, q):
        """Nothing is known but that the joint rests at q."""
        self.at, self.stood, self.still, self.elsewhere, self.since = q, q, 0.0, None, 0.0
        self.older, self.newer, self.fast = (q, 0.0), (q, 0.0), False
        self.force = self.friction = 0.0
        self.parts = []
        for part in (self.joint.compensator, self.joint.external or ExternalForce(inertia=1.0)):
            law = part.friction.law
            self.parts.append((part.row(self.T), law.row(), law.state(), part.start(q)))

    def can(self, way, time):
        return abs(way) <= self.joint.top_speed * (time + self.T) + 2.0 * self.joint.encoder_count

    def count_from(self, q):
        """The encoder counts from another zero: q is where the joint was."""
        self.zero += q - self.at
        self.elsewhere, self.since = None, 0.0

    def judged(self, q, inputs, dt):
        timely = self.T / 20.0 <= dt <= 20.0 * self.T
        self.passed = dt if timely else self.T
        self.clock += self.passed
        self.since += min(dt, 1.0) if 20.0 * self.T < dt < inf else self.passed
        if not self.begun and isfinite(q):
            self.count_from(q)
            self.begun, self.since = True, self.passed
            q = self.at
        if not timely:
            return Status.BAD_INTERVAL
        if not np.all(np.isfinite([q, *inputs])):
            return Status.NOT_FINITE
        if self.elsewhere is not None:
            there, speed, settled = self.elsewhere
            if self.can(q - there, self.passed):
                settled += self.passed
                self.elsewhere = q, speed, settled
                if settled > self.joint.patience / 2.0:
                    self.count_from(q)
                return Status.JUMP
            if not self.can(q - self.at, self.since):
                again = (q - there) / self.passed
                self.elsewhere = q, again, 0.0
                return Status.OVERSPEED if 0.5 <= again / speed <= 2.0 else Status.JUMP
        elif not self.can(q - self.at, self.since):
            self.elsewhere = q, (q - self.at) / self.since, 0.0
            return Status.JUMP
        return Status.LATE if dt > 1.5 * self.T else Status.OK

    def standing(self, q, t):
        """Share of the push that is left: below 5 % at the hold time, from half of it on."""
        hold = self.joint.hold
        if abs(q - self.stood) > 2.5 * self.joint.encoder_count:
            self.stood, self.still = q, 0.0
            return 1.0
        before, self.still = self.still, self.still + t
        if self.still < hold:
            return exp(-6.0 * max(self.still / hold - 0.5, 0.0))
        if before < hold:  # the contact and what is integrated are let go of, what was learned stays
            c, _, x, s = self.parts[0]
            theta = s[compensator_.S_EXTRA + 1]
            x[:], s[compensator_.S_EXTRA :] = 0.0, 0.0
            if c[compensator_.EXTRA] == 2.0:
                s[compensator_.S_EXTRA + 1] = theta
        return 1.0

    def watched(self, q, t):
        """Too fast over the older of two points, which are 5 ms apart: at least 10 ms ago."""
        (a, age), (b, later) = self.older, self.newer
        age, later, span = age + t, later + t, max(0.01, 2.0 * self.T)
        fast = False
        if age >= span * (1.0 - 1e-9):
            fast = self.fast = abs(q - a) > self.joint.top_speed * age
        self.older, self.newer = (a, age), (b, later)
        if later >= 0.5 * span * (1.0 - 1e-9):
            self.older, self.newer = (b, later), (q, 0.0)
        return fast

    def tick(self, q, u, dt, error=0.0, slope=0.0, known=0.0, load=(0.0, 0.0), temperature=20.0):
        code = self.judged(q - self.zero, (u, error, slope, known, *load, temperature), dt)
        q, t, wanted = q - self.zero, self.since, 0.0
        if code in (Status.OK, Status.LATE):
            dp = q - self.at
            left = self.standing(q, t)
            (c, p, x, s), (ce, pe, xe, se) = self.parts
            idle = self.still >= self.joint.hold
            push, wave = compensator_.tick(
                c, 0, p, x, s, 0, q, dp, t, self.clock, error, slope, u - known, load, temperature, idle
            )
            wanted, force, friction = self.level * (left * push + wave), 0.0, 0.0
            if self.joint.external is not None:
                force, friction = external_.tick(
                    ce, 0, pe, xe, se, 0, q, dp, t, u, known, load, temperature, self.level
                )
            if not isfinite(wanted + force + friction):
                self.rest(q)
                code = Status.NOT_FINITE
            else:
                before = self.level
                if (a := self.joint.adaptation) is not None:
                    self.slid = self.slid + t if abs(dp) >= a.slowest * t else 0.0
                    row = a.row(self.joint.external.friction.law)
                    self.level = learn(
                        before, friction / before, force, self.slid, t, row[0], row[2], *row[3:]
                    )
                self.force, self.friction = force, friction
                self.at, self.since, self.elsewhere = q, 0.0, None
                if (
                    self.still >= 0.1 * self.joint.hold
                    and abs(before * left * push) > 0.01 * self.joint.limit
                ):
                    code = Status.NO_MOTION
        self.code = self.act(code, wanted, t, dt)
        return self.code

    def act(self, code, wanted, t, dt):
        joint, out, passed, good = self.joint, self.torque, self.passed, code in GOOD
        if good:
            self.faulty, self.bad = max(self.faulty - passed / 4.0, 0.0), 0
            if self.watched(self.at, t):
                code = Status.OVERSPEED
        else:
            self.faulty += min(dt, 20.0 * passed) if dt > passed else passed
            fading = 1.0 + joint.fade * passed if self.bad else 1.0
            self.bad += 1
            wanted, self.force = out / fading, self.force / fading
        latched = self.cause is not None
        if not latched and (code == Status.OVERSPEED or self.faulty > joint.patience):
            self.cause = code
        if self.cause is not None:
            seconds = 0.02 if self.cause == Status.OVERSPEED else 0.15
            self.cap = max(min(self.cap, abs(out)) - joint.limit / seconds * passed, 0.0)
            wanted, code = out, Status.LATCHED if latched else code
        elif self.stopped:
            self.cap = max(min(self.cap, abs(out)) - joint.limit / joint.ramp * passed, 0.0)
            code = Status.STOPPED if good else code
        elif good:
            self.cap = min(self.cap + joint.limit / joint.ramp * passed, joint.limit)
        if abs(wanted) > joint.limit and code in (Status.OK, Status.LATE):
            code = Status.SATURATED
        rate = joint.rate or max(joint.limit / 0.15, 1000.0 * 7.0)
        f = min(max(wanted, -self.cap), self.cap)
        f = min(max(f, out - rate * passed), out + rate * passed)
        f = min(max(f, -joint.limit), joint.limit)
        if self.bad >= 2:
            self.cap = min(self.cap, abs(f))
        self.torque = f
        return code

    def acknowledge(self):
        if self.cause is not None and (self.torque != 0.0 or self.fast):
            return False
        if self.cause is not None or self.stopped:
            self.cap, self.faulty = min(self.cap, abs(self.torque)), 0.0
        self.cause, self.stopped = None, False
        return True


LEAKY = Law(rate=RATE, element=Decaying(stiffness=3e4, decay_rate=25.0))
CURVE = StribeckGauss(coulomb=5.0, breakaway=7.0, stribeck_velocity=0.05, viscous=2.0)
FORCE = {"inertia": 0.7, "friction": alg_fe(RATE, 3e4), "encoder_count": COUNT, "bandwidth": 50.0}
WITHIN = {"top_speed": TOP, "encoder_count": COUNT, "limit": 9.0}
JOINTS = {
    "learning": (
        alg_fc(RATE, 3e4, dither=Dither(share=0.3), share=0.7),
        {
            "external": ExternalForce(method="momentum", **FORCE),
            "adaptation": Adaptation(slowest=0.2, settle=0.02, time=0.2, lower=0.6, upper=1.2, start=0.9),
        },
    ),
    "pulses": (
        impulsive(RATE, 3e4, Pulses(height=4.0, wait=0.012, tolerance=1e-5), share=0.8),
        {"external": ExternalForce(method="extended", **FORCE), "hold": 0.06, "patience": 0.04},
    ),
    "bristle": (
        lugre_observer(
            CURVE,
            LuGre(stiffness=3e4, damping=9.0),
            BristleObserver(gain=0.5, adaptation=3.0, highest=1.2),
            0.8,
        ),
        {"external": ExternalForce(method="direct", **FORCE), "ramp": 0.2, "fade": 200.0, "rate": 900.0},
    ),
    "observer": (
        disturbance_observer(LEAKY, DisturbanceObserver(inertia=0.6, limit=3.0), 0.8),
        {"external": ExternalForce(method="disturbance", **FORCE), "hold": 0.1},
    ),
    "alone": (
        alg_fc(RATE, 3e4, dither=Dither(share=0.4, mode="adaptive", count=COUNT, window=0.02), share=0.8),
        {"patience": 0.3, "ramp": 0.15},
    ),
}


def story(seed, n):
    """Positions, torques and intervals of a life with all that can go wrong, and what is done to the loop, tick by tick."""
    g = np.random.default_rng(seed)
    q, zero, stuck, speed, out, k = 0.3 * seed, 0.0, 0, 0.0, [], 0
    while len(out) < n:
        k += 1
        if k % 40 == 1:
            stuck = int(g.integers(0, 3) == 0)
            speed = 0.0 if stuck else g.uniform(-1.5, 1.5)
        dt, u, todo, other = T, float(g.normal(0.0, 4.0)), "", {}
        reading_off = 0.0
        event = g.random()
        if event < 0.03:
            dt = float(
                g.choice(
                    [
                        0.0,
                        -T,
                        nan,
                        inf,
                        0.049 * T,
                        0.051 * T,
                        1.49 * T,
                        1.51 * T,
                        19.9 * T,
                        20.1 * T,
                        0.4,
                        3.0,
                    ]
                )
            )
        elif event < 0.045:
            reading_off = float(g.normal(0.0, 0.3))
        elif event < 0.05:
            zero += float(g.normal(0.0, 2.0))
        elif event < 0.055:
            todo = "stop"
        elif event < 0.075:
            todo = "acknowledge"
        elif event < 0.08:
            speed = float(g.choice([-1.0, 1.0]) * g.uniform(2.8, 9.0))
        elif event < 0.1:
            name = str(g.choice(["q", "u", "error", "slope", "known", "motor", "load", "temperature"]))
            other = {name: nan}
        elif event < 0.103:
            other = {"huge": 1.7e308}
        spell = int(g.integers(2, 60)) if event < 0.103 and g.random() < 0.25 and not todo else 1
        for _ in range(spell):
            passed = dt if T / 20.0 <= dt <= 1.0 else T
            q += speed * passed + (0.0 if stuck else 3e-5 * g.normal())
            noise = COUNT * g.uniform(-1.0, 1.0) if stuck else 0.0
            out.append((q + zero + noise + reading_off * g.normal(), u, dt, todo, dict(other)))
            reading_off = float(g.normal(0.0, 0.3)) if reading_off else 0.0
    return out[:n]


def seen(loop):
    return loop.torque[0], loop.external[0], loop.friction[0], loop.level[0]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", JOINTS)
def test_a_joint_lives_by_its_rules(name, seed):
    compensator, changes = JOINTS[name]
    joint = guarded(compensator, **(WITHIN | changes))
    loop, wanted, met = Loop(joint, interval=T), ByHand(joint), set()
    for k, (q, u, dt, todo, other) in enumerate(story(seed, 900)):
        error, slope = 2e-3 * copysign(1.0, k % 300 - 150), 0.01
        inputs = {
            "error": error,
            "slope": slope,
            "known": 0.4,
            "motor": 1.0,
            "load": -2.0,
            "temperature": 25.0,
        }
        q, u = other.pop("q", q), other.pop("u", u)
        if "huge" in other:  # each is finite and so is their sum, but not their difference
            u, inputs["known"] = other["huge"], -other.pop("huge")
        inputs |= other
        for each in ("error", "slope", "known", "temperature"):
            setattr(loop, each, inputs[each])
        loop.load = (inputs["motor"], inputs["load"])
        if todo == "stop":
            loop.stop()
            wanted.stopped = True
        if todo == "acknowledge":
            assert loop.acknowledge() is wanted.acknowledge()
        load = inputs.pop("motor"), inputs.pop("load")
        code = loop.update(np.array([q]), np.array([u]), dt)
        assert code == wanted.tick(q, u, dt, load=load, **inputs), (k, q, dt)
        assert code == loop.codes[0]
        assert loop.causes == (wanted.cause or Status.OK,)
        assert loop.count == k + 1
        met.add(code)
        assert seen(loop) == pytest.approx(
            (wanted.torque, wanted.force, wanted.friction, wanted.level), rel=1e-6, abs=1e-6
        ), k
    assert len(met) >= 7


# ------------------------------------------------------------------------------------------- numbers of a joint


FLAT = CoulombViscous(coulomb_positive=5.0, coulomb_negative=5.0)


def loop_of(compensator=None, *, T=T, **changes):
    """A joint with nothing to compensate, where a compensator is not given; its numbers may be at the ends of what is admitted."""
    good = {"limit": 1.0, "top_speed": 100.0, "encoder_count": 1e-9, "compensator": compensator or nothing()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LimitWarning)
        return Loop(JointLoop(**(good | changes)), interval=T)


def contact(K, share=1.0, F=5.0):
    return by_law(Law(rate=Coulomb(coulomb=F), element=Decaying(stiffness=K)), share=share)


#: What is given, at both ends of what the envelope admits; None: there is no such end.
ENDS = {
    "period": (5e-5, 2e-2, lambda x: loop_of(T=x)),
    "limit": (0.0, 1e5, lambda x: loop_of(limit=x)),
    "top speed": (1e-3, 1e3, lambda x: loop_of(top_speed=x)),
    "encoder": (1e-9, 0.1, lambda x: loop_of(encoder_count=x)),
    "share": (0.0, 1.0, lambda x: loop_of(contact(1.0, share=x))),
    "stiffness": (None, 1e9, lambda x: loop_of(contact(x))),
    "inertia": (1e-7, 1e5, lambda x: loop_of(external=ExternalForce(inertia=x))),
    "friction": (0.0, 1e5, lambda x: loop_of(contact(1.0, F=x))),
    "ramp": (0.15, 60.0, lambda x: loop_of(ramp=x)),
    "hold": (0.05, 2.0, lambda x: loop_of(hold=x)),
    "fade": (10.0, 1e4, lambda x: loop_of(fade=x)),
    "patience": (0.005, 1.0, lambda x: loop_of(patience=x)),
    "levels learned": (None, 1.25, lambda x: loop_of(contact(1.0, 0.8), **learning(x))),
    "levels of a bristle": (None, 1.25, lambda x: loop_of(observing(x, 1.0))),
    # 50 F, and limit/0.15 s
    "rate by friction": (250.0, None, lambda x: loop_of(contact(1.0), rate=x)),
    "rate by the limit": (9e3 / 0.15, None, lambda x: loop_of(contact(1.0), rate=x, limit=9e3)),
    # one encoder step moves the torque by F, and a tenth of the top speed in 10 ms
    "contact": (None, 5e5, lambda x: loop_of(contact(x), encoder_count=1e-5)),
    "contacts": (None, 4e5, lambda x: loop_of(many(x, 1e5), encoder_count=1e-5)),
    "resolution": (None, 2e-3, lambda x: loop_of(encoder_count=x, top_speed=2.0)),
    "resolution of a slow loop": (None, 2e-3, lambda x: loop_of(encoder_count=x, top_speed=2.0, T=0.02)),
}


def many(*stiffness):
    share = (1.0 / len(stiffness),) * len(stiffness)
    return by_law(Law(rate=FLAT, element=MaxwellSlip(stiffness=stiffness, share=share)), share=1.0)


def learning(upper):
    return {"external": ExternalForce(**FORCE), "adaptation": Adaptation(slowest=0.2, upper=upper)}


def observing(highest, adaptation):
    return lugre_observer(
        FLAT, LuGre(stiffness=1.0), BristleObserver(adaptation=adaptation, highest=highest), 0.8
    )


@pytest.mark.parametrize("name", ENDS)
def test_the_ends_of_what_a_loop_admits(name):
    least, most, made = ENDS[name]
    for end, way in ((least, -1.0), (most, 1.0)):
        if end is not None:
            assert made(end).joints[0] is not None
            with pytest.raises(InvalidInput):
                made(end + way * max(1e-3 * end, 1e-12))
            if end == 0.0:
                assert made(1e-3).joints[0] is not None


def test_no_end_where_nothing_is_compensated_or_learned():
    assert loop_of(contact(9e9, share=0.0)) and loop_of(contact(1e3, F=0.0), encoder_count=1e-3)
    assert loop_of(observing(1.5, 0.0)) and loop_of(contact(1.0, 1.0), **learning(1.0))
    with pytest.raises(InvalidInput, match="share"):  # a level below 1 makes no larger share admissible
        loop_of(
            contact(1.0, 1.01),
            external=ExternalForce(**FORCE),
            adaptation=Adaptation(slowest=0.2, upper=0.9, start=0.9),
        )
    with pytest.raises(InvalidInput, match="ExternalForce"):
        loop_of(contact(1.0), adaptation=Adaptation(slowest=0.2))
    with pytest.raises(InvalidInput, match="Coulomb"):
        loop_of(
            contact(1.0), external=ExternalForce(inertia=1.0), adaptation=Adaptation(slowest=0.2, floor=1.0)
        )
    for extra in (BristleObserver(), DisturbanceObserver(inertia=1.0, limit=1.0)):
        with pytest.raises(InvalidInput, match="adapts by itself"):
            loop_of(observing(1.0, 0.0).replace(extra=extra), **learning(1.0))
    for wrong in (True, "1", None, nan):
        with pytest.raises(InvalidInput, match=r"limit .* 0 or more and at most 100000"):
            loop_of(limit=wrong)
        if wrong is not None:
            with pytest.raises(InvalidInput, match="rate"):
                loop_of(rate=wrong)
    with pytest.raises(InvalidInput, match="rate"):
        loop_of(rate=inf)
    for kind in (np.float64(1.0), np.int64(1), 1):
        assert loop_of(limit=kind)
    with pytest.raises(InvalidInput, match=r"in 10 ms .* of 4 or more"):
        JointLoop(limit=1.0, top_speed=2.0, encoder_count=4e-3)


def test_friction_at_rest_and_at_the_top_speed():
    assert friction_of(Law(rate=RATE), 3.0) == pytest.approx((7.0, min(7.0 + 9.0, 5.0 + 6.0)))
    other = CoulombViscous(coulomb_positive=2.0, coulomb_negative=5.0, viscous_positive=1.0)
    assert friction_of(Law(rate=other), 4.0) == pytest.approx((5.0, 5.0))
    smooth = Sigmoid(span=2.0, steepness=9.0, shift=0.1)  # largest at the top speed, against its shift

    def sigmoid(v):
        return tanh(4.5 * (v + 0.1)) - tanh(0.45)

    assert friction_of(Law(rate=smooth), 3.0) == pytest.approx((-sigmoid(-3.0), sigmoid(3.0)))
    peak = Makkar(stribeck=2.0, rise=1e9, fall=1e3, coulomb=0.0, steepness=1.0)  # at the slowest motion
    slowest, fastest = (2.0 * (1.0 - tanh(1e3 * v)) for v in (3e-4, 3.0))
    assert friction_of(Law(rate=peak), 3.0) == pytest.approx((slowest, fastest), abs=1e-12)
    assert BareLoop(compensator=contact(1.0), top_speed=inf).friction == pytest.approx((5.0, 5.0))
    viscous = by_law(Law(rate=RATE))
    assert BareLoop(compensator=viscous, top_speed=inf).friction == pytest.approx((7.0, 5.0 + 2e3))
    assert loop_of(viscous, top_speed=3.0).joints[0].friction == pytest.approx((7.0, 11.0))


def test_the_limit_to_take_and_the_one_that_is_warned_of():
    """1.25 R F(v_top), at least R F with the dither, at most 1.5 R F(v_top): with R = 0.8, F = 5 or 7, F(v_top) = 5 or 11."""
    law = {"stiffness": 1e3, "share": 0.8}
    assert torque_limit(alg_fc(RATE, **law), 3.0) == pytest.approx(1.25 * 0.8 * 11.0)
    for share, wanted in ((0.1, 1.25 * 4.0), (0.3, 4.0 + 1.5), (0.5, 6.0), (1.0, 6.0)):
        made = alg_fc(FLAT, dither=Dither(share=share), **law)
        assert torque_limit(made, 3.0) == pytest.approx(wanted)
    most = {"top_speed": 3.0, "encoder_count": 1e-6, "compensator": alg_fc(RATE, **law)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert JointLoop(limit=1.5 * 0.8 * 11.0, **most)
        assert JointLoop(limit=1e5, **(most | {"compensator": nothing()}))
    with pytest.warns(LimitWarning, match=r"limit = 13\.201 .* = 13\.2 N.*gives 11\.") as found:
        JointLoop(limit=13.201, **most)
    assert found[0].filename == __file__
    with pytest.warns(LimitWarning, match=r"= 0\.6 "):
        JointLoop(limit=0.61, **(most | {"compensator": contact(1.0, 0.8, F=0.5)}))


def test_rates_by_the_limit_and_by_friction():
    """Normal: the larger of limit/0.15 s and 1000 F/s; slow: limit/ramp; latched: limit/0.15 s."""
    one = loop_of(contact(1.0), limit=6.0, ramp=0.4).joints[0]
    assert (one.normal_rate, one.slow_rate, one.latch_rate) == pytest.approx((5000.0, 15.0, 40.0))
    assert loop_of(contact(1.0), limit=900.0).joints[0].normal_rate == pytest.approx(6000.0)
    assert loop_of(contact(1.0), limit=6.0, rate=300.0).joints[0].normal_rate == 300.0
    assert (one.hold, one.fade, one.patience, one.ramp) == (0.5, 50.0, 0.1, 0.4)
    assert loop_of().joints[0].ramp == 0.5
    free = BareLoop()
    assert (free.normal_rate, free.slow_rate, free.latch_rate) == (inf, inf, inf)
    assert (free.limit, free.top_speed, free.hold, free.patience) == (inf, inf, inf, inf)
    assert (free.encoder_count, free.ramp, free.fade, free.external, free.adaptation) == (
        0.0,
        0.0,
        50.0,
        None,
        None,
    )
    some = BareLoop(limit=3.0, ramp=0.5, rate=20.0)
    assert (some.normal_rate, some.slow_rate, some.latch_rate) == (20.0, 6.0, pytest.approx(20.0))


def test_what_may_be_left_off_has_to_be_positive_where_it_is_given():
    for name in ("limit", "top_speed", "fade", "patience", "hold"):
        assert getattr(BareLoop(**{name: 0.25}), name) == 0.25
        for wrong in (0.0, -0.25, nan):
            with pytest.raises(InvalidInput):
                BareLoop(**{name: wrong})
    for name in ("ramp", "encoder_count"):
        assert getattr(BareLoop(**{name: 0.25}), name) == 0.25
        for wrong in (-0.25, nan):
            with pytest.raises(InvalidInput):
                BareLoop(**{name: wrong})
    with pytest.raises(InvalidInput, match="ExternalForce"):
        BareLoop(adaptation=Adaptation(slowest=0.2))


# ------------------------------------------------------------------------------------------------ the loop itself


def two():
    parts = [
        (alg_fc(RATE, 3e4, share=0.7), learning(1.1)),
        (by_law(Law(rate=CURVE, element=MaxwellSlip(stiffness=(1e4, 2e4, 1e4), share=(0.2, 0.5, 0.3)))), {}),
        (lugre_observer(CURVE, LuGre(stiffness=3e4)), {"external": ExternalForce(**FORCE)}),
    ]
    return [guarded(c, **(WITHIN | more)) for c, more in parts]


def drive(loop, n, begin=0, q=0.2):
    """Torque, force, friction, level and codes of every tick, (n, 5, J)."""
    k = begin + np.arange(n)[:, None] + 10 * np.arange(len(loop.joints))
    positions, torques = q + 0.05 * np.sin(k / 30.0), 3.0 * np.cos(k / 20.0)
    out = []
    for position, torque in zip(positions, torques, strict=True):
        loop.update(position, torque)
        out.append(np.stack([loop.torque, loop.external, loop.friction, loop.level, loop.codes]))
    return np.array(out)


def test_joints_of_many_kinds_side_by_side_are_what_each_is_alone():
    together = drive(Loop(two(), interval=T), 260)
    for j, joint in enumerate(two()):
        loop, alone = Loop(joint, interval=T), []
        for k in range(260):
            at = k + 10 * j
            loop.update(np.array([0.2 + 0.05 * np.sin(at / 30.0)]), np.array([3.0 * np.cos(at / 20.0)]))
            alone.append([x[0] for x in (loop.torque, loop.external, loop.friction, loop.level, loop.codes)])
        assert together[:, :, j] == pytest.approx(np.array(alone), rel=1e-12, abs=1e-12)
    assert np.abs(together[:, 1]).max(axis=0) == pytest.approx([1e2, 0.0, 1e2], rel=1.0)


def test_a_loop_is_reset_copied_and_counted():
    loop = Loop(two(), interval=T)
    assert loop.count == 0 and loop.level.tolist() == [1.0] * 3
    first = drive(loop, 120)
    twins = [copy.deepcopy(loop), copy.copy(loop), pickle.loads(pickle.dumps(loop))]
    rest = drive(loop, 80, 120)
    for twin in twins:
        assert twin.interval == T and twin.count == 120
        assert drive(twin, 80, 120) == pytest.approx(rest, abs=0.0)
        assert twin.count == 200
    assert loop.count == 200
    loop.error = 5.0
    loop.stop()
    loop.reset(np.full(3, -0.7))
    assert [x.tolist() for x in (loop.torque, loop.external, loop.friction, loop.error)] == [[0.0] * 3] * 4
    assert (loop.codes.tolist(), loop.count, loop.level.tolist()) == ([0] * 3, 200, [1.0] * 3)
    assert loop.temperature.tolist() == [20.0] * 3
    assert drive(loop, 120) == pytest.approx(first, rel=1e-6, abs=1e-7)
    for wrong in (np.zeros(2), np.array([0.0, nan, 0.0]), np.array([[0.0] * 3])):
        with pytest.raises(InvalidInput):
            loop.reset(wrong)
    assert loop.update(np.zeros(2), np.zeros(3)) == Status.NOT_FINITE
    assert loop.update(np.zeros(3), np.zeros(2)) == Status.NOT_FINITE
    assert loop.update(None, np.zeros(3)) == Status.NOT_FINITE
    assert loop.update(np.zeros(3), np.zeros(3), "soon") == Status.NOT_FINITE
    assert loop.codes.tolist() == [Status.NOT_FINITE] * 3 and loop.count == 324


@pytest.mark.parametrize("name", JOINTS)
def test_the_first_reading_is_where_a_joint_rests(name):
    """As if it had been reset there: nothing jumps, and nothing has to settle."""
    compensator, changes = JOINTS[name]
    if name == "alone":
        dither = Dither(share=0.4, mode="adaptive", count=COUNT, window=0.02)
        compensator = alg_fc2(RATE, 3e4, 0.05, dither=dither)
    unaware, told = (Loop(guarded(compensator, **(WITHIN | changes)), interval=T) for _ in range(2))
    told.reset(np.array([-40.0]))
    q = -40.0 + 2e-3 * np.maximum(np.arange(150) - 60.0, 0.0) ** 0.5
    for k in range(150):
        codes = [loop.update(q[k : k + 1], np.ones(1)) for loop in (unaware, told)]
        assert codes[0] == codes[1] and seen(unaware) == pytest.approx(seen(told), rel=1e-6, abs=1e-6)
    assert abs(unaware.torque[0]) > 0.5


def test_what_is_written_is_read_and_what_is_given_is_not_written():
    loop = Loop(two(), interval=T)
    for name, value in (("error", 0.1), ("slope", 0.2), ("known", 0.3), ("temperature", 40.0)):
        setattr(loop, name, value)
        assert getattr(loop, name).tolist() == [value] * 3
        setattr(loop, name, [1.0, 2.0, 3.0])
        getattr(loop, name)[1] = 7.0
        assert getattr(loop, name).tolist() == [1.0, 7.0, 3.0]
    loop.load = (4.0, 5.0)
    assert loop.load.tolist() == [[4.0, 5.0]] * 3
    for name in ("torque", "external", "friction", "level", "codes"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(loop, name)[0] = 1.0
    with pytest.raises(InvalidInput):
        Loop([], interval=T)
    with pytest.raises(InvalidInput, match="Joint 1"):
        Loop([two()[0], BareLoop()], interval=T)
    assert Bench(BareLoop(), interval=T).joints == (BareLoop(),)


def test_the_worst_of_the_joints_is_told_by_severity():
    """From harmless to grave; a latch is graver than what latched, and what is wrong with one joint is that joint's alone."""
    order = [
        "OK",
        "LATE",
        "NO_MOTION",
        "SATURATED",
        "STOPPED",
        "JUMP",
        "BAD_INTERVAL",
        "NOT_FINITE",
        "OVERSPEED",
        "LATCHED",
    ]
    assert sorted(Status, key=lambda status: status.severity) == [Status[name] for name in order]
    assert [status.severity for status in (Status[name] for name in order)] == list(range(10))
    codes = [
        "OK",
        "NOT_FINITE",
        "BAD_INTERVAL",
        "SATURATED",
        "JUMP",
        "LATE",
        "NO_MOTION",
        "STOPPED",
        "OVERSPEED",
        "LATCHED",
    ]
    assert [Status[name].value for name in codes] == [int(Status[name]) for name in codes] == list(range(10))
    assert all(status.sentence.endswith(".") for status in Status)
    loop = Loop(two(), interval=T)
    loop.reset(np.zeros(3))
    loop.update(np.zeros(3), np.zeros(3))
    assert loop.update(np.array([0.0, 9.0, 0.0]), np.zeros(3)) == Status.JUMP
    assert loop.codes.tolist() == [0, Status.JUMP, 0]
    assert loop.update(np.array([nan, 9.0, 0.0]), np.zeros(3)) == Status.NOT_FINITE
    assert loop.codes.tolist() == [Status.NOT_FINITE, Status.JUMP, 0]
    assert not any(loop.causes)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", ["position", "known", "error", "slope", "motor", "load", "temperature"])
def test_inputs_that_are_beyond_numbers_together_are_not_believed(name):
    loop = Loop(JointLoop(limit=1.0, top_speed=1.0, encoder_count=1e-6), interval=T)
    for huge, wanted in ((0.9e308, Status.OK), (1.7e308, Status.NOT_FINITE)):
        loop.reset(np.zeros(1))
        q = np.zeros(1)
        if name == "position":  # which is not a torque: it is tested by itself
            q[0], wanted = huge, Status.OK
        elif name in ("motor", "load"):
            loop.load = (huge, 0.0) if name == "motor" else (0.0, huge)
        else:
            setattr(loop, name, huge)
        assert loop.update(q, np.array([0.8e308])) == wanted
        assert abs(loop.torque[0]) <= 1.0
        loop.load = 0.0


def test_an_admittance_starts_at_rest_where_it_is():
    a = Admittance(inertia=1.0, viscosity=2.0, proportional=3.0, derivative=4.0, limit=5.0)
    assert a.row().tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert a.start(0.3).tolist() == [0.3, 0.0, 0.3]
    for zero in ("viscosity", "proportional", "derivative"):
        numbers = {"inertia": 0.5, "viscosity": 1.0, "proportional": 1.0, "derivative": 1.0, "limit": 0.5}
        assert getattr(Admittance(**(numbers | {zero: 0.0})), zero) == 0.0
    for name in ("inertia", "viscosity", "proportional", "derivative", "limit"):
        with pytest.raises(InvalidInput):
            Admittance(**(numbers | {name: inf}))
