"""Tests for model.py and model_file.py: what is written is what is read, and damage is located."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backdrive import FrictionModel, Joint, load_model
from backdrive.errors import InvalidInput, ModelFileError, UnknownName
from backdrive.laws import CoulombViscous, Growth, Law, Polyline
from backdrive.logs.log import Source
from backdrive.model import ArmModel, Estimate, JointFriction, Quality, Validity
from backdrive.model.file import decode, encode


def model() -> FrictionModel:
    first = JointFriction(
        joint=Joint(name="shoulder", gear_ratio=100.0, encoder_counts=1e6),
        law=Law(rate=Polyline(velocity=(0.0, 1.0), positive=(5.0, 6.0), negative=(4.0, 7.0))),
        standard_errors={"positive": (0.1, float("nan")), "negative": (0.1, 0.2)},
        at_bound=("positive",),
        dynamics={"inertia": Estimate(value=1.5, unit="kg.m^2", standard_error=0.01)},
        validity=Validity(velocity=(-1.0, 1.0), load=(0.0, 30.0), temperature=(20.0, 35.0)),
        fitted=Quality(residual=2.0, residual_raw=3.0, rms=0.1, samples=100),
        held_out=Quality(residual=2.5, residual_raw=3.5, rms=0.2, samples=50),
        method="sweep",
        warnings=("a remark",),
    )
    second = JointFriction(
        joint=Joint(name="rail", unit="m"),
        law=Law(rate=CoulombViscous(coulomb_positive=12.0, coulomb_negative=8.0)),
        validity=Validity(velocity=(-0.1, 0.2)),
    )
    return FrictionModel(
        joints=(first, second),
        arm=ArmModel(urdf_sha256="ab", parameters=(1.0, 2.0), condition=30.0),
        sources=(Source(path="log.csv", sha256="cd"),),
        options={"method": "sweep"},
        version="1.2.3",
    )


def test_what_is_saved_is_what_is_loaded(tmp_path):
    model().save(tmp_path / "m.json")
    assert encode(load_model(tmp_path / "m.json")) == encode(model())


def test_every_number_carries_its_unit():
    joints = json.loads(encode(model()))["joints"]
    assert joints[0]["parameters"]["velocity"]["unit"] == "rad/s"
    assert joints[1]["parameters"]["viscous_positive"]["unit"] == "N.s/m"
    assert joints[0]["parameters"]["positive"]["at_bound"] is True


def test_torque_is_that_of_the_law_and_the_joint_is_found_by_name():
    m = model()
    np.testing.assert_allclose(m.torque("shoulder", [0.5, -0.5, 0.0]), [5.5, -5.5, 0.0])
    np.testing.assert_allclose(m.torque(1, np.array([[0.1], [-0.1]])), [[12.0], [-8.0]])
    with pytest.raises(UnknownName, match="shoulder, rail"):
        m.torque("wrist", 1.0)
    with pytest.raises(InvalidInput, match="NaN"):
        m.torque("rail", float("nan"))


def test_table_spans_the_validity_range():
    table = model().table(5)["rail"]
    np.testing.assert_allclose(table["velocity"], np.linspace(-0.1, 0.2, 5))


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (lambda d: d.update(format="something"), "not a friction model"),
        (lambda d: d.update(schema=99), "schema is 99"),
        (lambda d: d["joints"][0].update(unit="deg"), r"\$\.joints\[\.\.\.\]\.unit|joints"),
        (lambda d: d["joints"][0]["law"].update(rate="polylin"), "polyline"),
        (lambda d: d["joints"][0]["parameters"].pop("velocity"), r"joints\[0\].*velocity"),
        (lambda d: d["joints"][0]["parameters"]["velocity"].update(unit="deg/s"), "deg/s"),
        (lambda d: d["joints"][0]["parameters"]["velocity"].update(value=[1.0, 0.5]), "strictly increase"),
        (lambda d: d["joints"][1]["parameters"]["coulomb_positive"].update(value="12"), "value"),
        (lambda d: d["joints"][1]["parameters"]["coulomb_positive"].update(value=-1), "outside"),
        (lambda d: d.update(joints=[]), "distinct joints"),
        (lambda d: d.update(extra=1), "extra"),
    ],
)
def test_damage_is_located(change, where):
    document = json.loads(encode(model()))
    change(document)
    with pytest.raises(ModelFileError, match=where):
        decode(json.dumps(document).encode())


@settings(max_examples=300, deadline=None)
@given(cut=st.integers(0, 5000), byte=st.integers(0, 255), at=st.integers(0, 5000))
def test_mutated_bytes_give_a_model_or_a_typed_error(cut, byte, at):
    data = bytearray(encode(model()))
    data[at % len(data)] = byte
    for damaged in (bytes(data), bytes(data[: cut % len(data)])):
        try:
            decode(damaged)
        except ModelFileError as error:
            assert str(error)


def test_absent_and_oversized_files_are_typed(tmp_path, monkeypatch):
    with pytest.raises(ModelFileError, match="No such file"):
        load_model(tmp_path / "none.json")
    monkeypatch.setattr("backdrive.model.file.MAX_BYTES", 10)
    model().save(tmp_path / "m.json")
    with pytest.raises(ModelFileError, match="larger"):
        load_model(tmp_path / "m.json")


def test_a_file_name_that_is_no_text_does_not_stop_the_saving():
    from dataclasses import replace

    odd = replace(model(), sources=(Source(path="log\udcff.csv", sha256="cd"),))
    assert decode(encode(odd)).sources[0].path == "log?.csv"


def test_an_error_that_is_unknown_is_absent_after_loading():
    assert "velocity" not in decode(encode(model())).joints[0].standard_errors


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "m.json"
    model().save(path)
    before = path.read_bytes()
    with pytest.raises(InvalidInput, match="Cannot write"):
        model().save(tmp_path / "no" / "such" / "m.json")
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.json"]


GROWN = Growth(load_driving=0.2, load_driven=0.05, load_carried=10.0)


def growing(growth=GROWN, **more) -> FrictionModel:
    first, *rest = model().joints
    errors = dict(first.standard_errors) | {"load_driving": 0.01, "load_driven": 0.02}
    first = replace(first, law=replace(first.law, growth=growth), standard_errors=errors, **more)
    return replace(model(), joints=(first, *rest))


def test_growth_with_the_load_stands_in_the_file_with_the_law():
    text = encode(growing())
    first, second = json.loads(text)["joints"]
    assert {n: (v["value"], v["unit"]) for n, v in first["growth"].items()} == {
        "load_driving": (0.2, "1"), "load_driven": (0.05, "1"), "load_carried": (10.0, "N.m"),
    }  # fmt: skip
    assert first["growth"]["load_driven"]["standard_error"] == 0.02 and "growth" not in second
    read = decode(text)
    assert read.joint("shoulder").law.growth == GROWN and read.joint("rail").law.growth is None
    assert encode(read) == text
    for load in (25.0, -25.0):
        assert read.torque("shoulder", 0.5, load=load) == growing().torque("shoulder", 0.5, load=load)


def test_the_torque_of_a_model_knows_load_and_temperature():
    m = growing()
    # 5.5 at 0.5 rad/s under 10 N.m, which the motor lifts, or which drives it back
    assert m.torque("shoulder", 0.5) == m.torque("shoulder", 0.5, load=10.0) == 5.5
    assert m.torque("shoulder", 0.5, load=30.0) == pytest.approx(5.5 + 0.2 * 20.0)
    assert m.torque("shoulder", 0.5, load=-30.0) == pytest.approx(5.5 + 0.05 * 20.0)
    np.testing.assert_allclose(m.torque("shoulder", [0.5, -0.5], load=[4.0, 30.0]), [5.5 - 1.2, -5.5 - 1.0])
    with pytest.raises(InvalidInput, match="A load is NaN"):
        m.torque("shoulder", 0.5, load=np.nan)
    with pytest.raises(InvalidInput, match="A temperature is NaN"):
        m.torque("shoulder", 0.5, temperature=np.inf)
    with pytest.raises(InvalidInput, match="shape"):
        m.torque("shoulder", [0.5, 0.6], load=[1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("terms", "growth", "errors"),
    [
        ({"load_dependence": 0.1, "load_carried": 20.0}, (0.1, 0.1, 20.0), {"load_driving", "load_driven"}),
        ({"load_driving": 0.2, "load_driven": -0.01}, (0.2, -0.01, 0.0), {"load_driving", "load_driven"}),
        ({"load_driving": 0.2}, (0.2, 0.0, 0.0), {"load_driving"}),
        ({"load_friction": 0.3}, (0.3, 0.3, 0.0), {"load_driving", "load_driven"}),
        ({}, None, set()),
    ],
)
def test_growth_that_stands_among_the_dynamics_becomes_the_laws(terms, growth, errors):
    document = json.loads(encode(model()))
    for name, value in terms.items():
        unit = "N.m" if name == "load_carried" else "1"
        document["joints"][0]["dynamics"][name] = {"value": value, "unit": unit, "standard_error": 0.04}
    found = decode(json.dumps(document).encode()).joint("shoulder")
    assert set(found.dynamics) == {"inertia"}
    assert (None if found.law.growth is None else tuple(found.law.growth.values().values())) == growth
    assert {n: e for n, e in found.standard_errors.items() if n.startswith("load_")} == dict.fromkeys(
        errors, 0.04
    )
    assert encode(decode(encode(decode(json.dumps(document).encode())))) == encode(
        decode(json.dumps(document).encode())
    )


def test_a_growth_that_makes_no_sense_is_located():
    for change, where in (
        (lambda g: g.pop("load_driven"), "load_driven"),
        (lambda g: g["load_driving"].update(value=99.0), r"joints\[0\].growth"),
        (lambda g: g["load_carried"].update(unit="1"), "unit is '1'"),
    ):
        document = json.loads(encode(growing()))
        change(document["joints"][0]["growth"])
        with pytest.raises(ModelFileError, match=where):
            decode(json.dumps(document).encode())


def test_growth_of_an_axis_with_a_drive_stays_the_axis():
    document = json.loads(encode(model()))
    for name in ("load_dependence", "drive.delay"):
        document["joints"][0]["dynamics"][name] = {"value": 0.1, "unit": "1"}
    found = decode(json.dumps(document).encode()).joint("shoulder")
    assert found.law.growth is None and found.dynamics["load_dependence"].value == 0.1


def test_numbers_of_numpy_are_written_as_plain_ones(tmp_path):
    first = model().joints[0]
    validity = Validity(velocity=tuple(np.array([-2.0, 2.0])), load=tuple(np.float32([-1.0, 1.0])))
    replace(
        model(),
        joints=(
            replace(
                first, validity=validity, dynamics={"offset": Estimate(value=np.float64(0.5), unit="N.m")}
            ),
        ),
        options={"flag": np.bool_(True), "count": np.int64(3), "knots": np.arange(2.0)},
    ).save(tmp_path / "m.json")
    again = load_model(tmp_path / "m.json")
    assert again.joints[0].validity == validity and again.joints[0].dynamics["offset"].value == 0.5
    assert again.options == {"flag": True, "count": 3, "knots": [0.0, 1.0]}
