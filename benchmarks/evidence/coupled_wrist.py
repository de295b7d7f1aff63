"""A wrist whose motors drive two joints: found untold, fitted as well as by a fit that knows; nothing found where nothing is.

The log holds joint positions and torques brought to the joints, as most controllers write them. The fit that knows is another
program: it knows the bodies exactly (MuJoCo's) and the motors' motion, and fits friction, inertia and offset of each motor.
"""

from __future__ import annotations

import numpy as np
from _common import Judge, first_seed, parser
from _payload_arm import JOINTS, NAMES, RATE, Truth, bodies, motion, record, urdf

from backdrive.identification.arm import identify_arm
from backdrive.logs.log import Joint, Log
from backdrive.robot import parse_robot

ROBOT = parse_robot(urdf(1.15))
WRIST = (4, 5)


def log(*given, **more) -> Log:
    """Return a record as a log."""
    t, q, tau = record(*given, **more)
    return Log(time=t, joints=tuple(Joint(name=n) for n in NAMES), position=q, torque=tau)


def knowing(
    seen: tuple[float, int], unseen: tuple[float, int], truth: Truth, logs: tuple[Log, Log]
) -> np.ndarray:
    """Return the unseen residual of the wrist's motors by a fit that knows bodies and structure [N.m], (2,)."""
    C = truth.coupling
    back = np.linalg.inv(C).T
    parts = []
    for (seconds, seed), one in zip((seen, unseen), logs, strict=False):
        _, q, dq, ddq = motion(seconds, seed)
        rigid = bodies(q, dq, ddq, None) @ C
        assert one.torque is not None
        parts.append((dq @ back, ddq @ back, rigid, one.torque @ C))
    out = []
    for j in WRIST:
        knots = np.quantile(np.abs(parts[0][0][:, j]), np.linspace(0.02, 0.99, 10))
        fits = []
        for dm, ddm, rigid, tau in parts:
            speed, sign = np.abs(dm[:, j]), np.sign(dm[:, j])
            hats = [np.interp(speed, knots, np.eye(knots.size)[k]) * sign for k in range(knots.size)]
            X = np.column_stack([*hats, sign * np.abs(rigid[:, j]), ddm[:, j], np.ones_like(speed)])
            fits.append((X, tau[:, j] - rigid[:, j]))
        theta = np.linalg.lstsq(*fits[0], rcond=None)[0]
        out.append(np.sqrt(np.mean((fits[1][1] - fits[1][0] @ theta) ** 2)))
    return np.array(out)


def named(warnings: list[str]) -> tuple[int, int, float] | None:
    """Return motor, joint and the matrix' entry that a remark names, or None."""
    for text in warnings:
        if "seems to turn with" in text:
            motor, joint = (NAMES.index(text.split("'")[i]) for i in (1, 3))
            return motor, joint, float(text.split("whose matrix has ")[1].split()[0])
    return None


def main() -> None:
    """Draw arms, identify, judge."""
    options = parser(__doc__)
    options.add_argument("--seed", type=int)
    given = options.parse_args()
    seed, n = first_seed(given.seed), 3 if given.short else 20
    judge = Judge()
    random = np.random.default_rng(seed)
    found, told, untold, wrong, off = 0, [], [], 0, []
    for i in range(n):
        C = np.eye(JOINTS)
        k, other = WRIST if i % 2 else WRIST[::-1]
        C[k, other] = random.choice([-1, 1]) * random.uniform(0.2, 1.0)
        truth = Truth(coupling=C, coulomb=1 + 0.05 * random.standard_normal(JOINTS))
        ways = ((40.0, 4 * (seed + i)), (20.0, 4 * (seed + i) + 1))
        seen, unseen = (log(*way, truth=truth) for way in ways)
        best = knowing(*ways, truth, (seen, unseen))
        frictions, _, _ = identify_arm(seen, ROBOT)
        guess = named([w for f in frictions for w in f.warnings])
        guessed = np.eye(JOINTS)
        if guess is not None:
            guessed[guess[0], guess[1]] = guess[2]
        if guess is not None and guess[:2] == (k, other):
            found += 1
            off.append(abs(guess[2] - C[k, other]))
        for matrix, ratios in ((C, told), (guessed, untold)):
            pair = [one.apply_coupling(matrix.tolist(), "joint") for one in (seen, unseen)]
            again, _, _ = identify_arm(pair[0], ROBOT, held_out=[pair[1]])
            quality = [again[j].held_out for j in WRIST]
            ratios.append(np.array([one.rms if one else np.inf for one in quality]) / best)
    for i in range(n):
        truth = Truth(coulomb=1 + 0.05 * random.standard_normal(JOINTS))
        frictions, _, _ = identify_arm(log(40.0, 4 * (seed + i) + 2, truth=truth), ROBOT)
        wrong += named([w for f in frictions for w in f.warnings]) is not None
    print(
        f"{n} coupled arms and {n} uncoupled ones, 40 s at {RATE:.0f} Hz each, judged on other motions of 20 s"
    )
    if off:
        print(f"error of the value found: median {np.median(off):.3f}, largest {max(off):.3f}")
    for what, ratios in (("told", told), ("as found untold", untold)):
        table = np.array(ratios)
        for j, name in enumerate(WRIST):
            ratio = np.sqrt(np.mean(table[:, j] ** 2))
            print(
                f"  {what}, joint {name + 1}: median {np.median(table[:, j]):.2f}, largest {table[:, j].max():.2f}"
            )
            judge.at_most(
                f"{what}: residual of joint {name + 1} by that of a fit that knows, rms", ratio, 1.3
            )
    judge.that(f"found untold in {found} of {n} (19 of 20)", found >= (19 * n) // 20)
    judge.that(f"false findings in {wrong} of {n} uncoupled arms (1 of 20)", wrong <= max(n // 20, 0))
    judge.end()


if __name__ == "__main__":
    main()
