from __future__ import annotations

import importlib.util
import math
import struct
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from link_fake_autopilot import FakeAutopilot, raw_frame, signed

from companion.link import incoming
from companion.link.autopilot_link import AutopilotLink
from companion.link.frames import FrameReader
from companion.link.parameters import LinkParameters

_SETTINGS = settings(max_examples=200, deadline=None)
_IDS = sorted(incoming.WANTED)


def connected_link() -> AutopilotLink:
    link = AutopilotLink(LinkParameters())
    link.receive(FakeAutopilot().heartbeat(), 1000.0)
    link.arm(1000.0)
    link.poll(1000.0)
    return link


def exercise(link: AutopilotLink, t: float) -> None:
    for datagram in link.poll(t):
        assert isinstance(datagram, bytes)
    link.status(t)
    link.statistics()
    for event in link.events():
        assert str(event)
    for state in link.take_ownship():
        for array in (state.position_ned, state.velocity_ned, state.acceleration_ned, state.ned_from_frd):
            assert np.isfinite(array).all()
        assert math.isfinite(state.t)


@_SETTINGS
@given(st.lists(st.binary(max_size=400), max_size=20))
def test_random_bytes_never_raise(datagrams):
    link = connected_link()
    for k, datagram in enumerate(datagrams):
        link.receive(datagram, 1000.0 + 0.1 * k)
        exercise(link, 1000.0 + 0.1 * k)


@_SETTINGS
@given(
    st.lists(st.tuples(st.sampled_from(_IDS), st.binary(min_size=1, max_size=255), st.booleans()), max_size=20),
)
def test_garbage_with_a_right_checksum_never_raises(frames):
    link = connected_link()
    for k, (identifier, payload, sign) in enumerate(frames):
        frame = raw_frame(identifier, payload, incoming.WANTED[identifier])
        link.receive(signed(frame, incoming.WANTED[identifier]) if sign else frame, 1000.0 + 0.2 * k)
        exercise(link, 1000.0 + 0.2 * k)
    assert link.statistics().undecodable == 0


@_SETTINGS
@given(st.lists(st.floats(width=32), min_size=13, max_size=13), st.integers(0, 2**64 - 1))
def test_odometry_of_any_floats_gives_finite_states(numbers, stamp):
    link = connected_link()
    numbers[3:7] = [1.0, 0.0, 0.0, 0.0]  # a usable attitude, so that some get through
    payload = struct.pack("<Q13f168xBBBBb", stamp, *numbers, 1, 1, 11, 8, 0)
    for k in range(3):
        link.receive(raw_frame(331, payload, 91), 1000.0 + 0.02 * k)
        exercise(link, 1000.0 + 0.02 * k)


@_SETTINGS
@given(st.binary(max_size=60).filter(lambda data: not {0xFD, 0xFE} & set(data)), st.integers(0, 3))
def test_garbage_before_a_frame_does_not_hide_it(garbage, copies):
    reader = FrameReader(incoming.WANTED, system=1, component=1)
    frames = [FakeAutopilot().heartbeat() for _ in range(copies)]
    found = reader.read(garbage + b"".join(garbage + frame for frame in frames))
    assert len(found) == copies
    assert reader.bad_bytes == len(garbage) * (copies + 1)


@_SETTINGS
@given(st.integers(0, 20), st.integers(1, 255))
def test_one_wrong_byte_costs_at_most_its_own_frame(position, change):
    autopilot = FakeAutopilot()
    damaged, good = bytearray(autopilot.heartbeat()), autopilot.heartbeat()
    damaged[position % len(damaged)] ^= change
    reader = FrameReader(incoming.WANTED, system=1, component=1)
    reader.read(bytes(damaged))
    assert len(reader.read(good)) == 1


def test_random_messages_into_everything_behind_the_link_leave_no_trace():
    """The short form of bench/link_fuzz.py."""
    path = Path(__file__).parents[3] / "bench" / "link_fuzz.py"
    spec = importlib.util.spec_from_file_location("link_fuzz", path)
    assert spec is not None
    assert spec.loader is not None
    bench = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(bench)
    growth, counts = bench.run(400_000, seed=7)
    assert counts["undecodable"] == 0
    assert counts["frames"] > 1000
    assert growth < 1.0
