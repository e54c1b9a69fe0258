"""From a goal to the trajectory that the guardian drives: a plan, or the last centimetres without one."""

from __future__ import annotations

import math

import numpy as np

from companion.clock import Clock
from companion.config.driving import DrivingSection
from companion.control.corrected import CorrectedTrajectory
from companion.estimation.ground_odometry import Odometry
from companion.estimation.ownship import OwnshipReset
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.guidance.goals import Goal
from companion.messages.motion import MotionState, Trajectory
from companion.messages.ownship import OwnshipState
from companion.planning.coupled.model import RoverMotion
from companion.planning.coupled.plan import CoupledPlan
from companion.planning.run_up import Motion, RunUp
from companion.planning.shortest.meeting import Meeting, Reach
from companion.runtime.driving.relative_motion import FRESH_S, RelativeMotion
from companion.runtime.driving.replanning import Occasion, Replanning
from companion.runtime.pilot import DirectTrajectory
from companion.runtime.tracking import Picture

_UPRIGHT = np.zeros(2)
_STILL = np.zeros(3)


class Driving:
    """Holds the present plan between steps.

    Args:
        section: how plans are made.
        motion: what the rover can do.
        rear_axle: behind the body origin [m].
        odometry: that the forecast and the rover's own motion are given in.
        reach: foresees where a place that is not near is met; None: each instant of a plan goes by the place as it
            will be then.
        clock: by which a plan keeps its deadline; None: it takes as long as it takes.
    """

    def __init__(
        self,
        section: DrivingSection,
        motion: RoverMotion,
        *,
        rear_axle: float,
        odometry: Odometry,
        reach: Reach | None = None,
        clock: Clock | None = None,
    ) -> None:
        self._p = section
        self._rear = rear_axle
        self._motion = RelativeMotion(section, rear_axle=rear_axle, odometry=odometry)
        self._replanning = Replanning(section, motion, rear_axle=rear_axle, reach=reach, clock=clock)
        self._run_up = RunUp(section.run_up, motion)
        self._plan: Trajectory | None = None
        self._t_planned = -math.inf

    @property
    def plan(self) -> Trajectory | None:
        """The present plan without feedback."""
        return self._plan

    @property
    def solution(self) -> CoupledPlan | None:
        """The newest answer of the coupled planner."""
        return self._replanning.solution

    @property
    def meeting(self) -> Meeting | None:
        """When the place is met, counted from the newest plan's beginning, its end at the earliest; None: not asked."""
        return self._replanning.meeting

    @property
    def velocity_bias_ned(self) -> Array:
        """Of the velocity that it goes by (3,) [m/s]: none."""
        return _STILL

    def relative_velocity_ned(self, ownship: OwnshipState) -> Array | None:  # noqa: ARG002  # the interface's
        """Give the velocity relative to the target as the sightings show it (3,) [m/s], None before it is known."""
        return self._motion.relative_velocity_ned

    def landmark(self, state: OwnshipState) -> Array | None:
        """Give the velocity by the sight of a target that stands, or drives at a known speed; see `Pilot.landmark`."""
        return self._motion.landmark(state)

    @property
    def lean_ned(self) -> Array:
        """A rover stands upright."""
        return _UPRIGHT

    def add_ownship(self, state: OwnshipState) -> None:
        """Take the next odometry message: nothing to be done with what is gone by."""

    def clear(self) -> None:
        """Forget the plan."""
        self._plan = None
        self._replanning.forget()
        self._run_up.forget()

    def rebase(self, reset: OwnshipReset) -> None:  # noqa: ARG002  # the interface's
        """Follow a reset of the autopilot's estimator: the trajectory belongs to the old frame.

        The controls do not: they are relative to the rover, and the next plan begins with them.
        """
        self._plan = None
        self._motion.forget()

    def update(
        self,
        *,
        t: float,
        dt: float,  # noqa: ARG002  # the interface's
        goal: Goal,
        switched: bool,
        ownship: OwnshipState,
        picture: Picture,
    ) -> Trajectory:
        """Plan where due; see `Pilot.update`."""
        self._motion.update(t, ownship, picture)
        if not goal.relative or picture.prediction is None:
            return self._stand(t, goal, ownship)
        motion = self._last_centimetres(t, goal, ownship)
        if motion is not None:
            self._replanning.forget()
            self._t_planned = -math.inf
            self._plan = self._straight(t, motion, ownship)
            return self._corrected(self._plan, ownship)
        due = t - self._t_planned >= self._p.replan_s - 1e-6
        if self._plan is None or switched or due:
            self._plan = self._replanning.plan(
                Occasion(
                    t=t,
                    goal=goal,
                    ownship=ownship,
                    prediction=picture.prediction,
                    track=picture.track,
                    target_rests=self._motion.target_rests,
                    target_seen=self._motion.sighting_age(t) < FRESH_S,
                )
            )
            self._t_planned = t
        return self._corrected(self._plan, ownship)

    def _corrected(self, plan: Trajectory, ownship: OwnshipState) -> CorrectedTrajectory:
        sent = self._motion.autopilot_bias_ned(ownship)
        return CorrectedTrajectory(base=plan, acceleration_ned=_STILL, velocity_ned=sent)

    def _last_centimetres(self, t: float, goal: Goal, ownship: OwnshipState) -> Motion | None:
        """Give what a run-up asks for beside a target that stands and is seen, None where plans are made."""
        if not self._motion.target_rests or self._motion.sighting_age(t) > FRESH_S:
            self._run_up.forget()
            return None
        wanted, yaw = goal.at(t), ownship.yaw
        cosine, sine = math.cos(wanted.yaw), math.sin(wanted.yaw)
        turned = wrap_angle(wanted.yaw - yaw)
        north = float(wanted.position_ned[0] - ownship.position_ned[0]) - self._rear * (cosine - math.cos(yaw))
        east = float(wanted.position_ned[1] - ownship.position_ned[1]) - self._rear * (sine - math.sin(yaw))
        along, across = cosine * north + sine * east, cosine * east - sine * north
        return self._run_up.update(t, along=along, across=across, heading=turned)

    def _straight(self, t: float, motion: Motion, ownship: OwnshipState) -> Trajectory:
        """Give one speed and turn as a trajectory, until the next step."""
        yaw, place = ownship.yaw, ownship.position_ned
        velocity = motion.speed * np.array([math.cos(yaw), math.sin(yaw), 0.0])

        def at(when: float) -> MotionState:
            return MotionState(
                position_ned=place + (when - t) * velocity,
                velocity_ned=velocity,
                acceleration_ned=_STILL,
                yaw=yaw + (when - t) * motion.yaw_rate,
                yaw_rate=motion.yaw_rate,
            )

        end = t + self._p.expiry_s
        return DirectTrajectory(motion=at, t_start=t, t_end=end, t_expiry=end, reset_counter=ownship.reset_counter)

    def _stand(self, t: float, goal: Goal, ownship: OwnshipState) -> Trajectory:
        self.clear()
        return DirectTrajectory(
            motion=goal.at, t_start=t, t_end=t, t_expiry=t + self._p.expiry_s, reset_counter=ownship.reset_counter
        )
