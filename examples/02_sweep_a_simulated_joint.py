"""Plan a sweep, record it on a simulated joint, identify it, and compare with the truth that was put in."""

import numpy as np

from backdrive import Sweep, identify
from backdrive.simulation.machines import machine
from backdrive.simulation.open_loop import simulate

plant = machine("joint_1")
sweep = Sweep(stroke=np.deg2rad(20.0), top_speed=2.0, cycles=10)
print(f"sweep of {sweep.duration:.1f} s, peak acceleration {sweep.peak_acceleration:.1f} rad/s^2")

result = identify(simulate(plant, sweep, seed=0))
print(f"method: {result.method}, because {result.reason}")
for speed in (0.2, 0.6, 1.0, 1.6):
    found, truth = float(result.model.torque(0, speed)), float(plant.law.torque(speed))
    print(f"{speed:.1f} rad/s: identified {found:.2f} N.m, true {truth:.2f} N.m")
