"""What the guidance remembers between steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z
from companion.guidance.looked import Looked
from companion.guidance.parameters import GuidanceParameters
from companion.guidance.plan import FlightPlan
from companion.messages.decision import Mode
from companion.planning.energy_path import EnergyPath

NEVER = -math.inf  # [s]


@dataclass(slots=True, kw_only=True)
class Memory:
    """What the guidance remembers between steps."""

    mode: Mode = Mode.PREFLIGHT
    t_entered: float = NEVER
    origin_ned: Array = field(default_factory=lambda: np.zeros(3))  # where the take-off began
    origin_yaw: float = 0.0
    origin_known: bool = False
    climb_height: float = 0.0  # [m] of the take-off's reference above that place
    climb_rate: float = 0.0  # [m/s] of that reference
    hold_position: Array = field(default_factory=lambda: np.zeros(3))
    hold_yaw: float = 0.0
    rest_position: Array = field(default_factory=lambda: np.zeros(3))  # where the vehicle can come to rest
    reorient_range: float = 0.0  # r2
    attempts: int = 0
    followed: bool = False
    wants_return: bool = False  # the target was not found: the mission asks to fly home
    search_started: float = NEVER
    centred_at: float = NEVER  # when the search was told the place around which it flies
    spiral_started: float | None = None  # None: still on the way to that place
    search_budget: float = math.inf
    search_left: float | None = None  # [s] of the budget, when the camera broke off a search
    looked: Looked = field(default_factory=Looked)  # held with camera frames, since the target was last acquired
    way_from: Array = field(default_factory=lambda: np.zeros(3))  # where the way to the pad began
    way: float = 0.0  # [m] of it that the reference has behind it
    way_speed: float = 0.0  # [m/s] of the reference
    path: EnergyPath | None = None  # speed and height along it; None: not planned yet
    coarse_std: float | None = None  # [m] of the pad's place before it was seen; None: it was never flown to so
    found: bool = False  # the target, where that is all the mission asks for
    centre_ned: Array | None = None  # where the target was last expected
    centre_velocity: Array = field(default_factory=lambda: np.zeros(3))
    dwell_since: float | None = None
    stopped_since: float | None = None
    follow_started: float = NEVER
    approach_height: float = 0.0
    height_reference: float = 0.0  # of the feet above the pad, while landing
    descent_rate: float = 0.0  # [m/s] of that reference, positive down
    lowest: float = math.inf
    t_progress: float = NEVER
    fence_since: float | None = None  # [s] the fence has been in the way
    gate_since: float | None = None
    gate_passed: bool = False
    precland_seen: bool = False  # the autopilot has been landing precisely
    last_seen: tuple[float, float, float] | None = None  # while it does: t [s], lateral and height [m] above the pad

    def rebase(self, translation_ned: Array, yaw: float, pivot_ned: Array) -> None:
        """Follow a reset of the autopilot's estimator; arguments as in `Guidance.rebase`."""

        def moved(point: Array) -> Array:
            return moved_by_reset(point, translation_ned, yaw, pivot_ned)

        self.origin_ned, self.hold_position = moved(self.origin_ned), moved(self.hold_position)
        self.rest_position, self.way_from = moved(self.rest_position), moved(self.way_from)
        self.origin_yaw += yaw
        self.hold_yaw += yaw
        if self.centre_ned is not None:
            self.centre_ned, self.centre_velocity = moved(self.centre_ned), rotation_about_z(yaw) @ self.centre_velocity


def moved_by_reset(point_ned: Array, translation_ned: Array, yaw: float, pivot_ned: Array) -> Array:
    """Take a point (3,) [m] into the frame after a reset of the estimator; arguments as in `Policy.rebase`."""
    result: Array = pivot_ned + translation_ned + rotation_about_z(yaw) @ (point_ned - pivot_ned)
    return result


def pose_moved_by_reset(
    pose: tuple[Array, float], translation_ned: Array, yaw: float, pivot_ned: Array
) -> tuple[Array, float]:
    """Take a position (3,) [m] and a heading [rad] into the frame after a reset; arguments as in `Policy.rebase`."""
    position_ned, heading = pose
    return moved_by_reset(position_ned, translation_ned, yaw, pivot_ned), heading + yaw


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Context:
    """What checks and goals look at besides the view."""

    plan: FlightPlan
    parameters: GuidanceParameters
    memory: Memory
