"""What a pilot orders by switch or gesture, carried out."""

from typing import TYPE_CHECKING

from sitl_stub.vehicle.system_state import BY_GESTURE, BY_SWITCH

if TYPE_CHECKING:
    from sitl_stub.vehicle.commander import Commander


def obey_pilot(commander: "Commander") -> None:
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
