"""The structure of a model file, field by field; `model.schema.json` is generated from it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from backdrive._documents import json_schema
from backdrive.model.covariance import Covariance
from backdrive.model.hardware import Actuator, TorqueChannel
from backdrive.model.joint_friction import Validity
from backdrive.model.prior_comparison import PriorComparison
from backdrive.model.quality import Bands, Verdict

FORMAT, SCHEMA = "backdrive-friction-model", 2
OLDER = 1  # older versions whose fields all exist in the present one

Number = float | None  # null stands for "unknown" and for an infinite bound
Word = Annotated[str, Meta(max_length=500)]
Sentence = Annotated[str, Meta(max_length=5000)]
Knots = Annotated[list[float], Meta(max_length=1000)]
Errors = Annotated[list[Number], Meta(max_length=1000)]
Count = Annotated[int, Meta(ge=0)]


class Value(msgspec.Struct, forbid_unknown_fields=True):
    """A number, or one for each knot, with unit, standard error and bounds; null means unknown or unbounded."""

    value: float | Knots
    unit: Word
    standard_error: Number | Errors = None
    lower: Number = None
    upper: Number = None
    at_bound: bool = False


class LawEntry(msgspec.Struct, forbid_unknown_fields=True):
    """Names of the rate law and of the presliding element that carries it."""

    rate: Word
    element: Word


class QualityEntry(msgspec.Struct, forbid_unknown_fields=True):
    """How well measured torque is explained: residuals below 5 Hz and raw [%], root mean square [N.m or N]."""

    residual_percent: Number
    residual_raw_percent: Number
    rms: Number
    samples: Count


Values = Annotated[dict[Word, Value], Meta(max_length=100)]


class JointEntry(msgspec.Struct, forbid_unknown_fields=True):
    """The friction of one joint; null stands for an unknown value."""

    name: Annotated[str, Meta(min_length=1, max_length=500)]
    unit: Literal["rad", "m"]
    torque_side: Literal["joint", "motor"]
    gear_ratio: float
    law: LawEntry
    parameters: Values
    validity: Validity
    named: bool | None = None
    friction_side: Literal["joint", "motor"] | None = None
    encoder_counts: Number = None
    element_parameters: Values = {}
    growth: Values | msgspec.UnsetType = msgspec.UNSET  # with the load; absent where the law has none
    dynamics: Values = {}
    fitted: QualityEntry | None = None
    held_out: QualityEntry | None = None
    method: Word = ""
    warnings: Annotated[list[Sentence], Meta(max_length=1000)] = []
    covariance: Covariance | None = None
    torque_channel: TorqueChannel | None = None
    actuator: Actuator | None = None
    verdict: Verdict | None = None
    bands: Bands | None = None
    prior: PriorComparison | msgspec.UnsetType = msgspec.UNSET  # absent where there was none


#: Fields of a joint's entry that `JointFriction` has under the same names and types.
ALIKE = (
    "validity",
    "method",
    "friction_side",
    "covariance",
    "torque_channel",
    "actuator",
    "verdict",
    "bands",
)


Matrix = Annotated[tuple[Annotated[tuple[float, ...], Meta(max_length=500)], ...], Meta(max_length=500)]


class ArmEntry(msgspec.Struct, forbid_unknown_fields=True):
    """The rigid bodies of an arm, as in `ArmModel`."""

    urdf_sha256: Word
    parameters: Annotated[list[float], Meta(max_length=5000)]
    condition: Number
    covariance: Matrix | msgspec.UnsetType = msgspec.UNSET


class SourceEntry(msgspec.Struct, forbid_unknown_fields=True):
    """A file that the model came from."""

    path: Sentence
    sha256: Word


class Provenance(msgspec.Struct, forbid_unknown_fields=True):
    """The origin of the model: program, files and options."""

    backdrive: Word
    sources: Annotated[list[SourceEntry], Meta(max_length=100_000)] = []
    options: dict[str, Any] = {}


class Header(msgspec.Struct):
    """The header that identifies a file."""

    format: Any = None
    schema: Any = None


class Document(msgspec.Struct, forbid_unknown_fields=True):
    """Friction of a robot's joints. `coupling` is C of q_joint = C q_motor, rows in the order of the joints, or of `coupled`."""

    format: Literal["backdrive-friction-model"]
    schema: Literal[1, 2]
    joints: Annotated[list[JointEntry], Meta(max_length=500)]
    provenance: Provenance
    arm: ArmEntry | None = None
    coupling: Matrix | None = None
    coupled: Annotated[tuple[Word, ...], Meta(max_length=500)] | msgspec.UnsetType = msgspec.UNSET


def schema() -> str:
    """Return the JSON schema of a model file, as `model.schema.json` holds it."""
    return json_schema(Document, f"Friction model of backdrive, schema {SCHEMA}")
