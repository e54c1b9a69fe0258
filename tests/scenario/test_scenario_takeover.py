"""With an operator: nothing before the word, the pilot takes the vehicle, the operator engages again, and it lands."""

from __future__ import annotations

from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mavlink

from companion.campaign.flight import SimulatedFlight
from companion.campaign.result import Outcome
from companion.config import load_flight
from companion.guardian.handover_frame import decode, encode
from companion.messages.decision import Mode
from companion.messages.guardian import GuardianState
from companion.messages.operator import OperatorOrder
from companion.runtime.ports import MissionState

MISSION = Path(__file__).resolve().parents[2] / "missions" / "land_static.yaml"
LOITER, POSCTL = 3 << 24 | 4 << 16, 3 << 16


class Day:
    """A simulated flight with an operator and a pilot, who act by `script`: instants in the mission to actions."""

    def __init__(self, seed: int) -> None:
        self.flight = SimulatedFlight(load_flight(MISSION), seed=seed, camera="corners", auto_engage=False)
        self.pilot = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self.modes: list[tuple[float, Mode]] = []
        self.states: list[MissionState] = []
        self.t = 0.0

    @property
    def pipeline(self):
        return self.flight.pipeline

    def pilot_wants(self, custom_mode: int) -> None:
        data = bytes(mavlink.MAVLink_set_mode_message(1, 1, custom_mode).pack(self.pilot))
        self.flight.simulation.receive("ground", data)

    def fly(self, act) -> None:
        """Fly to the end; `act(day)` looks at each step."""

        def on_progress(progress) -> None:
            self.t = progress.t
            decision = progress.snapshot.decision if progress.snapshot else None
            if decision is not None and decision.switched is not None and decision.t == progress.t:
                self.modes.append((progress.t, decision.mode))
            if not self.states or self.states[-1] is not progress.mission.state:
                self.states.append(progress.mission.state)
            act(self)

        self.result = self.flight.run(on_progress)


def test_the_pilot_takes_it_in_the_descent_and_the_operator_engages_again() -> None:
    day = Day(seed=3)
    seen: dict[str, float] = {}

    def act(day: Day) -> None:
        mode = day.modes[-1][1] if day.modes else Mode.PREFLIGHT
        state = day.pipeline.mission.state
        if day.t > 15.0 and "engaged" not in seen:
            assert state is MissionState.STANDBY
            assert day.pipeline.helm.order(OperatorOrder.ENGAGE).accepted
            seen["engaged"] = day.t
        elif mode is Mode.LAND and "taken" not in seen:
            seen["height"] = -day.flight.simulation.truth().vehicle.position_ned[2]
            day.pilot_wants(LOITER)
            seen["taken"] = day.t
        elif "taken" in seen and "again" not in seen and day.t > seen["taken"] + 0.1:
            assert day.pipeline.helm.state is GuardianState.MUTED
            if day.t > seen["taken"] + 8.0:
                assert state is MissionState.STANDBY
                answer = day.pipeline.helm.order(OperatorOrder.ENGAGE)
                assert answer.accepted, answer.text
                seen["again"] = day.t

    day.fly(act)
    assert not day.flight.simulation.truth().vehicle.armed
    assert day.result.outcome is Outcome.LANDED, day.result.reason
    assert day.states == [
        MissionState.WAITING,
        MissionState.STANDBY,
        MissionState.RUNNING,
        MissionState.STANDBY,
        MissionState.RUNNING,
        MissionState.LANDED,
    ]
    modes = [mode for _, mode in day.modes]
    assert modes.count(Mode.TAKEOFF) == 1
    assert modes[modes.index(Mode.LAND) + 1 :][:2] in ([Mode.ABORT, Mode.SEARCH], [Mode.SEARCH, Mode.APPROACH])


def test_without_the_word_nothing_is_flown() -> None:
    day = Day(seed=1)

    def act(day: Day) -> None:
        assert day.pipeline.helm.state is GuardianState.MUTED
        if day.t > 40.0:
            day.pipeline.helm.order(OperatorOrder.ABORT)

    day.fly(act)
    assert not day.flight.simulation.truth().vehicle.armed
    assert day.states[-1] is MissionState.ABORTED


@pytest.mark.parametrize("seed", [3])
def test_a_flight_whose_handovers_go_through_frames_lands_as_well(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    flight = SimulatedFlight(load_flight(MISSION), seed=seed, camera="corners")
    planner = flight.pipeline._planner
    step, count = planner.step, iter(range(1_000_000))
    monkeypatch.setattr(planner, "step", lambda *arguments: decode(encode(step(*arguments), next(count))))
    result = flight.run()
    assert result.outcome is Outcome.LANDED, result.reason
    assert result.limits_violated == ()
