"""Most tests here run programs in real time; those without the mark `sitl` only start one that ends by itself."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _in_company_or_alone(request: pytest.FixtureRequest) -> Iterator[None]:
    """Two flights in real time have a core each; where a test measures milliseconds it flies alone (mark `alone`)."""
    if request.node.get_closest_marker("sitl") is None:
        yield
        return
    alone = request.node.get_closest_marker("alone") is not None
    with (Path(tempfile.gettempdir()) / f"companion-sitl-{os.getuid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield
