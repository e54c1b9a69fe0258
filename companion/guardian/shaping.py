"""What turns a wanted reference into setpoints: one for each form of setpoint, chosen with the vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from companion.guardian.limiter import Reference, Target
from companion.guardian.motion import Vector
from companion.guardian.parameters import GuardianParameters
from companion.messages.motion import AnySetpoint
from companion.messages.ownship import FlightMode, OwnshipState


@dataclass(frozen=True, slots=True, kw_only=True)
class Tick:
    """What a tick of the guardian knows."""

    t: float  # [s] now
    dt: float  # [s] since the tick before
    ownship: OwnshipState | None  # the newest known, however old
    here: Vector  # [m] the vehicle now, ned, moved on from `ownship` at its velocity
    fresh: bool  # the own position is young enough to build on
    parameters: GuardianParameters  # with the fence where it stands

    @property
    def yaw(self) -> float:
        """Heading [rad] of the vehicle; 0 where it is unknown."""
        return 0.0 if self.ownship is None else self.ownship.yaw


class Shaper(Protocol):
    """Holds what is commanded, inside the vehicle's limits, whatever the reference does.

    From each command a stop must be at hand that keeps the limits too.
    """

    @property
    def mode(self) -> FlightMode:
        """The autopilot's mode that takes these setpoints."""

    @property
    def empty(self) -> bool:
        """Whether nothing is commanded yet."""

    def clear(self) -> None:
        """Forget the command."""

    def hold(self, tick: Tick) -> None:
        """Command to stay here."""

    def follow(self, tick: Tick, reference: Reference, target: Target | None) -> tuple[str, ...]:
        """Move the command on towards a reference; give the names of the limits that changed it."""

    def brake(self, tick: Tick) -> tuple[str, ...]:
        """Move the command on along the stop at hand; give what changed it besides."""

    def rebase(self, offset: Vector, turn: float, elapsed: float) -> None:
        """Follow a reset of the estimate.

        Args:
            offset: jump of the position [m].
            turn: of the heading [rad], the vehicle's own turn in the time between included.
            elapsed: that time [s].
        """

    def setpoint(self, tick: Tick) -> AnySetpoint | None:
        """Give what is to be sent now."""
