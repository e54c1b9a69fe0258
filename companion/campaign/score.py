"""Scores a flight against the truth, while it is flown and in constant memory.

Every figure is defined in docs/components/campaign.md. Nothing here trusts the companion's estimate; of the
companion's own word only three things are used: which mode it was in, when it fused a measurement of the target, and
why it gave up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Gt, Interval

from companion.campaign.limits import FlightLimits, LimitMonitor, LimitTolerances
from companion.campaign.result import FlightResult, Outcome, StationKeeping
from companion.campaign.sight import Sight
from companion.campaign.truth import TargetSample, TruthSample
from companion.geometry.angles import wrap_angle
from companion.messages.decision import Mode, Switch
from companion.messages.motion import AnySetpoint, Setpoint
from companion.runtime.ports import MissionState

_DESCENT = (Mode.LAND, Mode.AUTOPILOT_LAND, Mode.TOUCHDOWN, Mode.DONE)
_BEFORE_TARGET = (Mode.PREFLIGHT, Mode.TAKEOFF, Mode.TRANSIT, Mode.SEARCH)
OUTCOME_OF_STATE = {
    MissionState.REFUSED: Outcome.REFUSED,
    MissionState.WRONG_VEHICLE: Outcome.REFUSED,
    MissionState.NO_VEHICLE: Outcome.FAILED,
    MissionState.LOST: Outcome.FAILED,
    MissionState.ABORTED: Outcome.ABORTED,
    MissionState.HELD: Outcome.HELD,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoringParameters:
    """What counts as what."""

    goal: Outcome = Outcome.LANDED  # what the mission is for: landed, followed or held
    target: str | None = None  # name of the target in the world; None: its first
    coast_s: Annotated[float, Ge(0.0)] = 2.0  # the track may be without a measurement for this long (the mission's)
    rest_s: Annotated[float, Gt(0.0)] = 5.0  # disarmed with all feet on the pad for this long: landed
    feet: Annotated[int, Interval(ge=1, le=16)] = 4  # of the landing gear
    clear_height_m: Annotated[float, Gt(0.0)] = 1.0  # body origin above the landing point: surely in the air
    sample_s: Annotated[float, Gt(0.0)] = 0.02  # period of the samples


class Spread:
    """Mean and standard deviation of a stream (Welford)."""

    def __init__(self) -> None:
        self.count = 0
        self.mean = 0.0
        self._squares = 0.0

    def add(self, value: float) -> None:
        """Take the next value."""
        self.count += 1
        step = value - self.mean
        self.mean += step / self.count
        self._squares += step * (value - self.mean)

    @property
    def std(self) -> float:
        """Standard deviation of what has come; 0 where nothing has."""
        return math.sqrt(max(0.0, self._squares / self.count)) if self.count else 0.0


def station_keeping(distance: Spread, angle: Spread) -> StationKeeping | None:
    """Give how well the vehicle kept station, None where it did not; `distance` in [m], `angle` in [rad]."""
    if not distance.count:
        return None
    return StationKeeping(
        position_mean_m=distance.mean, position_std_m=distance.std, angle_mean_rad=angle.mean, angle_std_rad=angle.std
    )


def is_acquired(history: list[Switch]) -> bool:
    """Say whether a mission has gone by its target already."""
    return any(switch.mode not in _BEFORE_TARGET for switch in history)


class FlightScorer:
    """Takes what happens in the order of time, and gives the result at the end.

    Args:
        parameters: what counts as what.
        limits: what the flight must keep to.
        tolerances: by how much a limit may be exceeded.
    """

    def __init__(
        self, parameters: ScoringParameters, limits: FlightLimits, tolerances: LimitTolerances | None = None
    ) -> None:
        self._parameters = parameters
        self._limits = LimitMonitor(limits, tolerances)
        self._history: list[Switch] = []
        self._first: TruthSample | None = None
        self._last: TruthSample | None = None
        self._moved = False  # the target, at any time
        self._keeping = True  # station-keeping is still measured
        self._distance, self._angle = Spread(), Spread()
        self._flown = False  # the vehicle has been clear of the ground
        self._touch: tuple[float, float] | None = None  # t [s] and speed [m/s] of the first contact of the last descent
        self._rest_since: float | None = None  # t [s] since when disarmed with all feet on one surface
        self._rest_surface = ""
        self._track_began: float | None = None
        self._sight = Sight()  # up to the contact
        self._sight_on = Sight()  # past it: what counts if the vehicle lifts off once more

    @property
    def landed(self) -> bool:
        """Whether the vehicle has stood disarmed, all feet on the pad, for the time that a landing takes."""
        last = self._last
        return last is not None and self._rest_time >= self._parameters.rest_s and self._on_target(last)

    @property
    def settled(self) -> bool:
        """Whether it has stood disarmed, all feet on anything, for that time: there is nothing more to see."""
        return self._rest_time >= self._parameters.rest_s and self._flown

    def truth(self, sample: TruthSample) -> None:
        """Take one sample of the truth."""
        target = sample.target(self._parameters.target)
        if self._first is None:
            self._first = sample
        self._limits.truth(sample)
        self._watch_contact(sample, target)
        self._watch_rest(sample)
        self._watch_station(sample, target)
        self._last = sample

    def switched(self, switch: Switch) -> None:
        """Take one change of mode."""
        self._history.append(switch)

    def setpoint(self, setpoint: AnySetpoint) -> None:
        """Take one setpoint as it was sent."""
        if isinstance(setpoint, Setpoint):
            self._limits.setpoint(setpoint)

    def measured(self, t: float, *, began: float) -> None:
        """Take the capture time [s] of a fused measurement; the same one may come many times.

        Args:
            t: of the measurement.
            began: of the one with which its track began. Until the target is acquired, a new track counts anew: what
                was given up has shown something else.
        """
        anew = began != self._track_began and not is_acquired(self._history)
        self._track_began = began
        self._sight_on.take(t, anew=anew)
        if self._touch is None or t <= self._touch[0]:
            self._sight.take(t, anew=anew)

    def finish(
        self, *, state: MissionState, reason: str, seed: int, wall_s: float, t_end: float | None
    ) -> FlightResult:
        """Give the result.

        Args:
            state: how the mission stands by its own word.
            reason: why, by its own word.
            seed: of the simulation.
            wall_s: time on the wall [s].
            t_end: when the mission ended by its own word [s]; None: it did not.
        """
        outcome, why = self._outcome(state, reason)
        position_error, angular_error = self._errors_at_rest()
        if outcome is Outcome.LANDED:
            why = f"landed {position_error or 0.0:.3f} m from the landing point, {angular_error or 0.0:.4f} rad off"
        return FlightResult(
            outcome=outcome,
            success=outcome is self._parameters.goal,
            reason=why,
            position_error_m=position_error,
            angular_error_rad=angular_error,
            station_keeping=station_keeping(self._distance, self._angle),
            duration_s=self._duration(t_end),
            touchdown_speed_mps=None if self._touch is None else self._touch[1],
            mode_history=tuple(self._history),
            limits_violated=self._limits.violations,
            tracking_gap_s=self._tracking_gap(),
            wall_s=wall_s,
            seed=seed,
        )

    # What happens

    def _watch_contact(self, sample: TruthSample, target: TargetSample) -> None:
        start = self._first or sample
        if sample.feet_in_contact == 0:
            above_start = start.position_ned[2] - sample.position_ned[2]
            above_pad = target.position_ned[2] - sample.position_ned[2]
            if min(above_start, above_pad) > self._parameters.clear_height_m:
                self._flown = True
                if self._touch is not None:  # no landing: it was seen, or not, all the time
                    self._touch, self._sight = None, replace(self._sight_on)
        elif self._flown and self._touch is None:
            before = self._last or sample
            speed = max(_closing_speed(before, sample, target), _closing_speed(sample, sample, target))
            self._touch = (sample.t, speed)
            self._limits.touchdown(sample.t, speed)

    def _watch_rest(self, sample: TruthSample) -> None:
        at_rest = not sample.armed and sample.feet_in_contact == self._parameters.feet
        if not at_rest:
            self._rest_since = None
        elif self._rest_since is None or sample.surface != self._rest_surface:
            self._rest_since = sample.t
        self._rest_surface = sample.surface

    def _watch_station(self, sample: TruthSample, target: TargetSample) -> None:
        if target.moving:
            self._moved = True
        if not self._moved or not self._keeping:
            return
        if self._history and self._history[-1].mode in _DESCENT:
            self._keeping = False
            return
        self._distance.add(_distance(sample, target))
        self._angle.add(abs(wrap_angle(sample.yaw - target.yaw)))

    # What it came to

    @property
    def _rest_time(self) -> float:
        if self._rest_since is None or self._last is None:
            return 0.0
        return self._last.t - self._rest_since + 0.5 * self._parameters.sample_s

    def _on_target(self, sample: TruthSample) -> bool:
        return sample.surface == sample.target(self._parameters.target).name

    def _outcome(self, state: MissionState, reason: str) -> tuple[Outcome, str]:
        gave_up = state in OUTCOME_OF_STATE and state is not MissionState.HELD
        if self._parameters.goal is Outcome.LANDED and not gave_up and (self.landed or state is MissionState.LANDED):
            return self._judge_landing()
        if state is MissionState.HELD and self._parameters.goal in (Outcome.HELD, Outcome.FOLLOWED):
            fault = self._fault(tracked=self._parameters.goal is Outcome.FOLLOWED)
            return (Outcome.FAILED, fault) if fault else (self._parameters.goal, reason)
        if state in OUTCOME_OF_STATE:
            return OUTCOME_OF_STATE[state], reason
        if state is MissionState.LANDED:
            return Outcome.FAILED, f"the vehicle landed, but the mission should end {self._parameters.goal.value}"
        mode = self._history[-1].mode.value if self._history else "nothing"
        return Outcome.FAILED, f"the time was up in mode {mode}" + (f": {reason}" if reason else "")

    def _judge_landing(self) -> tuple[Outcome, str]:
        last = self._last
        if last is None:
            return Outcome.FAILED, "there is no truth to judge by"
        if not self.landed:
            return Outcome.FAILED, self._why_not_landed(last)
        fault = self._fault(tracked=True)
        return (Outcome.FAILED, f"on the pad, but {fault}") if fault else (Outcome.LANDED, "")

    def _why_not_landed(self, last: TruthSample) -> str:
        distance = _distance(last, last.target(self._parameters.target))
        if last.armed:
            return f"the vehicle is still armed, {distance:.2f} m from the landing point"
        if last.feet_in_contact < self._parameters.feet:
            return (
                f"only {last.feet_in_contact} of {self._parameters.feet} feet touch, {distance:.2f} m from the "
                "landing point"
            )
        if not self._on_target(last):
            return f'it stands on "{last.surface}", {distance:.2f} m from the landing point'
        return f"it stood on the pad for {self._rest_time:.1f} s only; {self._parameters.rest_s:g} s are needed"

    def _fault(self, *, tracked: bool) -> str | None:
        """Say what spoils a mission that has otherwise reached its goal."""
        gap = self._tracking_gap()
        if tracked and gap is None:
            return "the target was never tracked"
        if tracked and gap is not None and gap > self._parameters.coast_s:
            return f"the target went unseen for {gap:.1f} s; {self._parameters.coast_s:g} s are allowed"
        if self._limits.violations:
            return self._limits.violations[0].sentence
        return None

    def _tracking_gap(self) -> float | None:
        if self._last is None:
            return None
        return self._sight.longest(self._last.t if self._touch is None else self._touch[0])

    def _errors_at_rest(self) -> tuple[float | None, float | None]:
        last = self._last
        if last is None or not self.settled:
            return None, None
        target = last.target(self._parameters.target)
        return _distance(last, target), abs(wrap_angle(last.yaw - target.yaw))

    def _duration(self, t_end: float | None) -> float:
        if self._first is None or self._last is None:
            return 0.0
        if self.settled and self._rest_since is not None:
            end = self._rest_since
        else:
            end = self._last.t if t_end is None else t_end
        return max(0.0, end - self._first.t)


def _distance(sample: TruthSample, target: TargetSample) -> float:
    return math.hypot(sample.position_ned[0] - target.position_ned[0], sample.position_ned[1] - target.position_ned[1])


def _closing_speed(motion: TruthSample, contact: TruthSample, target: TargetSample) -> float:
    """Speed [m/s] of the body origin at `motion` relative to the surface met at `contact`."""
    north, east, down = motion.velocity_ned
    if contact.surface == target.name:
        arm_north = contact.position_ned[0] - target.position_ned[0]
        arm_east = contact.position_ned[1] - target.position_ned[1]
        north -= target.velocity_ned[0] - target.yaw_rate * arm_east
        east -= target.velocity_ned[1] + target.yaw_rate * arm_north
        down -= target.velocity_ned[2]
    return math.sqrt(north * north + east * east + down * down)
