"""Attitude and body thrust on the wire: SET_ATTITUDE_TARGET as PX4 reads it, with what pymavlink lacks of it."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink

from companion.link.outgoing import Encoder
from companion.messages.thrust import AttitudeThrust
from sitl_stub.vehicle.attitude_setpoints import decode


def frame(yaw=0.4, thrust=(0.3, -0.2, 0.0), time_boot_ms=1234) -> bytes:
    encoder = Encoder(system=7, component=1, own_component=191)
    return encoder.attitude_thrust(AttitudeThrust(t=1.0, yaw=yaw, thrust_body=np.array(thrust)), time_boot_ms)


def test_it_arrives_as_a_level_attitude_and_a_body_thrust() -> None:
    (message,) = mavlink.MAVLink(None).parse_buffer(frame())
    assert message.get_type() == "SET_ATTITUDE_TARGET"
    assert (message.target_system, message.target_component, message.time_boot_ms) == (7, 1, 1234)
    assert message.type_mask == 1 | 2 | 4 | 32
    read = decode(message)
    assert read.thrust_body == pytest.approx((0.3, -0.2, 0.0))
    assert message.q == pytest.approx([math.cos(0.2), 0.0, 0.0, math.sin(0.2)])


@pytest.mark.parametrize("values", [{"yaw": math.nan}, {"thrust": (1.01, 0.0, 0.0)}, {"thrust": (0.0, math.nan, 0.0)}])
def test_what_no_vehicle_can_do_is_not_sent(values) -> None:
    with pytest.raises(ValueError, match="a thrust within"):
        frame(**values)
