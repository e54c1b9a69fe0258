"""World, pad and camera files: what is accepted, and how clearly the rest is refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.world.camera import CameraConfig
from sitl_stub.world.documents import WorldFileError
from sitl_stub.world.pads import find_pad, load_pad
from sitl_stub.world.world import WORLDS, World

TARGET = "{name: pad, pad: landing_pad_0p8, start: {north_m: 2, east_m: 0, heading_deg: 0}}"
PAD = """version: 1
name: small
family: 36h11
size_m: [0.4, 0.4]
tags:
  - {id: 3, size_m: 0.1, x_m: 0.1, y_m: 0.0}
"""
CAMERA = {"fx": 460, "fy": 460, "cx": 319.5, "cy": 239.5, "mount_position_frd_m": [0.06, 0.0, 0.04]}


def world_file(folder: Path, text: str) -> Path:
    path = folder / "world.yaml"
    path.write_text("version: 1\n" + text, encoding="utf-8")
    return path


@pytest.mark.parametrize("path", sorted(WORLDS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_world_that_comes_along_loads(path: Path) -> None:
    world = World.load(path.stem)
    assert len(world.targets) == (0 if path.stem == "flat_ground" else 1)
    assert world == World.load(path)


def test_wind_and_gusts_are_on_unless_calm_is_asked_for(tmp_path: Path) -> None:
    windy = World.load(world_file(tmp_path, "name: x\n")).wind
    assert windy.mean.low == windy.mean.high == 3.0
    assert windy.turbulence > 0.0
    assert math.isfinite(windy.gust_interval)
    calm = World.load(world_file(tmp_path, "wind: calm\n")).wind
    assert calm.mean.high == calm.turbulence == calm.vertical_turbulence == 0.0
    assert math.isinf(calm.gust_interval)


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("wnd: {mean_mps: 3}", 2, "unknown key"),
        ("wind: {mean_mps: -3}", 2, "at least 0"),
        ("wind: {mean_mps: .nan}", 2, "finite"),
        ("wind: {mean_mps: fast}", 2, "no number"),
        ("wind: {mean_mps: true}", 2, "no number"),
        ("wind: {mean_mps: [3, 2]}", 2, "must not be greater"),
        ("wind: {mean_mps: [1, 2, 3]}", 2, "[low, high]"),
        ("wind: stormy", 2, "mapping"),
        ("wind: {gusts: maybe}", 2, "true or false"),
        ("name: a\nname: b", 3, "stands twice"),
        ("name: ''", 2, "not empty"),
        ("light: {level: 0}", 2, "greater than 0"),
        ("camera: {lost_fraction: 1.5}", 2, "at most 1"),
        ("camera: {dropouts: [{at_s: 1}]}", 2, "'for_s' is missing"),
        ("targets: pad", 2, "must be a list"),
        ("targets: [pad]", 2, "mapping"),
        ("targets:\n  - " + TARGET.replace("north_m: 2, ", ""), 3, "'north_m' is missing"),
        ("targets:\n  - " + TARGET.replace("landing_pad_0p8", "nowhere"), 3, "no pad file"),
        ("targets:\n  - " + TARGET.replace("}}", "}, height_m: -1}"), 3, "greater than 0"),
        ("targets:\n  - " + TARGET.replace("}}", "}, colour: red}"), 3, "unknown key"),
        ("targets:\n  - " + TARGET.replace("name: pad", "name: ground"), 3, "is taken"),
        (f"targets:\n  - {TARGET}\n  - {TARGET}", 4, "is taken"),
        ("targets:\n  - " + TARGET.replace("}}", "}, motion: {kind: fly}}"), 3, "must be one of static"),
        ("targets:\n  - " + TARGET.replace("}}", "}, motion: {kind: straight}}"), 3, "'speed_mps' is missing"),
        ("targets:\n  - " + TARGET.replace("}}", "}, motion: {kind: static, speed_mps: 1}}"), 3, "unknown key"),
        ("a: &a [1]\nb: *a", 3, "aliases"),
        ("a: [1", 1, "no YAML"),
    ],
)
def test_a_wrong_world_is_refused_with_its_place(tmp_path: Path, text: str, line: int, says: str) -> None:
    path = world_file(tmp_path, text)
    with pytest.raises(WorldFileError) as caught:
        World.load(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)
    if line > 1:
        assert f":{line}:" in str(caught.value)


def test_an_unknown_world_names_the_known_ones() -> None:
    with pytest.raises(WorldFileError, match="static_pad"):
        World.load("marble_halls")


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WorldFileError, match="cannot be read"):
        World.load(tmp_path / "none.yaml")


def test_a_version_from_the_future_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "world.yaml"
    path.write_text("version: 2\n", encoding="utf-8")
    with pytest.raises(WorldFileError, match="at most 1"):
        World.load(path)


def test_a_pad_may_lie_beside_the_world(tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(PAD, encoding="utf-8")
    world = World.load(world_file(tmp_path, "targets:\n  - " + TARGET.replace("landing_pad_0p8", "small.yaml")))
    assert world.targets[0].pad.name == "small"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("id: 3", "id: 587", "at most 586"),
        ("size_m: 0.1,", "size_m: -0.1,", "greater than 0"),
        ("x_m: 0.1", "x_m: 0.18", "does not fit"),
        ("36h11", "25h9", "must be one of 36h11"),
        ("  - {id: 3", "  - {id: 3, size_m: 0.1, x_m: -0.1, y_m: 0.0}\n  - {id: 3", "stands twice"),
        ("tags:\n  - {id: 3, size_m: 0.1, x_m: 0.1, y_m: 0.0}", "tags: []", "at least one"),
        ("[0.4, 0.4]", "[0.4]", "list of 2"),
    ],
)
def test_a_wrong_pad_is_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    path = tmp_path / "pad.yaml"
    path.write_text(PAD.replace(old, new), encoding="utf-8")
    with pytest.raises(WorldFileError) as caught:
        load_pad(path)
    assert says in str(caught.value)


def test_the_default_pad_loads_with_all_tags() -> None:
    pad = load_pad(find_pad("landing_pad_0p8"))
    assert pad.size == (0.8, 0.8)
    assert sorted(tag.id for tag in pad.tags) == list(range(12))


def test_the_vehicles_camera_is_understood() -> None:
    camera = CameraConfig.from_mapping(VehicleConfig.load("x500").camera)
    assert (camera.intrinsics.width, camera.intrinsics.height) == (640, 480)
    assert camera.intrinsics.fx == 460.0
    assert (camera.rate, camera.latency, camera.exposure) == (30.0, 0.040, 0.004)
    assert camera.mount.position_frd.tolist() == [0.06, 0.0, 0.04]
    assert camera.mount.frd_from_cam.tolist() == [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"fx": -1}, "greater than 0"),
        ({"fx": math.nan}, "finite"),
        ({"width": 10}, "at least 16"),
        ({"width": 640.5}, "whole number"),
        ({"zoom": 2}, "unknown key"),
        ({"exposure_s": 0.05}, "does not fit between frames"),
        ({"distortion": [0.1]}, "list of 5"),
    ],
)
def test_a_wrong_camera_is_refused(change: dict[str, object], says: str) -> None:
    with pytest.raises(WorldFileError) as caught:
        CameraConfig.from_mapping({**CAMERA, **change})
    assert says in str(caught.value)
