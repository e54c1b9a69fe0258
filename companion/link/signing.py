"""MAVLink 2 message signing.

A signed frame ends with 13 bytes: link id (1), timestamp (6, unit 10 us since 2015-01-01), and the first 6 bytes of

    SHA-256(secret key, header, payload, checksum, link id, timestamp).

Source: MAVLink, "Message Signing"; PX4 checks the same way (mavlink_helpers.h, mavlink_signature_check).
"""

from __future__ import annotations

import hashlib
import hmac
import os
import stat
from dataclasses import dataclass
from pathlib import Path

from companion.errors import InputError

SECRET_BYTES = 32
TICKS_PER_S = 100_000
_EPOCH_S = 1_420_070_400  # 2015-01-01 00:00 UTC in Unix time
_OLDEST = 60 * TICKS_PER_S  # behind our own time, of a stream that is new
_LAST = 2**48 - 1
_LINK_ID, _STAMP, _SIGNATURE = -13, -12, -6  # where the parts begin, from the frame's end


def signing_time(unix_s: float) -> int:
    """Give the signing timestamp of a Unix time [s]; 0 before 2015, where a clock was never set."""
    return max(0, round((unix_s - _EPOCH_S) * TICKS_PER_S))


def load_signing_key(path: str | os.PathLike[str]) -> bytes:
    """Read a secret key: 32 bytes, or 64 hexadecimal digits.

    Raises:
        InputError: there is no such file, others may read it, or it holds no key.
    """
    source = os.fspath(path)
    try:
        mode, data = Path(path).stat().st_mode, Path(path).read_bytes()
    except OSError as error:
        wrong = f"the key cannot be read ({error.strerror or error})"
        right = "name a file with 32 bytes or 64 hexadecimal digits"
        raise InputError.single(source=source, wrong=wrong, right=right) from None
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise InputError.single(
            source=source, wrong="the key is open to other users of this computer", right=f"chmod 600 {source}"
        )
    if len(data) != SECRET_BYTES:
        try:
            data = bytes.fromhex(data.decode("ascii").strip())
        except ValueError:
            data = b""
    if len(data) != SECRET_BYTES:
        raise InputError.single(
            source=source, wrong="this is no key", right="a key is 32 bytes, or 64 hexadecimal digits"
        )
    if not any(data):
        raise InputError.single(
            source=source, wrong="the key is all zeros, which PX4 takes as none", right="use one that was rolled"
        )
    return data


@dataclass(frozen=True, slots=True, kw_only=True)
class SigningStatistics:
    """What became of the frames that were looked at."""

    accepted: int
    unsigned: int  # without a signature
    forged: int  # with a signature that our key does not give
    old: int  # rightly signed, but not newer than the one before: repeated, or late


class Signing:
    """Signs what goes out and verifies what comes in, with one key.

    A frame leaves a trace here only after its signature was found right: a forged one with a far timestamp changes
    nothing.

    Args:
        secret: the key, 32 bytes, as the autopilot has it.
        link_id: of the companion's link, 0..255.
        timestamp: `signing_time` at companion time 0.
    """

    def __init__(self, *, secret: bytes, link_id: int, timestamp: int) -> None:
        if len(secret) != SECRET_BYTES or not 0 <= link_id <= 255:
            raise ValueError("a key has 32 bytes, and a link id is from 0 to 255")
        self.secret = secret
        self.link_id = link_id
        self._zero = timestamp
        self._own = timestamp  # the newest that was sent or accepted
        self._streams: dict[tuple[int, int, int], int] = {}  # system, component, link id to newest timestamp
        self._accepted = self._unsigned = self._forged = self._old = 0

    def advance(self, t: float) -> None:
        """Follow the companion's clock to `t` [s]."""
        self._own = max(self._own, self._zero + round(t * TICKS_PER_S))

    def stamp(self) -> int:
        """Give the timestamp of the next outgoing frame: later than every one before."""
        self._own = min(self._own + 1, _LAST)
        return self._own

    def authentic(self, frame: bytes) -> bool:
        """Tell whether a whole signed frame was signed with our key; says nothing of its age."""
        digest = hashlib.sha256(self.secret + frame[:_SIGNATURE]).digest()
        return hmac.compare_digest(digest[:6], frame[_SIGNATURE:])

    def verify(self, frame: bytes, *, signed: bool, source: tuple[int, int]) -> bool:
        """Tell whether a whole frame may be believed, and remember its timestamp if so.

        Args:
            frame: from its first byte to the last of the signature.
            signed: whether it says that it is signed.
            source: its system and component.
        """
        if not signed:
            self._unsigned += 1
            return False
        if not self.authentic(frame):
            self._forged += 1
            return False
        stream = (*source, frame[_LINK_ID])
        stamp = int.from_bytes(frame[_STAMP:_SIGNATURE], "little")
        newest = self._streams.get(stream, self._own - _OLDEST - 1)
        if stamp <= newest:
            self._old += 1
            return False
        self._streams[stream] = stamp
        self._own = max(self._own, stamp)
        self._accepted += 1
        return True

    def statistics(self) -> SigningStatistics:
        """Give what has been counted."""
        return SigningStatistics(accepted=self._accepted, unsigned=self._unsigned, forged=self._forged, old=self._old)
