"""A rover's odometry over the ground: what wheels cannot have done is taken off."""

import math

import numpy as np
import pytest

from companion.estimation.ground_odometry import AutopilotOdometry, GroundOdometry, GroundOdometryParameters
from companion.estimation.target_rest import TargetRest, TargetRestParameters
from companion.geometry.rotations import rotation_about_z
from companion.messages.ownship import OwnshipState

DT = 1.0 / 30.0
REAR = 0.18


def state(t, *, position=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), yaw=0.0, rate=0.0, counter=0):
    return OwnshipState(
        t=t,
        position_ned=np.array(position, float),
        velocity_ned=np.array(velocity, float),
        acceleration_ned=np.zeros(3),
        ned_from_frd=rotation_about_z(yaw),
        angular_velocity_frd=np.array([0.0, 0.0, rate]),
        reset_counter=counter,
    )


def odometry():
    return GroundOdometry(GroundOdometryParameters(), rear_axle=REAR)


def test_a_sideways_drift_of_the_autopilot_is_none_of_the_rovers() -> None:
    """It drives north at 1 m/s; the autopilot's position slides east at 0.3 m/s, and its velocity says so too."""
    ground = odometry()
    for k in range(150):
        t = k * DT
        told = state(t, position=(t, 0.3 * t, 0.0), velocity=(1.0, 0.3, 0.0))
        known = ground.take(told, standing=False, landmark=None)
    assert known.position_ned[:2] == pytest.approx([149 * DT, 0.0], abs=0.02)
    assert known.velocity_ned[:2] == pytest.approx([1.0, 0.0], abs=1e-6)


def test_a_rover_that_is_told_to_stand_stands_whatever_drifts() -> None:
    ground = odometry()
    dice = np.random.default_rng(3)
    places = []
    for k in range(200):
        told = state(k * DT, position=dice.normal(0, 0.2, 3), velocity=dice.normal(0, 0.3, 3), yaw=0.05 * math.sin(k))
        places.append(ground.take(told, standing=True, landmark=None))
    still = places[40:]
    assert ground.resting
    assert np.ptp([p.position_ned[:2] for p in still], axis=0).max() < 1e-12
    assert np.ptp([p.yaw for p in still]) < 1e-9


def test_the_heading_follows_the_gyro_and_not_the_compass() -> None:
    ground = odometry()
    for k in range(300):
        t = k * DT
        told = state(t, yaw=0.4 * t + 0.06 * math.sin(t), rate=0.4, velocity=(0.5, 0.0, 0.0))
        known = ground.take(told, standing=False, landmark=None)
    assert math.remainder(known.yaw - 0.4 * 299 * DT, math.tau) == pytest.approx(0.0, abs=1e-6)


def test_the_body_origin_swings_about_the_rear_axle() -> None:
    ground = odometry()
    for k in range(60):
        known = ground.take(state(k * DT, rate=1.0, yaw=k * DT), standing=False, landmark=None)
    yaw = known.yaw
    right = np.array([-math.sin(yaw), math.cos(yaw)])
    assert known.velocity_ned[:2] @ right == pytest.approx(REAR)


def test_a_landmark_gives_the_speed_and_what_it_showed_is_kept_for_a_while() -> None:
    """The autopilot says 0.7 m/s, the landmark 0.5."""
    ground = odometry()

    def driven(seconds, landmark, t0):
        for k in range(round(seconds / DT)):
            t = t0 + k * DT
            told = state(t, position=(0.7 * t, 0.0, 0.0), velocity=(0.7, 0.0, 0.0))
            known = ground.take(told, standing=False, landmark=landmark)
        return float(known.velocity_ned[0])

    assert driven(3.0, np.array([0.5, 0.1, 0.0]), 0.0) == pytest.approx(0.5)
    assert driven(0.2, None, 3.0) == pytest.approx(0.5, abs=0.03)
    assert driven(20.0, None, 3.2) == pytest.approx(0.7, abs=0.01)


def test_points_go_back_into_the_autopilots_frame_as_they_are_seen() -> None:
    ground = odometry()
    for k in range(100):
        t = k * DT
        told = state(t, position=(t, 0.4 * t, -0.2), velocity=(1.0, 0.4, 0.0), yaw=0.1 * math.sin(2 * t))
        known = ground.take(told, standing=False, landmark=None)
    seen = np.array([2.0, -1.0, 0.1])  # in the rover's level frame
    point = ground.point_told(known.position_ned + rotation_about_z(known.yaw) @ seen)
    assert rotation_about_z(-told.yaw) @ (point - told.position_ned) == pytest.approx(seen, abs=1e-9)
    assert ground.vector_told(ground.turned(np.array([1.0, 2.0, 3.0]))) == pytest.approx([1.0, 2.0, 3.0])


def test_a_reset_of_the_autopilots_estimator_moves_nothing() -> None:
    ground = odometry()
    before = ground.take(state(0.0), standing=False, landmark=None)
    after = ground.take(state(DT, position=(5.0, 3.0, 0.0), counter=1), standing=False, landmark=None)
    assert after.position_ned[:2] == pytest.approx(before.position_ned[:2], abs=0.01)
    gone = ground.take(state(DT + 3.0, position=(6.0, 3.0, 0.0), counter=1), standing=False, landmark=None)
    assert gone.position_ned[0] - after.position_ned[0] == pytest.approx(1.0, abs=0.01)


def test_in_the_air_the_autopilot_is_believed() -> None:
    told = state(1.0, position=(1.0, 2.0, 3.0))
    assert AutopilotOdometry().take(told, standing=True, landmark=None) is told


class TestTargetRest:
    def follow(self, rest, speed, seconds, t0=0.0, north=0.0, wander=0.15):
        """The rover drives; the target moves north, seen in a frame that wanders."""
        t = t0
        while t < t0 + seconds:
            t += 0.02
            north += 0.02 * speed
            rest.update(t, north=north + wander * math.sin(0.9 * t), east=0.0, speed=speed, surely=False)
        return t, north

    def test_a_slow_target_is_never_taken_for_one_that_stands(self) -> None:
        rest = TargetRest(TargetRestParameters())
        t, north = 0.0, 0.0
        for _ in range(60):
            t, north = self.follow(rest, 0.25, 1.0, t, north)
            assert not rest.resting

    def test_one_that_stands_is_found_and_its_leaving_too(self) -> None:
        rest = TargetRest(TargetRestParameters())
        t, north = self.follow(rest, 0.5, 10.0)
        t, north = self.follow(rest, 0.0, 6.5, t, north)
        assert rest.resting
        self.follow(rest, 0.5, 1.5, t, north)
        assert not rest.resting

    def test_from_a_standing_rover_it_is_seen_at_once(self) -> None:
        rest = TargetRest(TargetRestParameters())
        for k in range(30):
            rest.update(0.02 * k, north=0.0, east=0.0, speed=0.01, surely=True)
        assert rest.resting
        for k in range(30, 60):
            rest.update(0.02 * k, north=0.0, east=0.0, speed=0.25, surely=True)
        assert not rest.resting
