"""The faults of `loop_safety`: what each does to model and readings, what is promised of it, and whether it holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import _loop_scenes as scenes
import numpy as np
from _loop_joint import ABOVE, OUT, Joints, T
from _loop_scenes import Fault, Record, ticks
from _loop_settings import Settings

from backdrive.status import Status

OK, NO_MOTION, OVERSPEED, LATCHED = Status.OK, Status.NO_MOTION, Status.OVERSPEED, Status.LATCHED
QUIET = {OK, Status.SATURATED, NO_MOTION, OVERSPEED, LATCHED}  # what a loop with sound readings may say
LONGER, GONE, SEEN = (
    0.05,
    0.2,
    0.025,
)  # longer above 1.2 top speed; zero after latching; above it, from which on it is latched [s]


@dataclass(frozen=True)
class Case:
    """A fault and what is done about it.

    Attributes:
        done: `named`, or `bounded` without a name.
        status: by which it is named in every draw where it acts.
        why: it is so.
        model: what `settings.loops` is told of friction, stiffness, inertia.
        make: of the readings: rng, scene length in ticks, joints -> Fault.
        may: statuses that may be seen besides those of a loop with sound readings.
        blind: the speed cannot be seen while the fault lasts.
    """

    done: str
    status: Status | None
    why: str
    model: dict = field(default_factory=dict)
    make: Callable[[np.random.Generator, int, Joints], Fault] = lambda rng, n, joints: Fault()
    may: frozenset[Status] = frozenset()
    blind: bool = False


def frozen(rng: np.random.Generator, n: int, joints: Joints) -> Fault:
    """Return readings that stand still from somewhere in 0.75 to 1.5 s on: half of them for ever, half for a second."""
    begin = rng.integers(ticks(0.75), ticks(1.5), len(joints))
    return Fault(frozen=np.stack([begin, np.where(rng.random(len(joints)) < 0.5, n, begin + ticks(1.0))]))


def missing(told: bool) -> Callable[[np.random.Generator, int, Joints], Fault]:
    """Return calls of which every third is missed at random."""
    return lambda rng, n, joints: Fault(missed=rng.random(n) < 1.0 / 3.0, told=told)


def cases() -> dict[str, Case]:
    """Return the faults by name."""
    coasts = "a joint that coasts or is helped by a hand looks the same below its top speed"
    return {
        "friction 30 % less": Case("bounded", OVERSPEED, coasts, {"factor": 1.0 / 0.7}),
        "friction 20 % less": Case("bounded", OVERSPEED, coasts, {"factor": 1.0 / 0.8}),
        "friction 20 % more": Case("bounded", OVERSPEED, "less is given than could be", {"factor": 1.0 / 1.2}),
        "model x 2": Case("bounded", OVERSPEED, coasts, {"factor": 2.0, "stiffer": 2.0}),
        "model x 10": Case("bounded", OVERSPEED, coasts, {"factor": 10.0, "stiffer": 10.0}),
        "sign inverted": Case(
            "bounded", OVERSPEED, "the joint is heavy, as one with more friction", make=lambda *_: Fault(turned=True)
        ),
        "encoder frozen": Case(
            "named", NO_MOTION, "where there was torque: no counts, no push", make=frozen,
            may=frozenset({Status.JUMP}), blind=True,
        ),
        "encoder frozen, disturbance observer": Case(
            "named", NO_MOTION, "its integrator stops too", {"observer": True}, frozen,
            frozenset({Status.JUMP}), True,
        ),
        "encoder wraps by a turn": Case(
            "named", Status.JUMP, "the encoder's new zero, unlatched",
            make=lambda rng, n, joints: Fault(offset=scenes.wraps(rng, n, len(joints), 0.75)),
            may=frozenset({Status.JUMP}),
        ),
        "NaN for 1 to 60 ms, half of them once for 300": Case(
            "named", Status.NOT_FINITE, "fades and returns; longer than its patience it latches",
            make=lambda rng, n, joints: Fault(
                offset=scenes.bursts(rng, n, len(joints), 0.75, np.arange(len(joints)) % 2 == 0)
            ),
            may=frozenset({Status.NOT_FINITE, Status.JUMP}),
        ),
        "every third call missed, intervals told": Case(
            "named", Status.LATE, "run with the time that passed", make=missing(True),
            may=frozenset({Status.LATE}),
        ),
        "every third call missed, not told": Case(
            "bounded", OVERSPEED, "speeds seem half as fast again: the watch trips early", make=missing(False),
            may=frozenset({Status.JUMP}),
        ),
        "inertia x 3 or / 3": Case(
            "bounded", OVERSPEED, "the estimate alone is wrong, as under a hand; no torque hangs on it",
            {"inertia": "wrong"},
        ),
    }  # fmt: skip


def since_latch(codes: np.ndarray) -> np.ndarray:
    """Return the tick at which each joint was latched, the length of the scene where it was not (J,)."""
    n = len(codes)
    after = codes == LATCHED
    first = np.where(after.any(axis=0), after.argmax(axis=0), n)
    return np.where(first < n, np.maximum(first - 1, 0), n)


@dataclass
class Seen:
    """What one fault came to over scenes and settings where nothing pulls on the joint, for the table."""

    draws: int = 0
    named: int = 0
    acted: int = 0
    latched: int = 0


def judged(
    name: str, case: Case, s: Settings, fault: Fault, r: Record, above: np.ndarray, seen: Seen
) -> tuple[list[str], dict[str, float]]:
    """Return what does not hold, and the figures of the row; `above`: time above 1.2 top speed at zero torque (J,)."""
    n, J = r.torque.shape
    at, size = since_latch(r.codes), np.abs(r.torque)
    k = np.arange(n)[:, None]
    latched = at < n
    longer = r.state[ABOVE] - above
    alone = r.joints.p[OUT] == 0.0
    wrong = []
    if not (np.isfinite(r.torque).all() and r.worst[0] <= 1.0 and r.worst[1] <= 1.0 + 1e-9):
        wrong.append(f"output by limit {r.worst[0]:.6f}, step by rate {r.worst[1]:.6f}")
    ramp = np.array([one.slow_rate for one in r.loops])
    if np.any(size > ramp * (k + 1) * T * (1.0 + 1e-9)):
        wrong.append("grows faster than the slow rate after the start")
    if np.any(longer[alone] > LONGER):
        wrong.append(
            f"{np.sum(longer[alone] > LONGER)} of {alone.sum()} stay above 1.2 top speed for more than 50 ms longer"
        )
    fast = r.state[ABOVE] > SEEN
    if not case.blind and np.any(fast & ~latched):
        wrong.append(f"{np.sum(fast & ~latched)} of {fast.sum()} above 1.2 top speed were not latched")
    clock = np.cumsum(r.believed * r.called)  # as the loop was told
    told = clock[:, None] - clock[np.minimum(at, n - 1)]
    gone = np.where((k > at) & (told >= GONE), size, 0.0).max(axis=0)
    with np.errstate(invalid="ignore"):
        rising = np.where(k[1:] > at, np.diff(size, axis=0), 0.0).max(axis=0)
    if gone.max() > 0.0 or rising.max() > 0.0:
        wrong.append(
            f"torque of {np.sum((gone > 0.0) | (rising > 0.0))} latched joints is not gone after 0.2 s, or grows"
        )
    moved = scenes.coasted(r)[latched]
    if moved.size and moved.max() > 1e-4:
        wrong.append(f"{np.sum(moved > 1e-4)} latched joints do not stop")
    # names
    slow = r.speed.max(axis=0) < 0.9 * s.top
    expected = [int(x) for x in QUIET | case.may]
    odd = ~np.isin(r.codes, expected) & ~(
        (r.codes == Status.JUMP) & ~slow
    )  # what is faster than its encoder could be, jumps
    if odd.any():
        names = ", ".join(Status(int(c)).name for c in np.unique(r.codes[odd]))
        wrong.append(f"{np.sum(odd.any(axis=0))} draws with statuses that say something else: {names}")
    acts = np.ones(J, dtype=bool)
    if fault.frozen is not None:
        acts, short = standing(r, fault, s)
        if short:
            wrong.append(short)
    sound = latched & slow & (r.causes == int(OVERSPEED))
    if name != "every third call missed, not told" and sound.any():
        wrong.append(f"{sound.sum()} joints below 0.9 top speed latched for overspeed")
    by_name = (
        (r.codes == int(case.status)).any(axis=0) if case.status is not None else np.zeros(J, dtype=bool)
    )
    if case.done == "named":
        if fault.missed is not None:  # all late calls but those with worse to say
            late = (r.believed > T) & r.called
            silent = np.sum(r.codes[late] == OK)
            if silent:
                wrong.append(f"{silent} late calls say OK")
            acts = np.isin(r.codes[late], (OK, int(Status.LATE))).any(axis=0)
        if fault.offset is not None:
            acts = np.array([changed(fault.offset[: max(int(a), 1), j]) for j, a in enumerate(at)])
        if np.any(acts & ~by_name):
            wrong.append(f"{np.sum(acts & ~by_name)} of {acts.sum()} draws without {case.status.name}")  # type: ignore[union-attr]
    if case.status is Status.NOT_FINITE:
        wrong += bursts_latch(r, fault, latched, slow)
    elif "wraps" in name and np.any(latched & slow):
        wrong.append(f"{np.sum(latched & slow)} joints latched by a wrap")
    seen.draws += int(alone.sum())
    seen.named += int(np.sum(acts & by_name & alone))
    seen.acted += int(np.sum(acts & alone))
    seen.latched += int(np.sum(latched & alone))
    figures = {
        "latched": float(latched.mean()),
        "largest": float(r.worst[0]),
        "speed": float((r.speed.max(axis=0) / s.top)[alone].max()),
        "longer": float(longer[alone].max()),
        "pulled": float(longer[~alone].max()) if np.any(~alone) else np.nan,
    }
    return wrong, figures


def changed(offset: np.ndarray) -> bool:
    """Return whether a fault of the readings acts at all."""
    return bool(np.any(offset[0] != offset)) or bool(np.isnan(offset).any())


def standing(r: Record, fault: Fault, s: Settings) -> tuple[np.ndarray, str]:
    """Return which joints had a torque that a frozen encoder left standing, and whether it did not fade."""
    begin, end = fault.frozen  # type: ignore[misc]
    n, J = r.torque.shape
    hold = np.array([ticks(one.hold) for one in r.loops])
    at = since_latch(r.codes)
    acts, late = np.zeros(J, dtype=bool), 0
    for j in range(J):
        own = r.loops[j]
        law, size = own.compensator.friction.law, np.abs(r.torque[:, j])
        waves = 0.0 if own.compensator.dither is None else own.compensator.dither.share * max(law.coulomb())
        left = size[begin[j] + hold[j] : min(end[j], n)]
        late += int(  # a latched one goes to zero at a rate of its own
            left.size > 0
            and at[j] > begin[j] + hold[j]
            and left.max() > min(waves + 0.05 * own.compensator.share * max(law.coulomb()), own.limit)
        )
        # a notable torque while it stands still, which the dither alone does not make
        push = size[begin[j] + hold[j] // 10 + 2 :][:5]
        acts[j] = at[j] > begin[j] + hold[j] and push.min() > waves + 0.02 * own.limit
    return acts, f"torque of {late} joints does not fade while the encoder is frozen" if late else ""


def bursts_latch(r: Record, fault: Fault, latched: np.ndarray, slow: np.ndarray) -> list[str]:
    """Return what does not hold where readings are NaN: longer than the patience latches, passing ones do not."""
    wrong = []
    bad = np.isnan(fault.offset)  # type: ignore[arg-type]
    length = np.array([longest(bad[:, j]) for j in range(bad.shape[1])]) * T
    patience = np.array([one.patience for one in r.loops])
    must, never = length > patience + 3.0 * T, slow & (length < 0.061) & (patience >= 0.1)
    if np.any(must & ~latched):
        wrong.append(
            f"{np.sum(must & ~latched)} of {must.sum()} bursts longer than the patience did not latch"
        )
    if np.any(never & latched):
        wrong.append(f"{np.sum(never & latched)} of {never.sum()} joints with passing bursts latched")
    return wrong


def longest(x: np.ndarray) -> int:
    """Return the longest run of true values."""
    edges = np.flatnonzero(np.diff(np.r_[0, x.astype(np.int8), 0]))
    return int((edges[1::2] - edges[::2]).max()) if edges.size else 0
