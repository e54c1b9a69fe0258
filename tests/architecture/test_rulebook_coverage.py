"""The table of docs/rulebook.md says which rules have a test; the tests' names must say the same."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RULES = range(1, 22)
SIDES = {
    "PX4": ("tests/unit/sitl_stub", "test_rulebook*.py", 1),
    "companion": ("tests/unit/rulebook", "test_rulebook*.py", 2),
}


def table() -> dict[int, list[str]]:
    rows = {}
    for line in (ROOT / "docs/rulebook.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if len(cells) == 4 and cells[0].isdigit():
            rows[int(cells[0])] = cells[1:]
    return rows


def rules_with_tests(side: str) -> set[int]:
    folder, pattern, _ = SIDES[side]
    names = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / folder).glob(pattern))
    return {int(number) for number in re.findall(r"^(?:async )?def test_rule_(\d\d)_", names, re.MULTILINE)}


def test_every_rule_is_in_the_table():
    assert sorted(table()) == list(RULES)


@pytest.mark.parametrize("side", sorted(SIDES))
def test_the_table_says_which_rules_have_tests(side):
    column = SIDES[side][2]
    assert {number for number, cells in table().items() if cells[column] == "yes"} == rules_with_tests(side)
