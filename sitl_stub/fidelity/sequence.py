"""Compares what two flights reported: the same things in the same order, and at the same times."""

import math
from collections.abc import Iterator, Sequence

from sitl_stub.fidelity.flight import ARMED, HEARTBEAT, LANDED_STATE, MODE, STATE, STATES, TEXT, Flight, Report
from sitl_stub.fidelity.recording import Recording
from sitl_stub.fidelity.row import Row

TIME = 0.3
"""Tolerance of times [s]."""
PERIOD = {HEARTBEAT: 1.0, LANDED_STATE: 0.2, MODE: 0.0, ARMED: 0.0}
"""A state that is only told every so often [s] is known to have changed within that time before it was told."""

FLOOD_GAP, FLOOD_TIME = 0.2, 1.0
"""A text that is repeated at least so often [s] for so long [s] fills the autopilot's queue of texts."""
QUEUE_TIME = 0.4
"""So long [s] a full queue takes to empty."""


def compare(recording: Recording, flight: Flight, channel: str) -> Row:
    """Compare one channel: values must be equal, times within `TIME`, by the clock or since the landing."""
    if channel == HEARTBEAT and flight.channel(STATE):
        return _compare_beats(recording, flight)
    floods = [*_floods(recording.flight), *_floods(flight)] if channel == TEXT else []
    px4, stub = _sequence(recording.flight, channel, floods), _sequence(flight, channel, floods)
    name = f"{recording.name}: {channel}"
    late = bool(px4 and stub) and px4[0].t > recording.start >= stub[0].t
    if channel in STATES and late and stub[0].value != px4[0].value:
        stub = stub[1:]  # the recording began to listen after this state
    period = PERIOD.get(channel, 0.0)
    counts = len(px4), len(stub)
    px4 = _without_last(px4, counts[1], recording.flight.end - period)
    stub = _without_last(stub, counts[0], flight.end - period)
    same = 0
    while same < min(len(px4), len(stub)) and px4[same].value == stub[same].value:
        same += 1
    tolerance = f"same order, {TIME} s"
    if same < max(len(px4), len(stub)):
        return Row(name=name, stub=_where(stub, same), px4=_where(px4, same), tolerance=tolerance, passed=False)
    apart = [
        (gap, report)
        for report, other in zip(stub, px4, strict=True)
        if (gap := _gap(report.t, other.t, _anchors(flight), _anchors(recording.flight), period)) > TIME
    ]
    count = len(px4)
    if apart:
        gap, report = max(apart, key=lambda item: item[0])
        words = f"{count}; {report.value} at {report.t:.1f} s off by {gap:.2f} s"
        return Row(name=name, stub=words, px4=f"{count}", tolerance=tolerance, passed=False)
    return Row(name=name, stub=f"{count} equal", px4=f"{count}", tolerance=tolerance, passed=True)


def _compare_beats(recording: Recording, flight: Flight) -> Row:
    """Compare each HEARTBEAT of PX4 with what the stub's would have said within `TIME` of that moment.

    HEARTBEAT samples the state once a second: whether it shows one that lasted less is chance, so not the samples of
    both are compared but PX4's samples with the stub's state.
    """
    name, tolerance = f"{recording.name}: {HEARTBEAT}", f"as PX4's beats, {TIME} s"
    states = flight.channel(STATE)
    changes = len(_sequence(recording.flight, HEARTBEAT, []))
    for t, beat in _beats(recording.flight):
        moments = [m for m in _moments(t, _anchors(flight), _anchors(recording.flight)) if m < flight.end - TIME]
        shown = {report.value for moment in moments for report in _around(states, moment)}
        if moments and beat.value not in shown:
            says = " or ".join("/".join(map(str, value)) for value in sorted(shown, key=str))
            px4 = f"{changes}; {_plain(beat)} at {t:.1f} s"
            return Row(name=name, stub=f"{says} at {t:.1f} s", px4=px4, tolerance=tolerance, passed=False)
    return Row(name=name, stub="as PX4", px4=f"{changes}", tolerance=tolerance, passed=True)


def _beats(flight: Flight) -> Iterator[tuple[float, Report]]:
    """Every HEARTBEAT with its time [s]; recordings have only those that bring something new."""
    changes = [report for report in flight.channel(HEARTBEAT) if report.t > 0.0]
    ends = [report.t for report in changes[1:]] + [flight.end]
    for report, end in zip(changes, ends, strict=True):
        t = report.t
        while t < end - 0.5 * PERIOD[HEARTBEAT] or t == report.t:
            yield t, report
            t += PERIOD[HEARTBEAT]


def _moments(t: float, stub: Sequence[float], px4: Sequence[float]) -> list[float]:
    """Times [s] in the stub's flight for PX4's `t`: by the clock, and by the landing, whose time depends on chance."""
    found = [t]
    for mine, other in zip(stub, px4, strict=False):
        if t > other - TIME:
            found.append(mine + t - other)
        elif t > mine - TIME:
            found.append(mine - TIME)
    return found


def _around(states: Sequence[Report], moment: float) -> Iterator[Report]:
    """What was the case at some time within `TIME` of a moment [s]."""
    ends = [report.t for report in states[1:]] + [math.inf]
    for report, end in zip(states, ends, strict=True):
        if report.t <= moment + TIME and end >= moment - TIME:
            yield report


def _floods(flight: Flight) -> Iterator[tuple[float, float, str]]:
    """Begin and end [s] of each flood of one text, and its words."""
    last: dict[str, tuple[float, float]] = {}
    for report in [*flight.channel(TEXT), Report(t=math.inf, channel=TEXT, value=())]:
        for words, (begin, end) in list(last.items()):
            if report.t - end > FLOOD_GAP:
                del last[words]
                if end - begin > FLOOD_TIME:
                    yield begin, end + QUEUE_TIME, words
        begin = last.get(report.words, (report.t, report.t))[0]
        last[report.words] = (begin, report.t)


def _sequence(flight: Flight, channel: str, floods: Sequence[tuple[float, float, str]]) -> list[Report]:
    """Reports of a channel up to shortly before the end; of a text that is repeated only the first."""
    found = [report for report in flight.channel(channel) if report.t < flight.end - TIME]
    if channel in (TEXT, LANDED_STATE):
        # part of the chain from touchdown to landed, whose length depends on chance
        chance = flight.taken_back()
        found = [r for r in found if not any(begin <= r.t < end for begin, end in chance)]
    if channel != TEXT:
        return found
    # PX4 loses most of 50 texts a second: how many of them come through is chance, and which others
    found = [r for r in found if not any(begin < r.t < end and r.words != words for begin, end, words in floods)]
    return [report for i, report in enumerate(found) if i == 0 or report.words != found[i - 1].words]


def _without_last(reports: list[Report], count: int, end: float) -> list[Report]:
    """Leave out a report so close to the end that the other flight, with `count` reports, may have ended before it."""
    return reports[:-1] if len(reports) == count + 1 and reports[-1].t > end - 2.0 * TIME else reports


def _anchors(flight: Flight) -> list[float]:
    """Times since which later events are judged: landings, whose time depends on chance."""
    return flight.landings()


def _gap(stub: float, px4: float, stub_anchors: Sequence[float], px4_anchors: Sequence[float], period: float) -> float:
    """Difference of two times [s], by the clock or since the same landing, whichever is smaller."""
    gaps = [abs(stub - px4)]
    for mine, other in zip(stub_anchors, px4_anchors, strict=False):
        if stub > mine - TIME and px4 > other - TIME:
            gaps.append(abs((stub - mine) - (px4 - other)))
    return max(0.0, min(gaps) - period)


def _where(reports: Sequence[Report], index: int) -> str:
    """Say what comes at a place of a sequence, and how long the sequence is."""
    if index >= len(reports):
        return f"{len(reports)}; then nothing"
    report = reports[index]
    words = f" {report.words[:40]!r}" if report.words else ""
    return f"{len(reports)}; no. {index + 1} is {_plain(report)} at {report.t:.1f} s{words}"


def _plain(report: Report) -> str:
    return "/".join(map(str, report.value))
