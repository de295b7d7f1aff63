"""Any friction law in MuJoCo: in Python and as a callback in C, against closed forms and each other."""

from __future__ import annotations

import ctypes
import math
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from _c import WARNINGS, ZIG
from backdrive import load_model, rollout
from backdrive.errors import InvalidInput, ReadError, WriteError
from backdrive.export.mujoco import export_mujoco
from backdrive.export.simulators import export_description
from backdrive.laws import (
    GMS,
    RATES,
    CoulombViscous,
    DeadZone,
    Decaying,
    Law,
    LuGre,
    MaxwellSlip,
    Rigid,
    StribeckGauss,
)
from backdrive.model import FrictionModel, Validity
from backdrive.simulation import MujocoFriction
from backdrive.simulation.mujoco_friction import at_rest, longest_step, with_spring

mujoco = pytest.importorskip("mujoco")

CURVE = StribeckGauss(coulomb=1.0, breakaway=1.3, stribeck_velocity=0.05, viscous=0.2)
COULOMB = CoulombViscous(coulomb_positive=1.0, coulomb_negative=1.0)
LUGRE = LuGre(stiffness=3e3, damping=5.0)
ROTOR = 0.1  # inertia about the axis [kg.m^2]
ARM = """\
<mujoco><option timestep="{step}" gravity="0 0 0"/><worldbody>
<body><joint name="a" type="hinge" axis="0 0 1" {more}/><inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
<body pos="0.3 0 0"><joint name="b-1" type="hinge" axis="0 0 1"/><geom size="0.05" pos="0.2 0 0" mass="0.5"/></body></body>
</worldbody></mujoco>"""
ONE = """\
<mujoco><option timestep="{step}" gravity="0 0 0"/><worldbody>
<body><joint name="a" type="hinge" axis="0 0 1" {more}/><inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body>
</worldbody></mujoco>"""


def model(**laws: Law) -> FrictionModel:
    """A model of some joints; the joint `b` is called 'b-1'."""
    preset = load_model("preset:mx106/m6")
    joints = [
        replace(
            preset.joints[0],
            joint=replace(preset.joints[0].joint, name="b-1" if name == "b" else name, unit="rad"),
            law=law,
            validity=Validity(velocity=(-2.0, 2.0)),
            covariance=None,
            standard_errors={},
        )
        for name, law in laws.items()
    ]
    return replace(preset, joints=tuple(joints))


def loaded(text: str = ONE, step: float = 1e-3, more: str = ""):
    simulated = mujoco.MjModel.from_xml_string(text.format(step=step, more=more))
    return simulated, mujoco.MjData(simulated)


@pytest.mark.parametrize("element", [Rigid(), LUGRE, MaxwellSlip(stiffness=(2e3, 5e2), share=(0.5, 0.5))])
def test_a_joint_runs_out_as_coulomb_friction_says_and_rests(element):
    simulated, data = loaded()
    friction = MujocoFriction(model(a=Law(rate=COULOMB, element=element)), simulated, data)
    data.qvel[0] = 2.0
    friction.reset()
    friction.step(2000)
    assert data.qpos[0] == pytest.approx(0.5 * ROTOR * 2.0**2 / 1.0, rel=0.02)
    assert abs(data.qvel[0]) < 1.0 / math.sqrt(2.5e3 * ROTOR)  # an undamped spring swings on


@pytest.mark.parametrize("push", [0.9, -1.1])
def test_a_push_below_break_away_is_held_and_one_beyond_is_not(push):
    simulated, data = loaded()
    friction = MujocoFriction(model(a=Law(rate=COULOMB, element=LUGRE)), simulated, data)
    data.qfrc_applied[0] = push
    friction.step(3000)
    assert data.qfrc_applied[0] == push  # ours is taken back
    if abs(push) < 1.0:
        assert friction.torque[0] == pytest.approx(push, rel=1e-3)
        assert abs(data.qpos[0]) < 1e-2
    else:
        assert data.qvel[0] == pytest.approx((push + 1.0) / ROTOR * 3.0, rel=0.05)


def test_the_torque_is_that_of_the_law_along_the_motion():
    simulated, data = loaded()
    law = Law(rate=CURVE, element=GMS(stiffness=(2e3, 1e3), share=(0.6, 0.4), attraction=20.0))
    friction = MujocoFriction(model(a=law), simulated, data)
    q, torque = [0.0], []
    for k in range(500):
        data.qfrc_applied[0] = 2.0 * math.sin(0.02 * k)
        friction.step()
        q.append(data.qpos[0])
        torque.append(friction.torque[0])
    np.testing.assert_allclose(torque, rollout(law, q=np.array(q[:-1]), dt=1e-3), rtol=1e-9, atol=1e-12)


def test_stiffness_at_rest_by_element():
    assert at_rest(Law(rate=CURVE, element=LUGRE)) == pytest.approx((3e3, 5.2), rel=1e-6)
    assert at_rest(Law(rate=CURVE))[0] == math.inf
    assert at_rest(Law(rate=RATES["makkar"](**RATES["makkar"].EXAMPLE)))[0] == pytest.approx(0.0, abs=1e-6)
    law = Law(rate=CURVE, element=MaxwellSlip(stiffness=(2e3, 5e2), share=(0.5, 0.5)))
    h = longest_step(law, ROTOR)
    assert 2.5e3 * h**2 + 0.2 * h == pytest.approx(ROTOR, rel=1e-6)
    assert longest_step(Law(rate=CURVE), ROTOR) == 0.0
    spring = with_spring(Law(rate=CURVE), ROTOR, 1e-3)
    assert longest_step(spring, ROTOR) >= 1e-3
    assert with_spring(law, ROTOR, 1e-3) is law
    assert longest_step(Law(rate=COULOMB, element=DeadZone(threshold=0.1)), ROTOR) == math.inf
    assert longest_step(Law(rate=CURVE, element=Decaying(stiffness=1e4, decay_rate=5.0)), ROTOR) < 5e-3


def test_a_stiff_contact_divides_the_step_or_is_refused():
    simulated, data = loaded()
    friction = MujocoFriction(
        model(a=Law(rate=CURVE, element=replace(LUGRE, stiffness=1e6))), simulated, data
    )
    assert friction.steps == 4
    data.qfrc_applied[0] = 0.8
    friction.step(500)
    assert simulated.opt.timestep == 1e-3
    assert data.time == pytest.approx(0.5)
    assert abs(data.qvel[0]) < 1e-8
    with pytest.raises(InvalidInput, match=r"does not come to rest.*K = 9.99e\+08"):
        MujocoFriction(model(a=Law(rate=CURVE, element=replace(LUGRE, stiffness=1e9))), simulated, data)


def test_what_does_not_fit_is_named():
    law = Law(rate=CURVE, element=LUGRE)
    with pytest.raises(InvalidInput, match="no joint 'b-1'"):
        MujocoFriction(model(b=law), *loaded())
    with pytest.raises(InvalidInput, match="frictionloss of 0.5"):
        MujocoFriction(model(a=law), *loaded(more='frictionloss="0.5"'))
    free = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint name="a" type="free"/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(InvalidInput, match="ball or a free"):
        MujocoFriction(model(a=law), free, mujoco.MjData(free))


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Files of a two-joint arm, and the callback compiled with every warning an error."""
    folder = tmp_path_factory.mktemp("mujoco")
    (folder / "arm.xml").write_text(ARM.format(step=1e-3, more='frictionloss="0.5" damping="0.1"'))
    laws = model(a=Law(rate=CURVE, element=LUGRE), b=Law(rate=RATES["m6"](**RATES["m6"].EXAMPLE)))
    written, joints, step = export_mujoco(laws, folder / "arm.xml", folder / "out")
    assert [p.name for p in written] == ["friction.h", "friction_mujoco.c", "arm.xml"]
    assert [d.name for d in joints] == ["a", "b-1"]
    assert step == 1e-3
    include = Path(mujoco.__file__).parent / "include"
    target = folder / "callback.so"
    command = [
        *ZIG,
        "cc",
        "-std=c99",
        "-O1",
        "-ffp-contract=off",
        "-fno-sanitize=all",
        *WARNINGS,
        "-shared",
        "-fPIC",
    ]
    done = subprocess.run(
        [*command, "-isystem", include, written[1], "-o", target], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[:3000]
    return laws, written[2], ctypes.CDLL(str(target))


@pytest.fixture
def passive(built):
    """The callback in force; gone afterwards."""
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    mujoco.set_mjcb_passive(kind(("friction_passive", built[2])))
    yield
    mujoco.set_mjcb_passive(None)


def moved(simulated, data, step, n=800) -> np.ndarray:
    """Return the positions under a push that swings."""
    rows = []
    for k in range(n):
        data.qfrc_applied[:] = 2.0 * math.sin(0.01 * k), 0.7 * math.sin(0.023 * k)
        step(simulated, data)
        rows.append(data.qpos.copy())
    return np.array(rows)


def test_c_and_python_move_the_arm_alike(built, passive):
    laws, path, _ = built
    simulated = mujoco.MjModel.from_xml_path(str(path))
    first, second = mujoco.MjData(simulated), mujoco.MjData(simulated)
    in_c = moved(simulated, first, mujoco.mj_step)
    mujoco.mj_resetData(simulated, first)
    mujoco.mj_step(simulated, second, 100)  # another simulation of the same process
    np.testing.assert_array_equal(moved(simulated, first, mujoco.mj_step), in_c)
    mujoco.set_mjcb_passive(None)
    third = mujoco.MjData(simulated)
    friction = MujocoFriction(laws, simulated, third)
    in_python = moved(simulated, third, lambda *_: friction.step())
    assert np.ptp(in_c[:, 0]) > 0.1
    np.testing.assert_allclose(in_c, in_python, rtol=0.0, atol=1e-10)


def test_a_step_that_is_tried_again_changes_nothing(built, passive):
    simulated = mujoco.MjModel.from_xml_path(str(built[1]))
    once, again = mujoco.MjData(simulated), mujoco.MjData(simulated)

    def twice(simulated, data):
        mujoco.mj_forward(simulated, data)
        mujoco.mj_step(simulated, data)

    np.testing.assert_array_equal(
        moved(simulated, once, mujoco.mj_step, 1), moved(simulated, again, twice, 1)
    )
    moved(simulated, again, twice, 300)
    assert np.isfinite(again.qpos).all()


def test_other_models_are_left_alone_and_the_check_names_what_is_wrong(built, passive):
    _, path, library = built
    library.friction_check.restype, library.friction_check.argtypes = ctypes.c_char_p, [ctypes.c_void_p]
    good = mujoco.MjModel.from_xml_path(str(path))
    assert library.friction_check(good._address) is None
    good.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    assert b"RK4" in library.friction_check(good._address)
    other, data = loaded()
    assert b"nuserdata" in library.friction_check(other._address)
    data.qvel[0] = 1.0
    mujoco.mj_step(other, data, 100)
    assert data.qvel[0] == 1.0
    roomy = mujoco.MjModel.from_xml_string(
        ONE.format(step=1e-3, more="").replace("<option", '<size nuserdata="100"/><option')
    )
    assert library.friction_check(roomy._address) == b"b-1"
    data = mujoco.MjData(roomy)
    data.qvel[0] = 1.0
    mujoco.mj_step(roomy, data, 100)
    assert data.qvel[0] == 1.0


def test_a_callback_that_cannot_be_is_refused(tmp_path):
    laws = model(a=Law(rate=CURVE, element=LUGRE))
    (tmp_path / "arm.xml").write_text(
        ONE.format(step=1e-3, more="").replace("<option", '<option integrator="RK4"')
    )
    with pytest.raises(InvalidInput, match="RK4"):
        export_mujoco(laws, tmp_path / "arm.xml", tmp_path / "out")
    (tmp_path / "arm.xml").write_text("<mujoco><worldbody><nonsense/></worldbody></mujoco>")
    with pytest.raises(ReadError, match="cannot load"):
        export_mujoco(laws, tmp_path / "arm.xml", tmp_path / "out")
    (tmp_path / "arm.urdf").write_text('<robot name="r"/>')
    with pytest.raises(ReadError, match="<robot>"):
        export_mujoco(laws, tmp_path / "arm.urdf", tmp_path / "out")
    (tmp_path / "arm.xml").write_text(ONE.format(step=1e-2, more=""))
    stiff = model(a=Law(rate=CURVE, element=replace(LUGRE, stiffness=1e5)))
    assert export_mujoco(stiff, tmp_path / "arm.xml", tmp_path / "out")[2] < 2e-3
    (tmp_path / "out" / "arm.xml").write_text("<mujoco/>")
    with pytest.raises(WriteError, match="not made by"):
        export_mujoco(stiff, tmp_path / "arm.xml", tmp_path / "out")


def test_lugre_as_a_dcmotor_gives_its_torque(tmp_path):
    (tmp_path / "arm.xml").write_text(ONE.format(step=1e-5, more=""))
    law = Law(rate=CURVE, element=LUGRE)
    written, (simple,) = export_description(
        model(a=law), tmp_path / "arm.xml", tmp_path / "out", dcmotor=True
    )
    assert simple.lost == ()
    try:
        simulated = mujoco.MjModel.from_xml_path(str(written[0]))
    except ValueError:
        pytest.skip("this MuJoCo has no passive dcmotor")
    data = mujoco.MjData(simulated)
    torque: list[float] = []
    way = 2e-3 * np.sin(2.0 * np.pi * 5.0 * 1e-5 * np.arange(40000))
    for k, q in enumerate(way):
        data.qpos[0], data.qvel[0] = q, (way[min(k + 1, len(way) - 1)] - q) / 1e-5
        mujoco.mj_forward(simulated, data)
        torque.append(-data.actuator_force[0] - data.qfrc_passive[0])
        data.act[:] += 1e-5 * data.act_dot
    mine = rollout(law, q=way, dt=1e-5)
    assert np.abs(np.array(torque[1:-2]) - mine[2:-1]).max() < 0.02
    (tmp_path / "arm.urdf").write_text('<robot name="r"/>')
    with pytest.raises(InvalidInput, match="no dcmotor"):
        export_description(model(a=law), tmp_path / "arm.urdf", tmp_path / "out", dcmotor=True)
    with pytest.raises(InvalidInput, match="cannot run stribeck-gauss"):
        export_description(model(a=Law(rate=CURVE)), tmp_path / "arm.xml", tmp_path / "no", dcmotor=True)
    assert not (tmp_path / "no").exists()


def test_a_description_finds_its_meshes_from_elsewhere(tmp_path):
    arms = tmp_path / "arms"
    arms.mkdir()
    (arms / "tetra.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    text = ONE.format(step=1e-3, more="").replace(
        "<worldbody>",
        '<asset><mesh name="m" file="tetra.obj"/></asset><worldbody><geom type="mesh" mesh="m"/>',
    )
    (arms / "arm.xml").write_text(text)
    written, _ = export_description(model(a=Law(rate=CURVE)), arms / "arm.xml", tmp_path / "out" / "deep")
    assert mujoco.MjModel.from_xml_path(str(written[0])).nmesh == 1
    exported = export_mujoco(model(a=Law(rate=CURVE)), arms / "arm.xml", tmp_path / "other")[0]
    assert mujoco.MjModel.from_xml_path(str(exported[2])).nmesh == 1
