"""Presets: published numbers arrive where they belong, with provenance, and `preset:NAME` works wherever a model does."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from backdrive import load_model
from backdrive.cli import main
from backdrive.errors import UnknownName
from backdrive.laws import RATES, REFERENCE, kernels
from backdrive.model import presets
from backdrive.model.file import decode, encode

ROOT = Path(__file__).resolve().parent.parent
NAMES = presets.names()
SERVOS = ("erob80-100", "erob80-50", "mx106", "mx64", "xl320")


@pytest.fixture(scope="module")
def generator():
    spec = importlib.util.spec_from_file_location("make_presets", ROOT / "benchmarks" / "make_presets.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def run(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setenv("COLUMNS", "100")
        monkeypatch.setattr(sys, "argv", ["backdrive", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            main()
        said = capsys.readouterr()
        return stopped.value.code or 0, said.out, said.err

    return run


def only(name):
    (friction,) = load_model(f"preset:{name}").joints
    return friction


def under_load(friction, v, motor, external):
    law = friction.law
    lo, hi, viscous = kernels.limits(law.rate.KIND, law.row(), v, (motor, external), REFERENCE)
    return (hi if v > 0 else lo) + viscous


def test_every_family_is_there():
    assert set(NAMES) == {
        *(f"{servo}/m{i}" for servo in SERVOS for i in range(1, 7)),
        "sts3215/m1",
        "franka/panda",
        "thesis/hp3j",
        "thesis/setup-a",
    }


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_is_a_model_file_with_provenance(name):
    content = (Path(presets.__file__).parent / f"{name}.json").read_bytes()
    model = load_model(f"preset:{name}")
    assert encode(model) == content
    assert encode(decode(encode(model))) == content
    assert model.options["title"]
    assert "20" in model.options["citation"]
    assert model.options["licence"]
    for friction in model.joints:
        assert any("range of velocity not published" in w for w in friction.warnings)
        low, high = friction.validity.velocity
        assert -low == high > 0
        assert friction.standard_errors == {}
        assert friction.method == "published"
        v = np.linspace(low, high, 21)
        assert np.all(friction.law.torque(v) * v >= 0)


@pytest.mark.parametrize("name", [n for n in NAMES if n.split("/")[0] in (*SERVOS, "sts3215")])
def test_a_servo_names_its_file_and_its_motor(name):
    model, friction = load_model(f"preset:{name}"), only(name)
    assert name.split("/")[1] == friction.law.rate.NAME
    assert isinstance(friction.law.rate, RATES[friction.law.rate.NAME])
    (source,) = model.sources
    assert re.fullmatch(r"bam/params/\w+/m\d\.json", source.path)
    assert re.fullmatch(r"[0-9a-f]{64}", source.sha256)
    assert model.options["licence"] == "Apache-2.0"
    units = {k: e.unit for k, e in friction.dynamics.items()}
    expected = {"torque_constant": "N.m/A", "resistance": "ohm", "inertia": "kg.m^2"}
    if name.startswith("erob80-100"):
        del expected["resistance"]  # not published
    assert units == expected
    assert any("range of the load" in w for w in friction.warnings) == bool(friction.law.rate.NEEDS)


def test_published_numbers_of_bam():
    rate, motor = only("mx106/m6").law.rate, only("mx106/m6").dynamics
    assert rate.coulomb == 1.0232526438525893e-05
    assert rate.stribeck == 0.12195409579603411
    assert rate.stribeck_velocity == 1.7463251741328727
    assert rate.exponent == 1.142827788004191
    assert rate.load_motor == 0.19800553725822115
    assert rate.load_external == 0.022215529897348624
    assert rate.load_stribeck_motor == 0.19859970173941574
    assert rate.load_stribeck_external == 0.08710328264676681
    assert rate.quadratic_motor == 0.009999930103371748
    assert rate.quadratic_external == 7.326919843140997e-05
    assert rate.viscous == 0.05071566473605552
    assert motor["torque_constant"].value == 2.209828156174588
    assert motor["resistance"].value == 2.033661749312417
    assert motor["inertia"].value == 0.026016184370993383
    m4 = only("erob80-50/m4").law.rate
    assert (m4.load, m4.load_stribeck) == (0.06308728641180934, 7.125720330621117e-07)
    assert only("sts3215/m1").law.rate.coulomb == 0.05239296084748866
    remarks = load_model("preset:sts3215/m1").options["remarks"]
    assert any("q_offset = -0.05116067663549731 left out" in r for r in remarks)


def test_bam_under_a_load():
    """BAM's M6 by hand: motor and environment against each other, either the greater, and both along one direction."""
    v, motor, external = 0.5, 2.0, -1.5
    bow = np.exp(-((v / 1.7463251741328727) ** 1.142827788004191))
    plain = 1.0232526438525893e-05 + bow * 0.12195409579603411 + v * 0.05071566473605552

    def expected(m, e, quadratic):
        gears = abs(0.19800553725822115 * m - 0.022215529897348624 * e)
        fading = abs(0.19859970173941574 * m - 0.08710328264676681 * e)
        return plain + gears + bow * (fading + quadratic)

    friction = only("mx106/m6")
    for m, e, quadratic in (
        (motor, external, 7.326919843140997e-05 * external**2),
        (external, motor, 0.009999930103371748 * external**2),
        (motor, -external, 0.0),
    ):
        assert under_load(friction, v, m, e) == pytest.approx(expected(m, e, quadratic), rel=1e-13)
        assert under_load(friction, -v, m, e) == pytest.approx(-expected(m, e, quadratic), rel=1e-13)
    assert under_load(only("mx64/m3"), 1.0, 2.0, 0.5) == pytest.approx(
        0.10216727649779266 + 1.5 * 0.07580074806755707 + 0.0006300275797440622, rel=1e-13
    )


def test_a_bound_of_the_search_is_said():
    assert any("quadratic_motor ended at the upper bound" in w for w in only("mx106/m6").warnings)
    assert any("quadratic_external ended at the upper bound" in w for w in only("mx64/m6").warnings)
    assert not any("upper bound" in w for w in only("xl320/m6").warnings)


def test_published_numbers_of_the_panda():
    model = load_model("preset:franka/panda")
    assert model.names == tuple(f"panda_joint{i}" for i in range(1, 8))
    rate = model.joint("panda_joint1").law.rate
    assert (rate.span, rate.steepness, rate.shift) == (0.54615, 5.1181, 0.039533)
    assert [j.law.rate.span for j in model.joints] == [
        *(0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489),
    ]
    assert model.joint("panda_joint3").law.rate.shift == -0.04607
    for i, plateau, reverse in ((1, 0.2455, 0.3006), (3, 0.3938, 0.2469), (6, 0.1785, 0.1245)):
        joint = f"panda_joint{i}"
        law = model.joint(joint).law  # beyond the validity range: where the curve is level
        assert law.torque(50.0) == pytest.approx(plateau, abs=5e-5)
        assert law.torque(-50.0) == pytest.approx(-reverse, abs=5e-5)
    expected = 1.2794 / (1 + np.exp(-5.5903 * (0.3 + 0.036194))) - 1.2794 / (1 + np.exp(-5.5903 * 0.036194))
    assert model.torque("panda_joint4", 0.3) == pytest.approx(expected, rel=1e-13)


def test_printed_numbers_of_the_thesis():
    arm = load_model("preset:thesis/hp3j")
    assert arm.names == ("joint_0", "joint_1", "joint_2")
    assert [j.law.rate.coulomb for j in arm.joints] == [6.85, 9.56, 3.15]
    assert [j.joint.gear_ratio for j in arm.joints] == [100, 224, 120]
    for friction in arm.joints:
        assert friction.law.name == "coulomb+decaying"
        assert (friction.law.element.stiffness, friction.law.element.decay_rate) == (50000.0, 20.0)
        counts = friction.joint.encoder_counts * 2 * np.pi / friction.joint.gear_ratio
        assert counts == pytest.approx(65536, rel=1e-14)
    axis = only("thesis/setup-a")
    assert (axis.joint.unit, axis.joint.encoder_counts) == ("m", 200_000)
    assert (axis.law.element.stiffness, axis.law.element.decay_rate) == (1.2e6, 20.0)
    assert (axis.dynamics["inertia"].value, axis.dynamics["inertia"].unit) == (10.0, "kg")
    assert "lower bound" in axis.warnings[0]
    one_count = axis.law.element.stiffness / axis.joint.encoder_counts
    assert axis.law.rate.coulomb == pytest.approx(one_count)


def test_the_generator_writes_what_is_committed(generator, tmp_path):
    made = generator.franka() | generator.thesis()
    for name, model in made.items():
        committed = load_model(f"preset:{name}")
        assert encode(replace(model, version=committed.version)) == encode(committed)
        assert generator.write(name, model, tmp_path)
        assert not generator.write(name, replace(model, version="9.9.9"), tmp_path)


def test_the_generator_carries_over_every_key(generator):
    content = {
        "model": "m2",
        "actuator": "mx106",
        "friction_base": 0.1,
        "friction_stribeck": 0.2,
        "dtheta_stribeck": 0.3,
        "alpha": 1.4,
        "friction_viscous": 0.5,
        "kt": 2.0,
    }
    model = generator.bam_model(content, b"", "mx106", "a servo")
    assert model.joints[0].law.rate.values() == {
        "coulomb": 0.1,
        "stribeck": 0.2,
        "stribeck_velocity": 0.3,
        "exponent": 1.4,
        "viscous": 0.5,
    }
    with pytest.raises(SystemExit, match="friction_backlash"):
        generator.bam_model(content | {"friction_backlash": 1.0}, b"", "mx106", "a servo")
    with pytest.raises(SystemExit, match="alpha"):
        generator.bam_model({k: v for k, v in content.items() if k != "alpha"}, b"", "mx106", "a servo")


def test_an_unknown_preset_is_answered_with_the_nearest():
    with pytest.raises(UnknownName, match=r"Did you mean 'mx106/m6'\? Known: .*thesis/setup-a"):
        load_model("preset:mx107/m6")
    with pytest.raises(UnknownName, match="Known: erob80-100/m1"):
        load_model("preset:")


def test_what_counts_as_a_preset():
    assert presets.preset_name("model.json") is None
    assert presets.preset_name(Path("preset:MX106/M6")) == "mx106/m6"
    assert presets.preset_name("preset:mx106\\m6") == "mx106/m6"
    assert presets.preset_name("preset:") == ""
    assert load_model(Path("preset:MX106/M6")).names == ("mx106",)


def test_show_prints_a_preset(run):
    code, out, _ = run("show", "preset:mx106/m6")
    assert code == 0
    assert re.search(r"torque constant +2\.210 +N\.m/A", out)
    assert re.search(r"resistance +2\.034 +ohm", out)
    assert "range of velocity not published" in out
    assert "bam/params/mx106/m6.json  sha256 bdce996f" in out
    code, out, _ = run("show", "preset:thesis/hp3j", "-j", "joint_1", "--json")
    (joint,) = json.loads(out)["model"]["joints"]
    assert joint["parameters"]["coulomb"]["value"] == 9.56


def test_show_lists_the_presets(run):
    code, out, _ = run("show", "preset:")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()] == [f"preset:{name}" for name in NAMES]
    code, out, _ = run("show", "preset:", "--json")
    assert [p["name"] for p in json.loads(out)["presets"]] == list(NAMES)
    code, _, err = run("show", "preset:", "--plot", "all.svg")
    assert code == 2
    assert "is not a preset" in err


def test_validate_takes_a_preset(run, tmp_path):
    t = np.arange(0, 10, 0.002)
    v = np.sin(2 * t)
    torque = 0.026609234235148084 * 2 * np.cos(2 * t) + load_model("preset:mx106/m1").torque(0, v)
    path = tmp_path / "log.csv"
    columns = np.column_stack([t, -0.5 * np.cos(2 * t), v, torque])
    np.savetxt(path, columns, delimiter=",", header="t,q,dq,tau", comments="")
    code, out, err = run("validate", "preset:mx106/m1", path, "--names", "mx106", "--json")
    assert code == 0, err
    assert json.loads(out)["joints"]["mx106"]["residual_percent"] < 5.0  # reversals
    code, _, err = run("validate", "preset:mx106", path)
    assert code == 2
    assert "Did you mean 'mx106/m" in err
