"""A rigid body that floats over a plane floor on air bearings; it keeps its height and stays level.

    m dv/dt = R(heading) force - film drag - air drag + m g slope,    I dr/dt = torque - film drag

Forces are turned by the heading in the middle of the step. Somebody holds the vehicle until its first thruster fires,
as on a real floor, which is never quite level. Platforms of the world stand beside it: it does not ride on them, and
it does not collide.
"""

import math

from sitl_stub.truth import GROUND, Vector
from sitl_stub.vehicle.body import SurfaceUnder
from sitl_stub.vehicle.body_state import LevelBody
from sitl_stub.vehicle.rigid_body import GRAVITY
from sitl_stub.vehicle.spacecraft.config import FreeFlyerBodyParameters
from sitl_stub.vehicle.spacecraft.thrusters import Thrusters


class AirBearings:
    """What the vehicle stands on: a film of air on the floor."""

    __slots__ = ()
    count = 3
    surface = GROUND


class FreeFlyerBody(LevelBody):
    """State of the free-flyer."""

    __slots__ = ("_body", "_downhill", "gear", "thrusters")

    def __init__(self, body: FreeFlyerBodyParameters, *, heading: float) -> None:
        super().__init__(height=body.body_height_m, heading=heading)
        self._body = body
        pull = GRAVITY * math.sin(math.radians(body.floor_slope_deg))
        downhill = math.radians(body.floor_downhill_deg)
        self._downhill = (pull * math.cos(downhill), pull * math.sin(downhill))
        self.gear = AirBearings()
        self.thrusters = Thrusters(body)

    def step(self, dt: float, commands: list[float], wind: Vector, surface_under: SurfaceUnder) -> None:  # noqa: ARG002
        """Advance by `dt` [s] with the duties of the eight valves, 0 to 1.

        `wind` is the air's velocity [m/s], ned.
        """
        body = self._body
        forward, right, torque = self.thrusters.step(dt, commands)
        if not self.thrusters.openings:
            return
        before_north, before_east, rate = self.v_north, self.v_east, self.r
        inertia, mass = body.yaw_inertia_kg_m2, body.mass_kg
        self.r = _damped(rate, torque / inertia, body.film_turn_drag_nm_per_radps / inertia, dt)
        turned = 0.5 * (rate + self.r) * dt
        middle = self.heading + 0.5 * turned
        cosine, sine = math.cos(middle), math.sin(middle)
        gust_north, gust_east = wind[0] - before_north, wind[1] - before_east
        push = body.air_drag_n_per_mps2 * math.hypot(gust_north, gust_east)
        north = (cosine * forward - sine * right + push * gust_north) / mass + self._downhill[0]
        east = (sine * forward + cosine * right + push * gust_east) / mass + self._downhill[1]
        damping = body.film_drag_n_per_mps / mass
        self.v_north = _damped(before_north, north, damping, dt)
        self.v_east = _damped(before_east, east, damping, dt)
        self.north += 0.5 * (before_north + self.v_north) * dt
        self.east += 0.5 * (before_east + self.v_east) * dt
        self._face(self.heading + turned)
        self.acceleration = ((self.v_north - before_north) / dt, (self.v_east - before_east) / dt, 0.0)


def _damped(rate: float, push: float, damping: float, dt: float) -> float:
    """Speed or turn rate after `dt` [s] under a push [per s^2] and a linear damping [1/s], implicit Euler."""
    return (rate + push * dt) / (1.0 + damping * dt)
