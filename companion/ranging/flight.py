"""What a recorded flight says for the calibration of its anchors: the antenna's path, the ranges, the pad's place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from companion.errors import RecordingError
from companion.estimation.anchor_calibration import AnchorCalibration
from companion.estimation.anchor_problem import FlownPath, FlownRanges
from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z, yaw_of
from companion.recording import Recording

CHANNELS = ("ownship", "range", "measurement")  # that are read
_ODOMETRY_STD = 0.005  # [m] of one position against a smooth path: PX4's estimate at 50 Hz in calm flight
_SIGHTINGS_LEAST = 20  # of the pad
_PAD_MOVES = 0.15  # [m] median distance of its sightings from their middle, above which it moved


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedFlight:
    """The longest part of a flight without a jump of the autopilot's estimate."""

    path: FlownPath  # of the tag's antenna, in ned
    ranges: FlownRanges
    resets: int  # of the autopilot's estimate in the whole flight
    sightings: tuple[tuple[float, Array, float], ...]  # of the pad: time, position (3,) in ned [m], heading [rad]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PadPlace:
    """Where the pad lay during the flight."""

    position: Array  # (3,) [m] in the calibration's frame
    heading: float  # [rad] from north, clockwise

    def from_ned(self, position: Array) -> Array:
        """Give a position (3,) in `pad`: the pad counts as level."""
        turned: Array = rotation_about_z(-self.heading) @ (position - self.position)
        return turned


def recorded_flight(recording: Recording, lever_arm: tuple[float, float, float]) -> RecordedFlight:
    """Read the flight out of a recording.

    Args:
        recording: with the channels `ownship` and `range`, and `measurement` where the pad was seen.
        lever_arm: of the tag's antenna [m], forward, right, down.

    Raises:
        RecordingError: it has no odometry or no ranges.
    """
    states, ranges = recording.of("ownship"), recording.of("range")
    for channel, records in (("ownship", states), ("range", ranges)):
        if len(records) < 2:
            raise RecordingError(
                f"the recording has no messages of the channel {channel}; "
                "give one of a flight with `ranging.input` set, from take-off to landing"
            )
    times = np.array([state.data["t"] for state in states])
    counters = np.array([state.data["reset_counter"] for state in states])
    usable = np.concatenate([[True], np.diff(times) > 0.0])
    jumps = np.flatnonzero(np.diff(counters) != 0) + 1
    edges = [0, *jumps.tolist(), times.size]
    first, last = max(pairwise(edges), key=lambda part: part[1] - part[0])
    kept = np.flatnonzero(usable[first:last]) + first
    attitudes = np.array([states[i].data["ned_from_frd"] for i in kept])
    origins = np.array([states[i].data["position_ned"] for i in kept])
    path = FlownPath(
        t=times[kept],
        position=origins + attitudes @ np.array(lever_arm),
        covariance=np.eye(3) * _ODOMETRY_STD**2,
    )
    return RecordedFlight(
        path=path,
        ranges=FlownRanges(
            t=np.array([record.data["t"] for record in ranges]),
            anchor=np.array([record.data["anchor"] for record in ranges], dtype=float),
            range=np.array([record.data["range"] for record in ranges]),
        ),
        resets=jumps.size,
        sightings=_sightings(recording, times[kept], origins, attitudes),
    )


def pad_place(flight: RecordedFlight, calibration: AnchorCalibration) -> PadPlace | None:
    """Give where the pad lay, the odometry's drift taken out; None where it was hardly seen, or moved."""
    if len(flight.sightings) < _SIGHTINGS_LEAST:
        return None
    positions = np.array([position + calibration.drift_at(t) for t, position, _ in flight.sightings])
    headings = [heading for _, _, heading in flight.sightings]
    middle = np.median(positions, axis=0)
    if float(np.median(np.linalg.norm(positions - middle, axis=1))) > _PAD_MOVES:
        return None
    heading = math.atan2(float(np.median(np.sin(headings))), float(np.median(np.cos(headings))))
    return PadPlace(position=middle, heading=heading)


def _sightings(
    recording: Recording, times: Array, origins: Array, attitudes: Array
) -> tuple[tuple[float, Array, float], ...]:
    """Give the pad's place in ned, by each measurement of it."""
    found = []
    for record in recording.of("measurement"):
        t = float(record.data["t"])
        if not times[0] <= t <= times[-1]:
            continue
        nearest = int(np.argmin(np.abs(times - t)))
        yaw = yaw_of(attitudes[nearest])
        position = origins[nearest] + rotation_about_z(yaw) @ np.array(record.data["position_level"])
        found.append((t, position, yaw + float(record.data["heading"])))
    return tuple(found)
