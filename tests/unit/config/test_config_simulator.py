"""The simulator's configuration says what the simulator does."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from companion.config import load_flight

ROOT = Path(__file__).parents[3]
FLIGHT = load_flight(ROOT / "missions" / "land_static.yaml")
SIMULATED = yaml.safe_load((ROOT / "sitl_stub" / "vehicles" / "x500.yaml").read_text())


def test_the_calibration_is_the_simulated_camera() -> None:
    camera = SIMULATED["camera"]
    for name in ("width", "height", "fx", "fy", "cx", "cy"):
        assert getattr(FLIGHT.camera, name) == camera[name], name
    assert np.array_equal(FLIGHT.camera.distortion, camera["distortion"])


def test_mount_and_latency_are_the_simulated_ones() -> None:
    camera = SIMULATED["camera"]
    section = FLIGHT.config.camera
    assert section.mount.position_frd_m == tuple(camera["mount_position_frd_m"])
    # the stub's latency counts from the middle of the exposure, as ours does
    assert section.latency_s == pytest.approx(camera["latency_s"])


def test_the_gear_is_the_simulated_one() -> None:
    assert FLIGHT.config.vehicle.multicopter.gear_height == SIMULATED["gear"]["foot_down_m"]
