"""Random messages with right checksums into the link and everything that reads from it: no exception, bounded memory.

Every message that the link reads comes with random content, length, sequence and sender, signed and unsigned, between
random bytes, in datagrams and in a byte stream cut anywhere; and sensible ones among them, so that what lies behind is
reached. It goes to a link beside which a flight's commands run, to one with a key, and to a whole pipeline.
Run: python bench/link_fuzz.py [--bytes 10000000] [--seed 1]
"""

from __future__ import annotations

import argparse
import math
import random
import struct
import sys
import time
import tracemalloc
from pathlib import Path

from fastcrc import crc16

from companion.config import load_flight
from companion.link import incoming
from companion.link.autopilot_link import AutopilotLink
from companion.link.framing import StreamFramer
from companion.link.parameters import LinkParameters
from companion.link.signing import Signing
from companion.messages.ownship import FlightMode
from companion.preflight.autopilot_parameters import WantedParameters
from companion.preflight.listening import VehicleListener
from companion.preflight.parameters import VehicleLimits
from companion.preflight.vehicle import judge_vehicle
from companion.recording.recorder import NullRecorder
from companion.runtime.ports import Inbox
from companion.runtime.wiring import build_pipeline

MISSION = Path(__file__).resolve().parents[1] / "missions" / "land_static.yaml"
GROWTH_MAX_MB = 5.0
WARM_SHARE = 0.1  # of the bytes, after which growth is counted
TICK_S = 0.02
MODES = (FlightMode.OFFBOARD, FlightMode.AUTO_LOITER, FlightMode.AUTO_LAND)


def frame(dice: random.Random, message_id: int, extra: int) -> bytes:
    """Build one frame whose checksum is right and everything else is random."""
    payload = dice.randbytes(dice.choice((1, 9, 20, 60, 233, 255)))
    if dice.random() < 0.3:  # many fields are small numbers in truth
        payload = bytes(byte & dice.choice((0, 1, 3, 255)) for byte in payload)
    ours = dice.random() < 0.9
    source = bytes((1, 1)) if ours else dice.randbytes(2)
    signed = dice.random() < 0.3
    head = bytes((len(payload), int(signed), 0, dice.randrange(256))) + source + message_id.to_bytes(3, "little")
    crc = crc16.mcrf4xx(head + payload + bytes((extra,)))
    whole = b"\xfd" + head + payload + crc.to_bytes(2, "little")
    return whole + (dice.randbytes(13) if signed else b"")


def odometry(dice: random.Random, t: float) -> bytes:
    """Build an odometry with a usable attitude; the rest may be anything up to the link's limit."""
    scale = dice.choice((0.0, 1.0, 10.0, 1e3, 1e6))
    numbers = [scale * dice.uniform(-1.0, 1.0) for _ in range(9)]
    q = [dice.gauss(0.0, 1.0) for _ in range(4)]
    norm = math.sqrt(sum(x * x for x in q)) or 1.0
    stamp = round((t + dice.choice((0.0, 0.0, 0.0, -0.1, 0.3, -5.0, 1e6))) * 1e6) & (2**64 - 1)
    fields = (*numbers[:3], *(x / norm for x in q), *numbers[3:])
    payload = struct.pack("<Q13f168x4B", stamp, *fields, 1, dice.choice((1, 12)), dice.choice((11, 11, 12)), 0)
    head = bytes((len(payload), 0, 0, dice.randrange(256), 1, 1, 75, 1, 0))
    crc = crc16.mcrf4xx(head + payload + bytes((incoming.WANTED[incoming.ODOMETRY],)))
    return b"\xfd" + head + payload + crc.to_bytes(2, "little")


def heartbeat(dice: random.Random) -> bytes:
    """Build a sensible heartbeat, so that the link stays connected and its commands stay alive."""
    mode = dice.choice((6 << 16, 3 << 24 | 4 << 16, 6 << 24 | 4 << 16, 3 << 16))
    payload = mode.to_bytes(4, "little") + bytes((2, 12, 29 | dice.choice((0, 128)), dice.choice((3, 4, 5)), 3))
    head = bytes((9, 0, 0, dice.randrange(256), 1, 1, 0, 0, 0))
    crc = crc16.mcrf4xx(head + payload + b"\x32")
    return b"\xfd" + head + payload + crc.to_bytes(2, "little")


class Subject:
    """A link with all that reads from it."""

    def __init__(self, signing: Signing | None) -> None:
        self.link = AutopilotLink(LinkParameters(), signing)
        self.listener = VehicleListener(self.link, listen_s=6.0, patience_s=10.0, parameters=WantedParameters().rules)
        self.framer = StreamFramer()

    def tick(self, t: float, datagrams: list[bytes], dice: random.Random) -> None:
        if dice.random() < 0.02:
            self.link.request_mode(dice.choice(MODES), t)
            self.link.arm(t) if dice.random() < 0.5 else self.link.disarm(t)
            self.link.request_parameter(dice.choice(tuple(WantedParameters().rules)))
        self.listener.tick(t, [(t, datagram) for datagram in datagrams])
        if dice.random() < 0.02:
            for finding in judge_vehicle(self.listener.report(t), VehicleLimits(), WantedParameters().rules):
                str(finding)
        for datagram in datagrams[:1]:
            self.link.recognises(datagram)


def traffic(dice: random.Random, t: float) -> list[bytes]:
    """Build what arrives in one tick."""
    ids = tuple(incoming.WANTED.items())
    parts = [heartbeat(dice)] if dice.random() < 0.05 else []
    if dice.random() < 0.5:
        parts.append(odometry(dice, t))
    for _ in range(dice.randrange(12)):
        message_id, extra = dice.choice(ids)
        parts.append(frame(dice, message_id, extra))
        if dice.random() < 0.1:
            parts.append(dice.randbytes(dice.randrange(1, 40)))
    return parts


def run(total: int, seed: int) -> tuple[float, dict[str, int]]:
    """Feed `total` bytes; give the growth of memory [MB] after warming up, and counts."""
    dice = random.Random(seed)
    pipeline = build_pipeline(load_flight(MISSION), NullRecorder())
    subjects = [Subject(None), Subject(Signing(secret=bytes(range(32)), link_id=1, timestamp=10**12))]
    fed, ticks, base = 0, 0, None
    tracemalloc.start()
    while fed < total:
        t = (ticks + 1) * TICK_S
        parts = traffic(dice, t)
        fed += sum(map(len, parts))
        ticks += 1
        pipeline.step(t, Inbox(datagrams=[(t, part) for part in parts]))
        for subject in subjects:
            if ticks % 2:
                datagrams = parts
            else:
                stream = b"".join(parts)
                cut = dice.randrange(len(stream) + 1)
                datagrams = [f for piece in (stream[:cut], stream[cut:]) for f in subject.framer.feed(piece)]
            subject.tick(t, datagrams, dice)
        if base is None and fed >= WARM_SHARE * total:
            base = tracemalloc.get_traced_memory()[0]
    growth = (tracemalloc.get_traced_memory()[0] - (base or 0)) / 1e6
    tracemalloc.stop()
    plain = subjects[0].link.statistics()
    counts = {
        "bytes": fed,
        "ticks": ticks,
        "frames": plain.frames,
        "undecodable": plain.undecodable,
        "refused by signature": subjects[1].link.statistics().unbelieved,
    }
    return growth, counts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bytes", type=int, default=10_000_000)
    parser.add_argument("--seed", type=int, default=1)
    words = parser.parse_args()
    started = time.perf_counter()
    growth, counts = run(words.bytes, words.seed)
    print(f"link fuzz, seed {words.seed}: " + ", ".join(f"{value} {name}" for name, value in counts.items()))
    print(f"  exceptions 0, memory {growth:+.2f} MB (below {GROWTH_MAX_MB:g}), {time.perf_counter() - started:.0f} s")
    return 0 if growth < GROWTH_MAX_MB and counts["undecodable"] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
