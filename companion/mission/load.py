"""Read a mission file."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from companion.documents import (
    Document,
    in_order,
    json_schema,
    validate,
)
from companion.documents.nodes import ScalarNode, node_at
from companion.errors import InputError
from companion.mission.checks import check_output, check_steps, check_transit
from companion.mission.schema import STEP_TYPES, Mission, MissionDocument
from companion.mission.steps import open_steps

_KINDS = ", ".join(STEP_TYPES)


def load_mission(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Mission:
    """Read and check a mission.

    Args:
        path: the mission file.
        overrides: texts `a.b=value`, as from `--set`; paths in them count from the current directory.

    Raises:
        InputError: with every problem of the file.
    """
    return mission_from(open_mission(path, overrides))


def open_mission(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Document:
    """Read a mission file without checking its values.

    Raises:
        InputError: it cannot be read or is not YAML.
    """
    return open_steps(path, overrides, STEP_TYPES)


def mission_from(document: Document) -> Mission:
    """Check an opened mission.

    Raises:
        InputError: with every problem of the file.
    """
    written = validate(document, MissionDocument)
    steps = tuple(entry.step for entry in written.steps)
    problems = [
        *check_steps(document, steps),
        *check_transit(document, written.target.surveyed, steps),
        *check_output(document, written.output, steps),
    ]
    if problems:
        raise InputError(in_order(problems))
    return Mission(
        source=document.source,
        name=written.name,
        config=resolved(document, ("config",), written.config),
        pad=resolved(document, ("target", "pad"), written.target.pad),
        world=_world(document, written.simulation.world),
        wind_mps=written.simulation.wind_mps,
        dropout_s=written.simulation.dropout_s,
        interval_s=written.simulation.interval_s,
        corrupted_fraction=written.simulation.corrupted_fraction,
        limits=written.limits,
        on_target_lost=written.on_target_lost,
        output=written.output,
        steps=steps,
        surveyed=written.target.surveyed,
    )


def named_file(document: Document, path: tuple[str, ...]) -> Path | None:
    """Give the file that an opened mission names at `path`, None where no text stands there."""
    node = node_at(document.root, path)
    if isinstance(node, ScalarNode) and isinstance(node.value, str):
        return resolved(document, path, Path(node.value))
    return None


def named_world(document: Document) -> str | None:
    """Give the simulation's world that an opened mission names, None where it names none."""
    node = node_at(document.root, ("simulation", "world"))
    return _world(document, node.value) if isinstance(node, ScalarNode) and isinstance(node.value, str) else None


def mission_schema() -> dict[str, Any]:
    """Build the JSON Schema of mission files."""
    schema = json_schema(MissionDocument, title="Mission")
    entry = schema["$defs"]["StepEntry"]
    for property_ in entry["properties"].values():
        property_.pop("default", None)
    entry.update(minProperties=1, maxProperties=1)
    names = {
        "type": "string",
        "enum": list(STEP_TYPES),
        "description": "the step with all its values at their defaults",
    }
    schema["properties"]["steps"]["items"] = {"anyOf": [names, {"$ref": "#/$defs/StepEntry"}]}
    return schema


def resolved(document: Document, path: tuple[str, ...], value: Path) -> Path:
    """Paths in the file count from its folder; paths from `--set` from the current directory."""
    base = Path(document.source).parent if document.position(path).source == document.source else Path()
    return Path(os.path.normpath(base / value.expanduser()))


def _world(document: Document, world: str) -> str:
    if world.endswith((".yaml", ".yml")) or "/" in world:
        return str(resolved(document, ("simulation", "world"), Path(world)))
    return world
