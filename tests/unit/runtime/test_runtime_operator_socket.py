"""The operator's socket: orders go in, plain answers come out, nobody else comes near."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import stat
from pathlib import Path

import pytest

from companion.cli.main import main
from companion.errors import InputError, VehicleError
from companion.messages.operator import Answer, OperatorOrder
from companion.runtime.operator_socket import OperatorSocket, ask


class Flight:
    """Answers as a flight does; keeps what it was asked for."""

    def __init__(self) -> None:
        self.orders: list[OperatorOrder] = []

    def obey(self, order: OperatorOrder) -> Answer:
        self.orders.append(order)
        return Answer(accepted=order is not OperatorOrder.ENGAGE, text=f"as for {order.name.lower()}")

    def status(self) -> dict[str, object]:
        return {"mission": "running", "armed": True}


async def with_server(path: Path, flight: Flight, client):
    """Run a blocking client against a server."""
    server = OperatorSocket(flight.obey, flight.status)
    await server.open(path)
    try:
        return await asyncio.to_thread(client)
    finally:
        await server.close()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "operator.sock"


def test_orders_arrive_and_are_answered(path: Path) -> None:
    flight = Flight()
    replies = asyncio.run(
        with_server(path, flight, lambda: [ask(path, word) for word in ("engage", "hold", "abort", "land", "status")])
    )
    assert flight.orders == [OperatorOrder.ENGAGE, OperatorOrder.HOLD, OperatorOrder.ABORT, OperatorOrder.LAND]
    assert [reply["accepted"] for reply in replies] == [False, True, True, True, True]
    assert replies[0]["text"] == "as for engage"
    assert all(reply["status"] == flight.status() for reply in replies)
    assert not path.exists()


def test_only_its_user_may_connect(path: Path) -> None:
    mode = asyncio.run(with_server(path, Flight(), lambda: stat.S_IMODE(path.stat().st_mode)))
    assert mode == 0o600


@pytest.mark.parametrize("line", [b"nonsense\n", b"[1]\n", b'{"order": "fly"}\n', b'{"order": 1}\n', b"\n"])
def test_what_is_no_order_is_answered_with_the_orders(path: Path, line: bytes) -> None:
    def client() -> dict[str, object]:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(path))
            connection.sendall(line)
            answer: dict[str, object] = json.loads(connection.makefile("rb").readline())
            return answer

    flight = Flight()
    reply = asyncio.run(with_server(path, flight, client))
    assert reply["accepted"] is False
    assert "engage, hold, abort, land, status" in str(reply["text"])
    assert flight.orders == []


def test_a_line_without_end_and_a_client_that_leaves_do_no_harm(path: Path) -> None:
    def client() -> object:
        for data in (b"x" * 100_000, b""):
            with socket.socket(socket.AF_UNIX) as connection:
                connection.connect(str(path))
                with contextlib.suppress(OSError):
                    connection.sendall(data)
        return ask(path, "status")["accepted"]

    assert asyncio.run(with_server(path, Flight(), client)) is True


def test_a_socket_that_a_killed_flight_left_is_replaced(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))
    assert asyncio.run(with_server(path, Flight(), lambda: ask(path, "status")["accepted"])) is True


def test_another_flight_or_another_file_is_not_replaced(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        other.listen()
        with pytest.raises(InputError, match="another flight listens"):
            asyncio.run(with_server(path, Flight(), lambda: None))
    path.unlink()
    path.write_text("mine")
    with pytest.raises(InputError, match="something else"):
        asyncio.run(with_server(path, Flight(), lambda: None))
    assert path.read_text() == "mine"


def test_a_folder_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"operator\.socket"):
        asyncio.run(with_server(tmp_path / "none" / "x.sock", Flight(), lambda: None))


def test_where_nobody_listens_it_says_so(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(VehicleError, match="nobody listens"):
        ask(path, "status")
    assert main(["ctl", "status", "--socket", str(path)]) == 3
    assert "nobody listens" in capsys.readouterr().err


def test_what_answers_wrongly_is_named(path: Path) -> None:
    for reply, words in ((b"[]\n", "is not `companion fly`"), (b"nonsense\n", "no answer"), (b"", "no answer")):

        async def serve(reader, writer, reply=reply):
            await reader.readline()
            writer.write(reply)
            writer.close()

        async def run(serve=serve):
            server = await asyncio.start_unix_server(serve, path=str(path))
            async with server:
                return await asyncio.to_thread(ask, path, "status")

        with pytest.raises(VehicleError, match=words):
            asyncio.run(run())
        path.unlink(missing_ok=True)


@pytest.mark.parametrize(("order", "code"), [("engage", 1), ("hold", 0), ("status", 0)])
def test_the_verb_shows_the_answer(path: Path, capsys: pytest.CaptureFixture[str], order: str, code: int) -> None:
    assert asyncio.run(with_server(path, Flight(), lambda: main(["ctl", order, "--socket", str(path)]))) == code
    assert ("as for" in capsys.readouterr().out) is (order != "status")
    asyncio.run(with_server(path, Flight(), lambda: main(["ctl", order, "--json", "--socket", str(path)])))
    assert json.loads(capsys.readouterr().out)["status"] == {"mission": "running", "armed": True}
