"""Quadrotor X as a rigid body: rotor lag, drag in the wind, ground effect, feet on surfaces.

Scalar Python on purpose: numpy on vectors of three is several times slower in a 250 Hz loop.
"""

import math

from sitl_stub.truth import Vector
from sitl_stub.vehicle.body import SurfaceUnder
from sitl_stub.vehicle.body_state import BodyState
from sitl_stub.vehicle.config import BodyParameters, GearParameters
from sitl_stub.vehicle.gear import LandingGear

GRAVITY = 9.80665
"""Acceleration of free fall [m/s^2]."""

CONTACT_HEIGHT = 3.0
"""Below this height above the world's ground [m] the feet are checked against surfaces."""


class RigidBody(BodyState):
    """State of the vehicle's body; its origin is the centre of mass."""

    __slots__ = ("_body", "_lag_dt", "_lag_factor", "acceleration", "gear", "ground_clearance", "rotation", "thrusts")

    def __init__(self, body: BodyParameters, gear: GearParameters, *, heading: float) -> None:
        super().__init__()
        self._body = body
        self.gear = LandingGear(gear)
        self._lag_dt = 0.0
        self._lag_factor = 0.0
        sag = body.mass_kg * GRAVITY / (4.0 * gear.stiffness_n_per_m)
        self.down = -gear.foot_down_m + sag
        self.qw, self.qz = math.cos(heading / 2.0), math.sin(heading / 2.0)
        self.acceleration: Vector = (0.0, 0.0, 0.0)
        self.thrusts = [0.0, 0.0, 0.0, 0.0]
        self.rotation = self._rotation()
        self.ground_clearance = gear.foot_down_m

    def _rotation(self) -> tuple[float, ...]:
        w, x, y, z = self.qw, self.qx, self.qy, self.qz
        return (
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        )

    def step(self, dt: float, commands: list[float], wind: Vector, surface_under: SurfaceUnder) -> None:
        """Advance by `dt` [s] with rotor commands 0 to 1 (front right, rear left, front left, rear right).

        `wind` is the air's velocity [m/s], ned. In contact the step is halved, so that the feet's springs stay stable.
        """
        self._turn_rotors(dt, commands)
        near = self.down > -CONTACT_HEIGHT
        halves = 2 if near and self.gear.count else 1
        part = dt / halves
        v0, v1, v2 = self.v_north, self.v_east, self.v_down
        for _ in range(halves):
            self._integrate(part, wind, surface_under if near else None)
        self.acceleration = ((self.v_north - v0) / dt, (self.v_east - v1) / dt, (self.v_down - v2) / dt)

    def _turn_rotors(self, dt: float, commands: list[float]) -> None:
        if dt != self._lag_dt:
            self._lag_dt = dt
            self._lag_factor = 1.0 - math.exp(-dt / self._body.rotor_time_constant_s)
        full, factor = self._body.rotor_thrust_max_n, self._lag_factor
        thrusts = self.thrusts
        for i in range(4):
            thrusts[i] += (commands[i] * full - thrusts[i]) * factor

    def _ground_effect(self, surface_under: SurfaceUnder) -> float:
        """Thrust gain near a surface: 1 / (1 - (R / 4 h)^2), Cheeseman and Bennett 1955, h of the rotors."""
        height = surface_under(self.north, self.east)[0] - self.down
        self.ground_clearance = height
        rotor_height = max(height + self._body.rotor_height_m, 0.5 * self._body.rotor_radius_m)
        if rotor_height > 6.0 * self._body.rotor_radius_m:
            return 1.0
        ratio = self._body.rotor_radius_m / (4.0 * rotor_height)
        return 1.0 / (1.0 - ratio * ratio)

    def _integrate(self, dt: float, wind: Vector, surface_under: SurfaceUnder | None) -> None:
        """One semi-implicit Euler step of Newton's and Euler's equations."""
        body = self._body
        t0, t1, t2, t3 = self.thrusts
        _, _, r02, _, _, r12, _, _, r22 = self.rotation
        total = t0 + t1 + t2 + t3
        if surface_under is None:
            self.ground_clearance = -self.down
        else:
            total *= self._ground_effect(surface_under)
        # drag against the air
        a0, a1, a2 = self.v_north - wind[0], self.v_east - wind[1], self.v_down - wind[2]
        drag = body.drag_linear_n_per_mps + body.drag_quadratic_n_per_mps2 * math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        mass = body.mass_kg
        f0 = -r02 * total - drag * a0
        f1 = -r12 * total - drag * a1
        f2 = -r22 * total - drag * a2 + mass * GRAVITY
        p, q, r = self.p, self.q, self.r
        arm, spin, damping = body.rotor_arm_m, body.rotor_torque_per_thrust_m, body.angular_drag_nm_per_radps
        m0 = arm * (-t0 + t1 + t2 - t3) - damping * p
        m1 = arm * (t0 - t1 + t2 - t3) - damping * q
        m2 = spin * (t0 + t1 - t2 - t3) - damping * r
        if surface_under is not None:
            push = self.gear.push(self, dt, surface_under)
            if push is not None:
                f0 += push[0]
                f1 += push[1]
                f2 += push[2]
                m0 += push[3]
                m1 += push[4]
                m2 += push[5]
        self.v_north += f0 / mass * dt
        self.v_east += f1 / mass * dt
        self.v_down += f2 / mass * dt
        self.north += self.v_north * dt
        self.east += self.v_east * dt
        self.down += self.v_down * dt
        i0, i1, i2 = body.inertia_kg_m2
        self.p = p = p + (m0 - (i2 - i1) * q * r) / i0 * dt
        self.q = q = q + (m1 - (i0 - i2) * p * r) / i1 * dt
        self.r = r = r + (m2 - (i1 - i0) * p * q) / i2 * dt
        h = 0.5 * dt
        w, x, y, z = self.qw, self.qx, self.qy, self.qz
        nw = w - h * (x * p + y * q + z * r)
        nx = x + h * (w * p + y * r - z * q)
        ny = y + h * (w * q - x * r + z * p)
        nz = z + h * (w * r + x * q - y * p)
        s = 1.0 / math.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
        self.qw, self.qx, self.qy, self.qz = nw * s, nx * s, ny * s, nz * s
        self.rotation = self._rotation()
