"""The rover's body: friction, tyres, steering in both directions."""

import math
from dataclasses import replace
from typing import cast

import pytest
from stub_vehicle_support import CALM, BareTargets

from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.vehicle.rigid_body import GRAVITY
from sitl_stub.vehicle.rover.body import RoverBody
from sitl_stub.vehicle.rover.config import RoverConfig

DT = 0.004


def make_body(heading: float = 0.0, name: str = "sih_rover", **changes: float) -> RoverBody:
    config = cast(RoverConfig, load_vehicle(name))
    return RoverBody(replace(config.body, **changes), heading=heading)


def run(body: RoverBody, seconds: float, *, steering: float = 0.0, throttle: float = 0.0, targets=None, wind=CALM):
    surface = targets or BareTargets()
    for _ in range(round(seconds / DT)):
        surface.step(surface.t + DT, None)
        body.step(DT, [steering, throttle], wind, surface.surface_under)
    return body


def test_static_friction_holds_up_to_its_limit_and_not_beyond():
    assert run(make_body(), 3.0, throttle=98.0 / 400.0).speed == 0.0
    assert run(make_body(), 3.0, throttle=-98.0 / 400.0).speed == 0.0
    assert run(make_body(), 3.0, throttle=99.0 / 400.0).speed > 0.5
    assert run(make_body(), 3.0, throttle=-99.0 / 400.0).speed < -0.5


def test_coasts_to_a_stop_and_stays_there():
    body = run(make_body(), 3.0, throttle=0.5)
    speed = body.speed
    assert speed > 1.5
    body = run(body, 3.0)
    assert body.speed == 0.0
    place = body.position
    run(body, 5.0)
    assert body.position == place


@pytest.mark.parametrize("throttle", [0.3, 0.5, 0.9])
def test_steady_speed_balances_the_forces(throttle: float):
    """thrust = rolling friction + drag speed^2."""
    body = run(make_body(), 6.0, throttle=throttle)
    assert body.speed == pytest.approx(math.sqrt((400.0 * throttle - 58.9) / 41.7), rel=1e-3)


def test_drives_alike_in_every_direction():
    """SIH's rover is 17 % faster to the north than to the east; that is not copied."""
    speeds, turns = set(), set()
    for heading in (0.0, 0.7, 1.5708, 3.0, -2.0):
        body = run(make_body(heading), 4.0, throttle=0.5, steering=0.3)
        speeds.add(round(body.speed, 9))
        turns.add(round(math.remainder(body.heading - heading, math.tau), 9))
    assert len(speeds) == len(turns) == 1


@pytest.mark.parametrize("throttle", [0.4, 0.6])
def test_steady_turn_follows_the_bicycle(throttle: float):
    """r = C L steer u / (C L^2 + 2 damping u), from the balance of moments of two equal axles, per axle C L / 2."""
    body = run(make_body(grip=100.0), 6.0, throttle=throttle, steering=0.3)
    steer, length, stiffness, damping = math.radians(9.0), 0.321, 1000.0, 10.0
    u = body.speed
    expected = stiffness * length * steer * u / (stiffness * length**2 + 2.0 * damping * u)
    assert body.r == pytest.approx(expected, rel=1e-6)


def test_left_mirrors_right():
    left = run(make_body(), 3.0, throttle=0.5, steering=-0.4)
    right = run(make_body(), 3.0, throttle=0.5, steering=0.4)
    assert (left.north, left.east, left.heading) == pytest.approx((right.north, -right.east, -right.heading), abs=1e-9)


def test_reverse_with_the_wheel_to_the_right_turns_the_nose_left():
    """As a car does; SIH's tyres turn it the other way, which is not copied."""
    forwards = run(make_body(), 4.0, throttle=0.5, steering=0.3)
    backwards = run(make_body(), 4.0, throttle=-0.5, steering=0.3)
    assert forwards.r > 0.3
    assert backwards.speed < -1.0
    assert backwards.r < -0.3


def test_reversing_straight_stays_straight():
    body = run(make_body(0.5), 10.0, throttle=-0.5)
    assert body.heading == pytest.approx(0.5, abs=1e-9)
    assert math.atan2(-body.v_east, -body.v_north) == pytest.approx(0.5, abs=1e-9)


def test_does_not_turn_on_the_spot():
    body = run(make_body(), 5.0, steering=1.0)
    assert body.heading == 0.0


@pytest.mark.parametrize("name", ["sih_rover", "rover"])
def test_side_force_stays_within_the_grip(name: str):
    body = make_body(name=name)
    grip = body._body.grip
    run(body, 4.0, throttle=1.0)
    for _ in range(500):
        run(body, DT, throttle=1.0, steering=1.0)
        cosine, sine = math.cos(body.heading), math.sin(body.heading)
        side = -sine * body.acceleration[0] + cosine * body.acceleration[1]
        assert abs(side) < 1.02 * grip * GRAVITY


@pytest.mark.parametrize("name", ["sih_rover", "rover"])
def test_tyres_are_stable_at_crawling_speed(name: str):
    """Tyre forces grow as 1 / speed: an explicit step would oscillate here."""
    body = run(make_body(name=name), 2.0, throttle=0.4, steering=0.8)
    last = body.r
    while body.speed > 0.0:
        run(body, DT, steering=0.8)
        assert 0.0 <= body.r <= last * 1.02 + 1e-6
        last = body.r
    assert body.r == pytest.approx(0.0, abs=0.05)


def test_minimum_turning_radius_of_the_small_rover():
    """Driven slowly: wheel base / steering angle, as the linear bicycle has it."""
    body = run(make_body(name="rover", yaw_damping_nm_per_radps=0.0), 8.0, throttle=0.26, steering=1.0)
    cosine, sine = math.cos(body.heading), math.sin(body.heading)
    forward = cosine * body.v_north + sine * body.v_east
    assert forward / body.r == pytest.approx(0.36 / math.radians(28.0), rel=0.02)


def test_a_moving_platform_carries_it():
    targets = BareTargets(platform_top=0.0, speed=0.5)
    body = run(make_body(), 2.0, targets=targets)
    assert body.north == pytest.approx(1.0, abs=0.01)
    assert body.gear.surface == "pad"
    assert body.speed == 0.0


def test_a_high_platform_is_not_driven_onto():
    body = make_body()
    body.north = -2.0
    run(body, 2.0, throttle=0.5, targets=BareTargets(platform_top=0.4))
    assert body.gear.surface == "ground"
    assert body.down == pytest.approx(-0.10)


def test_wind_slows_the_small_rover_down():
    calm = run(make_body(name="rover"), 6.0, throttle=0.5).speed
    against = run(make_body(name="rover"), 6.0, throttle=0.5, wind=(-6.0, 0.0, 0.0)).speed
    along = run(make_body(name="rover"), 6.0, throttle=0.5, wind=(6.0, 0.0, 0.0)).speed
    assert against < calm < along


def test_acceleration_is_the_derivative_of_the_velocity():
    body = make_body(0.4)
    run(body, 1.0, throttle=0.5, steering=0.4)
    before = body.velocity
    run(body, DT, throttle=0.5, steering=0.4)
    assert body.acceleration[:2] == pytest.approx(
        [(after - start) / DT for after, start in zip(body.velocity[:2], before[:2], strict=True)], rel=1e-6
    )
