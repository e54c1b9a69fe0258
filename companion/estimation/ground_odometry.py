"""Odometry over the ground for a rover: the autopilot's, without what its wheels cannot have done.

PX4 without wheel odometry is wrong by 0.2 m/s for seconds, in speed and in the rate of its position, and everything that
is seen from the rover seems to drift by as much. Wheels do not slide sideways: with the body origin a distance b ahead of
the rear axle, its sideways speed is b times the yaw rate. And a rover whose throttle is shut stands. So

    velocity = along * forward + b * yaw rate * right,   along = 0 at rest, else forward . (v_est - bias) - slip

with the bias of the estimated velocity against the rate of the estimated position, and the slip what of it was seen
along the heading at rest, forgotten while driving. What is left of the error lies along the heading. The position is the integral of that velocity: a frame of its own, which begins
where the autopilot's does and has its directions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Protocol

from annotated_types import Ge, Gt, Le

from companion.estimation.bias_observer import BiasObserver
from companion.geometry.arrays import Array, frozen
from companion.messages.ownship import OwnshipState

_NOTHING = frozen([0.0, 0.0, 0.0])


class Odometry(Protocol):
    """What the planner's side takes for the vehicle's motion."""

    def take(self, state: OwnshipState, *, standing: bool) -> OwnshipState:
        """Give the motion to go by.

        Args:
            state: as the autopilot tells it.
            standing: the vehicle is told to stand, or disarmed.
        """

    @property
    def offset_ned(self) -> Array:
        """The autopilot's position minus the one to go by (3,) [m]."""

    @property
    def bias_ned(self) -> Array:
        """The autopilot's velocity minus the one to go by (3,) [m/s]."""


class AutopilotOdometry:
    """The autopilot's own."""

    offset_ned = bias_ned = _NOTHING

    def take(self, state: OwnshipState, *, standing: bool) -> OwnshipState:  # noqa: ARG002  # the interface's
        """Give it as it is."""
        return state


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundOdometryParameters:
    """Tuning."""

    bandwidth: Annotated[float, Gt(0.0), Le(20.0)] = 4.0  # [rad/s] of the bias's observer
    bias_max: Annotated[float, Ge(0.0), Le(5.0)] = 0.8  # [m/s]
    rest_s: Annotated[float, Gt(0.0), Le(10.0)] = 0.7  # told to stand for so long it stands
    slip_smoothing_s: Annotated[float, Gt(0.0), Le(10.0)] = 0.2  # of what is seen at rest
    slip_memory_s: Annotated[float, Gt(0.0), Le(100.0)] = 3.0  # it is forgotten so slowly
    pause_s: Annotated[float, Gt(0.0), Le(5.0)] = 0.5  # over a longer pause it is taken to have moved as the autopilot


class GroundOdometry:
    """Holds the position between messages.

    Args:
        parameters: the tuning.
        rear_axle: behind the body origin [m].
    """

    def __init__(self, parameters: GroundOdometryParameters, *, rear_axle: float) -> None:
        self._p = parameters
        self._rear = rear_axle
        self._bias = BiasObserver(bandwidth=parameters.bandwidth, bias_max=parameters.bias_max)
        self._known: OwnshipState | None = None  # the last one given
        self._told: OwnshipState | None = None  # the last one taken
        self._t_moved = -math.inf
        self._slip = 0.0  # [m/s]
        self._offset = self._velocity_bias = _NOTHING

    @property
    def offset_ned(self) -> Array:
        """The autopilot's position minus the one to go by (3,) [m]."""
        return self._offset

    @property
    def bias_ned(self) -> Array:
        """The autopilot's velocity minus the one to go by (3,) [m/s]."""
        return self._velocity_bias

    def take(self, state: OwnshipState, *, standing: bool) -> OwnshipState:
        """Give the motion over the ground; see `Odometry.take`."""
        self._bias.add(
            t=state.t,
            reset_counter=state.reset_counter,
            velocity_ned=state.velocity_ned,
            position_ned=state.position_ned,
        )
        if not standing:
            self._t_moved = state.t
        elapsed = self._p.pause_s if self._known is None else state.t - self._known.t
        velocity = self._velocity(state, max(elapsed, 0.0), resting=state.t - self._t_moved > self._p.rest_s)
        north, east, down = state.position_ned.tolist()
        known, told = self._known, self._told
        if known is not None and told is not None:
            if 0.0 < elapsed <= self._p.pause_s:
                was = known.velocity_ned.tolist()[:2]
                way = [0.5 * elapsed * (a + b) for a, b in zip(was, velocity, strict=True)]
            elif state.reset_counter == told.reset_counter:
                way = (state.position_ned - told.position_ned).tolist()[:2]
            else:
                way = [0.0, 0.0]
            north, east = (float(a) + b for a, b in zip(known.position_ned[:2], way, strict=True))
        result = replace(
            state, position_ned=frozen([north, east, down]), velocity_ned=frozen([*velocity, state.velocity_ned[2]])
        )
        self._known, self._told = result, state
        self._offset = frozen(state.position_ned - result.position_ned)
        self._velocity_bias = frozen(state.velocity_ned - result.velocity_ned)
        return result

    def _velocity(self, state: OwnshipState, elapsed: float, *, resting: bool) -> list[float]:
        """Give the velocity over the ground, north and east [m/s]."""
        north, east, _ = (state.velocity_ned - self._bias.bias_ned).tolist()
        cosine, sine = math.cos(state.yaw), math.sin(state.yaw)
        along = cosine * north + sine * east
        if resting:
            self._slip += -math.expm1(-elapsed / self._p.slip_smoothing_s) * (along - self._slip)
            return [0.0, 0.0]
        self._slip *= math.exp(-elapsed / self._p.slip_memory_s)
        along -= self._slip
        aside = self._rear * float(state.angular_velocity_frd[2])
        return [cosine * along - sine * aside, sine * along + cosine * aside]
