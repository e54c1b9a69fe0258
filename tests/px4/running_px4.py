"""The PX4 of this folder's tests: one that runs already, or one that is started anew for each flight."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

from pymavlink.dialects.v20 import all as mavlink

HEAR_S, START_S, STOP_S = 5.0, 60.0, 10.0
_SAID = "said.txt"  # in the folder in which PX4 runs: its output
SETTLE_S = 5.0
"""Between PX4's word that it could arm and the flight [s]: its estimate goes on settling."""


class Listener:
    """Hears PX4 on its onboard link and writes parameters there; closed before the companion takes the port."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((parts.hostname or "127.0.0.1", parts.port or 14540))
        self._socket.settimeout(0.2)
        self._mavlink = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._mavlink.robust_parsing = True
        self._sender: tuple[str, int] | None = None

    def close(self) -> None:
        """Free the port."""
        self._socket.close()

    def wait(self, seconds: float, wanted: Callable[[mavlink.MAVLink_message], bool]) -> mavlink.MAVLink_message | None:
        """Give the first message of the autopilot (component 1) that is `wanted`; None after `seconds` [s]."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                data, self._sender = self._socket.recvfrom(2048)
            except TimeoutError:
                continue
            for message in self._mavlink.parse_buffer(data) or ():
                if message.get_srcComponent() == 1 and wanted(message):
                    return message
        return None

    def set_integer(self, system: int, name: str, value: int) -> None:
        """Set an integer parameter (PX4 keeps its bytes in the float's place), and wait for PX4's answer.

        Raises:
            RuntimeError: PX4 does not answer.
        """
        (coded,) = struct.unpack("<f", struct.pack("<i", value))
        message = mavlink.MAVLink_param_set_message(system, 1, name.encode(), coded, mavlink.MAV_PARAM_TYPE_INT32)
        for _ in range(5):
            assert self._sender is not None
            self._socket.sendto(message.pack(self._mavlink), self._sender)
            if self.wait(1.0, lambda heard: heard.get_type() == "PARAM_VALUE" and heard.param_id == name) is not None:
                return
        raise RuntimeError(f"PX4 does not answer that {name} is to be {value}")


def _heartbeat(message: mavlink.MAVLink_message) -> bool:
    return bool(message.get_type() == "HEARTBEAT")


def _could_arm(message: mavlink.MAVLink_message) -> bool:
    ready = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    return message.get_type() == "SYS_STATUS" and bool(message.onboard_control_sensors_health & ready)


@contextlib.contextmanager
def px4(start: str, url: str, parameters: dict[str, int]) -> Iterator[int | None]:
    """Give the system id of a PX4 that is ready; None where none is heard.

    Args:
        start: shell command that starts it in the foreground, in a new folder of its own, so that no parameter is left
            of the flight before; empty: it runs already.
        url: where the companion hears it.
        parameters: integer parameters that it must have.

    Raises:
        RuntimeError: it was started, but is not heard, or does not become ready to arm.
    """
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        if start:
            stack.enter_context(_process(start, Path(folder)))
        listener = Listener(url)
        try:
            heard = listener.wait(START_S if start else HEAR_S, _heartbeat)
            if heard is not None:
                for name, value in parameters.items():
                    listener.set_integer(heard.get_srcSystem(), name, value)
            if start:
                if heard is None:
                    said = (Path(folder) / _SAID).read_text(encoding="utf-8", errors="replace")[-500:]
                    raise RuntimeError(f"PX4_START was run, but no PX4 is heard on {url}: {start}\nit said: {said}")
                if listener.wait(START_S, _could_arm) is None:
                    raise RuntimeError(f"the PX4 of PX4_START was not ready to arm within {START_S:g} s")
                listener.wait(SETTLE_S, lambda _: False)
        finally:
            listener.close()
        yield None if heard is None else heard.get_srcSystem()


@contextlib.contextmanager
def _process(start: str, folder: Path) -> Iterator[None]:
    """Run a shell command in a group of processes of its own; at the end of the block the group is gone."""
    with (folder / _SAID).open("wb") as said:
        streams = {"stdin": subprocess.DEVNULL, "stdout": said, "stderr": subprocess.STDOUT}
        started = subprocess.Popen(start, shell=True, cwd=folder, start_new_session=True, **streams)
    try:
        yield
    finally:
        for word in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(started.pid, word)
            with contextlib.suppress(subprocess.TimeoutExpired):
                started.wait(timeout=STOP_S)
