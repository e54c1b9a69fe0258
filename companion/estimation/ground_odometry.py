"""Odometry over the ground for a rover: the autopilot's, without what its wheels cannot have done.

PX4 without wheel odometry is wrong by 0.2 m/s for seconds, in speed and in the rate of its position, its heading
wanders by some degrees, and everything that is seen from the rover seems to drift by as much. Wheels do not slide
sideways: with the body origin a distance b ahead of the rear axle, its sideways speed is b times the yaw rate. A rover
whose throttle is shut stands. And gyros are good for minutes. So

    velocity = along * forward + b * r * right,   heading = integral of r
    along = 0 at rest; by a landmark where one is seen; else forward . (v_est - bias) - slip

with r the yaw rate, the bias that of the estimated velocity against the rate of the estimated position, and the slip
what of it was seen at rest or by a landmark, forgotten in between. A target that stands is a landmark. What is left of
the error lies along the heading. The position is the integral of that velocity: a frame of its own, level, which
begins at the autopilot's and turns and drifts away from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Protocol

from annotated_types import Ge, Gt, Le

from companion.estimation.bias_observer import BiasObserver
from companion.geometry.arrays import Array, frozen
from companion.geometry.rotations import rotation_about_z
from companion.messages.ownship import OwnshipState


class Odometry(Protocol):
    """What the planner's side takes for the vehicle's motion."""

    def take(self, state: OwnshipState, *, standing: bool, landmark: Array | None) -> OwnshipState:
        """Give the motion to go by.

        Args:
            state: as the autopilot tells it.
            standing: the vehicle is told to stand, or disarmed.
            landmark: velocity (3,) [m/s], to go by, relative to something that stands and is seen; None: there is none.
        """

    @property
    def resting(self) -> bool:
        """Whether the vehicle is known to stand."""

    def turned(self, vector_ned: Array) -> Array:
        """Give a vector (3,) of the autopilot's frame in the frame to go by."""

    def point_told(self, point_ned: Array) -> Array:
        """Give a point (3,) [m] of the frame to go by in the autopilot's."""

    def vector_told(self, vector_ned: Array) -> Array:
        """Give a vector (3,) of the frame to go by in the autopilot's."""


class AutopilotOdometry:
    """The autopilot's own."""

    resting = False

    def take(self, state: OwnshipState, *, standing: bool, landmark: Array | None) -> OwnshipState:  # noqa: ARG002
        """Give it as it is."""
        return state

    def turned(self, vector_ned: Array) -> Array:
        """Give a vector as it is."""
        return vector_ned

    def point_told(self, point_ned: Array) -> Array:
        """Give a point as it is."""
        return point_ned

    def vector_told(self, vector_ned: Array) -> Array:
        """Give a vector as it is."""
        return vector_ned


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
    """Holds place and heading between messages.

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
        self._turn = 0.0  # [rad] heading to go by, minus the autopilot's
        self.resting = False

    def turned(self, vector_ned: Array) -> Array:
        """Give a vector (3,) of the autopilot's frame in the frame to go by."""
        result: Array = rotation_about_z(self._turn) @ vector_ned
        return result

    def point_told(self, point_ned: Array) -> Array:
        """Give a point (3,) [m] of the frame to go by in the autopilot's; as seen from the vehicle it stays."""
        if self._known is None or self._told is None:
            return point_ned
        away = self.vector_told(point_ned - self._known.position_ned)
        away[2] = point_ned[2] - self._known.position_ned[2]
        result: Array = self._told.position_ned + away
        return result

    def vector_told(self, vector_ned: Array) -> Array:
        """Give a vector (3,) of the frame to go by in the autopilot's."""
        result: Array = rotation_about_z(-self._turn) @ vector_ned
        return result

    def take(self, state: OwnshipState, *, standing: bool, landmark: Array | None) -> OwnshipState:
        """Give the motion over the ground; see `Odometry.take`."""
        self._bias.add(
            t=state.t,
            reset_counter=state.reset_counter,
            velocity_ned=state.velocity_ned,
            position_ned=state.position_ned,
        )
        if not standing:
            self._t_moved = state.t
        self.resting = state.t - self._t_moved > self._p.rest_s
        known, told = self._known, self._told
        elapsed = self._p.pause_s if known is None else max(state.t - known.t, 0.0)
        rate = 0.0 if self.resting else float(state.angular_velocity_frd[2])
        if known is not None and told is not None and elapsed <= self._p.pause_s:
            before = 0.0 if self.resting else float(told.angular_velocity_frd[2])
            self._turn = math.remainder(known.yaw + 0.5 * (before + rate) * elapsed - state.yaw, math.tau)
        velocity = self._velocity(state, rate, elapsed, landmark)
        place = self._place(state, velocity, elapsed)
        result = replace(
            state,
            position_ned=frozen([*place, float(state.position_ned[2])]),
            velocity_ned=frozen([*velocity, float(state.velocity_ned[2])]),
            ned_from_frd=frozen(rotation_about_z(self._turn) @ state.ned_from_frd),
        )
        self._known, self._told = result, state
        return result

    def _velocity(self, state: OwnshipState, rate: float, elapsed: float, landmark: Array | None) -> list[float]:
        """Give the velocity over the ground, north and east [m/s]."""
        north, east, _ = (state.velocity_ned - self._bias.bias_ned).tolist()
        along = math.cos(state.yaw) * north + math.sin(state.yaw) * east
        cosine, sine = math.cos(state.yaw + self._turn), math.sin(state.yaw + self._turn)
        known = 0.0 if self.resting else None
        if known is None and landmark is not None:
            known = cosine * float(landmark[0]) + sine * float(landmark[1])
        if known is None:
            self._slip *= math.exp(-elapsed / self._p.slip_memory_s)
            along -= self._slip
        else:
            self._slip += -math.expm1(-elapsed / self._p.slip_smoothing_s) * (along - known - self._slip)
            along = known
        aside = self._rear * rate
        return [cosine * along - sine * aside, sine * along + cosine * aside]

    def _place(self, state: OwnshipState, velocity: list[float], elapsed: float) -> list[float]:
        """Give the position, north and east [m]."""
        known, told = self._known, self._told
        if known is None or told is None:
            return [float(state.position_ned[0]), float(state.position_ned[1])]
        if elapsed <= self._p.pause_s:
            way = [0.5 * elapsed * (a + b) for a, b in zip(known.velocity_ned.tolist()[:2], velocity, strict=True)]
        elif state.reset_counter == told.reset_counter:
            way = self.turned(state.position_ned - told.position_ned).tolist()[:2]
        else:
            way = [0.0, 0.0]
        return [a + b for a, b in zip(known.position_ned.tolist()[:2], way, strict=True)]
