"""How well a chaser that stands still would know its pose, without flying it: a discrete Riccati equation."""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from companion.estimation.proximity.covariance import Compounded, Noise, Step, Tandem
from companion.estimation.proximity.fusion import marker_jacobians
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.geometry.arrays import Array
from companion.geometry.quaternions import rotation_of

ATTITUDE_STD = 0.0175  # [rad] one degree: what a start without a camera is known to
UNDETERMINED = (
    "what is measured does not determine the position here: three or more anchors are wanted, not in a plane with the "
    "chaser's radio, or three or more markers, not in a line"
)


def steady_state(
    setup: ProximitySetup,
    parameters: ProximityParameters,
    position: Array,
    quaternion: Array,
    *,
    with_vision: bool,
    range_rate: float = 50.0,
    vision_rate: float = 20.0,
    attitude_std: float = ATTITUDE_STD,
) -> Array:
    """Give the covariance of the filter's errors in the steady state at a standing pose, right after a measurement.

    All markers are taken to be in view if `with_vision`. Ranges count unless vision excludes them
    (`ranges_with_vision`). Without vision there is no steady state of the attitude, for ranges to a radio on a vehicle
    that does not turn depend on the radio's place alone: it stays at `attitude_std`.

    Args:
        setup: anchors, markers and mounts.
        parameters: noise of the filter.
        position: (3,) [m] of the centre of mass, in c.
        quaternion: (4,) c_from_d.
        with_vision: whether the camera sees the markers.
        range_rate: [1/s] of all anchors together, taken in turn.
        vision_rate: [1/s] pictures.
        attitude_std: [rad] per axis, without vision.

    Returns:
        (9, 9): position, velocity (c), attitude error (d), as in `ProximityState`.

    Raises:
        ValueError: the anchors do not determine the position there.
    """
    w, x, y, z = (float(number) for number in quaternion / np.linalg.norm(quaternion))
    c_from_d = rotation_of((w, x, y, z))
    noise = Noise(parameters.gyro_noise**2, 0.0, parameters.force_error_time)
    period = 1.0 / (vision_rate if with_vision else range_rate)
    step = Step(period, (0.0, 0.0, 0.0), period, c_from_d, np.zeros(3), parameters.acceleration_noise**2)
    process = Compounded(np.zeros((9, 9))).predicted(step, noise).matrix
    transition = np.eye(9)
    transition[0:3, 3:6] = period * np.eye(3)
    ranges = np.zeros((9, 9))
    if parameters.ranges_with_vision or not with_vision:
        ranges = _range_information(setup, parameters, position, c_from_d) * range_rate * period
    if with_vision:
        seen = (setup.markers_in_c - position) @ c_from_d
        rows = marker_jacobians(seen, c_from_d, 9).reshape(-1, 9)
        return _after_measurement(transition, process, ranges + rows.T @ rows / parameters.feature_std**2)
    translation = _after_measurement(transition[:6, :6], process[:6, :6], ranges[:6, :6])
    rotation = attitude_std**2 * np.eye(3)
    return Tandem(translation, rotation, setup.lever_arm, (0.0, 0.0, 0.0)).joint(c_from_d)


def _range_information(
    setup: ProximitySetup, parameters: ProximityParameters, position: Array, c_from_d: Array
) -> Array:
    """Give the information (9, 9) of one range, the mean over the anchors."""
    offsets = position + c_from_d @ setup.lever_arm - setup.anchors
    directions = offsets / np.linalg.norm(offsets, axis=1)[:, None]
    rows = np.hstack([directions, np.zeros_like(directions), np.cross(setup.lever_arm, directions @ c_from_d)])
    information: Array = rows.T @ rows / (len(rows) * parameters.range_std**2)
    return information


def _after_measurement(transition: Array, process: Array, information: Array) -> Array:
    """Solve `P = (((F P F' + Q)^-1) + information)^-1` for the covariance P."""
    values, vectors = np.linalg.eigh(information)
    told = values > 1e-9 * values[-1]
    rows = vectors[:, told].T
    noise = np.diag(1.0 / values[told])
    if len(rows) < len(transition) - 3:
        raise ValueError(UNDETERMINED)
    try:
        before = solve_discrete_are(transition.T, rows.T, process, noise)
    except (LinAlgError, ValueError) as error:
        raise ValueError(UNDETERMINED) from error
    gain = np.linalg.solve(rows @ before @ rows.T + noise, rows @ before).T
    after: Array = before - gain @ rows @ before
    return 0.5 * (after + after.T)
