"""Platforms: when they start and stop, how they move, what is under a point."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl_stub.truth import TargetTruth, VehicleTruth
from sitl_stub.world.documents import Interval, Section
from sitl_stub.world.motion import MotionConfig
from sitl_stub.world.pads import Pad, Tag
from sitl_stub.world.targets import StartCondition, Target, TargetConfig, Targets
from sitl_stub.world.world import World

STEP = 0.004
PAD = Pad(
    name="p",
    family="36h11",
    size=(0.8, 0.6),
    landing_point=(0.1, -0.05),
    landing_heading=0.3,
    tags=(Tag(id=0, size=0.2, x=0.0, y=0.0, heading=0.0),),
)


def vehicle(t: float, height: float) -> VehicleTruth:
    return VehicleTruth(
        t=t,
        position_ned=(0.0, 0.0, -height),
        velocity_ned=(0.0, 0.0, 0.0),
        quaternion=(1.0, 0.0, 0.0, 0.0),
        angular_velocity_frd=(0.0, 0.0, 0.0),
        acceleration_ned=(0.0, 0.0, 0.0),
        feet_in_contact=0,
        surface="",
        armed=True,
    )


def config(
    motion: dict[str, object], *, above: float = -math.inf, after: float = 0.0, within: float = math.inf
) -> TargetConfig:
    return TargetConfig(
        name="pad",
        pad=PAD,
        height=0.15,
        sides=True,
        north=Interval(1.0, 3.0),
        east=Interval(-1.0, 1.0),
        heading=Interval(-math.pi, math.pi),
        starts=StartCondition(vehicle_above=above, after=after, vehicle_within=within),
        motion=MotionConfig.read(Section(motion, where="test")),
    )


def run(motion: dict[str, object], seconds: float, *, seed: int = 1, step: float = STEP) -> list[TargetTruth]:
    targets = Targets([config(motion)], np.random.default_rng(seed))
    history = []
    for k in range(1, round(seconds / step) + 1):
        targets.step(k * step, vehicle(k * step, 5.0))
        history.append(targets.truths()[0])
    return history


MOTIONS: list[dict[str, object]] = [
    {"kind": "static"},
    {"kind": "straight", "speed_mps": 0.5, "duration_s": 6.0},
    {"kind": "straight", "speed_mps": 0.4, "turn_rate_radps": 0.3, "duration_s": 6.0},
    {"kind": "stop_and_go", "speed_mps": [0.2, 0.6], "go_s": 2.0, "pause_s": 1.0, "duration_s": 8.0},
    {"kind": "random", "speed_mps": [0.0, 0.5], "turn_rate_radps": [-1.0, 1.0], "duration_s": 8.0},
    {"kind": "sine", "speed_mps": 0.4, "wavelength_m": 2.0, "peak_to_peak_m": 0.5, "duration_s": 8.0},
]


def test_a_target_that_waits_for_the_vehicle_sets_off_when_it_is_near() -> None:
    waiting = config({"kind": "straight", "speed_mps": 0.5}, within=0.4, after=0.2)
    target = Target(replace(waiting, pad=replace(PAD, landing_point=(0.0, 0.0))), np.random.default_rng(1))
    north, east, _ = target.truth().position_ned
    begun = None
    for k in range(1, 1000):
        t, away = k * STEP, 1.0 - 0.25 * k * STEP
        target.step(t, replace(vehicle(t, 0.0), position_ned=(north, east + away, 0.0)))
        if begun is None and target.truth().started:
            begun = t
    assert begun == pytest.approx((1.0 - 0.4) / 0.25 + 0.2, abs=2.5 * STEP)


@pytest.mark.parametrize("motion", MOTIONS, ids=str)
def test_velocity_and_turn_rate_are_the_derivatives_of_position_and_yaw(motion: dict[str, object]) -> None:
    history = run(motion, 10.0)
    position = np.array([truth.position_ned for truth in history])
    velocity = np.array([truth.velocity_ned for truth in history])
    yaw = np.array([truth.yaw for truth in history])
    yaw_rate = np.array([truth.yaw_rate for truth in history])
    assert np.allclose(np.diff(position, axis=0), 0.5 * STEP * (velocity[1:] + velocity[:-1]), atol=2e-6)
    exact = 1e-6 if motion["kind"] == "sine" else 1e-9  # a sine's heading is not the sum of steps
    assert np.allclose(np.diff(yaw), 0.5 * STEP * (yaw_rate[1:] + yaw_rate[:-1]), atol=exact)
    assert position[:, 2] == pytest.approx(-0.15)


@pytest.mark.parametrize("motion", MOTIONS, ids=str)
def test_acceleration_is_finite_and_the_platform_ends_at_rest(motion: dict[str, object]) -> None:
    history = run(motion, 12.0)
    velocity = np.array([truth.velocity_ned for truth in history])
    assert np.abs(np.diff(velocity, axis=0)).max() / STEP < 11.0
    assert not history[-1].moving
    assert history[-1].velocity_ned == (0.0, 0.0, 0.0)


def test_a_straight_target_keeps_its_speed_and_heading() -> None:
    history = run(MOTIONS[1], 5.0)
    late = history[-1]
    assert math.hypot(*late.velocity_ned[:2]) == pytest.approx(0.5, abs=1e-3)
    assert math.atan2(late.velocity_ned[1], late.velocity_ned[0]) == pytest.approx(
        math.remainder(late.yaw - PAD.landing_heading, math.tau), abs=1e-6
    )


def test_a_stop_is_a_short_braking_distance() -> None:
    history = run(MOTIONS[1], 10.0)
    at_end = history[round(6.0 / STEP)]
    assert 0.05 < math.dist(at_end.position_ned, history[-1].position_ned) < 0.5


@pytest.mark.parametrize("speed", [0.25, 1.0])
def test_a_sine_is_driven_exactly_at_constant_speed_along_it(speed: float) -> None:
    motion = {"kind": "sine", "speed_mps": speed, "wavelength_m": 5.0, "peak_to_peak_m": 1.0, "phase_deg": 0.0}
    targets = Targets([config({**motion, "duration_s": 40.0})], np.random.default_rng(4))
    body = targets._targets[0]._body
    start, first = np.array([body.north, body.east]), body.heading
    axis = first - math.atan(math.pi / 5.0)  # the slope where a sine of amplitude 0.5 m crosses its axis
    forward, right = np.array([math.cos(axis), math.sin(axis)]), np.array([-math.sin(axis), math.cos(axis)])
    across, way = [], 0.0
    for k in range(1, 11_000):
        before = np.array([body.north, body.east])
        targets.step(k * STEP, vehicle(k * STEP, 5.0))
        here = np.array([body.north, body.east]) - start
        way += math.dist(before - start, here)
        across.append(float(here @ right))
        slope = math.tau / 5.0 * 0.5 * math.cos(math.tau / 5.0 * float(here @ forward))
        assert across[-1] == pytest.approx(0.5 * math.sin(math.tau / 5.0 * float(here @ forward)), abs=1e-9)
        assert body.heading == pytest.approx(axis + math.atan(slope), abs=1e-9)
    assert (min(across), max(across)) == pytest.approx((-0.5, 0.5), abs=2e-3)
    braking = 0.5 * speed * speed / 1.0
    starting = speed * speed / (2.0 * 0.5)
    assert way == pytest.approx(40.0 * speed - starting + braking, abs=0.1)
    assert body.speed == 0.0


def test_random_commands_change_every_tenth_of_a_second_and_fill_their_range() -> None:
    history = run(
        {**MOTIONS[4], "duration_s": 200.0, "lag_s": 0.001, "acceleration_mps2": 1e4, "turn_acceleration_radps2": 1e4},
        100.0,
    )
    rates = np.array([truth.yaw_rate for truth in history[:-1]])[12::25]  # in the middle of each period
    changes = np.flatnonzero(np.abs(np.diff([truth.yaw_rate for truth in history])) > 0.02)
    assert set(np.diff(changes).tolist()) <= {1, 24, 25, 26, 49, 50, 51}
    assert abs(rates.mean()) < 0.08
    assert rates.std() == pytest.approx(2.0 / math.sqrt(12.0), rel=0.08)
    assert rates.min() >= -1.0
    assert rates.max() <= 1.0
    assert abs(np.corrcoef(rates[1:], rates[:-1])[0, 1]) < 0.12


def test_a_target_waits_for_the_vehicle_to_stay_up() -> None:
    targets = Targets([config(MOTIONS[1], above=2.0, after=1.0)], np.random.default_rng(0))
    t = 0.0
    for height, seconds, started in (
        (0.0, 3.0, False),
        (3.0, 0.9, False),
        (1.0, 0.1, False),
        (3.0, 0.9, False),
        (3.0, 0.2, True),
    ):
        for _ in range(round(seconds / STEP)):
            t += STEP
            targets.step(t, vehicle(t, height))
        assert targets.truths()[0].started is started
    targets.step(t + STEP, vehicle(t, 0.0))  # coming down later does not stop it
    assert targets.truths()[0].moving


def test_a_target_without_a_height_condition_starts_by_time() -> None:
    targets = Targets([config(MOTIONS[1], after=1.0)], np.random.default_rng(0))
    targets.step(0.9, vehicle(0.9, 0.0))
    assert not targets.truths()[0].started
    targets.step(1.0, vehicle(1.0, 0.0))
    assert targets.truths()[0].started


def test_the_surface_is_the_turned_rectangle_and_carries_its_own_motion() -> None:
    targets = Targets([config(MOTIONS[2])], np.random.default_rng(4))
    for k in range(1, 500):
        targets.step(k * STEP, vehicle(k * STEP, 5.0))
    truth = targets.truths()[0]
    board_yaw = truth.yaw - PAD.landing_heading
    c, s = math.cos(board_yaw), math.sin(board_yaw)
    center = (
        truth.position_ned[0] - c * PAD.landing_point[0] + s * PAD.landing_point[1],
        truth.position_ned[1] - s * PAD.landing_point[0] - c * PAD.landing_point[1],
    )
    for x, y, on in (
        (0.39, 0.29, True),
        (-0.39, -0.29, True),
        (0.41, 0.0, False),
        (0.0, 0.31, False),
        (0.0, 0.0, True),
    ):
        down, name, velocity, yaw_rate = targets.surface_under(center[0] + c * x - s * y, center[1] + s * x + c * y)
        assert (down, name) == ((-0.15, "pad") if on else (0.0, "ground"))
        if on:
            assert yaw_rate == truth.yaw_rate
            relative = np.array([velocity[0] - truth.velocity_ned[0], velocity[1] - truth.velocity_ned[1]])
            dx, dy = x - PAD.landing_point[0], y - PAD.landing_point[1]
            arm = np.array([c * dx - s * dy, s * dx + c * dy])
            assert relative == pytest.approx(truth.yaw_rate * np.array([-arm[1], arm[0]]), abs=1e-12)
        else:
            assert velocity == (0.0, 0.0, 0.0)


def test_the_higher_platform_is_on_top() -> None:
    low, high = config({"kind": "static"}), config({"kind": "static"})
    same = {"north": Interval(0.0, 0.0), "east": Interval(0.0, 0.0), "heading": Interval(0.0, 0.0)}
    pair = []
    for base, name, height in ((high, "high", 0.4), (low, "low", 0.1)):
        fields = {f: getattr(base, f) for f in base.__slots__} | same | {"name": name, "height": height}
        pair.append(TargetConfig(**fields))
    targets = Targets(pair, np.random.default_rng(0))
    assert targets.surface_under(0.0, 0.0)[:2] == (-0.4, "high")


@pytest.mark.parametrize("name", ["moving_pad", "random_pad", "stop_and_go"])
def test_seeds_differ_and_repeat(name: str) -> None:
    world = World.load(name)

    def end(seed: int) -> TargetTruth:
        targets = Targets(world.targets, np.random.default_rng(seed))
        for k in range(1, 4000):
            targets.step(k * STEP, vehicle(k * STEP, 5.0))
        return targets.truths()[0]

    assert end(1) == end(1)
    assert end(1).position_ned != end(2).position_ned
