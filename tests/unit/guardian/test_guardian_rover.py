"""The guardian with a rover: by sticks in ACRO, inside its limits, silent as soon as somebody else drives."""

import math
from dataclasses import replace

import numpy as np
import pytest
from guardian_bench import DT, Path, motion
from guardian_planar_bench import PlanarBench, assert_another_mode_mutes

from companion.guardian.fence import Fence
from companion.guardian.rover_drive import RoverShaper
from companion.messages.guardian import GuardianState, ModeRequest
from companion.messages.ownship import FlightMode
from companion.messages.target import TargetPose
from companion.vehicles.rover import RoverParameters

ROVER = RoverParameters()
S = GuardianState


class RoverBench(PlanarBench):
    """The rover drives as it is told."""

    mode = FlightMode.ACRO

    def __init__(self, **options):
        super().__init__(RoverShaper(ROVER), **options)
        self.speed = 0.0

    def obey(self, setpoint):
        self.speed = setpoint.speed
        self.yaw += setpoint.yaw_rate * DT
        self.velocity = self.speed * np.array([math.cos(self.yaw), math.sin(self.yaw), 0.0])

    @property
    def north(self):
        return float(self.place[0])


def arc(speed, yaw_rate=0.0, **more):
    """A reference that drives on from wherever it is, of which the guardian takes speed and turn."""

    def at(t):
        yaw = yaw_rate * t
        return motion((0, 0, 0), (speed * math.cos(yaw), speed * math.sin(yaw), 0), yaw=yaw, yaw_rate=yaw_rate)

    return Path(at, **more)


def test_it_asks_for_acro_and_sends_centred_sticks_until_it_is_there() -> None:
    bench = RoverBench().engaged()
    assert bench.requests == [ModeRequest.ACRO]
    assert all(s.throttle == s.steering == s.speed == 0.0 for s in bench.setpoints)


@pytest.mark.parametrize("mode", [FlightMode.MANUAL, FlightMode.POSCTL, FlightMode.AUTO_LOITER, FlightMode.OFFBOARD])
def test_any_other_mode_mutes_it_in_the_same_tick(mode) -> None:
    assert_another_mode_mutes(RoverBench(), mode)


def test_the_mode_into_which_px4_goes_by_itself_when_sticks_arrive_is_nobodys_takeover() -> None:
    """Disarmed and never told a mode, PX4 goes to Position; armed it does not, so then it was somebody."""
    bench = RoverBench(armed=False)
    bench.guardian.engage(bench.t)
    bench.run(0.5)
    bench.status = replace(bench.status, mode=FlightMode.POSCTL)
    assert bench.run(0.2).out.state is S.PRESTREAM
    bench = RoverBench()
    bench.guardian.engage(bench.t)
    bench.run(0.5)
    bench.status = replace(bench.status, mode=FlightMode.POSCTL)
    assert bench.run(0.04).out.state is S.MUTED


def heard(bench, *, transmitter=(0.0, 0.0, 0.0, 0.0), roll=0.0, throttle=0.0):
    bench.status = replace(bench.status, sticks=(*transmitter, 0.0, roll, throttle, 0.0))


def test_its_own_sticks_told_back_are_not_the_pilots() -> None:
    bench = RoverBench()
    heard(bench)
    bench.engaged()
    bench.trajectory = arc(1.0, 0.5)
    for _ in range(150):
        late = bench.setpoints[-10]
        heard(bench, roll=late.steering, throttle=late.throttle)
        bench.tick()
    assert bench.out.state is S.FOLLOWING
    assert abs(bench.setpoints[-1].throttle) > 0.2


def test_sticks_that_the_autopilot_obeys_and_that_are_not_ours_mute_it() -> None:
    bench = RoverBench()
    heard(bench)
    bench.engaged()
    bench.trajectory = arc(1.0)
    bench.run(1.0)
    heard(bench, roll=0.9, throttle=bench.setpoints[-1].throttle)
    assert bench.tick().state is S.MUTED


def test_a_transmitter_that_is_moved_mutes_it() -> None:
    bench = RoverBench()
    heard(bench)
    bench.engaged()
    heard(bench, transmitter=(0.0, 0.0, 0.4, 0.0))
    assert bench.tick().state is S.MUTED


def test_no_reference_drives_it_beyond_its_limits() -> None:
    dice = np.random.default_rng(5)
    bench = RoverBench().engaged()
    for _ in range(120):
        bench.trajectory = arc(float(dice.uniform(-4, 4)), float(dice.uniform(-6, 6)))
        bench.run(float(dice.uniform(0.02, 0.3)))
    speeds = np.array([s.speed for s in bench.setpoints])
    turns = np.array([s.yaw_rate for s in bench.setpoints])
    assert speeds.max() <= ROVER.speed_forward + 1e-9
    assert speeds.max() > 0.5
    assert speeds.min() >= -ROVER.speed_reverse - 1e-9
    assert np.abs(np.diff(speeds)).max() <= ROVER.acceleration * DT + 1e-9
    assert np.abs(turns).max() <= ROVER.yaw_rate + 1e-9
    assert (ROVER.turning_radius * np.abs(turns) <= np.abs(speeds) + 1e-9).all()
    assert all(-1.0 <= s.throttle <= 1.0 and -1.0 <= s.steering <= 1.0 for s in bench.setpoints)


def test_without_a_trajectory_it_stops_and_gives_the_rover_to_hold() -> None:
    bench = RoverBench().engaged()
    bench.trajectory = arc(1.0, t_expiry=bench.t + 2.0)
    bench.run(2.0)
    assert bench.speed == pytest.approx(1.0, abs=0.03)
    bench.run(1.1)
    assert bench.speed == 0.0
    assert bench.setpoints[-1].throttle == 0.0
    bench.run(2.0)
    assert bench.requests[-1] is ModeRequest.HOLD
    assert bench.out.state is S.MUTED


def test_it_stops_inside_the_fence_and_drives_back_in() -> None:
    bench = RoverBench(fence=Fence(radius=4.0, margin=1.0)).engaged()
    bench.trajectory = arc(1.0)
    bench.run(10.0)
    assert 2.0 < bench.north <= 3.1
    assert "fence" in bench.out.clips
    bench.trajectory = arc(-0.5)
    bench.run(2.0)
    assert bench.north < 2.5


def towards(bench: RoverBench, away: float, speed: float, aside: float = 0.0) -> float:
    """Give the speed that is commanded where 1.5 m/s are wanted, the target ahead coming on at a speed [m/s]."""
    bench.trajectory = arc(1.5)
    for _ in range(150):
        bench.target = TargetPose(
            t=bench.t,
            position_ned=np.array([bench.north + away, aside, 0.0]),
            velocity_ned=np.array([-speed, 0.0, 0.0]),
            acceleration_ned=np.zeros(3),
            yaw=0.0,
            yaw_rate=0.0,
            covariance=np.zeros((4, 4)),
        )
        bench.tick()
    return bench.speed


def test_near_the_target_it_does_not_close_in_faster_than_allowed() -> None:
    assert towards(RoverBench().engaged(), 1.4, 0.4) == pytest.approx(ROVER.closing_speed - 0.4)


def test_farther_away_it_may_be_as_much_faster_as_it_can_brake_off() -> None:
    away = 2.0
    speed = towards(RoverBench().engaged(), away, 0.4)
    most = math.sqrt(ROVER.closing_speed**2 + ROVER.acceleration * (away - ROVER.closing_within))
    assert ROVER.closing_speed - 0.4 < speed == pytest.approx(most - 0.4, abs=0.01)


def test_a_far_target_that_comes_by_itself_does_not_forbid_to_set_off() -> None:
    assert towards(RoverBench().engaged(), 4.0, ROVER.closing_speed + 0.2, aside=2.5) > 0.5
    assert towards(RoverBench().engaged(), 1.4, ROVER.closing_speed + 0.2) == 0.0


def test_a_reference_that_is_not_finite_stops_it() -> None:
    bench = RoverBench().engaged()
    bench.trajectory = arc(math.nan)
    bench.run(0.5)
    assert bench.out.state is S.HOLDING
    assert bench.speed == 0.0
