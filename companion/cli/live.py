"""What is shown while a mission runs: one line that updates, or, where there is no terminal, each change of mode."""

from __future__ import annotations

import contextlib
import math
import queue
import threading
import time
from collections.abc import Callable
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.text import Text

from companion.clock import Clock, MonotonicClock
from companion.messages.target import HEADING, POSITION
from companion.runtime.pipeline import Snapshot
from companion.runtime.ports import MissionStatus

_PERIOD_S = 0.1  # between updates of the line, on the wall
_QUEUE = 256  # remarks that a blocked terminal may hold up; later ones are dropped
_CLOSE_S = 1.0


class LiveLine:
    """Shows a mission's progress. On a terminal each change of mode stays above the line that updates.

    Args:
        console: where to.
        clock: paces the updates.
        quiet: show nothing.
        pace: show how much faster than real time the mission runs.
    """

    def __init__(self, console: Console, clock: Clock, *, quiet: bool, pace: bool) -> None:
        self._console = console
        self._clock = clock
        self._quiet = quiet
        self._pace = pace
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None
        self._started = clock.now()
        self._due = self._started
        self._said: object = None

    def __enter__(self) -> LiveLine:
        """Take the terminal's last line."""
        if self._live is not None and not self._quiet:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give it back."""
        if self._live is not None and not self._quiet:
            self._live.stop()

    def note(self, t: float, text: str) -> None:
        """Show a remark that stays."""
        if not self._quiet:
            self._print(t, "note", text)

    def show(self, t: float, mission: MissionStatus, snapshot: Snapshot | None) -> None:
        """Show how the mission stands at `t` [s]; cheap to call at each step."""
        self.update(
            t,
            (mission.state, mission.mode, mission.t),
            what=mission.mode.value.replace("_", " "),
            why=mission.reason,
            words=lambda rate: progress_line(t, mission, snapshot, rate),
        )

    def update(self, t: float, said: object, *, what: str, why: str, words: Callable[[float | None], str]) -> None:
        """Show how anything stands; cheap to call at each step.

        Args:
            t: time since the start [s].
            said: whenever it changes, `what` and `why` are shown, and stay.
            what: the mode, in a word.
            why: the reason for it.
            words: gives the line that is replaced each time, from how much faster than real time it runs, or None.
        """
        if self._quiet:
            return
        if said != self._said:
            self._said = said
            self._print(t, what, why)
        now = self._clock.now()
        if self._live is not None and now >= self._due:
            self._due = now + _PERIOD_S
            rate = t / max(now - self._started, 1e-9) if self._pace else None
            self._live.update(Text(words(rate), no_wrap=True), refresh=True)

    def _print(self, t: float, what: str, text: str) -> None:
        self._console.print(f"{t:7.2f} s  {what:<10}  {text}", markup=False, highlight=False, soft_wrap=True)


def progress_line(t: float, mission: MissionStatus, snapshot: Snapshot | None, rate: float | None) -> str:
    """Say in one line how a mission stands.

    Args:
        t: time since the start [s].
        mission: state and mode.
        snapshot: of the last step, None before it.
        rate: how much faster than real time it runs; None: not shown.
    """
    words = [f"{t:7.1f} s", f"{mission.mode.value.replace('_', ' '):<10}"]
    track = None if snapshot is None else snapshot.picture.track
    coarse = None if snapshot is None else snapshot.coarse
    if track is None and coarse is not None and snapshot is not None and snapshot.ownship is not None:
        offset = coarse.position_ned - snapshot.ownship.position_ned
        words.append(f"pad not in sight, {math.hypot(float(offset[0]), float(offset[1])):5.2f} m away")
        words.append(f"known to {coarse.position_std:.2f} m")
        if coarse.by_ranges:
            words.append(f"Mahalanobis distance {coarse.mahalanobis:.1f}")
    elif track is None:
        words.append("pad not in sight")
    else:
        forward, right, down = (float(value) for value in track.state[POSITION])
        words.append(f"{down:5.2f} m above the pad")
        words.append(f"{math.hypot(forward, right):5.2f} m beside it")
        words.append(f"{math.degrees(float(track.state[HEADING])):+4.0f} deg")
    if rate is not None:
        words.append(f"{rate:.1f} x real time")
    return "  ".join(words)


def pacer() -> Callable[[float], None]:
    """Give what sleeps until the wall has come as far as virtual time [s]."""
    clock = MonotonicClock()
    started = clock.now()

    def hold_back(t: float) -> None:
        ahead = t - (clock.now() - started)
        if ahead > 0.0:
            time.sleep(ahead)

    return hold_back


class BackgroundDisplay:
    """Shows a mission from a thread of its own: a terminal that blocks must not hold up a flight.

    Args:
        line: where to.
    """

    def __init__(self, line: LiveLine) -> None:
        self._line = line
        self._queue: queue.Queue[Callable[[], None] | None] = queue.Queue(maxsize=_QUEUE)
        self._said: MissionStatus | None = None
        self._due = -math.inf
        self._thread = threading.Thread(target=self._run, name="display", daemon=True)
        self._thread.start()

    def note(self, t: float, text: str) -> None:
        """Show a remark that stays."""
        self._put(lambda: self._line.note(t, text))

    def show(self, t: float, mission: MissionStatus, snapshot: Snapshot | None) -> None:
        """Show how the mission stands at `t` [s]; cheap to call at each step."""
        if mission is self._said and t < self._due:
            return
        self._said, self._due = mission, t + _PERIOD_S
        self._put(lambda: self._line.show(t, mission, snapshot))

    def close(self) -> None:
        """Show what is left, but do not wait long for a terminal that blocks."""
        self._put(None)
        self._thread.join(timeout=_CLOSE_S)

    def _put(self, action: Callable[[], None] | None) -> None:
        with contextlib.suppress(queue.Full):
            self._queue.put_nowait(action)

    def _run(self) -> None:
        while (action := self._queue.get()) is not None:
            with contextlib.suppress(OSError, ValueError):  # the terminal has gone
                action()
