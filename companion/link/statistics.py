"""What the link has counted."""

from __future__ import annotations

from dataclasses import dataclass

from companion.link.signing import SigningStatistics
from companion.link.timesync import TimesyncStatistics


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkStatistics:
    """What the link has counted since the start."""

    datagrams: int
    frames: int  # of the vehicle
    lost: int  # of the vehicle, by its sequence numbers
    bad_bytes: int  # that belong to no frame
    foreign: int  # frames of anyone else
    foreign_sources: dict[tuple[int, int], int]  # (system, component) to frames, the first 16
    unbelieved: int  # frames said to be of the vehicle, with no signature, a wrong one or an old one
    signing: SigningStatistics | None  # None: without a key signatures are not checked
    odometry_invalid: int
    odometry_stale: int
    undecodable: int  # frames whose decoding failed; stays 0
    rates: dict[str, float]  # [Hz] by message, last period
    timesync: TimesyncStatistics

    @property
    def heard_instead(self) -> str:
        """Say what came instead of the vehicle's heartbeat; empty where nothing came."""
        if self.unbelieved:
            return (
                f"{self.unbelieved} messages came whose signature is missing, wrong or old: "
                "check that link.signing.key_file holds the autopilot's key"
            )
        if self.frames:
            return f"{self.frames} other messages of the vehicle came: its heartbeat is not sent on this link"
        names = ", ".join(f"system {s} component {c}" for s, c in sorted(self.foreign_sources))
        return f"heard only {names}: check link.mavlink.system_id and component_id" if names else ""
