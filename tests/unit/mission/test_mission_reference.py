"""docs/missions.md explains every key."""

from __future__ import annotations

import dataclasses
import re
from enum import Enum
from pathlib import Path

import pytest

from companion.mission import load_mission
from companion.mission.docking import DOCKING_STEPS, DockingDocument, DockingLimits, DockingSimulation
from companion.mission.schema import STEP_TYPES, Limits, MissionDocument, OnTargetLost

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "docs" / "missions.md").read_text(encoding="utf-8")


def section(title: str, end: str) -> str:
    return TEXT.split(title, 1)[1].split(end, 1)[0]


STEPS = {**STEP_TYPES, **DOCKING_STEPS}


@pytest.mark.parametrize("kind", list(STEPS))
def test_every_key_of_a_step_has_a_row_with_its_default(kind: str) -> None:
    rows = section(f"**{kind}**:", "\n**").split("\n## ", 1)[0]
    for item in dataclasses.fields(STEPS[kind]):
        row = re.search(rf"^\| `{item.name}` \| ([^|]*) \|", rows, re.MULTILINE)
        assert row is not None, item.name
        default = item.default.value if isinstance(item.default, Enum) else item.default
        if isinstance(default, bool | int | float | str):
            assert row.group(1).strip("`") == str(default).lower(), item.name


@pytest.mark.parametrize(
    ("type_", "title"),
    [
        (MissionDocument, "## Keys of a mission"),
        (DockingDocument, "## Docking missions"),
        (Limits, "## Limits"),
        (OnTargetLost, "## When the target is out of sight"),
    ],
)
def test_every_other_key_has_a_row(type_: type, title: str) -> None:
    rows = section(title, "\n## ")
    for item in dataclasses.fields(type_):
        assert re.search(rf"^\| `{item.name}[`.]", rows, re.MULTILINE), item.name


@pytest.mark.parametrize(("key", "type_"), [("simulation", DockingSimulation), ("limits", DockingLimits)])
def test_every_key_within_a_docking_missions_sections_has_a_row(key: str, type_: type) -> None:
    rows = section("## Docking missions", "\n## ")
    for item in dataclasses.fields(type_):
        assert f"| `{key}.{item.name}` |" in rows, item.name


def test_the_mission_shown_is_valid(tmp_path) -> None:
    shown = re.search(r"```yaml\n(version.*?)```", TEXT, re.DOTALL)
    assert shown is not None
    path = tmp_path / "m.yaml"
    path.write_text(shown.group(1))
    assert len(load_mission(path).steps) == 3
