"""Setpoints of a planar free-flyer: attitude and body thrust in OFFBOARD.

The command is that of every vehicle that moves and turns independently (`holonomic`): position, velocity, acceleration
and heading, inside the limits. What flies it elsewhere is the autopilot; here it is `control.free_flyer`.
"""

from __future__ import annotations

import numpy as np

from companion.control.free_flyer.controller import FreeFlyerController
from companion.guardian.holonomic import HolonomicShaper
from companion.guardian.limiter import Reference, Target
from companion.guardian.motion import Vector
from companion.guardian.shaping import Tick
from companion.messages.motion import MotionState
from companion.messages.ownship import FlightMode
from companion.messages.thrust import AttitudeThrust
from companion.vehicles.free_flyer import FreeFlyer


class FreeFlyerShaper:
    """Holds the command, and the controller that flies it.

    Args:
        vehicle: its limits, and the parameters of its control.
    """

    mode = FlightMode.OFFBOARD

    def __init__(self, vehicle: FreeFlyer) -> None:
        self._command = HolonomicShaper(vehicle.limits)
        self._controller = FreeFlyerController(vehicle.parameters.control, speed_max=vehicle.limits.speed_horizontal)

    @property
    def empty(self) -> bool:
        """Whether nothing is commanded yet."""
        return self._command.empty

    def clear(self) -> None:
        """Forget the command: somebody else flies."""
        self._command.clear()
        self._controller.reset()

    def hold(self, tick: Tick) -> None:
        """Command to stay here; before OFFBOARD nothing that was commanded has been flown."""
        self._command.hold(tick)
        self._controller.reset()

    def follow(self, tick: Tick, reference: Reference, target: Target | None) -> tuple[str, ...]:
        """Move the command on towards a reference; give the names of the limits that changed it."""
        return self._command.follow(tick, reference, target)

    def brake(self, tick: Tick) -> tuple[str, ...]:
        """Move the command on along the stop at hand; give what changed it besides."""
        return self._command.brake(tick)

    def rebase(self, offset: Vector, turn: float, elapsed: float) -> None:
        """Follow a reset of the estimate; the controller sees it by itself."""
        self._command.rebase(offset, turn, elapsed)

    def setpoint(self, tick: Tick) -> AttitudeThrust | None:
        """Give what is to be sent now; without a fresh own position, what brings the velocity alone."""
        wanted = self._command.commanded(tick)
        if wanted is None or tick.ownship is None:
            return None
        reference = MotionState(
            position_ned=np.array(tick.here) if wanted.position_ned is None else wanted.position_ned,
            velocity_ned=wanted.velocity_ned,
            acceleration_ned=wanted.acceleration_ned,
            yaw=wanted.yaw,
            yaw_rate=wanted.yaw_rate,
        )
        return self._controller.update(tick.t, reference, tick.ownship).setpoint
