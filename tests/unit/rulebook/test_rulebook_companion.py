"""The rules that describe the companion, tested against the simulated PX4. Numbers: docs/rulebook.md."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink
from rulebook_rig import DT, Ahead, Rig

from companion.messages.guardian import GuardianState
from companion.messages.motion import Setpoint
from companion.messages.ownship import FlightMode

SETPOINT = "SET_POSITION_TARGET_LOCAL_NED"


def silent_after(rig: Rig, start: float) -> list[float]:
    """Times after `start` at which setpoints were sent all the same."""
    return [t - start for t, message in rig.sent if message.get_type() == SETPOINT and t > start + 1e-9]


def mode_requests(rig: Rig) -> list[int]:
    return [int(m.param2) for m in rig.of("COMMAND_LONG") if m.command == 176]


def test_rule_01_streams_50_hz_for_a_second_before_it_asks():
    rig = Rig().in_offboard()
    asked = next(t for t, m in rig.sent if m.get_type() == "COMMAND_LONG" and m.command == 176)
    before = [t for t, m in rig.sent if m.get_type() == SETPOINT and t <= asked]
    assert asked - before[0] >= 1.0
    assert np.diff(before) == pytest.approx(DT, abs=1e-6)


def test_rule_02_after_a_gap_it_holds_where_it_is():
    rig = Rig().in_offboard()
    rig.simulation.advance(rig.t + 0.4)  # the program stands still
    resumed_from = len(rig.sent)
    rig.run(0.4)
    first = next(m for _, m in rig.sent[resumed_from:] if m.get_type() == SETPOINT)
    here = rig.simulation.autopilot.estimate.position
    assert math.dist((first.x, first.y, first.z), here) < 0.2
    assert math.hypot(first.vx, first.vy, first.vz) < 0.1
    assert rig.mode == "OFFBOARD"


def test_rule_03_a_failsafe_is_left_alone():
    rig = Rig().in_offboard()
    asked = len(mode_requests(rig))
    rig.simulation.inject("battery=6")
    rig.run(12.0)
    assert rig.mode in ("AUTO_LOITER", "AUTO_RTL")
    assert len(mode_requests(rig)) == asked
    assert rig.out.state is GuardianState.MUTED


@pytest.mark.parametrize("mode", [FlightMode.AUTO_LOITER, FlightMode.AUTO_LAND, FlightMode.AUTO_RTL])
def test_rule_05_another_hand_on_the_mode_silences_it(mode):
    rig = Rig().in_offboard()
    start = rig.t
    rig.ground_mode(mode)
    rig.run(3.0)
    assert all(delay <= 0.1 for delay in silent_after(rig, start))
    assert rig.mode == mode.name
    assert rig.guardian.taken_over


def test_rule_05_termination_silences_it():
    rig = Rig().in_offboard()
    start = rig.t
    rig.command(185, 1.0)
    rig.run(2.0)
    assert all(delay <= 0.1 for delay in silent_after(rig, start))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_rule_06_what_is_not_finite_is_not_sent(bad):
    rig = Rig()
    rig.run(1.0)
    setpoint = Setpoint(
        t=rig.t,
        position_ned=None,
        velocity_ned=np.array([bad, 0.0, 0.0]),
        acceleration_ned=np.zeros(3),
        yaw=0.0,
        yaw_rate=0.0,
    )
    with pytest.raises(ValueError, match="finite"):
        rig.link.setpoint(setpoint, rig.t)


def test_rule_06_every_setpoint_sets_x_and_y_together():
    rig = Rig().in_offboard()
    for message in rig.of(SETPOINT):
        assert message.coordinate_frame == 1
        assert message.type_mask & 7 in (0, 7)
        assert message.type_mask & ~7 == 0


def test_rule_07_the_magic_number_is_never_sent():
    rig = Rig()
    rig.run(2.0)
    rig.link.arm(rig.t)
    rig.run(2.0)
    rig.link.disarm(rig.t)
    rig.run(2.0)
    assert [m.param1 for m in rig.of("COMMAND_LONG") if m.command == 400][:1] == [1.0]
    assert all(m.param2 == 0.0 for m in rig.of("COMMAND_LONG") if m.command == 400)


def test_rule_09_after_disarming_it_leaves_offboard_and_stops():
    rig = Rig().in_offboard()
    rig.command(400, 0.0, 21196.0)
    rig.run(3.0)
    start = rig.t
    rig.run(2.0)
    assert silent_after(rig, start) == []
    assert rig.mode != "OFFBOARD"


def test_rule_10_its_heartbeat_is_that_of_an_onboard_controller_once_a_second():
    rig = Rig()
    rig.run(10.0)
    beats = rig.of("HEARTBEAT")
    assert {(m.type, m.get_srcSystem()) for m in beats} == {(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 1)}
    assert len(beats) in (10, 11)


def test_rule_11_a_reset_moves_the_setpoint_with_it():
    rig = Rig().in_offboard()
    rig.run(1.0)
    start = rig.simulation.truth().vehicle.position_ned
    rig.simulation.inject("position_jump=3,-1,0")
    rig.run(5.0)
    assert rig.mode == "OFFBOARD"
    assert math.dist(rig.simulation.truth().vehicle.position_ned, start) < 0.5


def test_rule_12_it_asks_for_the_time_and_sends_none_of_its_own():
    rig = Rig()
    rig.run(5.0)
    assert not rig.of("SYSTEM_TIME")
    assert len(rig.of("TIMESYNC")) > 10


def test_rule_13_a_reboot_in_flight_silences_it():
    rig = Rig().in_offboard()
    rig.simulation.inject("reboot")
    rig.run(3.0)
    start = rig.t
    rig.run(6.0)
    assert silent_after(rig, start) == []
    assert rig.out.state is GuardianState.MUTED


def test_rule_15_slow_messages_are_raised():
    rig = Rig()
    rig.run(8.0)
    asked = {int(m.param1): m.param2 for m in rig.of("COMMAND_LONG") if m.command == 511}
    intervals = {number: link_interval(rig, number) for number in (230, 147)}
    assert 230 in asked or intervals[230] <= 1.0
    assert 147 in asked or intervals[147] <= 2.0
    assert 436 in asked  # CURRENT_MODE, the early sign of a takeover


def link_interval(rig: Rig, number: int) -> float:
    return float(rig.simulation._links["onboard"]._intervals.get(number, math.inf))


def test_rule_16_a_program_that_hangs_falls_silent():
    rig = Rig().in_offboard()
    count = len(rig.of(SETPOINT))
    rig.run(1.0)
    assert len(rig.of(SETPOINT)) - count == 50  # one for each tick
    count = len(rig.of(SETPOINT))
    rig.simulation.advance(rig.t + 3.0)  # nobody ticks
    assert len(rig.of(SETPOINT)) == count
    assert rig.mode == "AUTO_RTL"


def test_rule_17_before_it_falls_silent_it_has_asked_for_standstill():
    rig = Rig().in_offboard()
    rig.trajectory = Ahead(rig.trajectory.here, rig.trajectory.reset_counter, since=rig.t)
    rig.run(1.0)
    assert math.hypot(rig.of(SETPOINT)[-1].vx, rig.of(SETPOINT)[-1].vy) > 0.9
    rig.planning, rig.trajectory = False, None  # the plan has come to its end
    rig.run(8.0, lambda: rig.out.state is GuardianState.MUTED)
    assert rig.out.state is GuardianState.MUTED
    last = rig.of(SETPOINT)[-1]
    assert math.hypot(last.vx, last.vy, last.vz) < 1e-3
    assert math.hypot(*rig.simulation.truth().vehicle.velocity_ned) < 0.3


def test_rule_18_a_new_process_only_observes():
    rig = Rig().in_offboard()
    again = Rig(simulation=rig.simulation)
    again.run(0.9)
    assert not again.of(SETPOINT)
    assert not [m for m in again.of("COMMAND_LONG") if m.command not in (511, 512)]
    assert again.of("HEARTBEAT")
    again.run(5.0)
    assert again.out.state is GuardianState.MUTED
    assert again.mode == "AUTO_RTL"


def test_rule_19_only_the_configured_vehicle_is_heard_and_only_allowed_messages_are_sent():
    rig = Rig().in_offboard()
    allowed = {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG", "PARAM_REQUEST_READ", SETPOINT}
    assert {m.get_type() for _, m in rig.sent} <= allowed
    stranger = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    forged = mavlink.MAVLink_heartbeat_message(2, 12, 209, 3 << 16, 5, 3)
    rig.link.receive(bytes(forged.pack(stranger)), rig.t)
    rig.run(1.0)
    assert rig.out.state is GuardianState.FOLLOWING
    assert rig.link.statistics().foreign == 1


def test_rule_20_garbage_between_frames_costs_none():
    rig = Rig()
    rig.run(1.0)
    lost = rig.link.statistics().lost
    for datagram in rig.simulation.transmit("onboard"):
        rig.link.receive(b"\xfd\x00\xfe" + datagram, rig.t)
    for _ in range(50):
        rig.simulation.advance(rig.t + DT)
        for datagram in rig.simulation.transmit("onboard"):
            rig.link.receive(b"\xfd\x00\xfe", rig.t)
            rig.link.receive(datagram, rig.t)
    assert rig.link.statistics().lost == lost
    assert rig.link.status(rig.t).connected
