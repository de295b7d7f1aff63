"""Several logs of several joints, each of which moves in its own log and stands still in the others."""

import numpy as np
import pytest

from backdrive import Joint, Log, identify
from backdrive.identification.auto import choose_method, in_motion
from backdrive.identification.validate import validate
from backdrive.laws import CoulombViscous

RATE, COUNT = 500.0, 2.0 * np.pi / 65536
COULOMB, VISCOUS, INERTIA = (1.5, 0.7), (0.4, 0.2), (0.2, 0.1)


def log_of(moving: int, seed: int, flicker: float) -> Log:
    """Return a log in which one of two joints moves, and the encoder of the other flickers by a count."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(20.0 * RATE)) / RATE
    waves = [(0.3 / w, w, rng.uniform(0.0, 6.28)) for w in (1.3, 2.9, 4.7)]
    q, v, a = (
        sum(f(x, w, w * t + p) for x, w, p in waves)
        for f in (
            lambda x, w, y: x * np.sin(y),
            lambda x, w, y: x * w * np.cos(y),
            lambda x, w, y: -x * w * w * np.sin(y),
        )
    )
    position, torque = np.empty((2, t.size, 2))
    k, other = moving, 1 - moving
    position[:, k] = COUNT * np.round(q / COUNT)
    position[:, other] = COUNT * (rng.random(t.size) < flicker)
    torque[:, k] = COULOMB[k] * np.tanh(v / 0.01) + VISCOUS[k] * v + INERTIA[k] * a
    torque[:, other] = 0.2
    torque += 0.03 * rng.standard_normal(torque.shape)
    return Log(
        time=t,
        joints=(Joint(name="a", unit="rad"), Joint(name="b", unit="rad")),
        position=position,
        torque=torque,
    )


@pytest.mark.parametrize("flicker", [0.0, 0.1])
def test_a_log_in_which_a_joint_stands_still_does_not_count_for_it(flicker):
    logs = [log_of(0, 1, flicker), log_of(1, 2, flicker), log_of(0, 3, flicker)]
    assert [any(log is one for one in in_motion(logs, "a")) for log in logs] == [True, False, True]
    result = identify(logs)
    alone = [identify(in_motion(logs, name), joints=name) for name in ("a", "b")]
    for k, joint in enumerate(result.model.joints):
        assert isinstance(joint.law.rate, CoulombViscous)
        assert joint.law == alone[k].model.joints[0].law
        assert joint.verdict == alone[k].model.joints[0].verdict
        assert joint.law.rate.coulomb_positive == pytest.approx(COULOMB[k], rel=0.03)
        assert joint.held_out is not None and joint.held_out.residual < 3.0
    assert any("Joint 'b' stands still in 2 of 3 logs" in note for note in result.notes)
    assert not any("Several joints move at once" in w for w in result.warnings)
    remarks: list[str] = []
    qualities = validate(result.model, logs, remarks=remarks)
    assert all(qualities[name].residual < 3.0 for name in ("a", "b"))
    assert any("Joint 'a' stands still in 1 of 3 logs" in remark for remark in remarks)


def test_slow_motion_counts_and_so_does_a_joint_that_stands_still_everywhere():
    logs = [log_of(0, 1, 0.0), log_of(0, 2, 0.0)]
    slow = logs[1].replace(position=0.005 * logs[1].position)
    assert in_motion([logs[0], slow], "a") == [logs[0], slow]
    assert in_motion(logs, "b") == logs
    assert choose_method(logs, ["a"], None)[0] == "motion"
