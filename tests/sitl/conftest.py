"""Most tests here run programs in real time; those without the mark `sitl` only start one that ends by itself."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _one_at_a_time(request: pytest.FixtureRequest) -> Iterator[None]:
    """Programs in real time need their cores: two workers of pytest must not fly at the same time."""
    if request.node.get_closest_marker("sitl") is None:
        yield
        return
    with (Path(tempfile.gettempdir()) / f"companion-sitl-{os.getuid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
