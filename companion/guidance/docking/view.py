"""What the docking guidance looks at in one step, and what it remembers from the steps before."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.guidance.docking.goal_point import GoalPoint, Triple, minus, norm
from companion.guidance.docking.parameters import SettlingParameters
from companion.guidance.docking.port import DockingSetup, Port, triple
from companion.guidance.docking.turn import Turn, misalignment
from companion.messages.docking import DockingMode
from companion.messages.proximity import ProximityState


@dataclass(slots=True)
class DockingMemory:
    """What the guidance remembers."""

    t_start: float  # [s] of the first step
    t_entered: float  # [s] at which the mode was entered
    mode: DockingMode = DockingMode.WAIT
    waypoint: Triple | None = None  # [m] on the way round the target, None: the line of sight is free
    ahead: bool = False  # it aims at a point in front of the docking face, not at the docked place
    turn: Turn | None = None  # to the docking attitude, None before it was begun
    reorient_range: float | None = None  # [m] r2
    align_range: float | None = None  # [m] r1
    failed_attempts: int = 0
    given_up: bool = False
    vision_since: float = math.inf  # [s] vision has been there without a gap since then
    settled_since: float = math.inf  # [s] at rest in front of the docking face since then
    at_end_since: float = math.inf  # [s] the goal has been at the end of the mode's way since then


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingView:
    """The estimate and the goal as seen from the docking face, at one instant."""

    t: float  # [s]
    position: Triple  # [m] estimated, in c
    range: float  # [m] from the docked position
    out: float  # [m] in front of it, along the normal
    angle: float  # [rad] off the normal
    deviation: float  # [m] of the estimated position from the goal, across the normal
    lead: float  # [m] of the goal before the estimated position, in any direction
    speed: float  # [m/s] estimated
    misalignment: float  # norm of the error quaternion's vector part
    position_std: float  # [m] largest
    vision: bool  # the last fused picture is new
    blind_for: float  # [s] since the last fused picture
    silent: bool  # neither range nor picture for long
    goal: Triple  # [m] position of the goal
    goal_range: float  # [m] of the goal
    goal_out: float  # [m] of the goal

    @property
    def attitude_error(self) -> float:
        """Angle [rad] between the estimated attitude and the docking attitude."""
        return 2.0 * math.asin(self.misalignment)


def look(
    t: float, state: ProximityState, *, goal: GoalPoint, port: Port, setup: DockingSetup, settling: SettlingParameters
) -> DockingView:
    """Gather what a step looks at."""
    position = triple(state.position)
    diagonal = state.covariance.diagonal().tolist()
    blind_for = t - state.t_vision
    return DockingView(
        t=t,
        position=position,
        range=port.range(position),
        out=port.out(position),
        angle=port.angle(position),
        deviation=norm(minus(port.aside(position), port.aside(goal.position))),
        lead=norm(minus(goal.position, position)),
        speed=norm(triple(state.velocity)),
        misalignment=misalignment(state.quaternion, setup.quaternion),
        position_std=math.sqrt(max(diagonal[:3])),
        vision=blind_for <= settling.vision_age,
        blind_for=blind_for,
        silent=min(blind_for, t - state.t_range) > settling.silence,
        goal=goal.position,
        goal_range=port.range(goal.position),
        goal_out=port.out(goal.position),
    )
