"""A rover's planning problem: what it may do, what is asked, what a plan costs and where it breaks a limit.

Poses are (x, y, heading) [m, m, rad] in the frame of the rover at the start: x forward, y to the right, heading
clockwise. Controls are (speed, yaw rate) [m/s, rad/s], constant over a step. Equation numbers are those of Patel
et al., "A General Purpose Method for Robotic Interception of Non-Cooperative Dynamic Targets".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from companion.geometry.arrays import Array, frozen


@dataclass(frozen=True, slots=True, kw_only=True)
class RoverMotion:
    """What the rover can do."""

    speed_forward: Annotated[float, Gt(0.0), Le(50.0)] = 1.0  # [m/s] v_max
    speed_reverse: Annotated[float, Ge(0.0), Le(50.0)] = 1.0  # [m/s]; 0: it never drives backwards
    turning_radius: Annotated[float, Gt(0.0), Le(100.0)] = 0.8  # [m] R_min
    yaw_rate: Annotated[float, Gt(0.0), Le(100.0)] = 1.5  # [rad/s] omega_max, whatever the radius would allow
    acceleration: Annotated[float, Gt(0.0), Le(1000.0)] = 1.5  # [m/s^2]
    yaw_acceleration: Annotated[float, Gt(0.0), Le(1000.0)] = 3.0  # [rad/s^2]

    def sharpest(self, speeds: Array) -> Array:
        """Give the largest yaw rates [rad/s] at speeds [m/s], forward or back: by radius and limit."""
        return np.minimum(np.abs(speeds) / self.turning_radius, self.yaw_rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class CostWeights:
    """Weights of equation 6, of the bias that backs out first, and of the camera's term."""

    speed: Annotated[float, Ge(0.0)] = 0.02  # w_v [1 / (m/s)^2]
    yaw_rate: Annotated[float, Ge(0.0)] = 0.02  # w_omega [1 / (rad/s)^2]
    stage_position: Annotated[float, Ge(0.0)] = 0.2  # w_ip [1 / m^2]
    stage_heading: Annotated[float, Ge(0.0)] = 0.02  # w_itheta [1 / rad^2]
    final_position: Annotated[float, Ge(0.0)] = 40.0  # w_p [1 / m^2]
    final_heading: Annotated[float, Ge(0.0)] = 20.0  # w_theta [1 / rad^2]
    reverse: Annotated[float, Ge(0.0)] = 0.5  # [1 / (m/s)] of each early speed in a lateral correction
    view: Annotated[float, Ge(0.0)] = 5.0  # [1 / rad^2] of the target's bearing beyond the half angle
    clearance: Annotated[float, Ge(0.0)] = 0.0  # [1 / m^2] of coming nearer to the target than `clearance_m`
    clearance_m: Annotated[float, Ge(0.0), Le(100.0)] = 1.0  # [m] from the rover's point to the target's


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraView:
    """Where the camera looks, as far as a plan in the plane cares."""

    half_angle: Annotated[float, Gt(0.0), Le(math.pi)] = 0.45  # [rad] kept free on each side of the axis
    yaw: Annotated[float, Ge(-math.pi), Le(math.pi)] = 0.0  # [rad] of the axis, clockwise from forward
    forward: float = 0.0  # [m] of the camera, ahead of the rover's centre


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoupledRequest:
    """One planning problem."""

    t_start: float  # [s]
    step: float  # [s] length of a step
    goal: Array  # (N + 1, 3) goal pose at each step; or (3,), the same at all
    speed: float = 0.0  # [m/s] at present
    yaw_rate: float = 0.0  # [rad/s] at present
    target: Array | None = None  # (N + 1, 2) [m] where the target will be; None: no term for the camera
    weights: CostWeights | None = None  # None: those of the planner's parameters
    forward_only: bool = False  # do not drive backwards, although the rover can
    speed_most: float = math.inf  # [m/s] forward, where the rover could be faster
    speed_wanted: float = 0.0  # [m/s] that costs nothing: w_v (v_k - this)^2 in place of w_v v_k^2

    def __post_init__(self) -> None:
        object.__setattr__(self, "goal", frozen(self.goal))
        if self.target is not None:
            object.__setattr__(self, "target", frozen(self.target))
        numbers = (self.t_start, self.step, self.speed, self.yaw_rate, self.speed_wanted)
        target_finite = self.target is None or bool(np.isfinite(self.target).all())
        if not (all(map(math.isfinite, numbers)) and np.isfinite(self.goal).all() and target_finite):
            raise ValueError("a coupled plan's request must be finite")
        if self.step <= 0.0:
            raise ValueError(f"the step must be positive, got {self.step} s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """By how much a plan breaks the nonlinear problem; zeros where it holds."""

    dynamics: float  # [m, rad] largest residual of the nonlinear bicycle model
    speed: float  # [m/s] beyond the limits of speed
    turning: float  # [m/s] R_min |omega| - |v|
    yaw_rate: float  # [rad/s] beyond the limit of yaw rate
    acceleration: float  # [m/s^2]
    yaw_acceleration: float  # [rad/s^2]

    @property
    def worst(self) -> float:
        """The largest of all, in mixed units."""
        return max(self.dynamics, self.speed, self.turning, self.yaw_rate, self.acceleration, self.yaw_acceleration)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NonlinearProblem:
    """The problem that the convex programs approximate."""

    rover: RoverMotion
    weights: CostWeights
    view: CameraView
    midpoint: float  # heading of a step: theta_k + midpoint * omega_k * step; 0 is equation 7 as printed
    step: float  # [s]
    start: tuple[float, float]  # present speed [m/s] and yaw rate [rad/s]
    goal: Array  # (N + 1, 3)
    target: Array | None  # (N + 1, 2) [m]
    bias: Array  # (N,) [1 / (m/s)] linear cost of each speed

    def rolled_out(self, controls: Array) -> Array:
        """Give the poses (..., N + 1, 3) that controls (..., N, 2) lead to by the nonlinear model, from (0, 0, 0)."""
        poses = np.zeros((*controls.shape[:-2], controls.shape[-2] + 1, 3))
        speed, yaw_rate = controls[..., 0], controls[..., 1]
        np.cumsum(yaw_rate, axis=-1, out=poses[..., 1:, 2])
        poses[..., 2] *= self.step
        course = poses[..., :-1, 2] + (self.midpoint * self.step) * yaw_rate
        way = speed * self.step
        np.cumsum(way * np.cos(course), axis=-1, out=poses[..., 1:, 0])
        np.cumsum(way * np.sin(course), axis=-1, out=poses[..., 1:, 1])
        return poses

    def objective(self, poses: Array, controls: Array) -> Array:
        """Give equation 6 with x_k in the stage cost, plus bias and camera, for poses (..., N + 1, 3)."""
        w = self.weights
        error = poses - self.goal
        error[..., 2] -= 2.0 * math.pi * np.round(error[..., 2] / (2.0 * math.pi))
        error *= error
        controls_cost = controls * controls @ np.array((w.speed, w.yaw_rate)) + controls[..., 0] * self.bias
        stage = error[..., :-1, :].sum(axis=-2) @ np.array((w.stage_position, w.stage_position, w.stage_heading))
        final = error[..., -1, :] @ np.array((w.final_position, w.final_position, w.final_heading))
        result: Array = controls_cost.sum(axis=-1) + stage + final
        if self.target is not None and w.view > 0.0:
            excess = np.maximum(np.abs(self.bearing(poses)) - self.view.half_angle, 0.0)
            result = result + w.view * (excess * excess)[..., 1:].sum(axis=-1)
        if self.target is not None and w.clearance > 0.0:
            short = np.maximum(w.clearance_m - self.distance(poses), 0.0)
            result = result + w.clearance * (short * short)[..., 1:].sum(axis=-1)
        return result

    def distance(self, poses: Array) -> Array:
        """Give the distance [m] (..., N + 1) to the target; needs a target."""
        if self.target is None:
            raise ValueError("the request names no target")
        away = self.target - poses[..., :2]
        result: Array = np.sqrt((away * away).sum(axis=-1))
        return result

    def bearing(self, poses: Array) -> Array:
        """Give the target's bearing [rad] (..., N + 1) from the camera's axis; needs a target."""
        ahead, right = self.target_in_body(poses)
        angle = np.arctan2(right, ahead - self.view.forward) - self.view.yaw
        result: Array = angle - 2.0 * math.pi * np.round(angle / (2.0 * math.pi))
        return result

    def target_in_body(self, poses: Array) -> tuple[Array, Array]:
        """Give the target ahead and to the right [m] of the rover's centre, each (..., N + 1)."""
        if self.target is None:
            raise ValueError("the request names no target")
        away = self.target - poses[..., :2]
        cosine, sine = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        return (
            cosine * away[..., 0] + sine * away[..., 1],
            cosine * away[..., 1] - sine * away[..., 0],
        )

    def slack(self, controls: Array) -> Array:
        """Give by how much [m/s] each step of controls (..., N, 2) is too fast or turns too sharply, (..., N)."""
        speed = controls[..., 0]
        slack = np.maximum(speed - self.rover.speed_forward, -speed - self.rover.speed_reverse)
        sharp = self.rover.turning_radius * np.abs(controls[..., 1]) - np.abs(speed)
        result: Array = np.maximum(np.maximum(slack, sharp), 0.0)
        return result

    def violation(self, poses: Array, controls: Array) -> Violation:
        """Measure poses (N + 1, 3) and controls (N, 2) against the nonlinear problem, equations 7 and 8."""
        r = self.rover
        speed, yaw_rate = controls[:, 0], controls[:, 1]
        course = poses[:-1, 2] + self.midpoint * self.step * yaw_rate
        moved = np.stack((speed * np.cos(course), speed * np.sin(course), yaw_rate), axis=1) * self.step
        rates = np.diff(np.vstack((self.start, controls)), axis=0) / self.step
        return Violation(
            dynamics=float(max(np.abs(np.diff(poses, axis=0) - moved).max(), np.abs(poses[0]).max())),
            speed=_over(np.maximum(speed - r.speed_forward, -speed - r.speed_reverse), 0.0),
            turning=_over(r.turning_radius * np.abs(yaw_rate) - np.abs(speed), 0.0),
            yaw_rate=_over(np.abs(yaw_rate), r.yaw_rate),
            acceleration=_over(np.abs(rates[:, 0]), r.acceleration),
            yaw_acceleration=_over(np.abs(rates[:, 1]), r.yaw_acceleration),
        )

    def drivable(self, controls: Array) -> Array:
        """Give the controls (N, 2) brought, step by step, into accelerations, speed, yaw rate and turning radius.

        Where the present motion itself breaks a limit, the accelerations come first: nobody can drive otherwise.
        Where it does not, the result keeps all of them.
        """
        r, previous, turn = self.rover, self.start[0], self.start[1]
        gain, swing = r.acceleration * self.step, r.yaw_acceleration * self.step
        speeds = []
        for speed in controls[:, 0].tolist():
            wanted = min(max(speed, -r.speed_reverse), r.speed_forward)
            previous = min(max(wanted, previous - gain), previous + gain)
            speeds.append(previous)
        bound, bounds = math.inf, []
        for sharpest in reversed(r.sharpest(np.array(speeds)).tolist()):
            bound = min(sharpest, bound + swing)  # a turn must leave time to end before a standstill
            bounds.append(bound)
        yaw_rates = []
        for yaw_rate, bound in zip(controls[:, 1].tolist(), reversed(bounds), strict=True):
            wanted = min(max(yaw_rate, -bound), bound)
            turn = min(max(wanted, turn - swing), turn + swing)
            yaw_rates.append(turn)
        return np.array((speeds, yaw_rates)).T


def _over(values: Array, limit: float) -> float:
    return max(float(values.max()) - limit, 0.0)
