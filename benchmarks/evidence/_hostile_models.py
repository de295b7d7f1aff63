"""Model files that no identification wrote: each kind as bytes, with a piece of the sentence that has to refuse it.

They are made of plain JSON by hand; nothing of the package is used.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

PLACE = "$.joints[0]"


def number(value: Any, unit: str, **more: Any) -> dict[str, Any]:
    """Return a number as a model file holds it."""
    return {"value": value, "unit": unit, **more}


def honest() -> dict[str, Any]:
    """Return a model file of two joints that is right."""
    knots = number([0.1, 1.0, 2.0], "rad/s")
    curve = number([5.0, 6.0, 8.0], "N.m", standard_error=[0.1, 0.1, None])
    first = {
        "name": "elbow",
        "unit": "rad",
        "torque_side": "joint",
        "gear_ratio": 100.0,
        "encoder_counts": 1e6,
        "law": {"rate": "polyline", "element": "none"},
        "parameters": {"velocity": knots, "positive": curve, "negative": copy.deepcopy(curve)},
        "element_parameters": {},
        "validity": {"velocity": [-2.0, 2.0], "load": [0.0, 10.0], "temperature": [20.0, 40.0]},
        "dynamics": {"inertia": number(1.5, "kg.m^2", standard_error=0.1)},
        "fitted": {"residual_percent": 2.0, "residual_raw_percent": 3.0, "rms": 0.1, "samples": 100},
        "method": "sweep",
        "warnings": [],
    }
    second = {
        "name": "wrist",
        "unit": "rad",
        "torque_side": "joint",
        "gear_ratio": 1.0,
        "law": {"rate": "coulomb", "element": "dahl"},
        "parameters": {"coulomb": number(3.0, "N.m", standard_error=0.1)},
        "element_parameters": {"stiffness": number(1e4, "N.m/rad")},
        "validity": {"velocity": [-1.0, 1.0], "lowest_speed": 0.01, "nominal_load": 2.0},
        "covariance": {"names": ["coulomb", "stiffness"], "matrix": [[0.01, 20.0], [20.0, 1e6]]},
        "torque_channel": {"delay": 1e-3, "delay_error": 1e-4, "noise": 0.1, "long_run": 0.01},
        "actuator": {"torque_limit": 50.0, "trip_speed": 3.0},
        "bands": {"moving": {"half_width": 0.3, "samples": 900}},
    }
    return {
        "format": "backdrive-friction-model",
        "schema": 2,
        "joints": [first, second],
        "provenance": {"backdrive": "1.0", "sources": [], "options": {}},
    }


def _edited(edit: Callable[[dict[str, Any], dict[str, Any], dict[str, Any]], Any]) -> bytes:
    document = honest()
    edit(document, document["joints"][0], document["joints"][1])
    return json.dumps(document).encode()


def _text(old: str, new: str) -> bytes:
    text = json.dumps(honest())
    assert old in text
    return text.replace(old, new, 1).encode()


def _curve(joint: dict[str, Any], velocity: list[float], torque: list[float]) -> None:
    joint["parameters"] = {
        "velocity": number(velocity, "rad/s"),
        "positive": number(torque, "N.m"),
        "negative": number(torque, "N.m"),
    }


def _many_joints(document: dict[str, Any]) -> None:
    document["joints"] = [{**document["joints"][1], "name": f"j{i}"} for i in range(2000)]


def _deep(levels: int) -> Any:
    inner: Any = 0
    for _ in range(levels):
        inner = {"a": inner}
    return inner


def _matrix(matrix: Any, names: list[str] | None = None) -> bytes:
    """Return a file whose second joint has this covariance."""
    changes = {"matrix": matrix} if names is None else {"matrix": matrix, "names": names}
    return _edited(lambda d, a, b: b["covariance"].update(changes))


LIMIT = f"{PLACE}.validity"
SPREAD = "$.joints[1].covariance"
CURVE = f"{PLACE}.parameters"
ELEMENT = "$.joints[1].element_parameters"

#: kind -> (bytes of the file, what the refusal has to hold)
HOSTILE: dict[str, tuple[bytes, str]] = {
    "validity from 5 to -5": (_edited(lambda d, a, b: a["validity"].update(velocity=[5, -5])), PLACE),
    "load turned around": (_edited(lambda d, a, b: a["validity"].update(load=[5, -5])), PLACE),
    "temperature turned around": (_edited(lambda d, a, b: a["validity"].update(temperature=[40, 20])), PLACE),
    "colder than anything": (_edited(lambda d, a, b: a["validity"].update(temperature=[-300, 20])), LIMIT),
    "validity to 1e308": (_edited(lambda d, a, b: a["validity"].update(velocity=[-1e308, 1e308])), LIMIT),
    "validity faster than anything": (
        _edited(lambda d, a, b: a["validity"].update(velocity=[0, 1e9])),
        LIMIT,
    ),
    "validity of three ends": (_edited(lambda d, a, b: a["validity"].update(velocity=[-1, 0, 1])), LIMIT),
    "no validity": (_edited(lambda d, a, b: a.pop("validity")), PLACE),
    "knots 1e-9 apart": (_edited(lambda d, a, b: _curve(a, [1.0, 1.0 + 1e-9], [5.0, 5.3])), CURVE),
    "last knots 1e-9 apart": (_edited(lambda d, a, b: _curve(a, [0.1, 1.0, 1.0 + 1e-9], [5, 5, 6])), CURVE),
    "knots that fall": (_edited(lambda d, a, b: _curve(a, [2.0, 1.0], [5.0, 6.0])), CURVE),
    "a knot twice": (_edited(lambda d, a, b: _curve(a, [1.0, 1.0], [5.0, 6.0])), CURVE),
    "a negative knot": (_edited(lambda d, a, b: _curve(a, [-1.0, 1.0], [5.0, 6.0])), CURVE),
    "300,000 knots": (
        _edited(lambda d, a, b: _curve(a, [0.001 * (i + 1) for i in range(300_000)], [5.0] * 300_000)),
        CURVE,
    ),
    "more torques than knots": (_edited(lambda d, a, b: _curve(a, [1.0, 2.0], [5.0, 6.0, 7.0])), CURVE),
    "no knots": (_edited(lambda d, a, b: _curve(a, [], [])), CURVE),
    "torque of 1e308": (_edited(lambda d, a, b: _curve(a, [1.0, 2.0], [1e308, -1e308])), CURVE),
    "torque of a landslide": (_edited(lambda d, a, b: _curve(a, [1.0, 2.0], [1e9, 1e9])), PLACE),
    "steep to the end of the range": (_edited(lambda d, a, b: _curve(a, [1.0, 1.001], [5.0, 5e6])), PLACE),
    "not a number": (_text('"gear_ratio": 100.0', '"gear_ratio": NaN'), "damaged"),
    "infinity": (_text('"gear_ratio": 100.0', '"gear_ratio": -Infinity'), "damaged"),
    "1e999": (_text('"gear_ratio": 100.0', '"gear_ratio": 1e999'), PLACE),
    "gear ratio of zero": (_edited(lambda d, a, b: a.update(gear_ratio=0)), PLACE),
    "gear ratio of 1e308": (_edited(lambda d, a, b: a.update(gear_ratio=1e308)), f"{PLACE}.gear_ratio"),
    "negative encoder": (_edited(lambda d, a, b: a.update(encoder_counts=-5)), PLACE),
    "encoder of 1e305": (_edited(lambda d, a, b: a.update(encoder_counts=1e305)), f"{PLACE}.encoder_counts"),
    "inertia of 1e308": (
        _edited(lambda d, a, b: a["dynamics"]["inertia"].update(value=1e308)),
        f"{PLACE}.dynamics.inertia.value",
    ),
    "inertia as a list": (
        _edited(lambda d, a, b: a["dynamics"]["inertia"].update(value=[1.0])),
        f"{PLACE}.dynamics.inertia",
    ),
    "covariance that is not symmetric": (_matrix([[0.01, 20.0], [-20.0, 1e6]]), SPREAD),
    "covariance of correlation 2": (_matrix([[0.01, 200.0], [200.0, 1e6]]), SPREAD),
    "covariance of one row": (_matrix([[0.01]]), SPREAD),
    "covariance of unequal rows": (_matrix([[0.01, 0.0], [0.0]]), SPREAD),
    "covariance of nothing": (_matrix([], []), SPREAD),
    "covariance with a hole": (_matrix([[0.01, None], [None, 1e6]]), f"{SPREAD}.matrix[0][1]"),
    "covariance with a word": (_matrix([[0.01, "0"], ["0", 1e6]]), f"{SPREAD}.matrix[0][1]"),
    "negative variance": (_matrix([[0.01, 0.0], [0.0, -1e6]]), SPREAD),
    "variance of 1e300": (_matrix([[0.01, 0.0], [0.0, 1e300]]), f"{SPREAD}.matrix[1][1]"),
    "variance against the standard error": (_matrix([[0.04, 0.0], [0.0, 1e6]]), "$.joints[1]: "),
    "covariance of what is not there": (_matrix([[1.0]], ["warp"]), f"{SPREAD}.names[0]"),
    "covariance of a row twice": (_matrix([[0.01, 0.01], [0.01, 0.01]], ["coulomb"] * 2), SPREAD),
    "covariance of 2,000 rows": (_matrix([[0.0] * 2000] * 2000, [f"x[{i}]" for i in range(2000)]), SPREAD),
    "covariance of names alone": (_matrix([], [f"x{i}" for i in range(100_000)]), SPREAD),
    "torque limit of zero": (
        _edited(lambda d, a, b: b["actuator"].update(torque_limit=0.0)),
        "$.joints[1].actuator",
    ),
    "delay of 1e300": (_edited(lambda d, a, b: b["torque_channel"].update(delay=1e300)), "$.joints[1]"),
    "lowest speed below zero": (
        _edited(lambda d, a, b: b["validity"].update(lowest_speed=-1)),
        "$.joints[1]",
    ),
    "band of -1 samples": (
        _edited(lambda d, a, b: b["bands"]["moving"].update(samples=-1)),
        "$.joints[1].bands",
    ),
    "coupling of one row": (_edited(lambda d, a, b: d.update(coupling=[[1.0, 0.0]])), "coupling"),
    "coupling without inverse": (
        _edited(lambda d, a, b: d.update(coupling=[[1.0, 1.0], [1.0, 1.0]])),
        "coupling",
    ),
    "coupling of 1e300": (
        _edited(lambda d, a, b: d.update(coupling=[[1e300, 0.0], [0.0, 1.0]])),
        "$.coupling[0][0]",
    ),
    "ten thousand dynamics": (
        _edited(lambda d, a, b: a.update(dynamics={f"x{i}": number(1.0, "1") for i in range(10_000)})),
        f"{PLACE}.dynamics",
    ),
    "a joint twice": (_edited(lambda d, a, b: b.update(name="elbow")), "$.joints"),
    "a joint without name": (_edited(lambda d, a, b: a.update(name="")), f"{PLACE}.name"),
    "a name of a megabyte": (_edited(lambda d, a, b: a.update(name="x" * 1_000_000)), f"{PLACE}.name"),
    "a remark of a megabyte": (_edited(lambda d, a, b: a.update(warnings=["x" * 1_000_000])), PLACE),
    "no joint": (_edited(lambda d, a, b: d.update(joints=[])), "$.joints"),
    "2,000 joints": (_edited(lambda d, a, b: _many_joints(d)), "$.joints"),
    "a joint that is a word": (_edited(lambda d, a, b: d.update(joints=["elbow"])), PLACE),
    "joints by name": (_edited(lambda d, a, b: d.update(joints={"elbow": a})), "$.joints"),
    "negative stiffness": (
        _edited(lambda d, a, b: b["element_parameters"]["stiffness"].update(value=-1)),
        ELEMENT,
    ),
    "stiffness of 1e300": (
        _edited(lambda d, a, b: b["element_parameters"]["stiffness"].update(value=1e300)),
        f"{ELEMENT}.stiffness.value",
    ),
    "stiffness as a word": (
        _edited(lambda d, a, b: b["element_parameters"]["stiffness"].update(value="high")),
        f"{ELEMENT}",
    ),
    "stiffness as a list": (
        _edited(lambda d, a, b: b["element_parameters"]["stiffness"].update(value=[1.0])),
        ELEMENT,
    ),
    "stiffness forgotten": (_edited(lambda d, a, b: b["element_parameters"].pop("stiffness")), ELEMENT),
    "negative Coulomb torque": (
        _edited(lambda d, a, b: b["parameters"]["coulomb"].update(value=-3)),
        "$.joints[1].parameters",
    ),
    "torque in ft.lb": (
        _edited(lambda d, a, b: b["parameters"]["coulomb"].update(unit="ft.lb")),
        "$.joints[1].parameters.coulomb",
    ),
    "a parameter too many": (
        _edited(lambda d, a, b: b["parameters"].update(warp=number(1, "1"))),
        "$.joints[1].parameters",
    ),
    "negative standard error": (
        _edited(lambda d, a, b: b["parameters"]["coulomb"].update(standard_error=-0.1)),
        "$.joints[1].parameters.coulomb",
    ),
    "standard errors of other knots": (
        _edited(lambda d, a, b: a["parameters"]["positive"].update(standard_error=[0.1])),
        f"{CURVE}.positive",
    ),
    "unknown law": (_edited(lambda d, a, b: b["law"].update(rate="magic")), "$.joints[1].law"),
    "unknown element": (_edited(lambda d, a, b: b["law"].update(element="magic")), "$.joints[1].law"),
    "unknown unit": (_edited(lambda d, a, b: a.update(unit="deg")), f"{PLACE}.unit"),
    "negative number of samples": (
        _edited(lambda d, a, b: a["fitted"].update(samples=-1)),
        f"{PLACE}.fitted",
    ),
    "negative residual": (
        _edited(lambda d, a, b: a["fitted"].update(residual_percent=-2.0)),
        f"{PLACE}.fitted",
    ),
    "rigid bodies of 1e308": (
        _edited(lambda d, a, b: d.update(arm={"urdf_sha256": "ab", "parameters": [1e308], "condition": 1.0})),
        "$.arm.parameters[0]",
    ),
    "a million rigid bodies": (
        _edited(
            lambda d, a, b: d.update(
                arm={"urdf_sha256": "ab", "parameters": [0.0] * 1_000_000, "condition": 1}
            )
        ),
        "$.arm.parameters",
    ),
    "options 500 levels deep": (
        _edited(lambda d, a, b: d["provenance"].update(options=_deep(500))),
        "$.provenance",
    ),
    "options 100,000 levels deep": (
        _text('"options": {}', '"options": {"a": ' + "[" * 100_000 + "]" * 100_000 + "}"),
        "damaged",
    ),
    "nothing but brackets": (b"[" * 1_000_000, "model file"),
    "one key twice": (
        _text('"gear_ratio": 100.0', '"gear_ratio": 100.0, "gear_ratio": -1.0'),
        "'gear_ratio'",
    ),
    "an unknown key": (_edited(lambda d, a, b: a.update(backdoor=1)), PLACE),
    "schema true": (_edited(lambda d, a, b: d.update(schema=True)), "$.schema"),
    "schema of tomorrow": (_edited(lambda d, a, b: d.update(schema=10**30)), "$.schema"),
    "schema as a list": (_edited(lambda d, a, b: d.update(schema=[1])), "$.schema"),
    "another format": (_edited(lambda d, a, b: d.update(format="other")), "not a friction model"),
    "a list": (b"[]", "model file"),
    "empty": (b"", "model file"),
    "cut short": (json.dumps(honest()).encode()[:-40], "damaged"),
    "UTF-16": (json.dumps(honest()).encode("utf-16"), "JSON in UTF-8"),
    "bytes that are no text": (_text("elbow", "elb\x00w").replace(b"elb", b"\xff\xfe"), "damaged"),
    "half a character": (_text('"elbow"', '"\\ud800"'), "damaged"),
}
