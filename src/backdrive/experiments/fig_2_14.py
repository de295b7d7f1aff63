"""Fig. 2.14: tracking errors (2.26) of four compensations, and the gains at which their order breaks; Iwatani 2017, 2.5.2."""

from __future__ import annotations

from backdrive.experiments import Claim, Outcome
from backdrive.experiments._manual import curves, joint_4
from backdrive.experiments._tracking import (
    CASES,
    RATIOS,
    SETTING,
    by_joint,
    by_ratio,
    error,
    pd,
    saw_teeth,
    tracked,
    viscosity,
)

WEAK = 10.0  # a gain with which Joint 4 hardly moves against its friction [N.m/rad]


def run(seed: int = 0) -> Outcome:
    """Return the tracking errors of Joints 0, 1, 2 and 4, and their order by damping ratio."""
    E = {joint: {case: error(r) for case, r in cases.items()} for joint, cases in by_joint(seed).items()}
    claims = [
        Claim(
            what=f"{_name(joint)}: MOP < MOL < MO < NC",
            thesis="MOP smaller than MOL, MO and NC",
            ours=", ".join(f"{case} {1e3 * e[case]:.2f}" for case in reversed(CASES)) + " mrad",
            gate="in this order",
            holds=e["MOP"] < e["MOL"] < e["MO"] < e["NC"],
        )
        for joint, e in E.items()
    ]
    ratios = by_ratio(seed)
    ordered = {
        joint: {r: e["MOP"] < e["MOL"] < e["MO"] for r, e in found.items()} for joint, found in ratios.items()
    }
    damped = [r for r in RATIOS if r >= 0.5]
    claims.append(
        Claim(
            what="MOP < MOL < MO at every damping ratio from 0.5 on",
            ours="; ".join(
                f"{_name(j)}: " + ", ".join(f"{r:g}" for r in RATIOS if ordered[j][r]) for j in ratios
            ),
            gate=f"on every joint at {', '.join(f'{r:g}' for r in damped)}",
            holds=all(ordered[j][r] for j in ratios for r in damped),
        )
    )
    claims.append(
        Claim(
            what="Where it fails: a PD that is little damped itself",
            ours="; ".join(
                f"{_name(j)} at {RATIOS[0]:g}: "
                + ", ".join(f"{c} {1e3 * e[RATIOS[0]][c]:.1f}" for c in CASES[1:])
                + " mrad"
                for j, e in ratios.items()
            ),
            gate="the order breaks on Joints 0, 1 and 2",
            holds=all(not ordered[j][RATIOS[0]] for j in ("joint_0", "joint_1", "joint_2")),
            why="The joint's own viscous friction is what damps such a loop, and compensating it takes that damping away: after "
            "each corner the joint swings the longer, the better its friction is compensated.",
        )
    )
    joint = joint_4()
    held = float(joint.law.torque(0.5)) / WEAK
    weak = {
        case: error(r)
        for case, r in tracked([(joint, pd(joint, WEAK))], seed=seed, target=saw_teeth())[0].items()
    }
    claims.append(
        Claim(
            what=f"Where it fails: a gain so low ({WEAK:g} N.m/rad on Joint 4) that friction holds the joint {held:.2f} rad off",
            ours=", ".join(f"{case} {1e3 * weak[case]:.0f}" for case in CASES) + " mrad",
            holds=None,
            why="A loop this slow follows the faster teeth late with or without friction; without friction it also swings.",
        )
    )
    return Outcome(
        name="fig-2.14",
        title="Tracking errors of four compensations",
        setting=SETTING,
        claims=tuple(claims),
        data={"errors": E, "ratios": ratios},
        numbers={f"{j}_{case}": E[j][case] for j in E for case in CASES}
        | {f"{j}_viscosity": viscosity(law) for j, law in curves(seed).items()},
    )


def _name(joint: str) -> str:
    return joint.replace("_", " ").capitalize()
