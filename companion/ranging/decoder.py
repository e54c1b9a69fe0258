"""From messages of a ranging device to readings of the estimator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from companion.messages.proximity import RangeReading
from companion.ranging.parameters import RangingParameters
from companion.ranging.survey import AnchorSurvey, id_text
from companion.ranging.wire import Fault, WireMessage, WireRange

_SEQUENCES = 2**32
_OVERTAKEN = 64  # messages; one that comes so much late or later is the first of a device that has started anew
_GAP = 10_000  # likewise a larger jump ahead
_NAMED_MOST = 16  # unknown anchors and tags that are named: a damaged device must not fill the log


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """What one message has brought."""

    readings: tuple[RangeReading, ...] = ()
    remarks: tuple[str, ...] = ()  # plain, for the operator; each once


@dataclass(frozen=True, slots=True, kw_only=True)
class RangingStatistics:
    """What a decoder has counted."""

    messages: int  # that came, good or not
    readings: int  # delivered
    missed: int  # messages that never came, by gaps of the sequence
    faults: Mapping[Fault, int]  # messages and single ranges not used, by reason
    by_anchor: tuple[int, ...]  # readings of each anchor of the survey


class RangingDecoder:
    """Holds what is remembered from message to message: the sequence, the tag, what was counted and told.

    Args:
        decode: of the format; gives a message or a fault and never raises (`decode_packet`, `decode_line`).
        survey: the anchors.
        parameters: latency, the tag, what is plausible.
    """

    def __init__(
        self, decode: Callable[[bytes], WireMessage | Fault], survey: AnchorSurvey, parameters: RangingParameters
    ) -> None:
        self._decode = decode
        self._survey = survey
        self._parameters = parameters
        self._index = {anchor.id: index for index, anchor in enumerate(survey.anchors)}
        self._tag = parameters.tag
        self._sequence: int | None = None
        self._messages = self._missed = 0
        self._faults: Counter[Fault] = Counter()
        self._by_anchor = [0] * len(survey.anchors)
        self._named: set[tuple[str, int]] = set()

    def decode(self, data: bytes, t_arrival: float) -> Decoded:
        """Take the bytes of one message that arrived at `t_arrival` [s]. Never raises."""
        self._messages += 1
        message = self._decode(data)
        if isinstance(message, Fault):
            self._faults[message] += 1
            return Decoded()
        if message.tag is not None:
            if self._tag is None:
                self._tag = message.tag
            if message.tag != self._tag:
                self._faults[Fault.OTHER_TAG] += 1
                return Decoded(remarks=self._name_tag(message.tag, self._tag))
        fault = None if message.sequence is None else self._follow(message.sequence)
        if fault is not None:
            self._faults[fault] += 1
            return Decoded()
        return self._readings(message, t_arrival)

    def statistics(self) -> RangingStatistics:
        """Give what has been counted."""
        return RangingStatistics(
            messages=self._messages,
            readings=sum(self._by_anchor),
            missed=self._missed,
            faults=MappingProxyType(dict(self._faults)),
            by_anchor=tuple(self._by_anchor),
        )

    def _follow(self, sequence: int) -> Fault | None:
        """Follow the sequence; give why the message is not to be used."""
        before, fault = self._sequence, None
        if before is not None:
            step = (sequence - before + _SEQUENCES // 2) % _SEQUENCES - _SEQUENCES // 2
            if step == 0:
                fault = Fault.DUPLICATE
            elif -_OVERTAKEN < step < 0 and sequence:
                fault = Fault.LATE
            elif 1 < step < _GAP:
                self._missed += step - 1
        if fault is None:
            self._sequence = sequence
        return fault

    def _readings(self, message: WireMessage, t_arrival: float) -> Decoded:
        readings: list[RangeReading] = []
        remarks: list[str] = []
        for item in message.ranges:
            index = self._index.get(item.anchor)
            if index is None:
                self._faults[Fault.UNKNOWN_ANCHOR] += 1
                remarks += self._name_anchor(item.anchor)
                continue
            corrected = item.range - self._survey.anchors[index].delay
            fault = self._wrong_with(item, corrected)
            if fault is not None:
                self._faults[fault] += 1
                continue
            self._by_anchor[index] += 1
            t = t_arrival - item.age - self._parameters.latency_s
            readings.append(RangeReading(t=t, anchor=index, range=corrected))
        return Decoded(readings=tuple(readings), remarks=tuple(remarks))

    def _wrong_with(self, item: WireRange, corrected: float) -> Fault | None:
        if item.range <= 0.0 or not 0.0 < corrected <= self._parameters.range_most_m:
            return Fault.IMPLAUSIBLE
        if item.age > self._parameters.age_most_s:
            return Fault.STALE
        return Fault.DISTRUSTED if item.quality == 0 else None

    def _name_tag(self, heard: int, ours: int) -> tuple[str, ...]:
        if not self._first(("tag", heard)):
            return ()
        return (
            f"the radio {id_text(heard)} sends ranges too; those of {id_text(ours)} are used: "
            "set ranging.tag to the id of this vehicle's radio",
        )

    def _name_anchor(self, anchor: int) -> tuple[str, ...]:
        if not self._first(("anchor", anchor)):
            return ()
        text = f"{anchor:x}"
        if text.isdecimal() and int(text) in self._index:
            right = f"it has {text}, which is decimal: write {id_text(anchor)} there if that is the one"
        else:
            right = "add it there with its place, or switch it off"
        name = f"{id_text(anchor)} (decimal {anchor})"
        return (f'the survey "{self._survey.name}" has no anchor {name}, to which ranges come; {right}',)

    def _first(self, what: tuple[str, int]) -> bool:
        if what in self._named or len(self._named) >= _NAMED_MOST:
            return False
        self._named.add(what)
        return True
