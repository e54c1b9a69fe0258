"""PX4's own errors of its estimate, taken from a recording and put into the stub.

How the estimate wanders differs from flight to flight, and the vehicle follows it. With the recorded errors the stub is
judged by how it flies, not by which errors its dice threw.
"""

import math
from dataclasses import dataclass

import numpy as np

from sitl_stub.fidelity.flight import Angles, Array, Track
from sitl_stub.fidelity.motion import signal_at
from sitl_stub.truth import Vector
from sitl_stub.vehicle.body import Body
from sitl_stub.vehicle.config import EstimatorParameters
from sitl_stub.vehicle.estimator import Estimate, Estimator

DOWN_RATE_WINDOW = 0.3
"""The height error's derivative is taken over this time [s], centred: it is recorded to 1 mm only."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimateErrors:
    """Estimate minus truth over time."""

    t: Array
    """Boot time [s], shape (n,)."""
    values: Array
    """Position [m], velocity [m/s], derivative of the down error [m/s], roll, pitch, yaw [rad]; ned, shape (n, 10)."""

    def at(self, t: float) -> list[float]:
        """Interpolate at boot time `t` [s]; the first or last value outside."""
        i = int(np.searchsorted(self.t, t))
        if i == 0 or i == len(self.t):
            return [float(value) for value in self.values[min(i, len(self.t) - 1)]]
        share = (t - self.t[i - 1]) / (self.t[i] - self.t[i - 1])
        return [float(value) for value in self.values[i - 1] + share * (self.values[i] - self.values[i - 1])]


def recorded_errors(truth: Track, estimate: Track, attitude: Angles, true_attitude: Angles) -> EstimateErrors:
    """Subtract the truth from the estimate; that their origins are some centimetres apart is part of the error."""
    t = estimate.t

    position = estimate.position - signal_at(truth.t, truth.position, t)
    velocity = estimate.velocity - signal_at(truth.t, truth.velocity, t)
    half = 0.5 * DOWN_RATE_WINDOW
    ahead, behind = np.interp(t + half, t, position[:, 2]), np.interp(t - half, t, position[:, 2])
    believed = np.unwrap(attitude.roll_pitch_yaw, axis=0)
    at_truth = signal_at(attitude.t, believed, true_attitude.t)
    turned = np.angle(np.exp(1j * (at_truth - true_attitude.roll_pitch_yaw)))
    angles = signal_at(true_attitude.t, turned, t)
    rate = (ahead - behind) / DOWN_RATE_WINDOW
    return EstimateErrors(t=t, values=np.column_stack([position, velocity, rate, angles]))


def euler_angles(quaternions: Array) -> Array:
    """Roll, pitch, yaw [rad], shape (n, 3), of attitudes (w, x, y, z), shape (n, 4)."""
    w, x, y, z = quaternions.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=1)


class RecordedEstimator(Estimator):
    """Makes the estimate from the truth and recorded errors. Writes to `estimate`, which others hold."""

    __slots__ = ("_recorded", "_t")

    def __init__(
        self,
        parameters: EstimatorParameters,
        body: Body,
        errors: EstimateErrors,
        *,
        estimate: Estimate,
        t: float,
    ) -> None:
        self._recorded, self._t = errors, t
        super().__init__(parameters, body, np.random.default_rng(0))
        self.estimate = estimate

    def step(self, dt: float, body: Body) -> Estimate:
        """Advance by `dt` [s] and return the (same, updated) estimate of the body's state."""
        self._t += dt
        p0, p1, p2, v0, v1, v2, rate, roll, pitch, yaw = self._recorded.at(self._t)
        angles: Vector = (roll, pitch, math.remainder(yaw, 2.0 * math.pi))
        self.impose(body, (p0, p1, p2), (v0, v1, v2), rate, angles)
        return self.estimate
