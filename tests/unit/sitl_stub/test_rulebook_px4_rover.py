"""Rules of docs/rulebook.md that are a rover's, shown by the simulated autopilot."""

import math

import pytest
from pymavlink.dialects.v20 import all as mavlink
from stub_rover_support import OFFBOARD, RTL, mode, offboard, speed, stream, yaw


def test_rule_17_setpoints_lost_it_drives_on_then_home_and_setpoints_back_end_it():
    client = offboard(velocity=(2.0, 2.0, 0.0))
    client.run(8.0)
    client.stream = None
    lost = client.run(2.0, lambda: mode(client) == RTL)
    assert lost == pytest.approx(1.0, abs=0.1)
    assert speed(client) > 1.0  # PX4 drives on with the last setpoint until then
    client.run(1.5)
    assert client.heard["HEARTBEAT"].system_status == mavlink.MAV_STATE_CRITICAL
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_LANDING
    client.run(4.0)
    towards = math.atan2(-client.truth.position_ned[1], -client.truth.position_ned[0])
    assert abs(math.remainder(yaw(client) - towards, math.tau)) < 0.2
    assert speed(client) > 2.0
    stream(client, velocity=(0.0, 0.0, 0.0))
    assert client.run(0.2, lambda: mode(client) == OFFBOARD) < 0.05
    client.run(3.0)
    assert speed(client) == 0.0


def test_rule_17_an_explicit_zero_before_the_stop_leaves_nothing_to_drive_on():
    client = offboard(velocity=(2.0, 2.0, 0.0))
    client.run(8.0)
    stream(client, velocity=(0.0, 0.0, 0.0))
    client.run(2.0)
    client.stream = None
    north, east, _ = client.truth.position_ned
    client.run(2.0, lambda: mode(client) == RTL)
    assert math.dist(client.truth.position_ned[:2], (north, east)) < 0.05
