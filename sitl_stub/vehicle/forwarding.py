"""Messages passed on from one link to the other, as PX4 does (mavlink_main.cpp, forward_message)."""

from collections.abc import Callable, Mapping
from typing import Any

SYSTEM, COMPONENT = 1, 1
HEARTBEAT = "HEARTBEAT"


class Forwarder:
    """Knows who has been heard on which link.

    A message for the autopilot itself stays. Any other goes to the links on which its receiver has been heard; one for
    everybody goes to those on which anybody has. HEARTBEAT only with MAV_HB_FORW_EN.
    """

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self._links: dict[str, Callable[[bytes], None]] = {}
        self._heard: dict[str, set[tuple[int, int]]] = {}

    def add(self, port: str, put: Callable[[bytes], None]) -> None:
        """Add a link; `put` sends a frame on it."""
        self._links[port] = put
        self._heard[port] = set()

    def forget(self, port: str) -> None:
        """Forget who was heard on a link: the autopilot has restarted."""
        self._heard[port].clear()

    def heard(self, port: str, message: Any, frame: bytes) -> None:
        """Take a message that has arrived on a link."""
        self._heard[port].add((message.get_srcSystem(), message.get_srcComponent()))
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        if (system, component) == (SYSTEM, COMPONENT):
            return
        if message.get_type() == HEARTBEAT and not self._parameters["MAV_HB_FORW_EN"]:
            return
        for other, put in self._links.items():
            if other != port and self._is_there(other, system, component):
                put(frame)

    def _is_there(self, port: str, system: int, component: int) -> bool:
        heard = self._heard[port]
        if system == 0:
            return bool(heard)
        return any(known == system and component in (0, part) for known, part in heard)
