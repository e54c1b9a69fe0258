"""The trajectory of the automatic modes: limits, arrival, slowing down for a vehicle that is behind."""

import math

import numpy as np
import pytest

from sitl_stub.vehicle.auto_motion import AutoMotion, AxisTrajectory, stopping_point, stopping_speed
from sitl_stub.vehicle.estimator import Estimate

PARAMETERS = {
    "MPC_JERK_AUTO": 4.0,
    "MPC_ACC_HOR": 3.0,
    "MPC_ACC_UP_MAX": 4.0,
    "MPC_ACC_DOWN_MAX": 3.0,
    "MPC_XY_CRUISE": 5.0,
    "MPC_XY_VEL_MAX": 12.0,
    "MPC_Z_V_AUTO_UP": 3.0,
    "MPC_Z_V_AUTO_DN": 1.5,
    "MPC_XY_ERR_MAX": 2.0,
}
DT = 0.01


def fly(goal: tuple[float, float, float], seconds: float, *, down_rate: float = math.nan) -> np.ndarray:
    """Position, velocity and acceleration over time, shape (n, 9), of a vehicle that follows at once."""
    motion, estimate = AutoMotion(PARAMETERS), Estimate()
    motion.start(estimate)
    rows = []
    for _ in range(round(seconds / DT)):
        motion.step(goal, estimate, DT, down_rate=down_rate)
        estimate.north, estimate.east, estimate.down = motion.position
        rows.append((*motion.position, *motion.velocity, *motion.acceleration))
    return np.array(rows)


@pytest.mark.parametrize(
    ("north", "east", "down"), [(20.0, 0.0, 0.0), (-15.0, 12.0, -10.0), (0.0, 0.0, 6.0), (0.5, -0.2, 0.1)]
)
def test_it_arrives_within_the_limits_and_stands(north: float, east: float, down: float) -> None:
    path = fly((north, east, down), 60.0)
    assert path[-1, :3] == pytest.approx((north, east, down), abs=0.02)
    assert np.abs(path[-1, 3:]).max() < 0.05
    assert np.hypot(path[:, 3], path[:, 4]).max() <= 5.0 + 0.3
    assert path[:, 5].min() >= -3.0 - 1e-6
    assert path[:, 5].max() <= 1.5 + 1e-6
    assert np.abs(path[:, 6:8]).max() <= 3.0 + 1e-6
    assert np.abs(np.diff(path[:, 6:], axis=0)).max() <= 4.0 * DT + 1e-6


def test_a_change_of_speed_takes_the_shortest_time() -> None:
    axis = AxisTrajectory()
    axis.jerk_max, axis.acceleration_max, axis.velocity_max = 4.0, 3.0, 12.0
    axis.aim(1.0)
    assert axis.total_time == pytest.approx(2.0 * math.sqrt(1.0 / 4.0))
    axis.aim(10.0)
    assert axis.total_time == pytest.approx(10.0 / 3.0 + 3.0 / 4.0)
    axis.stretch(6.0)
    axis.advance(6.0)
    assert axis.velocity == pytest.approx(10.0, abs=1e-6)
    assert axis.acceleration == pytest.approx(0.0, abs=1e-6)


def test_a_landing_goes_on_below_the_ground() -> None:
    path = fly((0.0, 0.0, math.nan), 10.0, down_rate=0.7)
    assert path[-1, 2] > 6.0
    assert path[-1, 5] == pytest.approx(0.7)


def test_it_waits_for_a_vehicle_that_is_behind() -> None:
    motion, still = AutoMotion(PARAMETERS), Estimate()
    motion.start(still)
    for _ in range(2000):
        motion.step((30.0, 0.0, 0.0), still, DT)
    assert 1.0 < motion.position[0] < 2.0


def test_stopping_distance_of_a_fast_vehicle() -> None:
    estimate = Estimate()
    estimate.v_east = 6.0
    assert stopping_point(estimate, acceleration=3.0) == pytest.approx((0.0, 6.0 * (6.0 / 6.0 + 0.6)))
    assert stopping_speed(0.0, jerk=4.0, acceleration=3.0) == 0.0
    assert stopping_speed(9.0, jerk=4.0, acceleration=3.0) < stopping_speed(10.0, jerk=4.0, acceleration=3.0)
