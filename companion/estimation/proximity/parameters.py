"""What the proximity filter is tuned by, and what it knows of the vehicle, the anchors and the target."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Interval, Le

from companion.geometry.arrays import Array, frozen
from companion.geometry.transform import RigidTransform

ANCHORS_MAX = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ProximityParameters:
    """Noise, gate and bookkeeping of the filter. The defaults are those of Parikh et al. where they print one."""

    structure: Literal["tandem", "compounded"] = "tandem"  # 6 + 3 states, or 9 in one (section IV-A)
    gyro_noise: Annotated[float, Gt(0.0)] = 6.1e-5  # [rad/s/sqrt(Hz)] VN-100: 0.0035 deg/s/sqrt(Hz)
    range_std: Annotated[float, Gt(0.0)] = 0.02  # [m] section III
    feature_std: Annotated[float, Gt(0.0)] = 0.001  # [m] per component of a marker in cam, section III
    # White acceleration that nobody commanded. 1e-4 lets the velocity wander by 1 mm/s in 100 s, and lets a constant
    # residual of 2e-5 m/s^2 displace the estimate by less than its standard deviation.
    acceleration_noise: Annotated[float, Gt(0.0)] = 1e-4  # [m/s^2/sqrt(Hz)]
    # Nozzles err by a share of their thrust and keep erring alike: white noise of the density that a wrong share makes
    # if it lasts for `force_error_time`.
    force_error: Annotated[float, Ge(0.0), Le(1.0)] = 0.05  # share of the commanded force
    force_error_time: Annotated[float, Gt(0.0)] = 1.0  # [s] about one burst
    gate_probability: Annotated[float, Interval(gt=0.0, lt=1.0)] = 0.9999  # section IV-D
    # A first measurement that is far better than the prediction would shrink the covariance by more than the
    # linearised model deserves (Lear; Zanetti, DeMars, Bishop 2010): its noise grows by this share of H P H'.
    underweighting: Annotated[float, Ge(0.0), Le(1.0)] = 0.2
    underweighting_ratio: Annotated[float, Gt(0.0)] = 10.0  # applies while H P H' is larger than this many R
    gyro_bias: bool = False  # estimate the gyro's bias; the paper assumes none
    gyro_bias_std: Annotated[float, Gt(0.0)] = 1e-4  # [rad/s] at the start, 20 deg/h
    gyro_bias_noise: Annotated[float, Ge(0.0)] = 1e-7  # [rad/s/sqrt(s)] how it wanders
    # Once pictures give the whole pose, ranges can only add what is wrong in the survey of anchors and target.
    ranges_with_vision: bool = False
    vision_primary_for: Annotated[float, Gt(0.0)] = 0.5  # [s] after such a picture; ten missed pictures
    # Rejected readings of a sensor, less half of the accepted ones: when there are so many, over so long a time, the
    # filter is wrong, not the sensor. Of 5 % outliers ten such never come together (below 1e-9 for each reading).
    rejection_time: Annotated[float, Gt(0.0)] = 0.5  # [s]
    rejection_excess: Annotated[float, Gt(0.0)] = 10.0  # readings
    # What is added then: as much as one outlier at the start displaces; it adds up if once is not enough.
    reopened_position_std: Annotated[float, Gt(0.0)] = 0.1  # [m]
    reopened_velocity_std: Annotated[float, Gt(0.0)] = 0.02  # [m/s] added then
    reopened_attitude_std: Annotated[float, Gt(0.0)] = 0.1  # [rad] added then, if it was the camera's readings
    history: Annotated[float, Interval(ge=1.0, le=10.0)] = 1.2  # [s] how late a reading may come; d looks back 1 s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProximitySetup:
    """The chaser, the anchors and the target, as surveyed.

    Raises:
        ValueError: a shape, a count or a size is impossible.
    """

    anchors: Array  # (N, 3) [m] in c, 1 to 8 of them
    lever_arm: Array  # (3,) [m] of the chaser's radio from the centre of mass, in d
    markers: Array  # (M, 3) [m] in t
    c_from_t: RigidTransform  # the target's pose
    d_from_cam: RigidTransform  # the camera's mount
    mass: float  # [kg]
    control_period: float  # [s] in which each command's mean force acts
    markers_in_c: Array = field(init=False)  # (M, 3) [m]

    def __post_init__(self) -> None:
        anchors = np.asarray(self.anchors, dtype=float)
        if anchors.ndim != 2 or anchors.shape[1] != 3 or not 1 <= len(anchors) <= ANCHORS_MAX:
            raise ValueError(f"anchors: shape {anchors.shape}; 1 to {ANCHORS_MAX} positions are wanted, shape (N, 3)")
        markers = np.asarray(self.markers, dtype=float)
        if markers.ndim != 2 or markers.shape[1] != 3:
            raise ValueError(f"markers: shape {markers.shape}; positions are wanted, shape (M, 3)")
        if not (np.isfinite(anchors).all() and np.isfinite(markers).all()):
            raise ValueError("anchors or markers: not all are finite; positions in metres are wanted")
        if not (self.mass > 0.0 and self.control_period > 0.0):
            raise ValueError(f"mass {self.mass} kg, control period {self.control_period} s; both must be positive")
        object.__setattr__(self, "anchors", frozen(anchors))
        object.__setattr__(self, "lever_arm", frozen(self.lever_arm, (3,)))
        object.__setattr__(self, "markers", frozen(markers))
        object.__setattr__(self, "markers_in_c", frozen(self.c_from_t.apply(markers)))
