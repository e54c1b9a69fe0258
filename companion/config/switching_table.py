"""Tables of switching decisions as files."""

from __future__ import annotations

import os
from pathlib import Path

import yaml

from companion.documents import load_validated, to_plain
from companion.errors import InputError
from companion.guidance.decision_process.table import SwitchingTable


def load_switching_table(path: str | os.PathLike[str]) -> SwitchingTable:
    """Read and check a table.

    Raises:
        InputError: with every problem of the file.
    """
    return load_validated(path, SwitchingTable)


def switching_table_text(table: SwitchingTable) -> str:
    """Write a table as YAML: the same table gives the same bytes."""
    text: str = yaml.safe_dump(to_plain(table), sort_keys=False, default_flow_style=None, width=110)
    return f"# where to aim, when to turn and to align, solved from logged approaches; made by the program\n{text}"


def save_switching_table(table: SwitchingTable, path: str | os.PathLike[str]) -> None:
    """Write a table to a file.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        Path(path).write_text(switching_table_text(table), encoding="utf-8")
    except OSError as error:
        raise InputError.single(
            source=os.fspath(path),
            wrong=f"the table cannot be written: {error.strerror}",
            right="give the path of a file in an existing folder that may be written to",
        ) from None
