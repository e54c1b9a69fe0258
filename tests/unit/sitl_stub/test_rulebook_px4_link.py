"""The rules about MAVLink, time, parameters, battery and fence, on the simulated PX4. Numbers: docs/rulebook.md."""

import hashlib
import itertools
import math
import struct

import pytest
from pymavlink.dialects.v20 import all as mavlink
from rulebook_bench import (
    GCS,
    commander,
    companion,
    event_named,
    event_numbers,
    flying,
    ground_station,
    mode,
    run_with_sticks,
    set_parameter,
    texts,
    wait_for,
)
from stub_vehicle_support import Client

from sitl_stub.vehicle.mavlink_io import split_frames
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.parameters import parameter_hash
from sitl_stub.vehicle.timesync import Timesync

KEY = bytes(range(32))

# 10: heartbeats


@pytest.mark.parametrize(("kind", "masked"), [(18, False), (GCS, True)])
def test_rule_10_a_companion_that_claims_to_be_a_ground_station_masks_its_loss(kind, masked):
    client = flying()
    client.kind = kind
    set_parameter(client, "NAV_DLL_ACT", 2)
    set_parameter(client, "COM_DL_LOSS_T", 3)
    ground_station(client)
    client.partners.clear()  # it falls silent
    client.run(6.0)
    assert commander(client).failsafe != masked


# 11: resets


def test_rule_11_odometry_counts_resets_and_the_vehicle_flies_to_the_old_setpoint():
    client = flying()
    client.run(3.0)
    start = client.truth.position_ned
    assert client.heard["ODOMETRY"].reset_counter == 11
    before = client.heard["ODOMETRY"].x
    client.simulation.inject("position_jump=3,0,0")
    client.run(0.1)
    assert client.heard["ODOMETRY"].reset_counter == 13  # q13_ekf_reset: position and heading
    assert client.heard["ODOMETRY"].x - before == pytest.approx(3.0, abs=0.2)
    client.run(6.0)
    assert client.truth.position_ned[0] - start[0] == pytest.approx(-3.0, abs=0.3)


def test_rule_11_px4_moves_its_own_setpoint_along():
    client = flying()
    client.run(3.0)
    client.mode(4, 3)
    client.run(3.0)
    start = client.truth.position_ned
    client.simulation.inject("position_jump=3,-2,1")
    client.run(4.0)
    assert math.dist(client.truth.position_ned, start) < 0.3


def test_rule_11_the_counter_wraps_and_each_reset_adds_one_to_four():
    client = companion()
    health = client.simulation.autopilot.estimate_health
    seen = [health.reset_counter]
    for _ in range(100):
        for fault in ("position_jump=0,0,-1", "position_jump=0.5,0,0", "heading_jump=2"):
            client.simulation.inject(fault)
            seen.append(health.reset_counter)
    steps = {(after - before) % 256 for before, after in itertools.pairwise(seen)}
    assert steps == {1, 2}
    assert min(seen) < 11  # it has wrapped
    client.simulation.inject("position_jump=1,0,1")
    assert (health.reset_counter - seen[-1]) % 256 == 3


def test_rule_11_gnss_loss_drifts_and_its_return_resets_by_four():
    client = flying(4.0)
    client.run(3.0)
    offset = position_error(client)
    client.simulation.inject("gnss_lost")
    client.run(5.2)
    assert math.dist(position_error(client), offset) == pytest.approx(5.4, abs=0.5)  # q13_gps_loss: 5.2
    client.run(5.0)
    client.simulation.inject("gnss_back")
    client.run(1.4)
    assert client.heard["ODOMETRY"].reset_counter == 15
    assert math.dist(position_error(client), offset) < 0.1


def position_error(client: Client) -> tuple[float, float]:
    estimate, truth = client.simulation.autopilot.estimate, client.truth.position_ned
    return (estimate.north - truth[0], estimate.east - truth[1])


# 12: time


def test_rule_12_the_autopilot_asks_and_drops_slow_replies():
    client = companion()
    link = client.simulation._links["onboard"]

    def reply(delay: float) -> None:
        asked = next(m for m in reversed(client.of("TIMESYNC")) if m.tc1 == 0)
        due = asked.ts1 * 1e-9 + delay
        client.simulation.advance(client.simulation.t + due - client.simulation.autopilot.boot_time + 0.004)
        client.send(mavlink.MAVLink_timesync_message(int(client.simulation.t * 1e9), asked.ts1))

    client.simulation.advance(client.simulation.t + 0.004)
    client.log.clear()
    while not [m for m in client.of("TIMESYNC") if m.tc1 == 0]:
        client.simulation.advance(client.simulation.t + 0.004)
        client.read()
    reply(0.002)
    assert (link.timesync.samples, link.timesync.dropped) == (1, 0)
    client.log.clear()
    while not [m for m in client.of("TIMESYNC") if m.tc1 == 0]:
        client.simulation.advance(client.simulation.t + 0.004)
        client.read()
    reply(0.012)
    assert (link.timesync.samples, link.timesync.dropped) == (1, 1)


def test_rule_12_it_converges_in_500_samples_and_follows_a_jump_after_ten():
    sync = Timesync()
    for i in range(500):
        assert sync.converged == (i >= 500)
        now = 1_000_000 + 100_000 * i
        sync.update(now, (now - 2_000 - 5_000_000) * 1000, (now - 4_000) * 1000)
    assert sync.converged
    assert sync.offset_us == pytest.approx(5_000_000, abs=50)
    for i in range(11):
        assert sync.converged
        now = 60_000_000 + 100_000 * i
        sync.update(now, (now - 2_000) * 1000, (now - 4_000) * 1000)
    assert not sync.converged


def test_rule_12_time_runs_on_the_autopilots_own_clock():
    client = companion()
    client.send(mavlink.MAVLink_timesync_message(0, 777))
    client.run(0.02)
    answer = next(m for m in client.of("TIMESYNC") if m.ts1 == 777)
    assert answer.tc1 * 1e-9 == pytest.approx(client.simulation.autopilot.boot_time, abs=0.03)
    assert abs(answer.tc1 * 1e-9 - client.simulation.t) > 10.0


# 13: landed states


def test_rule_13_a_reboot_in_flight_says_on_ground_while_still_falling():
    client = flying(8.0)
    client.stream = None
    boots = client.heard["ATTITUDE"].time_boot_ms
    client.simulation.inject("reboot")
    client.log.clear()
    client.run(1.0)
    assert not client.log  # silent while it boots
    assert not client.truth.armed or client.simulation.autopilot.control.commands == [0.0] * 4
    client.run(1.5)
    assert client.heard["ATTITUDE"].time_boot_ms < boots
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == 1
    assert client.heard["ODOMETRY"].reset_counter < 11
    assert client.heard["HEARTBEAT"].system_status == 0
    assert client.arm() == [1]
    client.run(4.5)
    assert client.heard["ODOMETRY"].reset_counter == 11
    assert client.arm() == [0]


def test_rule_13_default_is_on_ground_right_after_the_boot_also_in_the_air():
    client = flying(30.0)
    client.stream = None
    client.simulation.inject("reboot")
    client.run(2.05)
    assert client.truth.feet_in_contact == 0
    assert client.simulation.autopilot.landed


def test_rule_13_offboard_never_says_landing_but_auto_land_does():
    client = flying(1.5)
    goal = client.setpoint(velocity=(0.0, 0.0, 0.7))
    client.stream = lambda t: goal
    client.run(20.0, lambda: not client.truth.armed)
    client.run(0.5)
    assert 4 not in {m.landed_state for m in client.of("EXTENDED_SYS_STATE")}
    client = flying(1.5)
    assert client.mode(4, 6) == [0, 0]
    client.run(0.5)
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == 4


# 14: the fence


@pytest.mark.parametrize(
    ("action", "first", "then"),
    [
        (1, Mode.OFFBOARD, Mode.OFFBOARD),
        (2, Mode.AUTO_LOITER, Mode.AUTO_LOITER),
        (3, Mode.AUTO_LOITER, Mode.AUTO_RTL),
        (5, Mode.AUTO_LOITER, Mode.AUTO_LAND),
        (4, Mode.TERMINATION, Mode.TERMINATION),
    ],
)
def test_rule_14_the_fence_acts_by_itself(action, first, then):
    client = flying()
    ground = ground_station(client)
    client.run(2.5)  # checks are told every 2 s; one that is told only because of a failsafe has no text
    set_parameter(client, "GF_MAX_HOR_DIST", 4.0)
    set_parameter(client, "GF_ACTION", action)
    goal = client.setpoint(position=(6.0, 0.0, -3.0))
    client.stream = lambda t: goal
    client.run(6.0, lambda: commander(client).flags.geofence_breached)
    assert commander(client).flags.geofence_breached
    client.run(0.2)
    assert mode(client) is first
    client.run(5.2)
    assert mode(client) is then
    ground.read()
    assert (2, "Geofence: exceeding maximum distance to Home") in texts(ground)


def test_rule_14_the_height_limit_counts_and_zero_is_none():
    client = flying()
    assert not commander(client).flags.geofence_breached
    set_parameter(client, "GF_MAX_VER_DIST", 2.0)
    wait_for(client, Mode.AUTO_LOITER, 0.5)


# 15: telemetry that must be asked for


def test_rule_15_estimator_and_battery_are_slow_until_asked_for():
    client = companion()
    client.log.clear()
    client.run(4.0)
    assert len(client.of("ESTIMATOR_STATUS")) in (4, 5)
    assert len(client.of("BATTERY_STATUS")) in (2, 3)
    for message in (230, 147, 436, 245):
        assert client.command(511, message, 100_000) == [0]
    client.log.clear()
    client.run(2.0)
    for name in ("ESTIMATOR_STATUS", "BATTERY_STATUS", "CURRENT_MODE", "EXTENDED_SYS_STATE"):
        assert len(client.of(name)) == pytest.approx(20, abs=1), name
    assert client.command(511, 436, -1) == [0]
    client.log.clear()
    client.run(2.5)
    assert client.of("CURRENT_MODE") == []


def test_rule_15_battery_ladder_low_says_critical_returns_emergency_lands():
    client = flying()
    ground = ground_station(client)
    client.simulation.inject("battery=13")
    client.run(4.0)
    assert mode(client) is Mode.OFFBOARD
    client.simulation.inject("battery=6")
    wait_for(client, Mode.AUTO_LOITER, 5.0)
    assert wait_for(client, Mode.AUTO_RTL, 6.0) == pytest.approx(5.0, abs=0.15)  # q17_battery_critical
    client.run(2.0)
    ground.read()
    said = texts(ground)
    assert said.index((2, "Low battery")) < said.index((2, "Critical battery"))
    assert (2, "Failsafe activated: entering Hold for 5 seconds") in said
    assert client.heard["BATTERY_STATUS"].charge_state == 3
    assert event_named(client, "commander_failsafe_enter_low_bat")


def test_rule_15_emergency_charge_ends_in_a_landing():
    client = flying()
    ground = ground_station(client)
    client.simulation.inject("battery=3")
    wait_for(client, Mode.AUTO_LOITER, 8.0)
    wait_for(client, Mode.AUTO_LAND, 6.0)
    client.run(2.0)
    ground.read()
    assert (0, "Emergency battery level") in texts(ground)
    client.run(40.0, lambda: not client.truth.armed)
    assert client.arm() == [1]


def test_rule_15_a_battery_that_drains_goes_down_the_ladder_in_time():
    client = companion()
    set_parameter(client, "SIM_BAT_DRAIN", 60.0)
    goal = client.setpoint(position=(0.0, 0.0, -3.0))
    client.stream = lambda t: goal
    client.run(0.5)
    client.mode(6)
    client.arm()
    low = client.run(60.0, lambda: commander(client).flags.battery_warning == 1)
    assert low == pytest.approx(52.05, abs=0.3)  # q17_battery
    critical = client.run(10.0, lambda: commander(client).flags.battery_warning == 2)
    assert critical == pytest.approx(4.76, abs=0.3)
    assert client.run(10.0, lambda: commander(client).flags.battery_warning == 3) == pytest.approx(1.2, abs=0.3)


# 19: who is listened to


def test_rule_19_every_source_is_acted_on_and_parameters_can_be_set_in_flight():
    client = flying()
    stranger = Client(client.simulation, kind=18)
    stranger.mav.srcSystem, stranger.mav.srcComponent = 77, 3
    assert stranger.mode(4, 3) == [0, 0]
    assert mode(client) is Mode.AUTO_LOITER
    set_parameter(stranger, "MPC_XY_CRUISE", 3.0)


def test_rule_19_parameters_have_px4s_names_types_and_errors():
    client = companion()
    client.log.clear()
    client.send(mavlink.MAVLink_param_request_list_message(1, 1))
    client.run(1.2)
    listed = client.of("PARAM_VALUE")
    assert len(listed) == 890
    assert (listed[0].param_id, listed[0].param_type, listed[0].param_index) == ("_HASH_CHECK", 5, 65535)
    coded = struct.unpack("<I", struct.pack("<f", listed[0].param_value))[0]
    assert coded == parameter_hash(client.simulation.autopilot.parameters)
    assert {m.param_index for m in listed[1:]} == set(range(889))
    for name, kind, error in ((b"_HASH_CHECK", 5, 5), (b"NO_SUCH", 9, 1), (b"COM_OF_LOSS_T", 6, 7)):
        client.send(mavlink.MAVLink_param_set_message(1, 1, name, 1.0, kind))
        client.run(0.02)
        assert client.heard["PARAM_ERROR"].error == error
    set_parameter(client, "COM_OF_LOSS_T", 900.0)  # out of the documented range, taken all the same


# 20: one datagram, one parser


def test_rule_20_garbage_in_a_datagram_costs_no_frame():
    client = companion()
    commands = [
        bytes(mavlink.MAVLink_command_long_message(1, 1, number, 0, 0, 0, 0, 0, 0, 0, 0).pack(client.mav))
        for number in (31997, 31998, 31999)
    ]
    client.log.clear()
    client.simulation.receive("onboard", b"\x00\xfe\x01" + commands[0] + b"abc" + commands[1])
    client.simulation.receive("onboard", b"\xfd\xfd\xfd")
    client.simulation.receive("onboard", commands[2])
    client.run(0.02)
    assert [m.command for m in client.of("COMMAND_ACK")] == [31997, 31998, 31999]


def test_rule_20_each_datagram_of_the_autopilot_is_one_frame():
    client = companion()
    client.run(1.0)
    assert all(len(split_frames(datagram)) == 1 for datagram in client.raw)


# 21: signing


def signed(message, key: bytes, timestamp: int, *, link: int = 7) -> bytes:
    encoder = mavlink.MAVLink(None, srcSystem=1, srcComponent=191)
    encoder.signing.secret_key, encoder.signing.link_id, encoder.signing.timestamp = key, link, timestamp
    encoder.signing.sign_outgoing = True
    return bytes(message.pack(encoder))


def ping(number: int):
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, 0, 0, 0, 0, 0, 0, 0)


def acknowledged(client: Client, datagram: bytes) -> bool:
    client.log.clear()
    client.simulation.receive("onboard", datagram)
    client.run(0.02)
    return bool(client.of("COMMAND_ACK"))


def locked(client: Client) -> None:
    set_parameter(client, "MAV_SIGN_CFG", 2)
    client.send(mavlink.MAVLink_setup_signing_message(1, 1, list(KEY), 10_000_000))


def test_rule_21_a_forged_frame_does_not_lock_the_true_one_out():
    client = companion()
    locked(client)
    assert acknowledged(client, signed(ping(31990), KEY, 10_000_100))
    assert not acknowledged(client, signed(ping(31991), bytes(32), 2**47))  # far in the future, wrong key
    assert acknowledged(client, signed(ping(31992), KEY, 10_000_101))


def test_rule_21_with_a_key_unsigned_and_replayed_frames_are_dropped():
    client = companion()
    locked(client)
    frame = signed(ping(31990), KEY, 10_000_100)
    assert acknowledged(client, frame)
    assert not acknowledged(client, frame)
    assert not acknowledged(client, bytes(ping(31993).pack(client.mav)))
    assert not acknowledged(client, signed(ping(31994), KEY, 10_000_000 - 60 * 100_000 - 10, link=9))  # too old
    assert acknowledged(client, signed(ping(31995), KEY, 9_999_000, link=9))


def test_rule_21_with_a_key_only_what_is_verified_is_forwarded_and_keeps_its_signature():
    client = companion()
    ground = ground_station(client)
    locked(client)
    text = mavlink.MAVLink_statustext_message(6, b"hello")
    forged, true = signed(text, bytes(32), 10_000_100), signed(text, KEY, 10_000_101)
    ground.raw.clear()
    for frame in (bytes(text.pack(client.mav)), forged, true):
        client.simulation.receive("onboard", frame)
    ground.read()
    assert [frame for frame in ground.raw if frame[6] == 191] == [true]


def test_rule_21_without_a_key_everything_is_accepted_and_everything_sent_is_signed_with_zeros():
    client = companion()
    assert acknowledged(client, signed(ping(31990), KEY, 5))
    assert acknowledged(client, bytes(ping(31991).pack(client.mav)))
    for frame in client.raw[-20:]:
        assert frame[2] & 1
        assert frame[-13] == 255
        assert hashlib.sha256(bytes(32) + frame[:-6]).digest()[:6] == frame[-6:]


def test_rule_21_with_a_key_the_autopilot_signs_with_it():
    client = companion()
    locked(client)
    client.read()
    client.raw.clear()
    client.run(0.2)
    assert all(hashlib.sha256(KEY + frame[:-6]).digest()[:6] == frame[-6:] for frame in client.raw)


# measured on the running autopilot


def test_measured_set_mode_is_answered_twice_and_set_mode_once():
    client = flying()
    assert client.mode(3) == [0, 1]
    client.log.clear()
    client.send(mavlink.MAVLink_set_mode_message(1, 1, Mode.AUTO_LOITER.custom_mode))
    client.run(0.02)
    assert [m.result for m in client.of("COMMAND_ACK")] == [0]


def test_measured_the_first_mode_with_sticks_is_position():
    client = companion()
    run_with_sticks(client, 0.3)
    assert mode(client) is Mode.POSCTL
    client = companion()
    client.mode(4, 3)
    run_with_sticks(client, 0.3)
    assert mode(client) is Mode.AUTO_LOITER


def test_measured_reboot_and_calibration_are_refused_in_the_air():
    client = flying()
    assert client.command(246, 1) == [2]
    assert client.command(241, 1) == [1]


def test_measured_texts_only_for_ground_stations_events_for_all():
    client = companion()
    client.mode(99)
    assert client.of("STATUSTEXT") == []
    assert event_named(client, "commander_unsupported_main_mode")


def test_measured_checks_are_reported_in_full_on_request():
    client = companion()
    client.log.clear()
    assert client.command(401) == [0]
    assert event_numbers(client) == [27825120, 17154777, 19865031, 17231145, 23579003, 18691879]


def test_measured_precision_landing_on_a_landing_target():
    client = flying(3.0)
    client.run(3.0)
    client.mode(4, 9)
    for _ in range(200):
        message = mavlink.MAVLink_landing_target_message(
            0, 0, 1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.5, -1.0, 0.0, (1.0, 0.0, 0.0, 0.0), 2, 1
        )
        client.send(message)
        client.run(0.2)
        if not client.truth.armed:
            break
    assert not client.truth.armed
    assert math.dist(client.truth.position_ned[:2], (1.5, -1.0)) < 0.25


def test_measured_requests_for_single_messages():
    client = companion()
    for number, result in ((148, 0), (300, 0), (435, 0), (242, 0), (49, 0), (245, 0), (410, 2), (99999, 2)):
        assert client.command(512, number) == [result], number
    assert client.heard["GPS_GLOBAL_ORIGIN"].altitude == 489400
    assert client.heard["AVAILABLE_MODES"].mode_index == client.heard["AVAILABLE_MODES"].number_modes


def test_measured_truth_has_no_time_and_whole_accelerations():
    client = flying()
    assert client.command(512, 115) == [0]
    truth = client.heard["HIL_STATE_QUATERNION"]
    assert truth.time_usec == 0
    assert max(map(abs, (truth.xacc, truth.yacc, truth.zacc))) <= 12
