"""JSON schemas of the channels, for the viewers that read them (Foxglove, mcap).

A schema is made from the first message of its channel; where that holds null, the dataclass behind the channel says
what may come later.
"""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Mapping
from enum import Enum
from functools import lru_cache
from typing import Any

from companion.messages.coarse import CoarseTarget
from companion.messages.decision import Decision
from companion.messages.docking import DockingDecision
from companion.messages.motion import Setpoint, SticksSetpoint
from companion.messages.ownship import OwnshipState, VehicleStatus
from companion.messages.perception import PadObservation
from companion.messages.pilot import LandingTarget
from companion.messages.proximity import (
    FeatureReading,
    GyroReading,
    NozzlePulses,
    PoseGoal,
    ProximityState,
    RangeReading,
)
from companion.messages.target import Intercept, TargetMeasurement, TargetTrack
from companion.messages.thrust import AttitudeThrust

MESSAGE_OF_CHANNEL: Mapping[str, type] = {
    "ownship": OwnshipState,
    "status": VehicleStatus,
    "observation": PadObservation,
    "measurement": TargetMeasurement,
    "track": TargetTrack,
    "intercept": Intercept,
    "decision": Decision,
    "setpoint": Setpoint,
    "sticks": SticksSetpoint,
    "thrust": AttitudeThrust,
    "landing_target": LandingTarget,
    "range": RangeReading,
    "coarse": CoarseTarget,
    "gyro": GyroReading,
    "features": FeatureReading,
    "proximity": ProximityState,
    "docking": DockingDecision,
    "pose_goal": PoseGoal,
    "pulses": NozzlePulses,
}
_SCALARS = {float: "number", int: "integer", str: "string", bool: "boolean"}


def channel_schema(channel: str, first: Mapping[str, object]) -> bytes:
    """Write the JSON schema of a channel.

    Args:
        channel: its name.
        first: its first message, plain values.
    """
    schema = {"title": channel, **_from_value(first, MESSAGE_OF_CHANNEL.get(channel))}
    return json.dumps(schema, separators=(",", ":")).encode()


def _from_value(value: object, hint: Any) -> dict[str, Any]:
    if value is None:
        return _from_type(hint)
    if isinstance(value, bool):
        return {"type": "boolean"}
    if isinstance(value, int):
        return {"type": "number" if _allows(hint, float) else "integer"}
    if isinstance(value, float):
        return {"type": "number"}
    if isinstance(value, str):
        return {"type": "string"}
    if isinstance(value, Mapping):
        hints = _hints(_dataclass_in(hint))
        return {
            "type": "object",
            "properties": {str(key): _from_value(item, hints.get(str(key))) for key, item in value.items()},
        }
    if isinstance(value, list | tuple):
        inner = _item_hint(hint)
        return {"type": "array", "items": _from_value(value[0], inner) if value else _from_type(inner)}
    return {}


def _from_type(hint: Any) -> dict[str, Any]:
    for member in _members(hint):
        if member in _SCALARS:
            return {"type": _SCALARS[member]}
        if isinstance(member, type) and issubclass(member, Enum):
            return {"type": "string" if isinstance(next(iter(member)).value, str) else "integer"}
        if isinstance(member, type) and dataclasses.is_dataclass(member):
            properties = {name: _from_type(inner) for name, inner in _hints(member).items()}
            return {"type": "object", "properties": properties}
        if typing.get_origin(member) is not None:
            return {"type": "array", "items": _from_type(_item_hint(member)) or {"type": "number"}}
    return {}


@lru_cache(maxsize=64)
def _hints(kind: Any) -> dict[str, Any]:
    return {} if kind is None else typing.get_type_hints(kind)


def _members(hint: Any) -> tuple[Any, ...]:
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return tuple(member for member in typing.get_args(hint) if member is not type(None))
    return () if hint is None else (hint,)


def _allows(hint: Any, kind: type) -> bool:
    return kind in _members(hint)


def _dataclass_in(hint: Any) -> Any:
    return next((member for member in _members(hint) if dataclasses.is_dataclass(member)), None)


def _item_hint(hint: Any) -> Any:
    for member in _members(hint):
        if typing.get_origin(member) in (tuple, list):
            arguments = typing.get_args(member)
            return arguments[0] if arguments else None
    return None
