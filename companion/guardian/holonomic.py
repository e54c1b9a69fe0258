"""Setpoints of a vehicle that moves and turns independently: position, velocity, acceleration and yaw in OFFBOARD."""

from __future__ import annotations

from companion.guardian.leading import leading_position, leading_yaw
from companion.guardian.limiter import (
    Command,
    Reference,
    Target,
    brake,
    follow,
    hold_here,
    keep_near,
    shifted,
)
from companion.guardian.motion import Vector
from companion.guardian.shaping import Tick
from companion.messages.motion import MotionLimits, Setpoint
from companion.messages.ownship import FlightMode


class HolonomicShaper:
    """Holds the command; see `limiter`.

    Args:
        limits: of the vehicle.
    """

    mode = FlightMode.OFFBOARD

    def __init__(self, limits: MotionLimits) -> None:
        self._limits = limits
        self._command: Command | None = None

    @property
    def empty(self) -> bool:
        """Whether nothing is commanded yet."""
        return self._command is None

    def clear(self) -> None:
        """Forget the command."""
        self._command = None

    def hold(self, tick: Tick) -> None:
        """Command to stay here."""
        self._command = hold_here(tick.here, tick.yaw, self._limits)

    def follow(self, tick: Tick, reference: Reference, target: Target | None) -> tuple[str, ...]:
        """Move the command on towards a reference; give the names of the limits that changed it."""
        if self._command is None:
            return ()
        command, clips = follow(self._command, reference, tick.here, target, tick.dt, self._limits, tick.parameters)
        return self._keep(command, tick, clips)

    def brake(self, tick: Tick) -> tuple[str, ...]:
        """Move the command on along the stop at hand; give what changed it besides."""
        if self._command is None:
            return ()
        return self._keep(brake(self._command, tick.dt, self._limits), tick, ())

    def _keep(self, command: Command, tick: Tick, clips: tuple[str, ...]) -> tuple[str, ...]:
        if tick.fresh:
            command, moved = keep_near(command, tick.here, tick.parameters)
            clips = (*clips, "leash") if moved and "leash" not in clips else clips
        self._command = command
        return clips

    def rebase(self, offset: Vector, turn: float, elapsed: float) -> None:
        """Follow a reset of the estimate; the heading's command has turned by itself in the time between."""
        if self._command is not None:
            self._command = shifted(self._command, offset, turn - self._command.heading.rate * elapsed)

    def commanded(self, tick: Tick) -> Setpoint | None:
        """Give what is commanded now, for a controller that keeps the speed limit itself."""
        return None if self._command is None else self._sent(self._command, self._command.motion.position, tick)

    def setpoint(self, tick: Tick) -> Setpoint | None:
        """Give what is to be sent now; without a fresh own position, no position."""
        if self._command is None:
            return None
        return self._sent(
            self._command, leading_position(self._command, tick.here, self._limits, tick.parameters), tick
        )

    def _sent(self, command: Command, position: Vector, tick: Tick) -> Setpoint:
        motion, heading = command.motion, command.heading
        return Setpoint(
            t=tick.t,
            position_ned=position if tick.fresh else None,  # type: ignore[arg-type]  # copied to an array
            velocity_ned=motion.velocity,  # type: ignore[arg-type]
            acceleration_ned=command.acceleration,  # type: ignore[arg-type]
            yaw=leading_yaw(command, tick.yaw, self._limits, tick.parameters),
            yaw_rate=heading.rate,
            feedback_velocity_ned=command.feedback_velocity,  # type: ignore[arg-type]
        )
