"""What all bodies, and the estimate of one, hold alike: where they are, how they move and how they are turned."""

import math

from sitl_stub.truth import Quaternion, Vector


class BodyState:
    """Position, velocity, attitude and turn rates; frame ned, body frame frd."""

    __slots__ = ("down", "east", "north", "p", "q", "qw", "qx", "qy", "qz", "r", "v_down", "v_east", "v_north")

    def __init__(self) -> None:
        self.north = self.east = self.down = 0.0
        self.v_north = self.v_east = self.v_down = 0.0
        self.qw, self.qx, self.qy, self.qz = 1.0, 0.0, 0.0, 0.0
        self.p = self.q = self.r = 0.0

    @property
    def position(self) -> Vector:
        """Body origin [m], ned."""
        return (self.north, self.east, self.down)

    @property
    def velocity(self) -> Vector:
        """Velocity [m/s], ned."""
        return (self.v_north, self.v_east, self.v_down)

    @property
    def quaternion(self) -> Quaternion:
        """Attitude ned_from_frd (w, x, y, z)."""
        return (self.qw, self.qx, self.qy, self.qz)


class LevelBody(BodyState):
    """A body that something carries: it keeps its height above that and stays level; origin at the centre of mass."""

    __slots__ = ("acceleration", "ground_clearance", "heading", "rotation")

    def __init__(self, *, height: float, heading: float) -> None:
        super().__init__()
        self.down = -height
        self.ground_clearance = height
        self.acceleration: Vector = (0.0, 0.0, 0.0)
        self._face(heading)

    def _face(self, heading: float) -> None:
        self.heading = math.remainder(heading, math.tau)
        cosine, sine = math.cos(heading), math.sin(heading)
        self.qw, self.qz = math.cos(0.5 * self.heading), math.sin(0.5 * self.heading)
        self.rotation = (cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0)
