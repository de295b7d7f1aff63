"""Models that no identification wrote: refused with the place, or said; an honest one next to each is taken."""

from __future__ import annotations

import json
import sys
import tracemalloc
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))
from _hostile_models import HOSTILE, honest, number

from backdrive import load_model
from backdrive.errors import ExtrapolationWarning, InvalidInput, ModelFileError, NegativeFrictionWarning
from backdrive.identification import validate
from backdrive.identification.quality import credible
from backdrive.identification.validate import _axis
from backdrive.laws import ELEMENTS, RATES
from backdrive.model import Validity
from backdrive.model.bounds import BIG
from backdrive.model.file import decode, encode
from backdrive.model.presets import names


def of(document) -> bytes:
    return json.dumps(document).encode()


def test_the_honest_one_is_taken():
    model = decode(of(honest()))
    assert model.names == ("elbow", "wrist")
    assert encode(decode(encode(model))) == encode(model)


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_models_are_refused_with_the_place(kind):
    data, words = HOSTILE[kind]
    with pytest.raises(ModelFileError) as raised:
        decode(data)
    assert raised.value.message.startswith("model file")
    assert words in raised.value.message
    assert raised.value.remedy
    assert len(str(raised.value)) < 1000


def test_refusing_takes_little_memory():
    tracemalloc.start()
    for data in (HOSTILE["nothing but brackets"][0], b'{"joints": [' + b"[]," * 3_000_000):
        with pytest.raises(ModelFileError):
            decode(data)
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


def test_bounds_of_laws_and_presets_are_within_those_of_a_file():
    for kind in (*RATES.values(), *ELEMENTS.values()):
        for p in kind.PARAMETERS.values():
            assert all(abs(v) <= BIG or np.isinf(v) for v in (p.lower, p.upper))
    for name in names():
        load_model(f"preset:{name}")


@pytest.mark.parametrize("ends", [(5.0, -5.0), (0.0, float("nan")), (-float("inf"), 1.0)])
@pytest.mark.parametrize("what", ["velocity", "load", "temperature"])
def test_a_validity_range_has_its_ends_in_order(what, ends):
    with pytest.raises(InvalidInput, match=f"validity.{what}"):
        Validity(**{"velocity": (-1.0, 1.0), what: ends})


def negative_in_between():
    """Friction below zero around 1.005 rad/s alone, on a range of 400: between 201 equal steps nothing shows."""
    document = honest()
    joint = document["joints"][0]
    for key, values, unit in (
        ("velocity", [0.1, 1.0, 1.005, 1.01, 200.0], "rad/s"),
        ("positive", [5.0, 5.0, -1.0, 5.0, 5.0], "N.m"),
        ("negative", [5.0, 5.0, 5.0, 5.0, 5.0], "N.m"),
    ):
        joint["parameters"][key] = number(values, unit)
    joint["validity"] = {"velocity": [-200.0, 200.0]}
    return document


def test_negative_friction_anywhere_is_said(tmp_path, capsys, monkeypatch):
    from backdrive.cli import main

    model = decode(of(negative_in_between()))
    elbow, wrist = model.joints
    assert elbow.driving() == (1.005, 1.005)
    assert not credible(elbow)
    assert elbow.remarks() == ("Friction is negative at 1.005 rad/s: there the model drives the motion.",)
    assert wrist.driving() is None
    assert wrist.remarks() == ()
    with pytest.warns(NegativeFrictionWarning, match=r"'elbow'.*negative at 1.005 rad/s"):
        assert model.torque("elbow", [1.0, 1.005])[1] == -1.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.torque("elbow", [-200.0, -1.005, 0.0, 1.0, 200.0])
    path = tmp_path / "m.json"
    path.write_bytes(of(negative_in_between()))
    for words in ((), ("--json",)):
        monkeypatch.setattr(sys, "argv", ["backdrive", "show", str(path), *words])
        with pytest.raises(SystemExit) as stopped:
            main()
        assert not stopped.value.code
        assert "Friction is negative at 1.005 rad/s" in capsys.readouterr().out.replace("\u00a0", " ")


def test_torque_outside_the_validity_range_is_said():
    model = decode(of(honest()))
    with pytest.warns(ExtrapolationWarning, match=r"'elbow': 3 rad/s is outside .*-2 to 2 rad/s; there"):
        # the last section, from 6 at 1 to 8 N.m at 2 rad/s, goes on
        assert model.torque("elbow", 3.0) == pytest.approx(10.0)
    with pytest.warns(ExtrapolationWarning, match=r"-9 rad/s is outside .* with 50 % of the velocities"):
        model.torque("elbow", [1.0, -3.0, 2.0, -9.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.torque("elbow", [-2.0, 2.0, np.nextafter(2.0, 3.0)])


def test_torque_below_the_lowest_speed_of_the_data_is_said():
    document = honest()
    document["joints"][0]["validity"]["lowest_speed"] = 0.175
    model = decode(of(document))
    elbow = model.joints[0]
    assert elbow.outside(np.array([-3.0, -0.1, 0.0, 0.1, 0.175])).tolist() == [True, True, False, True, False]
    assert elbow.extrapolation(np.array([0.1, 1.0])) == ""  # every log passes through low speeds
    words = r"'elbow' at 0.03 rad/s: Below 0.175 rad/s.* friction is unknown"
    for velocity in (0.03, 0.03, [1.0, 0.03]):
        with pytest.warns(ExtrapolationWarning, match=words):
            model.torque("elbow", velocity)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            model.torque("elbow", 0.2)  # from here on single velocities take the short way
            model.torque("elbow", 0.0)
    assert replace(elbow, validity=Validity(velocity=(-2.0, 2.0))).lowest_speed_remark() == ""


def test_a_log_outside_the_validity_range_is_said():
    sys.path.insert(0, str(Path(__file__).parent))
    from _synthetic import any_motion
    from backdrive import identify

    log = any_motion(lambda v: 5.0 * np.sign(v) + 2.0 * v, seconds=20.0)
    model = identify(log).model
    friction = model.joints[0]
    remarks: list[str] = []
    validate(model, [log], remarks=remarks)
    assert remarks == []
    high = friction.validity.velocity[1]
    narrow = replace(friction, validity=Validity(velocity=(-0.5 * high, 0.5 * high)))
    validate(replace(model, joints=(narrow,)), [log], remarks=remarks)
    assert len(remarks) == 1
    assert "outside the validity range" in remarks[0]


@pytest.mark.parametrize("step", [1e-300, -1.0, 1e300, float("nan"), "fast", None, [1e-3]])
def test_a_model_cannot_ask_for_endless_integration(step):
    document = honest()
    wrist = document["joints"][1]
    wrist["dynamics"] = {"inertia": number(1.0, "kg.m^2")}
    document["provenance"]["options"] = {"joints": {"wrist": {"drive": {"law": "torque"}}}}
    model = decode(of(document))
    model.options["joints"]["wrist"]["step"] = step
    with pytest.raises(InvalidInput, match="drive of joint 'wrist'"):
        _axis(model, "wrist")
