"""Transition probabilities between approach, reorient and align (Parikh et al., Algorithm 1), for a multirotor.

The paper's quantities and what stands for them here:

| paper | here |
|---|---|
| r, range to the docking face | distance between the vehicle and the pose it has when landed |
| d, Mahalanobis distance of measurements | excess over one of the averaged NIS per degree of freedom |
| norm of the vector part of the error quaternion | |sin(heading error / 2)|: roll and pitch are free |
| sigma_UWB, error of the coarse sensor | position error without vision (`coarse_position_std_m`) |
| r_t, r_d, first r1 and r2 | `activation_range_m`, `touchdown_range_m`, `align_floor_m`, `reorient_floor_m` |

Probabilities are clamped to [0, 1]: the printed forms leave it (1/|q| is unbounded, sigma may exceed sigma_UWB).
"""

from __future__ import annotations

import math

from companion.guidance.parameters import MarkovParameters
from companion.messages.decision import TransitionProbabilities


def _unit(value: float) -> float:
    return min(1.0, max(0.0, value))


def keep_approaching(
    *, range_m: float, inconsistency: float, heading_error: float, parameters: MarkovParameters
) -> float:
    """Give A11 = (r / r_t) (1 / (1 + d)) (1 / |q_e|), clamped to [0, 1].

    Args:
        range_m: r [m].
        inconsistency: d, dimensionless, 0 when the estimator is consistent.
        heading_error: pad heading minus vehicle heading [rad].
        parameters: scales.
    """
    misalignment = abs(math.sin(0.5 * heading_error))
    return _unit(range_m / parameters.activation_range_m / (1.0 + inconsistency) / max(misalignment, 1e-6))


def reorient_probabilities(
    *, range_m: float, reorient_range_m: float, inconsistency: float, position_std: float, parameters: MarkovParameters
) -> tuple[float, float]:
    """Give A22 = (r / r2) / (1 + d) and A32 = (sigma_pos / sigma_UWB) (r2 - r) / (r2 - r_d), clamped to [0, 1].

    Args:
        range_m: r [m].
        reorient_range_m: r2 [m], the range at which reorienting began.
        inconsistency: d.
        position_std: largest standard deviation of the target's position [m].
        parameters: scales.
    """
    a22 = _unit(range_m / max(reorient_range_m, 1e-6) / (1.0 + inconsistency))
    travelled = (reorient_range_m - range_m) / max(reorient_range_m - parameters.touchdown_range_m, 1e-6)
    a32 = _unit(position_std / parameters.coarse_position_std_m * max(travelled, 0.0))
    return a22, a32


def steady_state_align(a22: float, a32: float) -> float:
    """Give the steady-state probability of "align" of the chain [[A22, 1 - A22], [A32, 1 - A32]].

    It is A23 / (A23 + A32); a chain that never leaves "reorient" and never returns to it has not begun: 1.
    """
    a23 = 1.0 - a22
    total = a23 + a32
    return 1.0 if total < 1e-9 else a23 / total


def transition_probabilities(
    *,
    range_m: float,
    reorient_range_m: float,
    inconsistency: float,
    heading_error: float,
    position_std: float,
    parameters: MarkovParameters,
) -> TransitionProbabilities:
    """Give all numbers of Algorithm 1 at one instant; arguments as in the functions above."""
    a11 = keep_approaching(
        range_m=range_m, inconsistency=inconsistency, heading_error=heading_error, parameters=parameters
    )
    a22, a32 = reorient_probabilities(
        range_m=range_m,
        reorient_range_m=reorient_range_m,
        inconsistency=inconsistency,
        position_std=position_std,
        parameters=parameters,
    )
    return TransitionProbabilities(a11=a11, a22=a22, a32=a32, steady_align=steady_state_align(a22, a32))
