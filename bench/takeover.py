"""From the first datagram with the news of a takeover to the last setpoint, over sockets, the wire watched.

`companion fly` against `sitl-stub` in real time. In one flight, again and again: engage, take over, wait, engage again.
The news comes from the simulator itself (modes), or is put on the wire where it sends (sticks, kill, failsafe).
Run: python bench/takeover.py [--trials 20] (about three minutes). Required: each within 100 ms, and no mode asked for.
"""

from __future__ import annotations

import argparse
import random
import struct
import time

from fastcrc import crc16
from programs import Programs, programs
from pymavlink.dialects.v20 import common as mavlink
from wire import COMMAND_LONG, CURRENT_MODE, HEARTBEAT

from companion.link.event_names import event_id

ALLOWED_S, WATCHED_S = 0.100, 1.0
LOITER, RETURN, OFFBOARD = 3 << 24 | 4 << 16, 5 << 24 | 4 << 16, 6 << 16


def frame(message_id: int, payload: bytes, extra: int) -> bytes:
    payload = payload.rstrip(b"\0") or b"\0"
    head = bytes((len(payload), 0, 0, 0, 1, 1)) + message_id.to_bytes(3, "little")
    return b"\xfd" + head + payload + crc16.mcrf4xx(head + payload + bytes((extra,))).to_bytes(2, "little")


def sticks(roll: int) -> bytes:
    return frame(65, struct.pack("<I18HBB", 1, 1500 + roll, 1500, 1300, 1500, *(0xFFFF,) * 14, 4, 255), 118)


def manual(pitch: int) -> bytes:
    return frame(69, struct.pack("<4hHB", pitch, 0, 500, 0, 0, 1), 243)


def event(name: str) -> bytes:
    return frame(410, struct.pack("<IIHBBB", event_id(name), 1000, 7, 0, 0, 0x22), 160)


def heartbeat(system_status: int) -> bytes:
    return frame(0, struct.pack("<IBBBBB", OFFBOARD, 2, 12, 145, system_status, 3), 50)


INJECTED = {
    "sticks (RC_CHANNELS)": lambda: sticks(120),
    "sticks (MANUAL_CONTROL)": lambda: manual(-250),
    "kill (EVENT)": lambda: event("commander_kill_sw_engaged"),
    "kill (HEARTBEAT)": lambda: heartbeat(8),
    "failsafe (EVENT)": lambda: event("commander_failsafe_enter"),
    "CRITICAL (HEARTBEAT)": lambda: heartbeat(5),
}
KINDS = ("mode change", *INJECTED)


def ask_for_mode(running: Programs, custom_mode: int) -> None:
    """Set a mode as a ground station does, by a datagram to the simulator."""
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    running.wire.to_simulator(bytes(mavlink.MAVLink_set_mode_message(1, 1, custom_mode).pack(station)))


def first_news_of_mode(running: Programs, since: float) -> float | None:
    """Give when the first datagram passed that shows a mode other than OFFBOARD."""
    for passed in running.wire.down[-4000:]:
        shows_mode = passed.t >= since and passed.message_id in (HEARTBEAT, CURRENT_MODE)
        if shows_mode and int.from_bytes(passed.payload.ljust(4, b"\0")[:4], "little") != OFFBOARD:
            return passed.t
    return None


def trial(running: Programs, kind: str) -> tuple[float, bool]:
    """Take over once; give the delay [s] of the silence, and whether a mode was asked for afterwards."""
    since = time.monotonic()
    if kind == "mode change":
        ask_for_mode(running, RETURN)
        running.until(lambda: first_news_of_mode(running, since) is not None, 5.0, "the mode changes")
        t_news = first_news_of_mode(running, since)
    else:
        t_news = running.wire.inject(INJECTED[kind]())
    time.sleep(WATCHED_S)
    late = [setpoint.t - t_news for setpoint in running.wire.setpoints(t_news)]
    asked = [p for p in running.wire.up if p.t > t_news + ALLOWED_S and is_mode_request(p)]
    return max(late, default=0.0), bool(asked)


def is_mode_request(passed) -> bool:
    return passed.message_id == COMMAND_LONG and passed.payload.ljust(33, b"\0")[28:30] == (176).to_bytes(2, "little")


def engage(running: Programs) -> None:
    """Bring the vehicle to Hold, let the news be old, and engage."""
    running.wire.inject(sticks(0))
    running.wire.inject(manual(0))
    if running.status()["armed"]:
        ask_for_mode(running, LOITER)
        running.until(lambda: running.status()["vehicle"] == "AUTO.LOITER", 5.0, "Hold")
    running.until(lambda: running.order("engage")["accepted"], 20.0, "engaging")
    running.until(lambda: running.status()["guardian"] == "following", 15.0, "following a trajectory")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    dice, delays, asked = random.Random(args.seed), [], 0
    with programs("--set", "steps.0.takeoff.height_m=3") as running:
        running.until(running.operator.exists, 60.0, "the operator's socket")
        running.until(lambda: running.status()["engage"] == "possible", 60.0, "ready to engage")
        for number in range(args.trials):
            kind = KINDS[number % len(KINDS)]
            engage(running)
            time.sleep((8.0 if number == 0 else 0.3) + dice.uniform(0.0, 0.5))
            delay, again = trial(running, kind)
            muted = running.status()["guardian"] == "muted"
            note = "" if muted else ": NOT MUTED"
            print(f"{number + 1:3d}  {kind:24s} last setpoint {1e3 * delay:5.1f} ms after the news{note}", flush=True)
            delays.append(delay if muted else float("inf"))
            asked += again
        starved = running.stop_stub()
    good = sum(delay <= ALLOWED_S for delay in delays)
    print(f"simulator behind the clock by {starved:.1f} s in all (it shares the machine)")
    print(f"muted within {1e3 * ALLOWED_S:.0f} ms: {good} of {len(delays)}; slowest {1e3 * max(delays):.1f} ms")
    print(f"modes asked for afterwards: {asked} of {len(delays)}")


if __name__ == "__main__":
    main()
