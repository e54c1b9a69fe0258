"""From a goal to a free-flyer's trajectory: it leads to the place, and keeps the target's boards in sight."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.config.floating import Course, FloatingSection
from companion.geometry.rotations import rotation_about_z
from companion.guardian.handover import Handover, Stage
from companion.guardian.handover_frame import decode, encode
from companion.guidance.goals import Goal, behind_target, stand_still
from companion.messages.ownship import OwnshipState
from companion.messages.target import TargetPose
from companion.planning.minimum_snap import PlanParameters
from companion.runtime.floating import Boards, Floating
from companion.runtime.tracking import NOTHING_SEEN
from companion.vehicles.free_flyer import FreeFlyer

FLYER = FreeFlyer()
DOCK = Boards(ahead=0.65, radius=0.16)
DT = 0.02


class Moving:
    """A forecast of a target that goes straight on."""

    t, horizon, reset_counter = 0.0, 10.0, 0

    def __init__(self, north, east, yaw, velocity=(0.0, 0.0)):
        self._place, self._yaw = np.array([north, east, -0.25]), yaw
        self._velocity = np.array([*velocity, 0.0])

    def at(self, t):
        return TargetPose(
            t=t,
            position_ned=self._place + t * self._velocity,
            velocity_ned=self._velocity,
            acceleration_ned=np.zeros(3),
            yaw=self._yaw,
            yaw_rate=0.0,
            covariance=np.zeros((4, 4)),
        )


class Flight:
    """A free-flyer that does at once what it is told."""

    def __init__(self, target, *, course=Course.CONSTANT_BEARING, standoff=0.0, boards=DOCK):
        self.pilot = Floating(FloatingSection(course=course), PlanParameters(), FLYER, boards=boards)
        self.target, self.standoff = target, standoff
        self.t, self.place, self.velocity, self.yaw = 0.0, np.array([0.0, 0.0, -0.25]), np.zeros(3), 0.0

    def ownship(self):
        return OwnshipState(
            t=self.t,
            position_ned=self.place,
            velocity_ned=self.velocity,
            acceleration_ned=np.zeros(3),
            ned_from_frd=rotation_about_z(self.yaw),
            angular_velocity_frd=np.zeros(3),
            reset_counter=0,
        )

    def trajectory(self, goal=None):
        if goal is None:
            place = behind_target(self.target, self.standoff)
            goal = Goal(at=place, t_reach=self.t, relative=True, direct=False)
        return self.pilot.update(
            t=self.t,
            dt=DT,
            goal=goal,
            switched=False,
            ownship=self.ownship(),
            picture=replace(NOTHING_SEEN, prediction=self.target),
        )

    def tick(self, goal=None):
        self.t += DT
        wanted = self.trajectory(goal).at(self.t)
        self.place, self.velocity = wanted.position_ned.copy(), wanted.velocity_ned
        turn = math.remainder(wanted.yaw - self.yaw, math.tau)
        self.yaw += max(-1.0 * DT, min(1.0 * DT, turn))
        return wanted

    def off(self):
        wanted = behind_target(self.target, self.standoff)(self.t)
        return math.dist(wanted.position_ned[:2], self.place[:2]), abs(math.remainder(wanted.yaw - self.yaw, math.tau))


@pytest.mark.parametrize("course", Course)
@pytest.mark.parametrize("target", [(1.5, 0.5, 0.0), (1.0, -1.2, 1.4)])
def test_it_comes_to_its_place_at_its_heading(course, target) -> None:
    flight = Flight(Moving(*target), course=course, standoff=0.7, boards=Boards(ahead=0.0, radius=0.22))
    for _ in range(1500):
        flight.tick()
    assert flight.off() == pytest.approx((0.0, 0.0), abs=0.01)


def test_a_target_that_crosses_is_met_on_its_way_in_sight_all_the_time() -> None:
    """As fast as the vehicle; the boards are 0.65 m ahead of the place, and the camera sees 0.6 rad to each side."""
    target = Moving(1.2, -1.2, 0.5 * math.pi, (0.0, FLYER.limits.speed_horizontal))
    flight = Flight(target)
    for k in range(700):
        flight.tick()
        north, east, _ = target.at(flight.t).position_ned - flight.place
        bearing = math.atan2(east + 0.65, north)
        if k > 100:
            assert abs(math.remainder(bearing - flight.yaw, math.tau)) < 0.5
    assert flight.off() == pytest.approx((0.0, 0.0), abs=0.02)
    assert flight.velocity[:2] == pytest.approx([0.0, FLYER.limits.speed_horizontal], abs=0.01)


def test_near_its_place_it_flies_the_place_itself() -> None:
    target = Moving(0.05, 0.0, 0.3, (0.01, 0.0))
    flight = Flight(target)
    flight.t = 1.0
    wanted, place = flight.trajectory().at(1.3), behind_target(target, 0.0)(1.3)
    assert wanted.position_ned == pytest.approx(place.position_ned)
    assert wanted.velocity_ned == pytest.approx(place.velocity_ned)


def test_a_goal_that_stands_is_stayed_at() -> None:
    flight = Flight(Moving(2.0, 0.0, 0.0))
    flight.tick()
    goal = Goal(at=stand_still(np.zeros(3), 0.3), t_reach=0.0, relative=False, direct=True)
    assert not flight.trajectory(goal).at(0.1).velocity_ned.any()
    assert flight.pilot.plan is None


@pytest.mark.parametrize("course", Course)
@pytest.mark.parametrize("seen", [True, False])
def test_a_place_that_stands_elsewhere_is_flown_to_within_the_limits(course, seen) -> None:
    """As where it goes back to look about: from rest to rest, also from its place behind the target."""
    flight = Flight(Moving(0.02, 0.0, 0.0), course=course)
    flight.tick()
    if not seen:
        flight.target = None
    goal = Goal(at=stand_still(np.array([-0.4, 0.2, 0.0]), 0.7), t_reach=0.0, relative=False, direct=False)
    before, speeds, steps = flight.place, [], []
    for _ in range(800):
        wanted = flight.tick(goal)
        assert wanted.yaw == pytest.approx(0.7)
        speeds.append(math.hypot(*wanted.velocity_ned[:2]))
        steps.append(math.dist(before[:2], flight.place[:2]))
        before = flight.place
    assert before[:2] == pytest.approx([-0.4, 0.2], abs=0.01)
    assert speeds[0] < 0.02
    assert 0.03 < max(speeds) < FLYER.limits.speed_horizontal + 1e-6
    assert max(steps) < 0.09  # up to `station_m` from it, the place itself is followed


@pytest.mark.parametrize("course", Course)
def test_its_trajectory_is_the_same_behind_the_channel_to_the_guardian(course) -> None:
    flight = Flight(Moving(1.5, 0.4, 0.2, (0.0, 0.05)), course=course)
    for _ in range(60):
        flight.tick()
    trajectory = flight.trajectory()
    handover = Handover(t=flight.t, stage=Stage.RUNNING, reason="", trajectory=trajectory)
    there = decode(encode(handover, 1)).trajectory
    for later in np.arange(flight.t, flight.t + 0.4, 0.02):
        sent, read = trajectory.at(later), there.at(later)
        assert read.position_ned == pytest.approx(sent.position_ned, abs=0.002)
        assert read.velocity_ned == pytest.approx(sent.velocity_ned, abs=0.002)
        assert read.yaw == pytest.approx(sent.yaw, abs=0.005)


def test_the_same_inputs_give_the_same_bits() -> None:
    answers = []
    for _ in range(2):
        flight = Flight(Moving(1.0, 0.7, -0.4, (0.02, 0.03)))
        answers.append([flight.tick() for _ in range(50)][-1].position_ned.tobytes())
    assert answers[0] == answers[1]
