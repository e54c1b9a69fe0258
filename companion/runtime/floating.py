"""From a goal to the trajectory that the guardian flies, for a planar free-flyer."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.config.floating import Course, FloatingSection
from companion.estimation.ownship import OwnshipReset
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.guidance.goals import Goal, MotionAt
from companion.messages.motion import MotionState, Trajectory
from companion.messages.ownship import OwnshipState
from companion.messages.target import Prediction, TargetPose
from companion.planning.constant_bearing import CourseLimits, around, steered
from companion.planning.minimum_snap import PlanParameters, PlanRequest
from companion.planning.planar import level, plan_in_plane
from companion.runtime.pilot import DirectTrajectory
from companion.runtime.tracking import Picture
from companion.vehicles.free_flyer import FreeFlyer

_UPRIGHT = np.zeros(2)
_STILL = np.zeros(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Boards:
    """Where the boards of a target are, seen from above: in a disc."""

    ahead: float  # [m] its middle, of the target's reference point
    radius: float  # [m]


class Floating:
    """A free-flyer's `Pilot`: holds the present plan between steps.

    Away from its place it flies a course to it, at it the place itself; turned to the target's boards, so that they
    stay in sight, until the place's own heading shows them. Feedback is the guardian's, whose setpoints are thrust.

    Args:
        section: how plans are made.
        planner: of the search for a duration.
        vehicle: what it may be asked for.
        boards: where the target's are.
    """

    def __init__(
        self, section: FloatingSection, planner: PlanParameters, vehicle: FreeFlyer, *, boards: Boards
    ) -> None:
        self._p = section
        self._planner = planner
        self._vehicle = vehicle
        self._boards = boards
        self._limits = CourseLimits(
            speed=vehicle.limits.speed_horizontal,
            closing_speed=vehicle.closing_speed,
            acceleration=vehicle.limits.acceleration_horizontal,
        )
        self._plan: Trajectory | None = None
        self._t_planned = -math.inf
        self._at_place = False
        self._prediction: Prediction | None = None

    @property
    def plan(self) -> Trajectory | None:
        """The present plan without feedback."""
        return self._plan

    @property
    def velocity_bias_ned(self) -> Array:
        """Of the velocity that it goes by (3,) [m/s]: none."""
        return _STILL

    def relative_velocity_ned(self, ownship: OwnshipState) -> Array | None:
        """Give the velocity relative to the target's forecast (3,) [m/s], None without one."""
        forecast = self._prediction
        return None if forecast is None else ownship.velocity_ned - forecast.at(ownship.t).velocity_ned

    def landmark(self, state: OwnshipState) -> Array | None:  # noqa: ARG002  # the interface's
        """Nothing else than the autopilot's odometry is gone by."""
        return None

    @property
    def lean_ned(self) -> Array:
        """It stands upright."""
        return _UPRIGHT

    def add_ownship(self, state: OwnshipState) -> None:
        """Take the next odometry message: nothing to be done with what is gone by."""

    def clear(self) -> None:
        """Forget the plan."""
        self._plan, self._at_place = None, False

    def rebase(self, reset: OwnshipReset) -> None:  # noqa: ARG002  # the interface's
        """Follow a reset of the autopilot's estimator: the plan belongs to the old frame."""
        self._plan = None

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
        """Plan where due; see `Pilot.update`."""
        prediction = self._prediction = picture.prediction
        if goal.direct:
            self.clear()
            return self._direct(t, goal.at, ownship)
        target = prediction if goal.relative else None  # None: a place that stands, and says its own heading
        place = goal.at if target is None else self._in_sight(goal.at, target, ownship)
        away = math.dist(place(t).position_ned[:2].tolist(), ownship.position_ned[:2].tolist())
        self._at_place = away < (self._p.leave_m if self._at_place and target is not None else self._p.station_m)
        if self._at_place:
            self._plan = None
            return self._direct(t, place, ownship)
        if target is not None and self._p.course is Course.CONSTANT_BEARING:
            plan = self._plan = self._steered(t, dt, place, target.at(t), ownship)
        else:
            if self._plan is None or switched or t - self._t_planned >= self._p.replan_s - 1e-6:
                self._plan, self._t_planned = self._planned(t, place, goal.t_reach, ownship), t
            plan = self._plan
        return replace(
            self._direct(t, lambda when: _turned(plan.at(when), place(when)), ownship), t_expiry=plan.t_expiry
        )

    def _in_sight(self, motion: MotionAt, prediction: Prediction, ownship: OwnshipState) -> MotionAt:
        """Give a motion at our own height, its heading near the direction in which the boards are seen from here."""
        p, here = self._p, ownship.position_ned
        down = float(here[2])

        def at(t: float) -> MotionState:
            wanted, target = level(motion(t), down), prediction.at(t)
            north, east = self._to_boards(target, ownship)
            if math.hypot(north, east) < p.view_from_m:
                return wanted
            bearing = math.atan2(east, north)
            aside = wrap_angle(wanted.yaw - bearing)
            if abs(aside) <= p.view_rad:
                return wanted
            return replace(wanted, yaw=bearing + math.copysign(p.view_rad, aside), yaw_rate=0.0)

        return at

    def _direct(self, t: float, motion: MotionAt, ownship: OwnshipState) -> DirectTrajectory:
        return DirectTrajectory(
            motion=motion, t_start=t, t_end=t, t_expiry=t + self._p.expiry_s, reset_counter=ownship.reset_counter
        )

    def _to_boards(self, target: TargetPose, ownship: OwnshipState) -> tuple[float, float]:
        """Give the way from the vehicle to the middle of the boards, north and east [m]."""
        north, east = _pair(target.position_ned - ownship.position_ned)
        return north + self._boards.ahead * math.cos(target.yaw), east + self._boards.ahead * math.sin(target.yaw)

    def _steered(self, t: float, dt: float, goal: MotionAt, target: TargetPose, ownship: OwnshipState) -> Trajectory:
        """Move the reference on: its course is from where the vehicle is, so that what it lags does not add up."""
        p, start, wanted = self._p, self._start(t, ownship), goal(t)
        away, boards = _pair(wanted.position_ned - ownship.position_ned), self._to_boards(target, ownship)
        clear = self._boards.radius + self._vehicle.footprint_radius + p.clear_m
        clear = min(clear, math.dist(away, boards) - p.station_m)
        if clear > 0.0:
            away = around(away, boards, clear)
        velocity = steered(_pair(start.velocity_ned), away, _pair(wanted.velocity_ned), self._limits, dt)
        begun = replace(start, velocity_ned=np.array([*velocity, 0.0]), acceleration_ned=_STILL)
        return self._direct(t, lambda when: _moved_on(begun, when - t), ownship)

    def _planned(self, t: float, goal: MotionAt, t_reach: float, ownship: OwnshipState) -> Trajectory:
        request = PlanRequest(
            start=self._start(t, ownship),
            t_start=t,
            goal=goal,
            t_goal_hint=max(t_reach, t + self._p.settle_s),
            limits=self._vehicle.limits,
            t_expiry=t + self._p.expiry_s,
            reset_counter=ownship.reset_counter,
            parameters=self._planner,
        )
        return plan_in_plane(request).trajectory

    def _start(self, t: float, ownship: OwnshipState) -> MotionState:
        """Give where the last plan is now, or the vehicle itself where that is far off or there is none."""
        plan = self._plan
        if plan is not None:
            reference = plan.at(t)
            off = math.dist(reference.position_ned[:2].tolist(), ownship.position_ned[:2].tolist())
            if off < self._p.reference_leash_m:
                return reference
        return MotionState(
            position_ned=ownship.position_ned,
            velocity_ned=ownship.velocity_ned,
            acceleration_ned=_STILL,
            yaw=ownship.yaw,
            yaw_rate=float(ownship.angular_velocity_frd[2]),
        )


def _turned(motion: MotionState, heading: MotionState) -> MotionState:
    """Give a motion with the heading of another."""
    return replace(motion, yaw=heading.yaw, yaw_rate=heading.yaw_rate)


def _moved_on(state: MotionState, elapsed: float) -> MotionState:
    return replace(state, position_ned=state.position_ned + elapsed * state.velocity_ned)


def _pair(vector: Array) -> tuple[float, float]:
    north, east = vector[:2].tolist()
    return north, east
