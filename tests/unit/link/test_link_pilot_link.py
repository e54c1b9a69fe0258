from __future__ import annotations

import itertools
import math
import socket

import numpy as np
import pytest
from link_fake_autopilot import FakeAutopilot
from pymavlink.dialects.v20 import common as mavlink

from companion.link.autopilot_link import AutopilotLink
from companion.link.endpoints import UdpEndpoint
from companion.link.ground_station import GroundStationSender
from companion.link.parameters import LinkParameters
from companion.messages.decision import Mode
from companion.messages.pilot import LandingTarget, PilotText, Severity, Stand


def decoded(datagram: bytes):
    (message,) = mavlink.MAVLink(None).parse_buffer(datagram)
    return message


def target(t: float, **changed) -> LandingTarget:
    values = {
        "t": t,
        "position_ned": np.array([1.0, -2.0, 3.0]),
        "yaw": 0.5,
        "position_std": 0.1,
        "distance": 3.0,
        "angle_right": 0.1,
        "angle_down": -0.2,
        "size_right": 0.3,
        "size_down": 0.2,
    }
    return LandingTarget(**(values | changed))


def connected(boot_offset: float = 100.0, *, ground_station: bool = False, seconds: float = 3.0):
    link = AutopilotLink(LinkParameters(), ground_station=ground_station)
    autopilot = FakeAutopilot(boot_offset=boot_offset)
    t = 1000.0
    for index in range(round(seconds / 0.02)):
        if index % 50 == 0:
            link.receive(autopilot.heartbeat(), t)
        for answer in autopilot.hear(link.poll(t), t + 0.004):
            link.receive(answer, t + 0.008)
        t += 0.02
    return link, t


@pytest.mark.parametrize("boot_offset", [100.0, 950.0])
def test_the_stamp_is_the_capture_in_the_autopilots_time(boot_offset: float) -> None:
    link, t = connected(boot_offset)
    (datagram,) = link.landing_target(target(t - 0.12))
    message = decoded(datagram)
    assert message.time_usec * 1e-6 == pytest.approx(t - 0.12 - boot_offset, abs=0.002)


def test_place_and_heading_are_those_of_the_target() -> None:
    link, t = connected()
    message = decoded(link.landing_target(target(t))[0])
    assert (message.frame, message.position_valid) == (mavlink.MAV_FRAME_LOCAL_NED, 1)
    assert (message.x, message.y, message.z) == (1.0, -2.0, 3.0)
    assert 2.0 * math.atan2(message.q[3], message.q[0]) == pytest.approx(0.5)
    assert (message.q[1], message.q[2]) == (0.0, 0.0)


def test_landing_targets_are_bounded_in_rate() -> None:
    link, t = connected()
    sent = sum(len(link.landing_target(target(t + 0.01 * index))) for index in range(100))
    assert sent in (25, 26)  # every fourth of 100 Hz is the first that is 1/30 s after the one before


def test_nothing_that_is_not_finite_is_sent() -> None:
    link, t = connected()
    with pytest.raises(ValueError, match="finite"):
        link.landing_target(target(t, position_ned=np.array([1.0, math.nan, 0.0])))


def test_without_an_autopilot_texts_wait_and_landing_targets_do_not() -> None:
    link = AutopilotLink(LinkParameters())
    link.pilot.say(PilotText(severity=Severity.INFO, text="hello"))
    assert [decoded(datagram).get_type() for datagram in link.poll(1.0)] == ["HEARTBEAT"]
    assert link.landing_target(target(1.0)) == []
    link.receive(FakeAutopilot().heartbeat(), 1.1)
    kinds = [decoded(datagram).get_type() for datagram in link.poll(1.12)]
    assert "STATUSTEXT" in kinds


def test_a_ground_station_of_its_own_gets_the_same_and_no_commands() -> None:
    link, t = connected(ground_station=True)
    link.pilot.take_ground()
    link.pilot.present(Stand.ENGAGED, Mode.SEARCH)
    link.pilot.say(PilotText(severity=Severity.ERROR, text="x" * 70))
    own, ground = [], []
    for _ in range(60):
        t += 0.02
        own += [decoded(datagram) for datagram in link.poll(t)]
        ground += [decoded(datagram) for datagram in link.pilot.take_ground()]
    assert {message.get_type() for message in ground} == {"STATUSTEXT", "HEARTBEAT"}
    mine = [m.to_dict() for m in own if m.get_type() in ("STATUSTEXT", "HEARTBEAT")]
    assert mine == [message.to_dict() for message in ground]
    sequences = [message.get_seq() for message in ground]
    assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(sequences))
    beat = next(message for message in ground if message.get_type() == "HEARTBEAT")
    assert (beat.system_status, beat.custom_mode) == (mavlink.MAV_STATE_ACTIVE, 2 << 8 | 3)


def test_the_socket_to_a_ground_station_sends_and_survives_nobody_listening() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.bind(("127.0.0.1", 0))
        ground.settimeout(2.0)
        sender = GroundStationSender(UdpEndpoint(host="127.0.0.1", port=ground.getsockname()[1]))
        sender.send(b"hello")
        assert ground.recv(100) == b"hello"
    for _ in range(5):
        sender.send(b"nobody")
    assert sender.sent + sender.errors == 6
    sender.close()
