"""Rover as a rigid body on a plane: bicycle model with tyre slip, friction that holds at rest, lag of the actuators.

Longitudinal, as PX4's SIH rover: m du/dt = thrust - friction - drag + m v r, where friction holds up to its static
value at rest. Lateral, the linear bicycle model (Rajamani, Vehicle Dynamics and Control, 2nd ed., section 2.3); slip is
against the direction of travel so that the car turns the other way when it reverses:

    slip_front = steer u/|u| - (v + a r) / |u|        slip_rear = -(v - b r) / |u|
    m (dv/dt + u r) = C slip_front + C slip_rear
    I dr/dt = a C slip_front - b C slip_rear - damping r

u and v are forward and right speed, r the yaw rate, a and b the axles' distances. At low speed the tyres become
constraints; v and r are therefore stepped by the implicit Euler method.
"""

import math

from sitl_stub.truth import GROUND, Vector
from sitl_stub.vehicle.body import SurfaceUnder
from sitl_stub.vehicle.body_state import LevelBody
from sitl_stub.vehicle.rigid_body import GRAVITY
from sitl_stub.vehicle.rover.config import RoverBodyParameters

REST_SPEED, CREEPING_SPEED = 0.01, 0.05
"""Below these speeds [m/s] static friction holds and creeping friction brakes (SIH's thresholds)."""
STEP_HEIGHT = 0.05
"""A surface higher or lower than the present one by more [m] is not driven onto."""
WHEELS = 4
STEERING, THROTTLE = 0, 1
"""Places in the list of commands, each -1 to 1."""


class Wheels:
    """What the wheels stand on: they never leave the ground."""

    __slots__ = ("surface",)
    count = WHEELS

    def __init__(self) -> None:
        self.surface = GROUND


class RoverBody(LevelBody):
    """State of the rover."""

    __slots__ = ("_body", "_forward", "_right", "gear", "steering", "throttle")

    def __init__(self, body: RoverBodyParameters, *, heading: float) -> None:
        super().__init__(height=body.body_height_m, heading=heading)
        self._body = body
        self._forward = self._right = 0.0
        self.gear = Wheels()
        self.steering = self.throttle = 0.0
        """Actuators behind their lag, -1 to 1."""

    @property
    def speed(self) -> float:
        """Speed along the body [m/s], below zero in reverse."""
        return self._forward

    def step(self, dt: float, commands: list[float], wind: Vector, surface_under: SurfaceUnder) -> None:
        """Advance by `dt` [s] with (steering right, throttle) from -1 to 1.

        `wind` is the air's velocity [m/s], ned. A surface that moves carries the rover along.
        """
        body = self._body
        share = min(1.0, dt / body.actuator_time_constant_s)
        self.steering += share * (_unit(commands[STEERING]) - self.steering)
        self.throttle += share * (_unit(commands[THROTTLE]) - self.throttle)
        carried, turned = self._stand(surface_under)
        cosine, sine = self.rotation[0], self.rotation[3]
        headwind = self.speed + cosine * (carried[0] - wind[0]) + sine * (carried[1] - wind[1])
        self._drive(dt, headwind)
        self._steer(dt)
        self._face(self.heading + (self.r + turned) * dt)
        before = self.velocity
        cosine, sine = self.rotation[0], self.rotation[3]
        self.v_north = cosine * self._forward - sine * self._right + carried[0]
        self.v_east = sine * self._forward + cosine * self._right + carried[1]
        self.north += self.v_north * dt
        self.east += self.v_east * dt
        self.acceleration = ((self.v_north - before[0]) / dt, (self.v_east - before[1]) / dt, 0.0)

    def _stand(self, surface_under: SurfaceUnder) -> tuple[Vector, float]:
        """Follow the surface below; returns its velocity [m/s], ned, and yaw rate [rad/s]."""
        level, name, moving, turning = surface_under(self.north, self.east)
        if abs(level - (self.down + self._body.body_height_m)) > STEP_HEIGHT:
            level, name, moving, turning = 0.0, GROUND, (0.0, 0.0, 0.0), 0.0
        self.down = level - self._body.body_height_m
        self.gear.surface = name
        return moving, turning

    def _drive(self, dt: float, headwind: float) -> None:
        """Step the forward speed under thrust, friction and drag."""
        body, speed = self._body, self._forward
        push = body.thrust_max_n * self.throttle - body.air_drag_n_per_mps2 * headwind * abs(headwind)
        push += body.mass_kg * self._right * self.r
        if abs(speed) < REST_SPEED and abs(push) <= body.static_friction_n:
            self._forward = 0.0
            return
        if abs(speed) < CREEPING_SPEED:
            resistance = body.creeping_friction_n
        else:
            resistance = body.rolling_friction_n + body.rolling_drag_n_per_mps2 * speed * speed
        along = math.copysign(1.0, speed if speed else push)
        after = speed + (push - along * resistance) / body.mass_kg * dt
        stopped = after * along < 0.0 and abs(push) <= body.static_friction_n
        self._forward = 0.0 if stopped else after

    def _steer(self, dt: float) -> None:
        """Step side speed and yaw rate: two linear equations, solved at the end of the step."""
        body, u, v, r = self._body, self._forward, self._right, self.r
        a, b, mass, inertia = body.front_axle_m, body.rear_axle_m, body.mass_kg, body.yaw_inertia_kg_m2
        speed = max(abs(u), CREEPING_SPEED)
        steer = math.radians(body.steering_angle_max_deg) * self.steering * u / speed
        load = mass * GRAVITY / (a + b)
        front = self._stiffness(steer - (v + a * r) / speed, load * b)
        rear = self._stiffness(-(v - b * r) / speed, load * a)
        vv = mass / dt + (front + rear) / speed
        vr = (a * front - b * rear) / speed
        rr = inertia / dt + (a * a * front + b * b * rear) / speed + body.yaw_damping_nm_per_radps
        side = mass / dt * v + front * steer
        turn = inertia / dt * r + a * front * steer
        determinant = vv * rr - vr * (vr + mass * u)
        self._right = (side * rr - (vr + mass * u) * turn) / determinant
        self.r = (vv * turn - vr * side) / determinant

    def _stiffness(self, slip: float, load: float) -> float:
        """Cornering stiffness [N/rad] of an axle, lowered where its side force would exceed its grip."""
        stiffness, most = self._body.cornering_stiffness_n_per_rad, self._body.grip * load
        force = stiffness * abs(slip)
        return stiffness if force <= most else most / abs(slip)


def _unit(command: float) -> float:
    return max(-1.0, min(1.0, command))
