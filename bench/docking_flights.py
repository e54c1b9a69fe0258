"""Dock from random places and attitudes with a chaser that follows its goal: times, distance from the target, cost.

Run: python bench/docking_flights.py [--flights 60] [--seed 1]

No dynamics and no estimator: the chaser stands where the guidance's goal was, the estimate is off by noise, and a
camera's cone says what is seen. Tests of the guidance fly the same chaser.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from dataclasses import dataclass, field

import numpy as np

from companion.geometry.arrays import Array
from companion.geometry.rotations import quaternion_from_rotation, rotation_from_quaternion
from companion.guidance.docking.guidance import DockingGuidance
from companion.guidance.docking.parameters import DockingParameters
from companion.guidance.docking.policies import FixedDistances, MarkovSwitching
from companion.guidance.docking.port import DockingSetup
from companion.messages.docking import DockingDecision, DockingMode
from companion.messages.proximity import PoseGoal, ProximityState

C_FROM_T = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # Rx(90 deg) Rz(90 deg)
NORMAL = np.array([0.0, -1.0, 0.0])
DOCKED = np.array([1.0, 1.9, 1.0])
CENTRE = DOCKED - 0.1 * NORMAL
START = np.array([0.0, 1.0, 0.0])
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
SETUP = DockingSetup(
    position=DOCKED, quaternion=quaternion_from_rotation(C_FROM_T), normal=NORMAL, start_quaternion=IDENTITY
)
PERIOD = 0.1  # [s]
HALF = 0.05  # [m] half the side of a cube


@dataclass
class Flight:
    """What happened, one entry per step."""

    decisions: list[DockingDecision] = field(default_factory=list)
    goals: list[PoseGoal] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    positions: list[Array] = field(default_factory=list)

    @property
    def modes(self) -> list[DockingMode]:
        """The modes in the order in which they were entered."""
        return [DockingMode.WAIT] + [d.switched.mode for d in self.decisions if d.switched is not None]

    def entered(self, mode: DockingMode) -> DockingDecision:
        """The decision that entered a mode first."""
        return next(d for d in self.decisions if d.switched is not None and d.mode is mode)


def sees(position: Array, quaternion: Array) -> bool:
    """Say whether the centre of the docking face is in the camera's cone, near enough, and turned to it."""
    turned = rotation_from_quaternion(quaternion)
    way = DOCKED + 0.05 * -NORMAL - (position + turned @ np.array([0.0, 0.0, -0.05]))
    distance = float(np.linalg.norm(way))
    ahead = float(way @ (turned @ np.array([0.0, 0.0, -1.0])))
    facing = float(-way @ NORMAL)
    return 0.02 < distance < 1.0 and ahead > distance * np.cos(np.radians(30)) and facing > distance * 0.26


@dataclass
class FollowingChaser:
    """Stands where the goal was, plus noise that vision makes smaller; touches at the docked position."""

    guidance: DockingGuidance
    rng: np.random.Generator
    start: Array = field(default_factory=START.copy)
    noise: float = 0.01  # [m] of the estimate without vision
    blind: bool = False  # the camera shows nothing
    push: Array = field(default_factory=lambda: np.zeros(3))  # [m] the chaser stands so far beside its goal
    touch: bool = True

    def fly(self, until: float = 400.0) -> Flight:
        """Fly until it has docked, or gives up, or the time is over."""
        flight = Flight()
        position, quaternion, rate = self.start.copy(), IDENTITY, np.zeros(3)
        velocity, t, t_vision = np.zeros(3), 0.0, -np.inf
        while t < until:
            if not self.blind and sees(position, quaternion):
                t_vision = t
            std = min(self.noise, 0.001 + 0.0005 * (t - t_vision))  # what was seen is forgotten slowly
            state = ProximityState(
                t=t,
                position=position + std * self.rng.standard_normal(3),
                velocity=velocity + 0.0005 * self.rng.standard_normal(3),
                quaternion=quaternion,
                rate=rate,
                covariance=np.diag([std**2] * 3 + [1e-6] * 6),
                mahalanobis=1.0,
                t_vision=t_vision,
                t_range=t,
            )
            near = float(np.linalg.norm(position - DOCKED)) < 0.05
            contact = self.touch and near and float((position - DOCKED) @ NORMAL) <= 0.0
            decision, goal = self.guidance.step(t, state, contact=contact)
            flight.decisions.append(decision)
            flight.goals.append(goal)
            flight.times.append(t)
            flight.positions.append(position)
            if decision.mode in (DockingMode.DOCKED, DockingMode.HOLD):
                break
            if decision.mode is not DockingMode.WAIT:
                position = goal.position + self.push
                velocity, quaternion, rate = goal.velocity, goal.quaternion, goal.rate
            t = round(t + PERIOD, 6)
        return flight


def apart(position: Array, quaternion: Array) -> float:
    """Give the largest separation [m] of the two cubes along one of their face normals; positive: they are apart."""
    turned, target = rotation_from_quaternion(quaternion), rotation_from_quaternion(SETUP.quaternion)
    way = position - CENTRE
    seen_from_target = np.abs(target.T @ way) - HALF * np.abs(target.T @ turned).sum(axis=1)
    seen_from_chaser = np.abs(turned.T @ way) - HALF * np.abs(turned.T @ target).sum(axis=1)
    return max(float(seen_from_target.max()), float(seen_from_chaser.max())) - HALF


def random_start(rng: np.random.Generator) -> tuple[Array, DockingSetup]:
    """Draw a place 0.35 to 1.5 m from the target's centre, on any side of it, and an attitude to keep there."""
    side, axis = rng.standard_normal(3), rng.standard_normal(3)
    angle = rng.uniform(0.0, 3.1)
    attitude = np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * axis / np.linalg.norm(axis)])
    setup = DockingSetup(position=DOCKED, quaternion=SETUP.quaternion, normal=NORMAL, start_quaternion=attitude)
    return CENTRE + rng.uniform(0.35, 1.5) * side / np.linalg.norm(side), setup


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description="guidance of docking alone, from random starts")
    parser.add_argument("--flights", type=int, default=60, help="random starts for each policy")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    for policy in (FixedDistances(), MarkovSwitching()):
        name = type(policy).__name__
        flight = FollowingChaser(DockingGuidance(DockingParameters(), SETUP, policy), np.random.default_rng(1)).fly()
        first = flight.entered(DockingMode.REORIENT), flight.entered(DockingMode.ALIGN)
        print(
            f"{name}, the paper's start: docked after {flight.times[-1]:.1f} s, r2 {first[0].reorient_range:.2f} m, "
            f"r1 {first[1].align_range:.2f} m"
        )
        rng = np.random.default_rng(asked.seed)
        docked, gaps, times, steps, begun = 0, [], [], 0, time.process_time()
        for _ in range(asked.flights):
            start, setup = random_start(rng)
            flight = FollowingChaser(DockingGuidance(DockingParameters(), setup, policy), rng, start=start).fly()
            docked += flight.decisions[-1].mode is DockingMode.DOCKED
            times.append(flight.times[-1])
            steps += len(flight.times)
            gaps += [
                apart(position, goal.quaternion)
                for position, goal, decision in zip(flight.positions, flight.goals, flight.decisions, strict=True)
                if decision.mode in (DockingMode.APPROACH, DockingMode.REORIENT, DockingMode.ALIGN)
            ]
        cost = 1e6 * (time.process_time() - begun) / steps
        print(
            f"{name}, {asked.flights} random starts: {docked} docked after {statistics.mean(times):.0f} s on average, "
            f"cubes never nearer than {100.0 * min(gaps):.1f} cm before the last part; {cost:.0f} us a step, all told"
        )


if __name__ == "__main__":
    main()
