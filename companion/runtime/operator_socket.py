"""The operator's local socket: one order a connection, one line of JSON each way.

Request: `{"order": "engage" | "hold" | "abort" | "land" | "status"}`. Reply: `{"accepted": bool, "text": str,
"status": {...}}`. Only the user who runs the program may connect (mode 0600).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import stat
from collections.abc import Callable, Mapping
from pathlib import Path

from companion.errors import InputError, VehicleError
from companion.messages.operator import Answer, OperatorOrder

ORDERS = {order.name.lower(): order for order in OperatorOrder}
STATUS = "status"
_LINE_MAX = 4096  # [bytes]
_PATIENCE_S = 2.0  # for a client's line, or a server's
_CLIENTS_MAX = 8


class OperatorSocket:
    """Takes the operator's orders.

    Args:
        obey: takes an order.
        status: gives plain values for the operator to read.
    """

    def __init__(self, obey: Callable[[OperatorOrder], Answer], status: Callable[[], Mapping[str, object]]) -> None:
        self._obey = obey
        self._status = status
        self._clients = 0
        self._server: asyncio.Server | None = None
        self._path: Path | None = None

    async def open(self, path: Path) -> None:
        """Listen.

        Raises:
            InputError: the socket cannot be had.
        """
        remove_stale(path)
        before = os.umask(0o177)
        try:
            self._server = await asyncio.start_unix_server(self._serve, path=str(path), limit=_LINE_MAX)
        except OSError as error:
            raise wrong_socket(path, error.strerror or str(error)) from None
        finally:
            os.umask(before)
        self._path = path

    async def close(self) -> None:
        """Stop listening; a second call does nothing."""
        if self._server is not None:
            self._server.close()
            self._server = None
        if self._path is not None:
            self._path.unlink(missing_ok=True)
            self._path = None

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients += 1
        try:
            if self._clients <= _CLIENTS_MAX:
                with contextlib.suppress(TimeoutError, ValueError, OSError):
                    line = await asyncio.wait_for(reader.readline(), _PATIENCE_S)
                    writer.write(json.dumps(self._answer(line)).encode() + b"\n")
                    await asyncio.wait_for(writer.drain(), _PATIENCE_S)
        finally:
            self._clients -= 1
            writer.close()

    def _answer(self, line: bytes) -> dict[str, object]:
        try:
            document = json.loads(line)
        except ValueError:
            document = None
        name = document.get("order") if isinstance(document, dict) else None
        if name == STATUS:
            answer = Answer(accepted=True, text="")
        elif isinstance(name, str) and name in ORDERS:
            answer = self._obey(ORDERS[name])
        else:
            answer = Answer(accepted=False, text=f"the orders are {', '.join([*ORDERS, STATUS])}")
        return {"accepted": answer.accepted, "text": answer.text, "status": dict(self._status())}


def remove_stale(path: Path) -> None:
    """Remove the socket that a program which was killed has left.

    Raises:
        InputError: something else is there, or a program that listens.
    """
    try:
        kind = path.lstat().st_mode
    except FileNotFoundError:
        return
    except OSError as error:
        raise wrong_socket(path, error.strerror or str(error)) from None
    if not stat.S_ISSOCK(kind):
        raise wrong_socket(path, "there is something else of that name")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(_PATIENCE_S)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)
            return
        except OSError as error:
            raise wrong_socket(path, error.strerror or str(error)) from None
    raise wrong_socket(path, "another flight listens there")


def wrong_socket(path: Path, wrong: str) -> InputError:
    """Build the error for a socket that cannot be had."""
    return InputError.single(
        source=str(path),
        wrong=f"the operator's socket cannot be opened: {wrong}",
        right="end the other program, or set operator.socket to a path of your own",
    )


def ask(path: Path, order: str) -> dict[str, object]:
    """Give an order over the socket, and the reply.

    Raises:
        VehicleError: nobody listens, or the answer cannot be read.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(_PATIENCE_S)
        try:
            connection.connect(str(path))
            connection.sendall(json.dumps({"order": order}).encode() + b"\n")
            with connection.makefile("rb") as stream:
                reply = json.loads(stream.readline(_LINE_MAX))
        except (FileNotFoundError, ConnectionRefusedError):
            raise VehicleError(
                f"{path}: nobody listens there; start `companion fly`, or name its socket with --config or --socket"
            ) from None
        except PermissionError:
            raise VehicleError(f"{path}: not allowed; ask as the user who runs `companion fly`") from None
        except (OSError, ValueError) as error:
            raise VehicleError(f"{path}: no answer ({error}); look whether `companion fly` still runs") from None
    if not isinstance(reply, dict):
        raise VehicleError(f"{path}: what answers there is not `companion fly`; name its socket with --socket")
    return reply
