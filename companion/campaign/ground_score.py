"""Scores a drive, or a free-flyer's flight, against the truth, while it is driven and in constant memory.

Success is Patel et al.'s: tracked throughout, and, after the target has stopped, no farther than 0.25 m and 0.20 rad
from the place `standoff` behind it, at its heading. Along-track and cross-track are along and across the target's
heading. Nothing here trusts the companion's estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.campaign.float_limits import FloatLimits, FloatMonitor
from companion.campaign.forecast_score import ForecastScorer
from companion.campaign.limits import DriveLimits, DriveMonitor
from companion.campaign.result import FlightResult, Outcome
from companion.campaign.score import OUTCOME_OF_STATE, Spread, is_acquired, station_keeping
from companion.campaign.sight import Sight
from companion.campaign.truth import TruthSample
from companion.geometry.angles import wrap_angle
from companion.messages.decision import Mode, Switch
from companion.messages.motion import AnySetpoint
from companion.messages.ownship import OwnshipState
from companion.messages.target import Prediction, TargetTrack
from companion.runtime.ports import MissionState

_STANDING_MPS = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundScoring:
    """What counts as what."""

    goal: Outcome = Outcome.FOLLOWED  # what the mission is for: intercepted or followed
    standoff_m: Annotated[float, Ge(0.0)] = 1.25
    target: str | None = None  # name of the target in the world; None: its first
    coast_s: Annotated[float, Ge(0.0)] = 2.0  # the track may be without a measurement for this long (the mission's)
    position_m: Annotated[float, Gt(0.0)] = 0.25  # farther off after the stop is a failure
    angle_rad: Annotated[float, Gt(0.0)] = 0.20  # turned farther off likewise


class GroundScorer:
    """Takes what happens in the order of time, and gives the result at the end.

    Args:
        parameters: what counts as what.
        limits: what the drive must keep to.
    """

    def __init__(self, parameters: GroundScoring, limits: DriveLimits | FloatLimits) -> None:
        self._p = parameters
        self._limits = FloatMonitor(limits) if isinstance(limits, FloatLimits) else DriveMonitor(limits)
        self._history: list[Switch] = []
        self._first: TruthSample | None = None
        self._last: TruthSample | None = None
        self._ended = False
        self._distance, self._angle = Spread(), Spread()
        self._track_began: float | None = None
        self._sight = Sight()  # until it is over
        self._forecasts = ForecastScorer()

    @property
    def settled(self) -> bool:
        """Whether there is nothing more to see: it is over, and both stand."""
        last = self._last
        if last is None or not self._ended or last.target(self._p.target).moving:
            return False
        return math.hypot(last.velocity_ned[0], last.velocity_ned[1]) < _STANDING_MPS

    def truth(self, sample: TruthSample) -> None:
        """Take one sample of the truth."""
        target = sample.target(self._p.target)
        self._first = self._first or sample
        self._last = sample
        self._limits.truth(sample, target)
        on_station = any(switch.mode is Mode.FOLLOW for switch in self._history)
        if target.moving and on_station and not self._ended:
            along, across, angle = self._errors(sample)
            self._distance.add(math.hypot(along, across))
            self._angle.add(abs(angle))

    def switched(self, switch: Switch) -> None:
        """Take one change of mode."""
        self._history.append(switch)
        self._ended |= switch.mode in (Mode.DONE, Mode.ABORT)

    def setpoint(self, setpoint: AnySetpoint) -> None:
        """Take one setpoint as it was sent."""
        self._limits.setpoint(setpoint)

    def measured(self, t: float, *, began: float) -> None:
        """Take the capture time [s] of a fused measurement and of its track's first one; see `FlightScorer`."""
        anew = began != self._track_began and not is_acquired(self._history)
        self._track_began = began
        if not self._ended or anew or self._sight.last is None:
            self._sight.take(t, anew=anew)

    def predicted(self, track: TargetTrack | None, prediction: Prediction | None, ownship: OwnshipState | None) -> None:
        """Take what was known at the step of the newest truth."""
        last = self._last
        if track is None or prediction is None or ownship is None or last is None or self._ended:
            return
        target = last.target(self._p.target)
        self._forecasts.look(age=track.age, prediction=prediction, ownship=ownship, sample=last, target=target)

    def finish(
        self, *, state: MissionState, reason: str, seed: int, wall_s: float, t_end: float | None
    ) -> FlightResult:
        """Give the result; arguments as for `FlightScorer.finish`."""
        along, across, angle = (None, None, None) if self._last is None else self._errors(self._last)
        outcome, why = self._outcome(state, reason)
        start = 0.0 if self._first is None else self._first.t
        end = t_end if t_end is not None else (start if self._last is None else self._last.t)
        return FlightResult(
            outcome=outcome,
            success=outcome is self._p.goal,
            reason=why,
            position_error_m=None if along is None or across is None else math.hypot(along, across),
            along_error_m=None if along is None else abs(along),
            cross_error_m=None if across is None else abs(across),
            path_rmse_m=self._forecasts.rmse,
            forecast_path=self._forecasts.first,
            angular_error_rad=None if angle is None else abs(angle),
            station_keeping=station_keeping(self._distance, self._angle),
            duration_s=max(0.0, end - start),
            touchdown_speed_mps=None,
            mode_history=tuple(self._history),
            limits_violated=self._limits.violations,
            tracking_gap_s=self._tracking_gap(t_end),
            wall_s=wall_s,
            seed=seed,
        )

    def _errors(self, sample: TruthSample) -> tuple[float, float, float]:
        """Give how far the place is ahead and to the right [m] along the target's heading, and turned [rad]."""
        target = sample.target(self._p.target)
        north = target.position_ned[0] - sample.position_ned[0]
        east = target.position_ned[1] - sample.position_ned[1]
        cosine, sine = math.cos(target.yaw), math.sin(target.yaw)
        along = cosine * north + sine * east - self._p.standoff_m
        return along, cosine * east - sine * north, wrap_angle(target.yaw - sample.yaw)

    def _outcome(self, state: MissionState, reason: str) -> tuple[Outcome, str]:
        if state is not MissionState.HELD:
            mode = self._history[-1].mode.value if self._history else "nothing"
            return OUTCOME_OF_STATE.get(state, Outcome.FAILED), reason or f"the time was up in mode {mode}"
        fault = self._fault()
        if fault:
            return Outcome.FAILED, fault
        return self._p.goal, reason

    def _fault(self) -> str | None:
        """Say what spoils a drive that has ended as the mission asked."""
        gap, last = self._tracking_gap(None), self._last
        if gap is None or last is None:
            return "the target was never tracked"
        if gap > self._p.coast_s:
            return f"the target went unseen for {gap:.1f} s; {self._p.coast_s:g} s are allowed"
        if self._limits.violations:
            return self._limits.violations[0].sentence
        if last.target(self._p.target).moving:
            return "the target still moves"
        along, across, angle = self._errors(last)
        distance = math.hypot(along, across)
        if distance > self._p.position_m or abs(angle) > self._p.angle_rad:
            return (
                f"ended {distance:.2f} m and {abs(angle):.2f} rad off; at most {self._p.position_m:g} m and "
                f"{self._p.angle_rad:g} rad"
            )
        return None

    def _tracking_gap(self, t_end: float | None) -> float | None:
        if self._last is None:
            return None
        ended = next((switch.t for switch in self._history if switch.mode in (Mode.DONE, Mode.ABORT)), None)
        end = ended if ended is not None else self._last.t if t_end is None else t_end
        return self._sight.longest(end)
