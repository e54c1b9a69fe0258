"""Read a text file, or say plainly why not."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from companion.documents.nearest import nearest
from companion.errors import InputError

MAX_BYTES = 1_000_000  # a mission has a few kilobytes; more is a mistake
NO_SUCH_FILE = "no such file"
_ON_THE_COMMAND_LINE = "paths count from the current directory"


def read_text(path: str | os.PathLike[str]) -> str:
    """Read a whole UTF-8 file.

    Raises:
        InputError: it is missing, not a regular file, unreadable, too large or not UTF-8.
    """
    source = os.fspath(path)
    raw = _read_bytes(source)
    if len(raw) > MAX_BYTES:
        raise InputError.single(
            source=source,
            wrong=f"the file is larger than {MAX_BYTES // 1_000_000} MB",
            right="missions, configurations, pads and calibrations have a few kilobytes",
        )
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise InputError.single(
            source=f"{source}:{line}",
            wrong=f"byte 0x{raw[error.start]:02x} is not valid UTF-8 text",
            right="save the file as UTF-8",
        ) from None


def _read_bytes(source: str) -> bytes:
    try:
        mode = os.stat(source).st_mode
        if stat.S_ISDIR(mode):
            raise InputError.single(source=source, wrong="this is a directory", right="give the path of a file")
        if not stat.S_ISREG(mode):
            raise InputError.single(source=source, wrong="this is not a regular file", right="give the path of a file")
        with Path(source).open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise InputError.single(source=source, wrong=NO_SUCH_FILE, right=hint_for_missing(source)) from None
    except PermissionError:
        raise InputError.single(
            source=source, wrong="the file may not be read", right="give yourself read permission (chmod +r)"
        ) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError.single(
            source=source, wrong=f"the file cannot be read: {reason}", right="give the path of a readable file"
        ) from None


def hint_for_missing(source: str, counts: str = _ON_THE_COMMAND_LINE) -> str:
    """Say what may be meant by the path of a missing file.

    Args:
        source: the path.
        counts: where such a path counts from, in words; left out: as on the command line.
    """
    folder = Path(source).parent
    if not folder.is_dir():
        return f"there is no directory {folder} either; {counts}"
    names = sorted(p.name for p in folder.iterdir() if p.suffix == Path(source).suffix and p.is_file())
    if not names:
        return f"check the path; {counts}"
    meant = nearest(Path(source).name, names)
    if meant is not None:
        return f"did you mean {folder / meant}?"
    shown = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
    return f"check the path; in {folder} there are: {shown}"
