"""A table of switching decisions survives its file, always has the same bytes, and a bad file says what is wrong."""

from pathlib import Path

import pytest

from companion.config.switching_table import load_switching_table, save_switching_table, switching_table_text
from companion.errors import InputError
from companion.guidance.decision_process.approach_log import Action, Epoch, LoggedApproach
from companion.guidance.decision_process.grid import DecisionGrid
from companion.guidance.decision_process.model import LearningParameters
from companion.guidance.decision_process.solve import CostWeights
from companion.guidance.decision_process.table import SwitchingTable, solve_table
from companion.messages.docking import DockingMode, SwitchingSituation


def table() -> SwitchingTable:
    situation = SwitchingSituation(
        mode=DockingMode.REORIENT, range=0.4, misalignment=0.1, mahalanobis=1.0, position_std=0.005, vision=False,
        reorient_range=0.8,
    )  # fmt: skip
    epoch = Epoch(situation=situation, action=Action.SWITCH, elapsed=30.0, impulse=0.5)
    log = [LoggedApproach(seed=seed, epochs=(epoch,), docked=seed > 3) for seed in range(1000)]
    return solve_table(log, commit="abc1234", grid=DecisionGrid(), learning=LearningParameters(), weights=CostWeights())


def test_a_table_survives_its_file_and_stays_small(tmp_path: Path) -> None:
    path = tmp_path / "table.yaml"
    save_switching_table(table(), path)
    assert load_switching_table(path) == table()
    assert path.read_bytes() == switching_table_text(load_switching_table(path)).encode()
    assert path.stat().st_size <= 200_000


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("commit:", "comit:", "comit"),
        ("carefulness: 0.3", "carefulness: many", "number"),
        ("format: 2", "format: 1", "2"),
    ],
)
def test_a_bad_file_says_what_is_wrong(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "table.yaml"
    path.write_text(switching_table_text(table()).replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        load_switching_table(path)


def test_a_table_whose_rows_do_not_fit_says_so(tmp_path: Path) -> None:
    path = tmp_path / "table.yaml"
    text = switching_table_text(table())
    row = f"'{'.' * table().grid.row_length}', "
    assert row in text
    path.write_text(text.replace(row, "", 1))
    with pytest.raises(InputError, match="do not fit the grid"):
        load_switching_table(path)


def test_a_folder_that_is_missing_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="existing folder"):
        save_switching_table(table(), tmp_path / "nowhere" / "table.yaml")
