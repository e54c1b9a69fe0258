"""Position and velocity controller: from a trajectory setpoint to thrust and attitude, as PX4's mc_pos_control does.

NaN in a setpoint means "not controlled". Structure and defaults follow PX4 v1.17 (PositionControl, ControlMath).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sitl_stub.truth import Quaternion, Vector
from sitl_stub.vehicle.rigid_body import GRAVITY

NAN = math.nan
NOTHING: Vector = (NAN, NAN, NAN)
THRUST_MIN_VECTOR = 1e-3
"""Thrust never falls below this, so that its direction stays defined."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectorySetpoint:
    """What the position controller shall do; NaN: this quantity is free."""

    position: Vector = NOTHING
    velocity: Vector = NOTHING
    acceleration: Vector = NOTHING
    yaw: float = NAN
    yaw_rate: float = NAN


NO_SETPOINT = TrajectorySetpoint()
NO_THRUST = TrajectorySetpoint(acceleration=(0.0, 0.0, 100.0))
"""PX4's way to keep the motors at idle on the ground: a strong downward acceleration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityLimits:
    """Speeds [m/s] the controller may ask for; `up` may be negative during the take-off ramp."""

    horizontal: float
    up: float
    down: float


class PositionController:
    """P on position, PID on velocity with feed-forward, thrust vector to attitude. Holds the velocity integral."""

    __slots__ = (
        "acceleration",
        "attitude",
        "gain_position",
        "gain_velocity_d",
        "gain_velocity_i",
        "gain_velocity_p",
        "hover_thrust",
        "integral",
        "thrust",
        "thrust_margin_xy",
        "thrust_vector",
        "velocity",
        "yaw",
        "yaw_rate",
    )

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.integral = [0.0, 0.0, 0.0]
        self.hover_thrust = float(parameters["MPC_THR_HOVER"])
        self.velocity: Vector = NOTHING
        self.acceleration: Vector = NOTHING
        self.thrust_vector: Vector = (0.0, 0.0, 0.0)
        self.attitude: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self.thrust = 0.0
        self.yaw = self.yaw_rate = 0.0
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over gains from the autopilot's parameters."""
        xy, z = parameters["MPC_XY_P"], parameters["MPC_Z_P"]
        self.gain_position = (xy, xy, z)
        self.gain_velocity_p = _gains(parameters, "P")
        self.gain_velocity_i = _gains(parameters, "I")
        self.gain_velocity_d = _gains(parameters, "D")
        self.thrust_margin_xy = parameters["MPC_THR_XY_MARG"]

    def set_hover_thrust(self, hover_thrust: float) -> None:
        """Change the hover thrust without a jump of the output: the vertical integral takes up the difference."""
        previous, self.hover_thrust = self.hover_thrust, hover_thrust
        wanted = self.acceleration[2]
        if math.isfinite(wanted):
            self.integral[2] += (wanted - GRAVITY) * previous / hover_thrust + GRAVITY - wanted

    def update(
        self,
        setpoint: TrajectorySetpoint,
        position: Vector,
        velocity: Vector,
        velocity_rate: Vector,
        yaw: float,
        *,
        limits: VelocityLimits,
        tilt_max: float,
        thrust_min: float,
        thrust_max: float,
        dt: float,
    ) -> bool:
        """One step of `dt` [s]; False, and nothing changed, when the setpoint is not flyable.

        Not flyable: an axis without any setpoint, or x and y not both set or both free (PositionControl::_inputValid).
        """
        if not _flyable(setpoint):
            return False
        self._position_step(setpoint, position, limits)
        self._velocity_step(
            setpoint, velocity, velocity_rate, tilt_max, max(thrust_min, THRUST_MIN_VECTOR), thrust_max, dt
        )
        self.yaw = setpoint.yaw if math.isfinite(setpoint.yaw) else yaw
        self.yaw_rate = setpoint.yaw_rate if math.isfinite(setpoint.yaw_rate) else 0.0
        self.attitude = attitude_of_thrust(self.thrust_vector, self.yaw)
        t0, t1, t2 = self.thrust_vector
        self.thrust = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        return True

    def _position_step(self, setpoint: TrajectorySetpoint, position: Vector, limits: VelocityLimits) -> None:
        """Feed-forward velocity plus P on the position error; position has priority within the speed limit."""
        wanted, feed = setpoint.position, setpoint.velocity
        gain = self.gain_position
        total, from_position = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        for i in range(3):
            part = (wanted[i] - position[i]) * gain[i]
            known, forward = part == part, feed[i] == feed[i]
            from_position[i] = part if known else 0.0
            total[i] = (part if known else 0.0) + (feed[i] if forward else 0.0) if known or forward else NAN
        x, y = total[0], total[1]
        if x == x and y == y:
            x, y = limit_horizontal(
                from_position[0], from_position[1], x - from_position[0], y - from_position[1], limits.horizontal
            )
        z = total[2]
        if z == z:
            z = max(-limits.up, min(limits.down, z))
        self.velocity = (x, y, z)

    def _velocity_step(
        self,
        setpoint: TrajectorySetpoint,
        velocity: Vector,
        rate: Vector,
        tilt_max: float,
        thrust_min: float,
        thrust_max: float,
        dt: float,
    ) -> None:
        integral, wanted, feed = self.integral, self.velocity, setpoint.acceleration
        integral[2] = max(-GRAVITY, min(GRAVITY, integral[2]))
        errors, acceleration = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        for i in range(3):
            error = errors[i] = wanted[i] - velocity[i]
            correction = error * self.gain_velocity_p[i] + integral[i] - rate[i] * self.gain_velocity_d[i]
            forward = feed[i]
            if forward == forward:
                acceleration[i] = forward + correction if correction == correction else forward
            else:
                acceleration[i] = correction
        self.acceleration = (acceleration[0], acceleration[1], acceleration[2])
        t0, t1, t2 = self._thrust_of(self.acceleration, tilt_max, thrust_min)
        if (t2 >= -thrust_min and errors[2] >= 0.0) or (t2 <= -thrust_max and errors[2] <= 0.0):
            errors[2] = 0.0
        t0, t1, t2 = saturate(t0, t1, t2, thrust_max, self.thrust_margin_xy)
        self.thrust_vector = (t0, t1, t2)
        # tracking anti-windup: while saturated the horizontal integral follows what was produced
        made0, made1 = t0 * GRAVITY / self.hover_thrust, t1 * GRAVITY / self.hover_thrust
        a0, a1 = acceleration[0], acceleration[1]
        if a0 * a0 + a1 * a1 > made0 * made0 + made1 * made1:
            anti = 2.0 / self.gain_velocity_p[0]
            errors[0] -= anti * (a0 - made0)
            errors[1] -= anti * (a1 - made1)
        for i in range(3):
            if errors[i] == errors[i]:
                integral[i] += errors[i] * self.gain_velocity_i[i] * dt

    def _thrust_of(self, acceleration: Vector, tilt_max: float, thrust_min: float) -> Vector:
        """Thrust vector, ned, 1 is full throttle: direction from the horizontal, length from the vertical part."""
        a0, a1, a2 = acceleration
        norm = math.sqrt(a0 * a0 + a1 * a1 + GRAVITY * GRAVITY)
        b0, b1, b2 = -a0 / norm, -a1 / norm, GRAVITY / norm
        if math.acos(min(1.0, b2)) > tilt_max:
            side = math.sqrt(b0 * b0 + b1 * b1)
            scale = math.sin(tilt_max) / side
            b0, b1, b2 = b0 * scale, b1 * scale, math.cos(tilt_max)
        vertical = a2 * (self.hover_thrust / GRAVITY) - self.hover_thrust
        collective = min(vertical / b2, -thrust_min)
        return (b0 * collective, b1 * collective, b2 * collective)


def _gains(parameters: Mapping[str, float], letter: str) -> Vector:
    xy, z = parameters[f"MPC_XY_VEL_{letter}_ACC"], parameters[f"MPC_Z_VEL_{letter}_ACC"]
    return (xy, xy, z)


def _flyable(setpoint: TrajectorySetpoint) -> bool:
    finite = math.isfinite
    position, velocity, acceleration = setpoint.position, setpoint.velocity, setpoint.acceleration
    for i in range(3):
        if not (finite(position[i]) or finite(velocity[i]) or finite(acceleration[i])):
            return False
    # infinities never pass PX4's final check of the output
    if math.inf in map(abs, (*position, *velocity, *acceleration)):
        return False
    return (
        finite(position[0]) == finite(position[1])
        and finite(velocity[0]) == finite(velocity[1])
        and finite(acceleration[0]) == finite(acceleration[1])
    )


def limit_horizontal(p0: float, p1: float, f0: float, f1: float, limit: float) -> tuple[float, float]:
    """Sum of (p0, p1) and (f0, f1), cut to length `limit`; the first vector has priority (ControlMath::constrainXY)."""
    x, y = p0 + f0, p1 + f1
    if x * x + y * y <= limit * limit:
        return x, y
    first = math.hypot(p0, p1)
    second = math.hypot(f0, f1)
    if first >= limit:
        return p0 / first * limit, p1 / first * limit
    if math.hypot(f0 - p0, f1 - p1) < 1e-3:
        return p0 / first * limit, p1 / first * limit
    if first < 1e-3:
        return f0 / second * limit, f1 / second * limit
    u0, u1 = f0 / second, f1 / second
    along = u0 * p0 + u1 * p1
    scale = -along + math.sqrt(max(0.0, along * along - (first * first - limit * limit)))
    return p0 + u0 * scale, p1 + u1 * scale


def saturate(t0: float, t1: float, t2: float, thrust_max: float, margin: float) -> Vector:
    """Cut a thrust vector to `thrust_max`: the vertical part first, but leaving `margin` for the horizontal one."""
    horizontal = math.hypot(t0, t1)
    reserved = min(horizontal, margin)
    t2 = max(t2, -math.sqrt(thrust_max * thrust_max - reserved * reserved))
    left = math.sqrt(max(0.0, thrust_max * thrust_max - t2 * t2))
    if horizontal > left:
        t0, t1 = t0 / horizontal * left, t1 / horizontal * left
    return (t0, t1, t2)


def attitude_of_thrust(thrust: Vector, yaw: float) -> Quaternion:
    """Attitude ned_from_frd whose -z is the thrust direction and whose x points as near to `yaw` [rad] as it can."""
    z0, z1, z2 = -thrust[0], -thrust[1], -thrust[2]
    norm = math.sqrt(z0 * z0 + z1 * z1 + z2 * z2)
    if norm < 1e-6:
        z0, z1, z2, norm = 0.0, 0.0, 1.0, 1.0
    z0, z1, z2 = z0 / norm, z1 / norm, z2 / norm
    c0, c1 = -math.sin(yaw), math.cos(yaw)
    # x = y_c cross z
    x0, x1, x2 = c1 * z2, -c0 * z2, c0 * z1 - c1 * z0
    norm = math.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    if norm < 1e-6:
        x0, x1, x2, norm = math.cos(yaw), math.sin(yaw), 0.0, 1.0
    x0, x1, x2 = x0 / norm, x1 / norm, x2 / norm
    y0, y1, y2 = z1 * x2 - z2 * x1, z2 * x0 - z0 * x2, z0 * x1 - z1 * x0
    return quaternion_of_axes((x0, x1, x2), (y0, y1, y2), (z0, z1, z2))


def quaternion_of_axes(x: Vector, y: Vector, z: Vector) -> Quaternion:
    """Quaternion of the rotation matrix with these columns."""
    trace = x[0] + y[1] + z[2]
    if trace > 0.0:
        s = 2.0 * math.sqrt(1.0 + trace)
        return (0.25 * s, (y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s)
    if x[0] >= y[1] and x[0] >= z[2]:
        s = 2.0 * math.sqrt(1.0 + x[0] - y[1] - z[2])
        return ((y[2] - z[1]) / s, 0.25 * s, (y[0] + x[1]) / s, (z[0] + x[2]) / s)
    if y[1] >= z[2]:
        s = 2.0 * math.sqrt(1.0 - x[0] + y[1] - z[2])
        return ((z[0] - x[2]) / s, (y[0] + x[1]) / s, 0.25 * s, (z[1] + y[2]) / s)
    s = 2.0 * math.sqrt(1.0 - x[0] - y[1] + z[2])
    return ((x[1] - y[0]) / s, (z[0] + x[2]) / s, (z[1] + y[2]) / s, 0.25 * s)
