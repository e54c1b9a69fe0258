"""Rule 21 of PX4's: a frame is verified before anything of it is kept."""

from __future__ import annotations

import pytest
from link_fake_autopilot import LAND, FakeAutopilot
from pymavlink.dialects.v20 import common as mavlink

from companion.errors import InputError
from companion.link.autopilot_link import AutopilotLink
from companion.link.parameters import LinkParameters
from companion.link.signing import TICKS_PER_S, Signing, load_signing_key, signing_time
from companion.messages.ownship import FlightMode

KEY, OTHER = bytes(range(32)), bytes(range(1, 33))
NOW = signing_time(1_790_000_000.0)
MINUTE = 60 * TICKS_PER_S


def autopilot(key: bytes | None = KEY, stamp: int = NOW, link_id: int = 3) -> FakeAutopilot:
    one = FakeAutopilot()
    if key is not None:
        signing = one.mavlink.signing
        signing.secret_key, signing.link_id, signing.timestamp, signing.sign_outgoing = key, link_id, stamp, True
    return one


def signing(stamp: int = NOW) -> Signing:
    return Signing(secret=KEY, link_id=9, timestamp=stamp)


def link(own: Signing | None = None) -> AutopilotLink:
    return AutopilotLink(LinkParameters(), own or signing())


def verdicts(one: AutopilotLink) -> tuple[int, int, int, int]:
    counted = one.statistics().signing
    assert counted is not None
    return counted.accepted, counted.unsigned, counted.forged, counted.old


def test_what_the_autopilot_signs_is_heard():
    one = link()
    one.receive(autopilot().heartbeat(), 0.0)
    assert one.status(0.0).connected
    assert verdicts(one) == (1, 0, 0, 0)


@pytest.mark.parametrize(
    ("stranger", "counted"),
    [(autopilot(None), (0, 1, 0, 0)), (autopilot(OTHER), (0, 0, 1, 0)), (autopilot(bytes(32)), (0, 0, 1, 0))],
    ids=["unsigned", "another key", "no key, which PX4 signs with zeros"],
)
def test_with_a_key_nothing_else_is_heard(stranger, counted):
    one = link()
    for frame in (
        stranger.heartbeat(),
        stranger.odometry(101.0),
        stranger.pack(mavlink.MAVLink_attitude_message(*[0] * 7)),
    ):
        one.receive(frame, 0.0)
        assert not one.recognises(frame)
    assert not one.status(0.0).connected
    assert one.events() == []
    assert one.take_ownship() == []
    assert verdicts(one) == tuple(3 * count for count in counted)
    assert one.statistics().frames == 0


def test_what_a_ground_station_of_its_own_gets_is_signed_with_rising_timestamps():
    one = AutopilotLink(LinkParameters(), signing(), ground_station=True)
    station = signing()
    for index in range(3):
        one.poll(float(index))
        frames = one.pilot.take_ground()
        assert frames
        assert all(station.verify(frame, signed=bool(frame[2] & 1), source=(1, 191)) for frame in frames)


def test_without_a_key_signed_frames_are_heard_unverified():
    one = AutopilotLink(LinkParameters())
    one.receive(autopilot(bytes(32)).heartbeat(), 0.0)
    assert one.status(0.0).connected
    assert one.statistics().signing is None


def test_a_forged_frame_from_the_future_locks_nobody_out():
    one, vehicle = link(), autopilot()
    one.receive(vehicle.heartbeat(), 0.0)
    one.receive(autopilot(OTHER, stamp=NOW + 1000 * MINUTE).heartbeat(), 0.0)
    vehicle.mode = LAND
    one.receive(vehicle.heartbeat(), 0.1)
    assert one.status(0.1).mode is FlightMode.AUTO_LAND
    assert verdicts(one) == (2, 0, 1, 0)
    own = signing()
    own.verify(autopilot(OTHER, stamp=NOW + 1000 * MINUTE).heartbeat(), signed=True, source=(1, 1))
    assert own.stamp() == NOW + 1


def test_a_changed_byte_anywhere_is_noticed():
    frame = autopilot().heartbeat()
    for index in range(1, len(frame)):
        damaged = bytearray(frame)
        damaged[index] ^= 1
        assert not signing().authentic(bytes(damaged))


def test_repeated_and_older_frames_are_refused():
    one, vehicle = link(), autopilot()
    first, second = vehicle.heartbeat(), vehicle.heartbeat()
    one.receive(second, 0.0)
    one.receive(second, 0.1)
    one.receive(first, 0.2)
    assert verdicts(one) == (1, 0, 0, 2)


def test_each_link_of_the_autopilot_has_a_time_of_its_own():
    one, near, far = link(), autopilot(link_id=0), autopilot(stamp=NOW - MINUTE // 2, link_id=1)
    for _ in range(3):
        one.receive(near.heartbeat(), 0.0)
        one.receive(far.heartbeat(), 0.0)
    assert verdicts(one) == (6, 0, 0, 0)


@pytest.mark.parametrize(("behind", "accepted"), [(MINUTE - 10, 1), (MINUTE + 10, 0)])
def test_a_new_stream_may_be_a_minute_behind(behind, accepted):
    one = link()
    one.receive(autopilot(stamp=NOW - behind).heartbeat(), 0.0)
    assert verdicts(one) == (accepted, 0, 0, 1 - accepted)


def test_an_autopilot_that_restarted_is_recognised_and_heard_once_it_knows_the_time():
    """PX4 starts with the time of the key's set-up, and follows every newer stamp that it verifies."""
    one, vehicle = link(), autopilot(stamp=NOW - 100000 * MINUTE)
    old = vehicle.heartbeat()
    assert one.recognises(old)  # so that the transport has a peer to answer
    one.receive(old, 0.0)
    assert not one.status(0.0).connected
    (beat,) = one.poll(0.0)
    parser = mavlink.MAVLink(None)
    parser.signing.secret_key = KEY
    assert [message.get_type() for message in parser.parse_buffer(beat)] == ["HEARTBEAT"]
    vehicle.mavlink.signing.timestamp = max(vehicle.mavlink.signing.timestamp, parser.signing.timestamp)
    one.receive(vehicle.heartbeat(), 0.1)
    assert one.status(0.1).connected


def test_everything_that_goes_out_is_signed_and_newer_than_what_was_before():
    one, vehicle = link(), autopilot()
    one.receive(vehicle.heartbeat(), 1.0)
    datagrams = [datagram for k in range(5) for datagram in one.poll(1.0 + 0.02 * k)]
    assert len(datagrams) > 5
    stamps = [int.from_bytes(datagram[-12:-6], "little") for datagram in datagrams]
    assert all(datagram[2] == 1 and datagram[-13] == 9 for datagram in datagrams)
    assert all(signing().authentic(datagram) for datagram in datagrams)
    assert stamps == sorted(set(stamps))
    assert stamps[0] == NOW + TICKS_PER_S + 1


def test_a_companion_whose_clock_was_never_set_follows_the_autopilot():
    own = signing(signing_time(1000.0))
    one = link(own)
    one.receive(autopilot().heartbeat(), 0.0)
    assert own.stamp() > NOW


@pytest.mark.parametrize("data", [KEY, KEY.hex().encode() + b"\n"])
def test_a_key_is_read_from_bytes_or_digits(tmp_path, data):
    path = tmp_path / "key"
    path.write_bytes(data)
    path.chmod(0o600)
    assert load_signing_key(path) == KEY


@pytest.mark.parametrize(
    ("data", "mode", "word"),
    [
        (None, 0, "cannot be read"),
        (KEY[:31], 0o600, "no key"),
        (b"not hexadecimal", 0o600, "no key"),
        (bytes(32), 0o600, "all zeros"),
        (KEY, 0o640, "open to other users"),
    ],
)
def test_what_is_no_key_is_said(tmp_path, data, mode, word):
    path = tmp_path / "key"
    if data is not None:
        path.write_bytes(data)
        path.chmod(mode)
    with pytest.raises(InputError, match=word) as caught:
        load_signing_key(path)
    assert caught.value.problems[0].source == str(path)
