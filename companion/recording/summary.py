"""The small JSON file beside a recording. Everything that a clock on the wall says belongs here, nothing of it into
the recording, which is the same for the same seed.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping
from pathlib import Path

from companion.errors import RecordingError
from companion.recording.serialise import to_plain


def write_json(path: str | os.PathLike[str], data: Mapping[str, object]) -> None:
    """Write a mapping as readable JSON: the whole file or nothing.

    Raises:
        RecordingError: the file cannot be written.
    """
    target = Path(path)
    partial = target.with_name(f"{target.name}.{os.getpid()}.partial")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(json.dumps(to_plain(data), indent=2) + "\n", encoding="utf-8")
        partial.replace(target)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise RecordingError(f"{target}: cannot be written: {error.strerror}") from None
