"""Changing friction: comparison of two models, tracking of many, dependence on temperature, and bounds for adaptation."""

from __future__ import annotations

from backdrive.identification.drift.bounds import passive_level as passive_level
from backdrive.identification.drift.change import Change as Change
from backdrive.identification.drift.change import change_of as change_of
from backdrive.identification.drift.thermal import Thermal as Thermal
from backdrive.identification.drift.thermal import identify_thermal as identify_thermal
from backdrive.identification.drift.thermal import virtual_temperature as virtual_temperature
from backdrive.identification.drift.tracking import Track as Track
from backdrive.identification.drift.tracking import track as track
