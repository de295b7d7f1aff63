"""The result of `validate`: a dict of qualities by joint, which can be displayed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from backdrive._documents import plain
from backdrive._upper import Display
from backdrive.model import Quality


class Validation(dict[str, Quality], Display):
    """How well a model predicts logs: joint name -> `Quality`.

    Attributes:
        units: unit of the root mean square, by joint: of torque, or of position where motion is predicted.
        remarks: what a reader should know, in sentences: joints left out, or moved outside the model's validity range.
        quantity: that is predicted, `torque` or `motion`.
    """

    def __init__(
        self,
        qualities: Mapping[str, Quality],
        *,
        units: Mapping[str, str],
        remarks: Sequence[str] = (),
        quantity: str = "torque",
    ):
        super().__init__(qualities)
        self.units = dict(units)
        self.remarks = tuple(remarks)
        self.quantity = quantity

    def to_dict(self) -> dict[str, Any]:
        """Return plain values: residuals, root mean square and unit by joint, what is predicted, and the remarks."""
        return {
            "quantity": self.quantity,
            "joints": {
                name: plain(asdict(quality)) | {"unit": self.units[name]} for name, quality in self.items()
            },
            "remarks": list(self.remarks),
        }
