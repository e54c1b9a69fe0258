"""The page on which every key of a configuration stands."""

import json
import re
from pathlib import Path

import pytest

from companion.config.reference import reference
from companion.config.schema import schema_texts

ROOT = Path(__file__).parents[3]


def rows(page):
    """Give default and what is allowed by the path of each key; later trees replace earlier ones."""
    section, found = "", {}
    for line in page.splitlines():
        if line.startswith("### "):
            section = line[4:] + "."
        elif line.startswith("## "):
            section = ""
        match = re.fullmatch(r"\| `(\w+)` \| (.*?) \| (.*?) \| (.*) \|", line)
        if match:
            found[section + match[1]] = match.groups()[1:]
    return found


def keys(node, schema, path=""):
    """Give the paths of all values of a schema."""
    if "$ref" in node:
        node = schema["$defs"][node["$ref"].rpartition("/")[2]]
    if "properties" not in node:
        return [path]
    return [
        key for name, part in node["properties"].items() for key in keys(part, schema, f"{path}.{name}".lstrip("."))
    ]


def test_the_written_page_is_fresh() -> None:
    written = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
    assert written == reference(), "run `make schema`"


@pytest.mark.parametrize("name", ["config.schema.json", "spacecraft.schema.json"])
def test_every_key_of_a_schema_stands_on_the_page(name) -> None:
    schema = json.loads(schema_texts()[name])
    wanted = keys(schema, schema)
    assert len(wanted) > 20
    assert set(wanted) <= set(rows(reference()))


def test_defaults_and_bounds_are_those_of_the_program() -> None:
    found = rows(reference())
    assert found["guidance.ground.blind_ahead_rad"][:2] == ("`0.3`", "above 0")
    assert found["guidance.ground.lookout.step_rad"][:2] == ("`0.7`", "above 0, at most 1.6")
    assert found["camera.source"][:2] == ("needed", "text")
    assert found["prediction.method"][0] == "`evidence`"
    assert "`paper`" in found["prediction.method"][1]
    assert found["camera.mount.position_frd_m"][:2] == ("`[0, 0, 0]`", "3 numbers")
    assert found["ranging.survey"][:2] == ("none", "text, or `null`")
