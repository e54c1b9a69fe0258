"""A chaser that follows its goal with some error and sees what a camera would see; and the committed docking set-up."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from companion.geometry.arrays import Array
from companion.geometry.rotations import quaternion_from_rotation, rotation_from_quaternion
from companion.guidance.docking.guidance import DockingGuidance
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
PERIOD = 0.1


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
class ToyChaser:
    """Stands where the goal was, plus noise that vision makes smaller; touches at the docked position."""

    guidance: DockingGuidance
    rng: np.random.Generator
    start: Array = field(default_factory=lambda: START.copy())
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
