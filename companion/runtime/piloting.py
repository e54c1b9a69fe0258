"""From a goal to the trajectory that the guardian flies, for a multicopter."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from companion.config.tree import ControlSection
from companion.control.corrected import CorrectedTrajectory
from companion.control.heading_feedback import HeadingFeedback
from companion.control.motion_observer import GRAVITY, MotionObserver, tilt_acceleration
from companion.control.relative_feedback import RelativeFeedback
from companion.estimation.ownship import OwnshipReset
from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z
from companion.guidance.goals import Goal
from companion.guidance.parameters import ApproachParameters
from companion.messages.motion import MotionState, Trajectory
from companion.messages.ownship import OwnshipState
from companion.messages.target import Prediction, TargetPose
from companion.planning.chasing import plan_in_pursuit
from companion.planning.minimum_snap import PlanParameters, PlanRequest
from companion.runtime.pilot import DirectTrajectory
from companion.runtime.tracking import Picture
from companion.vehicles.multicopter import Multicopter

_CALM_SPEED = 0.5  # [m/s]
_CALM_ACCELERATION = 0.8  # [m/s^2]


class Piloting:
    """A multicopter's `Pilot`: holds the present plan between steps.

    Args:
        planner: of the plans.
        control: of the corrections.
        approach: limits of the last part of the way.
        vehicle: its limits.
        position_gain: of the autopilot's position loop [1/s], horizontal and vertical.
        heading_gain: of its heading loop [1/s].
    """

    def __init__(
        self,
        planner: PlanParameters,
        control: ControlSection,
        approach: ApproachParameters,
        vehicle: Multicopter,
        *,
        position_gain: tuple[float, float],
        heading_gain: float,
    ) -> None:
        self._planner = planner
        self._p = control
        self._limits = vehicle.limits
        self._approach_limits = replace(
            vehicle.limits,
            speed_horizontal=min(vehicle.limits.speed_horizontal, approach.speed_mps),
            acceleration_horizontal=min(vehicle.limits.acceleration_horizontal, approach.acceleration_mps2),
            jerk=min(vehicle.limits.jerk, approach.jerk_mps3),
        )
        self._closing_speed = vehicle.closing_speed
        self._position_gain = np.array([position_gain[0], position_gain[0], position_gain[1]])
        self._feedback = RelativeFeedback(control.feedback)
        self._heading = HeadingFeedback(
            control.feedback, gain=heading_gain, rate_max=vehicle.limits.yaw_rate, near=control.station_heading_rad
        )
        self._observer = MotionObserver(control.observer)
        self._relative = MotionObserver(control.relative_observer)
        self._plan: Trajectory | None = None
        self._t_planned = -1e9
        self._prediction: Prediction | None = None  # the forecast that the plan was made for
        self._gentle = False  # the plan has the limits of the approach
        self._sent = np.zeros(3)  # [m/s^2] acceleration last handed over
        self._lean = np.zeros(2)
        self._t_ownship = -math.inf
        self._level: Array | None = None  # [m/s^2] what levels the vehicle at touchdown

    @property
    def plan(self) -> Trajectory | None:
        """The present plan without feedback."""
        return self._plan

    @property
    def velocity_bias_ned(self) -> Array:
        """Bias of the autopilot's velocity estimate (3,) [m/s]."""
        return self._observer.bias_ned

    def relative_velocity_ned(self, ownship: OwnshipState) -> Array | None:
        """Give the velocity relative to the target as the sightings show it (3,) [m/s], None before it is known."""
        return ownship.velocity_ned - self._relative.bias_ned if self._relative.settled else None

    def landmark(self, state: OwnshipState) -> Array | None:  # noqa: ARG002  # the interface's
        """In the air nothing else than the autopilot's odometry is gone by."""
        return None

    @property
    def lean_ned(self) -> Array:
        """The vehicle's downward axis, north and east (2,), smoothed."""
        return self._lean

    def add_ownship(self, state: OwnshipState) -> None:
        """Take the next odometry message."""
        share = -math.expm1(-max(0.0, state.t - self._t_ownship) / self._p.lean_smoothing_s)
        self._lean = self._lean + share * (state.ned_from_frd[:2, 2] - self._lean)
        self._t_ownship = state.t
        self._observer.add(state, state.position_ned)

    def clear(self) -> None:
        """Forget the plan and the feedback."""
        self._plan = None
        self._prediction = None
        self._forget_feedback()

    def _forget_feedback(self) -> None:
        self._feedback.reset()
        self._heading.reset()

    def rebase(self, reset: OwnshipReset) -> None:
        """Follow a reset of the autopilot's estimator: the plan belongs to the old frame."""
        self._lean = rotation_about_z(reset.yaw)[:2, :2] @ self._lean
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
        """Plan where due and add the feedback; see `Pilot.update`."""
        prediction, sighted_ned = picture.prediction, picture.sighted_ned
        plan = self._direct(t, goal, ownship) if goal.direct else self._renewed(t, goal, switched, ownship, prediction)
        if sighted_ned is not None:
            self._relative.add(ownship, ownship.position_ned - sighted_ned)
        if goal.direct:
            return self._levelled(plan, ownship, picture.slope_ned)
        self._level = None
        if not goal.relative or prediction is None or sighted_ned is None:
            self._forget_feedback()
            self._sent = np.zeros(3)
            return CorrectedTrajectory(base=plan, acceleration_ned=self._sent, velocity_ned=self._observer.bias_ned)
        target = prediction.at(t)
        correction, lag = self._correction(t, dt, plan, goal, ownship, target)
        bias = self._relative.bias_ned - target.velocity_ned + lag
        bias[2] = self._observer.bias_ned[2] + lag[2]
        self._sent = correction + plan.at(t).acceleration_ned
        turn = self._heading.update(
            t,
            dt,
            goal=goal.at,
            calm=goal.calm,
            plan=plan.at(t),
            yaw=ownship.yaw,
            yaw_rate=float(ownship.angular_velocity_frd[2]),
        )
        return CorrectedTrajectory(base=plan, acceleration_ned=correction, velocity_ned=bias, yaw=turn)

    def _levelled(self, plan: Trajectory, ownship: OwnshipState, slope_ned: Array) -> Trajectory:
        """Touch down parallel to the pad: take out the tilt that the autopilot holds against the wind.

        A tilted vehicle meets the pad with one foot, which kicks it aside and turns it. The tilt is that against the
        pad as it is seen: the autopilot's own attitude is wrong by about as much as is left of it.
        """
        if self._level is None:
            tilt = tilt_acceleration(ownship) + GRAVITY * slope_ned
            gain = self._p.touchdown_levelling
            self._level = np.array([self._sent[0] - gain * tilt[0], self._sent[1] - gain * tilt[1], 0.0])
        self._forget_feedback()
        return CorrectedTrajectory(base=plan, acceleration_ned=self._level, velocity_ned=self._observer.bias_ned)

    def _direct(self, t: float, goal: Goal, ownship: OwnshipState) -> Trajectory:
        self._plan = DirectTrajectory(
            motion=goal.at,
            t_start=t,
            t_end=t,
            t_expiry=t + self._p.expiry_s,
            reset_counter=ownship.reset_counter,
        )
        self._t_planned = t
        return self._plan

    def _renewed(
        self, t: float, goal: Goal, switched: bool, ownship: OwnshipState, prediction: Prediction | None
    ) -> Trajectory:
        plan = self._plan
        if plan is None or switched or t - self._t_planned >= self._p.replan_s - 1e-6:
            plan = self._planned(t, goal, ownship)
            self._plan, self._t_planned, self._prediction = plan, t, prediction
        return plan

    def _planned(self, t: float, goal: Goal, ownship: OwnshipState) -> Trajectory:
        start = self._start(t, ownship)
        # a plan with gentle limits from a state that breaks them would swing far out: first come to rest
        self._gentle = goal.gentle and (self._gentle or _calm(start, goal.at(t)))
        request = PlanRequest(
            start=start,
            t_start=t,
            goal=goal.at,
            t_goal_hint=goal.t_reach,
            limits=self._approach_limits if self._gentle else self._limits,
            closing_speed=self._closing_speed if goal.relative else math.inf,
            t_expiry=t + self._p.expiry_s,
            reset_counter=ownship.reset_counter,
            parameters=self._planner,
        )
        return plan_in_pursuit(request).trajectory

    def _start(self, t: float, ownship: OwnshipState) -> MotionState:
        """Give the state to plan from: the present reference, or the vehicle itself where that has been lost."""
        plan = self._plan
        if plan is not None and plan.reset_counter == ownship.reset_counter:
            reference = plan.at(t)
            if float(np.linalg.norm(reference.position_ned - ownship.position_ned)) < self._p.reference_leash_m:
                return reference
        return MotionState(
            position_ned=ownship.position_ned,
            velocity_ned=ownship.velocity_ned,
            acceleration_ned=np.zeros(3),
            yaw=ownship.yaw,
            yaw_rate=0.0,
        )

    def _correction(
        self, t: float, dt: float, plan: Trajectory, goal: Goal, ownship: OwnshipState, now: TargetPose
    ) -> tuple[Array, Array]:
        """Feed back the relative error.

        On the way, against the plan, which keeps its place relative to the target as it is seen now; on station,
        against the goal itself, since a plan forgives the target its last jump and lags behind.

        Returns:
            The acceleration (3,) [m/s^2], and the velocity (3,) [m/s] by which the autopilot's position loop, which
            flies the plan, would fall short of the goal.
        """
        actual = ownship.velocity_ned - self._relative.bias_ned
        reference, wanted = plan.at(t), goal.at(t)
        error = wanted.position_ned - ownship.position_ned
        if goal.gentle or float(np.hypot(error[0], error[1])) > self._p.station_m:
            then = self._prediction.at(t) if self._prediction is not None else now
            error = reference.position_ned - then.position_ned + now.position_ned - ownship.position_ned
            rate = reference.velocity_ned - then.velocity_ned - actual
            lag = ahead = np.zeros(3)
        else:
            rate = wanted.velocity_ned - now.velocity_ned - actual
            lag = wanted.velocity_ned - reference.velocity_ned
            lag = lag + self._position_gain * (wanted.position_ned - reference.position_ned)
            most = self._p.feedback.vertical_max_mps
            lag[2] = np.clip(lag[2] + self._p.feedback.vertical * error[2], -most, most)
            ahead = wanted.acceleration_ned - reference.acceleration_ned
        return self._feedback.update(error, rate, self._relative.disturbance_ned, dt, calm=goal.calm) + ahead, lag


def _calm(start: MotionState, goal: MotionState) -> bool:
    """Say whether a state moves about as its goal does."""
    relative = start.velocity_ned - goal.velocity_ned
    return (
        float(np.hypot(relative[0], relative[1])) < _CALM_SPEED
        and float(np.hypot(start.acceleration_ned[0], start.acceleration_ned[1])) < _CALM_ACCELERATION
    )
