"""LANDING_TARGET as PX4's receiver takes it (mavlink_receiver.cpp, handle_message_landing_target)."""

from typing import TYPE_CHECKING, Any

from sitl_stub.vehicle.notices import CRITICAL, Notice

if TYPE_CHECKING:
    from sitl_stub.vehicle.autopilot import Autopilot

LOCAL_NED = 1


def take(message: Any, autopilot: "Autopilot") -> None:
    """Act on one message.

    With a valid position in LOCAL_NED it is the absolute place of the target at once, whoever sends it. In another
    frame it is refused with a text. Angles alone need PX4's landing target estimator, which is not part of the
    simulator.
    """
    if not message.position_valid:
        return
    if message.frame == LOCAL_NED:
        autopilot.landing_target(message.x, message.y, message.z)
    else:
        text = f"Landing target: coordinate frame {message.frame} unsupported\t"
        autopilot.commander.notices.append(Notice(severity=CRITICAL, text=text))
