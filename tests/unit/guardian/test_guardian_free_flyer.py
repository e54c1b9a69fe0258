"""The guardian with a free-flyer: attitude and thrust in OFFBOARD, silent as soon as somebody else flies."""

import math
from dataclasses import replace

import numpy as np
import pytest
from guardian_bench import DT, line, motion, status

from companion.geometry.rotations import rotation_about_z
from companion.guardian.free_flyer_thrust import FreeFlyerShaper
from companion.guardian.guardian import Guardian
from companion.guardian.parameters import GuardianParameters
from companion.messages.guardian import GuardianState, ModeRequest
from companion.messages.ownship import FlightMode, OwnshipState
from companion.messages.thrust import AttitudeThrust
from companion.vehicles.free_flyer import FreeFlyer

FLYER = FreeFlyer()
FULL = FLYER.parameters.control.thrust_acceleration
S = GuardianState


class FloatingBench:
    """Ticks the guardian; the vehicle is pushed as it is told and turns at once, the autopilot grants what is asked."""

    def __init__(self):
        self.guardian = Guardian(GuardianParameters(), FreeFlyerShaper(FLYER))
        self.t, self.yaw = 0.0, 0.0
        self.place, self.velocity = np.zeros(3), np.zeros(3)
        self.status = status(mode=FlightMode.AUTO_LOITER)
        self.trajectory = self.out = self.ownship = None
        self.odometry = True
        self.requests, self.setpoints, self.speeds = [], [], []

    def tick(self):
        self.t += DT
        if self.odometry:
            self.ownship = OwnshipState(
                t=self.t,
                position_ned=self.place,
                velocity_ned=self.velocity,
                acceleration_ned=np.zeros(3),
                ned_from_frd=rotation_about_z(self.yaw),
                angular_velocity_frd=np.zeros(3),
                reset_counter=0,
            )
        self.out = self.guardian.tick(self.t, self.ownship, self.status, self.trajectory, None)
        if self.out.request is not None:
            self.requests.append(self.out.request)
            self.status = replace(self.status, mode=self.out.request.mode)
        if self.out.setpoint is not None:
            self.setpoints.append(self.out.setpoint)
            if self.status.mode is FlightMode.OFFBOARD:
                self.yaw = self.out.setpoint.yaw
                push = rotation_about_z(self.yaw) @ self.out.setpoint.thrust_body
                self.velocity = self.velocity + FULL * DT * push
        self.place = self.place + DT * self.velocity
        self.speeds.append(float(np.linalg.norm(self.velocity)))
        return self.out

    def run(self, seconds):
        for _ in range(round(seconds / DT)):
            self.tick()
        return self

    def engaged(self):
        self.guardian.engage(self.t)
        self.run(1.2)
        assert self.out.state is S.HOLDING, self.out
        return self


def test_it_asks_for_offboard_and_pushes_nothing_until_it_is_there() -> None:
    bench = FloatingBench().engaged()
    assert bench.requests == [ModeRequest.OFFBOARD]
    assert all(isinstance(setpoint, AttitudeThrust) for setpoint in bench.setpoints)
    assert not any(setpoint.thrust_body.any() for setpoint in bench.setpoints)


@pytest.mark.parametrize("mode", [FlightMode.MANUAL, FlightMode.POSCTL, FlightMode.AUTO_LOITER, FlightMode.ACRO])
def test_any_other_mode_mutes_it_in_the_same_tick(mode) -> None:
    bench = FloatingBench().engaged()
    bench.status = replace(bench.status, mode=mode)
    out = bench.tick()
    assert out.state is S.MUTED
    assert out.setpoint is None


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
