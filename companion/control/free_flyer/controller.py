"""Control of a planar free-flyer: from a reference and odometry to attitude and body thrust.

With r the reference, ^ the state predicted to the instant at which the command will act, d the observed disturbance:

    v = v_r + k_p / k_v (p_r - p^), no longer than the top speed
    a = a_r + k_v (v - v^) - d^

which is a_r + k_p (p_r - p^) + k_v (v_r - v^) - d^ below the top speed. It is turned into the body and divided by the
acceleration of full thrust. Both axes are scaled alike where that is more than the thrusters have, so that the
direction stays. The heading setpoint leads, since PX4's spacecraft module feeds no turn rate forward: it turns at
heading_gain times the heading error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from companion.control.free_flyer.gains import feedback_gains
from companion.control.free_flyer.observer import CommandHistory, PlaneObserver
from companion.control.free_flyer.parameters import FreeFlyerControlParameters
from companion.control.free_flyer.pulses import PulseMaker
from companion.geometry.angles import angle_difference
from companion.messages.motion import MotionState
from companion.messages.ownship import OwnshipState
from companion.messages.thrust import AttitudeThrust

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeFlyerStep:
    """One tick of the controller and what it saw."""

    setpoint: AttitudeThrust
    position_error: Pair  # [m] north, east: reference minus predicted
    disturbance: Pair  # [m/s^2] north, east: observed
    share: float  # of the wanted thrust that the thrusters can give, 0..1
    blind: bool  # the odometry is too old: no thrust


class FreeFlyerController:
    """Holds the observer, the commands under way and the impulses owed."""

    def __init__(self, parameters: FreeFlyerControlParameters, *, speed_max: float) -> None:
        """`speed_max`: [m/s] what feedback may never ask for more of."""
        self._p = parameters
        self._speed_max = speed_max
        self._gains = feedback_gains(parameters)
        self._history = CommandHistory()
        self._observer = PlaneObserver(parameters.observer_bandwidth, parameters.disturbance_max)
        self._pulses = (
            PulseMaker(parameters.pulse, parameters.pulse_period),
            PulseMaker(parameters.pulse, parameters.pulse_period),
        )

    @property
    def gains(self) -> Pair:
        """Feedback on position [1/s^2] and velocity [1/s]."""
        return self._gains

    def reset(self) -> None:
        """Forget everything: somebody else has flown."""
        p = self._p
        self._history = CommandHistory()
        self._observer = PlaneObserver(p.observer_bandwidth, p.disturbance_max)
        for pulses in self._pulses:
            pulses.reset()

    def update(self, t: float, reference: MotionState, ownship: OwnshipState) -> FreeFlyerStep:
        """Give the setpoint of one tick.

        Args:
            t: now [s].
            reference: at `t`, ned; its height and its feedback velocity, meant for an autopilot's loops, do not count.
            ownship: the newest odometry.
        """
        p = self._p
        self._observer.add(ownship, self._history)
        self._history.forget_before(self._observer.t)
        yaw, rate = ownship.yaw, float(ownship.angular_velocity_frd[2])
        acts = t + p.delay
        heading = yaw + rate * (acts - ownship.t)
        blind = t - ownship.t > p.blind_after
        wanted, error = ((0.0, 0.0), (0.0, 0.0)) if blind else self._acceleration(acts, reference)
        body, share = self._into_body(wanted, heading)
        thrust = (self._pulses[0].update(t, body[0]), self._pulses[1].update(t, body[1]))
        self._remember(acts, thrust, heading)
        return FreeFlyerStep(
            setpoint=AttitudeThrust(
                t=t, yaw=self._heading_setpoint(reference, yaw), thrust_body=np.array([thrust[0], thrust[1], 0.0])
            ),
            position_error=error,
            disturbance=self._observer.disturbance,
            share=share,
            blind=blind,
        )

    def _acceleration(self, acts: float, reference: MotionState) -> tuple[Pair, Pair]:
        """Wanted acceleration [m/s^2] and position error [m], north and east, when the command acts."""
        h = self._p.delay
        k_v = self._gains[1]
        position, velocity = self._observer.predict(acts, self._history)
        d = self._observer.disturbance
        places, speeds = reference.position_ned.tolist(), reference.velocity_ned.tolist()
        pushes, more = reference.acceleration_ned.tolist(), reference.feedback_acceleration_ned.tolist()
        error = (
            places[0] + speeds[0] * h + 0.5 * pushes[0] * h * h - position[0],
            places[1] + speeds[1] * h + 0.5 * pushes[1] * h * h - position[1],
        )
        speed = self._wanted_velocity((speeds[0] + pushes[0] * h, speeds[1] + pushes[1] * h), error)
        return (
            pushes[0] + more[0] + k_v * (speed[0] - velocity[0]) - d[0],
            pushes[1] + more[1] + k_v * (speed[1] - velocity[1]) - d[1],
        ), error

    def _wanted_velocity(self, velocity: Pair, error: Pair) -> Pair:
        """Velocity [m/s] that closes the position error [m] beside the reference's, within the top speed."""
        pull = self._gains[0] / self._gains[1]
        north, east = velocity[0] + pull * error[0], velocity[1] + pull * error[1]
        size = math.hypot(north, east)
        scale = 1.0 if size <= self._speed_max else self._speed_max / size
        return scale * north, scale * east

    def _into_body(self, wanted: Pair, heading: float) -> tuple[Pair, float]:
        """Normalised thrust forward and right that the thrusters have, and which share of the wanted it is."""
        scale = 1.0 / self._p.thrust_acceleration
        cosine, sine = math.cos(heading), math.sin(heading)
        forward = (cosine * wanted[0] + sine * wanted[1]) * scale
        right = (cosine * wanted[1] - sine * wanted[0]) * scale
        most, largest = 1.0 - self._p.turning_share, max(abs(forward), abs(right))
        share = 1.0 if largest <= most else most / largest
        return (share * forward, share * right), share

    def _remember(self, acts: float, thrust: Pair, heading: float) -> None:
        """Keep the acceleration that the thrust will give; below the dead band there is none."""
        forward, right = (part if abs(part) >= self._p.dead_band else 0.0 for part in thrust)
        scale = self._p.thrust_acceleration
        cosine, sine = math.cos(heading), math.sin(heading)
        self._history.add(acts, scale * (cosine * forward - sine * right), scale * (sine * forward + cosine * right))

    def _heading_setpoint(self, reference: MotionState, yaw: float) -> float:
        """Heading [rad] to command: the reference's, ahead by what the autopilot lags, no further than it may turn."""
        p = self._p
        lead = reference.yaw_rate / p.heading_gain
        error = angle_difference(reference.yaw + reference.feedback_yaw, yaw) + lead
        most = p.yaw_rate_max / p.heading_gain
        return yaw + max(-most, min(most, error))
