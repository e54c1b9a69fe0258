"""Where the ranging anchors stand, from a recorded flight.

The flown path p(t), by the vehicle's odometry, drifts by d(t); a range to anchor k, at a_k and with the delay b_k, is

    r = |p(t) + d(t) - a_k| + b_k + noise.

All a_k, b_k and the drift at knots (linear in between) are found together: range-only mapping as in Djugash and Singh,
"A robust method of localization and mapping using only range" (2008), as one robust least-squares problem. The first
knot is zero: positions are in the odometry's frame as it was when the flight began. Drift between knots and delays are
held by their priors, ranges by Cauchy's loss, which bounds the pull of an outlier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from companion.estimation.anchor_problem import (
    AnchorCalibrationParameters,
    AnchorEstimate,
    AnchorProblem,
    FlownPath,
    FlownRanges,
    anchor_problem,
)
from companion.geometry.arrays import Array, frozen

_STRAIN_MOST = 4.0  # times the drift that odometry is trusted with
_FLY = "fly a square of at least 3 m by 3 m at two heights at least 1 m apart, slowly, about two minutes"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnchorCalibration:
    """What a flight says of the anchors."""

    refusal: str | None  # why it says too little, and what to fly instead; None: it is good
    anchors: tuple[AnchorEstimate, ...] = ()  # by number; those of a refused calibration are not to be used
    unused: int = 0  # readings outside the odometry or in its gaps
    knots: Array = field(default_factory=lambda: frozen(np.zeros(1)))  # (K,) [s]
    drift: Array = field(default_factory=lambda: frozen(np.zeros((1, 3))))  # (K, 3) [m] to be added to the odometry

    def drift_at(self, t: float) -> Array:
        """Give the correction (3,) [m] of the odometry at `t` [s]."""
        return np.array([np.interp(t, self.knots, self.drift[:, axis]) for axis in range(3)])


def calibrate_anchors(
    path: FlownPath, ranges: FlownRanges, parameters: AnchorCalibrationParameters
) -> AnchorCalibration:
    """Find where the anchors stand. Deterministic; what cannot be found is a refusal in the result.

    Args:
        path: of the tag's antenna.
        ranges: to all anchors, in any order.
        parameters: what is known and asked for.
    """
    if path.t.size < 2 or not ranges.t.size:
        return AnchorCalibration(refusal=f"there are no ranges with odometry beside them; {_FLY}")
    problem, unused = anchor_problem(path, ranges, parameters)
    refusal = _poor_flight(problem, parameters)
    if refusal is not None:
        return AnchorCalibration(refusal=refusal, unused=unused)
    starts = problem.starts()
    solution = problem.solve(starts)
    anchors = problem.estimates(solution)
    drift = np.vstack([np.zeros(3), solution.x[4 * problem.count :].reshape(-1, 3)])
    return AnchorCalibration(
        refusal=_poor_result(problem, anchors, drift, parameters),
        anchors=anchors,
        unused=unused,
        knots=frozen(problem.knots),
        drift=frozen(drift),
    )


def _poor_flight(problem: AnchorProblem, parameters: AnchorCalibrationParameters) -> str | None:
    """Say why a flight cannot tell where the anchors are; None where it may."""
    if not problem.numbers:
        return f"there are no ranges with odometry beside them; {_FLY}"
    for index, number in enumerate(problem.numbers):
        count = int(np.count_nonzero(problem.anchor == index))
        if count < parameters.readings_least:
            return (
                f"anchor {number} has {count} ranges only, {parameters.readings_least} are needed; "
                "stay in sight of all anchors"
            )
        offsets = problem.position[problem.anchor == index]
        extents = np.linalg.svd(offsets - offsets.mean(axis=0), compute_uv=False) / np.sqrt(count)
        if extents[1] < parameters.breadth_least:
            return (
                f"the flight is a straight line or a point (it spreads by {extents[1]:.2f} m across, "
                f"{parameters.breadth_least:g} m are needed): "
                f"an anchor might stand anywhere on a circle about it; {_FLY}"
            )
        if extents[2] < parameters.height_least:
            return (
                f"the flight lies in one plane (it spreads by {extents[2]:.2f} m out of it, "
                f"{parameters.height_least:g} m are needed): an anchor might as well stand on the other side; {_FLY}"
            )
    return None


def _poor_result(
    problem: AnchorProblem, anchors: Sequence[AnchorEstimate], drift: Array, parameters: AnchorCalibrationParameters
) -> str | None:
    """Say why a result is not to be used; None where it is."""
    strain = problem.drift_strain(drift)
    if strain > _STRAIN_MOST:
        return (
            f"ranges and odometry disagree: it would have drifted by {100 * strain * parameters.drift_share:.0f} % of "
            "the way; look for two anchors with one id, anchors that were moved, and a jump of the odometry"
        )
    for index, found in enumerate(anchors):
        spread = float(np.sqrt(np.linalg.eigvalsh(found.covariance[:3, :3])[-1]))
        if spread > parameters.position_std_most:
            return (
                f"the place of anchor {found.anchor} is known to {spread:.2f} m only, "
                f"{parameters.position_std_most:g} m are asked for: fly nearer to it and wider around it; {_FLY}"
            )
        if found.outliers > found.readings // 3:
            return (
                f"{found.outliers} of {found.readings} ranges to anchor {found.anchor} fit no place; "
                "look for what stands between, for two anchors with one id, and for a jump of the odometry"
            )
        if problem.mirror_doubt(index, found, drift):
            return f"anchor {found.anchor} might as well stand on the other side of the flown path; {_FLY}"
    return None
