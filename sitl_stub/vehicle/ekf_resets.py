"""What the estimator is good for now: validity, resets with their counter, and drift without GNSS.

Figures from PX4's recordings: q13_gps_loss (position invalid 5.2 s after the loss with 5.2 m of drift, 66 m off after
15 s; reset 1.2 s after GNSS returns, valid another second later), q13_ekf_reset (counter rises by 1 to 4), boot.
"""

import math
from dataclasses import dataclass

import numpy as np

from sitl_stub.truth import Vector
from sitl_stub.vehicle.estimator import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceTimes:
    """How long the estimator takes to notice that a position source has gone, or is back."""

    invalid_after: float
    """Time [s] without it after which the position is not trusted (EKF2_NOAID_TOUT and the commander's check)."""
    fused_after: float
    """Time [s] after its return until it is used."""
    valid_after: float
    """Time [s] after its return until the position is trusted: one second of probation later."""


GNSS_TIMES = SourceTimes(invalid_after=5.19, fused_after=1.23, valid_after=2.23)
VISION_TIMES = SourceTimes(invalid_after=4.6, fused_after=0.18, valid_after=1.18)
"""PX4 stops using vision after 0.4 s of silence and counts from one second before
(updateHorizontalDeadReckoningstatus); with GNSS it goes on for that second.
Vision is used again with its first sample, GNSS after several."""
DRIFT_ACCELERATION, DRIFT_JERK = 0.30, 0.057
"""Growth of the error without GNSS [m/s^2], [m/s^3]."""
FADE_TIME = 1.0
"""Time constant [s] with which a small error is corrected after a short loss."""
BOOT_COUNTERS = ((0.0, 4), (0.8, 6), (1.1, 8), (1.3, 10), (2.7, 11))
"""ODOMETRY.reset_counter by time since boot [s]: it is 11 once the estimator is ready."""
COUNTERS_WITHOUT_GNSS = 7
STILL: Vector = (0.0, 0.0, 0.0)
HEADING_STABLE_AFTER, READY_AFTER = 2.7, 3.82


class EstimateHealth:
    """Judges the estimate and moves it: add `shift` to what the estimator says.

    A reset moves the estimate in one step and raises `reset_counter` (uint8, it wraps) by one for each of horizontal
    position, height, horizontal velocity, vertical velocity and heading that was reset.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self.reset_counter = 11
        self.shift: Vector = STILL
        """Estimated minus otherwise estimated position [m], ned."""
        self.velocity_shift: Vector = STILL
        self.heading_shift = 0.0
        """[rad]"""
        self.resets: list[tuple[Vector, Vector]] = []
        """Steps of position [m] and velocity [m/s] that controllers have not taken yet."""
        self.position_valid = True
        self.heading_stable = True
        self.ever_had_position = True
        self._times = GNSS_TIMES
        self._booted_at: float | None = None
        self._lost_at: float | None = None
        self._back_at: float | None = None
        self._direction = (1.0, 0.0)
        self._drift: Vector = STILL
        self._drift_velocity: Vector = STILL
        self._jump: Vector = STILL

    @property
    def gnss_used(self) -> bool:
        """Whether GNSS is fused."""
        return self._lost_at is None and self.ever_had_position

    def start(self, t: float, origin: Vector) -> None:
        """The autopilot boots at `t` [s]: nothing is known yet, and `origin` is where the local frame begins."""
        self._booted_at = t
        self._lost_at = self._back_at = None
        self._jump = (-origin[0], -origin[1], -origin[2])
        self._drift = self._drift_velocity = STILL
        self._sum()
        self.heading_shift = 0.0
        self.resets.clear()
        self.position_valid = self.heading_stable = self.ever_had_position = False
        self.reset_counter = BOOT_COUNTERS[0][1]

    def jump(self, step: Vector) -> None:
        """The position source moves by `step` [m], ned, and the estimator follows at once."""
        j0, j1, j2 = self._jump
        self._jump = (j0 + step[0], j1 + step[1], j2 + step[2])
        # a horizontal reset from external vision also resets the heading
        horizontal = step[0] != 0.0 or step[1] != 0.0
        self._reset(step, 2 * horizontal + (step[2] != 0.0))

    def turn(self, angle: float) -> None:
        """The heading is reset by `angle` [rad]."""
        self.heading_shift += angle
        self._reset(STILL, 1)

    def _reset(self, step: Vector, count: int, velocity_step: Vector = STILL) -> None:
        self.reset_counter = (self.reset_counter + count) & 0xFF
        self.resets.append((step, velocity_step))
        self._sum()

    def _sum(self) -> None:
        jump, drift = self._jump, self._drift
        self.shift = (jump[0] + drift[0], jump[1] + drift[1], jump[2] + drift[2])
        self.velocity_shift = self._drift_velocity

    def step(self, t: float, dt: float, *, gnss: bool, vision: bool = True) -> None:
        """Advance to `t` [s]; `gnss`: satellites are received; `vision`: so is external vision, if it is the source."""
        if not vision:
            self._times, gnss = VISION_TIMES, False
        elif self._lost_at is None:
            self._times = GNSS_TIMES
        if self._booted_at is not None:
            self._boot(t - self._booted_at, gnss)
        elif not self.ever_had_position:
            self._first_fix(t, gnss)
        elif not gnss:
            self._without_gnss(t, dt)
        elif self._lost_at is not None:
            self._gnss_returns(t, dt)
        elif self._drift != STILL:
            self._fade(dt)

    def _boot(self, age: float, gnss: bool) -> None:
        for since, counter in BOOT_COUNTERS:
            if age >= since:
                self.reset_counter = counter if gnss else min(counter, COUNTERS_WITHOUT_GNSS)
        self.heading_stable = age >= HEADING_STABLE_AFTER
        if age >= READY_AFTER:
            self._booted_at = None
            self.position_valid = self.ever_had_position = gnss

    def without_position(self) -> None:
        """The vehicle has stood without GNSS since it booted."""
        self.position_valid = self.ever_had_position = False
        self.reset_counter = COUNTERS_WITHOUT_GNSS

    def _first_fix(self, t: float, gnss: bool) -> None:
        if not gnss:
            self._back_at = None
            return
        if self._back_at is None:
            self._back_at = t
        if t - self._back_at >= GNSS_TIMES.valid_after - 0.5:
            self.position_valid = self.ever_had_position = True
            self._back_at = None
            self._reset(STILL, 2)

    def _without_gnss(self, t: float, dt: float) -> None:
        self._back_at = None
        if self._lost_at is None:
            self._lost_at = t
            angle = float(self._rng.uniform(-math.pi, math.pi))
            self._direction = (math.cos(angle), math.sin(angle))
        age = t - self._lost_at
        growth = (DRIFT_ACCELERATION + DRIFT_JERK * age) * dt
        d0, d1 = self._direction
        v0, v1, _ = self._drift_velocity
        self._drift_velocity = (v0 + growth * d0, v1 + growth * d1, 0.0)
        p0, p1, p2 = self._drift
        self._drift = (p0 + self._drift_velocity[0] * dt, p1 + self._drift_velocity[1] * dt, p2)
        self._sum()
        if age >= self._times.invalid_after:
            self.position_valid = False

    def _gnss_returns(self, t: float, dt: float) -> None:
        if self._back_at is None:
            self._back_at = t
        age = t - self._back_at
        if self.position_valid:
            # not missed for long: the next fix still passes the innovation gate
            self._lost_at = self._back_at = None
        elif age < self._times.fused_after:
            p0, p1, p2 = self._drift
            v0, v1, _ = self._drift_velocity
            self._drift = (p0 + v0 * dt, p1 + v1 * dt, p2)
            self._sum()
        elif self._drift != STILL:
            d0, d1, d2 = self._drift
            v0, v1, v2 = self._drift_velocity
            self._drift = self._drift_velocity = STILL
            self._reset((-d0, -d1, -d2), 4, (-v0, -v1, -v2))
        elif age >= self._times.valid_after:
            self.position_valid = True
            self._lost_at = self._back_at = None

    def _fade(self, dt: float) -> None:
        keep = math.exp(-dt / FADE_TIME)
        p0, p1, p2 = self._drift
        v0, v1, v2 = self._drift_velocity
        self._drift = (p0 * keep, p1 * keep, p2 * keep)
        self._drift_velocity = (v0 * keep, v1 * keep, v2 * keep)
        if math.hypot(*self._drift) < 1e-4:
            self._drift = self._drift_velocity = STILL
        self._sum()

    def apply(self, estimate: Estimate) -> None:
        """Move a fresh estimate by what this knows."""
        if self.shift != STILL or self.velocity_shift != STILL:
            s, v = self.shift, self.velocity_shift
            estimate.north += s[0]
            estimate.east += s[1]
            estimate.down += s[2]
            estimate.v_north += v[0]
            estimate.v_east += v[1]
            estimate.v_down += v[2]
        if self.heading_shift:
            _turn(estimate, self.heading_shift)


def _turn(estimate: Estimate, angle: float) -> None:
    """Turn the attitude estimate by `angle` [rad] about the vertical: (c, 0, 0, s) * q."""
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    w, x, y, z = estimate.qw, estimate.qx, estimate.qy, estimate.qz
    estimate.qw, estimate.qx, estimate.qy, estimate.qz = c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
    estimate.yaw = math.remainder(estimate.yaw + angle, 2.0 * math.pi)
