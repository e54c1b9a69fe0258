"""Four feet on the ground or on platforms: spring, damper, and friction that sticks until it slips."""

import math

from sitl_stub.truth import GROUND, Vector
from sitl_stub.vehicle.body import Body, SurfaceUnder
from sitl_stub.vehicle.config import GearParameters

STEP_HEIGHT = 0.05
"""A foot that meets a surface from the side, deeper than this [m] below its top, does not stand on it."""
AT_REST: Vector = (0.0, 0.0, 0.0)

Push = tuple[float, float, float, float, float, float]


class Foot:
    """Where one foot is, on the body and, while it touches, on its surface."""

    __slots__ = ("anchor_east", "anchor_north", "down", "forward", "right", "surface")

    def __init__(self, forward: float, right: float, down: float) -> None:
        self.forward, self.right, self.down = forward, right, down
        self.surface = ""
        self.anchor_north = self.anchor_east = 0.0


class LandingGear:
    """The feet and what they stand on."""

    __slots__ = ("_gear", "count", "feet", "surface")

    def __init__(self, gear: GearParameters) -> None:
        self._gear = gear
        x, y, z = gear.foot_forward_m, gear.foot_right_m, gear.foot_down_m
        self.feet = (Foot(x, y, z), Foot(-x, -y, z), Foot(x, -y, z), Foot(-x, y, z))
        self.count = 0
        """Feet that press on a surface."""
        self.surface = ""
        """What they stand on: the one name all touching feet share, "ground" when they differ, "" when none touches."""

    def push(self, body: Body, dt: float, surface_under: SurfaceUnder) -> Push | None:
        """Force [N] in ned and moment [Nm] in frd that the surfaces exert on the body; None when no foot touches.

        Normal: N = k depth + c closing speed, never pulling. Tangential: a spring to the point where the foot landed,
        which moves with the surface; beyond friction * N the foot slips and takes that point along.
        """
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = body.rotation
        p, q, r = body.p, body.q, body.r
        f0 = f1 = f2 = m0 = m1 = m2 = 0.0
        count, common = 0, ""
        for foot in self.feet:
            x, y, z = foot.forward, foot.right, foot.down
            north = body.north + r00 * x + r01 * y + r02 * z
            east = body.east + r10 * x + r11 * y + r12 * z
            down = body.down + r20 * x + r21 * y + r22 * z
            level, name, moving, _ = surface_under(north, east)
            depth = down - level
            if depth > STEP_HEIGHT and foot.surface != name and name != GROUND:
                name, moving, depth = GROUND, AT_REST, down
            if depth <= 0.0:
                foot.surface = ""
                continue
            # velocity of the foot against its surface: v + R (w x arm) - v_surface
            b0, b1, b2 = q * z - r * y, r * x - p * z, p * y - q * x
            u0 = body.v_north + r00 * b0 + r01 * b1 + r02 * b2 - moving[0]
            u1 = body.v_east + r10 * b0 + r11 * b1 + r12 * b2 - moving[1]
            u2 = body.v_down + r20 * b0 + r21 * b1 + r22 * b2 - moving[2]
            n0, n1, n2 = self._press(foot, name, moving, dt, (north, east, depth), (u0, u1, u2))
            if n2 >= 0.0:
                continue
            count += 1
            common = name if common in ("", name) else GROUND
            f0 += n0
            f1 += n1
            f2 += n2
            g0 = r00 * n0 + r10 * n1 + r20 * n2
            g1 = r01 * n0 + r11 * n1 + r21 * n2
            g2 = r02 * n0 + r12 * n1 + r22 * n2
            m0 += y * g2 - z * g1
            m1 += z * g0 - x * g2
            m2 += x * g1 - y * g0
        self.count, self.surface = count, common
        return (f0, f1, f2, m0, m1, m2) if count else None

    def _press(self, foot: Foot, name: str, moving: Vector, dt: float, at: Vector, against: Vector) -> Vector:
        """Force of one surface on one foot [N], ned; `at` is (north, east, depth), `against` the relative velocity."""
        gear = self._gear
        north, east, depth = at
        if foot.surface != name:
            foot.surface, foot.anchor_north, foot.anchor_east = name, north, east
        else:
            foot.anchor_north += moving[0] * dt
            foot.anchor_east += moving[1] * dt
        normal = gear.stiffness_n_per_m * depth + gear.damping_n_per_mps * against[2]
        if normal <= 0.0:
            foot.anchor_north, foot.anchor_east = north, east
            return AT_REST
        stiffness = gear.tangential_stiffness_n_per_m
        f0 = -stiffness * (north - foot.anchor_north) - gear.tangential_damping_n_per_mps * against[0]
        f1 = -stiffness * (east - foot.anchor_east) - gear.tangential_damping_n_per_mps * against[1]
        size, limit = math.sqrt(f0 * f0 + f1 * f1), gear.friction * normal
        if size > limit:
            scale = limit / size
            f0 *= scale
            f1 *= scale
            foot.anchor_north = north + f0 / stiffness
            foot.anchor_east = east + f1 / stiffness
        return (f0, f1, -normal)
