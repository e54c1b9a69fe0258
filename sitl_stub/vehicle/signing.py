"""MAVLink 2 signing as PX4 does it: outgoing frames always signed, incoming ones verified before anything is stored.

PX4 signs also without a key: all zeros, link id 255, a counter as timestamp; then everything incoming is accepted.
SETUP_SIGNING sets a key. From then on MAV_SIGN_CFG decides: 0 unsigned frames still pass, 1 and 2 they do not
(mavlink/mavlink_sign_control.cpp; the MAVLink C library checks signature, then replay, and only then stores).
"""

import hashlib
from collections.abc import Mapping
from typing import Any

KEY_SIZE, SIGNATURE_SIZE = 32, 13
LINK_ID = 255
WINDOW = 60 * 100_000
"""A new stream may be so far behind [10 us]: one minute."""
ALWAYS_ACCEPTED = frozenset({109, 246, 247})
"""RADIO_STATUS, ADSB_VEHICLE, COLLISION."""
SIGNED_FLAG = 1


class Signing:
    """Key and timestamps of one link. `outgoing` is the encoder's own record of them (pymavlink's MAVLinkSigning)."""

    def __init__(self, parameters: Mapping[str, float], outgoing: Any) -> None:
        self._parameters = parameters
        self._outgoing = outgoing
        outgoing.secret_key, outgoing.link_id, outgoing.timestamp = bytes(KEY_SIZE), LINK_ID, 1
        outgoing.sign_outgoing = True
        self._active = False
        self._streams: dict[tuple[int, int, int], int] = {}

    @property
    def active(self) -> bool:
        """Whether a key is set."""
        return self._active

    def set_up(self, key: bytes, timestamp: int) -> None:
        """Take the key and the initial timestamp [10 us] of SETUP_SIGNING; all zeros switch signing off."""
        self._outgoing.secret_key, self._outgoing.timestamp = key, timestamp
        self._active = timestamp != 0 or key != bytes(KEY_SIZE)

    def sign(self, frame: bytes) -> bytes:
        """Return the 13 bytes that follow a frame whose incompatibility flags say it is signed."""
        outgoing = self._outgoing
        stamp: bytes = bytes([outgoing.link_id]) + outgoing.timestamp.to_bytes(6, "little")
        outgoing.timestamp = (outgoing.timestamp + 1) & 0xFFFFFFFFFFFF
        return stamp + self._digest(frame + stamp)

    def _digest(self, signed: bytes) -> bytes:
        key: bytes = self._outgoing.secret_key
        return hashlib.sha256(key + signed).digest()[:6]

    def accepts(self, frame: bytes, message_id: int) -> bool:
        """Whether a whole frame may be acted on. Timestamps are stored only after the signature was found good."""
        if not self._active or self._verified(frame):
            return True
        return message_id in ALWAYS_ACCEPTED or int(self._parameters["MAV_SIGN_CFG"]) == 0

    def _verified(self, frame: bytes) -> bool:
        if frame[0] != 0xFD or not frame[2] & SIGNED_FLAG:
            return False
        signed, digest = frame[:-6], frame[-6:]
        if self._digest(signed) != digest:
            return False
        signature = frame[-SIGNATURE_SIZE:]
        timestamp = int.from_bytes(signature[1:7], "little")
        stream = (signature[0], frame[5], frame[6])
        last = self._streams.get(stream)
        if timestamp <= last if last is not None else timestamp + WINDOW < self._outgoing.timestamp:
            return False
        self._streams[stream] = timestamp
        self._outgoing.timestamp = max(self._outgoing.timestamp, timestamp)
        return True
