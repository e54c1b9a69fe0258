"""What goes into the coupled planner beside the problem, and what comes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated

from annotated_types import Ge, Gt, Le

from companion.geometry.arrays import Array
from companion.planning.coupled.model import CameraView, CostWeights, Violation
from companion.planning.coupled.qp import QpBackend


@dataclass(frozen=True, slots=True, kw_only=True)
class CoupledParameters:
    """The sequence of convex programs."""

    horizon: Annotated[int, Ge(2), Le(200)] = 30  # steps N
    midpoint: Annotated[float, Ge(0.0), Le(0.5)] = (
        0.5  # of a step, where its heading is taken; 0: equation 7 as printed
    )
    weights: CostWeights = field(default_factory=CostWeights)
    view: CameraView = field(default_factory=CameraView)
    solver: QpBackend = QpBackend.PIQP
    iterations_max: Annotated[int, Ge(1)] = 12  # convex programs in a plan
    tolerance: Annotated[float, Gt(0.0)] = 0.02  # epsilon on |z - z_i| [m, rad, m/s, rad/s]
    tolerance_cost: Annotated[float, Gt(0.0)] = 2e-3  # of the cost: a smaller gain ends the sequence
    solver_tolerance: Annotated[float, Gt(0.0)] | None = None  # of a convex program's residuals; None: `TOLERANCES`
    trust_first: Annotated[float, Gt(0.0)] = 1.0  # [rad] change of heading in the first iteration
    trust_min: Annotated[float, Gt(0.0)] = 0.02  # [rad] below which the sequence ends
    trust_max: Annotated[float, Gt(0.0)] = 1.5  # [rad]
    standing: Annotated[float, Gt(0.0)] = 0.02  # [m/s] below which a step may change its gear
    slack_cost: Annotated[float, Gt(0.0)] = 100.0  # [1 / (m/s)] of each step's slack
    reverse_time: Annotated[float, Ge(0.0)] = (
        1.6  # [s] after its beginning, speeds carry the bias of a lateral correction
    )
    correction_time: Annotated[float, Gt(0.0)] = 6.0  # [s] after which it may begin anew
    correction_reach: Annotated[float, Ge(0.0)] = 2.5  # [m] farther goals are no lateral correction
    correction_tolerance: Annotated[float, Ge(0.0)] = 0.05  # [m] of lateral offset that needs none
    restart_growth: Annotated[float, Gt(0.0)] = 0.5  # relative growth of the last plan's cost: above, it may be dropped


class PlanEnd(Enum):
    """Why the sequence ended."""

    CONVERGED = "converged"
    ITERATIONS = "iterations used up"
    DEADLINE = "deadline"
    SOLVER_FAILED = "the solver found no solution"


@dataclass(frozen=True, slots=True, kw_only=True)
class Deadline:
    """An instant by which a plan must be there; the planner itself knows no clock."""

    clock: Callable[[], float]  # [s]
    t: float  # [s] on that clock


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoupledPlan:
    """The best drivable iterate, with what it costs and breaks in the nonlinear problem."""

    t_start: float  # [s]
    step: float  # [s]
    controls: Array  # (N, 2) [m/s, rad/s] constant over each step
    poses: Array  # (N + 1, 3) [m, m, rad] in the frame of the rover at the start
    objective: float  # of the nonlinear problem
    objective_first: float  # of the iterate that the sequence began with
    violation: Violation  # of the nonlinear problem
    end: PlanEnd
    iterations: int  # convex programs solved
    solver_iterations: int  # of all of them together
    residual_primal: float  # largest of the convex programs' own residuals
    residual_dual: float
    slack: float  # [m/s] largest that the last convex program used
    elastic: (
        bool  # True: the sequence began beyond a limit, as a present motion beyond one forces it to; slack was let in
    )
    correction_began: float | None  # [s] when the present lateral correction began; None: there is none
    view_excess: float  # [rad] largest bearing of the target beyond the camera's half angle; 0 without a target
