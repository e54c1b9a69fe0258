"""The history of our own motion, and what a reset of the autopilot's estimator does to it."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array, frozen
from companion.geometry.quaternions import Quaternion, Triple, product, rotation_of, slerp, yaw_of_quaternion
from companion.geometry.rotations import quaternion_from_rotation, rotation_about_z
from companion.messages.ownship import OwnshipState


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnshipHistoryParameters:
    """How much of our own motion is kept, and how far it may be stretched."""

    duration: Annotated[float, Gt(0.0)] = 3.0  # [s] of history kept
    capacity: Annotated[int, Ge(2)] = 1024  # samples kept at most, whatever their rate
    extrapolation: Annotated[float, Ge(0.0)] = 0.15  # [s] beyond the newest sample (and into a gap) that is answered
    gap: Annotated[float, Gt(0.0)] = 0.3  # [s] between two samples above which nothing is interpolated


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OwnshipReset:
    """A jump of the autopilot's local frame: `x_new = R_z(yaw) @ x_old + translation_ned`.

    It keeps the vehicle where it was: the same point of the world has the coordinates x_old before the reset and x_new
    after it. Headings turn by `yaw`, velocities by `R_z(yaw)`.
    """

    t: float  # [s] of the first state after the reset
    translation_ned: Array  # (3,) [m]
    yaw: float  # [rad]
    counter: int  # reset counter after it

    def __post_init__(self) -> None:
        object.__setattr__(self, "translation_ned", frozen(self.translation_ned, (3,)))

    @property
    def rotation(self) -> Array:
        """`new_from_old`, (3, 3), a turn about down."""
        return rotation_about_z(self.yaw)

    def position(self, position_ned: Array) -> Array:
        """Take positions (3,) or (N, 3) [m] from the old frame to the new one."""
        moved: Array = position_ned @ self.rotation.T + self.translation_ned
        return moved


class OwnshipPose(NamedTuple):
    """Where the vehicle is and how it points."""

    north: float  # [m] in the autopilot's local frame
    east: float  # [m]
    down: float  # [m]
    yaw: float  # [rad]
    axes: Array  # (3, 2) forward and right axis of the vehicle, ned


class OwnshipVerdict(Enum):
    """What the history did with the newest input."""

    ADDED = "added"
    RESET = "added: the autopilot's estimator was reset"
    IGNORED_DUPLICATE = "ignored: same instant as the newest"
    IGNORED_OLD = "ignored: older than the newest"
    REFUSED_INVALID = "refused: not finite, or not a rotation"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sample:
    t: float
    position: Triple
    velocity: Triple
    acceleration: Triple
    attitude: Quaternion  # ned_from_frd
    rate: Triple  # angular velocity, frd


class OwnshipHistory:
    """Our own recent motion, as the autopilot estimates it, continuous across its resets.

    After a reset the samples from before it are taken into the new frame, so that differences of positions and headings
    across the reset are those of the vehicle, not of the frame.
    """

    def __init__(self, parameters: OwnshipHistoryParameters | None = None) -> None:
        self.parameters = parameters or OwnshipHistoryParameters()
        self._times: list[float] = []
        self._samples: list[_Sample] = []
        self._newest: OwnshipState | None = None
        self._verdict = OwnshipVerdict.ADDED
        self._refused = 0

    def __len__(self) -> int:
        return len(self._samples)

    @property
    def newest(self) -> OwnshipState | None:
        """The newest accepted state, as it was given."""
        return self._newest

    @property
    def verdict(self) -> OwnshipVerdict:
        """What happened to the newest input."""
        return self._verdict

    @property
    def refused(self) -> int:
        """How many inputs were refused or ignored so far."""
        return self._refused

    def add(self, state: OwnshipState) -> OwnshipReset | None:
        """Append a state. A bad one is left out and `verdict` says why.

        Returns:
            The jump of the local frame if this state is the first after a reset of the autopilot's estimator: computed
            against the previous state extrapolated to now.
        """
        if not _valid(state):
            self._refuse(OwnshipVerdict.REFUSED_INVALID)
            return None
        previous = self._newest
        if previous is not None and state.t <= previous.t:
            same = state.t == previous.t
            self._refuse(OwnshipVerdict.IGNORED_DUPLICATE if same else OwnshipVerdict.IGNORED_OLD)
            return None
        reset = None
        if previous is not None and state.reset_counter != previous.reset_counter:
            reset = self._rebase(state)
        self._verdict = OwnshipVerdict.ADDED if reset is None else OwnshipVerdict.RESET
        self._newest = state
        self._times.append(state.t)
        self._samples.append(_sample(state))
        self._prune(state.t)
        return reset

    def at(self, t: float) -> OwnshipState | None:
        """Give the motion at `t` [s]; None outside the history (bounded extrapolation forward) or inside a gap.

        Position: cubic Hermite on positions and velocities. Attitude: slerp. The rest: linear.
        """
        sample = self._sample_at(t)
        if sample is None or self._newest is None:
            return None
        return OwnshipState(
            t=t,
            position_ned=np.array(sample.position),
            velocity_ned=np.array(sample.velocity),
            acceleration_ned=np.array(sample.acceleration),
            ned_from_frd=rotation_of(sample.attitude),
            angular_velocity_frd=np.array(sample.rate),
            reset_counter=self._newest.reset_counter,
        )

    def pose_at(self, t: float) -> OwnshipPose | None:
        """Give the pose at `t` [s]: the cheap part of `at`, equal to it."""
        sample = self._sample_at(t)
        if sample is None:
            return None
        north, east, down = sample.position
        axes = rotation_of(sample.attitude)[:, :2]
        return OwnshipPose(north=north, east=east, down=down, yaw=yaw_of_quaternion(sample.attitude), axes=axes)

    def _refuse(self, verdict: OwnshipVerdict) -> None:
        self._verdict = verdict
        self._refused += 1

    def _prune(self, now: float) -> None:
        """Forget in blocks, so that the cost is spread."""
        oldest = bisect_right(self._times, now - self.parameters.duration)
        surplus = max(oldest, len(self._times) - self.parameters.capacity)
        if surplus >= 64 or len(self._times) > self.parameters.capacity:
            del self._times[:surplus]
            del self._samples[:surplus]

    def _sample_at(self, t: float) -> _Sample | None:
        if not self._samples or not math.isfinite(t):
            return None
        after = bisect_right(self._times, t)
        if after == 0:
            return None
        first = self._samples[after - 1]
        if after == len(self._samples):
            return _extrapolated(first, t) if t - first.t <= self.parameters.extrapolation else None
        second = self._samples[after]
        if second.t - first.t <= self.parameters.gap:
            return _interpolated(first, second, t)
        return _extrapolated(first, t) if t - first.t <= self.parameters.extrapolation else None

    def _rebase(self, state: OwnshipState) -> OwnshipReset:
        """Take the history into the frame of `state`, the first one after a reset."""
        last = self._samples[-1]
        expected = _extrapolated(last, min(state.t, last.t + self.parameters.gap))
        yaw = wrap_angle(state.yaw - yaw_of_quaternion(expected.attitude))
        c, s = math.cos(yaw), math.sin(yaw)
        north, east, down = _turned(expected.position, c, s)
        new = state.position_ned
        shift = (float(new[0]) - north, float(new[1]) - east, float(new[2]) - down)
        turn = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
        self._samples = [_moved(sample, c, s, shift, turn) for sample in self._samples]
        return OwnshipReset(t=state.t, translation_ned=np.array(shift), yaw=yaw, counter=state.reset_counter)


def _valid(state: OwnshipState) -> bool:
    if not math.isfinite(state.t):
        return False
    numbers = np.concatenate(
        (
            state.position_ned,
            state.velocity_ned,
            state.acceleration_ned,
            state.angular_velocity_frd,
            state.ned_from_frd.ravel(),
        )
    )
    if not math.isfinite(float(numbers @ numbers)):
        return False
    r = state.ned_from_frd
    deviation = r @ r.T
    deviation[0, 0] -= 1.0
    deviation[1, 1] -= 1.0
    deviation[2, 2] -= 1.0
    return float(np.abs(deviation).max()) < 1e-3 and float(r[0] @ np.cross(r[1], r[2])) > 0.0


def _sample(state: OwnshipState) -> _Sample:
    return _Sample(
        t=state.t,
        position=tuple(state.position_ned.tolist()),
        velocity=tuple(state.velocity_ned.tolist()),
        acceleration=tuple(state.acceleration_ned.tolist()),
        attitude=tuple(quaternion_from_rotation(state.ned_from_frd).tolist()),
        rate=tuple(state.angular_velocity_frd.tolist()),
    )


def _mixed(a: Triple, b: Triple, fraction: float) -> Triple:
    rest = 1.0 - fraction
    return rest * a[0] + fraction * b[0], rest * a[1] + fraction * b[1], rest * a[2] + fraction * b[2]


def _interpolated(a: _Sample, b: _Sample, t: float) -> _Sample:
    span = b.t - a.t
    u = (t - a.t) / span
    u2, u3 = u * u, u * u * u
    h00, h01 = 2.0 * u3 - 3.0 * u2 + 1.0, 3.0 * u2 - 2.0 * u3
    h10, h11 = (u3 - 2.0 * u2 + u) * span, (u3 - u2) * span
    p, q, v, w = a.position, b.position, a.velocity, b.velocity
    return _Sample(
        t=t,
        position=(
            h00 * p[0] + h01 * q[0] + h10 * v[0] + h11 * w[0],
            h00 * p[1] + h01 * q[1] + h10 * v[1] + h11 * w[1],
            h00 * p[2] + h01 * q[2] + h10 * v[2] + h11 * w[2],
        ),
        velocity=_mixed(v, w, u),
        acceleration=_mixed(a.acceleration, b.acceleration, u),
        attitude=slerp(a.attitude, b.attitude, u),
        rate=_mixed(a.rate, b.rate, u),
    )


def _extrapolated(a: _Sample, t: float) -> _Sample:
    """Hold the acceleration and the angular velocity."""
    dt = t - a.t
    p, v, c, w = a.position, a.velocity, a.acceleration, a.rate
    half = 0.5 * dt * dt
    speed = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    s = 0.5 * dt if speed * dt < 1e-9 else math.sin(0.5 * speed * dt) / speed
    turn = (math.cos(0.5 * speed * dt), s * w[0], s * w[1], s * w[2])
    return _Sample(
        t=t,
        position=(
            p[0] + v[0] * dt + c[0] * half,
            p[1] + v[1] * dt + c[1] * half,
            p[2] + v[2] * dt + c[2] * half,
        ),
        velocity=(v[0] + c[0] * dt, v[1] + c[1] * dt, v[2] + c[2] * dt),
        acceleration=c,
        attitude=product(a.attitude, turn),
        rate=w,
    )


def _turned(v: Triple, c: float, s: float) -> Triple:
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


def _moved(sample: _Sample, c: float, s: float, shift: Triple, turn: Quaternion) -> _Sample:
    north, east, down = _turned(sample.position, c, s)
    return _Sample(
        t=sample.t,
        position=(north + shift[0], east + shift[1], down + shift[2]),
        velocity=_turned(sample.velocity, c, s),
        acceleration=_turned(sample.acceleration, c, s),
        attitude=product(turn, sample.attitude),
        rate=sample.rate,
    )
