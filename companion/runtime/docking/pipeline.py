"""The heart of a docking: readings in, nozzle pulses out. Reads no clock, opens nothing, rolls no dice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from companion.control.rigid_body.controller import RigidBodyController
from companion.estimation.proximity.filter import ProximityFilter
from companion.guidance.docking.guidance import DockingGuidance
from companion.messages.docking import DockingDecision
from companion.messages.proximity import (
    FeatureReading,
    GyroReading,
    NozzlePulses,
    PoseGoal,
    ProximityState,
    RangeReading,
)
from companion.recording import Recorder
from companion.recording.serialise import to_record

Reading = GyroReading | RangeReading | FeatureReading
_CHANNELS: dict[type, str] = {GyroReading: "gyro", RangeReading: "range", FeatureReading: "features"}


@dataclass(frozen=True, slots=True, kw_only=True)
class GatedRange:
    """What the estimator's gate said about a range."""

    t: float  # [s] when it was taken
    anchor: int
    accepted: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingStep:
    """What one step came to."""

    state: ProximityState
    decision: DockingDecision
    goal: PoseGoal
    pulses: NozzlePulses
    ranges: tuple[GatedRange, ...]  # that came to the gate in this step


class DockingPipeline:
    """Estimator, guidance and controller; `step` is called once in each control period."""

    def __init__(
        self,
        *,
        estimator: ProximityFilter,
        guidance: DockingGuidance,
        controller: RigidBodyController,
        recorder: Recorder | None,
    ) -> None:
        self._filter = estimator
        self._guidance = guidance
        self._controller = controller
        self._recorder = recorder

    def step(self, t: float, readings: Sequence[Reading], *, contact: bool = False) -> DockingStep:
        """Take what the sensors gave, decide, and give the pulses of the period that begins now.

        Args:
            t: now [s].
            readings: what has arrived since the last step, in any order.
            contact: the docking switch is closed.
        """
        gated: list[GatedRange] = []
        for reading in readings:
            self._take(reading, gated)
            if self._recorder is not None:
                self._recorder.record(_CHANNELS[type(reading)], reading.t, to_record(reading))
        state = self._filter.state(t)
        decision, goal = self._guidance.step(t, state, contact=contact)
        pulses = self._controller.step(t, state, goal)
        self._filter.command(pulses)
        step = DockingStep(state=state, decision=decision, goal=goal, pulses=pulses, ranges=tuple(gated))
        if self._recorder is not None:
            _record(self._recorder, t, step)
        return step

    def _take(self, reading: Reading, gated: list[GatedRange]) -> None:
        if isinstance(reading, GyroReading):
            self._filter.gyro(reading)
        elif isinstance(reading, RangeReading):
            verdict = self._filter.range(reading)
            if verdict.degrees:
                gated.append(GatedRange(t=reading.t, anchor=reading.anchor, accepted=verdict.accepted))
        else:
            self._filter.features(reading)


def _record(recorder: Recorder, t: float, step: DockingStep) -> None:
    for channel, message in (
        ("proximity", step.state),
        ("docking", step.decision),
        ("pose_goal", step.goal),
        ("pulses", step.pulses),
    ):
        recorder.record(channel, t, to_record(message))
