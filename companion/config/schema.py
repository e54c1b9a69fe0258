"""Write the JSON Schemas that editors use: `python -m companion.config.schema [FOLDER]`, by default `config/schema`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from companion.config.load import config_schema, docking_config_schema
from companion.mission import mission_schema
from companion.mission.docking import docking_schema
from companion.ranging.survey_file import survey_schema

FOLDER = Path("config") / "schema"


def schema_texts() -> dict[str, str]:
    """Give the text of each schema file by its name."""
    schemas = {
        "mission.schema.json": mission_schema(),
        "config.schema.json": config_schema(),
        "anchors.schema.json": survey_schema(),
        "docking.schema.json": docking_schema(),
        "spacecraft.schema.json": docking_config_schema(),
    }
    return {name: json.dumps(schema, indent=2, ensure_ascii=False) + "\n" for name, schema in schemas.items()}


def write_schemas(folder: Path) -> list[Path]:
    """Write the schema files; give their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, text in schema_texts().items():
        path = folder / name
        path.write_text(text, encoding="utf-8")
        paths.append(path)
    return paths


if __name__ == "__main__":
    for written in write_schemas(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER):
        sys.stdout.write(f"{written}\n")
