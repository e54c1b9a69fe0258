"""What a pilot orders by switch or gesture, carried out."""

from typing import Protocol

from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.sticks import ManualControl
from sitl_stub.vehicle.system_state import BY_GESTURE, BY_SWITCH, Result


class Commanded(Protocol):
    """What carries orders out: the commander."""

    @property
    def pilot(self) -> ManualControl:
        """What the pilot's switches and gestures ask for."""

    def request_mode(self, mode: Mode) -> Result:
        """Enter a mode, where that is possible."""

    def request_arm(self, reason: int) -> Result:
        """Arm, where that is possible."""

    def request_disarm(self, *, force: bool, reason: int) -> Result:
        """Disarm; `force`: also in flight."""

    def request_kill(self, killed: bool) -> None:
        """Stop the motors at once, or let them turn again."""

    def request_termination(self) -> Result:
        """End the flight for good."""


def obey_pilot(commander: Commanded) -> None:
    """Carry out what has been asked for since the last call."""
    pilot = commander.pilot
    requests, pilot.requests = pilot.requests, []
    for request in requests:
        if request.mode is not None:
            commander.request_mode(request.mode)
        reason = BY_SWITCH if pilot.arms_by_switch else BY_GESTURE
        if request.arm is not None and request.arm:
            commander.request_arm(reason)
        elif request.arm is not None:
            commander.request_disarm(force=False, reason=reason)
        if request.kill is not None:
            commander.request_kill(request.kill)
        if request.terminate:
            commander.request_termination()
