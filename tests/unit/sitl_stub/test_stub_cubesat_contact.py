"""Contact of the two cubes: what docks, what misses, what collides, and what happens afterwards."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np
import pytest
from stub_cubesat_support import DOCKING, SURVEYED, VEHICLE, as_designed, calm, fly, only

from sitl_stub.cubesat.as_built import PlacedTarget
from sitl_stub.cubesat.contact import COLLISION, DOCKING_FACE, Contact, ContactWatch, Pose
from sitl_stub.cubesat.readings import GyroReading
from sitl_stub.cubesat.rotation import from_rotation_vector, matrix_of
from sitl_stub.cubesat.simulation import CubesatSimulation
from sitl_stub.vehicle.attitude_control import multiply

AIM = DOCKING.target.quaternion
TARGET = PlacedTarget(position=DOCKING.target.position, quaternion=AIM)
STILL = (0.0, 0.0, 0.0)


def watch() -> ContactWatch:
    return ContactWatch(TARGET, 0.1, 0.1, DOCKING.docked)


def pose(t: float, position, *, velocity=STILL, turned_by=STILL, rate=STILL) -> Pose:
    quaternion = multiply(AIM, from_rotation_vector(turned_by))
    return Pose(t=t, position=position, velocity=velocity, quaternion=quaternion, rate=rate)


def coming_in(*, speed=0.01, aside=0.0, lateral=0.0, turned_by=STILL, rate=STILL) -> Contact | None:
    """Step over the docking plane, which is reached 0.3 of the way through the step of 0.01 s."""
    moved = (aside, 1.9 + 0.7 * speed * 0.01, 0.0)
    begun = (aside - lateral * 0.01, 1.9 - 0.3 * speed * 0.01, 0.0)
    both = {"velocity": (lateral, speed, 0.0), "turned_by": turned_by, "rate": rate}
    before = pose(5.0, (1.0 + begun[0], begun[1], 1.0), **both)
    after = pose(5.01, (1.0 + moved[0], moved[1], 1.0), **both)
    found = watch().look(before, after)
    return None if found is None else found[0]


def test_the_docked_place_is_one_side_before_the_target_and_looks_at_it():
    assert watch().docked_place == pytest.approx((1.0, 1.9, 1.0))
    assert np.array(matrix_of(AIM)) @ [0.0, 0.0, 1.0] == pytest.approx([0.0, -1.0, 0.0])


def test_a_good_approach_docks_and_is_measured_where_it_touches():
    contact = coming_in(aside=0.01, lateral=0.005, turned_by=(0.0, 0.0, 0.04))
    assert contact.docked
    assert contact.kind == DOCKING_FACE
    assert contact.t == pytest.approx(5.003)
    assert contact.position_error == pytest.approx((0.01 - 0.7 * 0.005 * 0.01, 0.0, 0.0))
    assert contact.attitude_error == pytest.approx(0.04)
    assert contact.closing_speed == pytest.approx(0.01)
    assert contact.lateral_speed == pytest.approx(0.005)


def test_speeds_are_those_of_the_docking_face():
    # a turn about d's x moves the face, 0.05 m below the centre, along d's y
    assert coming_in(rate=(0.1, 0.0, 0.0)).lateral_speed == pytest.approx(0.005)
    assert coming_in(rate=(0.0, 0.0, 0.1)).lateral_speed == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    "approach",
    [{"aside": 0.0151}, {"turned_by": (0.0, 0.051, 0.0)}, {"speed": 0.0201}, {"lateral": 0.0101}],
    ids=lambda approach: next(iter(approach)),
)
def test_each_limit_alone_makes_a_miss(approach):
    value = next(iter(approach.values()))
    inside = tuple(0.96 * part for part in value) if isinstance(value, tuple) else 0.96 * value
    assert coming_in(**dict.fromkeys(approach, inside)).docked
    contact = coming_in(**approach)
    assert contact.kind == DOCKING_FACE
    assert not contact.docked


def test_a_chaser_before_the_plane_does_not_touch_nor_one_that_passes_beside():
    assert watch().look(pose(0.0, (1.0, 1.89, 1.0)), pose(0.01, (1.0, 1.8999, 1.0))) is None
    assert watch().look(pose(0.0, (1.101, 1.89, 1.0)), pose(0.01, (1.101, 1.91, 1.0))) is None
    assert not watch().near((1.0, 1.8, 1.0))
    assert watch().near((1.0, 1.84, 1.0))


@pytest.mark.parametrize("position", [(1.0, 2.099, 1.0), (1.0, 2.0, 1.099), (0.901, 2.0, 1.0), (1.0, 1.901, 1.06)])
def test_other_sides_collide(position):
    contact, held = watch().look(pose(3.0, position), pose(3.0, position))
    assert contact.kind == COLLISION
    assert not contact.docked
    assert held.position == position


def test_an_edge_that_comes_in_over_the_face_collides_before_the_middle_is_there():
    edge_on = (math.radians(45.0), 0.0, 0.0)
    beside = 0.05 + 0.05 * math.sqrt(2.0)
    assert watch().look(*[pose(0.0, (1.0, 2.0 - beside - 0.001, 1.0), turned_by=edge_on)] * 2) is None
    contact, _ = watch().look(*[pose(0.0, (1.0, 2.0 - beside + 0.001, 1.0), turned_by=edge_on)] * 2)
    assert contact.kind == COLLISION


def test_overlap_of_turned_cubes_agrees_with_points_inside_both():
    generator = np.random.default_rng(6)
    grid = np.stack(np.meshgrid(*[np.linspace(-0.05, 0.05, 17)] * 3), axis=-1).reshape(-1, 3)
    rows, touching = np.array(matrix_of(AIM)), []
    for _ in range(300):
        turn = tuple(generator.uniform(-2.0, 2.0, 3).tolist())
        offset = generator.uniform(-0.14, 0.14, 3)
        placed = pose(0.0, tuple((np.array(TARGET.position) + offset).tolist()), turned_by=turn)
        inside = (np.array(matrix_of(placed.quaternion)) @ grid.T).T + offset
        overlap = bool((np.abs(inside @ rows).max(axis=1) < 0.05).any())
        found = watch().look(placed, placed)
        if overlap:
            assert found is not None
        elif found is not None:  # closer than the grid can tell: then a cube a little smaller does not touch
            smaller = ContactWatch(TARGET, 0.1 - 0.012, 0.1 - 0.012, DOCKING.docked)
            assert smaller.look(placed, placed) is None
        touching.append(overlap)
    assert 0.2 < np.mean(touching) < 0.8


def test_a_docked_chaser_stays_and_its_valves_are_shut():
    flown = CubesatSimulation(as_designed(), calm(position=(1.0, 1.895, 1.0), quaternion=AIM), 1)
    along = np.array(matrix_of(AIM)).T @ [0.0, 1.0, 0.0]
    assert along == pytest.approx([0.0, 0.0, -1.0])
    pushing = [0.1 if nozzle.direction[2] < -0.5 else 0.0 for nozzle in VEHICLE.propulsion.nozzles]
    while not flown.ended and flown.t < 10.0:
        flown.command(flown.t, pushing)
        flown.advance(flown.t + 0.1)
    contact, impulse = flown.truth.contact, flown.truth.impulse_ns
    assert contact is not None
    assert contact.docked
    assert impulse == pytest.approx(4 * 0.025 * (contact.t - 0.003), rel=1e-6)
    assert flown.truth.velocity == STILL
    held = flown.truth
    flown.readings()
    flown.command(flown.t, only(4, 0.1))
    flown.advance(flown.t + 5.0)
    assert replace(flown.truth, t=held.t) == held
    assert len([r for r in flown.readings() if isinstance(r, GyroReading)]) == 500


def test_a_valve_that_was_to_open_after_the_contact_stays_shut():
    def coasting() -> CubesatSimulation:
        flown = CubesatSimulation(as_designed(), calm(position=(1.0, 1.899, 1.0), quaternion=AIM), 1)
        flown.command(0.0, [0.1 if nozzle.direction[2] < -0.5 else 0.0 for nozzle in VEHICLE.propulsion.nozzles])
        flown.advance(0.15)
        return flown

    touching, late = coasting(), coasting()
    touching.advance(2.0)
    contact = touching.truth.contact
    late.advance(contact.t - 0.001)  # the valves are 3 ms late
    late.command(late.t, only(4, 0.1))
    late.advance(2.0)
    assert late.truth.contact.t == pytest.approx(contact.t, abs=1e-6)
    assert late.truth.openings == touching.truth.openings == 4


@pytest.mark.parametrize(("world", "seed"), [(DOCKING, 1), (DOCKING, 2), (SURVEYED, 3)])
def test_a_controller_that_sees_the_truth_docks(world, seed):
    flown = fly(VEHICLE, world, seed)
    contact = flown.truth.contact
    assert contact is not None
    place, turn, impulse = math.hypot(*contact.position_error), contact.attitude_error, flown.truth.impulse_ns
    logging.getLogger(__name__).info(
        "%s, seed %d: %.1f s, %.3f N s, %.2f mm, %.1f mrad",
        world.name,
        seed,
        contact.t,
        impulse,
        1e3 * place,
        1e3 * turn,
    )
    assert contact.docked
    assert place < 0.001
    assert turn < 0.01
    assert 100.0 < contact.t < 130.0
    assert impulse < 0.4
