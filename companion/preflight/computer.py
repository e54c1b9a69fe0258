"""Look at this computer: disk, clock, load."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from companion.clock import Clock, unix_time
from companion.preflight.finding import Finding, judged, not_checked
from companion.preflight.parameters import ComputerLimits

_PLAUSIBLE_UNIX_S = 1_735_689_600.0  # 2025-01-01: an earlier wall clock was never set
_STAT = Path("/proc/stat")


@dataclass(frozen=True, slots=True, kw_only=True)
class ComputerState:
    """Readings of one instant."""

    t: float  # [s] steady clock
    unix: float  # [s] wall clock
    busy: float  # [jiffies] of all processors since the start of the system
    total: float  # [jiffies]; 0 where it is not known


def read_computer(clock: Clock) -> ComputerState:
    """Take the readings now."""
    busy, total = _processor_times()
    return ComputerState(t=clock.now(), unix=unix_time(), busy=busy, total=total)


def _processor_times() -> tuple[float, float]:
    """Give the busy and the whole time of all processors, from the first line of /proc/stat (proc(5))."""
    try:
        numbers = [float(word) for word in _STAT.read_text(encoding="ascii").split("\n", 1)[0].split()[1:9]]
    except (OSError, ValueError):
        return 0.0, 0.0
    idle = sum(numbers[3:5])  # idle, iowait
    return sum(numbers) - idle, sum(numbers)


def disk_free_gb(folder: Path) -> float:
    """Give the free space [GB, 1e9 bytes] for a folder that may not exist yet."""
    place = folder.absolute()
    while not place.exists():
        place = place.parent
    return shutil.disk_usage(place).free * 1e-9


def judge_computer(
    before: ComputerState, after: ComputerState, free_gb: float, folder: Path, limits: ComputerLimits
) -> list[Finding]:
    """Judge the readings at the begin and the end of a look."""
    return [_disk(free_gb, folder, limits), _clock(before, after, limits), _load(before, after, limits)]


def _disk(free_gb: float, folder: Path, limits: ComputerLimits) -> Finding:
    found = f"{free_gb:.1f} GB free for {folder}"
    wanted = f"{limits.disk_free_least_gb:g} GB (pictures take about 0.6 GB a minute)"
    return judged("disk", free_gb >= limits.disk_free_least_gb, found, wanted, {"free_gb": free_gb})


def _clock(before: ComputerState, after: ComputerState, limits: ComputerLimits) -> Finding:
    step = (after.unix - before.unix) - (after.t - before.t)
    set_once = after.unix >= _PLAUSIBLE_UNIX_S
    found = f"moved {1e3 * step:+.0f} ms against the steady clock" if set_once else "the date was never set"
    wanted = f"set, and steady within {1e3 * limits.clock_step_most_s:g} ms"
    figures = {"unix_s": after.unix, "step_s": step}
    return judged("clock", set_once and abs(step) <= limits.clock_step_most_s, found, wanted, figures)


def _load(before: ComputerState, after: ComputerState, limits: ComputerLimits) -> Finding:
    wanted = f"at most {100 * limits.load_most:g} % of the processors' time"
    if after.total <= before.total:
        return not_checked("CPU load", "this system does not say", wanted)
    load = (after.busy - before.busy) / (after.total - before.total)
    return judged("CPU load", load <= limits.load_most, f"{100 * load:.0f} %", wanted, {"share": load})
