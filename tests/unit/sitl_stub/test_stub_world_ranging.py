"""The simulator's ranging radios, seen through the companion's decoder: neither can hide the other's mistakes."""

from __future__ import annotations

import math
import socket
from dataclasses import replace

import numpy as np
import pytest
from stub_vehicle_support import vehicle

from companion.ranging.packet import decode_packet
from companion.ranging.wire import WireMessage
from sitl_stub.ranging_output import RangingOutput
from sitl_stub.simulation import Simulation
from sitl_stub.truth import TargetTruth, Truth, VehicleTruth
from sitl_stub.world.camera import Dropout
from sitl_stub.world.documents import Interval, WorldFileError
from sitl_stub.world.ranging import TAG, AnchorConfig, Ranging, RangingConfig
from sitl_stub.world.world import World

EXACT = RangingConfig(
    target="pad",
    anchors=(AnchorConfig(id=7, position=(3.0, 0.0, 0.0)), AnchorConfig(id=9, position=(0.0, 2.0, -1.0))),
    rate=50.0,
    std=0.0,
    outlier_fraction=0.0,
    outlier=Interval(0.15, 1.0),
    lost_fraction=0.0,
    latency=0.005,
    reach=60.0,
    silences=(),
)


def truth(
    t: float, *, position=(0.0, 0.0, -4.0), quaternion=(1.0, 0.0, 0.0, 0.0), pad=(10.0, 0.0, 0.0), yaw=0.0
) -> Truth:
    zero = (0.0, 0.0, 0.0)
    return Truth(
        t=t,
        vehicle=VehicleTruth(
            t=t,
            position_ned=position,
            velocity_ned=zero,
            quaternion=quaternion,
            angular_velocity_frd=zero,
            acceleration_ned=zero,
            feet_in_contact=0,
            surface="",
            armed=True,
        ),
        targets=(
            TargetTruth(
                t=t,
                name="pad",
                position_ned=pad,
                yaw=yaw,
                velocity_ned=zero,
                yaw_rate=0.0,
                half_size=(0.4, 0.4),
                moving=False,
                started=False,
            ),
        ),
    )


def heard(
    config: RangingConfig, seconds: float, *, antenna=(0.0, 0.0, 0.0), **where
) -> list[tuple[float, WireMessage]]:
    ranging, messages = Ranging(config, np.random.default_rng(3)), []
    for step in range(round(seconds / 0.004)):
        t = 0.004 * step
        ranging.step(truth(t, **where), antenna)
        for packet in ranging.take(t):
            message = decode_packet(packet)
            assert isinstance(message, WireMessage)
            messages.append((t, message))
    return messages


def ranges(messages: list[tuple[float, WireMessage]], anchor: int) -> np.ndarray:
    return np.array([m.ranges[0].range for _, m in messages if m.ranges[0].anchor == anchor])


def test_anchors_take_turns_at_the_rate_and_packets_are_numbered() -> None:
    messages = heard(EXACT, 2.0)
    assert len(messages) == 100
    assert [m.ranges[0].anchor for _, m in messages] == [7, 9] * 50
    assert [m.sequence for _, m in messages] == list(range(100))
    assert {m.tag for _, m in messages} == {TAG}
    assert messages[0][0] == pytest.approx(0.008)  # measured at 0, 5 ms under way, seen at the next step


def test_a_range_is_the_distance_between_antenna_and_anchor_on_the_turned_pad() -> None:
    turned = 0.5 * math.pi
    half = (math.cos(0.25 * math.pi), 0.0, 0.0, math.sin(0.25 * math.pi))  # the vehicle's nose to the east
    messages = heard(EXACT, 0.1, antenna=(0.3, 0.0, -0.1), quaternion=half, yaw=turned)
    antenna = np.array([0.0, 0.3, -4.1])
    for anchor, place in ((7, (10.0, 3.0, 0.0)), (9, (8.0, 0.0, -1.0))):
        assert ranges(messages, anchor) == pytest.approx(np.linalg.norm(antenna - place), abs=0.0006)


def test_noise_outliers_and_losses_are_as_configured() -> None:
    config = replace(EXACT, std=0.05, outlier_fraction=0.05, lost_fraction=0.1)
    messages = heard(config, 100.0)
    assert len(messages) == pytest.approx(0.9 * 5000, rel=0.02)
    errors = ranges(messages, 7) - math.hypot(13.0, 4.0)
    far = errors > 0.2
    assert far.mean() == pytest.approx(0.05 * (1.0 - 0.2) / 0.85, rel=0.2)  # all but those up to four sigma
    assert errors.max() < 1.0 + 0.25
    assert np.std(errors[np.abs(errors) < 0.15]) == pytest.approx(0.05, rel=0.05)


def test_nothing_is_heard_in_a_silence_or_out_of_reach() -> None:
    times = [t for t, _ in heard(replace(EXACT, silences=(Dropout(begin=0.5, length=1.0),)), 2.0)]
    assert not [t for t in times if 0.51 < t < 1.5]
    assert len(times) == 50
    assert heard(EXACT, 0.2, position=(-80.0, 0.0, 0.0)) == []


def test_the_radios_change_nothing_else_and_the_camera_nothing_about_them() -> None:
    world = World.load("far_pad")
    flights = {
        name: Simulation(chosen, vehicle(), 5, camera)
        for name, chosen, camera in (
            ("with", world, "corners"),
            ("without", replace(world, ranging=None), "corners"),
            ("rendered", world, "rendered"),
        )
    }
    for flight in flights.values():
        flight.advance(0.4)
    assert flights["with"].truth() == flights["without"].truth()
    assert flights["with"].ranges() == flights["rendered"].ranges() != []
    assert flights["without"].ranges() == []


def test_packets_reach_a_port_on_loopback() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(2.0)
        output = RangingOutput(listener.getsockname()[1])
        output.send([b"one", b"two"])
        assert [listener.recv(100), listener.recv(100)] == [b"one", b"two"]
        output.close()


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("anchors: []", "at least one anchor"),
        ("anchors: [{id: 1, position_m: [0, 0, 0]}, {id: 1, position_m: [1, 0, 0]}]", "is taken"),
        ("anchors: [{id: 1, position_m: [0, 0]}]", "3 numbers"),
        ("target: lorry, anchors: [{id: 1, position_m: [0, 0, 0]}]", "must be one of pad"),
        ("rate_hz: 0, anchors: [{id: 1, position_m: [0, 0, 0]}]", "greater than 0"),
        ("noise: 1, anchors: [{id: 1, position_m: [0, 0, 0]}]", "unknown key"),
    ],
)
def test_a_wrong_section_says_what_is_wrong(tmp_path, written: str, said: str) -> None:
    path = tmp_path / "w.yaml"
    path.write_text(
        "version: 1\ntargets:\n  - {name: pad, pad: landing_pad_0p8, start: {north_m: 1, east_m: 0, heading_deg: 0}}\n"
        f"ranging: {{{written}}}\n"
    )
    with pytest.raises(WorldFileError, match=said):
        World.load(path)
