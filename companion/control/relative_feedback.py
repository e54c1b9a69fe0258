"""Feedback on the pose relative to the target.

PX4 flies its own estimate: position error times MPC_XY_P, velocity error times MPC_XY_VEL_P_ACC. That loop is soft
(about 1.3 rad/s), while the camera sees the error relative to the pad thirty times a second. This feedback adds an
acceleration to the setpoint that stiffens the loop and removes what is constant, wind above all:

    a = k_p e + k_d de/dt + k_i ∫ e dt - k_w h

with e the wanted minus the actual relative position, horizontally, and h the observed disturbance without its slow part
(first-order washout): what is constant is left to the integrals, ours and the autopilot's, so that they do not fight.
The sum passes a lead, since the vehicle must first tilt before it accelerates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from companion.geometry.arrays import Array

Gain = Annotated[float, Ge(0.0)]
Positive = Annotated[float, Gt(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativeFeedbackParameters:
    """Gains and bounds."""

    proportional: Gain = 3.0  # [1/s^2]
    derivative: Gain = 2.2  # [1/s]
    integral: Gain = 1.2  # [1/s^3]
    following: Annotated[float, Interval(gt=0.0, le=1.0)] = (
        0.7  # share of proportional and derivative while following at a height
    )
    vertical: Gain = 1.0  # [1/s] of the error in height, added to the velocity: on top of the autopilot's MPC_Z_P
    vertical_max_mps: Positive = 0.25  # bound of what is added to the vertical velocity on station
    heading_turning: Gain = 0.3  # of the heading error, added to the heading setpoint while the target turns,
    heading: Gain = 0.5  # and while it does not
    heading_damping_s: Gain = 0.3  # likewise of the rate of that error
    heading_max_rad: Positive = 0.1  # bound of what is added to the heading setpoint,
    heading_slew_radps: Positive = 0.2  # and of its rate
    following_heading: Positive = 5.0  # [1/s] while following a target that turns: turn rate for the heading error,
    following_turn: Gain = 1.2  # less so much of the own turn rate
    heading_rate_noise_radps: Positive = 0.1  # of the target's turn rate: well below it the target does not turn
    acceleration_max_mps2: Positive = 2.0  # bound of the whole correction
    integral_max_mps2: Positive = 1.2  # bound of its integral part
    disturbance: Annotated[float, Ge(0.0)] = 0.9  # k_w, share of the observed disturbance that is taken out
    washout_s: Positive = 2.0
    lead_s: Gain = 0.0  # the attitude follows late: PX4's default MC_ROLL_P makes it a quarter of a second
    lead_smoothing_s: Positive = 0.06
    engage_error_m: Positive = 0.8  # the integral grows only while the error is smaller


class RelativeFeedback:
    """Holds the integral between steps."""

    def __init__(self, parameters: RelativeFeedbackParameters) -> None:
        self._p = parameters
        self._integral = np.zeros(3)  # [m/s^2] ned
        self._slow: Array | None = None  # [m/s^2] slow part of the disturbance
        self._smooth: Array | None = None  # [m/s^2] the wanted acceleration, smoothed

    def reset(self) -> None:
        """Forget the integral."""
        self._integral = np.zeros(3)
        self._slow = None
        self._smooth = None

    def update(
        self, error_ned: Array, error_rate_ned: Array, disturbance_ned: Array, dt: float, *, calm: bool = False
    ) -> Array:
        """Give the acceleration to add to the setpoint.

        Args:
            error_ned: wanted minus actual position relative to the target (3,) [m]; only north and east are used.
            error_rate_ned: its rate (3,) [m/s].
            disturbance_ned: observed (3,) [m/s^2], zero downwards.
            dt: time since the last call [s].
            calm: with a share of the gains only.

        Returns:
            acceleration (3,) [m/s^2], zero downwards.
        """
        p = self._p
        error, rate = error_ned.copy(), error_rate_ned.copy()
        error[2] = rate[2] = 0.0
        if float(np.hypot(error[0], error[1])) < p.engage_error_m:
            self._integral = _bounded(self._integral + p.integral * dt * error, p.integral_max_mps2)
        slow = disturbance_ned if self._slow is None else self._slow
        self._slow = slow + min(1.0, dt / p.washout_s) * (disturbance_ned - slow)
        fast = disturbance_ned - self._slow
        share = p.following if calm else 1.0
        wanted = share * (p.proportional * error + p.derivative * rate) + self._integral - p.disturbance * fast
        smooth = wanted if self._smooth is None else self._smooth
        self._smooth = smooth + min(1.0, dt / p.lead_smoothing_s) * (wanted - smooth)
        ahead = wanted + p.lead_s / p.lead_smoothing_s * (wanted - smooth)
        return _bounded(ahead, p.acceleration_max_mps2)


def _bounded(vector: Array, limit: float) -> Array:
    size = float(np.hypot(vector[0], vector[1]))
    return vector if size <= limit else vector * (limit / size)
