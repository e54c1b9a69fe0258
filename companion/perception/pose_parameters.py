"""Tuning of the pad's pose from the corners of its tags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseParameters:
    """Tuning of the pose from corners."""

    iterations: Annotated[int, Interval(ge=1, le=50)] = 20  # at most; stops when the step is negligible
    # a second pose this much worse (difference of squared normalised errors) is impossible: exp(-30/2) = 3e-7
    impossible: Annotated[float, Gt(0.0)] = 30.0
    same_rotation: Annotated[float, Gt(0.0)] = 1e-3  # [rad] poses nearer than this, or than their deviation, are one
    # a tag disagrees with the others when its corners are off by more than this many sigmas ...
    disagreement_sigmas: Annotated[float, Gt(1.0)] = 6.0
    # ... and by more than the pad may have been printed wrong
    disagreement: Annotated[float, Ge(0.0)] = 0.004  # [m]
    disagreement_px: Annotated[float, Ge(0.0)] = 0.5  # [px] and never less than this
    nearest: Annotated[float, Gt(0.0)] = 0.01  # [m] a pad nearer than this cannot be seen
    smallest_sigma: Annotated[float, Gt(0.0)] = 0.01  # [px] smaller corner sigmas are not believed
    quantile: Annotated[float, Interval(gt=0.5, lt=1.0)] = 0.99  # of the scatter from which the covariance grows
