"""The multicopter's limits and reach."""

from itertools import pairwise

import numpy as np
import pytest
from pymavlink.dialects.v20 import common

from companion.messages.motion import MotionState
from companion.planning.minimum_snap import PlanParameters, plan_to_moving_goal
from companion.vehicles.multicopter import Multicopter, MulticopterParameters, Reachability


def test_it_accepts_multirotors_only():
    vehicle = Multicopter()
    for name in ("QUADROTOR", "HEXAROTOR", "OCTOROTOR", "TRICOPTER", "COAXIAL", "DODECAROTOR", "DECAROTOR"):
        assert vehicle.accepts(getattr(common, f"MAV_TYPE_{name}")), name
    for name in ("FIXED_WING", "GROUND_ROVER", "VTOL_TILTROTOR", "GCS", "SUBMARINE", "HELICOPTER", "GENERIC"):
        assert not vehicle.accepts(getattr(common, f"MAV_TYPE_{name}")), name


@pytest.mark.parametrize("kind", list(Reachability))
def test_reach_grows_with_time_from_nothing(kind):
    reach = [Multicopter().effective_radius(t, kind) for t in np.linspace(-1, 20, 100)]
    assert reach[0] == 0.0
    assert all(b >= a for a, b in pairwise(reach))
    assert reach[-1] > 15.0


def test_a_more_careful_reach_is_a_smaller_one():
    vehicle = Multicopter()
    for t in (0.3, 1.0, 3.0, 10.0):
        fast, accelerated, planned = (vehicle.effective_radius(t, kind) for kind in Reachability)
        assert planned < accelerated < fast


def test_accelerated_reach_is_continuous_where_the_speed_is_reached():
    vehicle = Multicopter()
    ramp = 3.0 / 2.5
    below, above = (vehicle.effective_radius(ramp + d, Reachability.ACCELERATION_LIMITED) for d in (-1e-9, 1e-9))
    assert below == pytest.approx(above, abs=1e-7)
    assert below == pytest.approx(0.5 * 2.5 * ramp**2)


@pytest.mark.parametrize("duration", [0.6, 2.0, 6.0])
def test_the_planned_reach_is_what_the_planner_flies(duration):
    vehicle = Multicopter()
    distance = vehicle.effective_radius(duration, Reachability.MINIMUM_SNAP)
    rest = {"velocity_ned": np.zeros(3), "acceleration_ned": np.zeros(3), "yaw": 0.0, "yaw_rate": 0.0}
    worst = [
        plan_to_moving_goal(
            MotionState(position_ned=np.zeros(3), **rest),
            t_start=0.0,
            goal=lambda _, d=d: MotionState(position_ned=np.array([d, 0, 0]), **rest),
            t_goal_hint=duration,
            limits=vehicle.limits,
            t_expiry=9.0,
            reset_counter=0,
            parameters=PlanParameters(accept=1.0),
            start_jerk_ned=np.zeros(3),
        ).scale_steps
        for d in (0.999 * distance, 1.01 * distance)
    ]
    assert worst[0] == 0
    assert worst[1] > 0


def test_parameters_reach_the_limits():
    vehicle = Multicopter(parameters=MulticopterParameters(speed_up=0.7, jerk=5.0, closing_speed=1.1, gear_height=0.3))
    assert vehicle.limits.speed_up == 0.7
    assert vehicle.limits.jerk == 5.0
    assert vehicle.closing_speed == 1.1
    assert vehicle.gear_height == 0.3
