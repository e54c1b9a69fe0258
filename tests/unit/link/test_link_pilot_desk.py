from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from companion.link.events import StatusText
from companion.link.incoming import StatusTextChunk
from companion.link.outgoing import Encoder
from companion.link.pilot_desk import (
    CHUNK,
    LONGEST,
    MODE_NUMBERS,
    NAME_LENGTH,
    PilotDesk,
    PilotParameters,
    chunks_of,
    custom_mode,
    mav_state,
)
from companion.link.texts import TextAssembler
from companion.messages.decision import Mode
from companion.messages.pilot import PilotText, Severity, Stand

TICK = 0.02


def encoder() -> Encoder:
    return Encoder(system=1, component=1, own_component=191)


def decoded(datagram: bytes):
    (message,) = mavlink.MAVLink(None).parse_buffer(datagram)
    return message


class Listener:
    """A desk polled at 50 Hz, and what a ground station makes of its datagrams."""

    def __init__(self, **parameters) -> None:
        self.desk = PilotDesk(PilotParameters(**parameters), (encoder(),))
        self.assembler = TextAssembler()
        self.t = 10.0
        self.messages: list = []
        self.texts: list[StatusText] = []

    def tick(self) -> int:
        sent = self.desk.poll(self.t, int(self.t * 1e3))
        for datagram in sent:
            message = decoded(datagram)
            self.messages.append((self.t, message))
            if message.get_type() == "STATUSTEXT":
                chunk = StatusTextChunk(
                    severity=message.severity,
                    text=message.text.encode() if isinstance(message.text, str) else message.text,
                    id=message.id,
                    chunk=message.chunk_seq,
                )
                self.texts += self.assembler.take(chunk, self.t)
        self.t += TICK
        return len(sent)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            self.tick()

    def words(self) -> list[str]:
        return [text.text for text in self.texts]


def say(listener: Listener, text: str, severity: Severity = Severity.INFO) -> None:
    listener.desk.say(PilotText(severity=severity, text=text))


@given(st.text(max_size=300))
def test_chunks_end_as_mavlink_wants_and_are_never_too_long(text: str) -> None:
    chunks = chunks_of(text)
    assert all(len(chunk) <= CHUNK for chunk in chunks)
    assert all(len(chunk) == CHUNK for chunk in chunks[:-1])
    assert len(chunks) == 1 or len(chunks[-1]) < CHUNK
    assert sum(map(len, chunks)) <= LONGEST
    assert b"\0" not in b"".join(chunks)


@given(st.text(alphabet=st.characters(min_codepoint=33, max_codepoint=126), max_size=LONGEST))
def test_chunks_reassemble_to_the_text(text: str) -> None:
    assert b"".join(chunks_of(text)).decode() == text


@pytest.mark.parametrize("length", [1, 49, 50, 51, 99, 100, 101, 120])
def test_texts_of_every_length_arrive_whole_one_after_the_other(length: int) -> None:
    listener = Listener()
    texts = ["a" * length, "b" * length, "c" * length]
    for text in texts:
        say(listener, text)
    listener.run(1.0)
    assert listener.words() == texts
    ids = [message.id for _, message in listener.messages]
    assert (set(ids) == {0}) is (length <= CHUNK)


def test_what_is_too_long_is_cut_at_a_word_and_marked() -> None:
    (whole,) = [b"".join(chunks_of("word " * 60)).decode()]
    assert whole.endswith("word...")
    assert LONGEST - 8 <= len(whole) <= LONGEST


def test_longer_texts_carry_numbers_of_their_own() -> None:
    listener = Listener()
    for letter in "abc":
        say(listener, letter * 60)
    listener.run(1.0)
    numbers = [key for key, _ in itertools.groupby(message.id for _, message in listener.messages)]
    assert len(numbers) == len(set(numbers)) == 3
    assert 0 not in numbers


def test_a_flapping_mode_cannot_flood_the_link_and_the_newest_is_told() -> None:
    listener = Listener(text_burst=8, text_rate=1.0)
    for index in range(3000):  # 60 s, another text in every tick
        say(listener, f"mode {index}: " + "x" * 90)
        assert listener.tick() <= 1
    assert len(listener.texts) <= 8 + 60 + 1
    per_second = [sum(1 for t, _ in listener.messages if s <= t < s + 1.0) for s in range(20, 70)]
    assert max(per_second) <= 3 * 2  # chunks of the texts that begin within any second, one a second
    listener.run(20.0)
    assert any(text.startswith("mode 2999:") for text in listener.words())
    assert any(text.endswith("messages left out") for text in listener.words())


def test_everything_is_told_or_counted() -> None:
    listener = Listener()
    for index in range(40):
        say(listener, f"text {index}")
    listener.run(60.0)
    told = [text for text in listener.words() if text.startswith("text")]
    left_out = [int(text.split()[0]) for text in listener.words() if text.endswith("left out")]
    assert len(told) + sum(left_out) == 40


def test_the_most_important_waiting_text_goes_first_and_is_not_dropped() -> None:
    listener = Listener(text_burst=1)
    say(listener, "first")
    listener.tick()
    say(listener, "the worst", Severity.CRITICAL)
    for index in range(50):
        say(listener, f"chatter {index}")
    listener.run(1.1)
    assert listener.texts[1].text == "the worst"
    assert listener.texts[1].severity == Severity.CRITICAL


def test_a_text_that_waits_is_not_taken_twice() -> None:
    listener = Listener(text_burst=1)
    for _ in range(5):
        say(listener, "again")
    listener.run(10.0)
    assert listener.words() == ["again"]


def test_numbers_come_at_their_rate_and_carry_the_newest_value() -> None:
    listener = Listener(value_rate=2.0)
    for index in range(500):  # 10 s
        listener.desk.show({"pad_dist": float(index), "pad_hgt": 1.0, "pad_tgo": float("nan")})
        assert listener.tick() <= 1
    names = [message.name for _, message in listener.messages]
    assert names.count("pad_dist") in (20, 21)
    assert names.count("pad_hgt") in (20, 21)
    assert "pad_tgo" not in names
    last = [message for _, message in listener.messages if message.name == "pad_dist"][-1]
    assert last.value > 470.0


def test_numbers_do_not_hold_up_texts() -> None:
    listener = Listener(value_rate=2.0)
    for _ in range(5):
        listener.desk.show({f"number_{index}": 1.0 for index in range(9)})
        listener.tick()
    say(listener, "x" * 80)
    listener.tick()
    listener.tick()
    assert listener.words() == ["x" * 80]


def test_a_name_that_px4_would_cut_is_refused() -> None:
    with pytest.raises(ValueError, match="longer than 9"):
        PilotDesk(PilotParameters(), (encoder(),)).show({"n" * (NAME_LENGTH + 1): 1.0})


def test_two_receivers_get_the_same_each_with_its_own_sequence() -> None:
    first, second = encoder(), encoder()
    second.heartbeat()
    desk = PilotDesk(PilotParameters(), (first, second))
    desk.say(PilotText(severity=Severity.NOTICE, text="hello"))
    one, other = (decoded(datagram) for datagram in desk.poll(1.0, 0))
    assert (one.severity, one.text) == (other.severity, other.text) == (Severity.NOTICE, "hello")
    assert (one.get_seq(), other.get_seq()) == (0, 1)


def test_heartbeat_numbers_tell_every_mode_and_stand_apart() -> None:
    assert set(MODE_NUMBERS) == set(Mode)
    numbers = {custom_mode(stand, mode) for stand in Stand for mode in Mode}
    assert len(numbers) == len(Stand) * len(Mode)
    assert all(0 < number < 2**16 for number in numbers)
    assert {mav_state(stand) for stand in (Stand.ENGAGED, Stand.GUIDING)} == {mavlink.MAV_STATE_ACTIVE}
    assert mav_state(Stand.FAILED) == mavlink.MAV_STATE_CRITICAL
    assert mav_state(Stand.MUTED) == mavlink.MAV_STATE_STANDBY
