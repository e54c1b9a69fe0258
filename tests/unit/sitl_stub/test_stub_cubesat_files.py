"""Files of the docking simulator: what they say, and how clearly the wrong ones are refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from stub_cubesat_support import DOCKING, SURVEYED, VEHICLE

from sitl_stub.cubesat.rotation import matrix_of
from sitl_stub.cubesat.vehicle import CubesatVehicle
from sitl_stub.cubesat.world import WORLDS, DockingWorld
from sitl_stub.vehicle.config import VEHICLES, VehicleFileError
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.world.documents import WorldFileError

VEHICLE_TEXT = (VEHICLES / "cubesat.yaml").read_text(encoding="utf-8")
WORLD_TEXT = (WORLDS / "docking.yaml").read_text(encoding="utf-8")


def changed(folder: Path, text: str, old: str, new: str) -> Path:
    assert text.count(old) >= 1
    path = folder / "changed.yaml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def test_orientations_are_read_as_the_paper_prints_them():
    about_x = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # 90 degrees
    about_z = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert np.array(matrix_of(DOCKING.target.quaternion)) == pytest.approx(about_x @ about_z, abs=1e-12)
    assert np.array(matrix_of(DOCKING.chaser.quaternion)) == pytest.approx(np.eye(3))


def test_docking_is_the_papers_and_the_surveyed_one_differs_in_what_fails():
    assert DOCKING.anchors == ((1.0, -0.2, 0.5), (1.0, 0.2, -0.5), (-1.0, 0.2, -0.5), (-1.0, -0.2, 0.5))
    assert VEHICLE.radio.position == (0.05, 0.05, 0.0)
    assert math.dist(DOCKING.chaser.position, (1.0, 1.9, 1.0)) == pytest.approx(1.676, abs=1e-3)
    assert DOCKING.survey.anchor_std == DOCKING.faults.dropout_interval == DOCKING.faults.lost_pictures == 0.0
    assert (SURVEYED.anchors, SURVEYED.target, SURVEYED.chaser) == (DOCKING.anchors, DOCKING.target, DOCKING.chaser)
    assert (SURVEYED.docked, SURVEYED.initial_estimate) == (DOCKING.docked, DOCKING.initial_estimate)
    assert SURVEYED.survey.anchor_std == SURVEYED.survey.target_position_std == 0.005
    assert SURVEYED.survey.target_attitude_std == pytest.approx(math.radians(0.5))
    assert SURVEYED.faults.dropout == 1.0
    assert SURVEYED.faults.dropout_interval > 0.0
    assert SURVEYED.faults.lost_pictures > 0.0


def test_the_camera_looks_out_of_the_docking_face_with_its_picture_upright():
    assert np.array(VEHICLE.camera.d_from_cam) == pytest.approx(np.diag([1.0, -1.0, -1.0]))


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("mass_kg: 2.0", "mass_kg: 0.0", "body.mass_kg: 0.0 must be greater than 0"),
        ("0.0035, 0.0035, 0.0033]", "0.0035, 0.0035, 0.0073]", "no rigid body has this tensor"),
        ("on_time_min_s: 0.010", "on_time_min_s: 0.2", "on_time_min_s: must be less than period_s"),
        ("valve_delay_s: 0.003", "valve_delay_s: 0.1", "valve_delay_s: must be less than period_s"),
        ("direction: [-1.0, 0.0, 0.0]", "direction: [0.0, 0.0, 0.0]", "must have a length above zero"),
        ("right_axis: [1.0, 0.0, 0.0]", "right_axis: [1.0, 0.0, 1.0]", "must be at right angles to optical_axis"),
        ("distance_m: [0.02, 1.0]", "distance_m: [1.0, 0.02]", r"must be \[nearest, farthest\]"),
        ("kind: cubesat", "kind: rover", "must be cubesat"),
        ("thrust_std: 0.05", "thrust_sdt: 0.05", "thrust_std' is missing"),
        ("rate_hz: 100.0", "rate_hz: fast", "'fast' is no number"),
        ("side_m: 0.1", "side_m: 0.1\n  colour: red", "unknown key; known here"),
        ("version: 1", "version: 2", "must be at most 1"),
    ],
)
def test_a_wrong_vehicle_file_is_refused_in_place(tmp_path, old, new, complaint):
    with pytest.raises(WorldFileError, match=complaint) as caught:
        CubesatVehicle.load(changed(tmp_path, VEHICLE_TEXT, old, new))
    assert "changed.yaml:" in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("[0.035, 0.035, 0.05]", "[0.035, 0.035, 0.04]", "must lie on the docking face"),
        ("[0.0, 1.0, 0.0]        #", "[1.0, 1.85, 1.0]      #", "starts inside or beside the target"),
        ("outlier_share: 0.05", "outlier_share: 1.5", "must be at most 1"),
        ("outlier_m: [0.15, 1.0]", "outlier_m: [1.0, 0.15]", r"must be \[least, largest\]"),
        ("position_error_max_m: 0.015", "position_error_max_m: -1", "must be greater than 0"),
        ("attitude_deg: [-90.0, 0.0, -90.0]", "attitude_deg: [-90.0, 0.0]", "must be a list of 3 numbers"),
        ("anchors: ", "beacons: ", "anchors|beacons: unknown key"),
    ],
)
def test_a_wrong_world_file_is_refused_in_place(tmp_path, old, new, complaint):
    with pytest.raises(WorldFileError, match=complaint) as caught:
        DockingWorld.load(changed(tmp_path, WORLD_TEXT, old, new))
    assert "changed.yaml:" in str(caught.value)


def test_names_that_nobody_knows_are_answered_with_those_that_are():
    with pytest.raises(
        WorldFileError, match=r"no docking world 'moon'.*docking, docking_hard, docking_hull, docking_surveyed"
    ):
        DockingWorld.load("moon")
    with pytest.raises(WorldFileError, match=r"moon\.yaml: cannot be read"):
        CubesatVehicle.load("moon")


def test_the_autopilots_simulator_refuses_a_cubesat_by_its_kind():
    with pytest.raises(VehicleFileError, match="unknown kind 'cubesat'; known: multicopter"):
        load_vehicle("cubesat")


def test_a_misspelt_name_is_answered_with_what_was_probably_meant():
    with pytest.raises(WorldFileError, match=r"no docking world 'dockng': did you mean docking\?$"):
        DockingWorld.load("dockng")
