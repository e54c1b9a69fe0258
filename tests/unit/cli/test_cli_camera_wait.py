"""A flight waits for a camera that comes up later, and for no other."""

from __future__ import annotations

import configparser
from collections.abc import Callable
from pathlib import Path

import pytest

from companion.camera.source import RecordedCamera
from companion.cli.camera_wait import PATIENCE_S, StartableCamera, wait_for_camera
from companion.clock import ManualClock
from companion.errors import CameraError, CameraNotReadyError

UNIT = Path(__file__).parents[3] / "config" / "systemd" / "companion.service"


class Camera(RecordedCamera):
    """Comes up, takes its time, or is wrong."""

    def __init__(self, clock: ManualClock, error: Callable[[float], CameraError | None]) -> None:
        super().__init__([], clock)
        self._now, self._error = clock, error

    def start(self) -> None:
        error = self._error(self._now.now())
        if error is not None:
            raise error


class Wait:
    """One wait in virtual time."""

    def __init__(self, error: Callable[[float], CameraError | None], *, end: float = float("inf")) -> None:
        self.clock, self.said, self.tried = ManualClock(), list[str](), 0
        self._error, self._end = error, end

    def run(self) -> object:
        return wait_for_camera(
            self._make,
            clock=self.clock,
            ended=lambda: self.clock.now() >= self._end,
            say=self.said.append,
            pause=lambda span: self.clock.set(self.clock.now() + span),
        )

    def _make(self) -> StartableCamera:
        self.tried += 1
        return Camera(self.clock, self._error)


def until(t: float) -> Callable[[float], CameraError | None]:
    return lambda now: CameraNotReadyError("nobody serves it") if now < t else None


def test_one_that_is_there_is_taken_without_a_word() -> None:
    wait = Wait(until(0.0))
    assert isinstance(wait.run(), Camera)
    assert (wait.said, wait.tried, wait.clock.now()) == ([], 1, 0.0)


def test_one_that_comes_up_later_is_waited_for_with_a_line_every_few_seconds() -> None:
    wait = Wait(until(20.0))
    assert isinstance(wait.run(), Camera)
    assert 20.0 <= wait.clock.now() < 24.0
    assert 5 <= len(wait.said) <= 10
    assert wait.said[0] == "waiting for the camera, 40 s more at most: nobody serves it"


def test_patience_ends_within_what_systemd_gives_a_start_and_after_what_it_counts_as_failing_fast() -> None:
    wait = Wait(until(1e9))
    with pytest.raises(CameraNotReadyError):
        wait.run()
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.read_string(UNIT.read_text(encoding="utf-8"))
    interval, burst = unit.getfloat("Unit", "StartLimitIntervalSec"), unit.getint("Unit", "StartLimitBurst")
    assert interval / burst < PATIENCE_S <= wait.clock.now() < unit.getfloat("Service", "TimeoutStartSec") - 15.0
    assert "3" not in unit.get("Service", "RestartPreventExitStatus").split()


def test_what_waiting_does_not_mend_is_told_at_once() -> None:
    wait = Wait(lambda _: CameraError("pictures of another size"))
    with pytest.raises(CameraError, match="another size"):
        wait.run()
    assert (wait.said, wait.tried) == ([], 1)


def test_the_end_of_the_program_ends_the_wait() -> None:
    wait = Wait(until(1e9), end=7.0)
    assert wait.run() is None
    assert wait.clock.now() < 7.5
