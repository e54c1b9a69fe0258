"""The stop: at rest at the end, inside the limits, as short as they allow."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.messages.motion import MotionState
from companion.planning.brake import brake, stop_phases
from companion.vehicles.multicopter import Multicopter

LIMITS = Multicopter().limits


def integrate(velocity, acceleration, phases):
    peak = abs(acceleration)
    for duration, jerk in phases:
        assert duration >= 0.0
        velocity += acceleration * duration + jerk * duration**2 / 2
        acceleration += jerk * duration
        peak = max(peak, abs(acceleration))
    return velocity, acceleration, peak


@given(v=st.floats(-4, 4), a=st.floats(-4, 4))
@settings(max_examples=200, deadline=None)
def test_one_axis_comes_to_rest_within_its_limits(v, a):
    phases = stop_phases(v, a, 2.5, 8.0)
    velocity, acceleration, peak = integrate(v, a, phases)
    assert velocity == pytest.approx(0.0, abs=1e-9)
    assert acceleration == pytest.approx(0.0, abs=1e-9)
    assert peak <= max(2.5, abs(a)) + 1e-9
    assert all(abs(jerk) <= 8.0 for _, jerk in phases)


@given(v=st.floats(-4, 4), a=st.floats(-2.5, 2.5), split=st.floats(0.05, 0.95))
@settings(max_examples=100, deadline=None)
def test_a_stop_replanned_on_the_way_is_the_same_stop(v, a, split):
    """Only a shortest-time law has this property: what remains of it is the shortest from there."""
    phases = stop_phases(v, a, 2.5, 8.0)
    total = sum(d for d, _ in phases)
    elapsed, left = 0.0, split * total
    for duration, jerk in phases:
        h = max(min(duration, left - elapsed), 0.0)
        v, a, elapsed = v + a * h + jerk * h * h / 2, a + jerk * h, elapsed + h
    again = sum(d for d, _ in stop_phases(v, a, 2.5, 8.0))
    assert again == pytest.approx((1 - split) * total, abs=2e-5)


@given(
    v=st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-1, 1)),
    a=st.tuples(st.floats(-1.2, 1.2), st.floats(-0.7, 0.7), st.floats(-1, 1)),
    rate=st.floats(-1, 1),
)
@settings(max_examples=60, deadline=None)
def test_the_vehicle_stops_inside_the_limits(v, a, rate):
    start = MotionState(
        position_ned=np.array([1.0, 2, -3]),
        velocity_ned=np.array(v),
        acceleration_ned=np.array(a),
        yaw=0.5,
        yaw_rate=rate,
    )
    trajectory = brake(start, t_start=5.0, limits=LIMITS, t_expiry=9.0, reset_counter=3)
    first, end, later = (trajectory.at(t) for t in (5.0, trajectory.t_end, trajectory.t_end + 3.0))
    assert first.position_ned == pytest.approx(start.position_ned)
    assert first.velocity_ned == pytest.approx(start.velocity_ned)
    assert first.acceleration_ned == pytest.approx(start.acceleration_ned, abs=1e-9)
    assert end.velocity_ned == pytest.approx(np.zeros(3), abs=1e-8)
    assert end.yaw_rate == pytest.approx(0.0, abs=1e-9)
    assert later.position_ned == pytest.approx(end.position_ned, abs=1e-7)
    assert later.yaw == pytest.approx(0.5 + rate * abs(rate) / (2 * LIMITS.yaw_acceleration), abs=1e-6)
    for t in np.linspace(5.0, trajectory.t_end, 300):
        s = trajectory.at(t)
        assert math.hypot(*s.acceleration_ned[:2]) <= LIMITS.acceleration_horizontal * 1.0001
        assert abs(s.acceleration_ned[2]) <= LIMITS.acceleration_vertical + 1e-9
        assert np.abs(trajectory.jerk_at(t)).max() <= LIMITS.jerk * 1.0001
        assert abs(s.yaw_rate) <= abs(rate) + 1e-9


def test_a_vehicle_at_rest_stays():
    still = MotionState(
        position_ned=np.ones(3), velocity_ned=np.zeros(3), acceleration_ned=np.zeros(3), yaw=1.0, yaw_rate=0.0
    )
    trajectory = brake(still, t_start=0.0, limits=LIMITS, t_expiry=9.0, reset_counter=3)
    assert trajectory.at(4.0).position_ned == pytest.approx(np.ones(3))
    assert trajectory.t_expiry == 9.0
    assert trajectory.reset_counter == 3
