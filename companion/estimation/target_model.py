"""The target's motion and measurement models, along the odometry's axes.

State (12): north, east, down [m], heading [rad], their rates [m/s, rad/s], and the errors of the levelling, in roll and
pitch [rad]: first those that last all flight, then those that wander. The position is that of the target in the
odometry's frame; the measurement is relative to the vehicle, so our own motion enters only as a difference of odometry,
and any turn or shift of the odometry's frame cancels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Lt

from companion.geometry.arrays import Array

SIZE = 12
POSE = slice(0, 4)  # [m, m, m, rad]
RATES = slice(4, 8)  # [m/s, m/s, m/s, rad/s]
TILT = slice(8, 12)  # [rad] lasting roll, pitch; wandering roll, pitch


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetEstimatorParameters:
    """Tuning of the target's filter."""

    velocity_model: Literal["augmented", "sliding_window"] = "augmented"
    # Process noise of a target at rest seen from a drifting odometry; densities.
    acceleration_horizontal: Annotated[float, Gt(0.0)] = 0.12  # [m/s^2 per sqrt(Hz)]
    acceleration_vertical: Annotated[float, Gt(0.0)] = 0.07  # [m/s^2 per sqrt(Hz)]
    acceleration_turn: Annotated[float, Gt(0.0)] = 0.025  # [rad/s^2 per sqrt(Hz)]
    wander_horizontal: Annotated[float, Ge(0.0)] = 0.003  # [m/s per sqrt(Hz)] random walk of the position
    wander_vertical: Annotated[float, Ge(0.0)] = 0.0007  # [m/s per sqrt(Hz)]
    wander_turn: Annotated[float, Ge(0.0)] = 0.0012  # [rad/s per sqrt(Hz)] random walk of the heading
    # Adaptation: the noise of an axis group is scaled up while its innovations are larger than they should be.
    adaptation_gain: Annotated[float, Ge(0.0), Lt(1.0)] = 0.1  # per measurement; 0 switches it off
    adaptation_dead_band: Annotated[float, Ge(1.0)] = 1.2  # normalised squared innovation that is still normal
    adaptation_clip: Annotated[float, Gt(1.0)] = 20.0  # most that one innovation may count
    wander_scale_limit: Annotated[float, Ge(1.0)] = 1e4  # most that the random-walk densities [.. ^2] are scaled
    acceleration_scale_limit: Annotated[float, Ge(1.0)] = 20.0  # most that the acceleration densities [.. ^2] are
    # Tilt error of the levelling: what lasts (mounting, accelerometer bias) and what wanders (Gauss-Markov).
    tilt_bias_roll: Annotated[float, Ge(0.0)] = 0.0175  # [rad]
    tilt_bias_pitch: Annotated[float, Ge(0.0)] = 0.0105  # [rad]
    tilt_wander_roll: Annotated[float, Ge(0.0)] = 0.014  # [rad]
    tilt_wander_pitch: Annotated[float, Ge(0.0)] = 0.0105  # [rad]
    tilt_time_roll: Annotated[float, Gt(0.0)] = 2.5  # [s] correlation time of the wander
    tilt_time_pitch: Annotated[float, Gt(0.0)] = 6.0  # [s]
    tilt_estimated: bool = False  # False: only its uncertainty is carried (Schmidt-Kalman)
    # Lasts all flight: where the camera sits on the vehicle, each axis, by how well that was measured.
    mount_sigma: Annotated[float, Ge(0.0)] = 0.003  # [m] 3 mm: a ruler
    # Start.
    initial_velocity_horizontal: Annotated[float, Gt(0.0)] = 0.7  # [m/s] deviation
    initial_velocity_vertical: Annotated[float, Gt(0.0)] = 0.3  # [m/s]
    initial_turn_rate: Annotated[float, Gt(0.0)] = 0.4  # [rad/s]
    # Sliding window (Patel et al., section 3).
    window_steps: Annotated[int, Ge(2)] = 15  # filter states differenced
    # Which measurements are real (`target_hypotheses.py`).
    gate_probability: Annotated[float, Gt(0.0), Lt(1.0)] = 0.999  # that a good measurement passes
    outlier_probability: Annotated[float, Gt(0.0), Lt(1.0)] = 0.4  # that one is random: carefully high
    outlier_volume: Annotated[float, Gt(0.0)] = 20.0  # [m^3] such a one is anywhere in this, in any heading
    manoeuvre_probability: Annotated[float, Gt(0.0), Lt(1.0)] = 0.01  # that it moves at random between two of them,
    manoeuvre_horizontal: Annotated[float, Gt(0.0)] = 0.3  # [m/s per sqrt(Hz)] by this random walk of the position,
    manoeuvre_vertical: Annotated[float, Gt(0.0)] = 0.07  # [m/s per sqrt(Hz)]
    manoeuvre_turn: Annotated[float, Gt(0.0)] = 0.12  # [rad/s per sqrt(Hz)] and this of the heading
    jump_probability: Annotated[float, Gt(0.0), Lt(1.0)] = 1e-25  # that the target is suddenly somewhere else
    belief_margin: Annotated[float, Ge(0.0)] = 3.0  # log odds by which another choice must be more probable
    hypotheses: Annotated[int, Ge(1)] = 8  # kept
    coast_limit: Annotated[float, Gt(0.0)] = 30.0  # [s] without measurement after which there is no track
    history: Annotated[float, Gt(0.0)] = 1.0  # [s] a measurement may be late
    nis_averaging: Annotated[float, Gt(0.0), Lt(1.0)] = 0.05  # weight of the newest in the averaged NIS


_DIAGONAL = np.arange(SIZE) * (SIZE + 1)
_POSE_DIAGONAL = _DIAGONAL[POSE]
_RATE_DIAGONAL = _DIAGONAL[RATES]
_POSE_RATE = np.arange(4) * SIZE + np.arange(4, 8)
_RATE_POSE = np.arange(4, 8) * SIZE + np.arange(4)
_IDENTITY = np.eye(SIZE)
_IDENTITY.setflags(write=False)


def tilt_variances(parameters: TargetEstimatorParameters) -> Array:
    """Give the variances of the four tilt errors, (4,)."""
    p = parameters
    return np.square([p.tilt_bias_roll, p.tilt_bias_pitch, p.tilt_wander_roll, p.tilt_wander_pitch])


def acceleration_densities(parameters: TargetEstimatorParameters) -> Array:
    """Give the squared acceleration densities of north, east, down, heading, (4,)."""
    horizontal = parameters.acceleration_horizontal**2
    return np.array([horizontal, horizontal, parameters.acceleration_vertical**2, parameters.acceleration_turn**2])


def wander_densities(parameters: TargetEstimatorParameters) -> Array:
    """Give the squared random-walk densities of north, east, down, heading, (4,)."""
    horizontal = parameters.wander_horizontal**2
    return np.array([horizontal, horizontal, parameters.wander_vertical**2, parameters.wander_turn**2])


def manoeuvre_densities(parameters: TargetEstimatorParameters) -> Array:
    """Give those of a target that moves at random between two measurements, (4,)."""
    horizontal = parameters.manoeuvre_horizontal**2
    return np.array([horizontal, horizontal, parameters.manoeuvre_vertical**2, parameters.manoeuvre_turn**2])


def transition(dt: float, parameters: TargetEstimatorParameters) -> Array:
    """Give the constant-velocity transition over `dt` [s], (12, 12); the wandering tilt errors decay."""
    matrix = _IDENTITY.copy()
    flat = matrix.reshape(-1)
    flat[_POSE_RATE] = dt
    matrix[10, 10] = math.exp(-dt / parameters.tilt_time_roll)
    matrix[11, 11] = math.exp(-dt / parameters.tilt_time_pitch)
    return matrix


def add_process_noise(
    covariance: Array, dt: float, acceleration: Array, wander: Array, parameters: TargetEstimatorParameters
) -> None:
    """Add the noise of `dt` [s] in place: white acceleration, random walk of the pose, Gauss-Markov tilt.

    Per axis, with q the squared acceleration density and w that of the walk:
    [[q dt^3 / 3 + w dt, q dt^2 / 2], [q dt^2 / 2, q dt]].

    Args:
        covariance: (12, 12), C-contiguous.
        dt: [s].
        acceleration: squared densities (4,).
        wander: squared densities (4,).
        parameters: for the tilt.
    """
    flat = covariance.reshape(-1)
    flat[_POSE_DIAGONAL] += acceleration * (dt * dt * dt / 3.0) + wander * dt
    cross = acceleration * (0.5 * dt * dt)
    flat[_POSE_RATE] += cross
    flat[_RATE_POSE] += cross
    flat[_RATE_DIAGONAL] += acceleration * dt
    covariance[10, 10] -= parameters.tilt_wander_roll**2 * math.expm1(-2.0 * dt / parameters.tilt_time_roll)
    covariance[11, 11] -= parameters.tilt_wander_pitch**2 * math.expm1(-2.0 * dt / parameters.tilt_time_pitch)


def expected_measurement(mean: Array, origin: Array, axes: Array) -> Array:
    """Give the measurement (4,) expected of a target: its relative pose turned by the tilt error.

    Equation: z = [r + a x r, heading + a_down], r = position - origin, a = axes @ (roll error, pitch error).

    Args:
        mean: (12,) state.
        origin: (3,) [m] the vehicle in the odometry's frame.
        axes: (3, 2) the vehicle's forward and right axes in the odometry's frame, about which the attitude is wrong.
    """
    rn, re, rd = (mean[0:3] - origin).tolist()
    an, ae, ad = _turn(mean, axes)
    return np.array([rn + ae * rd - ad * re, re + ad * rn - an * rd, rd + an * re - ae * rn, float(mean[3]) + ad])


def measurement_jacobian(mean: Array, origin: Array, axes: Array) -> Array:
    """Give the derivative (4, 12) of `expected_measurement` by the state."""
    rn, re, rd = (mean[0:3] - origin).tolist()
    an, ae, ad = _turn(mean, axes)
    (fn, gn), (fe, ge), (fd, gd) = axes.tolist()
    zero4 = (0.0, 0.0, 0.0, 0.0)
    north = (fe * rd - fd * re, ge * rd - gd * re)
    east = (fd * rn - fn * rd, gd * rn - gn * rd)
    down = (fn * re - fe * rn, gn * re - ge * rn)
    return np.array(
        [
            (1.0, -ad, ae, 0.0, *zero4, *north, *north),
            (ad, 1.0, -an, 0.0, *zero4, *east, *east),
            (-ae, an, 1.0, 0.0, *zero4, *down, *down),
            (0.0, 0.0, 0.0, 1.0, *zero4, fd, gd, fd, gd),
        ]
    )


def height_shortening(parameters: TargetEstimatorParameters) -> tuple[float, float]:
    """Give mean and variance of what a tilt error takes off a height, as a share of it: half the tilt error squared.

    It is of second order, and yet at 3 m as large as what the corners leave open; it does not average out.
    """
    roll, pitch = (tilt_variances(parameters).reshape(2, 2).sum(axis=0)).tolist()
    return 0.5 * (roll + pitch), 0.5 * (roll * roll + pitch * pitch)


def turn_about_down(yaw: float) -> Array:
    """Give the turn (12, 12) of a state's axes by `yaw` [rad] about down: headings are not added to, tilts stay."""
    c, s = math.cos(yaw), math.sin(yaw)
    matrix = _IDENTITY.copy()
    for first in (0, 4):
        matrix[first, first] = matrix[first + 1, first + 1] = c
        matrix[first, first + 1] = -s
        matrix[first + 1, first] = s
    return matrix


def _turn(mean: Array, axes: Array) -> tuple[float, float, float]:
    """Give the tilt error as a small turn [rad] about north, east and down."""
    _, _, _, _, _, _, _, _, bias_roll, bias_pitch, wander_roll, wander_pitch = mean.tolist()
    north, east, down = (axes @ (bias_roll + wander_roll, bias_pitch + wander_pitch)).tolist()
    return north, east, down
