"""Directions, mirror images, sight and boxes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from companion.geometry.transform import RigidTransform
from companion.perception.docking_port import load_port
from companion.placement.geometry import (
    directions,
    eigenvalues,
    flatness,
    information,
    mirror_distance,
    on_one_line,
    position_dilution,
)
from companion.placement.mounting import Box, Mounting, box_round
from companion.placement.sight import SightParameters, sees_port
from sitl_stub.cubesat.sensors import Camera
from sitl_stub.cubesat.simulation import CubesatSimulation
from sitl_stub.cubesat.vehicle import CubesatVehicle
from sitl_stub.cubesat.world import DockingWorld

ROOT = Path(__file__).resolve().parents[3]
PAPER = np.array([[1.0, -0.2, 0.5], [1.0, 0.2, -0.5], [-1.0, 0.2, -0.5], [-1.0, -0.2, 0.5]])
TETRAHEDRON = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
BOX = box_round(PAPER)


def test_the_eigenvalues_are_those_of_the_matrices() -> None:
    dice = np.random.default_rng(1)
    anchors, places = dice.normal(size=(5, 3)), dice.normal(size=(50, 3))
    u = directions(anchors, places)
    expected = np.linalg.eigvalsh(np.einsum("npi,npj->pij", u, u)).T
    assert eigenvalues(information(anchors, places).sum(axis=0)) == pytest.approx(expected, abs=1e-9)


def test_the_dilution_in_the_middle_of_a_tetrahedron_is_three_halves() -> None:
    """H'H = 4/3 I, so sqrt(3 * 3/4)."""
    assert position_dilution(TETRAHEDRON, np.zeros(3)) == pytest.approx(1.5)
    assert position_dilution(PAPER, np.array([3.0, 0.2, -0.5])) == math.inf


def test_the_mirror_image_of_a_plane_of_anchors_has_the_same_ranges() -> None:
    place = np.array([0.3, 1.0, 0.7])
    distance = mirror_distance(PAPER, place)
    normal = np.array([0.0, 2.5, 1.0]) / math.hypot(2.5, 1.0)
    image = place - distance * normal
    assert np.linalg.norm(PAPER - image, axis=1) == pytest.approx(np.linalg.norm(PAPER - place, axis=1))
    assert mirror_distance(TETRAHEDRON, place) == math.inf
    assert mirror_distance(PAPER[:3], place) == pytest.approx(distance)


def test_lines_and_planes_are_told() -> None:
    assert on_one_line(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0.01, 0]]))
    assert on_one_line(PAPER[:2])
    assert not on_one_line(PAPER)
    assert flatness(PAPER) == pytest.approx(0.0, abs=1e-12)
    assert flatness(TETRAHEDRON) == pytest.approx(1.0)
    assert flatness(np.stack([PAPER, TETRAHEDRON])) == pytest.approx([0.0, 1.0], abs=1e-12)


def test_the_camera_sees_what_the_simulated_one_sees() -> None:
    port = load_port(ROOT / "config/docks/cubesat_port.yaml")
    vehicle, world = CubesatVehicle.load("cubesat"), DockingWorld.load("docking")
    target = CubesatSimulation(vehicle, world, 1).target
    dice = np.random.default_rng(3)
    camera = Camera(vehicle.camera, world.faults, target, world.target.markers, 0.05, dice, dice)
    mount = RigidTransform(rotation=np.array(vehicle.camera.d_from_cam), translation=np.array(vehicle.camera.position))
    counts = [0, 0]
    for _ in range(300):
        position = port.position + dice.uniform(-1.0, 1.0, 3) * (0.5, 1.1, 0.5)
        quaternion = port.quaternion + 0.15 * dice.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        w, x, y, z = quaternion.tolist()
        a, b, c = position.tolist()
        simulated = bool(camera.in_sight((a, b, c), (w, x, y, z)))
        counts[simulated] += 1
        assert sees_port(SightParameters(), mount, port, position, quaternion) == simulated
    assert min(counts) > 20


def test_a_box_in_the_way_is_noticed() -> None:
    box = Box(low=np.array([-1.0, -0.2, -0.5]), high=np.array([1.0, 0.2, 0.5]))
    port = np.array([1.0, 1.9, 1.0])
    assert box.lies_between(np.array([0.0, -1.0, -0.5]), port)
    assert not box.lies_between(np.array([0.0, 1.0, 0.0]), port)
    assert not box.lies_between(np.array([0.0, -1.0, 0.0]), np.array([0.0, -0.3, 0.0]))
    assert box.lies_between(np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    assert not box.lies_between(np.array([1.5, -1.0, 0.0]), np.array([1.5, 1.0, 0.0]))


def test_anchors_may_stand_on_the_faces_that_are_allowed() -> None:
    mounting = Mounting(box=BOX, faces=("x+", "z-"))
    places = mounting.candidates()
    assert len(places) > 20
    on_x, on_z = places[:, 0] == 1.0, places[:, 2] == -0.5
    assert np.all(on_x | on_z)
    assert on_x.any()
    assert on_z.any()
    assert np.all(mounting.on_face(mounting.nearest(np.array([[0.0, 0.0, 0.0], [0.99, 5.0, 0.4], [-3.0, 0.0, 3.0]]))))


def test_sets_too_near_or_in_a_plane_are_refused() -> None:
    mounting = Mounting(box=BOX)
    corners = np.array([[1.0, 0.2, 0.5], [1.0, -0.2, -0.5], [-1.0, 0.2, -0.5], [-1.0, -0.2, 0.5]])
    near = corners.copy()
    near[1] = near[0] - (0.0, 0.1, 0.0)
    assert mounting.admits(np.stack([corners, near, PAPER])).tolist() == [True, False, False]
    flat = Mounting(box=Box(low=np.array([-3.0, -3.0, 0.0]), high=np.array([3.0, 3.0, 0.0])))
    assert flat.admits(np.array([[[3.0, 3, 0], [3, -3, 0], [-3, 3, 0], [-3, -3, 0]]])).tolist() == [True]


@pytest.mark.parametrize(
    "wrong",
    [
        {"count": 2},
        {"count": 9},
        {"faces": ("top",)},
        {"faces": ()},
        {"spacing": 0.0},
        {"box": Box(low=np.zeros(3), high=np.array([1.0, 0.0, 0.0]))},
    ],
)
def test_a_mounting_that_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"anchors|faces|spacing|box"):
        Mounting(**{"box": BOX, **wrong})  # type: ignore[arg-type]
