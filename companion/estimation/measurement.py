"""From the pad's pose in the camera to a measurement relative to the vehicle, levelled by the autopilot's attitude."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Lt

from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z, skew
from companion.geometry.transform import RigidTransform
from companion.messages.ownship import OwnshipState
from companion.messages.perception import PadObservation, PoseHypothesis
from companion.messages.target import HEADING, MeasurementVerdict, TargetMeasurement, TargetTrack


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementParameters:
    """How sure the levelled measurement is, and how the flip is resolved.

    Errors that last (the autopilot's tilt error, a camera mounted askew or some millimetres off) are not white: they
    are the estimator's, not part of the covariance here.
    """

    tilt_limit: Annotated[float, Gt(0.0), Lt(1.5)] = 0.5  # [rad] a pose whose pad leans more than this is refused
    tilt_sigma: Annotated[float, Gt(0.0)] = 0.08  # [rad] soft prior: a pad is about horizontal
    attitude_jitter: Annotated[float, Ge(0.0)] = 0.0005  # [rad] roll and pitch error from frame to frame
    capture_jitter: Annotated[float, Ge(0.0)] = 0.0005  # [s] error of the capture time from frame to frame
    heading_floor: Annotated[float, Ge(0.0)] = 0.0002  # [rad] least heading deviation
    covariance_scale: Annotated[float, Gt(0.0)] = 1.0  # on the pose covariance from the corners
    reprojection_floor: Annotated[float, Gt(0.0)] = 0.2  # [px] least corner deviation trusted when comparing poses
    ambiguity_margin: Annotated[float, Ge(0.0)] = 4.0  # difference of -2 log likelihood below which poses are alike
    agreement: Annotated[float, Ge(0.0)] = 4.0  # squared Mahalanobis distance below which two poses say the same
    prior_weight_limit: Annotated[float, Gt(0.0)] = 50.0  # most that the track may add to a pose's cost
    range_limit: Annotated[float, Gt(0.0)] = 200.0  # [m] a pad farther away is refused


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Candidate:
    measurement: TargetMeasurement
    cost: float  # -2 log likelihood, up to a constant


def measure_target(
    *,
    observation: PadObservation,
    ownship: OwnshipState,
    frd_from_cam: RigidTransform,
    prior: TargetTrack | None,
    parameters: MeasurementParameters,
) -> TargetMeasurement | MeasurementVerdict:
    """Level the pad's pose and choose between its hypotheses.

    Each hypothesis costs its reprojection error, its lean against gravity and its distance from the track. The cheapest
    wins; where two are about as cheap and say different things, none does.

    Args:
        observation: what one frame says of the pad.
        ownship: our own motion at the frame's capture.
        frd_from_cam: the camera on the vehicle.
        prior: the track at the frame's capture, where there is one.
        parameters: the tuning.

    Returns:
        The measurement, or why there is none: not seen or impossible (INVALID), or undecided (AMBIGUOUS).
    """
    level_from_frd = rotation_about_z(-ownship.yaw) @ ownship.ned_from_frd
    best: _Candidate | None = None
    second: _Candidate | None = None
    for hypothesis in observation.hypotheses:
        candidate = _candidate(observation, hypothesis, ownship, level_from_frd, frd_from_cam, prior, parameters)
        if candidate is None:
            continue
        if best is None or candidate.cost < best.cost:
            best, second = candidate, best
        elif second is None or candidate.cost < second.cost:
            second = candidate
    if best is None:
        return MeasurementVerdict.REJECTED_INVALID
    if second is not None and second.cost - best.cost < parameters.ambiguity_margin:
        difference = _difference(best.measurement, second.measurement)
        spread = best.measurement.covariance + second.measurement.covariance
        if float(difference @ np.linalg.solve(spread, difference)) > parameters.agreement:
            return MeasurementVerdict.REJECTED_AMBIGUOUS
    return best.measurement


def _candidate(
    observation: PadObservation,
    hypothesis: PoseHypothesis,
    ownship: OwnshipState,
    level_from_frd: Array,
    frd_from_cam: RigidTransform,
    prior: TargetTrack | None,
    parameters: MeasurementParameters,
) -> _Candidate | None:
    level_from_cam = level_from_frd @ frd_from_cam.rotation
    position = level_from_cam @ hypothesis.translation + level_from_frd @ frd_from_cam.translation
    level_from_pad = level_from_cam @ hypothesis.rotation
    if not math.isfinite(float(position.sum()) + float(level_from_pad.sum()) + float(hypothesis.covariance.sum())):
        return None
    lean = math.acos(max(-1.0, min(1.0, float(level_from_pad[2, 2]))))
    if lean > parameters.tilt_limit or float(position @ position) > parameters.range_limit**2:
        return None
    covariance = _covariance(hypothesis, ownship, level_from_frd, level_from_cam, level_from_pad, position, parameters)
    if float(covariance.diagonal().min()) <= 0.0:
        return None
    measurement = TargetMeasurement(
        t=observation.t,
        position_level=position,
        heading=math.atan2(float(level_from_pad[1, 0]), float(level_from_pad[0, 0])),
        covariance=covariance,
        slope_level=level_from_pad[:2, 2],
        slope_std=_slope_std(hypothesis, level_from_cam, parameters),
    )
    cost = _reprojection_cost(observation, hypothesis, parameters) + (lean / parameters.tilt_sigma) ** 2
    if prior is not None:
        cost += min(parameters.prior_weight_limit, _distance_from(prior, measurement))
    return _Candidate(measurement=measurement, cost=cost)


def _slope_std(hypothesis: PoseHypothesis, level_from_cam: Array, parameters: MeasurementParameters) -> float:
    """Give the deviation [rad] of the pad's normal, the mean of both axes, of a pad that lies about level."""
    turn = level_from_cam[:2] @ hypothesis.covariance[3:, 3:] @ level_from_cam[:2].T
    return math.sqrt(max(0.0, 0.5 * parameters.covariance_scale * float(turn[0, 0] + turn[1, 1])))


def pose_jacobian(level_from_cam: Array, level_from_pad: Array) -> Array:
    """Give the derivative (4, 6) of [position_level, heading] by a hypothesis's [translation, rotation vector] in cam.

    The rotation vector acts on the left in cam, hence as w = level_from_cam @ rotation_vector in level. With m the
    pad's x axis in level: d heading = w_z - m_z (m_x w_x + m_y w_y) / (m_x^2 + m_y^2).
    """
    jacobian = np.zeros((4, 6))
    jacobian[:3, :3] = level_from_cam
    mx, my, mz = level_from_pad[:, 0].tolist()
    across = mz / (mx * mx + my * my)
    jacobian[3, 3:] = np.array([-across * mx, -across * my, 1.0]) @ level_from_cam
    return jacobian


def _covariance(
    hypothesis: PoseHypothesis,
    ownship: OwnshipState,
    level_from_frd: Array,
    level_from_cam: Array,
    level_from_pad: Array,
    position: Array,
    parameters: MeasurementParameters,
) -> Array:
    """Propagate corner noise, attitude jitter and timing to [position, heading], (4, 4)."""
    jacobian = pose_jacobian(level_from_cam, level_from_pad)
    covariance: Array = jacobian @ hypothesis.covariance @ jacobian.T * parameters.covariance_scale
    lever = skew(position)
    tilting = lever[:, :2]
    covariance[:3, :3] += parameters.attitude_jitter**2 * (tilting @ tilting.T)
    # A frame stamped too late by dt is levelled with an attitude turned by w dt and placed at a position moved by v dt.
    rate = level_from_frd @ ownship.angular_velocity_frd
    cosine, sine = math.cos(ownship.yaw), math.sin(ownship.yaw)
    north, east, down = ownship.velocity_ned.tolist()
    drift = lever @ rate - np.array([cosine * north + sine * east, cosine * east - sine * north, down])
    covariance[:3, :3] += parameters.capture_jitter**2 * np.outer(drift, drift)
    covariance[3, 3] += parameters.heading_floor**2
    return 0.5 * (covariance + covariance.T)


def _reprojection_cost(
    observation: PadObservation, hypothesis: PoseHypothesis, parameters: MeasurementParameters
) -> float:
    detections = observation.detections
    sigma = max((d.corner_sigma for d in detections), default=0.0)
    normalised = hypothesis.reprojection_rms / max(sigma, parameters.reprojection_floor)
    return normalised * normalised * 4.0 * max(1, len(detections))


def _difference(a: TargetMeasurement, b: TargetMeasurement) -> Array:
    difference = np.empty(4)
    difference[:3] = a.position_level - b.position_level
    difference[3] = wrap_angle(a.heading - b.heading)
    return difference


def _distance_from(prior: TargetTrack, measurement: TargetMeasurement) -> float:
    difference = np.empty(4)
    difference[:3] = measurement.position_level - prior.state[:3]
    difference[3] = wrap_angle(measurement.heading - float(prior.state[HEADING]))
    spread = measurement.covariance + prior.covariance[:4, :4]
    return float(difference @ np.linalg.solve(spread, difference))
