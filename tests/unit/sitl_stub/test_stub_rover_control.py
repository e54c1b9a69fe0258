"""The rover's controllers against what PX4's source and recordings say."""

import json
import math
from pathlib import Path

import pytest

import sitl_stub.vehicle.rover as rover_package
from sitl_stub.vehicle.modes import AUTO, Mode
from sitl_stub.vehicle.position_control import NOTHING, TrajectorySetpoint
from sitl_stub.vehicle.rover.controllers import (
    ActuatorControl,
    Geometry,
    HeadingControl,
    Motion,
    PositionControl,
    SpeedControl,
    YawRateControl,
    stopping_speed,
)
from sitl_stub.vehicle.rover.drive_control import ALL, LOOPS, TURN, Loops, offboard_loops
from sitl_stub.vehicle.rover.loops import SlewRate, dead_zone, super_exponential, wrap
from sitl_stub.vehicle.rover.pursuit import target_bearing

DT = 0.01
NAN = math.nan
PARAMETERS: dict[str, float] = json.loads(
    (Path(rover_package.__file__).parent / "px4_parameters.json").read_text(encoding="utf-8")
)["values"]


def motion(north: float = 0.0, east: float = 0.0, yaw: float = 0.0, speed: float = 0.0) -> Motion:
    return Motion(place=(north, east), yaw=yaw, yaw_rate=0.0, speed=speed)


# building blocks


def test_slew_rate_never_steps_farther_than_allowed_and_arrives():
    ramp = SlewRate()
    values = [ramp.update(1.0, 2.0, DT) for _ in range(100)]
    assert max(b - a for a, b in zip([0.0, *values], values, strict=False)) <= 2.0 * DT + 1e-12
    assert values[-1] == 1.0


def test_ramp_is_never_farther_from_the_measured_than_the_goal_is():
    ramp = SlewRate()
    ramp.value = 3.0
    assert ramp.approach(1.0, 0.5, 1.0, DT) == 1.0


@pytest.mark.parametrize("stick", [-1.0, -0.5, -0.1, 0.0, 0.1, 0.3, 1.0])
def test_dead_zone_is_odd_monotone_and_reaches_the_ends(stick: float):
    assert dead_zone(-stick, 0.1) == -dead_zone(stick, 0.1)
    assert dead_zone(stick, 0.0) == stick
    assert dead_zone(math.copysign(1.0, stick), 0.1) == math.copysign(1.0, stick)
    assert dead_zone(0.3, 0.1) == pytest.approx(0.2 / 0.9)


def test_super_exponential_keeps_the_ends_and_flattens_the_middle():
    for cubic, steep in ((0.0, 0.0), (0.5, 0.0), (0.5, 0.6)):
        assert super_exponential(1.0, cubic, steep) == pytest.approx(1.0)
        assert super_exponential(-1.0, cubic, steep) == pytest.approx(-1.0)
        assert super_exponential(0.0, cubic, steep) == 0.0
    assert super_exponential(0.5, 0.5, 0.5) < 0.5


# pure pursuit


def test_pursuit_on_the_line_follows_it():
    assert target_bearing((10.0, 10.0), (0.0, 0.0), (3.0, 3.0), 2.0) == pytest.approx(math.pi / 4.0)


@pytest.mark.parametrize("offset", [-1.5, -0.5, 0.5, 1.5])
def test_pursuit_beside_the_line_aims_at_the_point_one_lookahead_away(offset: float):
    place, lookahead = (2.0, offset), 2.0
    bearing = target_bearing((20.0, 0.0), (0.0, 0.0), place, lookahead)
    aimed = (place[0] + lookahead * math.cos(bearing), place[1] + lookahead * math.sin(bearing))
    assert aimed[1] == pytest.approx(0.0, abs=1e-9)
    assert aimed[0] > place[0]


def test_pursuit_far_from_the_line():
    line = ((10.0, 0.0), (0.0, 0.0))
    assert target_bearing(*line, (5.0, 4.0), 2.0) == pytest.approx(-math.pi / 2.0)  # the nearest point
    assert target_bearing(*line, (-5.0, 4.0), 2.0) == pytest.approx(math.atan2(-4.0, 5.0))  # the start
    assert target_bearing(*line, (15.0, 4.0), 2.0) == pytest.approx(math.atan2(-4.0, -5.0))  # the goal


def test_pursuit_near_the_goal_and_without_a_line_aims_at_the_goal():
    assert target_bearing((1.0, 1.0), (0.0, 0.0), (1.0, 0.0), 2.0) == pytest.approx(math.pi / 2.0)
    assert target_bearing((9.0, 9.0), (9.0, 9.0), (0.0, 9.0), 2.0) == pytest.approx(0.0)
    assert math.isnan(target_bearing((NAN, 0.0), (0.0, 0.0), (0.0, 0.0), 2.0))


# controllers


def test_stopping_speed_grows_with_the_distance_and_allows_the_stop():
    speeds = [stopping_speed(0.1 * i, 3.0, 10.0) for i in range(100)]
    assert speeds[0] == 0.0
    assert speeds == sorted(speeds)
    for i, speed in enumerate(speeds):
        assert speed * speed / (2.0 * 3.0) <= 0.1 * i + 1e-9


def test_slowest_turning_speed_is_px4s():
    """Recorded in r02 and r04: 1.7467 m/s while it turns round."""
    assert Geometry.of(PARAMETERS).slowest_turn == pytest.approx(1.7467, abs=2e-4)


def test_position_goal_behind_is_driven_to_forwards_and_slowly():
    control = PositionControl(PARAMETERS)
    control.drive_to((-10.0, 0.0), (0.0, 0.0))
    speed, yaw = control.update(motion()) or (NAN, NAN)
    assert speed == pytest.approx(1.7467, abs=2e-4)
    assert abs(wrap(yaw - math.pi)) < 1e-9
    speed, _ = control.update(motion(yaw=math.pi)) or (NAN, NAN)
    assert speed == PARAMETERS["RO_SPEED_LIM"]


def test_negative_cruise_backs_up_with_the_tail_towards_the_goal():
    control = PositionControl(PARAMETERS)
    control.drive_to((-20.0, 0.0), (0.0, 0.0), start=(0.0, 0.0), cruise=-1.5)
    assert control.update(motion()) == pytest.approx((-1.5, 0.0))


def test_inside_the_acceptance_radius_the_rover_stops_as_it_stands():
    control = PositionControl(PARAMETERS)
    control.acceptance_radius = 0.5
    control.drive_to((0.3, 0.0), (0.0, 0.0))
    assert control.update(motion(yaw=1.0, speed=1.0)) == (0.0, 1.0)
    assert control.goal == (0.3, 0.0)
    control.update(motion(yaw=1.0))
    assert control.goal == (0.0, 0.0)  # stopped: here is good enough, also when the estimate moves on


def test_without_a_goal_nothing_is_wanted():
    control = PositionControl(PARAMETERS)
    assert control.update(motion()) is None
    control.drive_to((NAN, 1.0), (0.0, 0.0))
    assert control.update(motion()) is None


def test_speed_is_feed_forward_of_the_speed_at_full_throttle():
    control = SpeedControl(PARAMETERS)
    throttle = [control.update(1.6, 1.6, DT) for _ in range(200)]
    assert throttle[-1] == pytest.approx(0.5, abs=0.01)
    assert control.update(99.0, 3.0, DT) <= PARAMETERS["RO_SPEED_LIM"] / PARAMETERS["RO_MAX_THR_SPEED"] + 0.01


def test_heading_is_turned_to_the_short_way():
    control = HeadingControl(PARAMETERS)
    assert all(control.update(-3.0, 3.0, 1.0, DT) > 0.0 for _ in range(50))
    control = HeadingControl(PARAMETERS)
    assert all(control.update(3.0, -3.0, 1.0, DT) < 0.0 for _ in range(50))


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.5, -1.0])
def test_steering_follows_the_bicycle_and_never_asks_for_more_than_it_can(speed: float):
    control, geometry = YawRateControl(PARAMETERS), Geometry.of(PARAMETERS)
    steering = 0.0
    for _ in range(200):
        steering = control.update(0.4, 0.4, speed, DT)
    assert steering == pytest.approx(math.atan(0.4 * 0.321 / speed) / geometry.steering_max, abs=1e-6)
    for _ in range(300):
        steering = control.update(50.0, geometry.yaw_rate_at(speed), speed, DT)
    assert abs(steering) <= 1.0


def test_reverse_has_no_yaw_rate_feedback():
    """PX4 leaves it out: backwards the loop would be unstable."""
    control = YawRateControl({**PARAMETERS, "RO_YAW_ACCEL_LIM": 0.0})
    assert control.update(0.5, 0.5, -1.0, DT) == control.update(0.5, -0.5, -1.0, DT)
    assert control.update(0.5, 0.5, 1.0, DT) != control.update(0.5, -0.5, 1.0, DT)


def test_standing_still_the_wheels_are_straight():
    assert YawRateControl(PARAMETERS).update(1.0, 0.0, 0.0, DT) == 0.0


def test_throttle_ramps_and_stops_at_once_when_told():
    control = ActuatorControl(PARAMETERS)
    before = 0.0
    for _ in range(150):
        control.update(1.0, 0.0, DT)
        assert control.throttle - before <= 3.0 / 3.2 * DT + 1e-12
        before = control.throttle
    assert before == 1.0
    control.update(NAN, NAN, DT)
    assert control.throttle == 1.0
    control.stop()
    assert (control.throttle, control.steering) == (0.0, 0.0)


# modes


def test_every_mode_says_which_loops_run():
    assert set(LOOPS) == set(Mode) - {Mode.OFFBOARD}
    assert all(LOOPS[mode] == ALL for mode in AUTO - {Mode.DESCEND})


def test_loops_of_offboard_setpoints():
    one = (1.0, NAN, NAN)
    assert offboard_loops(TrajectorySetpoint(position=one, velocity=one)) == ALL
    assert offboard_loops(TrajectorySetpoint(velocity=one, acceleration=one)) == TURN | Loops.SPEED
    assert offboard_loops(TrajectorySetpoint(acceleration=one)) == TURN
    assert offboard_loops(TrajectorySetpoint(position=NOTHING, velocity=(0.0, 0.0, 0.0))) == TURN | Loops.SPEED
