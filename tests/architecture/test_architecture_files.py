"""The files that belong together: missions, configurations, pads, documents, the service's unit."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from companion.campaign.spec import load_campaign
from companion.cli.check import wrong_with_world
from companion.cli.main import VERBS, main
from companion.config import load_config, load_flight
from companion.config.docking import load_docking
from companion.config.load import is_spacecraft
from companion.documents import load_document
from companion.errors import InputError
from companion.mission.docking import names_docking
from companion.perception.calibration_file import load_calibration
from companion.perception.pad_file import load_pad
from companion.ranging.parameters import NO_INPUT
from sitl_stub.cubesat.world import DockingWorld

ROOT = Path(__file__).resolve().parents[2]
ALL_MISSIONS = sorted((ROOT / "missions").rglob("*.yaml"))
DOCKINGS = [path for path in ALL_MISSIONS if names_docking(path)]
MISSIONS = [path for path in ALL_MISSIONS if path not in DOCKINGS]
CONFIGURATIONS = sorted(path for path in (ROOT / "config").glob("*.yaml") if not is_spacecraft(load_document(path)))
DOCUMENTS = sorted([*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")])
SHIPPED = ("missions", "companion", "sitl_stub", "config", "docs", "bench", "tests")
MENTION = re.compile(
    rf"(?<![\w/.-])((?:{'|'.join(SHIPPED)})/[\w./-]+\.(?:py|yaml|md|json|toml|service|gz))(?![\w*<{{])"
)


def tracked() -> list[Path]:
    """Give the files of the project: what git knows, or, in an unpacked copy, what lies in its folders."""
    known = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if known.returncode == 0 and known.stdout:
        return [path for name in known.stdout.splitlines() if (path := ROOT / name).is_file()]
    kept = ("*.py", "*.md", "*.yaml", "*.toml", "*.json", "*.service")
    return [path for folder in SHIPPED for kind in kept for path in (ROOT / folder).rglob(kind)]


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_there_is_something_to_look_at() -> None:
    assert {path.stem for path in MISSIONS} >= {"land_static", "land_moving", "follow_then_land"}
    assert {path.stem for path in CONFIGURATIONS} >= {"x500_sim", "x500_voxl2"}
    assert len(tracked()) > 100


@pytest.mark.parametrize("path", MISSIONS, ids=name_of)
def test_each_mission_is_in_order_with_all_that_it_names(path: Path) -> None:
    flight = load_flight(path, wrong_with_world=wrong_with_world)
    assert flight.plan.land is not None or flight.plan.ground is not None


@pytest.mark.parametrize("path", DOCKINGS, ids=name_of)
def test_each_docking_is_in_order_with_all_that_it_names(path: Path) -> None:
    docking = load_docking(path)
    assert len(docking.port.markers) >= 4
    assert DockingWorld.load(docking.mission.world).anchors


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=name_of)
def test_each_configuration_is_in_order(path: Path) -> None:
    config = load_config(path)
    assert load_calibration(config.camera.calibration).width > 0


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=name_of)
def test_each_configuration_flies_each_mission_of_its_kind(path: Path) -> None:
    kind = load_config(path).vehicle.type
    fitting = [m for m in MISSIONS if load_flight(m).config.vehicle.type is kind]
    assert fitting
    for mission in fitting:
        if needs_ranges(mission) and load_config(path).ranging.input == NO_INPUT:
            with pytest.raises(InputError, match="no ranging input"):
                load_flight(mission, config_path=path)
        else:
            load_flight(mission, config_path=path)


def needs_ranges(mission: Path) -> bool:
    transit = load_flight(mission).plan.transit
    return transit is not None and transit.by_ranges


def test_each_pad_and_calibration_is_in_order() -> None:
    assert all(load_pad(path).ids for path in (ROOT / "config" / "pads").glob("*.yaml"))
    assert all(load_calibration(path).height > 0 for path in (ROOT / "config" / "cameras").glob("*.yaml"))


def test_each_campaign_is_in_order() -> None:
    for path in (ROOT / "config" / "campaigns").glob("*.yaml"):
        for case in load_campaign(path).cases:
            for mission in case.missions:
                load_flight(mission)


@pytest.mark.parametrize("path", [path for path in tracked() if path.suffix in (".yaml", ".yml")], ids=name_of)
def test_each_yaml_file_can_be_read(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    opencv_dialect = text.startswith("%YAML:1.0")  # read by test_each_pad_and_calibration_is_in_order
    assert opencv_dialect or yaml.safe_load(text) is not None


@pytest.mark.parametrize("path", DOCUMENTS, ids=name_of)
def test_files_that_the_documents_mention_exist(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    mentioned = {ROOT / name for name in MENTION.findall(text) if not Path(name).stem.isupper()}  # NAME.yaml: any
    linked = {
        (path.parent / target).resolve()
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text)
        if "://" not in target and not target.startswith("mailto:")
    }
    missing = sorted(name_of(found) for found in mentioned | linked if not found.exists())
    assert missing == []


@pytest.mark.parametrize("path", DOCUMENTS, ids=name_of)
def test_commands_that_the_documents_mention_exist(path: Path) -> None:
    verbs = set(re.findall(r"`companion ([a-z]+)", path.read_text(encoding="utf-8")))
    assert verbs <= set(VERBS)


@pytest.mark.parametrize("path", DOCUMENTS, ids=name_of)
def test_targets_of_make_that_the_documents_mention_exist(path: Path) -> None:
    targets = set(re.findall(r"^([a-z0-9_-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"`make ([a-z0-9_-]+)", path.read_text(encoding="utf-8"))) <= targets


def test_each_package_has_its_page() -> None:
    packages = {path.parent.name for path in (ROOT / "companion").glob("*/__init__.py")}
    pages = {path.stem for path in (ROOT / "docs" / "components").glob("*.md")}
    assert sorted(packages - pages - {"cli", "geometry", "messages"}) == []


def test_no_path_of_one_machine_stands_in_the_project() -> None:
    home = re.compile(rb"(?<![\w.])/(?:home|Users)/[a-z]\w*/|(?<![\w.])/(?:work|root)/[\w.]")
    here = str(ROOT).encode() if len(ROOT.parts) > 2 else None
    found = []
    for path in tracked():
        if path.suffix in (".gz", ".png", ".jpg") or path == Path(__file__).resolve():
            continue
        data = path.read_bytes()
        if home.search(data) or (here is not None and here in data):
            found.append(name_of(path))
    assert found == []


def test_the_unit_starts_what_there_is() -> None:
    unit = (ROOT / "config" / "systemd" / "companion.service").read_text(encoding="utf-8")
    words = shlex.split(re.search(r"^ExecStart=(.*)$", unit, re.MULTILINE).group(1))  # type: ignore[union-attr]
    assert words[0].endswith("/companion")
    assert words[1] in VERBS
    assert "Type=notify" in unit
    assert "WatchdogSec=" in unit


@pytest.mark.parametrize("words", [["--version"], ["--help"], *([verb, "--help"] for verb in VERBS)], ids=" ".join)
def test_every_verb_explains_itself(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    try:
        code = main(words)
    except SystemExit as end:
        code = int(end.code or 0)
    assert code == 0
    assert capsys.readouterr().out.strip()


@pytest.mark.parametrize(
    ("module", "words", "text"),
    [
        ("companion", ["check", str(ROOT / "missions" / "land_static.yaml")], "all in order"),
        ("sitl_stub", ["--help"], "--world"),
    ],
)
def test_the_programs_run_as_modules_from_anywhere(module: str, words: list[str], text: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", module, *words], cwd=tmp_path, capture_output=True, text=True, timeout=60.0, check=False
    )
    assert done.returncode == 0, done.stderr
    assert text in done.stdout


def test_the_vehicle_needs_nothing_of_the_simulator() -> None:
    """`companion fly` runs where only the main dependencies are installed."""
    script = (
        "import sys\n"
        "for name in ('matplotlib', 'aiohttp', 'joblib', 'sitl_stub'):\n"
        "    sys.modules[name] = None\n"
        "import companion.cli.fly, companion.cli.check, companion.cli.detect\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 0, done.stderr
