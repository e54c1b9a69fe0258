from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.ranging.decoder import RangingDecoder
from companion.ranging.lines import decode_line, plain_line
from companion.ranging.packet import decode_packet, encode_packet
from companion.ranging.parameters import RangingParameters
from companion.ranging.survey import Anchor, AnchorSurvey, SurveyFrame
from companion.ranging.wire import Fault, WireMessage, WireRange

SURVEY = AnchorSurvey(
    name="test",
    frame=SurveyFrame.PAD,
    anchors=(
        Anchor(id=0x10, position=(0.0, 0.0, 0.0)),
        Anchor(id=0x20, position=(1.0, 0.0, 0.0), delay=0.25),
        Anchor(id=9280, position=(0.0, 1.0, 0.0)),
    ),
)
PARAMETERS = RangingParameters(latency_s=0.005)


def decoder(parameters: RangingParameters = PARAMETERS) -> RangingDecoder:
    return RangingDecoder(decode_packet, SURVEY, parameters)


def packet(*ranges: WireRange, sequence: int = 0, tag: int = 7) -> bytes:
    return encode_packet(WireMessage(ranges=ranges, tag=tag, sequence=sequence))


def test_a_reading_has_the_surveys_number_its_own_time_and_no_delay() -> None:
    items = (WireRange(anchor=0x20, range=3.25, age=0.010), WireRange(anchor=0x10, range=2.0))
    readings = decoder().decode(packet(*items), 100.0).readings
    assert [reading.anchor for reading in readings] == [1, 0]
    assert [reading.range for reading in readings] == pytest.approx([3.0, 2.0])
    assert [reading.t for reading in readings] == pytest.approx([100.0 - 0.010 - 0.005, 100.0 - 0.005])


@pytest.mark.parametrize(
    ("item", "fault"),
    [
        (WireRange(anchor=0x10, range=0.0), Fault.IMPLAUSIBLE),
        (WireRange(anchor=0x10, range=300.1), Fault.IMPLAUSIBLE),
        (WireRange(anchor=0x20, range=0.2), Fault.IMPLAUSIBLE),  # less than its delay
        (WireRange(anchor=0x10, range=3.0, age=0.6), Fault.STALE),
        (WireRange(anchor=0x10, range=3.0, quality=0), Fault.DISTRUSTED),
        (WireRange(anchor=0x99, range=3.0), Fault.UNKNOWN_ANCHOR),
    ],
)
def test_a_range_that_cannot_be_is_refused_and_counted_and_the_others_are_used(item: WireRange, fault: Fault) -> None:
    under_test = decoder()
    decoded = under_test.decode(packet(item, WireRange(anchor=0x10, range=1.0)), 1.0)
    assert [reading.range for reading in decoded.readings] == [1.0]
    statistics = under_test.statistics()
    assert statistics.faults == {fault: 1}
    assert (statistics.messages, statistics.readings, statistics.by_anchor) == (1, 1, (1, 0, 0))


def test_an_unknown_anchor_is_named_once_and_a_decimal_mix_up_is_seen_through() -> None:
    under_test = decoder()
    first = under_test.decode(packet(WireRange(anchor=0x99, range=3.0), sequence=0), 1.0)
    again = under_test.decode(packet(WireRange(anchor=0x99, range=3.0), sequence=1), 1.1)
    mixed_up = under_test.decode(packet(WireRange(anchor=0x9280, range=3.0), sequence=2), 1.2)
    assert "0x0099 (decimal 153)" in first.remarks[0]
    assert again.remarks == ()
    assert "write 0x9280" in mixed_up.remarks[0]


def test_a_device_gone_mad_does_not_fill_the_log() -> None:
    under_test = decoder()
    remarks = [
        text
        for k in range(1000)
        for text in under_test.decode(packet(WireRange(anchor=1000 + k, range=1.0), sequence=k), 1.0).remarks
    ]
    assert 0 < len(remarks) <= 20


def follow(sequences: list[int]) -> RangingDecoder:
    under_test = decoder()
    for sequence in sequences:
        under_test.decode(packet(WireRange(anchor=0x10, range=1.0), sequence=sequence), 1.0)
    return under_test


@pytest.mark.parametrize(
    ("sequences", "missed", "used", "faults"),
    [
        ([5, 6, 7], 0, 3, {}),
        ([5, 8, 9], 2, 3, {}),
        ([2**32 - 1, 0, 1], 0, 3, {}),
        ([5, 5, 6], 0, 2, {Fault.DUPLICATE: 1}),
        ([5, 7, 6, 8], 1, 3, {Fault.LATE: 1}),
        ([5000, 0, 1], 0, 3, {}),  # started anew
        ([5000, 3, 4], 0, 3, {}),  # the first of them were lost
        ([5, 2_000_000, 2_000_001], 0, 3, {}),  # another counter, not two million lost
    ],
)
def test_gaps_are_counted_and_nothing_is_used_twice(sequences, missed, used, faults) -> None:
    statistics = follow(sequences).statistics()
    assert (statistics.missed, statistics.readings, dict(statistics.faults)) == (missed, used, faults)


def test_ranges_of_another_vehicles_radio_are_not_used() -> None:
    item = WireRange(anchor=0x10, range=1.0)
    for under_test, ours in ((decoder(), 7), (decoder(replace(PARAMETERS, tag=8)), 8)):
        others = [under_test.decode(packet(item, tag=tag, sequence=k), 1.0) for k, tag in enumerate([7, 8, 7, 8])]
        assert [bool(decoded.readings) for decoded in others] == [tag == ours for tag in (7, 8, 7, 8)]
        assert sum(len(decoded.remarks) for decoded in others) == 1
        assert under_test.statistics().faults == {Fault.OTHER_TAG: 2}


def test_text_lines_go_the_same_way() -> None:
    under_test = RangingDecoder(decode_line, SURVEY, PARAMETERS)
    (reading,) = under_test.decode(plain_line(0x20, 1250, 30), 10.0).readings
    assert (reading.anchor, reading.range, reading.t) == (1, pytest.approx(1.0), pytest.approx(9.965))


@settings(max_examples=100, deadline=None)
@given(st.lists(st.binary(max_size=120) | st.integers(0, 60), max_size=30))
def test_garbage_never_raises_and_every_message_is_accounted_for(items) -> None:
    good = packet(WireRange(anchor=0x10, range=1.0), WireRange(anchor=0x20, range=2.0, age=0.1), sequence=1)
    under_test = decoder()
    for k, item in enumerate(items):
        data = item if isinstance(item, bytes) else good[:item]
        for reading in under_test.decode(data, float(k)).readings:
            assert math.isfinite(reading.t)
            assert 0.0 < reading.range <= PARAMETERS.range_most_m
    statistics = under_test.statistics()
    assert statistics.messages == len(items)
    assert sum(statistics.faults.values()) + statistics.readings >= len(items)
