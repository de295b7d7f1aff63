"""The data of a joint that tuning needs: intervals from a model file or from the user.

A `FrictionModel` contains the friction law, usually an inertia, and sometimes a stiffness (that of a presliding element).
Other data are options or typical values of such joints, which `notes` then states.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from backdrive._arguments import NUMBER, check_arguments
from backdrive.errors import InvalidInput, NotIdentifiable
from backdrive.identification.dynamics import growth_with_load
from backdrive.laws import REFERENCE, Growth, Law, Polyline
from backdrive.laws.base import Rate
from backdrive.model import Actuator, JointFriction
from backdrive.tuning import rules
from backdrive.tuning.bounds import BOUNDS, between, check_numbers

Interval = tuple[float, float]  # lower and upper end

FRICTION_ERROR = 0.1  # default variation of the identified friction from day to day [-]
STIFFNESS_ERROR = 0.2  # where no interval is known [-]
INERTIA_ERROR = 0.2  # where no interval is known [-]
MOTOR_SHARE = 0.15  # of the inertia on the motor's side, as of the joints in `plants.thesis` [-]
DAMPING = (0.03, 0.15)  # ratio of the transmission's damping, load stuck, and of the contact's [-]
CONTACT = (
    1.0,
    8.0,
)  # ratio of the friction contact's stiffness to that of the transmission in series with it [-]
COARSE = 2.0  # F/(K count) below which no elastic compensation is possible [-]
SOFTEST = 0.1  # smallest K in the search, relative to the lower end of K_c's interval [-]
SPEEDS = 14  # knots of a curve that approximates a law
CHECKED = (
    "coulomb", "count", "interval", "top_speed", "friction", "damping", "contact", "motor_share", "noise", "delay", "temperature",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Facts:
    """The known data of a joint.

    Attributes:
        name: of the joint.
        unit: `rad` or `m`.
        rate: rate law that the compensator runs.
        growth: of friction with the load that the joint carries; None where the model does not know it.
        coulomb: F, the mean of both directions [N.m or N].
        friction: interval of the factor on friction [-].
        stiffness: K_c, the presliding stiffness at the encoder: transmission and contact in series, likely value [N.m/rad or
            N/m].
        stiffness_interval: of K_c [N.m/rad or N/m].
        inertia: of motor and load together [kg.m^2 or kg].
        inertia_interval: of it [kg.m^2 or kg].
        motor_share: of the inertia, on the motor's side [-].
        damping: interval of the damping ratios: D/(2 sqrt(K_c M)) of the transmission, the same of the contact and the load [-].
        contact: interval of the contact's stiffness divided by the transmission's [-].
        count: step of the encoder [rad or m].
        noise: standard deviation of a reading, in counts [1].
        delay: longest time from the command to the torque, beyond the hold [s].
        interval: sampling time T [s].
        temperature: interval of it [degC].
        top_speed: largest speed in the model's data [rad/s or m/s].
        trip_speed: speed above which the robot itself stops the joint, if the model contains it [rad/s or m/s].
        effort: largest torque of the actuator that the model knows [N.m or N].
        notes: what was assumed, in sentences.
    """

    name: str
    unit: str
    rate: Rate
    coulomb: float
    stiffness: float
    stiffness_interval: Interval
    inertia: float
    inertia_interval: Interval
    count: float
    top_speed: float
    friction: Interval = (1.0 - FRICTION_ERROR, 1.0 + FRICTION_ERROR)
    motor_share: float = MOTOR_SHARE
    damping: Interval = DAMPING
    contact: Interval = CONTACT
    growth: Growth | None = None
    noise: float = 0.0
    delay: float = 1e-3
    interval: float = 1e-3
    temperature: Interval = (REFERENCE, REFERENCE)
    trip_speed: float | None = None
    effort: float = np.inf
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self):
        check_numbers(
            f"Joint '{self.name}'",
            **{name: getattr(self, name) for name in CHECKED},
            **{name: getattr(self, f"{name}_interval") for name in ("stiffness", "inertia")},
        )
        if self.stiffest < SOFTEST * self.stiffness_interval[0]:
            force = "N.m" if self.unit == "rad" else "N"
            raise NotIdentifiable(
                f"Joint '{self.name}': its encoder is too coarse for any elastic compensation. Even with a contact of K_c/10 "
                f"the torque changes by {0.1 * self.stiffness_interval[0] * self.count:.3g} {force} in a count. F is "
                f"{self.coulomb:.3g} {force}, and F/(K count) must be at least {COARSE:g}.",
                remedy="Use an encoder with more counts, on the motor's side of the gear; or compensate at the desired instead "
                "of the measured velocity; or, for estimates, use CT with a dead zone of one count per tick "
                "(`backdrive.control.estimators.friction.ct`).",
            )

    @property
    def stiffest(self) -> float:
        """Largest K: it slides after the joint (F/K >= F_c/K_c), and one count changes the torque by at most F/2 [N.m/rad or
        N/m].
        """
        soft = rules.largest_stiffness(self.stiffness_interval[0], self.friction[1] - 1.0)
        return min(soft, self.coulomb / (COARSE * self.count))

    @property
    def friction_error(self) -> float:
        """Largest relative error of the identified friction [-]."""
        return max(1.0 - self.friction[0], self.friction[1] - 1.0)

    def replace(self, **changes: Any) -> Facts:
        """Return a copy with some fields changed."""
        return replace(self, **changes)


def curve_of(law: Law, top: float, *, factor: float = 1.0, temperature: float = REFERENCE) -> Polyline:
    """Return friction without load as a polyline, scaled, at a temperature.

    Args:
        law: whose curve.
        top: fastest knot [rad/s or m/s].
        factor: on the friction [-].
        temperature: [degC].
    """
    speeds = np.concatenate([[top / 500.0], np.geomspace(top / 100.0, top, SPEEDS - 1)])
    branches = []
    for way in (1.0, -1.0):
        torque = way * law.torque(way * speeds, temperature=temperature)
        branches.append(tuple(np.maximum(factor * torque, 0.0).tolist()))
    return Polyline(velocity=tuple(speeds.tolist()), positive=branches[0], negative=branches[1])


def scale_rate(rate: Rate, share: float, top: float) -> Rate:
    """Return a rate law scaled, itself for a share of 1.

    Args:
        rate: the law.
        share: R, the factor [-].
        top: fastest knot of the curve that stands for it [rad/s or m/s].
    """
    return rate if share == 1.0 else curve_of(Law(rate=rate), top, factor=share)


def facts_of(  # noqa: PLR0913  (the facts of a joint, each by its name)
    friction: JointFriction,
    *,
    stiffness: Interval | float | None = None,
    inertia: Interval | float | None = None,
    motor_share: float | None = None,
    counts: float | None = None,
    noise: float = 0.0,
    delay: float | None = None,
    interval: float = 1e-3,
    friction_error: float | None = None,
    damping: Interval = DAMPING,
    temperature: Interval | None = None,
) -> Facts:
    """Return the data of a joint from a model and from the user's options.

    Args:
        friction: of the model.
        stiffness: K_c, an interval or a value [N.m/rad or N/m]; None: of the law's presliding element.
        inertia: of motor and load, an interval or a value [kg.m^2 or kg]; None: the model's.
        motor_share: of the inertia, on the motor's side [-]; None: 0.15.
        counts: of the encoder per rad or m at the joint; None: the model's.
        noise: of a reading, in counts [1].
        delay: longest, from the command to the torque [s]; None: one sampling time.
        interval: sampling time [s].
        friction_error: largest relative error of friction from day to day [-]; None: 0.1. A wider interval of the model
            replaces it.
        damping: interval of the transmission's damping ratio [-].
        temperature: interval [degC]; None: the model's range.

    Raises:
        NotIdentifiable: stiffness, inertia or encoder count is unknown; there is no friction; the encoder is too coarse.
        InvalidInput: a number makes no sense.
    """
    joint, law, actuator = friction.joint, friction.law, friction.actuator or Actuator()
    check_arguments({"noise": NUMBER, "interval": NUMBER}, {"noise": noise, "interval": interval})
    check_numbers(
        f"Joint '{joint.name}'",
        stiffness=stiffness,
        inertia=inertia,
        motor_share=motor_share,
        counts=counts,
        noise=noise,
        delay=delay,
        interval=interval,
        friction_error=friction_error,
        damping=damping,
        temperature=temperature,
    )
    notes = [f"The model warns: {warning}" for warning in friction.warnings]
    top = max(abs(v) for v in friction.validity.velocity)
    if not 0.0 < top < np.inf:
        top = 1.0 if joint.unit == "rad" else 0.2
        notes.append(f"The model has no range of velocity; {top:g} {joint.unit}/s is taken.")
    warm = temperature or friction.validity.temperature or (REFERENCE, REFERENCE)
    coulomb = 0.0 if law.rate.SMOOTH else float(np.mean(Law(rate=law.rate).coulomb()))
    if not coulomb > 0.0:
        raise NotIdentifiable(
            f"Joint '{joint.name}': the law '{law.rate.NAME}' has no Coulomb friction at rest.",
            remedy="At rest such a law needs no compensation; in motion, R times its curve at the measured velocity is "
            "sufficient. Otherwise identify a law with Coulomb friction: `backdrive identify --law stribeck-gauss`, or without "
            "--law.",
        )
    error = FRICTION_ERROR if friction_error is None else friction_error
    known = coulomb_error(friction, coulomb)
    if known is None and friction_error is None:
        notes.append(
            f"The model has no intervals: an error of {100 * error:.0f} % is assumed for friction (--friction-error)."
        )
    if known is not None and known > error:
        error = known
        notes.append(f"The model's Coulomb torque is uncertain by {100 * known:.0f} % (95 %).")
    if not BOUNDS["friction_error"].holds(error):  # the model's own
        raise NotIdentifiable(
            f"Joint '{joint.name}': the error of the model's friction is {100 * error:.0f} % only.",
            remedy="Identify it better: a slower sweep, more cycles.",
        )
    elif known is not None and friction_error is None:
        notes.append(
            f"Friction is taken to vary by up to {100 * error:.0f} % from day to day (--friction-error)."
        )
    low, high = _load_range(friction, coulomb, error, notes)
    K_c, K_ends = _stiffness(friction, stiffness, notes)
    found = friction.dynamics.get("inertia")
    known_inertia = (found.value, found.standard_error) if found is not None else None
    inertia_value, I_ends = between(inertia, known_inertia, INERTIA_ERROR, "inertia", joint.name, notes)
    if motor_share is None:
        notes.append(f"The motor's share of the inertia is taken as {MOTOR_SHARE:g} (--motor-share).")
    counts = joint.encoder_counts if counts is None else counts
    if counts is None:
        raise NotIdentifiable(
            f"Joint '{joint.name}': the model does not say how many counts its encoder has.",
            remedy="Give --counts, per rad or m at the joint (65536 a motor turn behind a gear of 100: 1043038).",
        )
    return Facts(
        name=joint.name,
        unit=joint.unit,
        rate=law.rate,
        growth=law.growth,
        coulomb=coulomb,
        friction=(1.0 - error - low, 1.0 + error + high),
        stiffness=K_c,
        stiffness_interval=K_ends,
        inertia=inertia_value,
        inertia_interval=I_ends,
        motor_share=MOTOR_SHARE if motor_share is None else motor_share,
        damping=damping,
        count=1.0 / counts,
        noise=noise,
        delay=interval if delay is None else delay,
        interval=interval,
        temperature=warm,
        top_speed=top,
        trip_speed=actuator.trip_speed,
        effort=np.inf if actuator.torque_limit is None else actuator.torque_limit,
        notes=tuple(notes),
    )


def _load_range(
    friction: JointFriction, coulomb: float, error: float, notes: list[str]
) -> tuple[float, float]:
    """Return the largest decrease and increase of friction with the load of the joint, relative to F [-]."""
    found = growth_with_load(friction)
    if found is None:
        return 0.0, 0.0
    mu, carried = found
    gravity = [friction.dynamics[k].value for k in ("gravity_sin", "gravity_cos") if k in friction.dynamics]
    most = max(float(np.linalg.norm(gravity)), carried)
    low, high = max(mu * carried, 0.0) / coulomb, max(mu * (most - carried), 0.0) / coulomb
    if not 1.0 - error - low > 0.2:
        raise NotIdentifiable(
            f"Joint '{friction.joint.name}': its friction grows so strongly with the load that less than a fifth remains "
            f"without load.",
            remedy="Identify it with less load, and compensate with a law that depends on the load.",
        )
    notes.append(
        f"Friction grows with the load. Without load it is {100 * low:.0f} % below the curve, under {most:.3g} "
        f"{friction.joint.torque_unit} {100 * high:.0f} % above it. The intervals include this."
    )
    return low, high


def coulomb_error(friction: JointFriction, coulomb: float) -> float | None:
    """Return the half-width of F's 95 % interval divided by F, from the standard errors of its law; None without these."""
    rate, total, seen = friction.law.rate, 0.0, False
    for name in rate.PARAMETERS:
        value, error = getattr(rate, name), friction.standard_errors.get(name)
        if error is None:
            continue
        many = rate.PARAMETERS[name].many
        values, errors = (value, error) if many else ((value,), (error,))
        for i, e in enumerate(np.atleast_1d(np.asarray(errors, dtype=float))):
            if not np.isfinite(e) or e == 0.0:
                continue
            seen = True
            moved = list(values)
            moved[i] += 1e-3 * e
            try:
                other = Law(rate=type(rate)(**{**rate.values(), name: tuple(moved) if many else moved[0]}))
            except InvalidInput:  # at its bound
                continue
            total += ((float(np.mean(other.coulomb())) - coulomb) / 1e-3) ** 2
    return 1.96 * float(np.sqrt(total)) / coulomb if seen else None


def _stiffness(friction: JointFriction, given: Any, notes: list[str]) -> tuple[float, Interval]:
    element, name = friction.law.element, friction.joint.name
    value = getattr(element, "stiffness", None)
    if given is not None or value is None:
        if given is None:
            raise NotIdentifiable(
                f"Joint '{name}': the law '{friction.law.name}' has no presliding stiffness.",
                remedy="Give --stiffness LOW:HIGH of the transmission, from its catalogue or from `backdrive plan ramp` and "
                "`backdrive identify --law auto`. Without it, friction can still be compensated in motion, by R times the "
                "curve at the desired velocity.",
            )
        return between(given, None, STIFFNESS_ERROR, "stiffness", name, notes)
    error = friction.standard_errors.get("stiffness")
    K = float(np.sum(value))  # elements side by side
    spread = None if error is None else float(np.sqrt(np.sum(np.square(np.atleast_1d(error)))))
    return between(
        None, (K, float("nan") if spread is None else spread), STIFFNESS_ERROR, "stiffness", name, notes
    )
