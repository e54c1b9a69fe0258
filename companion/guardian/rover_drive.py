"""Setpoints of a rover: the sticks of PX4's ACRO mode, behind limits of speed, acceleration and turning.

The command is a speed along the heading and a yaw rate. Its stop is at hand at any time: the speed falls to zero at the
limit of the acceleration, along the arc that is being driven, in v^2 / 2a. A speed from which that stop would leave
the fence, or close in on the target too fast, is never commanded.
"""

from __future__ import annotations

import math

from companion.control.drive import STOOD, DriveState, drive
from companion.guardian.limiter import Reference, Target
from companion.guardian.motion import TOLERANCE, Vector
from companion.guardian.shaping import Tick
from companion.messages.motion import SticksSetpoint
from companion.messages.ownship import FlightMode
from companion.vehicles.rover import RoverParameters

_CREEP = 0.02  # [m/s] a slower reference means: stand


class RoverShaper:
    """Holds the command.

    Args:
        parameters: of the vehicle.
    """

    mode = FlightMode.ACRO

    def __init__(self, parameters: RoverParameters) -> None:
        self._p = parameters
        self._speed: float | None = None  # [m/s] commanded; None: nothing is
        self._yaw_rate = 0.0  # [rad/s] commanded
        self._rate = 0.0  # [m/s^2] at which the speed has just changed
        self._bias: Vector = (0.0, 0.0, 0.0)  # [m/s] of the autopilot's velocity estimate
        self._drive: DriveState = STOOD

    @property
    def empty(self) -> bool:
        """Whether nothing is commanded yet."""
        return self._speed is None

    def clear(self) -> None:
        """Forget the command."""
        self._speed, self._yaw_rate, self._rate = None, 0.0, 0.0
        self._bias, self._drive = (0.0, 0.0, 0.0), STOOD

    def hold(self, tick: Tick) -> None:  # noqa: ARG002  # the interface's
        """Command to stay here."""
        self.clear()
        self._speed = 0.0

    def follow(self, tick: Tick, reference: Reference, target: Target | None) -> tuple[str, ...]:
        """Move the command on towards a reference; give the names of the limits that changed it."""
        p, clips = self._p, []
        heading, velocity = reference.heading, reference.motion.velocity
        speed = math.cos(heading.yaw) * velocity[0] + math.sin(heading.yaw) * velocity[1]
        if abs(speed) < _CREEP:
            speed = 0.0
        curvature = heading.rate / speed if speed else 0.0
        if not -p.speed_reverse * TOLERANCE <= speed <= p.speed_forward * TOLERANCE:
            clips.append("speed")
            speed = max(-p.speed_reverse, min(p.speed_forward, speed))
        if abs(curvature) * p.turning_radius > TOLERANCE:
            clips.append("turning_radius")
            curvature = math.copysign(1.0 / p.turning_radius, curvature)
        slower = self._not_closing(speed, tick, target)
        if slower != speed:
            clips.append("closing_speed")
        inside = self._inside_fence(slower, tick)
        if inside != slower:
            clips.append("fence")
        self._bias = _within(reference.feedback_velocity, tick.parameters.feedback_velocity_max)
        return (*clips, *self._move(inside, curvature, tick.dt))

    def brake(self, tick: Tick) -> tuple[str, ...]:
        """Move the command on along the stop at hand, on the arc that is being driven."""
        speed = self._speed or 0.0
        self._move(0.0, self._yaw_rate / speed if speed else 0.0, tick.dt)
        return ()

    def rebase(self, offset: Vector, turn: float, elapsed: float) -> None:
        """Follow a reset of the estimate: the command holds no place and no heading."""

    def setpoint(self, tick: Tick) -> SticksSetpoint | None:
        """Give what is to be sent now; without a fresh own speed, by the drive train's model alone."""
        if self._speed is None:
            return None
        measured = self._speed
        if tick.fresh and tick.ownship is not None:
            north, east, _ = tick.ownship.velocity_ned.tolist()
            yaw = tick.ownship.yaw
            measured = math.cos(yaw) * (north - self._bias[0]) + math.sin(yaw) * (east - self._bias[1])
        self._drive, sticks = drive(
            self._drive,
            speed=self._speed,
            acceleration=self._rate,
            curvature=self._yaw_rate / self._speed if self._speed else 0.0,
            measured=measured,
            dt=min(max(tick.dt, 0.0), 0.1),
            parameters=self._p.drive,
        )
        return SticksSetpoint(
            t=tick.t, speed=self._speed, yaw_rate=self._yaw_rate, throttle=sticks.throttle, steering=sticks.steering
        )

    def _move(self, speed: float, curvature: float, dt: float) -> tuple[str, ...]:
        """Bring speed [m/s] and curvature [1/m] as near to those wanted as the accelerations allow in `dt` [s]."""
        p, now, clips = self._p, self._speed or 0.0, []
        step = p.acceleration * dt
        if abs(speed - now) > step * TOLERANCE:
            clips.append("acceleration")
            speed = max(now - step, min(now + step, speed))
        wanted = curvature * speed
        most = min(p.yaw_rate, abs(speed) / p.turning_radius)
        turn = max(-most, min(most, wanted))
        swing = p.yaw_acceleration * dt
        if abs(turn - self._yaw_rate) > swing * TOLERANCE:
            clips.append("yaw_acceleration")
            turn = max(self._yaw_rate - swing, min(self._yaw_rate + swing, turn))
        elif abs(turn - wanted) > 1e-9:
            clips.append("yaw_rate")
        self._rate = (speed - now) / dt if dt > 0.0 else 0.0
        # the smallest circle comes before the yaw acceleration: it cannot turn while it stands
        self._speed, self._yaw_rate = speed, max(-most, min(most, turn))
        return tuple(clips)

    def _not_closing(self, speed: float, tick: Tick, target: Target | None) -> float:
        """Take away what of a speed [m/s] closes in on the target too fast for the way that is left to brake on.

        With c the limit, a the acceleration and d the distance beyond `closing_within`, that is sqrt(c^2 + a d): else a
        target that comes by itself at c would forbid to set off, however far away it is and wherever it drives past.
        """
        if target is None or tick.ownship is None:
            return speed
        north, east = target.position[0] - tick.here[0], target.position[1] - tick.here[1]
        distance = math.hypot(north, east)
        if distance < tick.parameters.closing_range:
            return speed
        ahead = (math.cos(tick.yaw) * north + math.sin(tick.yaw) * east) / distance
        away = (target.velocity[0] * north + target.velocity[1] * east) / distance
        limit = min(self._p.closing_speed, tick.parameters.closing_speed)
        most = math.sqrt(limit * limit + self._p.acceleration * max(distance - self._p.closing_within, 0.0)) + away
        if ahead * speed <= most * TOLERANCE or abs(ahead) < 0.1:
            return speed
        return math.copysign(max(most, 0.0) / abs(ahead), speed)

    def _inside_fence(self, speed: float, tick: Tick) -> float:
        """Give the speed [m/s], or 0 where the stop from it would lead further out of the fence than the vehicle is."""
        if speed == 0.0:
            return 0.0
        fence = tick.parameters.fence
        way = math.copysign(speed * speed / (2.0 * self._p.acceleration) + 0.3 * abs(speed), speed)
        north, east, down = tick.here
        end = (north + way * math.cos(tick.yaw), east + way * math.sin(tick.yaw), down)
        outside = fence.excess(end, fence.margin)
        if outside <= 0.0 or outside <= fence.excess(tick.here, fence.margin):
            return speed
        return 0.0


def _within(vector: Vector, limit: float) -> Vector:
    north, east, down = (max(-limit, min(limit, x)) for x in vector)
    return north, east, down
