"""The convex program of one iteration: equations 5 to 8 of Patel et al. linearised about an iterate.

z = (x_0, u_0, x_1, u_1, ..., x_N), equation 5, with one slack [m/s] for each step behind it in the elastic program.
The sparsity never changes: the matrices are built once and their entries written in place.
"""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.arrays import Array
from companion.planning.coupled.model import NonlinearProblem
from companion.planning.coupled.qp import QuadraticProgram, SparsePattern

_STAGE = 5  # numbers of a step in z
_X, _Y, _HEADING, _SPEED, _YAW_RATE = range(_STAGE)
_STANDING = 1e-4  # [m/s] room of the turning bound at a step that stands still: an interior point needs an inside


class ConvexProgram:
    """Equations 5 to 8 about an iterate, as numbers of one quadratic program.

    Args:
        horizon: number of steps N.
        elastic: let slack widen the bounds of speed and turning, at a cost.
        standing: [m/s] a step slower than this may change its gear.
    """

    def __init__(self, horizon: int, *, elastic: bool, standing: float) -> None:
        self._horizon, self._elastic, self._standing = horizon, elastic, standing
        n = self._size = _STAGE * horizon + 3
        total = n + (horizon if elastic else 0)
        k = self._k = np.arange(horizon)
        self._states = np.arange(horizon + 1) * _STAGE
        self._speeds, self._yaw_rates = k * _STAGE + _SPEED, k * _STAGE + _YAW_RATE
        headings = self._states[1:] + _HEADING
        self._headings = headings
        slack = n + k if elastic else k[:0]
        self._slack = slack
        boxed = np.sort(np.concatenate((headings, self._yaw_rates, slack if elastic else self._speeds)))
        low, high = np.full(total, -math.inf), np.full(total, math.inf)
        low[slack] = 0.0
        rows = (6 if elastic else 4) * horizon
        self.program = QuadraticProgram(
            p=self._cost_pattern(total),
            q=np.zeros(total),
            a=self._dynamics_pattern(total),
            b=np.zeros(3 * (horizon + 1)),
            g=self._bounds_pattern(total, rows),
            g_low=np.full(rows, -math.inf),
            g_high=np.zeros(rows),
            low=low,
            high=high,
            boxed=boxed,
        )

    def _cost_pattern(self, total: int) -> SparsePattern:
        s, count = self._states, self._horizon
        x, y, h = s + _X, s + _Y, s + _HEADING
        rows = np.concatenate((x, y, h, x, x, y, self._speeds, self._yaw_rates, self._slack))
        columns = np.concatenate((x, y, h, y, h, h, self._speeds, self._yaw_rates, self._slack))
        pattern = SparsePattern.of(rows, columns, (total, total))
        self._cost_places = rows, columns
        self._cost_share = np.where(rows == columns, 0.25, 0.5)  # of an entry's two products in the cost's fall
        self._cost_states = pattern.entries[: 6 * (count + 1)].reshape(6, count + 1)
        self._cost_rest = pattern.entries[6 * (count + 1) :]
        return pattern

    def _dynamics_pattern(self, total: int) -> SparsePattern:
        """Rows: the initial state, then equations 7a, 7b and 7c of each step."""
        s, ones = self._states[:-1], np.ones(self._horizon)
        first = 3 + 3 * self._k
        blocks = []
        for row, column, value in (
            (first, s + _STAGE + _X, 1.0),
            (first, s + _X, -1.0),
            (first + 1, s + _STAGE + _Y, 1.0),
            (first + 1, s + _Y, -1.0),
            (first + 2, s + _STAGE + _HEADING, 1.0),
            (first + 2, s + _HEADING, -1.0),
            (first + 2, self._yaw_rates, 0.0),  # the rest is written for each iterate
            (first, self._speeds, 0.0),
            (first, s + _HEADING, 0.0),
            (first, self._yaw_rates, 0.0),
            (first + 1, self._speeds, 0.0),
            (first + 1, s + _HEADING, 0.0),
            (first + 1, self._yaw_rates, 0.0),
        ):
            blocks.append((row, column, value * ones))
        rows, columns, values = (
            np.concatenate([np.arange(3.0) if part < 2 else np.ones(3), *(b[part] for b in blocks)])
            for part in range(3)
        )
        pattern = SparsePattern.of(rows.astype(np.intp), columns.astype(np.intp), (3 * (self._horizon + 1), total))
        pattern.entries[:] = values
        self._dynamics = pattern.entries[3:].reshape(13, self._horizon)[6:]
        return pattern

    def _bounds_pattern(self, total: int, rows_count: int) -> SparsePattern:
        """Rows, N of each: turning to the right and to the left, accelerations; elastic also speed forward and back."""
        n, k, ones = self._horizon, self._k, np.ones(self._horizon)
        blocks = [
            (k, self._yaw_rates, 0.0 * ones),
            (k + n, self._yaw_rates, 0.0 * ones),
            (k, self._speeds, 0.0 * ones),
            (k + n, self._speeds, 0.0 * ones),
            (k + 2 * n, self._speeds, ones),
            (k[1:] + 2 * n, self._speeds[:-1], -ones[1:]),
            (k + 3 * n, self._yaw_rates, ones),
            (k[1:] + 3 * n, self._yaw_rates[:-1], -ones[1:]),
        ]
        if self._elastic:
            blocks += [(k + row * n, self._slack, -ones) for row in (0, 1, 4, 5)]
            blocks += [(k + 4 * n, self._speeds, ones), (k + 5 * n, self._speeds, -ones)]
        rows, columns, values = (np.concatenate([block[part] for block in blocks]) for part in range(3))
        pattern = SparsePattern.of(rows, columns, (rows_count, total))
        pattern.entries[:] = values
        self._turning = pattern.entries[: 4 * n].reshape(4, n)
        return pattern

    def pose(self, problem: NonlinearProblem, slack_cost: float) -> None:
        """Write what one problem keeps through its iterations: weights, speeds, yaw rates, accelerations."""
        w, r, p, n = problem.weights, problem.rover, self.program, self._horizon
        self._cost_rest[:n] = 2.0 * w.speed
        self._cost_rest[n : 2 * n] = 2.0 * w.yaw_rate
        if self._elastic:
            self._cost_rest[2 * n :] = 1e-3 * slack_cost
            p.q[self._slack] = slack_cost
            p.g_high[4 * n : 5 * n] = r.speed_forward
            p.g_high[5 * n :] = r.speed_reverse
        else:
            p.low[self._speeds] = -r.speed_reverse
            p.high[self._speeds] = r.speed_forward
        # what turns faster than it may comes down as its acceleration allows, so there is always a solution
        slowing = r.yaw_acceleration * problem.step * (self._k + 0.9)
        p.low[self._yaw_rates] = np.minimum(-r.yaw_rate, problem.start[1] + slowing)
        p.high[self._yaw_rates] = np.maximum(r.yaw_rate, problem.start[1] - slowing)
        self._turning[:2] = r.turning_radius
        self._turning[1] *= -1.0
        for row, limit, present in (
            (2, r.acceleration * problem.step, problem.start[0]),
            (3, r.yaw_acceleration * problem.step, problem.start[1]),
        ):
            p.g_low[row * n : (row + 1) * n] = -limit
            p.g_high[row * n : (row + 1) * n] = limit
            p.g_low[row * n] += present
            p.g_high[row * n] += present

    def linearise(self, problem: NonlinearProblem, poses: Array, controls: Array, trust: float) -> None:
        """Write what depends on the iterate: poses (N + 1, 3), controls (N, 2). `trust`: [rad] on each heading."""
        self._write_dynamics(problem, poses, controls)
        self._write_turning(problem, controls[:, 0])
        self._write_cost(problem, poses)
        self.program.low[self._headings] = poses[1:, 2] - trust
        self.program.high[self._headings] = poses[1:, 2] + trust

    def _write_dynamics(self, problem: NonlinearProblem, poses: Array, controls: Array) -> None:
        """Equation 7, its heading taken at `midpoint` of the step."""
        step, lead = problem.step, problem.midpoint * problem.step
        speed, yaw_rate = controls[:, 0], controls[:, 1]
        course = poses[:-1, 2] + lead * yaw_rate
        cosine, sine = step * np.cos(course), step * np.sin(course)
        across, along = speed * sine, speed * cosine
        d = self._dynamics
        d[0] = -step
        d[1], d[2], d[3] = -cosine, across, lead * across
        d[4], d[5], d[6] = -sine, -along, -lead * along
        b = self.program.b[3:].reshape(self._horizon, 3)
        b[:, 0] = across * course
        b[:, 1] = -along * course

    def _write_turning(self, problem: NonlinearProblem, speed: Array) -> None:
        """Equation 8 with |v|: R_min |omega| <= |v_i| + sign(v_i) (v - v_i), which never exceeds |v|."""
        gear = np.sign(speed)
        if problem.rover.speed_reverse == 0.0:
            gear[:] = 1.0
        else:
            gear[np.abs(speed) <= self._standing] = 0.0
        self._turning[2] = self._turning[3] = -gear
        room = np.where(gear == 0.0, np.abs(speed) + _STANDING, 0.0)
        n = self._horizon
        self.program.g_high[:n] = room
        self.program.g_high[n : 2 * n] = room

    def _write_cost(self, problem: NonlinearProblem, poses: Array) -> None:
        """Equation 6 with x_k, and the camera's term by Gauss and Newton where the iterate loses the target."""
        w = problem.weights
        cost = self._cost_states
        cost[:2] = 2.0 * w.stage_position
        cost[2] = 2.0 * w.stage_heading
        cost[3:] = 0.0
        cost[:2, -1], cost[2, -1] = 2.0 * w.final_position, 2.0 * w.final_heading
        linear = -cost[:3].T * _goal_near(problem.goal, poses)
        if problem.target is not None and w.view > 0.0:
            _add_view(problem, poses, cost, linear)
        if problem.target is not None and w.clearance > 0.0:
            _add_clearance(problem, poses, cost, linear)
        q = self.program.q
        q[: self._size - 3].reshape(self._horizon, _STAGE)[:, :3] = linear[:-1]
        q[self._size - 3 : self._size] = linear[-1]
        q[self._speeds] = problem.bias

    def stacked(self, poses: Array, controls: Array, slack: Array) -> Array:
        """Give z for poses (N + 1, 3), controls (N, 2) and, in the elastic program, slack (N,) [m/s]."""
        z = np.zeros(len(self.program.q))
        if self._elastic:
            z[self._slack] = slack
        stages = z[: self._size - 3].reshape(self._horizon, _STAGE)
        stages[:, :3], stages[:, 3:] = poses[:-1], controls
        z[self._size - 3 : self._size] = poses[-1]
        return z

    def controls(self, z: Array) -> Array:
        """Give the controls (N, 2) in z."""
        return z[: self._size - 3].reshape(self._horizon, _STAGE)[:, 3:].copy()

    def slack(self, z: Array) -> float:
        """Give the largest slack [m/s] in z."""
        return float(z[self._slack].max(initial=0.0))

    def gain(self, before: Array, after: Array) -> float:
        """Give by how much the program's cost falls from one z to another."""
        difference, total = before - after, before + after
        # Half of z'Pz falls by half of difference' P total, and P is its upper triangle and that one's mirror.
        rows, columns = self._cost_places
        products = difference[rows] * total[columns] + difference[columns] * total[rows]
        quadratic = (self._cost_share * self.program.p.entries) @ products
        return float(quadratic + self.program.q @ difference)


def _goal_near(goal: Array, poses: Array) -> Array:
    """Give the goal (N + 1, 3) with each heading in the full turn nearest to the iterate's."""
    near = goal.copy()
    turns = np.round((poses[:, 2] - goal[:, 2]) / (2.0 * math.pi))
    near[:, 2] += 2.0 * math.pi * turns
    return near


def _add_clearance(problem: NonlinearProblem, poses: Array, cost: Array, linear: Array) -> None:
    """Add w (clearance - distance)^2, linearised, at every step but the first where it is positive."""
    if problem.target is None:
        return
    distance = problem.distance(poses)
    short = problem.weights.clearance_m - distance
    near = np.flatnonzero(short[1:] > 0.0) + 1
    if near.size == 0:
        return
    slope = (problem.target[near] - poses[near, :2]) / np.maximum(distance[near, None], 1e-3)
    double = 2.0 * problem.weights.clearance
    for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1))):
        if i < 2:
            cost[row, near] += double * slope[:, i] * slope[:, j]
    constant = short[near] - (slope * poses[near, :2]).sum(axis=1)
    linear[near, :2] += double * constant[:, None] * slope


def _add_view(problem: NonlinearProblem, poses: Array, cost: Array, linear: Array) -> None:
    """Add w (|bearing| - half angle)^2, linearised, at every step but the first where it is positive."""
    bearing = problem.bearing(poses)
    excess = np.abs(bearing) - problem.view.half_angle
    lost = np.flatnonzero(excess[1:] > 0.0) + 1
    if lost.size == 0:
        return
    ahead, right = (part[lost] for part in problem.target_in_body(poses))
    seen_ahead = ahead - problem.view.forward
    square = np.maximum(seen_ahead * seen_ahead + right * right, 1e-4)
    side = np.sign(bearing[lost])
    cosine, sine = np.cos(poses[lost, 2]), np.sin(poses[lost, 2])
    slope = np.stack(
        (
            (right * cosine + seen_ahead * sine),
            (right * sine - seen_ahead * cosine),
            -(right * right + seen_ahead * ahead),
        )
    ) * (side / square)
    double = 2.0 * problem.weights.view
    for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
        cost[row, lost] += double * slope[i] * slope[j]
    constant = excess[lost] - np.einsum("ij,ji->i", poses[lost], slope)
    linear[lost] += (double * constant * slope).T
