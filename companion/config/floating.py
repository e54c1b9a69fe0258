"""How a free-flyer gets to its place; the control itself stands with the vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Annotated

from annotated_types import Interval


class Course(Enum):
    """How it gets near its place."""

    CONSTANT_BEARING = "constant_bearing"  # at top speed, to where the place will be
    MINIMUM_SNAP = "minimum_snap"  # by plans as those of a multicopter, in the plane: slower


@dataclass(frozen=True, slots=True, kw_only=True)
class FloatingSection:
    """From the goal to the trajectory."""

    course: Course = Course.CONSTANT_BEARING
    replan_s: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.2  # between plans of minimum snap
    expiry_s: Annotated[float, Interval(gt=0.1, le=2.0)] = 0.5  # a plan not renewed by then is dropped by the guardian
    settle_s: Annotated[float, Interval(gt=0.0, le=5.0)] = 0.8  # least duration of a plan
    station_m: Annotated[float, Interval(gt=0.0, le=2.0)] = 0.08  # nearer than this the place itself is followed
    leave_m: Annotated[float, Interval(gt=0.0, le=5.0)] = 0.5  # and so until it is so far away again
    # [rad] the heading may be so far off the direction of the target's boards before keeping them in sight comes first
    view_rad: Annotated[float, Interval(gt=0.0, le=3.2)] = 0.35
    view_from_m: Annotated[float, Interval(gt=0.0, le=20.0)] = 0.3  # nearer than this there is no direction
    clear_m: Annotated[float, Interval(ge=0.0, le=5.0)] = 0.15  # at least so far from the boards, on the way
    reference_leash_m: Annotated[float, Interval(gt=0.0, le=5.0)] = 0.3  # a reference farther away is given up
