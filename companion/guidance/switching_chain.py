"""The transition probabilities between approach, reorient and align: Parikh et al., Algorithm 1, in plain quantities.

Probabilities are clamped to [0, 1]: the printed forms leave it (1/|q| is unbounded, sigma may exceed sigma_UWB).
"""

from __future__ import annotations

_LEAST_MISALIGNMENT = 1e-6
_LEAST_LENGTH = 1e-6  # [m]


def _unit(value: float) -> float:
    return min(1.0, max(0.0, value))


def approach_kept(*, distance: float, activation_range: float, inconsistency: float, misalignment: float) -> float:
    """Give A11 = (r / r_t) (1 / (1 + d)) (1 / |q_e|), clamped to [0, 1].

    Args:
        distance: r [m].
        activation_range: r_t [m].
        inconsistency: d, dimensionless, Mahalanobis distance of the measurements.
        misalignment: norm of the vector part of the error quaternion.
    """
    return _unit(distance / activation_range / (1.0 + inconsistency) / max(misalignment, _LEAST_MISALIGNMENT))


def reorient_kept(*, distance: float, reorient_range: float, inconsistency: float) -> float:
    """Give A22 = (r / r2) (1 / (1 + d)), clamped to [0, 1].

    Args:
        distance: r [m].
        reorient_range: r2 [m], the range at which reorienting began.
        inconsistency: d.
    """
    return _unit(distance / max(reorient_range, _LEAST_LENGTH) / (1.0 + inconsistency))


def reorient_again(
    *, distance: float, reorient_range: float, docked_range: float, position_std: float, coarse_std: float
) -> float:
    """Give A32 = (max sigma_pos / sigma_UWB) (r2 - r) / (r2 - r_d), clamped to [0, 1].

    Args:
        distance: r [m].
        reorient_range: r2 [m], the range at which reorienting began.
        docked_range: r_d [m].
        position_std: largest standard deviation of the position [m].
        coarse_std: sigma_UWB [m], of the coarse sensor.
    """
    travelled = (reorient_range - distance) / max(reorient_range - docked_range, _LEAST_LENGTH)
    return _unit(position_std / coarse_std * max(travelled, 0.0))


def steady_state_align(a22: float, a32: float) -> float:
    """Give the steady-state probability of "align" of the chain [[A22, 1 - A22], [A32, 1 - A32]].

    It is A23 / (A23 + A32); a chain that never leaves "reorient" and never returns to it has not begun: 1.
    """
    a23 = 1.0 - a22
    total = a23 + a32
    return 1.0 if total < 1e-9 else a23 / total
