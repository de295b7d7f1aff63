"""A wrench in the log: read, kept row by row, brought to the base, compared with the estimate, and doubted in a wrong frame."""

import json

import numpy as np
import pytest

pytest.importorskip("pinocchio")

from _arm_force import PUSH, ROBOT, SLIDING, TEXT, log_of
from _commands import called
from backdrive.errors import InvalidInput, MappingError, UnknownName
from backdrive.external import estimate_force
from backdrive.external.wrench_axes import Convention, wrench_at
from backdrive.logs.log import Joint, Log
from backdrive.logs.readers.columns import Columns
from backdrive.logs.readers.mapping import to_log


@pytest.fixture(scope="module")
def sensed():
    """A log with a sensor at the tip, along the tip's axes, without torques of the joints."""
    log = log_of(PUSH, n=4000)
    turned = ROBOT.placement(log.position, "tip")[:, :3, :3]
    force, moment = (np.einsum("nij,i->nj", turned, part) for part in (PUSH[:3], PUSH[3:]))
    return log.replace(external_torque=None, wrench=np.hstack([force, moment]))


def estimated(log, axes="frame", frame="tip"):
    return estimate_force(SLIDING, log, robot=ROBOT, frame=frame, wrench_axes=axes, bandwidth=60.0)


def doubts(result):
    return [line for line in result.remarks if "unexplained" in line]


def test_a_sensor_at_the_frame_is_compared_along_the_axes_of_the_base(sensed):
    result = estimated(sensed)
    assert result.wrench.known == pytest.approx(np.tile(PUSH, (result.wrench.time.size, 1)), abs=0.05)
    clear = ~result.wrench.singular
    assert np.sqrt(np.mean((result.wrench.wrench - result.wrench.known)[clear, :3] ** 2)) < 3.0
    assert np.all(result.wrench.rms_error > 0.0) and not doubts(result)
    along_base = sensed.replace(wrench=np.tile(PUSH, (len(sensed), 1)))
    same = estimated(along_base, axes="base")
    assert same.wrench.rms_error == pytest.approx(result.wrench.rms_error, rel=0.02) and not doubts(same)


def test_wrong_axes_sign_or_place_are_said_with_what_fits(sensed):
    (line,) = doubts(estimated(sensed, axes="base"))
    assert (
        "taken at 'tip' along those of the base, leaves" in line
        and "; taken at 'tip' along its own axes it leaves" in line
    )
    (line,) = doubts(estimated(sensed.replace(wrench=-sensed.wrench)))
    assert "sign turned round" in line
    (line,) = doubts(estimated(sensed.replace(wrench=np.random.default_rng(0).normal(size=(4000, 6)) * 20.0)))
    assert "no frame of the description explains it" in line
    (line,) = [x for x in estimated(sensed.replace(wrench=np.zeros((4000, 6)))).remarks if "throughout" in x]
    with pytest.raises(UnknownName, match="axes of a wrench"):
        estimated(sensed, axes="world")
    silent = estimate_force(SLIDING, sensed, robot=ROBOT, bandwidth=60.0)
    assert any("give the frame at which" in line for line in silent.remarks)


def test_a_wrench_of_another_origin_is_brought_over_by_its_lever():
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 6))
    raw = np.random.default_rng(2).normal(size=(5, 6))
    got = wrench_at(raw, ROBOT, q, Convention(frame="l3", axes="frame", sign=-1.0), "tip")
    for row, at, out in zip(raw, q, got, strict=True):
        there, here = (ROBOT.placement(at[None], name)[0] for name in ("l3", "tip"))
        force = -there[:3, :3] @ row[:3]
        moment = -there[:3, :3] @ row[3:] + np.cross(there[:3, 3] - here[:3, 3], force)
        assert out == pytest.approx(np.r_[force, moment])
        # the same torques of the joints before it, by either Jacobian
        both = [ROBOT.jacobian(at[None], name)[0] for name in ("l3", "tip")]
        plain = np.r_[force, -there[:3, :3] @ row[3:]]
        assert (both[0].T @ plain)[:4] == pytest.approx((both[1].T @ out)[:4])


def test_a_log_keeps_its_wrench_by_rows_and_for_all_joints_only():
    n = 50
    log = Log(time=np.arange(n) * 0.01, joints=(Joint(name="a"), Joint(name="b")), position=np.zeros((n, 2)),
              wrench=np.arange(6.0 * n).reshape(n, 6))  # fmt: skip
    assert log.rows(slice(3, 7)).wrench.tolist() == log.wrench[3:7].tolist()
    assert log.between(0.1, 0.2).wrench.shape == (10, 6)
    assert log.select("a").wrench is None and log.select(["b", "a"]).wrench is not None
    with pytest.raises(InvalidInput, match="wrench has shape"):
        log.replace(wrench=np.zeros((n, 3)))
    with pytest.raises(InvalidInput, match="not a number"):
        log.replace(wrench=[["a"] * 6] * n)


def test_a_map_names_six_columns():
    rng = np.random.default_rng(3)
    columns = Columns(
        arrays={"t": np.arange(40) * 0.01, "q": rng.normal(size=(40, 2)), "ft": rng.normal(size=(40, 6))},
        units={},
    )  # fmt: skip
    log = to_log(columns, map="t=t,q=q,wrench=-1*ft")
    assert np.array_equal(log.wrench, -columns.arrays["ft"]) and log.position.shape == (40, 2)
    mixed = to_log(columns, map="t=t,q=q,wrench=ft[0:3],ft[3:6]")
    assert np.array_equal(mixed.wrench, columns.arrays["ft"])
    with pytest.raises(MappingError, match="wrench: 3 columns"):
        to_log(columns, map="t=t,q=q,wrench=ft[0:3]")
    assert to_log(columns, map="t=t,q=q").wrench is None


def test_the_command_compares_and_says(sensed, tmp_path):
    columns = [sensed.time, *sensed.position.T, *sensed.torque.T, *sensed.wrench.T]
    heading = ["t", *(f"{c}{i}" for c in "qu" for i in range(6)), *(f"f{i}" for i in range(6))]
    np.savetxt(
        tmp_path / "log.csv", np.column_stack(columns), delimiter=",", header=",".join(heading), comments=""
    )
    SLIDING.save(tmp_path / "arm.json")
    (tmp_path / "arm.xml").write_text(TEXT)
    base = [
        "estimate", tmp_path / "arm.json", tmp_path / "log.csv", "--map", "t=t,q=q0..q5,tau=u0..u5,wrench=f0..f5",
        "--names", ",".join(ROBOT.joints), "--urdf", tmp_path / "arm.xml", "--frame", "tip", "--bandwidth", "60", "--json",
    ]  # fmt: skip
    told = json.loads(called(*base).stdout)
    assert len(told["wrench"]["rms_error"]) == 6 and not [w for w in told["warnings"] if "unexplained" in w]
    told = json.loads(called(*base, "--wrench-axes", "base").stdout)
    assert any("--wrench-axes" in w for w in told["warnings"])
