"""Sensors of the docking simulator: noise, lever arm, outliers, sight, latency, dropouts, dice."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from stub_cubesat_support import DOCKING, NONE, SURVEYED, VEHICLE, as_designed, calm, only, without_noise

from sitl_stub.cubesat.readings import GyroReading, MarkerReading, RangeReading, Reading
from sitl_stub.cubesat.rotation import from_rotation_vector, matrix_of
from sitl_stub.cubesat.simulation import CubesatSimulation
from sitl_stub.cubesat.vehicle import CubesatVehicle
from sitl_stub.cubesat.world import DockingWorld
from sitl_stub.vehicle.attitude_control import multiply

AIM = DOCKING.target.quaternion
FACE = np.array([1.0, 1.95, 1.0])
SENSORS = {"gyro": GyroReading, "radio": RangeReading, "camera": MarkerReading}
NO_OUTLIERS = replace(DOCKING.faults, outlier_share=0.0)


def before_the_face(distance: float = 0.4, *, aside=0.0, turned_by=(0.0, 0.0, 0.0), world=DOCKING) -> DockingWorld:
    """Start the chaser so that its camera is `distance` [m] before the docking face, at rest."""
    place = (1.0 + aside, 1.9 - distance, 1.0)
    return calm(world, position=place, quaternion=multiply(AIM, from_rotation_vector(turned_by)))


def readings(vehicle: CubesatVehicle, world: DockingWorld, seconds: float, seed: int = 1) -> list[Reading]:
    flown = CubesatSimulation(vehicle, world, seed)
    flown.advance(seconds)
    return list(flown.readings())


def with_only(name: str, vehicle: CubesatVehicle = VEHICLE) -> CubesatVehicle:
    """Switch all sensors but one off."""
    off = {other: replace(getattr(vehicle, other), enabled=False) for other in SENSORS if other != name}
    return replace(vehicle, **off)


def of(kind: type, found: list[Reading]) -> list:
    return [reading for reading in found if isinstance(reading, kind)]


# gyroscope


def test_gyro_noise_makes_the_angle_walk_by_the_density():
    rates = np.array([r.rate for r in of(GyroReading, readings(with_only("gyro"), calm(), 60.0))])
    assert len(rates) == 6000
    assert rates.std() == pytest.approx(math.radians(0.0035) * 10.0, rel=0.02)
    seconds = 0.01 * rates.reshape(60, 100, 3).sum(axis=1)
    assert seconds.std() == pytest.approx(math.radians(0.0035), rel=0.15)
    assert np.abs(rates.mean(axis=0)).max() < 4.0 * rates.std() / math.sqrt(6000)
    neighbours = (rates[1:] * rates[:-1]).mean() / rates.var()
    assert abs(neighbours) < 0.04  # white


def test_gyro_measures_the_turn_in_the_body_and_a_bias_stays():
    biased = replace(without_noise(as_designed()), gyro=replace(VEHICLE.gyro, noise_density=0.0, bias_std=0.01))
    flown = CubesatSimulation(biased, calm(), 3)
    flown.advance(0.05)
    flown.command(0.05, only(0, 0.1))
    flown.advance(0.5)
    before, *_, last = of(GyroReading, list(flown.readings()))
    assert last.rate == pytest.approx(np.add(flown.truth.rate, before.rate), abs=1e-9)
    assert math.hypot(*before.rate) > 1e-3
    assert math.hypot(*flown.truth.rate) > 1e-2


# radio


def test_ranges_go_from_the_antenna_to_the_anchors_in_turn():
    world = replace(before_the_face(), faults=NO_OUTLIERS)
    found = of(RangeReading, readings(without_noise(as_designed()), world, 0.2))
    assert [r.anchor for r in found] == [0, 1, 2, 3] * 2 + [0]  # the tenth is under way
    assert [r.t for r in found] == pytest.approx([k / 50 for k in range(1, 10)])
    antenna = np.array([1.0, 1.5, 1.0]) + np.array(matrix_of(AIM)) @ [0.05, 0.05, 0.0]
    for reading in found:
        assert reading.range == pytest.approx(math.dist(antenna, DOCKING.anchors[reading.anchor]), abs=1e-12)


def test_outliers_are_too_long_as_often_as_the_world_says_and_only_the_truth_knows_them():
    flown = CubesatSimulation(with_only("radio", as_designed()), calm(), 1)
    flown.advance(80.0)
    found = of(RangeReading, list(flown.readings()))
    antenna = (0.05, 1.05, 0.0)
    error = {(r.t, r.anchor): r.range - math.dist(antenna, DOCKING.anchors[r.anchor]) for r in found}
    marked = {(outlier.t, outlier.anchor): outlier.excess for outlier in flown.outliers}
    assert len(marked) / len(found) == pytest.approx(0.05, abs=0.012)
    assert min(marked.values()) >= 0.15
    assert max(marked.values()) <= 1.0
    noise = np.array([value - marked.get(key, 0.0) for key, value in error.items()])
    assert noise.std() == pytest.approx(0.02, rel=0.03)
    assert {key for key, value in error.items() if value > 0.12} <= set(marked)
    assert not hasattr(found[0], "excess")


def test_a_lost_radio_is_lost_for_a_second_and_the_dice_go_on():
    radio = with_only("radio")
    everything = readings(radio, replace(SURVEYED, faults=DOCKING.faults), 150.0)
    found = readings(radio, SURVEYED, 150.0)
    gaps = np.diff([r.t for r in found])
    lost = gaps[gaps > 0.021]
    assert 2 <= len(lost) <= 15
    assert lost == pytest.approx(1.02, abs=0.021)
    assert set(map(repr, found)) < set(map(repr, everything))


# camera


def test_markers_stand_where_they_are_in_the_cameras_frame():
    vehicle, world = without_noise(as_designed()), before_the_face(aside=0.05, turned_by=(0.05, -0.1, 0.4))
    flown = CubesatSimulation(vehicle, world, 1)
    flown.advance(0.2)
    seen = of(MarkerReading, list(flown.readings()))
    assert [r.t for r in seen] == pytest.approx([0.05, 0.1, 0.15])
    rotation, truth = np.array(matrix_of(flown.truth.quaternion)), flown.truth
    for reading in seen:
        assert reading.markers == (0, 1, 2, 3, 4, 5)
        for number, place in zip(reading.markers, reading.positions, strict=True):
            # x right, y down, z along the optical axis, which is -z of d
            in_d = np.array([0.0, 0.0, -0.05]) + np.array([place[0], -place[1], -place[2]])
            in_t = np.array(matrix_of(AIM)).T @ (np.array(truth.position) + rotation @ in_d - [1.0, 2.0, 1.0])
            assert in_t == pytest.approx(DOCKING.target.markers[number], abs=1e-12)
            assert place[2] > 0.0


def test_noise_of_a_marker_is_a_millimetre_on_each_axis():
    exact = of(MarkerReading, readings(with_only("camera", without_noise(as_designed())), before_the_face(), 30.0))
    noisy = of(MarkerReading, readings(with_only("camera", as_designed()), before_the_face(), 30.0))
    error = np.array([a.positions for a in noisy]) - np.array([a.positions for a in exact])
    assert error.std(axis=(0, 1)) == pytest.approx([0.001] * 3, rel=0.02)
    assert np.abs(error.mean(axis=0)).max() < 1e-4  # what the steps of the picture leave


@pytest.mark.parametrize(
    ("world", "markers"),
    [
        (before_the_face(0.4), 6),
        (before_the_face(0.999), 6),
        (before_the_face(1.001), 0),
        (before_the_face(0.05), 2),  # the corners are outside the cone
        (before_the_face(0.021), 2),
        (before_the_face(0.019), 0),
        (before_the_face(0.4, turned_by=(math.radians(18.0), 0.0, 0.0)), 6),
        # the camera swings aside as the cube turns: the angles of sight are 20, 28 and 31 degrees
        (before_the_face(0.4, turned_by=(math.radians(25.0), 0.0, 0.0)), 4),  # centre in sight, two corners are not
        (
            before_the_face(0.4, turned_by=(math.radians(28.0), 0.0, 0.0)),
            0,
        ),  # others are in the cone, the centre is not
        (before_the_face(0.4, turned_by=(math.pi, 0.0, 0.0)), 0),
    ],
)
def test_sight_ends_at_the_cone_and_with_the_distance(world, markers):
    seen = of(MarkerReading, readings(without_noise(as_designed()), world, 0.1))
    assert [len(reading.markers) for reading in seen] == ([markers] if markers else [])


@pytest.mark.parametrize(("angle", "sees"), [(70.0, True), (80.0, False), (100.0, False)])
def test_a_face_that_is_turned_away_is_not_seen(angle, sees):
    # on a circle about the face's centre, the camera looking at it
    turn = from_rotation_vector((0.0, 0.0, math.radians(angle)))
    swung = np.array(matrix_of(turn)) @ [0.0, -0.55, 0.0]
    world = calm(position=tuple((FACE + swung).tolist()), quaternion=multiply(turn, AIM))
    seen = of(MarkerReading, readings(without_noise(as_designed()), world, 0.1))
    assert bool(seen) is sees


def test_lost_pictures_are_lost_as_often_as_the_world_says():
    pictures = of(MarkerReading, readings(with_only("camera"), before_the_face(world=SURVEYED), 50.05))
    assert len(pictures) / 1000 == pytest.approx(0.9, abs=0.03)


# delivery and dice


def test_readings_come_late_by_their_latency_and_in_order_of_delivery():
    flown = CubesatSimulation(VEHICLE, before_the_face(), 1)
    latency = {GyroReading: 0.0, RangeReading: 0.005, MarkerReading: 0.05}
    arrived, times = [], []
    for step in range(1, 201):
        flown.advance(step / 200)
        for reading in flown.readings():
            due = reading.t + latency[type(reading)]
            assert due <= flown.t + 1e-9
            assert due > flown.t - 0.005 - 1e-9
            arrived.append(round(due, 6))
            times.append(reading.t)
    assert arrived == sorted(arrived)
    assert times != sorted(times)
    assert len(arrived) == 100 + 49 + 19
    assert flown.readings() == ()


def test_the_same_seed_gives_the_same_bytes():
    def run(seed: int) -> bytes:
        flown = CubesatSimulation(VEHICLE, before_the_face(world=SURVEYED), seed)
        for period in range(30):
            flown.command(flown.t, [0.02 if (period + k) % 3 == 0 else 0.0 for k in range(10)])
            flown.advance((period + 1) / 10)
        return repr((flown.initial_estimate(), flown.truth, flown.readings(), flown.outliers)).encode()

    assert run(7) == run(7)
    assert run(7) != run(8)


@pytest.mark.parametrize("name", SENSORS)
def test_switching_one_sensor_off_changes_nothing_else(name):
    off = replace(VEHICLE, **{name: replace(getattr(VEHICLE, name), enabled=False)})
    found = []
    for vehicle in (VEHICLE, off):
        flown = CubesatSimulation(vehicle, before_the_face(world=SURVEYED), 5)
        for period in range(20):
            flown.command(flown.t, only(period % 10, 0.0123))
            flown.advance((period + 1) / 10)
        kept = [reading for reading in flown.readings() if not isinstance(reading, SENSORS[name])]
        found.append(repr((flown.truth, flown.initial_estimate(), kept)))
    assert found[0] == found[1]


def test_the_chaser_is_told_its_start_as_well_as_the_world_says():
    position, velocity, attitude = [], [], []
    for seed in range(101, 301):
        flown = CubesatSimulation(VEHICLE, DOCKING, seed)
        told, truth = flown.initial_estimate(), flown.truth
        position.append(np.subtract(told.position, truth.position))
        velocity.append(np.subtract(told.velocity, truth.velocity))
        error = np.array(matrix_of(truth.quaternion)).T @ np.array(matrix_of(told.quaternion))
        attitude.append((error[2, 1], error[0, 2], error[1, 0]))
    assert np.std(position) == pytest.approx(told.position_std, rel=0.1) == 0.05
    assert np.std(velocity) == pytest.approx(told.velocity_std, rel=0.1) == 0.002
    assert np.std(attitude) == pytest.approx(told.attitude_std, rel=0.1)


def test_starts_scatter_and_the_survey_is_exact_or_not():
    starts, anchors, targets = [], [], []
    for seed in range(101, 201):
        flown = CubesatSimulation(VEHICLE, SURVEYED, seed)
        starts.append(np.subtract(flown.truth.position, DOCKING.chaser.position))
        anchors.append(np.subtract(flown.anchors, SURVEYED.anchors))
        targets.append(np.subtract(flown.target.position, SURVEYED.target.position))
    assert np.std(starts) == pytest.approx(0.02, rel=0.15)
    assert np.std(anchors) == pytest.approx(0.005, rel=0.1)
    assert np.std(targets) == pytest.approx(0.005, rel=0.15)
    exact = CubesatSimulation(VEHICLE, DOCKING, 101)
    assert exact.anchors == DOCKING.anchors
    assert exact.target.position == DOCKING.target.position
    assert exact.docked_place == pytest.approx((1.0, 1.9, 1.0))


def test_time_does_not_go_back_and_idle_valves_do_nothing():
    flown = CubesatSimulation(as_designed(), calm(), 1)
    flown.command(0.0, NONE)
    flown.advance(1.0)
    assert flown.truth.position == DOCKING.chaser.position
    with pytest.raises(ValueError, match=r"cannot advance to 0\.5"):
        flown.advance(0.5)
