"""Schema 2 of the model file: what it holds beside the law, what it refuses, the schemas that are shipped, files of schema 1."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from backdrive import load_model
from backdrive.errors import InvalidInput, ModelFileError
from backdrive.model import (
    Actuator,
    Band,
    Bands,
    Covariance,
    FrictionModel,
    TorqueChannel,
    Validity,
    Verdict,
    document,
    presets,
)
from backdrive.model.file import decode, encode
from backdrive.tuning import tuning_file
from test_model_file import growing, model

ROOT = Path(document.__file__).parents[1]
NAMES = ("positive[0]", "negative[0]", "negative[1]", "load_driven", "inertia")
ERRORS = np.array([0.1, 0.1, 0.2, 0.02, 0.01])
CORRELATION = np.full((5, 5), 0.4) + 0.6 * np.eye(5)


def full() -> FrictionModel:
    """A model that knows everything that a file can hold."""
    first, second = growing().joints
    first = replace(
        first,
        joint=replace(first.joint, named=True),
        validity=replace(first.validity, lowest_speed=0.02, nominal_load=10.0),
        covariance=Covariance.of(NAMES, CORRELATION * np.outer(ERRORS, ERRORS)),
        torque_channel=TorqueChannel(delay=-1e-3, delay_error=1e-4, noise=0.2, long_run=0.03),
        actuator=Actuator(torque_limit=100.0, trip_speed=3.0, gain=-2.5, motor_inertia=0.4),
        friction_side="joint",
        verdict=Verdict(grade="good", text="It slides."),
        bands=Bands(moving=Band(half_width=0.4, samples=900), rest=Band(half_width=2.0, samples=10)),
    )
    return replace(growing(), joints=(first, second), coupling=((1.0, 0.0), (-0.5, 1.0)))


def test_what_is_saved_is_what_is_loaded(tmp_path):
    full().save(tmp_path / "m.json")
    read = load_model(tmp_path / "m.json")
    assert encode(read) == encode(full())
    for name in ("covariance", "torque_channel", "actuator", "friction_side", "verdict", "bands", "validity"):
        assert getattr(read.joints[0], name) == getattr(full().joints[0], name)
    assert read.joints[0].joint.named is True and read.joints[1].joint.named is None
    assert read.coupling == full().coupling
    assert read.joints[1].covariance is None and read.joints[1].bands is None


def test_the_standard_errors_are_the_roots_of_the_diagonal():
    matrix = full().joints[0].covariance
    assert matrix.standard_errors() == pytest.approx(dict(zip(NAMES, ERRORS, strict=True)))
    with pytest.raises(InvalidInput, match="'load_driven' is 0.03, and 0.02"):
        replace(full().joints[0], standard_errors={"load_driven": 0.03})


def test_a_joint_without_a_number_has_no_row_of_it():
    first = full().joints[0]
    assert replace(first, dynamics={}).covariance.names == NAMES[:-1]
    bare = replace(first, law=replace(first.law, growth=None)).covariance
    assert bare.names == (*NAMES[:3], "inertia")
    assert bare.array() == pytest.approx(
        (CORRELATION * np.outer(ERRORS, ERRORS))[np.ix_([0, 1, 2, 4], [0, 1, 2, 4])]
    )
    assert replace(first, law=model().joints[1].law, dynamics={}).covariance is None


def test_rows_that_the_data_do_not_determine_are_left_out():
    matrix = np.diag([1.0, np.nan, np.inf, 4.0, 1e80])
    found = Covariance.of(("a", "b", "c", "d", "e"), matrix)
    assert found.names == ("a", "d") and found.matrix == ((1.0, 0.0), (0.0, 4.0))
    assert Covariance.of(("b",), np.array([[np.nan]])) is None
    many = [f"x[{i}]" for i in range(201)]
    assert Covariance.of(many, np.eye(201)) is None


def edited(change) -> bytes:
    data = json.loads(encode(full()))
    change(data, data["joints"][0])
    return json.dumps(data).encode()


PLACE = r"\$\.joints\[0\]"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d, j: j["covariance"]["matrix"].pop(), rf"{PLACE}\.covariance: .* rows and columns"),
        (lambda d, j: j["covariance"]["matrix"][2].append(0.0), rf"{PLACE}\.covariance: .* rows and columns"),
        (lambda d, j: j["covariance"]["names"].pop(), rf"{PLACE}\.covariance"),
        (lambda d, j: j["covariance"].update(names=[], matrix=[]), rf"{PLACE}\.covariance: .*0 rows"),
        (lambda d, j: j["covariance"]["names"].__setitem__(1, "inertia"), rf"{PLACE}\.covariance: .*twice"),
        (lambda d, j: j["covariance"]["names"].__setitem__(0, "positive[7]"), rf"{PLACE}\.covariance.names\[0\] is .positive\[7\]"),
        (lambda d, j: j["covariance"]["names"].__setitem__(0, "positive[-1]"), rf"{PLACE}\.covariance\.names\[0\] .*neither"),
        (lambda d, j: j["covariance"]["names"].__setitem__(0, "positive"), rf"{PLACE}\.covariance\.names\[0\] .*neither"),
        (lambda d, j: j["covariance"]["names"].__setitem__(0, "warp"), rf"{PLACE}\.covariance\.names\[0\] is 'warp', which"),
        (lambda d, j: j["covariance"]["names"].__setitem__(0, "inertia[0]"), rf"{PLACE}\.covariance\.names\[0\] .*neither"),
        (lambda d, j: j["covariance"]["matrix"][0].__setitem__(1, 0.0), "not symmetric"),
        (lambda d, j: j["covariance"]["matrix"][0].__setitem__(0, -1.0), "negative variance"),
        (lambda d, j: j["covariance"]["matrix"][0].__setitem__(0, 4.0), rf"{PLACE}: .*'positive\[0\]' is 0.1, and 2"),
        (lambda d, j: j["covariance"]["matrix"][0].__setitem__(0, None), rf"{PLACE}\.covariance\.matrix\[0\]\[0\]"),
        (lambda d, j: j["covariance"]["matrix"][0].__setitem__(0, 1e300), "beyond"),
        (lambda d, j: j["covariance"]["matrix"][0].__setitem__(0, 0.0), "correlation beyond 1"),
        (lambda d, j: j["covariance"].update(units=[]), rf"{PLACE}\.covariance contains the unknown field 'units'"),
        (lambda d, j: j["torque_channel"].update(noise=-0.1), rf"{PLACE}\.torque_channel: .*noise = -0.1"),
        (lambda d, j: j["torque_channel"].update(delay="late"), rf"{PLACE}\.torque_channel\.delay"),
        (lambda d, j: j["torque_channel"].update(delay=1e13), rf"{PLACE}\.torque_channel: .*delay"),
        (lambda d, j: j["actuator"].update(torque_limit=0), rf"{PLACE}\.actuator: .*torque_limit"),
        (lambda d, j: j["actuator"].update(trip_speed=-3), rf"{PLACE}\.actuator: .*trip_speed"),
        (lambda d, j: j["bands"]["moving"].update(half_width=-1), rf"{PLACE}\.bands\.moving: .*half_width"),
        (lambda d, j: j["bands"]["moving"].update(samples=0), rf"{PLACE}\.bands\.moving: samples"),
        (lambda d, j: j["bands"].update(flying=None), "unknown field 'flying'"),
        (lambda d, j: j["validity"].update(lowest_speed=-1), rf"{PLACE}\.validity: .*lowest_speed"),
        (lambda d, j: j["validity"].update(slowest=1), rf"{PLACE}\.validity contains the unknown field 'slowest'"),
        (lambda d, j: j["verdict"].update(grade="splendid"), rf"{PLACE}\.verdict\.grade"),
        (lambda d, j: j["verdict"].update(text="x" * 6000), rf"{PLACE}\.verdict: .*6000"),
        (lambda d, j: j.update(friction_side="both"), rf"{PLACE}\.friction_side"),
        (lambda d, j: j.update(named=1), rf"{PLACE}\.named"),
        (lambda d, j: d.update(coupling=[[1.0, 0.0]]), "coupling of 2 joints"),
        (lambda d, j: d.update(coupling=[[1.0, 2.0], [2.0, 4.0]]), "no invertible matrix"),
        (lambda d, j: d.update(coupling=[[1e13, 0.0], [0.0, 1.0]]), r"\$\.coupling\[0\]\[0\]"),
        (lambda d, j: d.update(schema=3), "schema is 3, this version reads 1 and 2"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_located(change, words):
    with pytest.raises(ModelFileError, match=words) as raised:
        decode(edited(change))
    assert len(str(raised.value)) < 1000 and raised.value.remedy


def test_a_covariance_that_no_numbers_have_is_refused():
    matrix = np.array([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]])
    with pytest.raises(InvalidInput, match="positive semidefinite"):
        Covariance(names=("a", "b", "c"), matrix=tuple(map(tuple, matrix.tolist())))
    with pytest.raises(InvalidInput, match="finite"):
        Covariance(names=("a",), matrix=((float("nan"),),))
    Covariance(names=("a", "b"), matrix=((1.0, 2.0), (2.0, 4.0)))  # as of one number twice
    Covariance(names=("a", "b"), matrix=((0.0, 0.0), (0.0, 4.0)))


def test_a_model_is_checked_as_it_is_made():
    with pytest.raises(InvalidInput, match="coupling"):
        replace(model(), coupling=((1.0, float("nan")), (0.0, 1.0)))
    with pytest.raises(InvalidInput, match="side"):
        replace(model().joints[0], friction_side="gear")
    with pytest.raises(InvalidInput, match="nominal_load"):
        Validity(velocity=(-1.0, 1.0), nominal_load=float("inf"))


@settings(max_examples=200, deadline=None)
@given(at=st.integers(0, 20_000), byte=st.integers(0, 255))
def test_mutated_bytes_give_a_model_or_a_typed_error(at, byte):
    data = bytearray(encode(full()))
    data[at % len(data)] = byte
    try:
        decode(bytes(data))
    except ModelFileError as error:
        assert str(error)


def test_a_file_of_the_first_schema_becomes_one_of_the_second():
    old = (Path(__file__).parent / "model_schema_1.json").read_bytes()
    assert json.loads(old)["schema"] == 1
    read = decode(old)
    assert encode(read) == encode(growing())
    again = json.loads(encode(read))
    assert again["schema"] == 2 and again["joints"][0]["covariance"] is None
    assert read.torque("shoulder", 0.5, load=30.0) == pytest.approx(5.5 + 0.2 * 20.0)


@pytest.mark.parametrize("name", list(presets.names())[::6])
def test_presets_of_either_schema_are_read_alike(name):
    data = json.loads((Path(presets.__file__).parent / f"{name}.json").read_bytes())
    assert data["schema"] == 2
    old = {k: v for k, v in data.items() if k != "coupling"} | {"schema": 1}
    for joint in old["joints"]:
        for field in (
            "named",
            "friction_side",
            "covariance",
            "torque_channel",
            "actuator",
            "verdict",
            "bands",
        ):
            assert joint.pop(field) is None
        del joint["validity"]["lowest_speed"], joint["validity"]["nominal_load"]
    assert encode(decode(json.dumps(old).encode())) == encode(load_model(f"preset:{name}"))


@pytest.mark.parametrize(("kind", "made"), [("model", document.schema), ("tuning", tuning_file.schema)])
def test_the_schemas_that_are_shipped_are_those_of_the_code(kind, made):
    assert (ROOT / kind / f"{kind}.schema.json").read_text() == made(), "run benchmarks/make_schemas.py"


def test_written_files_hold_to_the_schema():
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(json.loads(document.schema()))
    for data in (
        encode(full()),
        encode(model()),
        (Path(__file__).parent / "model_schema_1.json").read_bytes(),
    ):
        validator.validate(json.loads(data))
    wrong = json.loads(encode(full()))
    wrong["joints"][0]["validity"]["slowest"] = 1.0
    assert not validator.is_valid(wrong)


def test_a_tuning_holds_to_its_schema(tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    from test_tune_limits import TUNING

    path = tuning_file.save_tunings([TUNING], tmp_path / "t.json")
    jsonschema.Draft202012Validator(json.loads(tuning_file.schema())).validate(json.loads(path.read_text()))


def run(monkeypatch, capsys, *arguments) -> tuple[int, str]:
    from backdrive.cli import main

    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys, "argv", ["backdrive", "show", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        main()
    captured = capsys.readouterr()
    return stopped.value.code or 0, captured.out + captured.err


def test_show_prints_schemas_and_what_is_known_beside_the_law(tmp_path, monkeypatch, capsys):
    for kind in ("model", "tuning"):
        code, out = run(monkeypatch, capsys, "--schema", kind)
        assert code == 0 and json.loads(out)["title"].endswith("schema 2")
    full().save(tmp_path / "m.json")
    code, out = run(monkeypatch, capsys, tmp_path / "m.json")
    assert code == 0
    for words in (
        "lowest speed of the data",
        "torque limit",
        "drive gain",
        "95 % of torque within, moving",
        "covariance matrix",
    ):
        assert words in out
    code, out = run(monkeypatch, capsys, tmp_path / "m.json", "--joint", "rail", "--json")
    assert code == 0 and json.loads(out)["model"]["coupling"] == [[1.0, 0.0], [-0.5, 1.0]]
    code, out = run(monkeypatch, capsys)
    assert code == 2 and "--schema" in out
    code, out = run(monkeypatch, capsys, "--schema", "report")
    assert code == 2 and "'report'" in out and "model or tuning" in out
