"""Where the sequence of convex programs begins: the last plan, moved on, or the best of many simple drives."""

from __future__ import annotations

import itertools
import math

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.planning.coupled.model import NonlinearProblem, RoverMotion

# Gears of the three parts of a drive; a convex program cannot change a gear by itself except at a standstill.
_GEARS = ((1, 1, 1), (-1, 1, 1), (-1, -1, 1), (1, -1, -1), (1, 1, -1), (-1, -1, -1))
_PARTS = ((0.2, 0.2, 0.4), (0.2, 0.4, 0.4), (0.35, 0.35, 0.3), (0.4, 0.2, 0.4), (0.1, 0.2, 0.2))
_SPEEDS = (0.5, 1.0)
_FINALISTS = 24


def simple_drives(rover: RoverMotion, horizon: int) -> Array:
    """Give controls (M, N, 2) of drives in three parts, each straight or turning as sharply as it can, then at rest."""
    drives = [np.zeros((horizon, 2))]
    gears = [g for g in _GEARS if rover.speed_reverse > 0.0 or min(g) > 0]
    for parts, gear, share in itertools.product(_PARTS, gears, _SPEEDS):
        ends = [round(horizon * sum(parts[: i + 1])) for i in range(3)]
        pieces = [slice(begin, end) for begin, end in zip((0, *ends), ends, strict=False)]
        speed = np.zeros(horizon)
        for piece, direction in zip(pieces, gear, strict=True):
            speed[piece] = share * (rover.speed_forward if direction > 0 else -rover.speed_reverse)
        for turns in itertools.product((-1, 0, 1), repeat=3):
            yaw_rate = np.zeros(horizon)
            for piece, turn in zip(pieces, turns, strict=True):
                yaw_rate[piece] = turn * rover.sharpest(speed[piece])
            drives.append(np.stack((speed, yaw_rate), axis=1))
    return frozen(np.array(drives))


class DriveTable:
    """Simple drives with their places, and sums of them that make their costs cheap; for one length of step.

    Args:
        problem: gives rover, step and nonlinear model.
        controls: (M, N, 2) of `simple_drives`.
    """

    def __init__(self, problem: NonlinearProblem, controls: Array) -> None:
        self._controls = controls
        self._poses = problem.rolled_out(controls)
        count = len(controls)
        squares = controls * controls
        self._squares = squares.sum(axis=1)  # (M, 2)
        places = self._poses[:, :-1, :2]
        self._places = np.ascontiguousarray(places.reshape(count, -1))
        self._places_squared = (places * places).sum(axis=(1, 2))
        self._speeds = np.ascontiguousarray(controls[..., 0])
        self._forward_first = controls[:, 0, 0] > 0.0

    def best(self, problem: NonlinearProblem) -> Array:
        """Give the controls (N, 2) of the drive with the lowest cost, accelerations aside.

        All are ranked by equation 6 without heading and camera in the stage cost, the first few then by all of it.
        In a lateral correction only those compete that do not begin forward.
        """
        w, goal = problem.weights, problem.goal
        stage = goal[:-1, :2].ravel()
        error = self._poses[:, -1] - goal[-1]
        error[:, 2] -= 2.0 * math.pi * np.round(error[:, 2] / (2.0 * math.pi))
        cost = self._squares @ np.array((w.speed, w.yaw_rate))
        cost += w.stage_position * (self._places_squared - 2.0 * (self._places @ stage))
        cost += (error * error) @ np.array((w.final_position, w.final_position, w.final_heading))
        if problem.bias.any():
            cost += self._speeds @ problem.bias
            cost[self._forward_first] = math.inf
        few = np.argpartition(cost, _FINALISTS)[:_FINALISTS]
        controls = self._controls[few]
        result: Array = controls[int(np.argmin(problem.objective(self._poses[few], controls)))]
        return result


def moved_on(controls: Array, elapsed: float, old_step: float, new_step: float) -> Array:
    """Give controls (N, 2) of a plan as seen `elapsed` [s] later, in steps of another length; at rest after its end."""
    count = len(controls)
    index = np.floor((elapsed + (np.arange(count) + 0.5) * new_step) / old_step).astype(int)
    shifted: Array = controls[np.clip(index, 0, count - 1)]
    shifted[index >= count] = 0.0
    return shifted


def is_lateral_correction(goal: Array, turning_radius: float, reach: float, tolerance: float) -> bool:
    """Say whether a goal (3,) lies aside, too near for two forward arcs.

    Two arcs of radius R move a vehicle sideways by y, its heading unchanged, over the length sqrt(y (4 R - y)).
    Aside and ahead are taken along the goal's heading.

    Args:
        goal: (x, y, heading) in the rover's frame.
        turning_radius: R [m].
        reach: [m] beyond which nothing counts as a correction.
        tolerance: [m] of lateral offset that needs none.
    """
    x, y, heading = map(float, goal)
    ahead = math.cos(heading) * x + math.sin(heading) * y
    aside = abs(math.cos(heading) * y - math.sin(heading) * x)
    if aside <= tolerance or math.hypot(ahead, aside) > reach:
        return False
    return ahead < math.sqrt(aside * max(4.0 * turning_radius - aside, 0.0))
