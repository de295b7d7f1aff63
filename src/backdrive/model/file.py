"""The model file: JSON with a schema version, every number with unit, error and bounds."""

from __future__ import annotations

import math
from dataclasses import is_dataclass, replace
from pathlib import Path, PurePath
from typing import Any, TypeVar

import msgspec
import numpy as np

from backdrive import model as m
from backdrive._documents import is_object, is_several, plain
from backdrive._files import read_whole, write_whole
from backdrive.errors import BackdriveError, ModelFileError
from backdrive.laws import Growth, Law, element, rate_law
from backdrive.laws.base import Rows
from backdrive.logs.log import Joint, Source
from backdrive.model.bounds import (
    check_document,
    check_errors,
    check_keys,
    check_law,
    check_rows,
    error_place,
)
from backdrive.model.document import (
    ALIKE,
    FORMAT,
    OLDER,
    SCHEMA,
    ArmEntry,
    Document,
    Header,
    JointEntry,
    LawEntry,
    Number,
    Provenance,
    QualityEntry,
    SourceEntry,
    Value,
)
from backdrive.model.former import beside_the_law, growth_of

MAX_BYTES = 10_000_000
AGAIN = "Restore it, or identify again."

R = TypeVar("R", bound=Rows)


def _null(x: float | None) -> Number:
    return None if x is None or not math.isfinite(x) else float(x)


def _nan(x: Number) -> float:
    return math.nan if x is None else x


def _values(rows: Rows, unit: str, errors: dict[str, Any], at_bound: tuple[str, ...]) -> dict[str, Value]:
    result: dict[str, Value] = {}
    for name, parameter in rows.PARAMETERS.items():
        value, error = getattr(rows, name), errors.get(name)
        result[name] = Value(
            value=list(value) if parameter.many else value,
            unit=parameter.unit_for(unit),
            standard_error=[_null(e) for e in error] if is_several(error) else _null(error),
            lower=_null(parameter.lower),
            upper=_null(parameter.upper),
            at_bound=name in at_bound,
        )
    return result


def _quality_entry(q: m.Quality | None) -> QualityEntry | None:
    if q is None:
        return None
    return QualityEntry(_null(q.residual), _null(q.residual_raw), _null(q.rms), q.samples)


def encode(model: m.FrictionModel) -> bytes:
    """Return the model file's bytes."""
    joints = [
        JointEntry(
            name=j.joint.name,
            unit=j.joint.unit,
            torque_side=j.joint.torque_side,
            gear_ratio=j.joint.gear_ratio,
            encoder_counts=_null(j.joint.encoder_counts),
            named=j.joint.named,
            law=LawEntry(j.law.rate.NAME, j.law.element.NAME),
            parameters=_values(j.law.rate, j.joint.unit, dict(j.standard_errors), j.at_bound),
            element_parameters=_values(j.law.element, j.joint.unit, dict(j.standard_errors), j.at_bound),
            growth=_values(j.law.growth, j.joint.unit, dict(j.standard_errors), j.at_bound)
            if j.law.growth
            else msgspec.UNSET,
            dynamics={
                k: Value(e.value, e.unit, _null(e.standard_error)) for k, e in sorted(j.dynamics.items())
            },
            fitted=_quality_entry(j.fitted),
            held_out=_quality_entry(j.held_out),
            warnings=list(j.warnings),
            prior=j.prior or msgspec.UNSET,
            **{name: getattr(j, name) for name in ALIKE},
        )
        for j in model.joints
    ]
    arm = model.arm and ArmEntry(
        model.arm.urdf_sha256,
        list(model.arm.parameters),
        _null(model.arm.condition),
        model.arm.covariance or msgspec.UNSET,
    )
    provenance = Provenance(
        model.version, [SourceEntry(s.path, s.sha256) for s in model.sources], dict(model.options)
    )
    document = Document(
        FORMAT, SCHEMA, joints, provenance, arm, model.coupling, model.coupled or msgspec.UNSET
    )
    data = msgspec.json.encode(_encodable(msgspec.to_builtins(document, enc_hook=_as_builtin)))
    return msgspec.json.format(data, indent=2) + b"\n"


def _encodable(value: Any) -> Any:
    """Replace characters that UTF-8 cannot encode, since file names may contain any bytes."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode("utf-8")
    if is_object(value):
        return {_encodable(k): _encodable(v) for k, v in value.items()}
    if is_several(value):
        return [_encodable(v) for v in value]
    return value


def _as_builtin(value: Any) -> Any:
    """Return a path as text, and numpy's numbers and arrays as Python's."""
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value)
    raise TypeError(f"A model file cannot hold a {type(value).__name__}.")


def save(model: m.FrictionModel, path: str | Path) -> None:
    """Write the model file, whole or not at all.

    Raises:
        ModelFileError: a number is beyond any machine, so that the file would be refused when it is read.
    """
    data = encode(model)
    try:
        decode(data)
    except ModelFileError as error:
        raise ModelFileError(f"The model is not written: {error.message}", remedy=error.remedy) from error
    write_whole(path, data)


def _rows(cls: type[R], values: dict[str, Value], where: str, unit: str) -> R:
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
        check_errors(value.value, value.standard_error, f"{where}.{name}")
    with error_place(where):
        return cls(**{k: tuple(v.value) if isinstance(v.value, list) else v.value for k, v in values.items()})


def _errors(values: dict[str, Value]) -> dict[str, Any]:
    return {
        k: tuple(_nan(e) for e in v.standard_error)
        if isinstance(v.standard_error, list)
        else _nan(v.standard_error)
        for k, v in values.items()
        if v.standard_error is not None
    }


def _dynamics(values: dict[str, Value], where: str) -> dict[str, m.Estimate]:
    found: dict[str, m.Estimate] = {}
    for name, v in values.items():
        if isinstance(v.value, list) or isinstance(v.standard_error, list):
            raise ModelFileError(f"{where}.{name}: is a list.", remedy="It must be one number.")
        check_errors(v.value, v.standard_error, f"{where}.{name}")
        found[name] = m.Estimate(value=v.value, unit=v.unit, standard_error=_nan(v.standard_error))
    return found


def _quality(q: QualityEntry | None) -> m.Quality | None:
    if q is None:
        return None
    return m.Quality(
        residual=_nan(q.residual_percent),
        residual_raw=_nan(q.residual_raw_percent),
        rms=_nan(q.rms),
        samples=q.samples,
    )


def _joint(j: JointEntry, where: str) -> m.JointFriction:
    with error_place(f"{where}.law"):
        kinds = rate_law(j.law.rate), element(j.law.element)
    rate = _rows(kinds[0], j.parameters, f"{where}.parameters", j.unit)
    carrier = _rows(kinds[1], j.element_parameters, f"{where}.element_parameters", j.unit)
    dynamics = _dynamics(j.dynamics, f"{where}.dynamics")
    numbers, growth = j.parameters | j.element_parameters, None
    if j.growth is not msgspec.UNSET:
        growth = _rows(Growth, j.growth, f"{where}.growth", j.unit)
        numbers = numbers | j.growth
    with error_place(where):
        errors = _errors(numbers)
        if growth is None and beside_the_law(rate, dynamics):
            growth, dynamics, more = growth_of(dynamics)
            errors = errors | more
        friction = m.JointFriction(
            joint=Joint(
                name=j.name,
                unit=j.unit,
                torque_side=j.torque_side,
                gear_ratio=j.gear_ratio,
                encoder_counts=j.encoder_counts,
                named=j.named,
            ),
            law=Law(rate=rate, element=carrier, growth=growth),
            standard_errors=errors,
            at_bound=tuple(k for k, v in numbers.items() if v.at_bound),
            dynamics=dynamics,
            fitted=_quality(j.fitted),
            held_out=_quality(j.held_out),
            warnings=tuple(j.warnings),
            prior=j.prior or None,
            **{name: getattr(j, name) for name in ALIKE},
        )
    check_law(friction, where)
    check_rows(j.covariance, friction, where)
    return friction


def _fill(entry: JointEntry) -> None:
    """Fill the dataclasses of an entry with the fields that the file leaves out, since msgspec does not."""
    for name in ALIKE:
        value = getattr(entry, name)
        if is_dataclass(value) and not isinstance(value, type):
            setattr(entry, name, replace(value))


def decode(data: bytes, name: str = "model file") -> m.FrictionModel:
    """Return the model that the bytes of a model file describe.

    Raises:
        ModelFileError: the message names the fault and its place.
    """
    try:
        if data[:100].strip()[:1] not in (b"{", b""):
            raise ModelFileError(
                "it is no friction model, which is JSON in UTF-8.",
                remedy="Name a file made by `identify -o` or `fit -o`; a log is looked at with `backdrive inspect`.",
            )
        head = msgspec.json.decode(data, type=Header)
        if head.format != FORMAT:
            raise ModelFileError(
                "it is JSON, but not a friction model.",
                remedy="Name a file made by `identify -o` or `fit -o`.",
            )
        if isinstance(head.schema, bool) or head.schema not in (OLDER, SCHEMA):
            raise ModelFileError(
                f"$.schema is {str(head.schema)[:40]}, this version reads {OLDER} and {SCHEMA}.",
                remedy="Upgrade backdrive, or identify again.",
            )
        document = msgspec.json.decode(data, type=Document)
        for entry in document.joints:
            _fill(entry)
        plain = msgspec.to_builtins(document)
        check_document(plain)
        check_keys(data, plain)
        joints = tuple(_joint(j, f"$.joints[{i}]") for i, j in enumerate(document.joints))
        with error_place("$.arm"):
            arm = document.arm and m.ArmModel(
                urdf_sha256=document.arm.urdf_sha256,
                parameters=tuple(document.arm.parameters),
                condition=_nan(document.arm.condition),
                covariance=document.arm.covariance or None,
            )
        with error_place("$.joints"):
            return m.FrictionModel(
                joints=joints,
                arm=arm,
                sources=tuple(Source(path=s.path, sha256=s.sha256) for s in document.provenance.sources),
                options=document.provenance.options,
                version=document.provenance.backdrive,
                coupling=document.coupling,
                coupled=document.coupled or (),
            )
    except BackdriveError as error:
        raise ModelFileError(f"{name}: {error.message}", remedy=error.remedy) from error
    except msgspec.ValidationError as error:
        message, _, place = str(error).rpartition(" - at ")
        said = f"{place.replace('`', '')}: {message}" if message else str(error)
        newer = " A newer backdrive may have written it: upgrade." if "unknown field" in message else ""
        raise ModelFileError(f"{name}: {said.rstrip('.')}.", remedy=AGAIN + newer) from error
    except (
        msgspec.MsgspecError,
        ValueError,
        RecursionError,
        OverflowError,
    ) as error:  # UnicodeDecodeError included
        raise ModelFileError(f"{name} is damaged: {error}.", remedy=AGAIN) from error


def load(path: str | Path) -> m.FrictionModel:
    """Read a model file; see `decode`."""
    data = read_whole(path, MAX_BYTES, error=ModelFileError, remedy="A model file is a few kilobytes.")
    return decode(data, str(path))
