"""Rows of the autopilot's own modes: braking in Hold, coming down in Land and Return, touching down."""

from collections.abc import Iterator

import numpy as np

from sitl_stub.fidelity.flight import Flight, Track
from sitl_stub.fidelity.recording import Recording
from sitl_stub.fidelity.row import Row, inside, within

SHARE = 0.20
SPREAD_MARGIN = 0.3
"""Tolerance of times at both ends of a recorded spread [s]."""
SLOW = 0.2
"""Speed [m/s] that counts as stopped."""
CONTACT_HEIGHT, ALOFT_HEIGHT = 0.05, 0.3
SPREADS = {
    "q07_descent_03": (3.2, 20.6),
    "q07_descent_05": (1.46, 7.2),
    "q07_descent_07": (1.2, 6.4),
    "q07_descent_05_clean": (3.48, 4.4),
    "q08_auto_land": (1.18, 5.48),
    "q08_rtl_near": (1.18, 5.48),
    "q08_rtl_far": (1.18, 5.48),
    "q16_wind": (1.18, 5.48),
    "q16_wind_start": (1.18, 5.48),
    "q19_flight": (1.18, 5.48),
}
"""True contact to "landed" [s] in PX4's flights of that kind: q07_touchdown_repeats.json, figures.json."""


def contact_time(flight: Flight) -> float | None:
    """Boot time [s] at which the vehicle last came down to the ground before it was landed; None if it never was."""
    landings = flight.landings()
    if not landings:
        return None
    truth = flight.truth
    before = truth.t <= landings[0]
    height, t = -truth.position[before, 2], truth.t[before]
    aloft = np.flatnonzero(height > ALOFT_HEIGHT)
    down = np.flatnonzero(height < CONTACT_HEIGHT)
    down = down[down > (aloft[-1] if aloft.size else -1)]
    return float(t[down[0]]) if down.size else None


def touchdown(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Time from true contact to "landed", and from there to disarmed."""
    low, high = SPREADS[recording.name]
    times = []
    for one in (flight, recording.flight):
        contact = contact_time(one)
        times.append(one.landings()[0] - contact if contact is not None else float("nan"))
    name = f"{recording.name}: contact to landed [s]"
    yield inside(name, times[0], low - SPREAD_MARGIN, high + SPREAD_MARGIN, px4=f"{times[1]:.3g}")


def braking(recording: Recording, flight: Flight) -> Iterator[Row]:
    """AUTO.LOITER out of fast flight."""
    begin, end = recording.mark("request AUTO.LOITER")
    figures = []
    for one in (flight, recording.flight):
        track = one.truth.between(begin, end)
        heading = track.velocity[0, :2] / np.linalg.norm(track.velocity[0, :2])
        way = (track.position[:, :2] - track.position[0, :2]) @ heading
        speed = track.velocity[:, :2] @ heading
        stopped = track.t[np.flatnonzero(speed < SLOW)[0]] - begin
        deceleration = -np.min(np.gradient(speed, track.t))
        figures.append((float(np.max(way)), float(stopped), float(deceleration)))
    names = ("stopping distance [m]", "time to 0.2 m/s [s]", "peak deceleration [m/s2]")
    for name, stub, px4 in zip(names, *figures, strict=True):
        yield within(f"{recording.name}: braking, {name}", stub, px4, share=SHARE)


def landing(recording: Recording, flight: Flight) -> Iterator[Row]:
    """AUTO.LAND from 5 m: a short rise, then down."""
    begin, _ = recording.mark("request AUTO.LAND")
    figures = []
    for one in (flight, recording.flight):
        track = one.truth.between(begin, contact_time(one) or one.end)
        height = -track.position[:, 2]
        figures.append((float(height.max() - height[0]), float(track.t[-1] - begin)))
    yield within(f"{recording.name}: landing, rises first [m]", figures[0][0], figures[1][0], margin=0.2)
    yield within(f"{recording.name}: landing, to the ground [s]", figures[0][1], figures[1][1], share=SHARE)


def descent(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Speeds of AUTO.LAND, higher up and close to the ground."""
    begin, _ = recording.mark("request AUTO.LAND")
    for upper, lower in ((4.0, 1.5), (0.9, 0.2)):
        name = f"{recording.name}: descent {upper:g} to {lower:g} m [m/s]"
        speeds = [_fall(one.truth.between(begin, one.end), upper, lower) for one in (flight, recording.flight)]
        yield within(name, speeds[0], speeds[1], share=SHARE)


def _fall(track: Track, upper: float, lower: float) -> float:
    """Mean speed of descent [m/s] between two heights."""
    height = -track.position[:, 2]
    above = np.flatnonzero(height > upper)
    first, last = (above[-1] if above.size else 0), np.flatnonzero(height < lower)
    last = last[last > first]
    if not last.size:
        return float("nan")
    return float((height[first] - height[last[0]]) / (track.t[last[0]] - track.t[first]))


def way_home(recording: Recording, flight: Flight) -> Iterator[Row]:
    """AUTO.RTL: how high, how fast, how long."""
    begin, _ = recording.mark("request AUTO.RTL")
    figures = []
    for one in (flight, recording.flight):
        track = one.truth.between(begin, contact_time(one) or one.end)
        level = np.hypot(track.velocity[:, 0], track.velocity[:, 1])
        height = -track.position[:, 2]
        figures.append(
            (
                float(height.max()),
                float(-track.velocity[:, 2].min()),
                float(level.max()),
                float(track.velocity[:, 2].max()),
                float(track.t[-1] - begin),
            )
        )
    names = ("highest [m]", "climb [m/s]", "speed [m/s]", "fastest descent [m/s]", "to the ground [s]")
    for name, stub, px4 in zip(names, *figures, strict=True):
        yield within(f"{recording.name}: {name}", stub, px4, share=SHARE)
