"""Rows of commanded motion: position, velocity and yaw steps, circles, accelerations, take-off, wind."""

import math
from collections.abc import Iterator

import numpy as np

from sitl_stub.fidelity import motion
from sitl_stub.fidelity.flight import Angles, Array, Flight, Track
from sitl_stub.fidelity.recording import Recording
from sitl_stub.fidelity.row import Row, at_most, inside, within

RMS_SHARE = 0.12
"""Largest RMS difference, as a share of the step or radius."""
TIME_SHARE = 0.20
"""Tolerance of rise times and lags."""
OVERSHOOT = 5.0
"""Tolerance of overshoot [points of per cent]."""
SMOOTHING = 1.0
"""Overshoot of a speed is that of its mean over so long [s]: gusts of the estimate are up to 7 % of 1 m/s."""
AFTER = 2.0
"""Time [s] after a velocity step at which what it has reached is compared."""
TAKEOFF = {0.1: (3.17, 3.45), 1.0: (3.79, 4.04), 2.5: (4.53, 4.72), 4.5: (6.07, 7.13)}
"""Height [m] and when 21 take-offs of PX4 reached it, from the arm command on [s]: figures.json."""
TAKEOFF_MARGIN = 0.3


def position_step(recording: Recording, flight: Flight, words: str, axis: int, size: float) -> Iterator[Row]:
    """One step of the position setpoint along an axis (0 north, 1 east, 2 down) by `size` [m]."""
    begin, end = recording.mark(words)
    name = f"{recording.name}: {words}"
    stub, px4 = flight.truth.between(begin, end), recording.flight.truth.between(begin, end)
    rms = motion.rms_difference(px4.t, px4.position, stub.t, stub.position)
    yield at_most(f"{name}, RMS difference [m]", rms, "0", RMS_SHARE * abs(size))
    mine, other = _response(flight.estimate, begin, end, axis), _response(recording.flight.estimate, begin, end, axis)
    yield within(f"{name}, rise 10-90 % [s]", motion.rise_time(*mine), motion.rise_time(*other), share=TIME_SHARE)
    yield within(f"{name}, overshoot [%]", motion.overshoot(mine[1]), motion.overshoot(other[1]), margin=OVERSHOOT)


def _response(track: Track, begin: float, end: float, axis: int) -> tuple[Array, Array]:
    """Time and share of the way, 0 at the mark and 1 where the last second is."""
    part = track.between(begin, end)
    values = part.position[:, axis]
    final = float(np.mean(values[part.t > end - 1.0]))
    return part.t, (values - values[0]) / (final - values[0])


def velocity_step(
    recording: Recording, flight: Flight, index: int, axis: int, speeds: tuple[float, float]
) -> Iterator[Row]:
    """The step of the velocity setpoint between two `speeds` [m/s] along an axis at the mark number `index`."""
    begin, words = recording.marks[index]
    end = recording.marks[index + 1][0]
    name = f"{recording.name}: {words} at {begin:.0f} s"
    stub, px4 = flight.truth.between(begin, end), recording.flight.truth.between(begin, end)
    rms = motion.rms_difference(px4.t, px4.velocity[:, axis], stub.t, stub.velocity[:, axis])
    yield at_most(f"{name}, RMS difference [m/s]", rms, "0", RMS_SHARE * abs(speeds[1] - speeds[0]))

    def share(track: Track) -> Array:
        before = track.velocity[0, axis]
        changed: Array = (track.velocity[:, axis] - before) / (speeds[1] - before)
        return changed

    mine, other = share(stub), share(px4)
    half = [motion.first_time(stub.t, mine, 0.5) - begin, motion.first_time(px4.t, other, 0.5) - begin]
    yield within(f"{name}, half of it after [s]", half[0], half[1], share=TIME_SHARE)
    reached = [100.0 * float(np.interp(begin + AFTER, t, y)) for t, y in ((stub.t, mine), (px4.t, other))]
    yield within(f"{name}, reached after {AFTER:g} s [%]", reached[0], reached[1], share=RMS_SHARE)
    beyond = [motion.overshoot(motion.moving_mean(t, y, SMOOTHING)) for t, y in ((stub.t, mine), (px4.t, other))]
    yield within(f"{name}, overshoot [%]", beyond[0], beyond[1], margin=OVERSHOOT)


def circle(recording: Recording, flight: Flight, speed: int, radius: float = 5.0) -> Iterator[Row]:
    """A commanded circle at `speed` [m/s]."""
    words = f"circle radius 5 m at {speed} m/s"
    begin, end = recording.mark(words)
    name = f"{recording.name}: {words}"
    sent = [entry for entry in recording.inputs if entry.kind == "cmd" and begin <= entry.t < end]
    place = np.array([[float(entry.values.get(axis, 0.0)) for axis in "xyz"] for entry in sent])
    wanted = Track(t=np.array([entry.t for entry in sent]), position=place, velocity=np.zeros_like(place))
    stub, px4 = flight.truth.between(begin, end), recording.flight.truth.between(begin, end)
    rms = motion.rms_difference(px4.t, px4.position, stub.t, stub.position)
    yield at_most(f"{name}, RMS difference [m]", rms, "0", RMS_SHARE * radius)
    lags = [motion.circle_lag(track, wanted) for track in (stub, px4)]
    yield within(f"{name}, lag [s]", lags[0], lags[1], share=TIME_SHARE)
    radii = [motion.circle_radius(track, wanted) for track in (stub, px4)]
    yield within(f"{name}, mean radius [m]", radii[0], radii[1], share=RMS_SHARE)


def yaw_step(recording: Recording, flight: Flight, words: str, size: float) -> Iterator[Row]:
    """One step of the yaw setpoint by `size` [deg]."""
    begin, end = recording.mark(words)
    name = f"{recording.name}: {words}"
    (t, stub), (px4_t, px4) = (_yaw(f.attitude, begin, end) for f in (flight, recording.flight))
    rms = motion.rms_difference(px4_t, px4, t, stub)
    yield at_most(f"{name}, RMS difference [deg]", rms, "0", RMS_SHARE * abs(size))
    shares = (t, stub / size), (px4_t, px4 / size)
    rises = [motion.rise_time(*share) for share in shares]
    yield within(f"{name}, rise 10-90 % [s]", rises[0], rises[1], share=TIME_SHARE)
    beyond = [motion.overshoot(share[1]) for share in shares]
    yield within(f"{name}, overshoot [%]", beyond[0], beyond[1], margin=OVERSHOOT)


def yaw_rate_step(recording: Recording, flight: Flight, words: str, rate: float) -> Iterator[Row]:
    """A commanded yaw rate [deg/s]: turning, and turning on after it ended."""
    begin, end = recording.mark(words)
    index = [mark[0] for mark in recording.marks].index(begin)
    stop = recording.marks[index + 2][0]
    name = f"{recording.name}: {words}"
    turning = [_yaw(f.attitude, begin, end) for f in (flight, recording.flight)]
    times = [motion.first_time(t, _slope(t, yaw) / rate, 0.5) - begin for t, yaw in turning]
    yield within(f"{name}, half of it after [s]", times[0], times[1], share=TIME_SHARE)
    steady = [float(np.mean(_slope(t, yaw)[t > end - 1.0])) for t, yaw in turning]
    yield within(f"{name}, steady [deg/s]", steady[0], steady[1], share=RMS_SHARE)
    on = [abs(float(_yaw(f.attitude, end, stop)[1][-1])) for f in (flight, recording.flight)]
    yield within(f"{name}, turns on afterwards [deg]", on[0], on[1], share=TIME_SHARE)


def _yaw(angles: Angles, begin: float, end: float) -> tuple[Array, Array]:
    """Times and how far the vehicle has turned since the mark [deg], continuous."""
    part = (angles.t >= begin) & (angles.t < end)
    turned = np.degrees(np.unwrap(angles.roll_pitch_yaw[part, 2]))
    return angles.t[part], turned - turned[0]


def _slope(t: Array, values: Array, window: float = 0.1) -> Array:
    """Derivative over a centred window [s]."""
    ahead, behind = np.interp(t + 0.5 * window, t, values), np.interp(t - 0.5 * window, t, values)
    slope: Array = (ahead - behind) / (np.minimum(t + 0.5 * window, t[-1]) - np.maximum(t - 0.5 * window, t[0]))
    return slope


def takeoff(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Heights over time of a take-off, against the spread of PX4's 21."""
    armed = next(entry.t for entry in recording.inputs if entry.kind == "command" and entry.values["command"] == 400)
    for height, (low, high) in TAKEOFF.items():
        mine = motion.first_time(flight.truth.t, -flight.truth.position[:, 2], height) - armed
        other = motion.first_time(recording.flight.truth.t, -recording.flight.truth.position[:, 2], height) - armed
        name = f"{recording.name}: {height:g} m high after [s]"
        yield inside(name, mine, low - TAKEOFF_MARGIN, high + TAKEOFF_MARGIN, px4=f"{other:.3g}")
    climbs = [-float(np.min(f.truth.velocity[:, 2])) for f in (flight, recording.flight)]
    yield within(f"{recording.name}: peak climb [m/s]", climbs[0], climbs[1], share=TIME_SHARE)


def acceleration(recording: Recording, flight: Flight, words: str, axis: int) -> Iterator[Row]:
    """Speed gained while only an acceleration is commanded. Open loop: PX4's own tilt error of 1 to 2 deg is in it."""
    begin, end = recording.mark(words)
    gains = []
    for track in (flight.truth.between(begin, end), recording.flight.truth.between(begin, end)):
        gains.append(float(track.velocity[-1, axis] - track.velocity[0, axis]))
    drift = 9.81 * math.radians(2.0) * 1.0
    name = f"{recording.name}: {words}, speed gained [m/s]"
    yield within(name, gains[0], gains[1], share=TIME_SHARE, margin=drift)


def gust(recording: Recording, flight: Flight) -> Iterator[Row]:
    """A step of the wind in hover."""
    begin, end = recording.mark("wind from north")
    figures = []
    for one in (flight, recording.flight):
        track = one.truth.between(begin, end)
        away = np.abs(track.position[:, 0] - track.position[0, 0])
        furthest = int(np.argmax(away))
        part = (one.attitude.t > end - 3.0) & (one.attitude.t < end)
        pitch = math.degrees(float(np.mean(one.attitude.roll_pitch_yaw[part, 1])))
        figures.append((float(away[furthest]), float(track.t[furthest] - begin), pitch))
    names = ("moves [m]", "furthest after [s]", "steady pitch [deg]")
    for name, stub, px4 in zip(names, *figures, strict=True):
        yield within(f"{recording.name}: wind 4 m/s, {name}", stub, px4, share=TIME_SHARE)
