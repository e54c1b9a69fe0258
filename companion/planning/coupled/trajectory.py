"""A coupled plan as a trajectory in the autopilot's local frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.messages.motion import MotionState
from companion.planning.coupled.plan import CoupledPlan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RoverTrajectory:
    """A plan's poses, joined by the plan's own model; implements `companion.messages.motion.Trajectory`.

    Velocity points along the heading, backwards where the speed is negative; acceleration is that of the turn.
    Before its start it stands at its first pose, after its end at its last.
    """

    plan: CoupledPlan
    origin_ned: tuple[float, float, float]  # [m] of the rover at the start
    yaw: float  # [rad] of the rover at the start
    midpoint: float  # of `CoupledParameters`
    t_expiry: float  # [s]
    reset_counter: int

    @property
    def t_start(self) -> float:
        """Instant [s] at which it begins."""
        return self.plan.t_start

    @property
    def t_end(self) -> float:
        """Instant [s] at which its last step ends."""
        return self.plan.t_start + len(self.plan.controls) * self.plan.step

    def at(self, t: float) -> MotionState:
        """Give the reference at `t` [s]."""
        plan = self.plan
        elapsed = (t - plan.t_start) / plan.step
        count = len(plan.controls)
        if not 0.0 <= elapsed < count:
            return self._state(plan.poses[0 if elapsed < 0.0 else count].tolist(), 0.0, 0.0)
        index = int(elapsed)
        since = (elapsed - index) * plan.step
        speed, yaw_rate = plan.controls[index].tolist()
        x, y, heading = plan.poses[index].tolist()
        course = heading + self.midpoint * yaw_rate * since
        way = speed * since
        pose = [x + way * math.cos(course), y + way * math.sin(course), heading + yaw_rate * since]
        return self._state(pose, speed, yaw_rate)

    def _state(self, pose: list[float], speed: float, yaw_rate: float) -> MotionState:
        x, y, turn = pose
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        heading = self.yaw + turn
        ahead, aside = math.cos(heading), math.sin(heading)
        north, east, down = self.origin_ned
        return MotionState(
            position_ned=(north + cosine * x - sine * y, east + sine * x + cosine * y, down),  # type: ignore[arg-type]
            velocity_ned=(speed * ahead, speed * aside, 0.0),  # type: ignore[arg-type]
            acceleration_ned=(-speed * yaw_rate * aside, speed * yaw_rate * ahead, 0.0),  # type: ignore[arg-type]
            yaw=heading,
            yaw_rate=yaw_rate,
        )
