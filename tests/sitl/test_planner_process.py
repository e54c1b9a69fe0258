"""The planner's process dies, hangs, or goes mad in mid-descent: the guardian's brakes, hovers, hands over to Hold.

Real processes on loopback, in real time: `companion fly`, `sitl-stub`, and a wire between them that is watched.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import signal
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from processes import END_S, finish, fly_words, free_port, process
from sitl_programs import STALL_S, TRIES, Stub, stub
from wire import COMMAND_LONG, CURRENT_MODE, HEARTBEAT, ODOMETRY, Passed, Wire

from companion.errors import VehicleError
from companion.runtime.operator_socket import ask

pytestmark = pytest.mark.sitl

GAP_S = 0.1
OFFBOARD, HOLD = (6, 0), (4, 3)


class Starved(Exception):
    """The machine had no time for the simulator: the run says nothing."""


class Flight:
    """One flight with its wire."""

    def __init__(self, process: subprocess.Popen[str], wire: Wire, folder: Path, simulator: Stub) -> None:
        self.process, self.wire, self.socket, self.simulator = process, wire, folder / "operator.sock", simulator
        self.said: list[str] = []

    def wait_for(self, words: str) -> None:
        """Read what the program says until `words` come."""
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.said.append(line)
            if words in line:
                return
        raise Starved(f"{words!r} never came: {''.join(self.said)}")

    def status(self) -> dict[str, object]:
        status = ask(self.socket, "status")["status"]
        assert isinstance(status, dict)
        return status

    def is_silent(self) -> bool:
        """Whether the guardian is muted, or its program has ended."""
        try:
            return self.status()["guardian"] == "muted"
        except VehicleError:
            return True

    def until(self, condition: Callable[[], bool], seconds: float) -> float:
        """Wait for a condition; give when it came."""
        t_end = time.monotonic() + seconds
        while time.monotonic() < t_end:
            if condition():
                return time.monotonic()
            time.sleep(0.02)
        raise AssertionError(f"not within {seconds} s; {self.status() if self.process.poll() is None else self.said}")


@contextlib.contextmanager
def flight(folder: Path, *words: str, program: tuple[str, ...], camera: str, rogue: str = "") -> Iterator[Flight]:
    port = free_port()
    with Wire(port) as wire, stub("--camera", camera, onboard=wire.port) as simulator:
        arguments = fly_words(f"udp://127.0.0.1:{port}", simulator.camera, folder, *words)
        with process(*program, *arguments, folder=folder, more={"ROGUE": rogue}) as started:
            yield Flight(started, wire, folder, simulator)


def modes(passed: list[Passed]) -> list[tuple[int, int]]:
    """Give main and sub mode of each DO_SET_MODE."""
    found = []
    for each in passed:
        if each.message_id == COMMAND_LONG:
            payload = each.payload.ljust(33, b"\0")
            numbers, command = struct.unpack("<7f", payload[:28]), struct.unpack("<H", payload[28:30])[0]
            if command == 176:
                found.append((int(numbers[1]), int(numbers[2])))
    return found


def heights(passed: list[Passed]) -> list[tuple[float, float]]:
    """Give the vehicle's height [m] by its odometry."""
    frames = [each for each in passed if each.message_id == ODOMETRY]
    return [(each.t, -struct.unpack("<f", each.payload.ljust(230, b"\0")[16:20])[0]) for each in frames]


def velocity_down(setpoint: Passed) -> float:
    value: float = struct.unpack("<f", setpoint.payload.ljust(53, b"\0")[24:28])[0]
    return value


def gaps(setpoints: list[Passed]) -> float:
    return max((b.t - a.t for a, b in itertools.pairwise(setpoints)), default=0.0)


def check_handed_over(run: Flight, t_bad: float) -> None:
    """Brake, hover, after two seconds Hold, then silence; not a step lower than the braking takes."""
    t_hold = run.until(lambda: HOLD in modes([p for p in run.wire.up if p.t > t_bad]), 8.0)
    run.until(run.is_silent, 5.0)
    before = [p for p in run.wire.setpoints(t_bad) if p.t < t_hold]
    late = run.simulator.lost_time
    assert 2.0 <= t_hold - t_bad <= 3.2 + late
    assert gaps(before) <= GAP_S
    assert velocity_down(before[-1]) == pytest.approx(0.0, abs=0.02)
    assert abs(velocity_down(before[len(before) // 2])) < 0.05
    track = heights(run.wire.down)
    start = next(height for t, height in track if t >= t_bad)
    after = [height for t, height in track if t >= t_bad]
    assert min(after) > start - 0.5
    assert max(after) < start + 0.5
    assert start > 0.4
    time.sleep(1.5)
    t_quiet = time.monotonic() - 1.0
    assert run.wire.setpoints(t_quiet) == []
    assert OFFBOARD not in modes([p for p in run.wire.up if p.t > t_bad])


def in_mid_descent(tmp_path: Path, act: Callable[[Flight, int], None]) -> None:
    """Fly the real planner into the descent; `act` on its process, of which the id is given."""
    for attempt in range(TRIES):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        with flight(folder, program=("-m", "companion"), camera="rendered") as run:
            try:
                run.wait_for("  land  ")
                time.sleep(0.7)
                act(run, int(str(run.status()["planner_process"])))
                return
            except (Starved, AssertionError):
                run.simulator.stop()
                if run.simulator.lost_time < STALL_S or attempt == TRIES - 1:
                    raise


def test_a_killed_planner(tmp_path: Path) -> None:
    def act(run: Flight, planner: int) -> None:
        os.kill(planner, signal.SIGKILL)
        check_handed_over(run, time.monotonic())
        _output, said = run.process.communicate(timeout=END_S)
        assert run.process.returncode == 4, said
        assert "planner's process was ended by SIGKILL" in said

    in_mid_descent(tmp_path, act)


def test_a_stopped_planner(tmp_path: Path) -> None:
    def act(run: Flight, planner: int) -> None:
        os.kill(planner, signal.SIGSTOP)
        t_stopped = time.monotonic()
        check_handed_over(run, t_stopped)
        assert "planner is silent" in str(ask(run.socket, "engage")["text"])
        os.kill(planner, signal.SIGCONT)
        code, result, _ = finish(run.process)  # it wakes, sees that the vehicle has gone, and ends
        assert code == 1
        assert result["outcome"] == "aborted"
        assert run.wire.setpoints(time.monotonic() - 1.0) == []

    in_mid_descent(tmp_path, act)


ROGUE = (str(Path(__file__).with_name("rogue_planner.py")),)


@pytest.mark.parametrize("kind", ["garbage", "replay"])
def test_a_planner_that_floods_with_what_is_no_word(tmp_path: Path, kind: str) -> None:
    with flight(tmp_path, program=ROGUE, camera="corners", rogue=kind) as run:
        run.wait_for("misbehaving")
        t_bad = time.monotonic()
        check_handed_over(run, t_bad)
        run.process.send_signal(signal.SIGTERM)
        run.process.communicate(timeout=END_S)
        assert run.process.returncode in (1, 4)


def test_a_planner_that_floods_with_wild_wishes_stays_in_the_limits(tmp_path: Path) -> None:
    with flight(tmp_path, program=ROGUE, camera="corners", rogue="wild") as run:
        run.wait_for("misbehaving")
        t_bad = time.monotonic()
        time.sleep(4.0)
        setpoints = run.wire.setpoints(t_bad)
        run.process.send_signal(signal.SIGTERM)
        t_term = time.monotonic()
        run.until(lambda: HOLD in modes([p for p in run.wire.up if p.t > t_term]), 5.0)
        run.process.communicate(timeout=END_S)
    assert len(setpoints) > 150
    assert gaps(setpoints) <= GAP_S
    for setpoint in setpoints:
        numbers = struct.unpack("<11f", setpoint.payload.ljust(53, b"\0")[4:48])
        north, east, down = numbers[3:6]
        assert (north**2 + east**2) ** 0.5 <= 4.0 + 0.8
        assert -3.0 <= down <= 2.0
        assert (numbers[0] ** 2 + numbers[1] ** 2) ** 0.5 < 51.0
        assert -numbers[2] < 16.0
    assert OFFBOARD not in modes([p for p in run.wire.up if p.t > t_bad])


def test_the_guardians_own_death_is_the_autopilots_failsafe(tmp_path: Path) -> None:
    with flight(tmp_path, program=ROGUE, camera="corners", rogue="steady") as run:
        run.until(lambda: any(height > 2.0 for _, height in heights(run.wire.down[-200:])), 40.0)
        planner = int(str(run.status()["planner_process"]))
        run.process.kill()
        t_dead = time.monotonic()
        run.process.wait(timeout=END_S)
        run.until(lambda: not Path(f"/proc/{planner}").exists() or "Z" in state_of(planner), 5.0)
        run.until(lambda: (4, 5) in reported_modes([p for p in run.wire.down if p.t > t_dead]), 5.0)
    assert run.wire.setpoints(t_dead + 0.2) == []


def state_of(process: int) -> str:
    with contextlib.suppress(FileNotFoundError):
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    return "Z"


def reported_modes(passed: list[Passed]) -> list[tuple[int, int]]:
    found = []
    for each in passed:
        if each.message_id in (HEARTBEAT, CURRENT_MODE):
            custom = int.from_bytes(each.payload.ljust(4, b"\0")[:4], "little")
            found.append((custom >> 16 & 0xFF, custom >> 24))
    return found
