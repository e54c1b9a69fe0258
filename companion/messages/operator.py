"""What the operator may ask for in flight, and what is answered."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class OperatorOrder(Enum):
    """A wish of the operator; the value is its number in MAVLink."""

    ENGAGE = 1  # begin the mission, or go on with it after a takeover
    HOLD = 2  # brake and give the vehicle to the autopilot's Hold; the mission waits
    ABORT = 3  # the same, and the mission is over
    LAND = 4  # brake and give the vehicle to the autopilot's Land; the mission waits


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What became of an order."""

    accepted: bool
    text: str  # plain: what happens now, or why nothing does
