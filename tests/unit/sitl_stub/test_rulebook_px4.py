"""The rules about modes, failsafes, setpoints and landing, on the simulated PX4. Numbers: docs/rulebook.md."""

import math

import pytest
from rulebook_bench import (
    commander,
    companion,
    event_named,
    flying,
    ground_station,
    map_radio,
    mode,
    run_with_radio,
    run_with_sticks,
    set_parameter,
    sticks,
    texts,
    wait_for,
)

from sitl_stub.vehicle.modes import Mode


def silence(client):
    stream, client.stream = client.stream, None
    return stream


# 1: what makes OFFBOARD valid


@pytest.mark.parametrize(("gap", "holds"), [(0.95, True), (1.3, False)])
def test_rule_01_setpoints_must_arrive_within_the_loss_time(gap, holds):
    client = flying()
    goal = silence(client)(0.0)
    for _ in range(3):
        client.send_setpoint(goal)
        client.run(gap)
    assert (mode(client) is Mode.OFFBOARD) == holds


def test_rule_01_one_setpoint_is_enough_to_enter():
    client = flying()
    goal = silence(client)(0.0)
    assert client.mode(4, 3) == [0, 0]
    client.run(1.5)
    assert client.mode(6) == [0, 1]
    client.send_setpoint(goal)
    client.run(0.06)
    assert client.mode(6) == [0, 0]


def test_rule_01_disarmed_every_mode_is_taken_and_arming_is_refused():
    client = companion()
    assert client.mode(6) == [0, 0]
    assert client.arm() == [1]


def test_rule_01_an_invalid_estimate_is_a_loss_at_once():
    client = flying(4.0)
    client.simulation.inject("gnss_lost")
    lost = wait_for(client, Mode.ALTCTL, 8.0)
    assert lost == pytest.approx(5.2, abs=0.3)  # q13_gps_loss
    assert commander(client).failsafe
    assert event_named(client, "commander_failsafe_enter_autopilot_disengaged")
    client.run(1.0)
    assert client.heard["HEARTBEAT"].system_status == 5


def test_rule_01_without_gnss_only_an_acceleration_stream_arms():
    client = companion(faults=["gnss_lost"])
    for setpoint, result in (
        ({"position": (0.0, 0.0, -3.0)}, 1),
        ({"velocity": (0.0, 0.0, -0.5)}, 1),
        ({"acceleration": (0.0, 0.0, -0.5)}, 0),
    ):
        goal = client.setpoint(**setpoint)
        client.stream = lambda t, goal=goal: goal
        client.run(0.5)
        client.mode(6)
        assert client.arm() == [result], setpoint  # q11_arm_without_gps


# 2: loss is sticky


def test_rule_02_offboard_comes_back_by_itself_in_the_middle_of_a_return():
    client = flying()
    stream = silence(client)
    assert wait_for(client, Mode.AUTO_RTL, 2.0) == pytest.approx(1.05, abs=0.08)
    client.run(3.0)
    client.stream = stream
    assert wait_for(client, Mode.OFFBOARD, 1.0) <= 0.04
    assert not commander(client).failsafe


def test_rule_02_offboard_comes_back_when_the_estimate_does():
    client = flying(4.0)
    client.simulation.inject("gnss_lost")
    wait_for(client, Mode.ALTCTL, 8.0)
    client.simulation.inject("gnss_back")
    assert wait_for(client, Mode.OFFBOARD, 4.0) == pytest.approx(2.25, abs=0.3)  # q13_gps_loss


# 3: asking for OFFBOARD in a failsafe


def test_rule_03_a_mode_request_in_a_failsafe_cancels_it():
    client = flying()
    run_with_sticks(client, 1.0)
    wait_for(client, Mode.AUTO_LOITER, 2.0)  # sticks lost: Hold, Return to follow
    assert commander(client).failsafe
    assert client.mode(6) == [0, 0]
    assert mode(client) is Mode.OFFBOARD
    client.run(8.0)
    assert mode(client) is Mode.OFFBOARD
    assert not commander(client).failsafe


def test_rule_03_left_alone_the_failsafe_goes_on_also_when_the_sticks_return():
    client = flying()
    run_with_sticks(client, 1.0)
    assert wait_for(client, Mode.AUTO_LOITER, 1.0) == pytest.approx(0.5, abs=0.2)  # q10: 0.37 to 0.67
    assert wait_for(client, Mode.AUTO_RTL, 6.0) == pytest.approx(5.0, abs=0.1)
    run_with_sticks(client, 1.0)
    assert mode(client) is Mode.AUTO_RTL


# 4: parameters that decide who may take over


def test_rule_04_defaults_are_px4s():
    parameters = companion().simulation.autopilot.parameters
    names = ("COM_RC_OVERRIDE", "COM_OBL_RC_ACT", "COM_OF_LOSS_T", "COM_RCL_EXCEPT", "NAV_RCL_ACT", "GF_ACTION")
    assert [parameters[name] for name in names] == [1, 0, 1.0, 0, 2, 2]
    assert len(parameters) == 889


@pytest.mark.parametrize(("setting", "taken"), [(1, False), (3, True)])
def test_rule_04_sticks_take_over_from_offboard_only_with_bit_1(setting, taken):
    client = flying()
    set_parameter(client, "COM_RC_OVERRIDE", setting)
    run_with_sticks(client, 0.6)
    run_with_sticks(client, 0.2, roll=200)
    assert (mode(client) is Mode.POSCTL) == taken
    if not taken:
        client.mode(4, 3)
        run_with_sticks(client, 0.2, roll=800)
        assert mode(client) is Mode.POSCTL  # AUTO modes give way


def test_rule_04_the_threshold_is_on_how_fast_a_stick_moves():
    client = flying()
    set_parameter(client, "COM_RC_OVERRIDE", 3)
    for step in range(50):
        sticks(client, roll=4 * step)
        client.run(0.04)
    assert mode(client) is Mode.OFFBOARD  # 0.2 in 2 s
    run_with_sticks(client, 0.4, roll=200, throttle=900)
    assert mode(client) is Mode.POSCTL  # the throttle counts too


def test_rule_04_offboard_loss_goes_where_com_obl_rc_act_says():
    for setting, expected in ((3, Mode.AUTO_RTL), (4, Mode.AUTO_LAND), (5, Mode.AUTO_LOITER), (0, Mode.AUTO_RTL)):
        client = flying()
        set_parameter(client, "COM_OBL_RC_ACT", setting)
        silence(client)
        wait_for(client, expected, 1.3)


def test_rule_04_with_sticks_offboard_loss_falls_back_to_position_mode():
    client = flying()
    run_with_sticks(client, 0.5)
    silence(client)
    run_with_sticks(client, 1.2)
    assert mode(client) is Mode.POSCTL
    assert commander(client).failsafe


def test_rule_04_com_rcl_except_spares_offboard():
    client = flying()
    set_parameter(client, "COM_RCL_EXCEPT", 4)
    run_with_sticks(client, 0.5)
    client.run(7.0)
    assert mode(client) is Mode.OFFBOARD


# 5: the signs of a takeover


def test_rule_05_a_mode_switch_on_the_radio_is_shown_at_once():
    client = flying()
    map_radio(client)
    run_with_radio(client, 0.6)
    client.log.clear()
    run_with_radio(client, 0.12, flight=1000)
    assert mode(client) is Mode.POSCTL
    assert client.of("CURRENT_MODE")[0].custom_mode == Mode.POSCTL.custom_mode


def test_rule_05_the_kill_switch_stops_the_motors_and_disarms_after_five_seconds():
    client = flying()
    map_radio(client)
    run_with_radio(client, 0.6)
    run_with_radio(client, 0.2, kill=2000)
    assert commander(client).killed
    run_with_radio(client, 2.5, kill=2000)
    assert client.truth.feet_in_contact > 0
    assert client.truth.armed
    run_with_radio(client, 2.6, kill=2000)
    assert not client.truth.armed


def test_rule_05_flight_termination_has_no_way_back():
    client = flying(2.0)
    assert client.command(185, 1) == [0]
    client.run(1.1)
    heartbeat = client.heard["HEARTBEAT"]
    assert (heartbeat.custom_mode, heartbeat.system_status, heartbeat.base_mode) == (10 << 16, 8, 129)
    assert client.command(185, 0) == [2]
    assert client.mode(6) == [0, 1]
    client.run(3.0)
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == 2  # q15: also on the ground
    assert client.command(400, 0, 21196) == [0]
    client.run(1.1)
    assert client.heard["HEARTBEAT"].system_status == 8
    assert client.arm() == [1]


def test_rule_05_a_failsafe_is_system_status_critical():
    client = flying()
    silence(client)
    client.run(2.1)
    assert (client.heard["HEARTBEAT"].system_status, client.heard["HEARTBEAT"].base_mode) == (5, 157)


# 6: setpoints


@pytest.mark.parametrize(
    ("change", "counts", "flown"),
    [
        ({"v": (1.0, 0.0, 0.0), "mask": 0xDC7}, True, True),
        ({"v": (math.nan, 0.0, 0.0), "mask": 0xDC7}, True, False),
        ({"v": (math.inf, 0.0, 0.0), "mask": 0xDC7}, True, False),
        ({"v": (1.0, 0.0, math.nan), "mask": 0xDC7}, True, False),
        ({"v": (1.0, 0.0, 0.0), "mask": 0xDC7 | 16}, True, False),  # half of xy ignored
        ({"v": (1.0, 0.0, 0.0), "mask": 0x9C7, "yaw": math.nan}, True, True),  # NaN yaw: ignored, the rest flown
        ({"v": (math.nan,) * 3, "mask": 0xDC7}, False, False),  # nothing left
        ({"mask": 0xFFF}, False, False),
        ({"mask": 0xBFF}, False, False),  # yaw alone
        ({"v": (1.0, 0.0, 0.0), "mask": 0xDC7, "frame": 7}, False, False),
        ({"v": (1.0, 0.0, 0.0), "mask": 0xDC7, "frame": 9}, False, False),
        ({"v": (1.0, 0.0, 0.0), "mask": 0xDC7, "frame": 8}, True, True),
        ({"v": (1.0, 0.0, 0.0), "mask": 0xDC7 | 32, "frame": 8}, False, False),  # one ignored axis drops the vector
        ({"p": (3.0, 0.0, -3.0), "mask": 0xDF8, "frame": 8}, False, False),
        ({"a": (1.0, 0.0, 0.0), "mask": 0xE3F | 512}, False, False),  # force
    ],
)
def test_rule_06_what_counts_and_what_is_flown(change, counts, flown):
    client = flying()
    start = client.truth.position_ned
    good = client.stream(0.0)
    client.stream = lambda t: {**good, **change}
    client.run(1.5)
    assert commander(client).failsafe != counts
    assert (math.dist(client.truth.position_ned[:2], start[:2]) > 0.4) == flown


def test_rule_06_body_velocities_turn_with_the_heading_only():
    client = flying(4.0)
    heading = math.radians(90.0)
    turned = client.setpoint(velocity=(0.0, 0.0, 0.0), yaw=heading)
    client.stream = lambda t: turned
    client.run(4.0)
    forward = client.setpoint(velocity=(1.0, 0.0, 0.0), yaw=heading, frame=8)
    client.stream = lambda t: forward
    client.run(3.0)
    north, east, _ = client.truth.velocity_ned
    assert east > 0.5
    assert abs(north) < 0.3


# 7: the forced disarm


def test_rule_07_the_magic_number_disarms_in_flight_and_arms_nothing():
    client = flying(1.9)
    assert client.command(400, 0) == [1]
    assert client.command(400, 0, 21196) == [0]
    assert not client.truth.armed
    client.run(0.55)
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == 1  # q15: reported while still in the air
    assert client.truth.feet_in_contact == 0
    other = companion()
    other.mode(6)
    assert other.command(400, 1, 21196) == [1]


# 8: land detection


def touchdown(rate: float | None):
    """Descend from 1.5 m at a commanded rate, or by a position below the ground; 12 s later."""
    client = flying(1.5)
    goal = client.setpoint(velocity=(0.0, 0.0, rate)) if rate else client.setpoint(position=(0.0, 0.0, 1.0))
    client.stream = lambda t: goal
    client.run(1.5 / (rate or 1.0) + 10.0, lambda: not client.truth.armed)
    return client


@pytest.mark.parametrize(("rate", "lands"), [(0.7, True), (0.3, True), (0.2, False), (None, False)])
def test_rule_08_only_a_commanded_descent_fast_enough_is_a_landing(rate, lands):
    client = touchdown(rate)
    assert client.truth.feet_in_contact == 4
    assert client.truth.armed != lands
    if not lands:
        assert client.command(400, 0) == [1]
        assert (2, "Disarming denied: not landed") in texts(ground_after(client))


def ground_after(client):
    ground = ground_station(client)
    client.command(400, 0)
    ground.read()
    return ground


def test_rule_08_ground_contact_maybe_landed_and_landed_follow_each_other():
    client = flying(1.0)
    goal = client.setpoint(velocity=(0.0, 0.0, 0.5))
    client.stream = lambda t: goal
    detector, times = client.simulation.autopilot.control.land_detector, {}
    while len(times) < 3 and client.simulation.t < 60.0:
        client.run(0.02)
        for stage in ("ground_contact", "maybe_landed", "landed"):
            if stage not in times and getattr(detector, stage):
                times[stage] = client.simulation.t
    first, second, third = times["ground_contact"], times["maybe_landed"], times["landed"]
    assert first + 0.3 < second < third
    assert third - second == pytest.approx(0.34, abs=0.06)
    assert client.run(4.0, lambda: not client.truth.armed) == pytest.approx(2.0, abs=0.1)


# 9: after the landing


@pytest.mark.parametrize("back", [(4, 6), (4, 5), (4, 9)])
def test_rule_09_after_landing_and_disarming_the_mode_is_offboard_again(back):
    client = flying(2.0)
    silence(client)
    client.run(0.1)
    assert client.mode(*back) == [0, 0]
    client.run(60.0, lambda: not client.truth.armed)
    assert not client.truth.armed
    client.run(0.1)
    assert mode(client) is Mode.OFFBOARD


def test_rule_09_armed_again_with_the_stream_alive_it_takes_off():
    client = flying(2.0)
    assert client.command(400, 0, 21196) == [0]
    client.run(4.0)
    assert client.truth.feet_in_contact == 4
    assert client.arm() == [0]
    client.run(5.0)
    assert client.truth.position_ned[2] < -1.0
