"""Draw the README's figure: a simulated joint swept and identified, beside the truth that was put in."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from backdrive.identification import Curve, identify
from backdrive.plans import Sweep
from backdrive.report.pictures.curve import save_curves
from backdrive.simulation.machines import machine
from backdrive.simulation.open_loop import simulate

TARGET = Path(__file__).resolve().parent.parent / "docs" / "figures" / "demo.png"


def main() -> None:
    """Simulate, identify, draw."""
    plant = machine("joint_1")
    sweep = Sweep(stroke=float(np.deg2rad(20.0)), top_speed=2.0, cycles=10, joint=plant.name)
    result = identify(simulate(plant, sweep, seed=0))
    speed = sweep.top_speed * np.linspace(1e-6, 1.0, 80)
    velocity = np.concatenate([-speed[::-1], speed])
    truth = Curve(
        velocity=velocity, torque=plant.law.torque(velocity), standard_error=np.full(velocity.size, np.nan)
    )
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    save_curves(TARGET, result.model, evidence=result.evidence, truth={plant.name: truth})
    print(f"wrote {TARGET}")


if __name__ == "__main__":
    main()
