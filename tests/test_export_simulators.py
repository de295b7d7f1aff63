"""Friction in MJCF and URDF: the nearest Coulomb and viscous friction, its error, and what MuJoCo makes of it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from backdrive import load_model
from backdrive.errors import ForbiddenContent, InvalidInput, WriteError
from backdrive.export.simple import simplify
from backdrive.export.simulators import export_description
from backdrive.laws import RATES, Law, LuGre, StribeckGauss
from backdrive.model import FrictionModel, Validity

MJCF = '<mujoco><worldbody><body><joint name="j" type="hinge" axis="0 0 1"/><geom size="0.1" mass="1"/></body></worldbody></mujoco>'
LINKS = '<link name="a"/><link name="b"/>'
URDF = f'<robot name="r">{LINKS}<joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint></robot>'


def model(law: Law) -> FrictionModel:
    """A model of one joint 'j' that was seen up to 2 rad/s."""
    preset = load_model("preset:mx106/m6")
    joint = replace(preset.joints[0].joint, name="j", unit="rad")
    friction = replace(
        preset.joints[0],
        joint=joint,
        law=law,
        validity=Validity(velocity=(-2.0, 2.0)),
        covariance=None,
        standard_errors={},
    )
    return replace(preset, joints=(friction,))


def test_coulomb_and_viscous_friction_is_expressed_whole(tmp_path):
    law = Law(rate=RATES["m1"](coulomb=3.0, viscous=0.5))
    for name, text in (("arm.xml", MJCF), ("arm.urdf", URDF)):
        (tmp_path / name).write_text(text)
        written, (simple,) = export_description(model(law), tmp_path / name, tmp_path / "out")
        assert simple.friction == pytest.approx(3.0, rel=1e-9)
        assert simple.damping == pytest.approx(0.5, rel=1e-9)
        assert simple.largest_error < 1e-9
        assert simple.lost == ()
        beside = json.loads(written[1].read_text())
        assert beside["joints"][0]["joint"] == "j"
        export_description(model(law), tmp_path / name, tmp_path / "out")  # ours is replaced


def test_mujoco_slows_down_as_the_description_says(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    (tmp_path / "arm.xml").write_text(MJCF)
    law = Law(rate=RATES["m1"](coulomb=0.004, viscous=0.001))
    written, _ = export_description(model(law), tmp_path / "arm.xml", tmp_path / "out")
    simulated = mujoco.MjModel.from_xml_path(str(written[0]))
    simulated.opt.timestep, simulated.opt.gravity[:] = 1e-4, 0.0
    data = mujoco.MjData(simulated)
    data.qvel[0], inertia = 1.5, 0.4 * 1.0 * 0.1**2
    for _ in range(3000):
        mujoco.mj_step(simulated, data)
    t, rate = 0.3, 0.001 / inertia
    expected = (1.5 + 4.0) * np.exp(-rate * t) - 4.0  # of I v' = -F - B v
    assert data.qvel[0] == pytest.approx(expected, rel=2e-3)


def test_what_is_lost_is_said():
    curve = StribeckGauss(coulomb=4.0, breakaway=6.0, stribeck_velocity=0.05, viscous=1.0)
    simple = simplify(model(Law(rate=curve, element=LuGre(**LuGre.EXAMPLE))).joints[0])
    velocity = np.linspace(2e-3, 2.0, 200)
    error = (
        4.0
        + 2.0 * np.exp(-((velocity / 0.05) ** 2))
        + velocity
        - (simple.friction + simple.damping * velocity)
    )
    assert simple.largest_error == pytest.approx(np.abs(error).max(), rel=1e-6)
    assert simple.rms_error == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-6)
    assert simple.lost == ("presliding ('lugre')",)


def test_what_cannot_be_written_is_refused(tmp_path):
    law = Law(rate=RATES["m1"](coulomb=3.0, viscous=0.5))
    (tmp_path / "arm.xml").write_text(MJCF.replace('"j"', '"other"'))
    with pytest.raises(InvalidInput, match="no joint 'j'"):
        export_description(model(law), tmp_path / "arm.xml", tmp_path / "out")
    (tmp_path / "arm.xml").write_text(MJCF)
    with pytest.raises(WriteError, match="itself"):
        export_description(model(law), tmp_path / "arm.xml", tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "arm.xml").write_text("<mine/>")
    with pytest.raises(WriteError, match="not made by an export"):
        export_description(model(law), tmp_path / "arm.xml", tmp_path / "out")
    (tmp_path / "bad.xml").write_text('<!DOCTYPE x [<!ENTITY a "b">]><mujoco>&a;</mujoco>')
    with pytest.raises(ForbiddenContent):
        export_description(model(law), tmp_path / "bad.xml", tmp_path / "out")
