"""A small spacecraft in free space, moved by pulses of its nozzles: the truth behind bench and tests of its control.

It is not the controller's model: nozzles are stronger or weaker and point a little beside, mass and centre of mass are
off, valves answer late, and something pushes all the time. Semi-implicit steps of 20 ms; what a valve is open within a
step counts in full, wherever in the step it was.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.messages.proximity import NozzlePulses, ProximityState

SUBSTEPS = 5  # in a control period


@dataclass(frozen=True, kw_only=True)
class Imperfection:
    """Standard deviations, but for the lengths that are given; drawn once for each flight."""

    strength: float = 0.05  # relative, of each nozzle
    direction: float = math.radians(1.0)  # [rad] of each nozzle
    mass: float = 0.02  # relative
    centre: float = 0.001  # [m] length of the centre of mass's offset
    delay: float = 0.003  # [s] of the valves
    push: float = 2e-5  # [m/s^2] length of the residual acceleration, constant in c


PERFECT = Imperfection(strength=0.0, direction=0.0, mass=0.0, centre=0.0, push=0.0)


def unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Give the quaternion a b."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *vector])


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Give the quaternion of a turn."""
    return np.array([math.cos(0.5 * angle), *(math.sin(0.5 * angle) * np.asarray(axis) / np.linalg.norm(axis))])


def matrix(q: np.ndarray) -> np.ndarray:
    w, v = q[0], q[1:]
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


class Spacecraft:
    """Pose and motion; frames as in `companion.messages.proximity`."""

    def __init__(
        self,
        parameters: RigidBodyParameters,
        imperfection: Imperfection,
        rng: np.random.Generator,
        *,
        position: np.ndarray,
        quaternion: np.ndarray,
    ) -> None:
        directions = np.array(parameters.nozzle_directions)
        tilted = directions + imperfection.direction * rng.normal(size=directions.shape)
        tilted /= np.linalg.norm(tilted, axis=1)[:, None]
        strength = parameters.thrust * (1.0 + imperfection.strength * rng.normal(size=len(directions)))
        forces = strength[:, None] * tilted
        places = np.array(parameters.nozzle_places) - imperfection.centre * unit(rng)
        self._effect = np.vstack([forces.T, np.cross(places, forces).T])
        self._mass = parameters.mass * (1.0 + imperfection.mass * rng.normal())
        self._inertia = np.array(parameters.inertia) * self._mass / parameters.mass
        self._push = imperfection.push * unit(rng)
        self._delay = imperfection.delay
        self._step = parameters.period / SUBSTEPS
        self._thrust = parameters.thrust
        self._tail = np.zeros(len(directions))  # [s] on-time that the last period's late valves still owe
        self._attitude_error = np.zeros(3)  # [rad] of noisy estimates
        self.impulse = 0.0  # [N s] nominal thrust times on-time, all nozzles
        self.openings = 0  # of all nozzles
        self.t = 0.0
        self.position = np.array(position, dtype=float)
        self.velocity = np.zeros(3)
        self.quaternion = np.array(quaternion, dtype=float)
        self.rate = np.zeros(3)

    def advance(self, pulses: NozzlePulses) -> None:
        """Move by one control period."""
        on = np.array(pulses.on_times)
        self.impulse += self._thrust * float(on.sum())
        self.openings += int(np.count_nonzero(on))
        for k in range(SUBSTEPS):
            begin, end = k * self._step - self._delay, (k + 1) * self._step - self._delay
            open_for = np.clip(np.minimum(on, end) - max(begin, 0.0), 0.0, None)
            if k == 0:
                open_for = open_for + self._tail
            self._move(self._effect @ open_for)
        self._tail = np.clip(on - (SUBSTEPS * self._step - self._delay), 0.0, None)
        self.t += SUBSTEPS * self._step

    def _move(self, impulse: np.ndarray) -> None:
        dt = self._step
        before = self.velocity
        self.velocity = before + matrix(self.quaternion) @ impulse[:3] / self._mass + self._push * dt
        self.position = self.position + 0.5 * (before + self.velocity) * dt
        momentum = self._inertia * self.rate
        rate = self.rate + (impulse[3:] - np.cross(self.rate, momentum) * dt) / self._inertia
        turned = product(self.quaternion, np.array([1.0, *(0.25 * dt * (self.rate + rate))]))
        self.quaternion, self.rate = turned / np.linalg.norm(turned), rate

    def state(self) -> ProximityState:
        """Give an exact estimate."""
        return self._state(self.position, self.velocity, self.quaternion, self.rate, np.zeros((9, 9)))

    def noisy_state(self, rng: np.random.Generator, *, position: float, velocity: float) -> ProximityState:
        """Give an estimate with white noise [m, m/s] and its honest covariance; to be called once in a period.

        The turn rate is as noisy as one reading of a VN-100 at 100 Hz; the attitude, which a filter carries on by the
        gyro, is wrong by 0.1 deg that change within 10 s.
        """
        attitude, rate = math.radians(0.1), math.radians(0.035)
        kept = math.exp(-SUBSTEPS * self._step / 10.0)
        self._attitude_error = kept * self._attitude_error + attitude * math.sqrt(1.0 - kept**2) * rng.normal(size=3)
        covariance = np.diag(np.repeat([position, velocity, attitude], 3) ** 2)
        error = np.array([1.0, *(0.5 * self._attitude_error)])
        return self._state(
            self.position + position * rng.normal(size=3),
            self.velocity + velocity * rng.normal(size=3),
            product(self.quaternion, error / np.linalg.norm(error)),
            self.rate + rate * rng.normal(size=3),
            covariance,
        )

    def _state(self, position, velocity, quaternion, rate, covariance) -> ProximityState:
        return ProximityState(
            t=self.t,
            position=position,
            velocity=velocity,
            quaternion=quaternion,
            rate=rate,
            covariance=covariance,
            mahalanobis=1.0,
            t_vision=self.t,
            t_range=self.t,
        )
