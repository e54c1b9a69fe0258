"""The guardian with a free-flyer: attitude and thrust in OFFBOARD, silent as soon as somebody else flies."""

import math

import numpy as np
import pytest
from guardian_bench import DT, line, motion
from guardian_planar_bench import PlanarBench, assert_another_mode_mutes

from companion.geometry.rotations import rotation_about_z
from companion.guardian.free_flyer_thrust import FreeFlyerShaper
from companion.messages.guardian import GuardianState, ModeRequest
from companion.messages.ownship import FlightMode
from companion.messages.thrust import AttitudeThrust
from companion.vehicles.free_flyer import FreeFlyer

FLYER = FreeFlyer()
FULL = FLYER.parameters.control.thrust_acceleration
S = GuardianState


class FloatingBench(PlanarBench):
    """The vehicle is pushed as it is told and turns at once."""

    mode = FlightMode.OFFBOARD

    def __init__(self):
        super().__init__(FreeFlyerShaper(FLYER))

    def obey(self, setpoint):
        self.yaw = setpoint.yaw
        self.velocity = self.velocity + FULL * DT * (rotation_about_z(self.yaw) @ setpoint.thrust_body)


def test_it_asks_for_offboard_and_pushes_nothing_until_it_is_there() -> None:
    bench = FloatingBench().engaged()
    assert bench.requests == [ModeRequest.OFFBOARD]
    assert all(isinstance(setpoint, AttitudeThrust) for setpoint in bench.setpoints)
    assert not any(setpoint.thrust_body.any() for setpoint in bench.setpoints)


@pytest.mark.parametrize("mode", [FlightMode.MANUAL, FlightMode.POSCTL, FlightMode.AUTO_LOITER, FlightMode.ACRO])
def test_any_other_mode_mutes_it_in_the_same_tick(mode) -> None:
    assert_another_mode_mutes(FloatingBench(), mode)


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_it_flies_a_reference_at_any_heading(yaw) -> None:
    bench = FloatingBench()
    bench.yaw = yaw
    bench.engaged()
    start = bench.t
    velocity = np.array([0.03, -0.05, 0.0])
    bench.trajectory = line(bench.place, velocity, start)
    bench.trajectory.function = lambda t: motion(velocity * (t - start), velocity, yaw=yaw)
    bench.run(10.0)
    assert bench.out.state is S.FOLLOWING
    assert bench.place == pytest.approx(velocity * (bench.t - start), abs=0.01)
    assert math.remainder(bench.yaw - yaw, math.tau) == pytest.approx(0.0, abs=0.01)


def test_a_reference_beyond_the_limits_is_flown_within_them() -> None:
    bench = FloatingBench().engaged()
    bench.trajectory = line(bench.place, (2.0, 0.0, 0.0), bench.t)
    bench.run(6.0)
    assert FLYER.limits.speed_horizontal * 0.9 < max(bench.speeds) < FLYER.limits.speed_horizontal * 1.1
    assert all(abs(part) <= 1.0 for setpoint in bench.setpoints for part in setpoint.thrust_body)


def test_without_a_trajectory_it_brakes_and_stays() -> None:
    bench = FloatingBench().engaged()
    bench.trajectory = line(bench.place, (0.1, 0.0, 0.0), bench.t)
    bench.run(5.0)
    bench.trajectory = None
    bench.run(5.0)
    assert bench.speeds[-1] < 0.005


def test_without_odometry_it_gives_no_thrust() -> None:
    bench = FloatingBench().engaged()
    bench.trajectory = line(bench.place, (0.1, 0.0, 0.0), bench.t)
    bench.run(0.4)
    bench.odometry = False
    bench.run(FLYER.parameters.control.blind_after + 0.2)
    last = bench.setpoints[-1]
    assert bench.out.setpoint is None or not last.thrust_body.any()
