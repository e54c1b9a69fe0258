"""A trajectory with a correction on top."""

from __future__ import annotations

from dataclasses import dataclass

from companion.geometry.arrays import Array, frozen
from companion.messages.motion import MotionState, Trajectory


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CorrectedTrajectory:
    """A planned trajectory with feedback for the autopilot's loops, until it expires."""

    base: Trajectory
    acceleration_ned: Array  # (3,) [m/s^2] feedback on top of the planned acceleration
    velocity_ned: Array  # (3,) [m/s] feedback on top of the planned velocity
    yaw: float = 0.0  # [rad] feedback on top of the planned heading

    def __post_init__(self) -> None:
        object.__setattr__(self, "acceleration_ned", frozen(self.acceleration_ned, (3,)))
        object.__setattr__(self, "velocity_ned", frozen(self.velocity_ned, (3,)))

    @property
    def t_start(self) -> float:
        """Instant [s] at which it begins."""
        return self.base.t_start

    @property
    def t_end(self) -> float:
        """Instant [s] at which its last piece ends."""
        return self.base.t_end

    @property
    def t_expiry(self) -> float:
        """Instant [s] after which it is no longer followed."""
        return self.base.t_expiry

    @property
    def reset_counter(self) -> int:
        """Reset counter of the odometry it is anchored in."""
        return self.base.reset_counter

    def at(self, t: float) -> MotionState:
        """Give the planned motion with the correction at `t` [s]."""
        motion = self.base.at(t)
        return MotionState(
            position_ned=motion.position_ned,
            velocity_ned=motion.velocity_ned,
            acceleration_ned=motion.acceleration_ned,
            yaw=motion.yaw,
            yaw_rate=motion.yaw_rate,
            feedback_velocity_ned=motion.feedback_velocity_ned + self.velocity_ned,
            feedback_yaw=motion.feedback_yaw + self.yaw,
            feedback_acceleration_ned=motion.feedback_acceleration_ned + self.acceleration_ned,
        )
