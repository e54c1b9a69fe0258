"""What a simulated flight leaves beside its recording."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from companion.errors import RecordingError
from companion.recording import RECORDING_NAME, SUMMARY_NAME, McapRecorder, NullRecorder, write_json

PICTURE_NAME, PAGE_NAME = "flight.png", "flight.html"
RECORD_HELP = f"leave {RECORDING_NAME}, {SUMMARY_NAME}, {PICTURE_NAME} and {PAGE_NAME} here"


def recorder_at(folder: Path | None, metadata: Mapping[str, Mapping[str, str]]) -> McapRecorder | NullRecorder:
    """Give what records into a folder, and what records nothing where there is none.

    Raises:
        RecordingError: the folder cannot be written to.
    """
    return NullRecorder() if folder is None else McapRecorder(folder / RECORDING_NAME, metadata)


def keep(folder: Path | None, recorder: McapRecorder | NullRecorder, result: Mapping[str, Any]) -> list[Path]:
    """Write result, picture and page beside a finished recording; give the files for people.

    Raises:
        RecordingError: something was not recorded, or cannot be written.
    """
    if folder is None:
        return []
    from companion.report import draw_flight, write_page  # needs matplotlib, which takes its time

    if isinstance(recorder, McapRecorder) and recorder.state.problem is not None:
        raise RecordingError(f"{recorder.state.problem} ({recorder.state.dropped} messages lost)")
    write_json(folder / SUMMARY_NAME, result)
    recording, picture, page = folder / RECORDING_NAME, folder / PICTURE_NAME, folder / PAGE_NAME
    draw_flight(recording, picture)
    write_page(recording, page)
    return [picture, page, recording]


def rows_of(seed: int, simulated_s: float, wall_s: float, left: list[Path]) -> list[tuple[str, str]]:
    """Give the rows of the result's table that say how it was simulated, and what `keep` has left."""
    rows = [
        ("seed", str(seed)),
        ("speed", f"{simulated_s / max(wall_s, 1e-9):.1f} x real time ({wall_s:.1f} s on the wall)"),
    ]
    return [*rows, *zip(("picture", "page", "recording"), map(str, left), strict=False)]
