"""Real PX4 traffic of a short flight (SIH quadrotor): take-off, 4 m north, AUTO.LAND."""

from __future__ import annotations

import gzip
import itertools
import struct
from pathlib import Path

import numpy as np
import pytest

from companion.link.arming import transmitter_heard
from companion.link.autopilot_link import AutopilotLink
from companion.link.events import EstimatorReset, ModeChanged, WrongVehicle
from companion.link.framing import StreamFramer
from companion.link.parameters import LinkParameters
from companion.link.signing import Signing
from companion.messages.ownship import FlightMode, LandedState

EXTRACT = Path(__file__).parents[2] / "data" / "px4_sih_onboard_link.tlog.gz"


def records(path: Path) -> list[tuple[float, bytes]]:
    """Time [s] and frame of each entry of a tlog."""
    data, position, found = gzip.decompress(path.read_bytes()), 0, []
    while position < len(data):
        (stamp,) = struct.unpack_from(">Q", data, position)
        frame = position + 8
        end = frame + 12 + data[frame + 1] + (13 if data[frame + 2] & 1 else 0)
        found.append((stamp * 1e-6, data[frame:end]))
        position = end
    t0 = found[0][0]
    return [(t - t0, frame) for t, frame in found]


class Flight:
    def __init__(self) -> None:
        self.link = AutopilotLink(LinkParameters())
        self.records = records(EXTRACT)
        self.states, self.events, self.statuses = [], [], []
        tick = 0.0
        for t, frame in self.records:
            self.link.receive(frame, t)
            while tick <= t:
                self.link.poll(t)
                self.statuses.append(self.link.status(t))
                tick += 0.1
            self.states += self.link.take_ownship()
            self.events += self.link.events()


@pytest.fixture(scope="module")
def flight() -> Flight:
    return Flight()


def test_every_frame_is_understood(flight):
    statistics = flight.link.statistics()
    assert statistics.bad_bytes == 0
    assert statistics.undecodable == 0
    assert statistics.odometry_invalid == 0
    assert statistics.frames + statistics.foreign == len(flight.records)
    # The tlog holds both directions: ours and the ground station's frames are not the vehicle's.
    assert set(statistics.foreign_sources) == {(1, 191), (255, 190)}


def test_modes_and_landed_states(flight):
    modes = [event.mode for event in flight.events if isinstance(event, ModeChanged)]
    assert modes == [FlightMode.AUTO_LOITER, FlightMode.OFFBOARD, FlightMode.AUTO_LAND]
    assert not any(event.commanded for event in flight.events if isinstance(event, ModeChanged))
    landed = [status.landed for status in flight.statuses]
    assert landed[5] is LandedState.ON_GROUND
    assert LandedState.IN_AIR in landed
    assert landed[-1] is LandedState.LANDING  # AUTO.LAND, not yet down
    assert flight.statuses[-1].armed
    assert flight.statuses[-1].estimate_valid
    assert flight.statuses[-1].battery_remaining == pytest.approx(0.79, abs=0.02)
    assert not any(isinstance(event, WrongVehicle | EstimatorReset) for event in flight.events)


def test_ownship_flies_up_and_north(flight):
    position = np.array([state.position_ned for state in flight.states])
    assert abs(position[0]).max() < 0.5
    assert position[:, 2].min() == pytest.approx(-3.0, abs=0.5)
    assert position[:, 0].max() == pytest.approx(4.0, abs=0.5)
    assert all(state.reset_counter == 11 for state in flight.states)
    for state in flight.states[::20]:
        assert state.ned_from_frd @ state.ned_from_frd.T == pytest.approx(np.eye(3), abs=1e-6)


def test_velocity_is_in_the_same_frame_as_position(flight):
    """The integral of the velocity is the change of the position: child frame 1 means north, east, down."""
    t = np.array([state.t for state in flight.states])
    position = np.array([state.position_ned for state in flight.states])
    velocity = np.array([state.velocity_ned for state in flight.states])
    moved = np.sum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(t)[:, None], axis=0)
    error = moved - (position[-1] - position[0])  # not zero: the estimator pulls the position towards its sensors
    assert np.abs(error[:2]).max() < 0.2
    assert abs(error[2]) < 0.8


def test_acceleration_integrates_to_velocity_and_is_calm_in_hover(flight):
    t = np.array([state.t for state in flight.states])
    velocity = np.array([state.velocity_ned for state in flight.states])
    acceleration = np.array([state.acceleration_ned for state in flight.states])
    summed = np.sum(acceleration[1:] * np.diff(t)[:, None], axis=0)
    assert summed == pytest.approx(velocity[-1] - velocity[0], abs=0.15)
    hover = (t > 8.5) & (t < 9.5)  # 3 m reached, the step to the north not yet asked
    assert hover.sum() > 20
    assert acceleration[hover].std(axis=0).max() < 0.5


def test_order_of_time_is_kept(flight):
    t = [state.t for state in flight.states]
    assert all(a < b for a, b in itertools.pairwise(t))


def test_the_signatures_of_a_real_px4_are_right(flight):
    """Without a key PX4 signs with 32 zeros, link id 255 and a counter."""
    signing = Signing(secret=bytes(32), link_id=1, timestamp=0)
    frames = [frame for _, frame in flight.records if frame[2] & 1 and (frame[5], frame[6]) == (1, 1)]
    assert len(frames) > 1000
    assert all(signing.verify(frame, signed=True, source=(1, 1)) for frame in frames)
    assert all(not signing.verify(frame, signed=True, source=(1, 1)) for frame in frames[::50])  # repeated
    assert signing.statistics().accepted == len(frames)
    assert signing.statistics().forged == 0


def test_a_byte_stream_of_it_falls_into_the_same_frames(flight):
    frames = [frame for _, frame in flight.records]
    stream, framer, dice = b"".join(frames), StreamFramer(), np.random.default_rng(3)
    found, at = [], 0
    while at < len(stream):
        length = int(dice.integers(1, 300))
        found += framer.feed(stream[at : at + length])
        at += length
    assert found == frames[: len(found)]
    assert len(frames) - len(found) <= 1  # an unknown message at the very end waits for what follows
    assert framer.statistics().skipped == 0


def test_the_health_that_it_reports(flight):
    health = flight.link.health()
    assert health.estimator is not None
    assert health.sensors is not None
    ratios = health.estimator[:4]
    assert all(0.0 <= ratio < 1.0 for ratio in ratios)
    assert any(ratio > 0.0 for ratio in ratios)
    assert not transmitter_heard(health.sensors)
