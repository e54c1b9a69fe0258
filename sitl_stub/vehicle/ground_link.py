"""Whether a link has a ground station, and the texts that wait for it.

Follows PX4 v1.17: mavlink/mavlink_receiver.cpp (CheckHeartbeats), mavlink/streams/STATUSTEXT.hpp, msg/MavlinkLog.msg.
"""

import math
from collections import deque

from sitl_stub.vehicle.notices import Notice

HEARTBEAT_TIMEOUT = 2.5
"""So long [s] a ground station's heartbeat counts; no partner counts while the boot is younger."""
INTERVAL = 0.05
"""Texts leave at 20 Hz at most."""
QUEUE_LENGTH = 8
"""So many texts wait; of more, the oldest are lost."""
STALE_AFTER = 5.0
"""A text that has waited longer [s] is dropped."""


class GroundLink:
    """Texts for the ground station of one link; times are since boot [s]."""

    def __init__(self) -> None:
        self._heard = -math.inf
        self._waiting: deque[tuple[float, Notice]] = deque(maxlen=QUEUE_LENGTH)
        self._due = 0.0

    def heard(self, t: float) -> None:
        """A ground station's heartbeat has come."""
        self._heard = t

    def connected(self, t: float) -> bool:
        """Whether a ground station listens."""
        return t > HEARTBEAT_TIMEOUT and t - self._heard <= HEARTBEAT_TIMEOUT

    def put(self, t: float, notice: Notice) -> None:
        """Queue a text."""
        self._waiting.append((t, notice))

    def take(self, t: float) -> Notice | None:
        """Hand out the text that is due now."""
        if not self._waiting or t < self._due or not self.connected(t):
            return None
        while self._waiting:
            since, notice = self._waiting.popleft()
            if t - since < STALE_AFTER:
                self._due = t + INTERVAL
                return notice
        return None
