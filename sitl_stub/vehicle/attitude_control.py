"""Attitude and rates: from an attitude setpoint to four rotor commands, as PX4 v1.17 does."""

import math
from collections.abc import Mapping

from sitl_stub.truth import Quaternion, Vector
from sitl_stub.vehicle.mixer import Mixer

RATE_ERROR_CUTOFF = math.radians(400.0)
"""The integrators learn less the larger the rate error [rad/s]."""
DERIVATIVE_CUTOFF = 20.0
"""Low-pass of the angular acceleration [Hz] (IMU_DGYRO_CUTOFF)."""


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(a: Quaternion) -> Quaternion:
    """Inverse of a unit quaternion."""
    return (a[0], -a[1], -a[2], -a[3])


class AttitudeController:
    """Quaternion P control that turns the thrust direction first and the heading with less weight."""

    __slots__ = ("gain", "rate_max", "yaw_weight")

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over gains from the autopilot's parameters."""
        self.yaw_weight = max(0.0, min(1.0, parameters["MC_YAW_WEIGHT"]))
        yaw = parameters["MC_YAW_P"] / self.yaw_weight if self.yaw_weight > 1e-4 else parameters["MC_YAW_P"]
        self.gain = (parameters["MC_ROLL_P"], parameters["MC_PITCH_P"], yaw)
        self.rate_max = tuple(math.radians(parameters[f"MC_{axis}RATE_MAX"]) for axis in ("ROLL", "PITCH", "YAW"))

    def update(self, attitude: Quaternion, wanted: Quaternion, yaw_rate: float) -> Vector:
        """Turn rate setpoint [rad/s], frd, with `yaw_rate` [rad/s] about the vertical fed forward."""
        w, x, y, z = attitude
        d, e, f, g = wanted
        # thrust axes: third columns of the rotation matrices
        a0, a1, a2 = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
        b0, b1, b2 = 2.0 * (e * g + d * f), 2.0 * (f * g - d * e), 1.0 - 2.0 * (e * e + f * f)
        tilt = _between((a0, a1, a2), (b0, b1, b2))
        reduced = wanted if tilt is None else multiply(tilt, attitude)
        turn = multiply(conjugate(reduced), wanted)
        sign = 1.0 if turn[0] >= 0.0 else -1.0
        cosine, sine = max(-1.0, min(1.0, turn[0] * sign)), max(-1.0, min(1.0, turn[3] * sign))
        weight = self.yaw_weight
        goal = multiply(reduced, (math.cos(weight * math.acos(cosine)), 0.0, 0.0, math.sin(weight * math.asin(sine))))
        error = multiply(conjugate(attitude), goal)
        scale = 2.0 if error[0] >= 0.0 else -2.0
        gain, limit = self.gain, self.rate_max
        # the vertical in frd is the third row of the rotation matrix
        p = scale * error[1] * gain[0] + 2.0 * (x * z - w * y) * yaw_rate
        q = scale * error[2] * gain[1] + 2.0 * (y * z + w * x) * yaw_rate
        r = scale * error[3] * gain[2] + a2 * yaw_rate
        return (
            max(-limit[0], min(limit[0], p)),
            max(-limit[1], min(limit[1], q)),
            max(-limit[2], min(limit[2], r)),
        )


def _between(a: Vector, b: Vector) -> Quaternion | None:
    """Shortest rotation from direction a to direction b, in the frame of both; None when they are opposite."""
    dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    if dot < -1.0 + 1e-5:
        return None
    w = 1.0 + dot
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return (w * scale, x * scale, y * scale, z * scale)


class RateController:
    """PID on turn rates with saturation-aware integrators, in front of the rotor mixer."""

    __slots__ = (
        "_acceleration",
        "_gain_d",
        "_gain_i",
        "_gain_p",
        "_last",
        "_limit",
        "_mixer",
        "_yaw_torque",
        "integral",
    )

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.integral = [0.0, 0.0, 0.0]
        self._acceleration = [0.0, 0.0, 0.0]
        self._last: Vector = (0.0, 0.0, 0.0)
        self._mixer = Mixer()
        self._yaw_torque = 0.0
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over gains from the autopilot's parameters."""
        axes = ("ROLL", "PITCH", "YAW")
        self._gain_p = tuple(parameters[f"MC_{axis}RATE_P"] for axis in axes)
        self._gain_i = tuple(parameters[f"MC_{axis}RATE_I"] for axis in axes)
        self._gain_d = tuple(parameters[f"MC_{axis}RATE_D"] for axis in axes)
        self._limit = tuple(parameters[f"MC_{name}_INT_LIM"] for name in ("RR", "PR", "YR"))

    def reset(self) -> None:
        """Forget the integrals (disarmed)."""
        self.integral = [0.0, 0.0, 0.0]

    def update(self, rates: Vector, wanted: Vector, thrust: float, *, dt: float, landed: bool) -> list[float]:
        """Rotor commands 0 to 1, from turn rates [rad/s] measured and wanted and the collective thrust 0 to 1."""
        smooth = dt / (dt + 1.0 / (2.0 * math.pi * DERIVATIVE_CUTOFF))
        torque = [0.0, 0.0, 0.0]
        for i in range(3):
            rate = rates[i]
            self._acceleration[i] += ((rate - self._last[i]) / dt - self._acceleration[i]) * smooth
            error = wanted[i] - rate
            torque[i] = self._gain_p[i] * error + self.integral[i] - self._gain_d[i] * self._acceleration[i]
            if not landed:
                self._integrate(i, error, dt)
        self._last = rates
        # MC_YAW_TQ_CUTOFF: 2 Hz low-pass on the yaw torque
        self._yaw_torque += (torque[2] - self._yaw_torque) * dt / (dt + 1.0 / (4.0 * math.pi))
        return self._mixer.mix(torque[0], torque[1], self._yaw_torque, thrust)

    def _integrate(self, axis: int, error: float, dt: float) -> None:
        saturated = self._mixer.saturated[axis]
        if saturated > 0:
            error = min(error, 0.0)
        elif saturated < 0:
            error = max(error, 0.0)
        factor = error / RATE_ERROR_CUTOFF
        learned = self.integral[axis] + max(0.0, 1.0 - factor * factor) * self._gain_i[axis] * error * dt
        limit = self._limit[axis]
        self.integral[axis] = max(-limit, min(limit, learned))
