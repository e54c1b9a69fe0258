"""From ODOMETRY to OwnshipState."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt

from companion.geometry.quaternions import Rows, Triple, rotation_rows
from companion.link.incoming import Odometry
from companion.messages.ownship import OwnshipState

_LOCAL_NED = 1
_BODY_FRAMES = (8, 12)  # MAV_FRAME_BODY_NED as older senders use it, and MAV_FRAME_BODY_FRD


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryParameters:
    """Tuning of the ownship state."""

    acceleration_time_constant: Annotated[float, Gt(0.0)] = 0.06  # [s] low pass on the differences of the velocity
    longest_gap: Annotated[float, Gt(0.0)] = 0.2  # [s] over a longer gap no acceleration is formed
    quaternion_tolerance: Annotated[float, Gt(0.0)] = 0.01  # |norm - 1| of a usable attitude
    largest_number: Annotated[float, Gt(0.0)] = 1.0e6  # [m, m/s, rad/s] larger is nonsense


class OwnshipBuilder:
    """Turns odometry into ownship states; keeps the last velocity, from which the acceleration is formed.

    a <- a + (1 - exp(-dt / tau)) ((v - v_last) / dt - a),   dt by the autopilot's own stamps.
    """

    def __init__(self, parameters: OdometryParameters) -> None:
        self._parameters = parameters
        self._time_usec: int | None = None
        self._velocity: Triple = (0.0, 0.0, 0.0)
        self._acceleration: Triple = (0.0, 0.0, 0.0)
        self._reset_counter = 0
        self.invalid = 0  # not finite, no attitude, or a frame without north
        self.stale = 0  # not newer than the one before

    def restarted(self, odometry: Odometry) -> bool:
        """Tell whether the autopilot's clock went back by more than any reordering explains."""
        return self._time_usec is not None and odometry.time_usec < self._time_usec - 1_000_000

    def forget(self) -> None:
        """Start anew: the autopilot has restarted."""
        self._time_usec = None

    def take(self, odometry: Odometry, t: float) -> OwnshipState | None:
        """Give the state valid at `t` [s], or None for a message that is not usable or not newer."""
        rotation = self._rotation(odometry)
        if rotation is None:
            self.invalid += 1
            return None
        if self._time_usec is not None and odometry.time_usec <= self._time_usec:
            self.stale += 1
            return None
        velocity = odometry.numbers[7:10]
        if odometry.child_frame in _BODY_FRAMES:
            velocity = _rotate(rotation, velocity)
        else:
            velocity = (velocity[0], velocity[1], velocity[2])
        self._update_acceleration(odometry, velocity)
        return OwnshipState(
            t=t,
            position_ned=np.array(odometry.numbers[0:3]),
            velocity_ned=np.array(velocity),
            acceleration_ned=np.array(self._acceleration),
            ned_from_frd=np.array(rotation),
            angular_velocity_frd=np.array(odometry.numbers[10:13]),
            reset_counter=odometry.reset_counter,
        )

    def _rotation(self, odometry: Odometry) -> Rows | None:
        """Give ned_from_frd, or None where the message is not usable."""
        if odometry.frame != _LOCAL_NED or odometry.child_frame not in (_LOCAL_NED, *_BODY_FRAMES):
            return None
        limit = self._parameters.largest_number
        for number in odometry.numbers:
            if not -limit <= number <= limit:  # false for NaN
                return None
        w, x, y, z = odometry.numbers[3:7]
        norm = math.sqrt(w * w + x * x + y * y + z * z)
        if abs(norm - 1.0) > self._parameters.quaternion_tolerance:
            return None
        return rotation_rows((w / norm, x / norm, y / norm, z / norm))

    def _update_acceleration(self, odometry: Odometry, velocity: Triple) -> None:
        before = self._time_usec
        dt = math.inf if before is None else (odometry.time_usec - before) * 1e-6
        if dt > self._parameters.longest_gap:
            self._acceleration = (0.0, 0.0, 0.0)
        elif odometry.reset_counter == self._reset_counter:
            gain = 1.0 - math.exp(-dt / self._parameters.acceleration_time_constant)
            a, last = self._acceleration, self._velocity
            self._acceleration = (
                a[0] + gain * ((velocity[0] - last[0]) / dt - a[0]),
                a[1] + gain * ((velocity[1] - last[1]) / dt - a[1]),
                a[2] + gain * ((velocity[2] - last[2]) / dt - a[2]),
            )
        self._time_usec = odometry.time_usec
        self._velocity = velocity
        self._reset_counter = odometry.reset_counter


def _rotate(rotation: tuple[Triple, Triple, Triple], v: tuple[float, ...]) -> Triple:
    a, b, c = rotation
    return (
        a[0] * v[0] + a[1] * v[1] + a[2] * v[2],
        b[0] * v[0] + b[1] * v[1] + b[2] * v[2],
        c[0] * v[0] + c[1] * v[1] + c[2] * v[2],
    )
