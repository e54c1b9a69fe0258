"""The stub's rover beside recordings of PX4's, where they are."""

import math

import numpy as np
import pytest

from sitl_stub.fidelity.__main__ import EXTRACT, REFERENCE
from sitl_stub.fidelity.experiments import Reference
from sitl_stub.fidelity.rover import EAST_AXES, MEAN_DRAG, NORTH_AXES, Beside, evened
from sitl_stub.fidelity.rover_drive import PLACE, DriveError, read_drive, replay
from sitl_stub.fidelity.row import never_in_either, within
from sitl_stub.vehicle.kinds import load_vehicle

recordings = pytest.mark.skipif(not REFERENCE.is_dir(), reason="no reference recordings here")


@recordings
def test_every_figure_is_inside_its_tolerance():
    rows = list(Reference(folder=REFERENCE).rows("r0"))
    assert len(rows) == 162
    assert [row for row in rows if not row.passed] == []


def test_the_committed_drive_is_inside_its_tolerance():
    rows = list(Reference(folder=EXTRACT).rows("r0"))
    assert len(rows) > 10
    assert [row for row in rows if not row.passed] == []


@recordings
def test_replay_repeats_and_the_errors_of_the_estimate_change_it():
    recorded, inputs = read_drive(REFERENCE, "r05_posctl_offboard_mix")
    vehicle = load_vehicle("sih_rover")

    def place(seed: int, *, noise: bool) -> np.ndarray:
        return replay(recorded, inputs, vehicle, seed=seed, noise=noise).series[PLACE]

    exact, noisy = place(1, noise=False), place(1, noise=True)
    assert np.array_equal(noisy, place(1, noise=True))
    assert not np.array_equal(noisy, exact)
    assert np.max(np.abs(noisy[:, 1:3] - exact[:, 1:3])) < 5.0


@recordings
def test_another_vehicle_is_noticed():
    recorded, inputs = read_drive(REFERENCE, "r02_velocity")
    beside = Beside(recorded, replay(recorded, inputs, load_vehicle("rover"), seed=1, noise=False))
    assert not beside.peak_speed("setpoint loss").passed


def test_evened_speeds_are_the_same_in_all_directions_for_sihs_drag():
    """Speeds whose drag, taken axis by axis, balances the same force come out equal."""
    force, places = 100.0, []
    for course in np.linspace(0.0, 2.0 * math.pi, 13):
        axes = math.cos(course) * np.array(NORTH_AXES) + math.sin(course) * np.array(EAST_AXES)
        speed = math.sqrt(force / (50.0 * float(np.sum(np.abs(axes) ** 3))))
        places.append([0.0, 0.0, 0.0, speed * math.cos(course), speed * math.sin(course)])
    assert evened(np.array(places)) == pytest.approx(math.sqrt(force / (50.0 * MEAN_DRAG)), rel=1e-3)


def test_a_figure_that_neither_reaches_agrees_and_one_that_only_one_reaches_does_not():
    nan = math.nan
    assert never_in_either("").passed
    assert not within("", nan, 1.0, margin=9.0).passed
    assert not within("", 1.0, nan, margin=9.0).passed
    assert not within("", 1.2, 1.0, margin=0.1).passed


def test_a_missing_recording_is_named(tmp_path):
    with pytest.raises(DriveError, match="r09_nothing"):
        read_drive(tmp_path, "r09_nothing")
