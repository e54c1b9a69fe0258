"""How the rover and its target move: the sightings, the wheels and the autopilot's velocity, compared.

The autopilot's velocity drifts along the heading; the sightings tell the velocity relative to the target without that
drift. Where the target's own speed is known as well (it stands, it crosses the rover's way, or it has been watched
long enough) the two make a landmark: the rover's velocity over the ground.
"""

from __future__ import annotations

import math

import numpy as np

from companion.config.driving import DrivingSection
from companion.estimation.bias_observer import BiasObserver
from companion.estimation.ground_odometry import Odometry
from companion.estimation.target_rest import TargetRest
from companion.estimation.target_speed import TargetSpeed, crossing_speed
from companion.geometry.arrays import Array
from companion.messages.ownship import OwnshipState
from companion.messages.target import Prediction
from companion.runtime.tracking import Picture

FRESH_S = 0.3  # [s] an older sighting is no landmark
_STILL = np.zeros(3)


class RelativeMotion:
    """Holds what the sightings have told.

    Args:
        section: the observers' tuning.
        rear_axle: behind the body origin [m].
        odometry: gives the frame to go by, in which velocities are compared.
    """

    def __init__(self, section: DrivingSection, *, rear_axle: float, odometry: Odometry) -> None:
        self._p = section
        self._rear = rear_axle
        self._odometry = odometry
        self._relative = BiasObserver(bandwidth=section.bias_bandwidth, bias_max=section.relative_max_mps)
        self._rest = TargetRest(section.target_rest)
        self._speed = TargetSpeed(section.target_speed)
        self._course = _STILL  # the direction of the target's heading, in the frame to go by
        self._t_sighted = -math.inf
        self._crossing: float | None = None  # [m/s] the target's speed, where it crosses the rover's way in its view
        self._told_velocity = _STILL  # [m/s] the autopilot's, in the frame to go by
        self._rolling = _STILL  # [m/s] of that, what wheels can have done: nothing sideways but in a turn

    @property
    def target_rests(self) -> bool:
        """Whether the target stands."""
        return self._rest.resting

    @property
    def relative_velocity_ned(self) -> Array | None:
        """The rover's velocity relative to the target (3,) [m/s], None before the sightings have told it."""
        if not self._relative.settled:
            return None
        return self._rolling - self._relative.bias_ned

    def sighting_age(self, t: float) -> float:
        """Give how long ago [s] the target was seen, at `t` [s]; infinite before the first time."""
        return t - self._t_sighted

    def autopilot_bias_ned(self, ownship: OwnshipState) -> Array:
        """Give the velocity to add to one over the ground for the autopilot, in its frame (3,) [m/s].

        Args:
            ownship: the rover's motion in the frame to go by.
        """
        return self._odometry.vector_told(self._told_velocity - ownship.velocity_ned)

    def landmark(self, state: OwnshipState) -> Array | None:
        """Give the velocity by the sight of a target that stands, or drives at a known speed; see `Pilot.landmark`."""
        self._told_velocity = self._odometry.turned(state.velocity_ned)
        north, east, _ = self._odometry.turned(np.array([math.cos(state.yaw), math.sin(state.yaw), 0.0])).tolist()
        along = north * float(self._told_velocity[0]) + east * float(self._told_velocity[1])
        aside = self._rear * float(state.angular_velocity_frd[2])
        self._rolling = np.array([along * north - aside * east, along * east + aside * north, 0.0])
        self._crossing = None
        relative = self.relative_velocity_ned
        if relative is None or self.sighting_age(state.t) >= FRESH_S:
            return None
        self._crossing = crossing_speed(
            relative,
            course=(north, east),
            target_course=(float(self._course[0]), float(self._course[1])),
            aside=aside,
            least=self._p.target_speed.crossing,
        )
        speed = 0.0 if self.target_rests else self._speed.speed if self._crossing is None else self._crossing
        return None if speed is None else relative + speed * self._course

    def update(self, t: float, ownship: OwnshipState, picture: Picture) -> None:
        """Observe the velocity relative to the target, its speed, and whether it stands.

        Args:
            t: now [s].
            ownship: the rover's motion in the frame to go by.
            picture: what is known of the target now.
        """
        self._t_sighted = picture.t_sighted
        if picture.prediction is None or picture.sighted_ned is None:
            self._rest.forget()
            self._speed.forget()
            return
        self._relative.add(
            t=ownship.t,
            reset_counter=ownship.reset_counter,
            velocity_ned=self._rolling,
            position_ned=ownship.position_ned - picture.sighted_ned,
        )
        self._watch_target(t, picture.prediction, picture.sighted_ned)

    def forget(self) -> None:
        """Follow a reset of the autopilot's estimator: what was observed belongs to the old frame."""
        self._relative.forget()
        self._rest.forget()
        self._speed.forget()

    def _watch_target(self, t: float, prediction: Prediction, sighted_ned: Array) -> None:
        """Observe whether the target stands, and its speed where it does not."""
        north, east, _ = self._odometry.point_told(sighted_ned).tolist()
        target = prediction.at(t)
        surely = self._odometry.resting or self._crossing is not None
        speed = math.hypot(*target.velocity_ned[:2].tolist()) if self._crossing is None else abs(self._crossing)
        self._rest.update(t, north=north, east=east, speed=speed, surely=surely)
        self._course = np.array([math.cos(target.yaw), math.sin(target.yaw), 0.0])
        if self.target_rests:
            self._speed.forget()
        elif self.sighting_age(t) < FRESH_S:
            ahead, aside, _ = self._odometry.vector_told(self._course).tolist()
            self._speed.update(t, north=north, east=east, course=(ahead, aside), crossing=self._crossing)
