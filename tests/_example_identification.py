"""Identifications made of arithmetic, to be shown: six ordinary joints, and six that a hostile file might name."""

from __future__ import annotations

import math

import numpy as np

from backdrive.identification.result import Curve, Identification, JointEvidence, Samples
from backdrive.laws import CoulombViscous, Law, Polyline
from backdrive.logs.log import Joint, Source
from backdrive.model import Estimate, FrictionModel, JointFriction, Quality, Validity

HOSTILE = (
    "<script>alert(1)</script>",
    '</style><img src="x" onerror="alert(1)">',
    "joint 🤖 \u202etxet desrever",
    "L" * 200,
    "a\x00b\x1b[31m& \"quoted\" 'single' $x_1^{$",
    "]]> --> </details></svg>",
)
ORDINARY = tuple(f"joint_{i}" for i in range(1, 7))
SHARES = np.array([0.005, 0.015, 0.03, 0.06, 0.12, 0.25, 0.4, 0.6, 0.8, 1.0])
COMMAND = "backdrive identify run1.csv run2.csv --method sweep -o model.json --report report.html"


def stribeck(speed, coulomb, rise, decay, viscous):
    """Friction magnitude at a speed >= 0."""
    return coulomb + rise * np.exp(-speed / decay) + viscous * speed


def _law(i, scale, top):
    if i == 4:
        return Law(
            rate=CoulombViscous(
                coulomb_positive=3.21 * scale,
                coulomb_negative=2.87 * scale,
                viscous_positive=1.05 * scale,
                viscous_negative=0.0,
            )
        )
    speed = SHARES * top
    forward = stribeck(speed, 6.0, 1.8, 0.06 * top, 2.4 / top) * scale
    backward = stribeck(speed, 5.5, 1.2, 0.06 * top, 2.9 / top) * scale
    return Law(rate=Polyline(velocity=tuple(speed), positive=tuple(forward), negative=tuple(backward)))


def _errors(law, scale, known):
    unknown = math.nan
    if isinstance(law.rate, CoulombViscous):
        return {name: 0.043 * scale if known else unknown for name in law.rate.PARAMETERS}
    n = len(law.rate.velocity)
    spread = tuple(scale * (0.05 + 0.12 * math.exp(-k)) if known else unknown for k in range(n))
    return {"positive": spread, "negative": spread}


def curve_of(law, top, error, points=121):
    one = top * np.linspace(0.0, 1.0, points) ** 2
    one[0] = 1e-6 * top
    velocity = np.concatenate([-one[::-1], one])
    return Curve(
        velocity=velocity,
        torque=law.torque(velocity),
        standard_error=error * (1.0 + 2.0 * np.exp(-np.abs(velocity) / (0.05 * top))),
    )


def _samples(law, rng, n, top, noise, inertia, offset, position):
    time = np.linspace(0.0, 42.0, n)
    phase = 2.0 * np.pi * time / 10.5
    velocity = top * np.sin(phase) * np.linspace(0.15, 1.0, n)
    q = np.cumsum(velocity) * (time[1] - time[0])
    acceleration = np.gradient(velocity, time)
    friction = law.torque(velocity) + noise * rng.standard_normal(n)
    friction += 0.6 * noise * np.sin(3 * q)  # a structure that the model lacks
    rest = inertia * acceleration + offset
    held = (time > 15.0) & (time < 24.0)
    return Samples(
        time=time,
        position=q if position else np.full(n, np.nan),
        velocity=velocity,
        torque=friction + rest,
        friction=friction,
        predicted=law.torque(velocity) + rest,
        fitted=~held,
    )


def example(names=ORDINARY, samples=4000, seed=3):
    """Return an identification of some joints.

    The second has no position, the third unknown standard errors, the fourth a linear unit and a presliding loop, the fifth
    a parameter at its bound and nothing held out, the sixth no quality at all.
    """
    rng = np.random.default_rng(seed)
    joints, evidence = [], []
    for i, name in enumerate(names):
        scale, top = (1.0, 2.0) if i != 3 else (40.0, 0.35)
        scale /= 1.0 + 0.6 * i if i != 3 else 1.0
        law = _law(i, scale, top)
        known = i != 2
        inertia, offset = 1.6 / (1 + i), 0.12 * scale
        seen = _samples(law, rng, samples, top, 0.35 * scale * (1 + (i == 1) * 3), inertia, offset, i != 1)
        residual = 100 * float(np.linalg.norm(seen.residual) / np.linalg.norm(seen.torque))
        quality = Quality(
            residual=0.6 * residual, residual_raw=residual, rms=float(np.std(seen.residual)), samples=60_000
        )
        held = None
        if i not in (4, 5):
            held = Quality(
                residual=0.66 * residual,
                residual_raw=1.07 * residual,
                rms=1.05 * float(np.std(seen.residual)),
                samples=12_800,
            )
        joint = Joint(
            name=name,
            unit="m" if i == 3 else "rad",
            torque_side="motor" if i == 0 else "joint",
            gear_ratio=101.0 if i == 0 else 1.0,
            encoder_counts=16384.0 if i == 3 else None,
        )
        unit = joint.torque_unit
        warnings = ()
        if i == 1:
            warnings = (
                "The velocity lags the torque by 1.8 samples: a slip of one sample biases this curve by 0.04 N.m.",
                "Knots below 0.02 rad/s rest on fewer than 30 samples each & are <not> to be trusted.",
            )
        if i == 4:
            warnings = (
                "viscous_negative ended at its lower bound of 0: the sign of the torque may be wrong.",
            )
        joints.append(
            JointFriction(
                joint=joint,
                law=law,
                standard_errors=_errors(law, scale, known),
                at_bound=("viscous_negative",) if i == 4 else (),
                dynamics={
                    "inertia": Estimate(
                        value=inertia, unit="kg" if i == 3 else "kg.m^2", standard_error=0.0123 * inertia
                    ),
                    "offset": Estimate(value=offset, unit=unit, standard_error=math.nan if i == 2 else 0.004),
                    "gravity_sin": Estimate(value=-0.0412 * scale, unit=unit, standard_error=0.011),
                },
                validity=Validity(
                    velocity=(float(seen.velocity.min()), float(seen.velocity.max())),
                    load=(-8.13, 9.42) if i == 0 else None,
                    temperature=(24.0, 31.5) if i == 0 else None,
                ),
                fitted=quality if i != 5 else None,
                held_out=held,
                method="motion",
                warnings=warnings,
            )
        )
        slow, fast = law.torque(np.array([0.02 * top, top]))
        loop = None
        if i == 3:
            turn = np.concatenate([np.linspace(0, 1, 150), np.linspace(1, -1, 300), np.linspace(-1, 1, 300)])
            lag = 0.2 * (1.0 - turn**2) * np.sign(np.gradient(turn)) * (np.arange(turn.size) > 150)
            loop = np.column_stack([4.1e-5 * (turn - lag), 180.0 * turn])
        evidence.append(
            JointEvidence(
                joint=name,
                samples=seen,
                curve=curve_of(law, top, 0.03 * scale if known else math.nan),
                verdict=f"Friction is {slow:.3g} {unit} at low speed and {fast:.3g} {unit} at {top:.3g} {joint.unit}/s. "
                f"The model explains all but {(held or quality).residual:.1f} % of torque it had not seen: good.",
                presliding=loop,
            )
        )
    model = FrictionModel(
        joints=tuple(joints),
        sources=(
            Source(path="logs/2024-03-11/run1 <left arm>.csv", sha256="9f86d081884c7d659a2feaa0c55ad015" * 2),
            Source(path="logs/2024-03-11/run2.csv", sha256="60303ae22b998861bce3b28f33eec1be" * 2),
        ),
        options={"method": "motion", "map": "t=t,q=qm,tau=35.15*vir", "folds": 5, "seed": None},
        version="0.1.0",
    )
    return Identification(
        model=model,
        evidence=tuple(evidence),
        method="motion",
        reason="The joint moves freely and the log holds position and torque, so the inverse dynamics of one axis were used.",
        warnings=(
            "The two logs were recorded 4.2 degC apart; friction of a cold gear can differ by a third.",
        ),
    )


def truths(result):
    """Return a true curve per joint, 3 % above the identified one."""
    return {
        e.joint: Curve(
            velocity=e.curve.velocity,
            torque=1.03 * e.curve.torque,
            standard_error=np.zeros(e.curve.torque.size),
        )
        for e in result.evidence
    }
