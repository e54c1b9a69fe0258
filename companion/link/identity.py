"""Who answers: the kind of vehicle, by its heartbeats, and the software of its autopilot, which is asked for."""

from __future__ import annotations

from collections.abc import Collection

from companion.link.events import AutopilotIdentified, WrongVehicle
from companion.link.incoming import Heartbeat, Version
from companion.link.modes import PX4, autopilot_name, vehicle_type_name

_VERSION_PERIOD, _VERSION_ATTEMPTS = 2.0, 5
_VERSION_KINDS = {0: "development", 64: "alpha", 128: "beta", 192: "release candidate", 255: ""}


class Identity:
    """Holds what the vehicle has said of itself.

    Args:
        vehicle_types: MAV_TYPEs that the program flies, with PX4.
        wanted: the same in words.
    """

    def __init__(self, vehicle_types: Collection[int], *, wanted: str) -> None:
        self._vehicle_types = vehicle_types
        self._wanted = wanted
        self._wrong: WrongVehicle | None = None
        self._software: AutopilotIdentified | None = None
        self._next_request, self._requests = float("-inf"), 0

    @property
    def software(self) -> AutopilotIdentified | None:
        """The autopilot's software, once it has said it."""
        return self._software

    @property
    def obstacle(self) -> str | None:
        """Why this vehicle is not commanded, None where it may be."""
        wrong = self._wrong
        return None if wrong is None else f"this is a {wrong.type_name} with {wrong.autopilot}; {wrong.wanted}"

    def heartbeat(self, heartbeat: Heartbeat, t: float) -> WrongVehicle | None:
        """Look at the kind of vehicle with each heartbeat: another one may answer after a reconnection.

        Returns:
            What is wrong with it, where that is news.
        """
        if heartbeat.vehicle_type in self._vehicle_types and heartbeat.autopilot == PX4:
            self._wrong = None
            return None
        if self._wrong is not None:
            return None
        self._wrong = WrongVehicle(
            t=t,
            type_name=vehicle_type_name(heartbeat.vehicle_type),
            autopilot=autopilot_name(heartbeat.autopilot),
            wanted=self._wanted,
        )
        return self._wrong

    def connected(self, t: float) -> None:
        """Begin to ask for the software, where it is not known, at `t` [s]."""
        self._next_request, self._requests = t, 0

    def request_due(self, t: float) -> bool:
        """Say whether to ask for the software now, which counts as asked; some attempts are made, no more."""
        if self._software is not None or t < self._next_request or self._requests >= _VERSION_ATTEMPTS:
            return False
        self._next_request = t + _VERSION_PERIOD
        self._requests += 1
        return True

    def version(self, version: Version, t: float) -> AutopilotIdentified:
        """Take the autopilot's answer."""
        major, minor, patch, kind = version.flight_software.to_bytes(4, "big")
        name = f"{major}.{minor}.{patch} {_VERSION_KINDS.get(kind, '')}".strip()
        text = f"{name} ({version.custom[::-1].hex()})"
        self._software = AutopilotIdentified(t=t, version=text, numbers=(major, minor, patch))
        return self._software
