"""From a goal to a rover's trajectory: it leads to the place, and it survives the way to the guardian."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from companion.config.driving import DrivingSection
from companion.estimation.ground_odometry import AutopilotOdometry
from companion.geometry.rotations import rotation_about_z
from companion.guardian.handover import Handover, Stage
from companion.guardian.handover_frame import decode, encode
from companion.guidance.goals import Goal, behind_target, stand_still
from companion.messages.ownship import OwnshipState
from companion.messages.target import TargetPose
from companion.planning.coupled.plan import PlanEnd
from companion.planning.shortest.meeting import make_reach
from companion.planning.stopping import fastest
from companion.runtime.driving.pilot import Driving
from companion.runtime.tracking import NOTHING_SEEN
from companion.vehicles.rover import Rover, RoverParameters

SECTION, PARAMETERS = DrivingSection(), RoverParameters()
STANDOFF = 1.25


class Standing:
    """A forecast of a target that stands."""

    t, horizon, reset_counter = 0.0, 10.0, 0

    def __init__(self, north, east, yaw):
        self._pose = (np.array([north, east, 0.0]), yaw)

    def at(self, t):
        return TargetPose(
            t=t,
            position_ned=self._pose[0],
            velocity_ned=np.zeros(3),
            acceleration_ned=np.zeros(3),
            yaw=self._pose[1],
            yaw_rate=0.0,
            covariance=np.zeros((4, 4)),
        )


def ownship(t, north=0.0, east=0.0, yaw=0.0, speed=0.0):
    return OwnshipState(
        t=t,
        position_ned=np.array([north, east, 0.0]),
        velocity_ned=speed * np.array([math.cos(yaw), math.sin(yaw), 0.0]),
        acceleration_ned=np.zeros(3),
        ned_from_frd=rotation_about_z(yaw),
        angular_velocity_frd=np.zeros(3),
        reset_counter=0,
    )


def driving(**more):
    motion = Rover(parameters=PARAMETERS).motion
    return Driving(SECTION, motion, rear_axle=PARAMETERS.rear_axle, odometry=AutopilotOdometry(), **more)


def updated(driver, state, target, goal=None):
    driver.landmark(state)
    chosen = goal or Goal(at=behind_target(target, STANDOFF), t_reach=state.t, relative=True, direct=False)
    return driver.update(
        t=state.t,
        dt=0.02,
        goal=chosen,
        switched=False,
        ownship=state,
        picture=replace(
            NOTHING_SEEN, prediction=target, sighted_ned=target.at(state.t).position_ned, t_sighted=state.t
        ),
    )


@pytest.mark.parametrize(
    ("target", "start"), [((4.0, 0.5, 0.0), (0, 0, 0)), ((3.0, 4.0, 1.5), (1.0, 0.0, 0.3)), ((1.6, 0, 0), (0.5, 0, 0))]
)
def test_driven_as_planned_it_comes_to_its_place_behind_the_target(target, start) -> None:
    """A rover that does at once what it is told, planned anew ten times a second, the body's origin at the place."""
    driver, place = driving(), Standing(*target)
    (north, east, yaw), speed, rear = start, 0.0, PARAMETERS.rear_axle
    for k in range(2500):
        t = 0.02 * k
        trajectory = updated(driver, ownship(t, north, east, yaw, speed), place)
        wanted = trajectory.at(t)
        speed = float(wanted.velocity_ned[:2] @ (math.cos(wanted.yaw), math.sin(wanted.yaw)))
        axle = (north - rear * math.cos(yaw), east - rear * math.sin(yaw))
        yaw += 0.02 * wanted.yaw_rate
        axle = (axle[0] + 0.02 * speed * math.cos(yaw), axle[1] + 0.02 * speed * math.sin(yaw))
        north, east = axle[0] + rear * math.cos(yaw), axle[1] + rear * math.sin(yaw)
    wanted = behind_target(place, STANDOFF)(0.0)
    assert math.hypot(north - wanted.position_ned[0], east - wanted.position_ned[1]) < 0.015
    assert abs(math.remainder(yaw - wanted.yaw, math.tau)) < 0.01


class Hurried:
    """A clock by which each program takes 0.4 of what a plan may."""

    def __init__(self):
        self._t = 0.0

    def now(self):
        self._t += 0.4 * SECTION.deadline_s
        return self._t


def test_in_flight_a_plan_keeps_its_deadline_with_the_best_so_far() -> None:
    state, target = ownship(0.0), Standing(4.0, 1.5, 0.5)
    hurried, patient = driving(clock=Hurried()), driving()
    for driver in (hurried, patient):
        updated(driver, state, target)
    assert hurried.solution.end is PlanEnd.DEADLINE
    assert hurried.solution.iterations == 1
    assert hurried.solution.violation.worst < 1e-9
    assert patient.solution.end is PlanEnd.CONVERGED


def test_a_rover_that_friction_holds_is_pushed_on_without_a_pause() -> None:
    driver, place, told = driving(), Moving(0.5), []
    for k in range(200):
        told.append(float(updated(driver, ownship(0.02 * k), place).at(0.02 * k).velocity_ned[0]))
    begin = next(k for k, speed in enumerate(told) if speed > 0.3)
    pushing = told[begin : begin + round((SECTION.start_s - 0.4) / 0.02)]
    assert min(pushing) > 0.3
    assert np.diff(pushing).min() > -0.2  # one that begins each plan with the standstill falls back by 0.4 each time
    assert min(told[begin + round(SECTION.start_s / 0.02) :]) < 0.3  # not for ever: something else holds it


def test_its_trajectory_is_the_same_behind_the_channel_to_the_guardian() -> None:
    driver, place = driving(), Standing(4.0, 1.0, 0.2)
    for k in range(60):
        trajectory = updated(driver, ownship(0.02 * k, north=0.004 * k, speed=0.2), place)
    t = 0.02 * 59
    there = decode(encode(Handover(t=t, stage=Stage.RUNNING, reason="", trajectory=trajectory), 1)).trajectory
    for later in np.arange(t, t + 0.4, 0.02):
        sent, read = trajectory.at(later), there.at(later)
        assert read.position_ned == pytest.approx(sent.position_ned, abs=0.005)
        assert read.yaw == pytest.approx(sent.yaw, abs=0.005)
        step = (later - driver.solution.t_start) / SECTION.step_s % 1.0
        if 0.15 < step < 0.85:  # from step to step the speed jumps, between two samples it does not
            assert read.velocity_ned == pytest.approx(sent.velocity_ned, abs=1e-6)
            assert read.yaw_rate == pytest.approx(sent.yaw_rate, abs=1e-6)
        assert read.feedback_velocity_ned == pytest.approx(sent.feedback_velocity_ned)


def test_a_goal_that_stands_is_stood_at() -> None:
    driver, place = driving(), Standing(4.0, 0.0, 0.0)
    updated(driver, ownship(0.0), place)
    goal = Goal(at=stand_still(np.zeros(3), 0.3), t_reach=0.0, relative=False, direct=True)
    trajectory = updated(driver, ownship(0.02, speed=0.5), place, goal)
    assert not trajectory.at(0.02).velocity_ned.any()
    assert driver.solution is None


def test_a_target_that_stands_is_a_landmark_only_while_it_is_seen() -> None:
    driver, place = driving(), Standing(3.0, 0.0, 0.0)
    for k in range(400):
        updated(driver, ownship(0.02 * k), place)
    t = 0.02 * 399
    assert driver.landmark(ownship(t)) == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert driver.landmark(ownship(t, speed=0.3))[0] == pytest.approx(0.3, abs=1e-6)
    assert driver.landmark(ownship(t + 1.0)) is None


class Moving(Standing):
    """One that drives north."""

    def __init__(self, speed):
        super().__init__(0.0, 0.0, 0.0)
        self._speed = speed

    def at(self, t):
        pose = super().at(t)
        velocity = np.array([self._speed, 0.0, 0.0])
        return replace(pose, position_ned=np.array([3.0, 0.0, 0.0]) + t * velocity, velocity_ned=velocity)


@pytest.mark.parametrize(("speed", "known"), [(0.25, True), (1.0, False)])
def test_a_slow_target_that_keeps_its_speed_is_a_landmark(speed, known) -> None:
    """The rover drives as fast; its own speed is told wrong by 0.2 m/s meanwhile, its place is not."""
    driver, target = driving(), Moving(speed)
    for k in range(500):
        t = 0.02 * k
        updated(driver, ownship(t, north=speed * t, speed=speed + (0.2 if t > 8.0 else 0.0)), target)
    landmark = driver.landmark(ownship(t, north=speed * t, speed=speed + 0.2))
    if known:
        assert landmark == pytest.approx([speed, 0.0, 0.0], abs=0.02)
    else:
        assert landmark is None


def test_the_speed_across_a_leaders_heading_counts() -> None:
    """Half a metre aside of the place, headings equal, at 1 m/s: the dearer that is, the less it turns to the place."""
    turns = []
    for drift in (0.0, 5.0, 50.0):
        driver, target = (
            Driving(
                replace(SECTION, station_drift=drift),
                Rover(parameters=PARAMETERS).motion,
                rear_axle=PARAMETERS.rear_axle,
                odometry=AutopilotOdometry(),
            ),
            Moving(1.0),
        )
        for k in range(30):
            t = 0.02 * k
            updated(driver, ownship(t, north=3.0 - STANDOFF + t, east=0.5, speed=1.0), target)
        turns.append(float(np.abs(driver.solution.poses[:, 2]).max()))
    assert turns[0] > 1.2 * turns[1] > 1.44 * turns[2]


def test_the_same_inputs_give_the_same_bits() -> None:
    answers = []
    for _ in range(2):
        driver, place = driving(), Standing(4.0, 0.7, -0.4)
        last = [updated(driver, ownship(0.02 * k), place) for k in range(30)][-1]
        answers.append(last.at(0.9).position_ned.tobytes())
    assert answers[0] == answers[1]


class Crossing(Standing):
    """A forecast of a target that crosses from right to left, 5 m ahead."""

    def at(self, t):
        speed = 0.25
        return replace(
            super().at(t),
            position_ned=np.array([5.0, 2.0 - speed * t, 0.0]),
            velocity_ned=np.array([0.0, -speed, 0.0]),
            yaw=-math.pi / 2.0,
        )


def test_a_target_that_crosses_is_a_landmark_at_once_and_is_not_taken_to_stand() -> None:
    """The rover goes 0.5 m/s, its own speed is told wrong by 0.3 m/s from the beginning."""
    driver, target = driving(), Crossing(0.0, 0.0, 0.0)
    for k in range(100):
        t = 0.02 * k
        driver.landmark(ownship(t, north=0.5 * t, speed=0.8))
        updated(driver, ownship(t, north=0.5 * t, speed=0.8), target)
    assert driver.landmark(ownship(2.0, north=1.0, speed=0.8)) == pytest.approx([0.5, 0.0, 0.0], abs=0.02)


@pytest.mark.parametrize("name", ["paper", "dubins", "reeds_shepp"])
def test_it_drives_to_where_its_place_will_be_met_and_says_when(name):
    rover, target = Rover(parameters=replace(PARAMETERS, speed_forward=0.6)), Crossing(0.0, 0.0, 0.0)
    ends = []
    for reach in (None, make_reach(name, rover.car(gear_time=0.5))):
        driver = Driving(
            SECTION, rover.motion, rear_axle=PARAMETERS.rear_axle, odometry=AutopilotOdometry(), reach=reach
        )
        updated(driver, ownship(0.0), target)
        ends.append(driver.solution.poses[-1])
    meeting = driver.meeting
    assert meeting is not None
    assert meeting.feasible
    assert meeting.elapsed > SECTION.planner.horizon * SECTION.step_s  # it cannot be there within a plan,
    assert ends[1][1] < ends[0][1] - 0.05  # and heads further left: the place goes there meanwhile
    updated(driver, ownship(0.1, north=5.0, east=2.0 + STANDOFF, yaw=-math.pi / 2.0), target)
    assert driver.meeting is None  # beside its place nothing is foreseen


def told_behind(range_m, target_speed, track_speed, *, planned=3, age=0.0):
    """Give the speed [m/s] asked for in the end by a rover at 0.5 m/s, so far behind a target that drives north.

    `age` [s]: how long ago it was seen.
    """
    driver, target = driving(), Moving(target_speed)
    for k in range(5 * planned + 1):
        t = 0.02 * k
        state = ownship(t, north=float(target.at(t).position_ned[0]) - range_m, speed=0.5)
        velocity = np.array([track_speed, 0.0, 0.0])
        track = SimpleNamespace(velocity_ned=velocity, age=age)
        seen = replace(target.at(-age), velocity_ned=velocity) if age else None
        driver.landmark(state)
        trajectory = driver.update(
            t=t,
            dt=0.02,
            goal=Goal(at=behind_target(target, STANDOFF), t_reach=t, relative=True, direct=False, may_stand_at=seen),
            switched=False,
            ownship=state,
            picture=replace(
                NOTHING_SEEN, track=track, prediction=target, sighted_ned=target.at(t).position_ned, t_sighted=t
            ),
        )
    return float(trajectory.at(t).velocity_ned[0])


def test_behind_a_target_that_may_brake_it_keeps_a_speed_that_it_can_stop_from() -> None:
    """So near that it could not: it gives way, by what the track knows and the forecast does not yet."""
    near, usual = SECTION.stopping.nearest_m + 0.02, STANDOFF
    stoppable = fastest(
        gap=near,
        standoff=STANDOFF,
        ahead=1.0,
        away=0.1,
        braking=PARAMETERS.acceleration,
        parameters=SECTION.stopping,
    )
    assert stoppable < 0.2
    assert told_behind(near, 0.5, 0.1, planned=6) <= stoppable + 1e-3
    assert told_behind(usual, 0.5, 0.5) > 0.4


def test_a_leader_out_of_sight_may_have_braked_and_is_not_driven_up_to() -> None:
    """Seen last so long ago that it would stand 0.7 m ahead by now, though the forecast has it drive on."""
    assert told_behind(STANDOFF, 0.3, 0.3) > 0.2
    assert told_behind(STANDOFF, 0.3, 0.3, age=2.0, planned=6) < 0.05
    assert told_behind(STANDOFF, 1.0, 1.0, age=0.9, planned=6) < 0.05


@pytest.mark.parametrize("backs_out", [False, True])
def test_it_backs_out_though_the_target_is_in_sight_again(backs_out) -> None:
    """Beside a target that drives it only drives forward else."""
    driver, target, told = driving(), Moving(0.1), []
    place = stand_still(target.at(0.0).position_ned - np.array([STANDOFF + 1.0, 0.0, 0.0]), 0.0)
    for k in range(60):
        t = 0.02 * k
        state = ownship(t, north=float(target.at(0.0).position_ned[0]) - STANDOFF)
        goal = Goal(at=place, t_reach=t, relative=True, direct=False, backs_out=backs_out)
        told.append(float(updated(driver, state, target, goal).at(t).velocity_ned[0]))
    assert (min(told) < -0.2) == backs_out


def beyond_the_picture(age):
    """Give how far [rad] beyond the picture's edge a plan lets a target get that crosses and was seen so long ago."""
    driver, target, state = driving(), Crossing(0.0, 0.0, 0.0), ownship(0.0, yaw=0.6)
    pose = target.at(0.0)
    driver.landmark(state)
    driver.update(
        t=0.0,
        dt=0.02,
        goal=Goal(at=behind_target(target, STANDOFF), t_reach=0.0, relative=True, direct=False),
        switched=False,
        ownship=state,
        picture=replace(
            NOTHING_SEEN,
            track=SimpleNamespace(velocity_ned=pose.velocity_ned, age=age),
            prediction=target,
            sighted_ned=pose.position_ned,
        ),
    )
    return driver.solution.view_excess


def test_to_see_a_target_again_is_worth_a_detour() -> None:
    """On the way round to its place behind a target that crosses a rover turns away from it: not when it is lost."""
    assert beyond_the_picture(age=0.0) > 0.2
    assert beyond_the_picture(age=1.0) < 0.1
