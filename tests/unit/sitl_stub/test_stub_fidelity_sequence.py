"""Comparing what two flights reported: samples of a state, floods of texts, landings taken back."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sitl_stub.fidelity import sequence
from sitl_stub.fidelity.flight import HEARTBEAT, LANDED_STATE, STATE, TEXT, Flight, Report, Track
from sitl_stub.fidelity.recording import Recording, read_recording

EXTRACT = Path(__file__).parents[2] / "data" / "px4_sih"
RECORDING = read_recording(EXTRACT, "q07_descent_05")
END = 20.0
HOLD, RETURN, LANDED, FLYING = (4, 3, 157, 4), (4, 5, 157, 5), (1,), (2,)


def flight(reports: list[Report], *, climbs: bool = False) -> Flight:
    t = np.arange(0.0, END, 0.02)
    position = np.zeros((t.size, 3))
    if climbs:
        position[:, 2] = -0.2 * np.sin(t) ** 2
    truth = Track(t=t, position=position, velocity=np.zeros((t.size, 3)))
    return replace(RECORDING.flight, truth=truth, reports=tuple(sorted(reports, key=lambda r: r.t)))


def recording(px4: Flight) -> Recording:
    return replace(RECORDING, start=0.0, end=END, flight=px4)


def says(channel: str, *what: tuple[float, tuple[Any, ...]], words: str = "") -> list[Report]:
    return [Report(t=t, channel=channel, value=value, words=words) for t, value in what]


def beats_pass(px4: list[Report], stub: list[Report]) -> bool:
    return sequence.compare(recording(flight(px4)), flight(stub), HEARTBEAT).passed


def test_a_state_between_two_heartbeats_may_be_unseen_but_not_invented() -> None:
    seen = says(HEARTBEAT, (1.5, HOLD), (9.5, RETURN), (10.5, HOLD))
    assert beats_pass(seen, says(STATE, (0.0, HOLD), (9.6, RETURN), (10.4, HOLD)))
    assert not beats_pass(seen, says(STATE, (0.0, HOLD)))
    unseen = says(HEARTBEAT, (1.5, HOLD))
    assert beats_pass(unseen, says(STATE, (0.0, HOLD), (9.6, RETURN), (10.4, HOLD)))
    assert not beats_pass(unseen, says(STATE, (0.0, HOLD), (9.6, RETURN), (11.4, HOLD)))


def test_a_state_that_comes_late_fails_although_heartbeats_are_rare() -> None:
    seen = says(HEARTBEAT, (1.5, HOLD), (9.5, RETURN))
    assert beats_pass(seen, says(STATE, (0.0, HOLD), (9.75, RETURN)))
    assert not beats_pass(seen, says(STATE, (0.0, HOLD), (9.85, RETURN)))


def test_in_a_flood_of_one_text_others_may_be_lost() -> None:
    flood = [report for k in range(100) for report in says(TEXT, (5.0 + 0.02 * k, (2,)), words="invalid")]
    other = says(TEXT, (6.0, (6,)), words="RTL")
    assert sequence.compare(recording(flight([*flood, *other])), flight(flood), TEXT).passed
    assert not sequence.compare(
        recording(flight([*flood, *says(TEXT, (9.0, (6,)), words="RTL")])), flight(flood), TEXT
    ).passed
    few = flood[:10]
    assert not sequence.compare(
        recording(flight([*few, *says(TEXT, (5.1, (6,)), words="RTL")])), flight(few), TEXT
    ).passed


def chain(*times: float) -> list[Report]:
    """Landed, not landed, landed and so on, with what is said."""
    reports = says(LANDED_STATE, (0.0, FLYING))
    for k, t in enumerate(times):
        reports += says(LANDED_STATE, (t + 0.05, FLYING if k % 2 else LANDED))
        reports += says(TEXT, (t, (6,)), words="Takeoff detected" if k % 2 else "Landing detected")
    return [*reports, *says(TEXT, (times[-1] + 2.0, (6,)), words="Disarmed by landing")]


def test_a_landing_that_is_taken_back_on_the_ground_belongs_to_the_touchdown() -> None:
    px4, stub = chain(10.0, 11.4, 12.6), chain(7.0)
    for channel in (TEXT, LANDED_STATE):
        assert sequence.compare(recording(flight(px4)), flight(stub), channel).passed
        assert sequence.compare(recording(flight(stub)), flight(px4), channel).passed
        assert not sequence.compare(recording(flight(px4, climbs=True)), flight(stub), channel).passed
    assert flight(px4).landings() == [12.6]
    assert flight(px4, climbs=True).landings() == [10.0, 12.6]
