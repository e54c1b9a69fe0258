"""Scripted flights of the free-flyer in memory, through MAVLink: what PX4's spacecraft module does.

Expectations are read from PX4's source (modules/spacecraft, mavlink_receiver.cpp, control_mode.cpp); there is no
recording of a spacecraft.
"""

import math
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import all as mavlink
from stub_free_flyer_support import (
    ATTITUDE_IGNORE,
    LOITER,
    OFFBOARD,
    POSCTL,
    RATES_IGNORE,
    THRUST_BODY,
    Pilot,
    attitude_target,
    free_flyer,
    offboard,
    start,
)
from stub_vehicle_support import BareWorld, Client

from sitl_stub.simulation import Simulation


def speed(pilot):
    return math.hypot(*pilot.truth.velocity_ned[:2])


def far(pilot):
    return math.hypot(*pilot.truth.position_ned[:2])


def test_what_it_says_of_itself():
    pilot = start()
    pilot.run(1.5)
    assert pilot.heard["HEARTBEAT"].type == mavlink.MAV_TYPE_SPACECRAFT_ORBITER
    parameters = pilot.inner.parameters
    assert parameters["CA_AIRFRAME"] == 14
    assert parameters["CA_ROTOR_COUNT"] == 8
    assert not {"MPC_XY_P", "MC_YAW_P", "LNDMC_XY_VEL_MAX"} & set(parameters)
    heard = {message.get_type() for _, message in pilot.log}
    assert {"ODOMETRY", "LOCAL_POSITION_NED", "SERVO_OUTPUT_RAW", "VFR_HUD", "ATTITUDE_TARGET"} <= heard
    assert "POSITION_TARGET_LOCAL_NED" not in heard
    assert pilot.heard["SERVO_OUTPUT_RAW"].servo1_raw == 0


def test_body_thrust_pushes_along_the_body_and_attitude_turns_it():
    pilot = offboard()
    pilot.push(math.radians(90.0), 0.0)
    pilot.run(4.0)
    assert pilot.simulation.body.heading == pytest.approx(math.radians(90.0), abs=0.04)
    before = pilot.truth.velocity_ned
    pilot.push(math.radians(90.0), 0.5, 0.25)
    pilot.run(3.0)
    north, east = (after - was for after, was in zip(pilot.truth.velocity_ned[:2], before[:2], strict=True))
    # thrust 1 is 0.4 m/s^2; forward is east, right is south
    assert east == pytest.approx(0.4 * 0.5 * 3.0, rel=0.08)
    assert north == pytest.approx(-0.4 * 0.25 * 3.0, rel=0.15)


def test_it_is_always_landed_and_disarms_in_motion():
    """PX4 starts no land detector on a spacecraft."""
    pilot = offboard()
    pilot.push(0.0, 0.5)
    pilot.run(4.0)
    assert speed(pilot) > 0.5
    assert pilot.heard["EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    assert pilot.command(400, 0) == [0]
    pilot.run(0.3)
    held = pilot.truth.velocity_ned
    pilot.run(1.0)
    assert pilot.truth.velocity_ned == pytest.approx(held, abs=0.02)  # it slides on


def airframe_default():
    """The vehicle with PX4's own position gain."""
    config = free_flyer()
    return replace(config, autopilot={**config.autopilot, "SPC_POS_P": 0.2})


def test_lost_setpoints_hold_after_a_second_and_hold_brakes():
    pilot = offboard()
    pilot.push(0.0, 0.5)
    pilot.run(4.0)
    pilot.target = None
    pilot.run(1.5)
    assert pilot.mode_word == LOITER
    pilot.run(5.0)
    assert speed(pilot) < 0.03
    place = pilot.truth.position_ned
    pilot.run(10.0)
    assert math.dist(pilot.truth.position_ned, place) < 0.1


def test_lost_setpoints_with_the_airframes_own_gain_drive_to_the_origin():
    pilot = offboard(config=airframe_default())
    pilot.push(0.0, 0.5)
    pilot.run(4.0)
    pilot.target = None
    lost_after = pilot.run(3.0, lambda: pilot.mode_word != OFFBOARD)
    assert lost_after == pytest.approx(1.05, abs=0.15)
    assert pilot.mode_word == LOITER  # COM_OBL_RC_ACT 0 without sticks: NAV_RCL_ACT of the airframe
    pilot.run(6.0)
    distance = far(pilot)
    assert speed(pilot) == pytest.approx(0.2 * distance, rel=0.2)  # SPC_POS_P
    pilot.run(10.0)
    assert far(pilot) < 0.25 * distance


def test_setpoints_that_the_module_does_not_know_count_as_signal_but_are_not_flown():
    pilot = offboard(config=airframe_default())
    pilot.push(0.0, 0.5)
    pilot.run(3.0)
    pilot.target = None
    goal = pilot.setpoint(position=(5.0, 5.0, 0.0))
    pilot.stream = lambda t: goal
    pilot.run(25.0)
    assert pilot.mode_word == OFFBOARD
    assert far(pilot) < 0.4  # the origin, not the goal


def test_velocity_setpoints_leave_the_last_thrust_on():
    pilot = offboard()
    pilot.push(0.0, 0.3)
    pilot.run(1.0)
    pilot.target = None
    stop = pilot.setpoint(velocity=(0.0, 0.0, 0.0))
    pilot.stream = lambda t: stop
    pilot.run(3.0)
    assert speed(pilot) == pytest.approx(0.4 * 0.3 * 4.0, rel=0.15)


def test_turn_rates_alone_turn_without_thrust_and_the_plain_thrust_field_is_ignored():
    pilot = offboard()
    pilot.target = attitude_target(ATTITUDE_IGNORE | THRUST_BODY, 0.0, (1.0, 0.0, 0.0), rates=(0.0, 0.0, 0.5))
    pilot.run(3.0)
    assert pilot.truth.angular_velocity_frd[2] == pytest.approx(0.5, abs=0.1)
    assert speed(pilot) < 0.05
    pilot = offboard()
    pilot.target = attitude_target(RATES_IGNORE, 0.0, (1.0, 0.0, 0.0))
    pilot.run(2.0)
    assert speed(pilot) < 0.05


def test_messages_for_others_or_without_content_are_no_signal():
    for mask, system in ((RATES_IGNORE | ATTITUDE_IGNORE, 1), (RATES_IGNORE | THRUST_BODY, 7)):
        pilot = start()
        pilot.target = attitude_target(mask, 0.0, (0.0, 0.0, 0.0))
        pilot.target.target_system = system
        pilot.run(0.5)
        assert pilot.inner.commander.flags.offboard_signal_lost
        assert pilot.mode(6) in ([0, 0], [0, 1])
        assert pilot.arm() == [1]


def test_attitude_setpoints_need_no_position():
    pilot = start()
    pilot.simulation.inject("vision_lost")
    pilot.push(0.0, 0.0)
    pilot.run(8.0)
    assert pilot.inner.commander.flags.position_invalid
    assert not pilot.inner.commander.flags.offboard_signal_lost


@pytest.mark.parametrize(("main", "axis"), [(1, 0), (3, 0)])
def test_sticks_push_and_hold(main, axis):
    client = Client(Simulation(BareWorld(), free_flyer(), 1), "ground", kind=6)

    def sticks(forward, duration):
        begin = client.simulation.t
        while client.simulation.t < begin + duration - 1e-9:
            client.send(mavlink.MAVLink_manual_control_message(1, round(1000 * forward), 0, 500, 0, 0))
            client.run(0.04)

    sticks(0.0, 0.5)
    assert client.mode(main) == [0, 0]
    sticks(0.0, 0.2)
    assert client.arm() == [0]
    sticks(0.5, 3.0)
    assert client.truth.velocity_ned[0] > 0.2
    sticks(0.0, 12.0)
    if main == POSCTL >> 16:
        assert math.hypot(*client.truth.velocity_ned[:2]) < 0.1
    else:
        assert client.truth.velocity_ned[0] > 0.2


def test_same_seed_same_bytes():
    def flight(seed):
        pilot: Pilot = offboard(seed=seed, config=free_flyer(wander=True))
        pilot.push(0.4, 0.3, -0.2)
        pilot.run(3.0)
        return b"".join(pilot.raw), pilot.truth

    first, second, other = flight(3), flight(3), flight(4)
    assert first == second
    assert first[0] != other[0]
