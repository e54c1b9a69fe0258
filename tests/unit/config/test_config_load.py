import json
import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from companion.config import Config, dump, fingerprint, load_config, load_flight
from companion.config.load import is_spacecraft
from companion.config.schema import schema_texts
from companion.config.sections import MountSection
from companion.documents import load_document
from companion.errors import InputError
from companion.mission.docking import names_docking

ROOT = Path(__file__).parents[3]
CONFIGS = sorted(path for path in (ROOT / "config").glob("*.yaml") if not is_spacecraft(load_document(path)))
MISSION = ROOT / "missions" / "land_static.yaml"
MISSIONS = sorted(path for path in (ROOT / "missions").glob("*.yaml") if not names_docking(path))


@pytest.mark.parametrize("path", CONFIGS, ids=lambda p: p.stem)
def test_every_configuration_of_the_project_loads(path: Path) -> None:
    config = load_config(path)
    assert config.camera.calibration.is_file()
    assert path.read_text().startswith("# yaml-language-server: $schema=schema/config.schema.json\n")


@pytest.mark.parametrize("path", MISSIONS, ids=lambda p: p.stem)
def test_every_mission_of_the_project_is_ready_to_fly(path: Path) -> None:
    flight = load_flight(path)
    assert len(flight.pad.ids) > 0
    assert flight.camera.width == 640


@pytest.mark.parametrize("name", sorted(schema_texts()))
def test_the_written_schemas_are_fresh(name: str) -> None:
    written = (ROOT / "config" / "schema" / name).read_text(encoding="utf-8")
    assert written == schema_texts()[name], "run `python -m companion.config.schema`"


def test_schemas_are_strict_json_with_a_description_of_each_key() -> None:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    for text in schema_texts().values():
        schema = json.loads(text, parse_constant=refuse)
        assert schema["additionalProperties"] is False
        assert all("description" in value for value in schema["properties"].values())


@pytest.mark.parametrize("name", ["docking.schema.json", "spacecraft.schema.json"])
def test_schemas_of_dockings_describe_every_nested_key(name: str) -> None:
    schema = json.loads(schema_texts()[name])
    bare = [
        f"{definition}.{key}"
        for definition, body in schema["$defs"].items()
        for key, value in body.get("properties", {}).items()
        if "description" not in value
    ]
    assert bare == []


def test_the_effective_configuration_reads_back_as_itself(tmp_path) -> None:
    config = load_config(CONFIGS[0])
    path = tmp_path / "effective.yaml"
    path.write_text(dump(config))
    again = load_config(path)
    assert again == config
    assert fingerprint(again) == fingerprint(config)


def test_the_fingerprint_tells_values_not_spelling(tmp_path) -> None:
    config = load_config(CONFIGS[0])
    assert f"sha256 {fingerprint(config)}" in dump(config).splitlines()[0]
    assert fingerprint(load_config(CONFIGS[0], ["camera.latency_s=0.0400"])) == fingerprint(
        load_config(CONFIGS[0], ["camera.latency_s=4e-2"])
    )
    assert fingerprint(load_config(CONFIGS[0], ["camera.latency_s=0.0401"])) != fingerprint(config)


def test_dump_is_plain_yaml_without_infinities() -> None:
    data = yaml.safe_load(dump(load_config(CONFIGS[0])))

    def leaves(value):
        if isinstance(value, dict):
            for item in value.values():
                yield from leaves(item)
        elif isinstance(value, list):
            for item in value:
                yield from leaves(item)
        else:
            yield value

    assert all(math.isfinite(leaf) for leaf in leaves(data) if isinstance(leaf, float))


def test_calibration_counts_from_the_file_and_from_set_from_the_current_directory() -> None:
    path = ROOT / "config" / "x500_sim.yaml"
    assert load_config(path).camera.calibration == ROOT / "config" / "cameras" / "sim_640x480.yaml"
    assert load_config(path, ["camera.calibration=a/b.yaml"]).camera.calibration == Path("a/b.yaml")


@pytest.mark.parametrize(
    ("mount", "ray_cam", "ray_frd"),
    [
        (MountSection(), (0, 0, 1), (0, 0, 1)),  # looks down
        (MountSection(), (0, -1, 0), (1, 0, 0)),  # the picture's top is towards the nose
        (MountSection(), (1, 0, 0), (0, 1, 0)),  # the picture's right is the vehicle's right
        (MountSection(pitch_deg=90.0), (0, 0, 1), (1, 0, 0)),  # positive pitch looks forward
        (MountSection(roll_deg=90.0), (0, 0, 1), (0, -1, 0)),  # positive roll looks to the left
        (MountSection(yaw_deg=90.0), (0, -1, 0), (0, 1, 0)),  # positive yaw turns the top to the right
    ],
)
def test_mount_turns_the_camera_as_documented(mount: MountSection, ray_cam, ray_frd) -> None:
    assert np.allclose(mount.frd_from_cam.rotation @ np.array(ray_cam, dtype=float), ray_frd, atol=1e-12)


def test_mount_position_is_the_optical_centre() -> None:
    mount = MountSection(position_frd_m=(0.06, 0.0, 0.04))
    assert mount.frd_from_cam.apply(np.zeros(3)) == pytest.approx((0.06, 0.0, 0.04))


def problems_of(*overrides: str, mission: Path = MISSION, config: Path | None = None) -> list[str]:
    with pytest.raises(InputError) as caught:
        load_flight(mission, config_path=config, overrides=overrides)
    return [str(problem) for problem in caught.value.problems]


def test_overrides_find_their_file_by_the_first_key() -> None:
    flight = load_flight(
        MISSION, overrides=["steps.0.takeoff.height_m=3", "camera.latency_s=0.1", "guidance.descent.speed_mps=0.4"]
    )
    assert flight.plan.takeoff_height_m == 3.0
    assert flight.config.camera.latency_s == 0.1
    assert flight.config.guidance.descent.speed_mps == 0.4
    (line,) = problems_of("gidance.descent.speed_mps=1")
    assert "did you mean guidance?" in line


def fence_inside(config: Config, name: str) -> float:
    fence = config.guardian.fence
    return float(getattr(fence, name)) - fence.margin


@pytest.mark.parametrize(
    ("limit", "value", "effects"),
    [
        ("speed_mps", 1.1, [lambda c: c.vehicle.multicopter.speed_horizontal]),
        ("speed_up_mps", 0.5, [lambda c: c.vehicle.multicopter.speed_up]),
        ("speed_down_mps", 0.4, [lambda c: c.vehicle.multicopter.speed_down]),
        ("acceleration_mps2", 0.7, [lambda c: c.vehicle.multicopter.acceleration_horizontal]),
        (
            "closing_speed_mps",
            0.6,
            [lambda c: c.vehicle.multicopter.closing_speed, lambda c: c.guardian.closing_speed],
        ),
        ("height_m", 5.0, [lambda c: fence_inside(c, "height_max")]),
        ("radius_m", 20.0, [lambda c: fence_inside(c, "radius")]),
    ],
)
def test_the_mission_tightens_the_configuration(limit: str, value: float, effects) -> None:
    config = load_flight(MISSION, overrides=[f"limits.{limit}={value}"]).config
    assert [effect(config) for effect in effects] == [value] * len(effects)


@pytest.mark.parametrize("section", ["guardian", "vehicle.multicopter"])
def test_the_smaller_of_both_closing_speeds_counts(section: str) -> None:
    (line,) = problems_of(f"{section}.closing_speed=0.5", "limits.closing_speed_mps=0.6")
    assert "0.6 is more than the configuration allows, which is 0.5" in line


def test_the_mission_chooses_the_descent() -> None:
    assert load_flight(MISSION, overrides=["steps.2.land.descent_mps=0.3"]).config.guidance.descent.speed_mps == 0.3


def test_cone_angle_becomes_radians() -> None:
    flight = load_flight(MISSION, overrides=["steps.2.land.cone_half_angle_deg=30"])
    assert flight.config.guidance.descent.cone_half_angle_rad == pytest.approx(math.pi / 6.0)


def test_without_limits_the_configuration_is_untouched() -> None:
    flight = load_flight(MISSION)
    assert flight.config == load_config(flight.config_source)


def test_problems_of_all_files_are_reported_at_once(tmp_path) -> None:
    (tmp_path / "m.yaml").write_text(
        "version: 1\nname: x\nconfig: c.yaml\ntarget: {pad: p.yaml}\nsteps: [takeoff, fly]\n"
    )
    (tmp_path / "c.yaml").write_text(
        "version: 1\nname: x\nvehicle: {type: plane}\ncamera: {source: a, calibration: k}\n"
    )
    (tmp_path / "p.yaml").write_text("version: 1\nname: x\nfamily: 36h11\nsize_m: [-1, 1]\ntags: []\n")
    found = problems_of(mission=tmp_path / "m.yaml")
    assert [line.split(":", 1)[0].rsplit("/", 1)[-1] for line in found] == ["m.yaml", "p.yaml", "p.yaml", "c.yaml"]
    assert 'found the text "plane"; it must be one of multicopter, rover, free_flyer' in found[-1]


def test_the_link_is_checked() -> None:
    (line,) = problems_of("link.url=udp//:14540")
    assert line.startswith("--set link.url=udp//:14540: link.url: 'udp//:14540'")


@pytest.mark.parametrize("url", ["tcp://127.0.0.1:5760", "serial:///dev/ttyHS1", "udp://somewhere:14550"])
def test_a_ground_station_of_its_own_is_an_address_for_udp(url) -> None:
    (line,) = problems_of(f"link.ground_station={url}")
    assert line.startswith(f"--set link.ground_station={url}: link.ground_station: ")
    assert load_flight(MISSION, overrides=["link.ground_station=udp://127.0.0.1:14560"])


def test_a_missing_file_is_reported_where_it_is_named(tmp_path) -> None:
    (tmp_path / "m.yaml").write_text(
        "version: 1\nname: x\nconfig: c.yaml\ntarget:\n  pad: nope.yaml\nsteps: [takeoff, land]\n"
    )
    found = problems_of(mission=tmp_path / "m.yaml")
    assert len(found) == 2
    assert ":3:9: config: " in found[0]
    assert ":5:8: target.pad: " in found[1]
    assert all("no such file" in line for line in found)


def test_where_a_path_counts_from_depends_on_where_it_is_written(tmp_path) -> None:
    written = "version: 1\nname: x\nconfig: no/c.yaml\ntarget: {pad: no/p.yaml}\nsteps: [takeoff, land]\n"
    (tmp_path / "m.yaml").write_text(written)
    found = problems_of(mission=tmp_path / "m.yaml")
    assert len(found) == 2
    assert all(
        line.endswith(f"no directory {tmp_path}/no either; paths in m.yaml count from its folder") for line in found
    )
    (line,) = problems_of("target.pad=no/p.yaml")
    assert line.endswith("there is no directory no either; paths count from the current directory")


def test_another_configuration_can_be_chosen() -> None:
    flight = load_flight(MISSION, config_path=ROOT / "config" / "x500_voxl2.yaml")
    assert flight.config.link.url == "udp://127.0.0.1:14551"
    (line,) = problems_of(config=Path("nope.yaml"))
    assert line.startswith("nope.yaml: no such file")


def test_the_key_of_the_link_is_checked_where_it_is_named(tmp_path) -> None:
    sim = ROOT / "config" / "x500_sim.yaml"
    text = sim.read_text().replace("cameras/sim_640x480.yaml", str(ROOT / "config" / "cameras" / "sim_640x480.yaml"))
    path = tmp_path / "c.yaml"
    path.write_text(text.replace("link:\n", "link:\n  signing: {key_file: keys/mine}\n"))
    (line,) = problems_of(config=path)
    assert line.startswith(f"{path}:16:23: link.signing.key_file: {tmp_path}/keys/mine: the key cannot be read")
    key = tmp_path / "keys" / "mine"
    key.parent.mkdir()
    key.write_text("5a" * 32)
    key.chmod(0o600)
    assert load_flight(MISSION, config_path=path).config.link.signing.key_file == key
