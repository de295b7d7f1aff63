"""The model file: JSON with a schema version, every number with unit, error and bounds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal, TypeVar

import msgspec

from backdrive import model as m
from backdrive._files import write_whole
from backdrive.errors import BackdriveError, ModelFileError
from backdrive.laws import Law, element, rate_law
from backdrive.laws.base import Rows
from backdrive.log import Joint, Source

SCHEMA = 1
MAX_BYTES = 50_000_000

R = TypeVar("R", bound=Rows)
Number = float | None  # null stands for "unknown" and for an infinite bound


class _Value(msgspec.Struct, forbid_unknown_fields=True):
    value: float | list[float]
    unit: str
    standard_error: Number | list[Number] = None
    lower: Number = None
    upper: Number = None
    at_bound: bool = False


class _Law(msgspec.Struct, forbid_unknown_fields=True):
    rate: str
    element: str


class _Quality(msgspec.Struct, forbid_unknown_fields=True):
    residual_percent: Number
    residual_raw_percent: Number
    rms: Number
    samples: int


class _Validity(msgspec.Struct, forbid_unknown_fields=True):
    velocity: tuple[float, float]
    load: tuple[float, float] | None = None
    temperature: tuple[float, float] | None = None


class _Joint(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    unit: Literal["rad", "m"]
    torque_side: Literal["joint", "motor"]
    gear_ratio: float
    law: _Law
    parameters: dict[str, _Value]
    validity: _Validity
    encoder_counts: Number = None
    element_parameters: dict[str, _Value] = {}
    dynamics: dict[str, _Value] = {}
    fitted: _Quality | None = None
    held_out: _Quality | None = None
    method: str = ""
    warnings: list[str] = []


class _Arm(msgspec.Struct, forbid_unknown_fields=True):
    urdf_sha256: str
    parameters: list[float]
    condition: Number


class _Source(msgspec.Struct, forbid_unknown_fields=True):
    path: str
    sha256: str


class _Provenance(msgspec.Struct, forbid_unknown_fields=True):
    backdrive: str
    sources: list[_Source] = []
    options: dict[str, Any] = {}


class _File(msgspec.Struct, forbid_unknown_fields=True):
    format: Literal["backdrive-friction-model"]
    schema: int
    joints: list[_Joint]
    provenance: _Provenance
    arm: _Arm | None = None


def _null(x: float | None) -> Number:
    return None if x is None or not math.isfinite(x) else float(x)


def _nan(x: Number) -> float:
    return math.nan if x is None else x


def _values(rows: Rows, unit: str, errors: dict, at_bound: tuple[str, ...]) -> dict[str, _Value]:
    result = {}
    for name, parameter in rows.PARAMETERS.items():
        value, error = getattr(rows, name), errors.get(name)
        result[name] = _Value(
            value=list(value) if parameter.many else value,
            unit=parameter.unit_for(unit),
            standard_error=[_null(e) for e in error] if isinstance(error, (list, tuple)) else _null(error),
            lower=_null(parameter.lower),
            upper=_null(parameter.upper),
            at_bound=name in at_bound,
        )
    return result


def _quality(q: m.Quality | None) -> _Quality | None:
    if q is None:
        return None
    return _Quality(_null(q.residual), _null(q.residual_raw), _null(q.rms), q.samples)


def encode(model: m.FrictionModel) -> bytes:
    """Return the model file's bytes."""
    joints = [
        _Joint(
            name=j.joint.name,
            unit=j.joint.unit,
            torque_side=j.joint.torque_side,
            gear_ratio=j.joint.gear_ratio,
            encoder_counts=_null(j.joint.encoder_counts),
            law=_Law(j.law.rate.NAME, j.law.element.NAME),
            parameters=_values(j.law.rate, j.joint.unit, dict(j.standard_errors), j.at_bound),
            element_parameters=_values(j.law.element, j.joint.unit, dict(j.standard_errors), j.at_bound),
            validity=_Validity(j.validity.velocity, j.validity.load, j.validity.temperature),
            dynamics={
                k: _Value(e.value, e.unit, _null(e.standard_error)) for k, e in sorted(j.dynamics.items())
            },
            fitted=_quality(j.fitted),
            held_out=_quality(j.held_out),
            method=j.method,
            warnings=list(j.warnings),
        )
        for j in model.joints
    ]
    arm = model.arm and _Arm(model.arm.urdf_sha256, list(model.arm.parameters), _null(model.arm.condition))
    provenance = _Provenance(
        model.version, [_Source(s.path, s.sha256) for s in model.sources], dict(model.options)
    )
    document = _File("backdrive-friction-model", SCHEMA, joints, provenance, arm)
    data = msgspec.json.encode(_encodable(msgspec.to_builtins(document)))
    return msgspec.json.format(data, indent=2) + b"\n"


def _encodable(value: Any) -> Any:
    """Replace what UTF-8 cannot hold: a file name need not be text."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode("utf-8")
    if isinstance(value, dict):
        return {_encodable(k): _encodable(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_encodable(v) for v in value]
    return value


def save(model: m.FrictionModel, path: str | Path) -> None:
    """Write the model file, whole or not at all."""
    write_whole(path, encode(model))


def _rows(cls: type[R], values: dict[str, _Value], where: str, unit: str) -> R:
    missing, strange = set(cls.PARAMETERS) - set(values), set(values) - set(cls.PARAMETERS)
    if missing or strange:
        raise ModelFileError(
            f"{where}: parameters {sorted(strange)} are unknown and {sorted(missing)} are missing.",
            remedy=f"The law '{cls.NAME}' has {', '.join(cls.PARAMETERS) or 'none'}.",
        )
    for name, value in values.items():
        expected = cls.PARAMETERS[name].unit_for(unit)
        if value.unit != expected:
            raise ModelFileError(
                f"{where}.{name}: the unit is '{value.unit}'.", remedy=f"It must be '{expected}'."
            )
    return cls(**{k: tuple(v.value) if isinstance(v.value, list) else v.value for k, v in values.items()})


def _errors(values: dict[str, _Value]) -> dict[str, Any]:
    return {
        k: tuple(_nan(e) for e in v.standard_error)
        if isinstance(v.standard_error, list)
        else _nan(v.standard_error)
        for k, v in values.items()
        if v.standard_error is not None
    }


def _joint(j: _Joint, where: str) -> m.JointFriction:
    rate = _rows(rate_law(j.law.rate), j.parameters, f"{where}.parameters", j.unit)
    carrier = _rows(element(j.law.element), j.element_parameters, f"{where}.element_parameters", j.unit)
    joint = Joint(
        name=j.name,
        unit=j.unit,
        torque_side=j.torque_side,
        gear_ratio=j.gear_ratio,
        encoder_counts=j.encoder_counts,
    )
    dynamics = {}
    for name, v in j.dynamics.items():
        if isinstance(v.value, list) or isinstance(v.standard_error, list):
            raise ModelFileError(f"{where}.dynamics.{name}: is a list.", remedy="It must be one number.")
        dynamics[name] = m.Estimate(value=v.value, unit=v.unit, standard_error=_nan(v.standard_error))
    qualities = [
        q
        and m.Quality(
            residual=_nan(q.residual_percent),
            residual_raw=_nan(q.residual_raw_percent),
            rms=_nan(q.rms),
            samples=q.samples,
        )
        for q in (j.fitted, j.held_out)
    ]
    return m.JointFriction(
        joint=joint,
        law=Law(rate=rate, element=carrier),
        standard_errors=_errors(j.parameters) | _errors(j.element_parameters),
        at_bound=tuple(k for k, v in (j.parameters | j.element_parameters).items() if v.at_bound),
        dynamics=dynamics,
        validity=m.Validity(
            velocity=j.validity.velocity, load=j.validity.load, temperature=j.validity.temperature
        ),
        fitted=qualities[0],
        held_out=qualities[1],
        method=j.method,
        warnings=tuple(j.warnings),
    )


def decode(data: bytes, name: str = "model file") -> m.FrictionModel:
    """Return the model that the bytes of a model file describe.

    Raises:
        ModelFileError: says at which place what is wrong.
    """
    try:
        head = msgspec.json.decode(data)
        if not isinstance(head, dict) or head.get("format") != "backdrive-friction-model":
            raise ModelFileError(
                f"{name} is JSON, but not a friction model.",
                remedy="Name a file made by `identify -o` or `fit -o`.",
            )
        if head.get("schema") != SCHEMA:
            raise ModelFileError(
                f"{name}: $.schema is {head.get('schema')!r}, this version reads {SCHEMA}.",
                remedy="Upgrade backdrive, or identify again.",
            )
        document = msgspec.convert(head, _File)
        joints = tuple(_joint(j, f"$.joints[{i}]") for i, j in enumerate(document.joints))
        arm = document.arm and m.ArmModel(
            urdf_sha256=document.arm.urdf_sha256,
            parameters=tuple(document.arm.parameters),
            condition=_nan(document.arm.condition),
        )
        return m.FrictionModel(
            joints=joints,
            arm=arm,
            sources=tuple(Source(path=s.path, sha256=s.sha256) for s in document.provenance.sources),
            options=document.provenance.options,
            version=document.provenance.backdrive,
        )
    except ModelFileError:
        raise
    except BackdriveError as error:
        raise ModelFileError(f"{name}: {error.message}", remedy=error.remedy) from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, OverflowError) as error:
        raise ModelFileError(
            f"{name} is damaged: {error}.", remedy="Restore it, or identify again."
        ) from error


def load(path: str | Path) -> m.FrictionModel:
    """Read a model file; see `decode`."""
    path = Path(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ModelFileError(
                f"{path} is larger than {MAX_BYTES} bytes.", remedy="A model file is a few kilobytes."
            )
        data = path.read_bytes()
    except OSError as error:
        raise ModelFileError(f"Cannot read {path}: {error.strerror}.", remedy="Check the path.") from error
    return decode(data, str(path))
