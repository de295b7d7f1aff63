"""Identify the friction of one joint from arrays, and use the model."""

import numpy as np

from backdrive import Joint, Log, identify

t = np.arange(0.0, 20.0, 0.002)
q = 0.8 * np.sin(0.9 * t) + 0.2 * np.sin(4.1 * t)
dq, ddq = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
tau = 0.6 * ddq + 4.0 * np.sign(dq) + 1.5 * dq + 0.1 * np.random.default_rng(0).standard_normal(t.size)

log = Log(time=t, joints=(Joint(name="elbow"),), position=q, torque=tau)
result = identify(log)
print(result.evidence[0].verdict)
print("friction at 0.5 rad/s:", result.model.torque("elbow", 0.5), "N.m")
result.model.save("model.json")
