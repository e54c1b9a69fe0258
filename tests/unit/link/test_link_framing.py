from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from link_fake_autopilot import FakeAutopilot, event_frame, raw_frame, signed

from companion.link.framing import LONGEST_FRAME, StreamFramer

_SETTINGS = settings(max_examples=150, deadline=None)
UNKNOWN = 12345  # in no dialect


def cut(data: bytes, pieces: random.Random) -> list[bytes]:
    parts, at = [], 0
    while at < len(data):
        length = pieces.randint(1, 40)
        parts.append(data[at : at + length])
        at += length
    return parts


def traffic(count: int) -> list[bytes]:
    autopilot = FakeAutopilot()
    makers = (
        autopilot.heartbeat,
        autopilot.estimator,
        lambda: autopilot.odometry(101.0),
        lambda: event_frame(99, log_level=4, arguments=b"abc"),
        lambda: signed(autopilot.heartbeat(), 50),
        autopilot.sys_status,
    )
    return [makers[k % len(makers)]() for k in range(count)]


@_SETTINGS
@given(st.randoms(use_true_random=False), st.binary(max_size=60).filter(lambda b: not {0xFD, 0xFE} & set(b)))
def test_frames_come_out_whole_however_the_stream_is_cut(pieces, garbage):
    frames = traffic(12)
    framer = StreamFramer()
    found = [frame for part in cut(garbage + garbage.join(frames), pieces) for frame in framer.feed(part)]
    assert found == frames
    assert framer.statistics().skipped == len(garbage) * 12
    assert framer.pending == 0


@_SETTINGS
@given(st.lists(st.binary(min_size=1, max_size=300), max_size=30))
def test_any_bytes_keep_the_buffer_bounded(parts):
    framer = StreamFramer()
    total = 0
    for part in parts:
        total += len(part)
        out = framer.feed(part)
        assert framer.pending <= LONGEST_FRAME
        total -= sum(map(len, out))
    assert framer.statistics().skipped + framer.pending == total


@pytest.mark.parametrize("false_start", [b"\xfd\xff\x00", b"\xfd\xff\x01\x00", b"\xfe\xff", b"\xfd" * 40, b"\xfe\x00"])
def test_a_false_beginning_hides_no_good_frame(false_start):
    framer = StreamFramer()
    frames = traffic(40)
    found = framer.feed(false_start + b"".join(frames))
    assert found == frames


def test_a_damaged_frame_costs_only_itself():
    frames = traffic(20)
    damaged = bytearray(frames[3])
    damaged[1] ^= 0x40  # its length: everything behind would be out of step
    framer = StreamFramer()
    assert framer.feed(b"".join([*frames[:3], bytes(damaged), *frames[4:]])) == [*frames[:3], *frames[4:]]


def test_an_unknown_message_counts_if_a_frame_follows_it():
    unknown = raw_frame(UNKNOWN, b"hello", 0)
    beat = FakeAutopilot().heartbeat()
    framer = StreamFramer()
    assert framer.feed(unknown) == []
    assert framer.feed(beat) == [unknown, beat]
    assert StreamFramer().feed(unknown + b"\x00" + beat) == [beat]


def test_a_stream_that_broke_off_begins_anew():
    beat = FakeAutopilot().heartbeat()
    framer = StreamFramer()
    framer.feed(beat[:10])
    framer.forget()
    assert framer.feed(beat) == [beat]
    assert framer.statistics().skipped == 10
