"""Control of a rigid body by on/off nozzles: one call in a control period.

The estimate is carried to the instant at which the valves answer, with the pulses that are still to come until
then; the goal is carried to the same instant. Translation and attitude feedback give a force and a torque,
`pulses.py` makes on-times of them.
"""

from __future__ import annotations

import numpy as np

from companion.control.rigid_body.attitude import AttitudeFeedback
from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.control.rigid_body.pulses import PulseMaker
from companion.control.rigid_body.translation import TranslationFeedback
from companion.geometry.arrays import Array
from companion.geometry.quaternions import Quaternion, between, rotation_of, turned_slightly
from companion.messages.proximity import NozzlePulses, PoseGoal, ProximityState


class RigidBodyController:
    """Holds the integral, the impulse owed and the pulses under way."""

    def __init__(self, parameters: RigidBodyParameters) -> None:
        self._p = parameters
        self._translation = TranslationFeedback(parameters)
        self._attitude = AttitudeFeedback(parameters)
        self._pulses = PulseMaker(parameters)
        self._inertia = np.array(parameters.inertia)
        self._latest: NozzlePulses | None = None

    @property
    def disturbance(self) -> Array:
        """Acceleration [m/s^2] that the integral makes up for, (3,), in c."""
        return self._translation.disturbance

    def reset(self) -> None:
        """Forget everything: somebody else has flown."""
        self._translation.reset()
        self._pulses.reset()
        self._latest = None

    def step(self, t: float, state: ProximityState, goal: PoseGoal) -> NozzlePulses:
        """Give the pulses of the period that begins at `t`.

        Args:
            t: now [s].
            state: the newest estimate.
            goal: at `t`.
        """
        p = self._p
        if t - state.t > p.blind_after:
            self._pulses.reset()
            return self._send(t, np.zeros(len(p.nozzle_places)), np.zeros(6))
        acts = t + p.valve_delay
        position, velocity, quaternion, rate = self._at(acts, state)
        c_from_d = rotation_of(quaternion)
        error = goal.position + p.valve_delay * goal.velocity - position
        band = self._translation.band(state.covariance)
        push = goal.acceleration + self._translation.acceleration(
            error, goal.velocity + p.valve_delay * goal.acceleration - velocity, band
        )
        goal_then = turned_slightly(goal.quaternion.tolist(), (p.valve_delay * goal.rate).tolist())
        d_from_goal = between(quaternion, goal_then)
        torque = self._attitude.torque(np.array(d_from_goal), rotation_of(d_from_goal) @ goal.rate, rate)
        allocation = self._pulses.update(
            p.period * np.concatenate([p.mass * (push @ c_from_d), torque]),
            position_band=float(band.min()),
            attitude_band=self._attitude.band(state.covariance[6:, 6:]),
        )
        if allocation.share >= 1.0:
            self._translation.integrate(error, band)
        return self._send(t, allocation.on_times, allocation.wrench)

    def _send(self, t: float, on_times: Array, wrench: Array) -> NozzlePulses:
        mean = wrench / self._p.period
        self._latest = NozzlePulses(t=t, on_times=tuple(on_times.tolist()), force=mean[:3], torque=mean[3:])
        return self._latest

    def _at(self, t: float, state: ProximityState) -> tuple[Array, Array, Quaternion, Array]:
        """Give position, velocity (c), c_from_d and rate (d) at `t` [s].

        What the pulses add from the estimate on is counted in full, and for the places as if it came at half time.
        """
        dt = t - state.t
        position, velocity, rate = state.position, state.velocity, state.rate
        attitude: Quaternion = state.quaternion.tolist()
        to_come = self._to_come(state.t)
        if to_come is not None:
            dv = rotation_of(attitude) @ to_come[:3] / self._p.mass
            dw = to_come[3:] / self._inertia
            position = position + (velocity + 0.5 * dv) * dt
            quaternion = turned_slightly(attitude, (dt * (rate + 0.5 * dw)).tolist())
            return position, velocity + dv, quaternion, rate + dw
        return position + velocity * dt, velocity, turned_slightly(attitude, (dt * rate).tolist()), rate

    def _to_come(self, t: float) -> Array | None:
        """Give what the latest pulses give after `t` [s], (6,) [N s, N m s], in d; None where all is over."""
        latest = self._latest
        if latest is None:
            return None
        over = t - latest.t - self._p.valve_delay  # [s] that the valves have had
        if over >= max(latest.on_times):
            return None
        left: Array = self._pulses.effect @ [min(on, max(on - over, 0.0)) for on in latest.on_times]
        return left
