"""Feedback on the heading relative to the target.

The autopilot turns at the rate r = r_plan + g (yaw_plan + turn - yaw), with g its gain (MC_YAW_P), and late: by its yaw
torque, which is weak and smoothed. This feedback chooses `turn`, the heading to add to the plan's. The plan forgives
the target its last jump and lags behind; close to the goal's heading the vehicle is turned to the goal itself.

Following a target that turns, the rate that is wanted of the autopilot is

    r = k (yaw_goal(t + (1 + d) / k) - yaw) - d r_own

with the goal's heading foreseen by so much that nothing is left behind a target that turns steadily. Landing is gentler
than that, since a foot that meets the pad while the vehicle turns slips.
"""

from __future__ import annotations

from collections.abc import Callable

from companion.control.relative_feedback import RelativeFeedbackParameters
from companion.geometry.angles import wrap_angle
from companion.messages.motion import MotionState


class HeadingFeedback:
    """Holds the last correction between steps.

    Args:
        parameters: gains and bounds.
        gain: of the autopilot's heading [1/s].
        rate_max: at which the vehicle may turn [rad/s].
        near: heading error [rad] below which the feedback is against the goal itself.
    """

    def __init__(self, parameters: RelativeFeedbackParameters, *, gain: float, rate_max: float, near: float) -> None:
        self._p = parameters
        self._gain = gain
        self._rate_max = rate_max
        self._near = near
        self._turn = 0.0

    def reset(self) -> None:
        """Forget the last correction."""
        self._turn = 0.0

    def update(
        self,
        t: float,
        dt: float,
        *,
        goal: Callable[[float], MotionState],
        calm: bool,
        plan: MotionState,
        yaw: float,
        yaw_rate: float,
    ) -> float:
        """Give the heading [rad] to add to the plan's.

        Args:
            t: now [s].
            dt: since the last call [s].
            goal: the wanted motion.
            calm: a target is followed; nothing is about to be touched.
            plan: the planned motion now.
            yaw: of the vehicle [rad].
            yaw_rate: of the vehicle [rad/s].
        """
        p = self._p
        wanted = goal(t)
        error = wrap_angle(wanted.yaw - yaw)
        noise = p.heading_rate_noise_radps**2
        turning = noise + wanted.yaw_rate**2 + plan.yaw_rate**2 + yaw_rate**2
        if calm:
            turning += (p.following_heading * error) ** 2
            moving = self._following(t, goal, plan, yaw, yaw_rate)
        else:
            moving = p.heading_turning * wrap_angle(plan.yaw - yaw) + p.heading_damping_s * (plan.yaw_rate - yaw_rate)
        # the turn rate is an estimate: where it is small it is mostly noise, and would shake the vehicle
        still = noise / turning if abs(error) <= self._near else 0.0
        lag = wrap_angle(wanted.yaw - plan.yaw) - plan.yaw_rate / self._gain
        turn = still * (lag + p.heading * error - p.heading_damping_s * yaw_rate) + (1.0 - still) * moving
        self._turn = turn if calm else self._bounded(turn, dt)
        return self._turn

    def _following(
        self, t: float, goal: Callable[[float], MotionState], plan: MotionState, yaw: float, yaw_rate: float
    ) -> float:
        p = self._p
        foreseen = goal(t + (1.0 + p.following_turn) / p.following_heading).yaw
        rate = p.following_heading * wrap_angle(foreseen - yaw) - p.following_turn * yaw_rate
        rate = max(-self._rate_max, min(self._rate_max, rate))
        return wrap_angle(yaw - plan.yaw) + (rate - plan.yaw_rate) / self._gain

    def _bounded(self, turn: float, dt: float) -> float:
        most, step = self._p.heading_max_rad, self._p.heading_slew_radps * dt
        turn = max(self._turn - step, min(self._turn + step, turn))
        return max(-most, min(most, turn))
