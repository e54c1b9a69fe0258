"""Compares what two flights reported: the same things in the same order, and at the same times."""

from collections.abc import Sequence

from sitl_stub.fidelity.flight import ARMED, HEARTBEAT, LANDED_STATE, MODE, STATES, TEXT, Flight, Report
from sitl_stub.fidelity.recording import Recording
from sitl_stub.fidelity.row import Row

TIME = 0.3
"""Tolerance of times [s]."""
PERIOD = {HEARTBEAT: 1.0, LANDED_STATE: 0.2, MODE: 0.0, ARMED: 0.0}
"""A state that is only told every so often [s] is known to have changed within that time before it was told."""


def compare(recording: Recording, flight: Flight, channel: str) -> Row:
    """Compare one channel: values must be equal, times within `TIME`, by the clock or since the landing."""
    px4, stub = _sequence(recording.flight, channel), _sequence(flight, channel)
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


def _sequence(flight: Flight, channel: str) -> list[Report]:
    """Reports of a channel up to shortly before the end; of a text that is repeated only the first."""
    found = [report for report in flight.channel(channel) if report.t < flight.end - TIME]
    if channel != TEXT:
        return found
    # PX4 loses some of 50 equal texts a second: how many come through is chance
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
