"""One measurement into a snapshot: ranges with their lever arm, markers in a picture, gate and underweighting."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import chi2

from companion.estimation.proximity.covariance import BIAS, Compounded, Covariance, Tandem, split
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.estimation.proximity.snapshot import NO_REFUSALS, Refusals, Snapshot
from companion.geometry.arrays import Array
from companion.geometry.quaternions import rotation_of, turned
from companion.geometry.rotations import skew

Outcome = Literal["fused", "gated", "late", "duplicate", "unknown", "not finite", "vision is primary"]
_EYE6 = np.eye(6)
_MARKERS_OF_A_POSE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What became of a measurement."""

    accepted: bool
    squared_distance: float  # squared Mahalanobis distance to the prediction, without underweighting; nan if none
    degrees: int  # of freedom of it; 0 if there is none
    reason: Outcome


REFUSED = {
    reason: Verdict(accepted=False, squared_distance=math.nan, degrees=0, reason=reason)
    for reason in ("late", "duplicate", "unknown", "not finite", "vision is primary")
}


class Fusion:
    """Fuses measurements into snapshots. Holds constants only."""

    def __init__(self, setup: ProximitySetup, parameters: ProximityParameters) -> None:
        self._setup = setup
        self._parameters = parameters
        self._range_gate = float(chi2.ppf(parameters.gate_probability, 1))
        self._marker_gate = float(chi2.ppf(parameters.gate_probability, 3))
        self._range_variance = parameters.range_std**2
        self._feature_variance = parameters.feature_std**2
        self._camera_rotation = setup.d_from_cam.rotation.T.copy()
        self._camera_place = setup.d_from_cam.translation

    def range(self, s: Snapshot, anchor: int, measured: float) -> tuple[Snapshot, tuple[Verdict, ...]]:
        """Fuse a range [m] to an anchor; `s` stands at its time.

            r = |p + R l - a|,    dr/dp = e,    dr/dtheta = l x R^T e

        (Parikh et al., eq. 1: rotation moves the radio.) Where a tandem filter's point is the radio, only the
        translational filter is concerned.
        """
        p = self._parameters
        if not p.ranges_with_vision and s.t - s.t_pose < p.vision_primary_for:
            return s, (REFUSED["vision is primary"],)
        lever = self._setup.lever_arm
        c_from_d = rotation_of(s.quaternion)
        offset = s.position + c_from_d @ lever - self._setup.anchors[anchor]
        distance = math.sqrt(float(offset @ offset))
        if distance < 1e-6:
            return s, (REFUSED["not finite"],)
        direction = offset / distance
        innovation = measured - distance
        covariance = self._for_ranges(s, c_from_d)
        matrix = covariance.matrix if isinstance(covariance, Compounded) else covariance.translation
        row = np.zeros(len(matrix))
        row[:3] = direction
        if isinstance(covariance, Compounded):
            row[6:9] = np.cross(lever, direction @ c_from_d)
        shared = matrix @ row
        predicted = float(row @ shared)
        squared = innovation * innovation / (predicted + self._range_variance)
        if squared > self._range_gate:
            s, refusals = self._judged(s, s.range_refusals, rejected=True, attitude=False)
            gated = Verdict(accepted=False, squared_distance=squared, degrees=1, reason="gated")
            return s._replace(range_refusals=refusals), (gated,)
        variance = self._underweighted(self._range_variance, predicted)
        gain = shared / (predicted + variance)
        rest = np.eye(len(matrix)) - gain[:, None] * row
        matrix = rest @ matrix @ rest.T + variance * gain[:, None] * gain
        s = self._corrected(s, gain * innovation, matrix, covariance)
        verdict = Verdict(accepted=True, squared_distance=squared, degrees=1, reason="fused")
        s, refusals = self._judged(s, s.range_refusals, rejected=False, attitude=False)
        return s._replace(t_range=s.t, range_refusals=refusals), (verdict,)

    def features(self, s: Snapshot, markers: tuple[int, ...], positions: Array) -> tuple[Snapshot, tuple[Verdict, ...]]:
        """Fuse the markers of a picture, positions (N, 3) [m] in cam; `s` stands at its time.

            y = R^T (m - p),    dy/dp = -R^T,    dy/dtheta = [y]x

        Each marker is gated alone, against the prediction; those that pass are fused together. Both structures use the
        joint covariance: a tandem filter parts it again at the middle of the markers.
        """
        c_from_d = rotation_of(s.quaternion)
        expected = (self._setup.markers_in_c[list(markers)] - s.position) @ c_from_d
        innovations = positions @ self._camera_rotation + self._camera_place - expected
        joint = s.covariance.joint(c_from_d)
        jacobian = marker_jacobians(expected, c_from_d, len(joint))
        shared = jacobian @ joint
        blocks = shared @ jacobian.transpose(0, 2, 1)
        blocks[:, range(3), range(3)] += self._feature_variance
        squared = np.einsum("ni,ni->n", innovations, np.linalg.solve(blocks, innovations[:, :, None])[:, :, 0])
        inside = squared <= self._marker_gate
        verdicts = tuple(
            Verdict(accepted=accepted, squared_distance=distance, degrees=3, reason="fused" if accepted else "gated")
            for accepted, distance in zip(inside.tolist(), squared.tolist(), strict=True)
        )
        count = int(inside.sum())
        if count == 0:
            s, refusals = self._judged(s, s.vision_refusals, rejected=True, attitude=True)
            return s._replace(vision_refusals=refusals), verdicts
        if count < len(inside):
            expected, innovations = expected[inside], innovations[inside]
            jacobian, shared = jacobian[inside], shared[inside]
        stacked = jacobian.reshape(3 * count, -1)
        correction, joint = self._stacked_update(joint, stacked, shared.reshape(3 * count, -1), innovations.ravel())
        s = self._corrected_jointly(s, correction, joint, expected.mean(axis=0))
        t_pose = s.t if count >= _MARKERS_OF_A_POSE else s.t_pose
        s, refusals = self._judged(s, s.vision_refusals, rejected=2 * count < len(markers), attitude=True)
        return s._replace(t_vision=s.t, t_pose=t_pose, vision_refusals=refusals), verdicts

    def _stacked_update(self, joint: Array, rows: Array, shared: Array, innovation: Array) -> tuple[Array, Array]:
        """Give the correction and the joint covariance (Joseph's form) of many rows of equal variance."""
        predicted = shared @ rows.T
        size = len(rows)
        noise = self._feature_variance * np.eye(size)
        ratio = self._parameters.underweighting_ratio
        if float(predicted.trace()) > ratio * self._feature_variance * size:
            noise += self._parameters.underweighting * predicted
        gain = np.linalg.solve(predicted + noise, shared).T
        rest = np.eye(len(joint)) - gain @ rows
        return gain @ innovation, rest @ joint @ rest.T + gain @ noise @ gain.T

    def _underweighted(self, variance: float, predicted: float) -> float:
        p = self._parameters
        return variance + p.underweighting * predicted if predicted > p.underweighting_ratio * variance else variance

    def _for_ranges(self, s: Snapshot, c_from_d: Array) -> Covariance:
        """Give the covariance in which a range is fused.

        A tandem filter comes back to the radio's place when pictures have ceased; while they come and ranges are
        wanted too, a range is fused jointly.
        """
        covariance = s.covariance
        if isinstance(covariance, Compounded) or covariance.lever is self._setup.lever_arm:
            return covariance
        joint = covariance.joint(c_from_d)
        if s.t - s.t_pose < self._parameters.vision_primary_for:
            return Compounded(joint)
        return split(joint, c_from_d, self._setup.lever_arm, s.true_rate)

    def _corrected(self, s: Snapshot, correction: Array, matrix: Array, used: Covariance) -> Snapshot:
        """Apply what a range has taught, in the covariance in which it was fused."""
        if isinstance(used, Tandem):
            return s._replace(
                position=s.position + correction[:3],
                velocity=s.velocity + correction[3:],
                covariance=used._replace(translation=0.5 * (matrix + matrix.T)),
            )
        lever = s.covariance.lever if isinstance(s.covariance, Tandem) else self._setup.lever_arm
        return self._corrected_jointly(s, correction, matrix, lever)

    def _corrected_jointly(self, s: Snapshot, correction: Array, joint: Array, lever: Array) -> Snapshot:
        """Apply a correction of all states and reset the attitude error to zero (Markley 2003).

        The reset turns the frame of the attitude error by half the correction, and the covariance with it.
        """
        x, y, z = correction[6:9].tolist()
        quaternion = turned(s.quaternion, (x, y, z))
        reset = np.eye(3) - 0.5 * skew(correction[6:9])
        joint[6:9] = reset @ joint[6:9]
        joint[:, 6:9] = joint[:, 6:9] @ reset.T
        joint = 0.5 * (joint + joint.T)
        bias = s.bias
        if len(joint) == BIAS.stop:
            u, v, w = correction[BIAS].tolist()
            bias = (bias[0] + u, bias[1] + v, bias[2] + w)
        together = isinstance(s.covariance, Compounded)
        return s._replace(
            position=s.position + correction[:3],
            velocity=s.velocity + correction[3:6],
            quaternion=quaternion,
            bias=bias,
            covariance=Compounded(joint) if together else split(joint, rotation_of(quaternion), lever, s.true_rate),
        )

    def _judged(self, s: Snapshot, before: Refusals, *, rejected: bool, attitude: bool) -> tuple[Snapshot, Refusals]:
        """Keep count of a sensor's rejected readings; reopen the gate if they have been too many for too long.

        An accepted one makes up for half a rejected one. So a third of outliers is borne, and a filter that has locked
        onto a wrong place is found out although now and then an outlier suits it.
        """
        p = self._parameters
        if not rejected:
            return s, Refusals(before.since, before.excess - 0.5) if before.excess > 0.5 else NO_REFUSALS
        refusals = Refusals(min(before.since, s.t), before.excess + 1.0)
        if s.t - refusals.since < p.rejection_time or refusals.excess < p.rejection_excess:
            return s, refusals
        return self._reopened(s, attitude=attitude), NO_REFUSALS

    def _reopened(self, s: Snapshot, *, attitude: bool) -> Snapshot:
        """Admit that the estimate is wrong: a sensor's readings have all been rejected for too long."""
        p = self._parameters
        c_from_d = rotation_of(s.quaternion)
        joint = s.covariance.joint(c_from_d).copy()
        stds = (p.reopened_position_std, p.reopened_velocity_std, p.reopened_attitude_std if attitude else 0.0)
        for k in range(9):
            joint[k, k] += stds[k // 3] ** 2
        lever = s.covariance.lever if isinstance(s.covariance, Tandem) else None
        covariance = Compounded(joint) if lever is None else split(joint, c_from_d, lever, s.true_rate)
        return s._replace(covariance=covariance, reopenings=s.reopenings + 1)


def marker_jacobians(expected: Array, c_from_d: Array, size: int) -> Array:
    """Give d(marker in d)/d(error), (N, 3, size), for the expected markers (N, 3) in d."""
    jacobian = np.zeros((len(expected), 3, size))
    jacobian[:, :, 0:3] = -c_from_d.T
    x, y, z = expected.T
    jacobian[:, 0, 7], jacobian[:, 0, 8] = -z, y
    jacobian[:, 1, 6], jacobian[:, 1, 8] = z, -x
    jacobian[:, 2, 6], jacobian[:, 2, 7] = -y, x
    return jacobian
