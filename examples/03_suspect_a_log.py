"""A log with a wrapped encoder and a missing sample: what is found, and what a repair does."""

import numpy as np

from backdrive import Joint, Log, check, identify

t = np.arange(0.0, 20.0, 0.002)
q = 2.0 * np.sin(0.7 * t) + 2.0
dq, ddq = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
tau = 0.6 * ddq + 4.0 * np.sign(dq) + 1.5 * dq + 0.1 * np.random.default_rng(0).standard_normal(t.size)
tau[1234] = np.nan
log = Log(time=t, joints=(Joint(name="wrist"),), position=np.mod(q, np.pi), torque=tau)

for finding in check(log):
    print(f"{finding.name}: {finding.sentence} {finding.remedy}")
result = identify(log, repair=True)
print(result.evidence[0].verdict)
