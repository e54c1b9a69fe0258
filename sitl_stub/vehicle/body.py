"""What a simulated vehicle's body shows: to the autopilot's sensors, to telemetry and to the truth."""

from collections.abc import Callable
from typing import Protocol, TypeAlias

from sitl_stub.truth import Quaternion, Vector

SurfaceUnder: TypeAlias = Callable[[float, float], tuple[float, str, Vector, float]]
"""(north [m], east [m]) -> (down coordinate of the surface [m], name, velocity there ned [m/s], yaw rate [rad/s])."""


class Standing(Protocol):
    """What the body stands on."""

    @property
    def count(self) -> int:
        """Feet or wheels that press on a surface."""

    @property
    def surface(self) -> str:
        """Name of the surface, "ground" when they stand on several, "" when none touches."""


class Body(Protocol):
    """State of a vehicle's body; frame ned, body frame frd. Read only for everyone but the body itself."""

    @property
    def north(self) -> float:
        """Body origin [m]."""

    @property
    def east(self) -> float:
        """Body origin [m]."""

    @property
    def down(self) -> float:
        """Body origin [m]."""

    @property
    def v_north(self) -> float:
        """Velocity over ground [m/s]."""

    @property
    def v_east(self) -> float:
        """Velocity over ground [m/s]."""

    @property
    def v_down(self) -> float:
        """Velocity over ground [m/s]."""

    @property
    def position(self) -> Vector:
        """Body origin [m], ned."""

    @property
    def velocity(self) -> Vector:
        """Velocity [m/s], ned."""

    @property
    def acceleration(self) -> Vector:
        """Acceleration [m/s^2], ned, gravity included (zero at rest)."""

    @property
    def qw(self) -> float:
        """Attitude ned_from_frd, real part."""

    @property
    def qx(self) -> float:
        """Attitude ned_from_frd, forward part."""

    @property
    def qy(self) -> float:
        """Attitude ned_from_frd, right part."""

    @property
    def qz(self) -> float:
        """Attitude ned_from_frd, down part."""

    @property
    def quaternion(self) -> Quaternion:
        """Attitude ned_from_frd (w, x, y, z)."""

    @property
    def rotation(self) -> tuple[float, ...]:
        """Rotation matrix ned_from_frd, row by row."""

    @property
    def p(self) -> float:
        """Roll rate [rad/s], frd."""

    @property
    def q(self) -> float:
        """Pitch rate [rad/s], frd."""

    @property
    def r(self) -> float:
        """Yaw rate [rad/s], frd."""

    @property
    def ground_clearance(self) -> float:
        """Distance [m] from the body origin to the surface below."""

    @property
    def gear(self) -> Standing:
        """What the body stands on."""

    def step(self, dt: float, commands: list[float], wind: Vector, surface_under: SurfaceUnder) -> None:
        """Advance by `dt` [s] with actuator commands and the air's velocity [m/s], ned."""
