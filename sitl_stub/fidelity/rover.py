"""The stub's rover beside PX4's: figures of r01 to r05.

SIH's drag depends on the direction (speed squared is taken axis by axis of an Earth-fixed frame), so PX4's speeds are
evened out: multiplied by the root of the drag in their direction over its mean, which is what the stub has. Where SIH
turns a reversing car to the wrong side, setpoints are compared and not the motion.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from sitl_stub.fidelity.rover_drive import (
    PLACE,
    SPEED_SETPOINT,
    STEERING,
    THROTTLE,
    YAW,
    YAW_RATE_SETPOINT,
    Array,
    Drive,
    read_drive,
    replay,
)
from sitl_stub.fidelity.row import Row, never_in_either, within
from sitl_stub.vehicle.kinds import load_vehicle

VEHICLE, SEED = "sih_rover", 1
NORTH_AXES, EAST_AXES = (-0.7278, -0.1094, 0.6770), (-0.1486, 0.9889, 0.0)
"""North and east at SIH's place in the Earth-fixed frame."""
MEAN_DRAG = 0.834
"""Mean of north's and east's drag, as a share of SIH_KDV; the vehicle file's drag is this."""
SPEED_SHARE, TIME_SHARE, TIME_MARGIN, ANGLE = 0.12, 0.20, 0.15, 10.0
STILL = 0.05
"""Speed [m/s] below which the rover stands."""


def evened(place: Array) -> Array:
    """PX4's true speeds [m/s], shape (n,), as they were if SIH's drag were the same in all directions."""
    velocity = place[:, 3:5]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    axes = velocity @ np.array([NORTH_AXES, EAST_AXES]) / np.maximum(speed, 1e-9)[:, None]
    evened_out: Array = speed * np.sqrt(np.sum(np.abs(axes) ** 3, axis=1) / MEAN_DRAG)
    return evened_out


def plain(place: Array) -> Array:
    """The stub's true speeds [m/s], shape (n,)."""
    speeds: Array = np.hypot(place[:, 3], place[:, 4])
    return speeds


class Beside:
    """A recorded drive and the stub's, measured alike."""

    def __init__(self, px4: Drive, stub: Drive) -> None:
        self._sides = ((stub, plain), (px4, evened))
        self.name = px4.name

    def _row(self, part: str, figure: str, values: Sequence[float], *, share: float = 0.0, margin: float = 0.0) -> Row:
        name, (stub, px4) = f"{self.name}: {part}, {figure}", values
        if math.isnan(stub) and math.isnan(px4):
            return never_in_either(name)
        return within(name, stub, px4, share=share, margin=margin)

    def steady_speed(self, words: str, number: int = 0) -> Row:
        """Mean speed in the last 1.5 s of a part."""
        values = []
        for drive, speeds in self._sides:
            _, end = drive.mark(words, number)
            values.append(float(np.mean(speeds(drive.part(PLACE, end - 1.5, end)))))
        return self._row(words, "steady speed [m/s]", values, share=SPEED_SHARE, margin=STILL)

    def peak_speed(self, words: str) -> Row:
        """Greatest speed in a part."""
        values = [float(np.max(speeds(drive.part(PLACE, *drive.mark(words))))) for drive, speeds in self._sides]
        return self._row(words, "peak speed [m/s]", values, share=SPEED_SHARE)

    def stop_time(self, words: str, number: int = 0) -> Row:
        """Time from the mark until the rover stands, having moved."""
        values = []
        for drive, _ in self._sides:
            begin, end = drive.mark(words, number)
            place = drive.part(PLACE, begin, end)
            moving = np.flatnonzero(plain(place) > STILL)
            values.append(float(place[moving[-1], 0] - begin) if moving.size else math.nan)
        return self._row(words, "stands after [s]", values, share=TIME_SHARE, margin=TIME_MARGIN)

    def way(self, words: str, axis: int, number: int = 0, *, share: float, margin: float) -> Row:
        """How far a part moves the rover along north (0) or east (1)."""
        values = []
        for drive, _ in self._sides:
            place = drive.part(PLACE, *drive.mark(words, number))
            values.append(float(place[-1, 1 + axis] - place[0, 1 + axis]))
        return self._row(words, f"way {('north', 'east')[axis]} [m]", values, share=share, margin=margin)

    def heading(self, words: str, number: int = 0) -> Row:
        """Heading at the end of a part, unwrapped to be near PX4's."""
        values = []
        for drive, _ in self._sides:
            _, end = drive.mark(words, number)
            values.append(math.degrees(float(drive.part(YAW, end - 0.5, end)[-1, 1])))
        values[0] = values[1] + math.remainder(values[0] - values[1], 360.0)
        return self._row(words, "heading [deg]", values, margin=ANGLE)

    def turned(self, words: str, number: int = 0) -> Row:
        """Change of heading over a part."""
        values = []
        for drive, _ in self._sides:
            yaw = np.unwrap(drive.part(YAW, *drive.mark(words, number))[:, 1])
            values.append(math.degrees(float(yaw[-1] - yaw[0])))
        return self._row(words, "change of heading [deg]", values, margin=ANGLE)

    def quarter_turn(self, words: str) -> Iterator[Row]:
        """Time to 90 % of a turn by 90 deg, and overshoot."""
        rises, overshoots = [], []
        for drive, _ in self._sides:
            begin, end = drive.mark(words)
            part = drive.part(YAW, begin, end)
            share = np.unwrap(part[:, 1]) / (0.5 * math.pi)
            rises.append(float(part[np.argmax(share > 0.9), 0] - begin))
            overshoots.append(90.0 * float(np.max(share) - 1.0))
        yield self._row(words, "90 % after [s]", rises, share=TIME_SHARE)
        yield self._row(words, "overshoot [deg]", overshoots, margin=5.0)

    def advance(self, words: str) -> Row:
        """How far north the rover still gets when it is told to go east, as a time at the speed that it had [s]."""
        values = []
        for drive, _ in self._sides:
            begin, _ = drive.mark(words)
            place = drive.part(PLACE, begin, begin + 2.0)
            values.append(float((np.max(place[:, 1]) - place[0, 1]) / place[0, 3]))
        return self._row(words, "advance over speed [s]", values, share=TIME_SHARE)

    def turn_rate(self, words: str, *, margin: float = 2.0) -> Row:
        """Mean yaw rate in the last 2 s of a part."""
        values = []
        for drive, _ in self._sides:
            _, end = drive.mark(words)
            part = drive.part(YAW, end - 2.0, end)
            yaw = np.unwrap(part[:, 1])
            values.append(math.degrees(float((yaw[-1] - yaw[0]) / (part[-1, 0] - part[0, 0]))))
        return self._row(words, "turn rate [deg/s]", values, share=SPEED_SHARE, margin=margin)

    def setpoint(self, words: str, series: str, *, margin: float) -> Row:
        """Median of a setpoint in the last 1.5 s of a part."""
        values = []
        for drive, _ in self._sides:
            _, end = drive.mark(words)
            values.append(float(np.median(drive.part(series, end - 1.5, end)[:, 1])))
        return self._row(words, series, values, margin=margin)

    def backwards(self, begin: float, end: float) -> Row:
        """Greatest speed against the heading."""
        values = []
        for drive, _ in self._sides:
            place = drive.part(PLACE, begin, end)
            yaw = np.interp(place[:, 0], drive.series[YAW][:, 0], np.unwrap(drive.series[YAW][:, 1]))
            along = place[:, 3] * np.cos(yaw) + place[:, 4] * np.sin(yaw)
            values.append(float(np.max(-along)))
        return self._row("all of it", "fastest backwards [m/s]", values, margin=STILL)

    def sequence(self, channel: str) -> Iterator[Row]:
        """Events of one channel: how many agree in value and order, and the greatest difference in time."""
        lists = []
        for drive, _ in self._sides:
            begin, end = drive.marks[0][0], drive.marks[-1][0]
            lists.append([event for event in drive.events if begin <= event.t < end - 0.3])
        stub, px4 = ([event for event in events if event.channel == channel] for events in lists)
        same = 0
        while same < min(len(stub), len(px4)) and stub[same].value == px4[same].value:
            same += 1
        first = max(len(stub), len(px4)) if same == len(stub) == len(px4) else same
        yield self._row("sequence", f"{channel}, equal events", (float(first), float(len(px4))))
        late = max((abs(a.t - b.t) for a, b in zip(stub[:same], px4[:same], strict=True)), default=0.0)
        yield self._row("sequence", f"{channel}, greatest difference in time [s]", (late, 0.0), margin=0.3)


def position_goals(beside: Beside) -> Iterator[Row]:
    """Goals of r01."""
    for words in ("request arm", "position 6 m E", "back to the start"):
        yield beside.peak_speed(words)
    for words, axis in (("request arm", 0), ("position 6 m E", 1), ("back to the start", 0)):
        yield beside.way(words, axis, share=0.0, margin=0.25)


def velocities(beside: Beside) -> Iterator[Row]:
    """Velocities of r02: speeds, turn, stop, loss."""
    for words, number in (
        ("velocity 1 m/s N", 0),
        ("velocity 2 m/s N", 0),
        ("velocity 1 m/s E", 0),
        ("velocity 2 m/s S", 0),
        ("velocity 0.3 m/s S", 0),
        ("acceleration only", 0),
        ("velocity 1 m/s N", 2),
    ):
        yield beside.steady_speed(words, number)
    yield beside.peak_speed("setpoint loss")
    turn = "velocity 1 m/s E (heading"
    yield from beside.quarter_turn(turn)
    yield beside.advance(turn)
    stop = "velocity 0"
    yield beside.stop_time(stop, 1)
    yield beside.way(stop, 1, 1, share=TIME_SHARE, margin=0.1)
    yield beside.turned(stop, 1)
    yield beside.heading("setpoint loss")


def reverse_attempts(beside: Beside) -> Iterator[Row]:
    """OFFBOARD attempts of r03 to drive backwards."""
    for words, number in (
        ("LOCAL_NED velocity (-1,0,0) from", 0),
        ("LOCAL_NED velocity (1,0,0)", 0),
        ("LOCAL_NED velocity (-1,0,0) with", 0),
        ("LOCAL_NED velocity (1,0,0)", 1),
    ):
        yield beside.heading(words, number)
        yield beside.steady_speed(words, number)
    yield beside.peak_speed("position goal 3 m behind")
    yield beside.backwards(5.7, 42.0)


def sticks(beside: Beside) -> Iterator[Row]:
    """Stick positions of r04. Where SIH turns to the wrong side, or diverges, only what PX4 asked for counts."""
    speed_loop, rate_loop = "posctl" in beside.name, "manual_manual" not in beside.name
    for words in ("throttle +0.5, steering +0.3", "throttle +0.25, steering -0.3"):
        yield beside.steady_speed(words)
        yield beside.turn_rate(words)
    yield beside.steady_speed("throttle +0.5, steering 0")
    # straight on: PX4's gyro noise and estimate make it wander, the stub is driven without them
    yield beside.turn_rate("throttle +0.5, steering 0", margin=5.0)
    straight = "throttle -0.5, steering 0"
    if not speed_loop and "stab" not in beside.name:
        yield beside.steady_speed(straight)
        yield beside.turned(straight)
    for words in (straight, "throttle -0.5, steering +0.3", "throttle -0.5, steering -0.3"):
        if speed_loop:
            yield beside.setpoint(words, SPEED_SETPOINT, margin=0.01)
        if rate_loop and words != straight:
            yield beside.setpoint(words, YAW_RATE_SETPOINT, margin=0.02)
        yield beside.setpoint(words, THROTTLE, margin=0.01)
        if not rate_loop:
            yield beside.setpoint(words, STEERING, margin=0.01)
    for words in ("throttle 0, steering +0.5", "z = -500"):
        yield beside.steady_speed(words)


def hand_over(beside: Beside) -> Iterator[Row]:
    """OFFBOARD, POSCTL and OFFBOARD of r05."""
    yield beside.steady_speed("request arm")
    yield beside.setpoint("throttle -0.5", SPEED_SETPOINT, margin=0.01)
    yield beside.setpoint("throttle -0.5", THROTTLE, margin=0.01)
    for words in ("companion: OFFBOARD", "stick moved"):
        yield beside.steady_speed(words)
        yield beside.heading(words)


MEASURES: Mapping[str, Callable[[Beside], Iterator[Row]]] = {
    "r01_position": position_goals,
    "r02_velocity": velocities,
    "r03_reverse": reverse_attempts,
    "r04_manual_manual": sticks,
    "r04_manual_acro": sticks,
    "r04_manual_stab": sticks,
    "r04_manual_posctl": sticks,
    "r05_posctl_offboard_mix": hand_over,
}
"""Recording -> its rows."""


def experiment_rows(folder: Path, name: str) -> Iterator[Row]:
    """Compare one recorded drive, a key of `MEASURES`. Raises `DriveError` when the recording is missing."""
    recorded, inputs = read_drive(folder, name)
    beside = Beside(recorded, replay(recorded, inputs, load_vehicle(VEHICLE), seed=SEED, noise=False))
    yield from MEASURES[name](beside)
    for channel in ("ack", "mode", "armed", "landed"):
        yield from beside.sequence(channel)
