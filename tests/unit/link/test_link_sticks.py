"""Sticks on the wire: MANUAL_CONTROL as PX4 reads it."""

import math

import pytest
from pymavlink.dialects.v20 import common as mavlink

from companion.link.outgoing import Encoder
from companion.messages.motion import SticksSetpoint


def sent(throttle: float, steering: float):
    encoder = Encoder(system=7, component=1, own_component=191)
    setpoint = SticksSetpoint(t=1.0, speed=0.0, yaw_rate=0.0, throttle=throttle, steering=steering)
    (message,) = mavlink.MAVLink(None).parse_buffer(encoder.sticks(setpoint))
    return message


@pytest.mark.parametrize(
    ("throttle", "steering", "z", "y"),
    [(0.0, 0.0, 500, 0), (1.0, -1.0, 1000, -1000), (-1.0, 1.0, 0, 1000), (0.25, 0.3, 625, 300)],
)
def test_throttle_and_steering_are_where_px4_looks_for_them(throttle, steering, z, y) -> None:
    message = sent(throttle, steering)
    assert message.get_type() == "MANUAL_CONTROL"
    assert (message.target, message.z, message.y) == (7, z, y)
    assert (message.x, message.r, message.buttons) == (0, 0, 0)


@pytest.mark.parametrize("sticks", [(1.01, 0.0), (0.0, -1.01), (math.nan, 0.0), (0.0, math.inf)])
def test_sticks_beyond_their_ends_are_not_sent(sticks) -> None:
    with pytest.raises(ValueError, match="sticks"):
        sent(*sticks)
