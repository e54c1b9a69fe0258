"""Transition probabilities between approach, reorient and align (Parikh et al., Algorithm 1), for a multirotor.

The paper's quantities and what stands for them here:

| paper | here |
|---|---|
| r, range to the docking face | distance between the vehicle and the pose it has when landed |
| d, Mahalanobis distance of measurements | excess over one of the averaged NIS per degree of freedom |
| norm of the vector part of the error quaternion | |sin(heading error / 2)|: roll and pitch are free |
| sigma_UWB, error of the coarse sensor | position error without vision (`coarse_position_std_m`) |
| r_t, r_d, first r1 and r2 | `activation_range_m`, `touchdown_range_m`, `align_floor_m`, `reorient_floor_m` |

The equations are in `switching_chain.py`.
"""

from __future__ import annotations

import math

from companion.guidance.parameters import MarkovParameters
from companion.guidance.switching_chain import approach_kept, reorient_again, reorient_kept, steady_state_align
from companion.messages.decision import TransitionProbabilities


def keep_approaching(
    *, range_m: float, inconsistency: float, heading_error: float, parameters: MarkovParameters
) -> float:
    """Give A11.

    Args:
        range_m: r [m].
        inconsistency: d, dimensionless, 0 when the estimator is consistent.
        heading_error: pad heading minus vehicle heading [rad].
        parameters: scales.
    """
    return approach_kept(
        distance=range_m,
        activation_range=parameters.activation_range_m,
        inconsistency=inconsistency,
        misalignment=abs(math.sin(0.5 * heading_error)),
    )


def reorient_probabilities(
    *, range_m: float, reorient_range_m: float, inconsistency: float, position_std: float, parameters: MarkovParameters
) -> tuple[float, float]:
    """Give A22 and A32.

    Args:
        range_m: r [m].
        reorient_range_m: r2 [m], the range at which reorienting began.
        inconsistency: d.
        position_std: largest standard deviation of the target's position [m].
        parameters: scales.
    """
    a22 = reorient_kept(distance=range_m, reorient_range=reorient_range_m, inconsistency=inconsistency)
    a32 = reorient_again(
        distance=range_m,
        reorient_range=reorient_range_m,
        docked_range=parameters.touchdown_range_m,
        position_std=position_std,
        coarse_std=parameters.coarse_position_std_m,
    )
    return a22, a32


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
