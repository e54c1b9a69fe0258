"""A rigid body in free space, six degrees of freedom (Parikh et al., eq. 1 and 2, the mother-ship being inertial).

    I dw/dt = N - w x (I w),    dq/dt = 1/2 q (0, w),    dv/dt = R(q) F / m + a

w, N, F in the body's axes d; q is c_from_d; the residual acceleration a is constant in c. N and F are constant within a
step, so that the caller ends a step wherever a valve opens or shuts. Rates and attitude go by the classical Runge-Kutta
method; velocity and position by Simpson's rule over the turning force, exact while no nozzle is open.
"""

from __future__ import annotations

import numpy as np

from sitl_stub.cubesat.rotation import Matrix, cross, matrix_of, minus, normalised, plus, turned
from sitl_stub.truth import Quaternion, Vector


class FreeBody:
    """Motion of the body.

    Its origin is the centre of the cube; it turns about its centre of mass, which stands at `mass_centre` [m], in d.
    """

    __slots__ = ("_centre", "_inertia", "_inverse", "_mass", "_mass_centre", "_pull", "_speed", "quaternion", "rate")

    def __init__(
        self,
        *,
        mass: float,
        inertia: Matrix,
        mass_centre: Vector,
        position: Vector,
        quaternion: Quaternion,
        velocity: Vector = (0.0, 0.0, 0.0),
        rate: Vector = (0.0, 0.0, 0.0),
        residual_acceleration: Vector = (0.0, 0.0, 0.0),
    ) -> None:
        self._mass = mass
        self._mass_centre = mass_centre
        self._pull = residual_acceleration
        self._inertia = inertia
        a, b, c = np.linalg.inv(np.array(inertia)).tolist()
        self._inverse: Matrix = (tuple(a), tuple(b), tuple(c))
        self.quaternion = quaternion
        """c_from_d"""
        self.rate = rate
        """Of d against c [rad/s], in d."""
        rotation = matrix_of(quaternion)
        self._centre = plus(position, turned(rotation, mass_centre))
        self._speed = plus(velocity, turned(rotation, cross(rate, mass_centre)))

    @property
    def position(self) -> Vector:
        """Centre of the cube [m], in c."""
        return minus(self._centre, turned(matrix_of(self.quaternion), self._mass_centre))

    @property
    def velocity(self) -> Vector:
        """Of the centre of the cube [m/s], in c."""
        swing = turned(matrix_of(self.quaternion), cross(self.rate, self._mass_centre))
        return minus(self._speed, swing)

    def hold(self, position: Vector, quaternion: Quaternion) -> None:
        """Put the body at rest."""
        self.quaternion, self.rate = quaternion, (0.0, 0.0, 0.0)
        self._centre = plus(position, turned(matrix_of(quaternion), self._mass_centre))
        self._speed = (0.0, 0.0, 0.0)

    def step(self, h: float, force: Vector, torque: Vector) -> None:
        """Advance by `h` [s] under a force [N] and a torque [N m] about the centre of mass, both constant in d."""
        before = self.quaternion
        middle = self._turn(h, torque)
        px, py, pz = self._pull
        vx, vy, vz = self._speed
        x, y, z = self._centre
        if not any(force):
            square = 0.5 * h * h
            self._centre = (x + h * vx + square * px, y + h * vy + square * py, z + h * vz + square * pz)
            self._speed = (vx + h * px, vy + h * py, vz + h * pz)
            return
        ax, ay, az = turned(matrix_of(before), force)
        bx, by, bz = turned(matrix_of(middle), force)
        cx, cy, cz = turned(matrix_of(self.quaternion), force)
        once, twice = h / (6.0 * self._mass), h * h / (6.0 * self._mass)
        square = 0.5 * h * h
        self._centre = (
            x + h * vx + square * px + twice * (ax + bx + bx),
            y + h * vy + square * py + twice * (ay + by + by),
            z + h * vz + square * pz + twice * (az + bz + bz),
        )
        self._speed = (
            vx + h * px + once * (ax + 4.0 * bx + cx),
            vy + h * py + once * (ay + 4.0 * by + cy),
            vz + h * pz + once * (az + 4.0 * bz + cz),
        )

    def _turn(self, h: float, torque: Vector) -> Quaternion:
        """Advance rates and attitude by one Runge-Kutta step; gives the attitude in the middle of it.

        The two slopes in the middle lead there from both sides: the mean of their attitudes is good to the third order.
        """
        half, sixth = 0.5 * h, h / 6.0
        w, q = self.rate, self.quaternion
        a1, d1 = self._angular_acceleration(w, torque), _spin(q, w)
        w2, q2 = plus(w, a1, half), _moved(q, d1, half)
        a2, d2 = self._angular_acceleration(w2, torque), _spin(q2, w2)
        w3, q3 = plus(w, a2, half), _moved(q, d2, half)
        a3, d3 = self._angular_acceleration(w3, torque), _spin(q3, w3)
        w4, q4 = plus(w, a3, h), _moved(q, d3, h)
        a4, d4 = self._angular_acceleration(w4, torque), _spin(q4, w4)
        self.rate = (
            w[0] + sixth * (a1[0] + 2.0 * (a2[0] + a3[0]) + a4[0]),
            w[1] + sixth * (a1[1] + 2.0 * (a2[1] + a3[1]) + a4[1]),
            w[2] + sixth * (a1[2] + 2.0 * (a2[2] + a3[2]) + a4[2]),
        )
        self.quaternion = normalised(
            (
                q[0] + sixth * (d1[0] + 2.0 * (d2[0] + d3[0]) + d4[0]),
                q[1] + sixth * (d1[1] + 2.0 * (d2[1] + d3[1]) + d4[1]),
                q[2] + sixth * (d1[2] + 2.0 * (d2[2] + d3[2]) + d4[2]),
                q[3] + sixth * (d1[3] + 2.0 * (d2[3] + d3[3]) + d4[3]),
            )
        )
        return normalised((q2[0] + q3[0], q2[1] + q3[1], q2[2] + q3[2], q2[3] + q3[3]))

    def _angular_acceleration(self, w: Vector, torque: Vector) -> Vector:
        (a, b, c), (_, d, e), (_, _, f) = self._inertia
        x, y, z = w
        hx, hy, hz = a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z
        nx = torque[0] - y * hz + z * hy
        ny = torque[1] - z * hx + x * hz
        nz = torque[2] - x * hy + y * hx
        (a, b, c), (_, d, e), (_, _, f) = self._inverse
        return (a * nx + b * ny + c * nz, b * nx + d * ny + e * nz, c * nx + e * ny + f * nz)


def _spin(q: Quaternion, rate: Vector) -> Quaternion:
    """Time derivative of a quaternion that turns with `rate`, given in the turning frame."""
    w, x, y, z = q
    a, b, c = 0.5 * rate[0], 0.5 * rate[1], 0.5 * rate[2]
    return (-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a)


def _moved(q: Quaternion, derivative: Quaternion, h: float) -> Quaternion:
    return (
        q[0] + h * derivative[0],
        q[1] + h * derivative[1],
        q[2] + h * derivative[2],
        q[3] + h * derivative[3],
    )
