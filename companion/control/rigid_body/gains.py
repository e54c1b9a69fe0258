"""Feedback gains from the model.

Translation, one axis, with the position error e, its rate and its sum over the periods T:

    x = [e, de/dt, i],    A = [[1, T, 0], [0, 1, 0], [T, 0, 1]],    B = [T^2/2, T, 0]

The gain of u = K x minimises the sum of x' Q x + R u^2 (Ogata, Discrete-time Control Systems, section 8-4), Q and R by
Bryson's rule. Attitude: a quaternion feedback (Wie & Barba 1985, eq. 13) with gains proportional to the inertia is, for
small errors, an oscillator of the given natural frequency and damping about each axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from companion.control.rigid_body.parameters import RigidBodyParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class TranslationGains:
    """Of the acceleration on errors, goal minus state."""

    position: float  # [1/s^2]
    velocity: float  # [1/s]
    integral: float  # [1/s^3]


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeGains:
    """Of the angular acceleration on errors."""

    attitude: float  # [1/s^2] on the rotation to the goal [rad]
    rate: float  # [1/s]


def translation_gains(parameters: RigidBodyParameters) -> TranslationGains:
    """Give the gains of the linear-quadratic regulator with integral."""
    p = parameters
    dt = p.period
    a = np.array([[1.0, dt, 0.0], [0.0, 1.0, 0.0], [dt, 0.0, 1.0]])
    b = np.array([[0.5 * dt * dt], [dt], [0.0]])
    q = np.diag([p.position_scale**-2, p.velocity_scale**-2, p.integral_scale**-2])
    r = np.array([[p.acceleration_scale**-2]])
    cost = solve_discrete_are(a, b, q, r)
    gain = np.linalg.solve(r + b.T @ cost @ b, b.T @ cost @ a)[0]
    return TranslationGains(position=float(gain[0]), velocity=float(gain[1]), integral=float(gain[2]))


def attitude_gains(parameters: RigidBodyParameters) -> AttitudeGains:
    """Give the gains for the natural frequency and the damping."""
    w = parameters.natural_frequency
    return AttitudeGains(attitude=w * w, rate=2.0 * parameters.damping * w)
