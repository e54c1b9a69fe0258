"""A piece of wire between the simulator and the program: passes MAVLink on, notes when what passed, and adds to it."""

from __future__ import annotations

import select
import socket
import threading
import time
from dataclasses import dataclass

SETPOINT, COMMAND_LONG, HEARTBEAT, CURRENT_MODE, ODOMETRY = 84, 76, 0, 436, 331


@dataclass(frozen=True)
class Passed:
    t: float  # [s] monotonic
    data: bytes

    @property
    def message_id(self) -> int:
        """Of the first frame; the simulator and the program put one into each datagram."""
        return int.from_bytes(self.data[7:10], "little") if self.data[0] == 0xFD else self.data[5]

    @property
    def payload(self) -> bytes:
        return self.data[10 : 10 + self.data[1]]


class Wire:
    """Listens where the simulator sends; passes on to where the program listens. Use it as a context."""

    def __init__(self, program_port: int) -> None:
        self._program = ("127.0.0.1", program_port)
        self._to_simulator = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to_simulator.bind(("127.0.0.1", 0))
        self._to_program = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to_program.bind(("127.0.0.1", 0))
        self.port = self._to_simulator.getsockname()[1]  # for the simulator to send to
        self._simulator: tuple[str, int] | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.down: list[Passed] = []  # from the simulator
        self.up: list[Passed] = []  # from the program

    def __enter__(self) -> Wire:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._to_simulator.close()
        self._to_program.close()

    def inject(self, data: bytes) -> float:
        """Send to the program as if it came from the simulator; give when [s]."""
        t = time.monotonic()
        self._to_program.sendto(data, self._program)
        self.down.append(Passed(t, data))
        return t

    def to_simulator(self, data: bytes) -> None:
        """Send to the simulator as if it came from the program; it is not noted as the program's."""
        if self._simulator is not None:
            self._to_simulator.sendto(data, self._simulator)

    def _run(self) -> None:
        both = [self._to_simulator, self._to_program]
        while not self._stop.is_set():
            for ready in select.select(both, [], [], 0.05)[0]:
                try:
                    data, source = ready.recvfrom(4096)
                except OSError:  # nobody listens at the other end yet
                    continue
                passed = Passed(time.monotonic(), data)
                if ready is self._to_simulator:
                    self._simulator = source
                    self.down.append(passed)
                    self._to_program.sendto(data, self._program)
                elif self._simulator is not None:
                    self.up.append(passed)
                    self._to_simulator.sendto(data, self._simulator)

    def setpoints(self, since: float = 0.0) -> list[Passed]:
        """Give the setpoints that passed since `since` [s]."""
        return [passed for passed in self.up if passed.message_id == SETPOINT and passed.t >= since]
