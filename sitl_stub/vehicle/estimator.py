"""The autopilot's estimate: the truth plus errors that wander as those of PX4's EKF on GNSS and barometer do.

Position and velocity error of each axis are one stochastic process, the error dynamics of a filter that is corrected by
slowly wandering measurements:

    du = -u / correlation dt + noise             the wandering disturbance
    dv = (u - v) / smoothing dt                   velocity error: smooth above 1 Hz
    dp = v dt - decay p dt                        position error: integrated, pulled back by position fixes

In the recordings the velocity error leads the position error by 0.5 to 1 s, correlates with it by 0.75 to 0.9, and is
two to four times the position error's derivative: that is this structure. Roll, pitch and yaw errors are a bias and a
smoothed wander.
"""

import math
from collections.abc import Callable

import numpy as np

from sitl_stub.truth import Vector
from sitl_stub.vehicle.body import Body
from sitl_stub.vehicle.body_state import BodyState
from sitl_stub.vehicle.config import EstimatorParameters
from sitl_stub.vehicle.rigid_body import GRAVITY

NORMALS_PER_DRAW = 4096
NO_ERROR: Vector = (0.0, 0.0, 0.0)


class Normals:
    """Standard normal numbers as Python floats, drawn in blocks."""

    __slots__ = ("_block", "_rng", "_used")

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._block: list[float] = []
        self._used = 0

    def __call__(self) -> float:
        """Return the next number."""
        if self._used >= len(self._block):
            self._block = self._rng.standard_normal(NORMALS_PER_DRAW).tolist()
            self._used = 0
        self._used += 1
        return self._block[self._used - 1]


class Wander:
    """A first-order Gauss-Markov process behind a first-order low-pass.

    The output has standard deviation `std`; correlation and smoothing are the two time constants [s].
    """

    __slots__ = ("_correlation", "_drive", "_noise", "_normal", "_smoothing", "value")

    def __init__(self, *, std: float, correlation: float, smoothing: float, normal: Callable[[], float]) -> None:
        self._correlation, self._smoothing, self._normal = correlation, smoothing, normal
        # stationary variance of the smoothed process: var(u) * correlation / (correlation + smoothing)
        drive = std * math.sqrt((correlation + smoothing) / correlation)
        self._noise = drive * math.sqrt(2.0 / correlation)
        # start in the steady state: output and drive correlate by std / drive
        share = math.sqrt(correlation / (correlation + smoothing))
        first, second = normal(), normal()
        self.value = std * first
        self._drive = drive * (share * first + math.sqrt(1.0 - share * share) * second)

    def step(self, dt: float) -> float:
        """Advance by `dt` [s] and return the output."""
        self._drive += -self._drive / self._correlation * dt + self._noise * math.sqrt(dt) * self._normal()
        self.value += (self._drive - self.value) / self._smoothing * dt
        return self.value


class Estimate(BodyState):
    """What the autopilot believes; frame local ned with the origin where it booted."""

    __slots__ = ("down_rate", "pitch", "range_down", "roll", "specific_force", "yaw")

    def __init__(self) -> None:
        super().__init__()
        self.down_rate = 0.0
        """Derivative of `down` [m/s]: it differs from `v_down`, which has its own error."""
        self.roll = self.pitch = self.yaw = 0.0
        self.specific_force: Vector = (0.0, 0.0, -GRAVITY)
        """What the accelerometer feels [m/s^2], frd."""
        self.range_down = 0.0
        """Range finder: distance [m] from the body origin to what is below."""


class Estimator:
    """Makes the estimate from the truth. One instance per flight, all randomness from `rng`."""

    __slots__ = (
        "_bias",
        "_decay",
        "_errors",
        "_normal",
        "_origin",
        "_parameters",
        "_position_error",
        "_tilts",
        "estimate",
    )

    def __init__(self, parameters: EstimatorParameters, body: Body, rng: np.random.Generator) -> None:
        self._parameters = parameters
        self._normal = normal = Normals(rng)
        self._origin = body.position
        self._errors = [
            Wander(std=std, correlation=correlation, smoothing=smoothing, normal=normal)
            for std, correlation, smoothing in zip(
                parameters.velocity_std_mps,
                parameters.velocity_correlation_s,
                parameters.velocity_smoothing_s,
                strict=True,
            )
        ]
        self._decay = parameters.position_decay_per_s
        self._position_error = [
            _start_position_error(error.value, decay, correlation, std, normal)
            for error, decay, correlation, std in zip(
                self._errors,
                self._decay,
                parameters.velocity_correlation_s,
                parameters.velocity_std_mps,
                strict=True,
            )
        ]
        self._tilts = [
            Wander(std=math.radians(std), correlation=correlation, smoothing=smoothing, normal=normal)
            for std, correlation, smoothing in zip(
                parameters.attitude_std_deg,
                parameters.attitude_correlation_s,
                parameters.attitude_smoothing_s,
                strict=True,
            )
        ]
        self._bias = [math.radians(std) * normal() for std in parameters.attitude_bias_std_deg]
        self.estimate = Estimate()
        self.step(1e-3, body)

    def step(self, dt: float, body: Body) -> Estimate:
        """Advance the errors by `dt` [s] and return the (same, updated) estimate of the body's state."""
        estimate, parameters = self.estimate, self._parameters
        if not parameters.enabled:
            self.impose(body, NO_ERROR, NO_ERROR, 0.0, NO_ERROR)
            return estimate
        normal, errors, position = self._normal, self._errors, self._position_error
        k0, k1, k2 = self._decay
        v0, v1, v2 = errors[0].step(dt), errors[1].step(dt), errors[2].step(dt)
        rate_down = v2 - k2 * position[2]
        position[0] += (v0 - k0 * position[0]) * dt
        position[1] += (v1 - k1 * position[1]) * dt
        position[2] += rate_down * dt
        tilts, bias = self._tilts, self._bias
        angles = (bias[0] + tilts[0].step(dt), bias[1] + tilts[1].step(dt), bias[2] + tilts[2].step(dt))
        self.impose(body, (position[0], position[1], position[2]), (v0, v1, v2), rate_down, angles)
        noise = parameters.gyro_noise_std_radps
        estimate.p += noise * normal()
        estimate.q += noise * normal()
        estimate.r += noise * normal()
        return estimate

    def impose(
        self, body: Body, position_error: Vector, velocity_error: Vector, down_rate_error: float, angles: Vector
    ) -> None:
        """Set the estimate to the body's state plus errors [m], [m/s], ned; `angles`: roll, pitch, yaw error [rad]."""
        self._take(body, position_error, velocity_error)
        self.estimate.down_rate = body.v_down + down_rate_error
        self._turn(body, angles[0], angles[1], angles[2])

    def range_noise(self) -> float:
        """Error of one reading of the range finder [m]."""
        return self._parameters.range_finder_noise_std_m * self._normal() if self._parameters.enabled else 0.0

    def _take(self, body: Body, position_error: Vector, velocity_error: Vector) -> None:
        estimate, origin = self.estimate, self._origin
        estimate.north = body.north - origin[0] + position_error[0]
        estimate.east = body.east - origin[1] + position_error[1]
        estimate.down = body.down - origin[2] + position_error[2]
        estimate.v_north = body.v_north + velocity_error[0]
        estimate.v_east = body.v_east + velocity_error[1]
        estimate.v_down = body.v_down + velocity_error[2]
        estimate.p, estimate.q, estimate.r = body.p, body.q, body.r
        a0, a1, a2 = body.acceleration
        a2 -= GRAVITY
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = body.rotation
        estimate.specific_force = (
            r00 * a0 + r10 * a1 + r20 * a2,
            r01 * a0 + r11 * a1 + r21 * a2,
            r02 * a0 + r12 * a1 + r22 * a2,
        )
        estimate.range_down = body.ground_clearance

    def _turn(self, body: Body, roll_error: float, pitch_error: float, yaw_error: float) -> None:
        """Attitude estimate: yaw error about the vertical, small roll and pitch errors about the body's axes."""
        w, x, y, z = body.qw, body.qx, body.qy, body.qz
        h, k = 0.5 * roll_error, 0.5 * pitch_error
        # q * (1, h, k, 0)
        w, x, y, z = w - x * h - y * k, x + w * h - z * k, y + w * k + z * h, z + x * k - y * h
        c, s = math.cos(0.5 * yaw_error), math.sin(0.5 * yaw_error)
        # (c, 0, 0, s) * q
        w, x, y, z = c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
        scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w * scale, x * scale, y * scale, z * scale
        estimate = self.estimate
        estimate.qw, estimate.qx, estimate.qy, estimate.qz = w, x, y, z
        estimate.roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        estimate.pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
        estimate.yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _start_position_error(
    velocity: float, decay: float, correlation: float, std: float, normal: Callable[[], float]
) -> float:
    """Draw the position error from its stationary distribution, given the velocity error.

    For dp = (v - decay p) dt and v of correlation time T: E[p v] = std^2 / (decay + 1/T), E[p^2] = E[p v] / decay.
    """
    if std == 0.0 or decay == 0.0:
        return 0.0
    slope = 1.0 / (decay + 1.0 / correlation)
    variance = std * std * slope / decay - (std * slope) ** 2
    return slope * velocity + math.sqrt(max(variance, 0.0)) * normal()
