"""What a model answers, against curves worked by hand: where friction drives, where it extrapolates, what it warns of."""

import json
import math
import warnings

import numpy as np
import pytest

from backdrive.errors import ExtrapolationWarning, InvalidInput, ModelFileError, NegativeFrictionWarning
from backdrive.laws import CoulombViscous, Law, Polyline
from backdrive.logs.log import Joint
from backdrive.model import FrictionModel, JointFriction, Validity
from backdrive.model.file import decode, encode


def friction(rate, low, high, name="a", unit="rad"):
    return JointFriction(
        joint=Joint(name=name, unit=unit), law=Law(rate=rate), validity=Validity(velocity=(low, high))
    )


def line(positive, negative, velocity=(1.0, 2.0)):
    return Polyline(velocity=velocity, positive=positive, negative=negative)


PLAIN = CoulombViscous(
    coulomb_positive=2.0, coulomb_negative=3.0, viscous_positive=0.5, viscous_negative=0.25
)

FALLING = line((5.0, 1.0), (5.0, 1.0))  # 9 - 4 v: 0 at 2.25


@pytest.mark.parametrize(
    ("rate", "low", "high", "ends"),
    [
        (PLAIN, -3.0, 3.0, None),
        (FALLING, -2.0, 2.0, None),
        (FALLING, -2.0, 3.0, (2.25 + 0.025, 3.0)),  # 201 velocities are 1/40 apart, and at 2.25 it is 0
        (FALLING, -3.0, 2.0, (-3.0, -2.275)),
        (FALLING, -3.0, 3.0, (-3.0, 3.0)),
        (FALLING, 2.2, 2.4, (2.251, 2.4)),
        (line((5.0, -1.0, 5.0), (5.0, 5.0, 5.0), (1.0, 1.001, 1.002)), -2.0, 2.0, (1.001, 1.001)),  # between two of 201
        (line((5.0, 5.0, 5.0), (5.0, -1.0, 5.0), (1.0, 1.001, 1.002)), -2.0, 2.0, (-1.001, -1.001)),
        (line((5.0, 5.0, 5.0), (5.0, -1.0, 5.0), (1.0, 1.001, 1.002)), -1.0, 2.0, None),  # the knot is outside
        (line((5.0, -1.0, 5.0), (5.0, 5.0, 5.0), (1.0, 1.001, 1.002)), -2.0, 1.0, None),
        (line((5.0, -1.0), (5.0, -1.0)), -2.0, 2.0, (-2.0, 2.0)),  # at the very ends
        (CoulombViscous(coulomb_positive=0.0, coulomb_negative=0.0), -1.0, 1.0, None),  # 0 everywhere drives nothing
    ],
)  # fmt: skip
def test_friction_drives_where_it_is_negative(rate, low, high, ends):
    found = friction(rate, low, high)
    assert found.driving() == (None if ends is None else pytest.approx(ends, abs=1e-9))
    unit = friction(rate, low, high, unit="m")
    if ends is None:
        assert found.remarks() == () == unit.remarks()
    else:
        where = f"at {ends[0]:.4g}" if ends[0] == ends[1] else f"between {ends[0]:.4g} and {ends[1]:.4g}"
        for joint, per in ((found, "rad/s"), (unit, "m/s")):
            assert joint.remarks() == (
                f"Friction is negative {where} {per}: there the model drives the motion.",
            )


@pytest.mark.parametrize(("low", "high"), [(-2.0, 4.0), (1.0, 3.0), (-5.0, -0.5), (0.0, 0.0)])
def test_a_validity_range_ends_a_billionth_of_its_ends_outside(low, high):
    joint = friction(PLAIN, low, high)
    inside = np.array([low, high, 0.5 * (low + high), low - 0.9e-9 * abs(low), high + 0.9e-9 * abs(high)])
    beyond = np.array(
        [low - 1.1e-9 * abs(low) - 1e-300, high + 1.1e-9 * abs(high) + 1e-300, low - 1.0, high + 1.0]
    )
    assert joint.outside(inside).tolist() == [False] * 5
    assert joint.outside(beyond).tolist() == [True] * 4
    assert joint.outside(beyond.reshape(2, 2)).shape == (2, 2)
    assert joint.extrapolation(inside) == ""


@pytest.mark.parametrize(
    ("velocity", "furthest", "share"),
    [
        ([3.0, 0.0, 1.0, -1.0], "3", "25"),
        ([-4.0, 3.0, 0.0, 0.0], "-4", "50"),  # 2 below the one end, 1 above the other
        ([-3.0, 5.0, 0.0, 0.0], "5", "50"),
        ([-2.5, -2.25, 0.0], "-2.5", "66.7"),
        ([2.25, 2.75, 2.5, 0.0], "2.75", "75"),
        ([9.0, 9.0], "9", "100"),
        ([2.5], "2.5", None),  # of a single velocity there is no share
        ([0.0] * 7 + [3.0], "3", "12.5"),
    ],
)
def test_how_far_velocities_leave_the_range_is_said(velocity, furthest, share):
    for unit in ("rad", "m"):
        share_of = "" if share is None else f", with {share} % of the velocities"
        assert friction(PLAIN, -2.0, 2.0, unit=unit).extrapolation(np.array(velocity)) == (
            f"Joint 'a': {furthest} {unit}/s is outside the validity range, -2 to 2 {unit}/s{share_of}; "
            "there the model extrapolates."
        )


def warned(model, velocity):
    """What a model says of velocities, and whether it points at the line that asked."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        torque = model.torque("a", velocity)
    assert all(one.filename == __file__ for one in caught)
    return torque, [(one.category, str(one.message)) for one in caught]


def test_a_model_warns_where_it_is_asked_and_not_elsewhere():
    model = FrictionModel(joints=(friction(FALLING, -2.5, 2.5),))
    assert warned(model, [2.0, -2.0, 0.0]) == (pytest.approx([1.0, -1.0, 0.0]), [])
    torque, said = warned(model, [1.0, 2.4, 2.5])
    assert torque == pytest.approx([5.0, 9.0 - 4.0 * 2.4, -1.0])
    assert said == [
        (
            NegativeFrictionWarning,
            "Joint 'a': friction is negative at 2.4 rad/s; there the model drives the motion.",
        )
    ]
    _, said = warned(model, [-2.45, 2.4])
    assert [category for category, _ in said] == [NegativeFrictionWarning] and "at -2.45 rad/s" in said[0][1]
    _, said = warned(model, [1.0, -3.0])
    assert [category for category, _ in said] == [ExtrapolationWarning, NegativeFrictionWarning]
    assert "-3 rad/s is outside the validity range, -2.5 to 2.5 rad/s, with 50 %" in said[0][1]
    rail = FrictionModel(joints=(friction(PLAIN, -1.0, 1.0, unit="m"),))
    torque, said = warned(rail, 2.0)
    assert float(torque) == pytest.approx(3.0) and [category for category, _ in said] == [
        ExtrapolationWarning
    ]
    assert (
        said[0][1]
        == "Joint 'a': 2 m/s is outside the validity range, -1 to 1 m/s; there the model extrapolates."
    )


def test_curves_span_the_validity_range_from_low_to_high():
    model = FrictionModel(joints=(friction(PLAIN, -2.0, 6.0), friction(PLAIN, 1.0, 1.5, name="b")))
    for speeds in (2, 3, 9):
        table = model.table(speeds)
        assert list(table) == ["a", "b"]
        assert table["a"]["velocity"] == pytest.approx([-2.0 + 8.0 * k / (speeds - 1) for k in range(speeds)])
        assert table["b"]["velocity"] == pytest.approx([1.0 + 0.5 * k / (speeds - 1) for k in range(speeds)])
        assert table["b"]["torque"] == pytest.approx(2.0 + 0.5 * table["b"]["velocity"])
    assert model.table()["b"]["velocity"] == pytest.approx([1.0 + 0.025 * k for k in range(21)])


@pytest.mark.parametrize("name", ["velocity", "load", "temperature"])
def test_ranges_are_two_finite_numbers_in_order(name):
    def ranges(low, high):
        return Validity(**{"velocity": (-1.0, 1.0), name: (low, high)})

    for low, high in ((-1.0, 2.0), (1.0, 1.0), (0.0, 0.0)):
        assert getattr(ranges(low, high), name) == (low, high)
    for low, high in ((1.0, 0.5), (-math.inf, 0.0), (0.0, math.inf), (math.nan, 1.0), (0.0, math.nan)):
        with pytest.raises(InvalidInput, match=f"validity.{name} goes from"):
            ranges(low, high)


# ------------------------------------------------------------------------------------- damaged model files


def refused(data, name="m.json"):
    with pytest.raises(ModelFileError) as error:
        decode(data, name)
    return str(error.value)


def test_what_is_wrong_with_a_model_file_is_told_apart():
    good = encode(FrictionModel(joints=(friction(PLAIN, -1.0, 1.0),)))
    assert decode(good).names == ("a",)
    for data in (b"words", b"t,q,tau\n0.0,1.0,2.0\n", b"[1]", b"\x93NUMPY"):
        assert "it is no friction model, which is JSON" in refused(data) and "damaged" not in refused(data)
    for data in (b"", b"{", good[:-20], good + b"x", good.replace(b'"a"', b'"\xff"')):
        assert refused(data).startswith("m.json is damaged: ")
    for data in (b"{}", b'{"format": "other", "schema": 1}', b'{"format": null}'):
        assert "not a friction model" in refused(data)
    assert "model file: it is JSON, but" in refused(b"{}", "model file")
    document = json.loads(good)
    for schema in (3, 0, True, "1", None, 1.5):
        assert "this version reads 1 and 2" in refused(json.dumps({**document, "schema": schema}).encode())
    long = refused(json.dumps({**document, "schema": "9" * 100}).encode())
    assert f"$.schema is {'9' * 40}, this" in long
    for change, said in (
        ({"joints": 5}, "$.joints: Expected `array`, got `int`"),
        ({"version": 1}, "m.json: Object contains unknown field `version`"),
    ):
        text = refused(json.dumps({**document, **change}).encode())
        assert said in text and "damaged" not in text
    del document["provenance"]
    assert "m.json: Object missing required field `provenance`" in refused(json.dumps(document).encode())


def test_names_that_utf_8_cannot_hold_are_replaced_wherever_they_stand():
    options = {"a\udcff": ["b\udcff", {"c\udcff": ("d\udcff", 1, None, True)}]}
    read = decode(encode(FrictionModel(joints=(friction(PLAIN, -1.0, 1.0),), options=options)))
    assert read.options == {"a?": ["b?", {"c?": ["d?", 1, None, True]}]}


def test_a_model_file_without_what_may_be_left_out():
    bare = FrictionModel(joints=(friction(PLAIN, -1.0, 1.0),))
    document = json.loads(encode(bare))
    joint = document["joints"][0]
    for key in (
        "encoder_counts",
        "element_parameters",
        "dynamics",
        "fitted",
        "held_out",
        "method",
        "warnings",
    ):
        joint.pop(key)
    for key in ("load", "temperature"):
        joint["validity"].pop(key)
    for value in joint["parameters"].values():
        for key in ("standard_error", "lower", "upper", "at_bound"):
            value.pop(key)
    document.pop("arm")
    for key in ("sources", "options"):
        document["provenance"].pop(key)
    assert encode(decode(json.dumps(document).encode())) == encode(bare)
    assert decode(json.dumps(document).encode()).joints[0].at_bound == ()


def grown(place, make, size):
    """A model file in which one thing has a given size."""
    document = json.loads(encode(FrictionModel(joints=(friction(PLAIN, -1.0, 1.0),))))
    *way, last = place.split(".")
    inner = document
    for key in way:
        inner = inner[int(key) if key.isdigit() else key]
    inner[last] = make(size)
    return json.dumps(document).encode()


def joints_of(size):
    joint = json.loads(encode(FrictionModel(joints=(friction(PLAIN, -1.0, 1.0),))))["joints"][0]
    return [{**joint, "name": f"j{k}"} for k in range(size)]


SOURCE = {"path": "", "sha256": ""}
NUMBER = {"value": 1.0, "unit": "1"}


@pytest.mark.parametrize(
    ("place", "make", "most"),
    [
        ("joints.0.name", "n".__mul__, 500),
        ("joints.0.method", "m".__mul__, 500),
        ("joints.0.warnings", lambda size: ["w" * size], 5000),
        ("joints.0.warnings", lambda size: ["w"] * size, 1000),
        ("joints.0.dynamics", lambda size: {f"k{k}": NUMBER for k in range(size)}, 100),
        ("joints.0.dynamics", lambda size: {"k" * size: NUMBER}, 500),
        ("joints.0.dynamics", lambda size: {"k": {**NUMBER, "unit": "u" * size}}, 500),
        ("joints", joints_of, 500),
        ("arm", lambda size: {"urdf_sha256": "x", "parameters": [0.5] * size, "condition": 1}, 5000),
        ("provenance.backdrive", "v".__mul__, 500),
        ("provenance.sources", lambda size: [SOURCE] * size, 100_000),
        ("provenance.sources", lambda size: [{**SOURCE, "path": "p" * size}], 5000),
        ("provenance.sources", lambda size: [{**SOURCE, "sha256": "s" * size}], 500),
    ],
)
def test_everything_in_a_model_file_has_a_largest_size(place, make, most):
    assert decode(grown(place, make, most)).joints
    said = refused(grown(place, make, most + 1))
    assert said.startswith(("m.json: $.", "m.json: key in $.")) and "Expected `" in said


def test_curves_of_a_model_file_have_1000_knots_at_most():
    def curve(size, errors):
        velocity = tuple(0.1 * (k + 1) for k in range(size))
        rate = Polyline(velocity=velocity, positive=(2.0,) * size, negative=(2.0,) * size)
        document = json.loads(encode(FrictionModel(joints=(friction(rate, -1.0, 1.0),))))
        document["joints"][0]["parameters"]["positive"]["standard_error"] = [0.5] * errors
        return json.dumps(document).encode()

    assert decode(curve(1000, 1000)).joints[0].standard_errors == {"positive": (0.5,) * 1000}
    assert "`array` of length <= 1000" in refused(
        curve(1001, 1001)
    ) and "`array` of length <= 1000" in refused(curve(1000, 1001))
    for place, value in (
        ("joints.0.name", ""),
        ("joints.0.fitted", {"residual_percent": 1, "residual_raw_percent": 1, "rms": 1, "samples": -1}),
    ):
        assert "m.json: $." in refused(grown(place, lambda _, value=value: value, 0))
    for samples, fits in ((10**12, True), (10**12 + 1, False), (10**400, False)):
        counted = {"residual_percent": 1, "residual_raw_percent": 1, "rms": 1, "samples": samples}
        data = grown("joints.0.fitted", lambda _, value=counted: value, 0)
        assert decode(data).joints[0].fitted.samples == samples if fits else refused(data)
    none = {"residual_percent": None, "residual_raw_percent": None, "rms": None, "samples": 0}
    quality = decode(grown("joints.0.fitted", lambda _: none, 0)).joints[0].fitted
    assert (
        all(math.isnan(x) for x in (quality.residual, quality.residual_raw, quality.rms))
        and quality.samples == 0
    )


def test_an_object_that_says_one_thing_twice_is_refused():
    good = encode(FrictionModel(joints=(friction(PLAIN, -1.0, 1.0),)))
    twice = good.replace(b'"unit": "rad",', b'"unit": "m", "unit": "rad",', 1)
    assert twice != good and "'unit' occurs twice in one object" in refused(twice)
