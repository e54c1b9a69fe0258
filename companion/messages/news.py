"""What the planner gives the guardian's side to pass on to the pilot, the ground station and the autopilot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from companion.messages.decision import Mode
from companion.messages.pilot import LandingTarget, PilotText

TEXTS_MAX = 6  # texts in one piece of news
VALUES_MAX = 8  # numbers in it


class End(Enum):
    """How a mission has ended."""

    AS_ASKED = "as the mission asked"
    OTHERWISE = "without success"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MissionNews:
    """How the mission stands after one step, and what there is to tell of it."""

    mode: Mode = Mode.PREFLIGHT
    end: End | None = None  # None: it has not ended
    said: int = 0  # texts since the start
    texts: tuple[PilotText, ...] = ()  # the newest of them, oldest first, at most TEXTS_MAX
    values: Mapping[str, float] = field(default_factory=dict)  # numbers for the pilot, at most VALUES_MAX
    landing_target: LandingTarget | None = None  # of a picture that was fused in this step
