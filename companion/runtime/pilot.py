"""What flies or drives to a goal: the piece between guidance and guardian, one for each type of vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from companion.estimation.ownship import OwnshipReset
from companion.geometry.arrays import Array
from companion.guidance.goals import Goal, MotionAt
from companion.messages.motion import MotionState, Trajectory
from companion.messages.ownship import OwnshipState
from companion.runtime.tracking import Picture


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DirectTrajectory:
    """A goal followed as it is."""

    motion: MotionAt
    t_start: float
    t_end: float
    t_expiry: float
    reset_counter: int

    def at(self, t: float) -> MotionState:
        """Give the goal at `t` [s]."""
        return self.motion(t)


class Pilot(Protocol):
    """Plans, and adds feedback; holds the present plan between steps."""

    @property
    def plan(self) -> Trajectory | None:
        """The present plan without feedback."""

    @property
    def velocity_bias_ned(self) -> Array:
        """Bias of the autopilot's velocity estimate (3,) [m/s]."""

    def relative_velocity_ned(self, ownship: OwnshipState) -> Array | None:
        """Give the velocity relative to the target as the sightings show it (3,) [m/s], None before it is known."""

    def landmark(self, state: OwnshipState) -> Array | None:
        """Give the velocity (3,) [m/s] by the sight of a target that stands or drives at a known speed, else None.

        Args:
            state: the autopilot's newest word of our own motion.
        """

    @property
    def lean_ned(self) -> Array:
        """The vehicle's downward axis, north and east (2,), smoothed."""

    def add_ownship(self, state: OwnshipState) -> None:
        """Take the next odometry message."""

    def clear(self) -> None:
        """Forget the plan and the feedback."""

    def rebase(self, reset: OwnshipReset) -> None:
        """Follow a reset of the autopilot's estimator."""

    def update(
        self,
        *,
        t: float,
        dt: float,
        goal: Goal,
        switched: bool,
        ownship: OwnshipState,
        picture: Picture,
    ) -> Trajectory:
        """Plan where due and add the feedback.

        Args:
            t: now [s].
            dt: time since the last call [s].
            goal: of the present mode.
            switched: the mode changed in this step.
            ownship: our own motion now.
            picture: what is known of the target now.
        """
