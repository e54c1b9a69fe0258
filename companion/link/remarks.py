"""What of the link's events an operator wants to read, in plain words."""

from __future__ import annotations

from companion.link.events import (
    AutopilotIdentified,
    AutopilotRestarted,
    Connected,
    EstimatorReset,
    LinkEvent,
    Lost,
    RateShort,
)


def remark(event: LinkEvent) -> str | None:
    """Say what has happened; None for what the mission's own status tells better."""
    match event:
        case Connected():
            return f"connected: {event.vehicle_type}, system {event.system}"
        case Lost():
            return f"no heartbeat for {event.silence:.1f} s"
        case AutopilotIdentified():
            return f"the autopilot is PX4 {event.version}"
        case AutopilotRestarted():
            return "the autopilot has restarted"
        case EstimatorReset():
            return f"the autopilot's estimator was reset ({event.before} to {event.after})"
        case RateShort():
            asked = f"although {event.asked:g} Hz were asked for"
            return f"{event.message} comes {event.measured:.1f} times a second only, {asked}"
        case _:
            return None
