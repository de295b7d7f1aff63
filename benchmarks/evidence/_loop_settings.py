"""With which numbers the joints of `loop_safety` run: the how-to's, those of the tuner, the smallest that construction accepts."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from _loop_joint import D_C, F_N, F_P, GROWTH, K_C, STRIBECK, TOP, V_S, Joints, M, T, drawn

from backdrive.control import JointLoop, Loop, torque_limit
from backdrive.control.compensators import Compensator, Dither, alg_fc
from backdrive.control.compensators.extras import DisturbanceObserver
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.laws import Polyline
from backdrive.tuning import Facts, Tuning, tune

KNOTS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.3)  # by the top speed
DRAWS = 8  # of the tuner's check, the fewest that it accepts


@dataclass(frozen=True, eq=False)
class Settings:
    """Numbers of a compensator and of its guards, a joint each (J,).

    Attributes:
        words: what they are.
        share: R.
        stiffness: K [N.m/rad].
        decay: alpha [1/s].
        dither: R_d.
        frequency: of the dither [Hz].
        mode: of the dither.
        limit: [N.m].
        top: top speed [rad/s].
        guards: what else `JointLoop` takes.
    """

    words: str
    share: np.ndarray
    stiffness: np.ndarray
    decay: np.ndarray
    dither: np.ndarray
    frequency: np.ndarray
    mode: str
    limit: np.ndarray
    top: np.ndarray
    guards: dict[str, float]


def curve(joints: Joints, j: int, factor: float, top: float) -> Polyline:
    """Return a joint's friction as somebody believes it."""
    p, v = joints.p[:, j], top * np.array(KNOTS)
    shape = factor * (1.0 + p[STRIBECK] * np.exp(-((v / p[V_S]) ** 2)) + p[GROWTH] * v)
    return Polyline(
        velocity=tuple(v.tolist()),
        positive=tuple((p[F_P] * shape).tolist()),
        negative=tuple((p[F_N] * shape).tolist()),
    )


def compensator(s: Settings, joints: Joints, j: int, factor: float, stiffer: float) -> Compensator:
    """Return the compensator of a joint whose friction is believed to be `factor` times what it is."""
    rate = curve(joints, j, factor, float(joints.p[TOP, j]))
    sine = None
    if s.dither[j] > 0.0:
        sine = Dither(share=float(s.dither[j]), frequency=float(s.frequency[j]), mode=s.mode)  # type: ignore[arg-type]
    return alg_fc(rate, stiffer * float(s.stiffness[j]), float(s.decay[j]), sine, float(s.share[j]))


def loops(
    s: Settings,
    joints: Joints,
    factor: float | np.ndarray = 1.0,
    stiffer: float = 1.0,
    inertia: float | np.ndarray = 1.0,
    observer: bool = False,
    limit: Callable[[Compensator, float], float] | None = None,
) -> list[JointLoop]:
    """Return what runs on every joint; believed friction, stiffness and inertia by what they are; `limit`: taken from the model."""
    found, J = [], len(joints)
    factors, inertias = np.broadcast_to(factor, J), np.broadcast_to(inertia, J)
    for j in range(J):
        own = compensator(s, joints, j, float(factors[j]), stiffer)
        mass, contact = float(joints.p[M, j] * inertias[j]), own.friction.law.element
        if observer:
            F = float(joints.friction(0.0)[j])
            own = own.replace(extra=DisturbanceObserver(inertia=mass, limit=F), dither=None)
        external = ExternalForce(inertia=mass, friction=alg_fe(own.friction.law.rate, contact.stiffness))  # type: ignore[attr-defined]
        top = float(s.top[j])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of limits above 1.5 R F of a model that is wrong on purpose
            found.append(
                JointLoop(
                    compensator=own,
                    external=external,
                    limit=float(s.limit[j]) if limit is None else limit(own, top),
                    top_speed=top,
                    encoder_count=float(joints.count[j]),
                    **s.guards,  # type: ignore[arg-type]
                )
            )
    return found


def limits(rng: np.random.Generator, joints: Joints, share: np.ndarray) -> np.ndarray:
    """Return 1.5 R F(top) of the true joint for half of the joints, 1 to 1.5 times R F(top) for the others [N.m]."""
    by = np.where(rng.random(len(joints)) < 0.5, 1.5, rng.uniform(1.0, 1.5, len(joints)))
    return by * share * joints.friction(joints.p[TOP])


def how_to(rng: np.random.Generator, joints: Joints) -> Settings:
    """Return docs/how-to/compensate-a-joint.md: R 0.8, K half the contact's, alpha 20, dither 0.3 at 15 Hz."""
    J = len(joints)
    share = np.full(J, 0.8)
    return Settings(
        "how-to's", share, 0.5 * joints.p[K_C], np.full(J, 20.0), np.full(J, 0.3), np.full(J, 15.0), "fixed",
        limits(rng, joints, share), joints.p[TOP].copy(), {},
    )  # fmt: skip


def accepted(**changes: float) -> bool:
    """Return whether construction accepts a joint with these guards."""
    usual = {"limit": 10.0, "top_speed": 3.0, "encoder_count": 1e-4}
    try:
        Loop(JointLoop(**{**usual, **changes}), interval=T)  # type: ignore[arg-type]
    except InvalidInput:
        return False
    return True


def smallest(name: str, usual: float, **others: float) -> float:
    """Return the smallest value of a guard that construction accepts, by bisection."""
    if accepted(**{name: 0.0}, **others):
        return 0.0
    low, high = 1e-12, usual
    for _ in range(60):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if accepted(**{name: middle}, **others) else (middle, high)
    return high


def least(rng: np.random.Generator, joints: Joints) -> Settings:
    """Return the how-to's numbers behind the smallest top speed, patience, ramp and hold that construction accepts.

    The smallest limit is 0, by which nothing is given: so a quarter of the joints have it, the others 0.001 to 0.3 F.
    """
    s = how_to(rng, joints)
    guards = {
        name: smallest(name, usual) for name, usual in (("patience", 0.1), ("ramp", 0.5), ("hold", 0.5))
    }
    count = 1e-4
    top = smallest("top_speed", 3.0, encoder_count=count) / count * joints.count
    top = np.array([t * (1.0 + 1e-9) for t in top])
    limit = 10.0 ** rng.uniform(-3.0, np.log10(0.3), len(joints)) * joints.friction(0.0)
    limit[rng.random(len(joints)) < 0.25] = smallest("limit", 10.0)
    return Settings(
        "smallest", s.share, s.stiffness, s.decay, s.dither, s.frequency, s.mode, limit, top, guards
    )


def facts(joints: Joints, j: int) -> Facts:
    """Return a joint as it is known."""
    p, name = joints.p[:, j], f"joint_{j}"
    F, K, mass = 0.5 * float(p[F_P] + p[F_N]) * (1.0 + p[STRIBECK]), float(p[K_C]), float(p[M])
    return Facts(
        name=name,
        unit="rad",
        rate=curve(joints, j, 1.0, float(p[TOP])),
        coulomb=float(F),
        stiffness=K,
        stiffness_interval=(0.8 * K, 1.2 * K),
        inertia=mass,
        inertia_interval=(0.9 * mass, 1.1 * mass),
        count=float(joints.count[j]),
        delay=float(joints.delay[j]) * T,
        interval=T,
        top_speed=float(p[TOP]),
    )


def tuned(seed: int, low: float, high: float) -> tuple[Joints, Tuning, list[str]]:
    """Return a joint with F/M between two ends [rad/s^2] that the tuner accepts, its tuning, and why it refused others before."""
    rng, refused = np.random.default_rng([7, seed]), []
    while True:
        one, ratio = drawn(rng, 1), low * (high / low) ** rng.random()
        by = one.p[F_P] / one.p[M] / ratio
        one = one.with_(M=one.p[M] * by, D_C=one.p[D_C] * np.sqrt(by))
        try:
            found = tune(facts(one, 0), joints=DRAWS, trip_speed=float(one.p[TOP, 0]))
        except NotIdentifiable as error:
            refused.append(str(error).split(". ")[0])
            continue
        print(
            f"  tuned: F/M {ratio:.1f} rad/s^2, delay {one.delay[0]} ticks: R {found['share']:.3f}, K/K_c "
            f"{found['stiffness'] / one.p[K_C, 0]:.3f}, alpha {found['decay_rate']:.1f} 1/s, R_d {found['dither_share']:.2f}"
        )
        for why in refused:
            print(f"    refused before: {why}")
        return one, found, refused


def handed_on(one: Joints, tuning: Tuning) -> bool:
    """Return whether `Tuning.loop` hands on what is played here, and finite guards, with R below the least friction."""
    loop, top = tuning.loop(), float(one.p[TOP, 0])
    mine = Tuned([one], [tuning]).settings(np.random.default_rng(0), one)
    return (
        loop.compensator == compensator(mine, one, 0, 1.0, 1.0)
        and (loop.top_speed, loop.encoder_count) == (top, facts(one, 0).count)
        and 0.0 < loop.limit <= torque_limit(loop.compensator, top)
        and tuning["share"] <= facts(one, 0).friction[0]
    )


@dataclass(frozen=True, eq=False)
class Tuned:
    """Joints that were tuned for real, and what runs on them."""

    joints: list[Joints]
    tunings: list[Tuning]

    def draw(self, rng: np.random.Generator, n: int) -> Joints:
        """Return draws of them, which differ in delay (the tuned one is the longest) and encoder phase."""
        at = np.arange(n) % len(self.joints)
        delay = np.concatenate([one.delay for one in self.joints])[at]
        return Joints(
            np.concatenate([one.p for one in self.joints], axis=1)[:, at],
            np.concatenate([one.count for one in self.joints])[at],
            rng.random(n),
            rng.integers(1, delay + 1),
        )

    def settings(self, rng: np.random.Generator, joints: Joints) -> Settings:
        """Return the numbers of draws as `draw` returns them."""
        at = np.arange(len(joints)) % len(self.joints)

        def number(name: str) -> np.ndarray:
            return np.array([self.tunings[i][name] for i in at])

        share = number("share")
        return Settings(
            "tuned", share, number("stiffness"), number("decay_rate"), number("dither_share"),
            number("dither_frequency"), "reset", limits(rng, joints, share), joints.p[TOP].copy(), {},
        )  # fmt: skip
