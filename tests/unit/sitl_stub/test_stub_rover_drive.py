"""Scripted drives of the rover in memory, through MAVLink: what PX4's rover does, in the words of the recordings."""

import math

import pytest
from pymavlink.dialects.v20 import all as mavlink
from stub_rover_support import (
    LOITER,
    MODES,
    OFFBOARD,
    POSCTL,
    RTL,
    Driver,
    by_sticks,
    inner,
    mode,
    offboard,
    rover,
    speed,
    start,
    stream,
    turn_rate,
    yaw,
)
from stub_vehicle_support import BareWorld, Client

from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.config import VEHICLES, VehicleConfig, VehicleFileError
from sitl_stub.vehicle.kinds import KINDS, kind_of, load_vehicle

# vehicle files


@pytest.mark.parametrize(
    "path",
    # the docking simulator's CubeSat has no autopilot: tests/unit/sitl_stub/test_stub_cubesat_files.py
    [path for path in sorted(VEHICLES.glob("*.yaml")) if path.stem != "cubesat"],
    ids=lambda path: path.stem,
)
def test_every_vehicle_file_makes_a_vehicle_that_stands_still(path):
    config = load_vehicle(path)
    simulation = Simulation(BareWorld(), config, 1)
    simulation.advance(0.5)
    assert kind_of(config) in KINDS.values()
    assert math.dist(simulation.truth().vehicle.position_ned[:2], (0.0, 0.0)) < 0.01


@pytest.mark.parametrize("name", ["sih_rover", "rover"])
def test_geometry_of_the_body_is_what_the_autopilot_was_told(name: str):
    config = rover(name=name)
    parameters = Simulation(BareWorld(), config, 1).autopilot.parameters
    body = config.body
    assert body.front_axle_m + body.rear_axle_m == pytest.approx(parameters["RA_WHEEL_BASE"])
    assert math.radians(body.steering_angle_max_deg) == pytest.approx(parameters["RA_MAX_STR_ANG"], abs=1e-3)


def test_wrong_kinds_are_refused_by_name(tmp_path):
    with pytest.raises(VehicleFileError, match="kind is 'rover_ackermann', expected 'multicopter'"):
        VehicleConfig.load("sih_rover")
    text = (VEHICLES / "sih_rover.yaml").read_text()
    path = tmp_path / "boat.yaml"
    path.write_text(text.replace("kind: rover_ackermann", "kind: boat"))
    with pytest.raises(VehicleFileError, match="unknown kind 'boat'; known: multicopter, rover_ackermann"):
        load_vehicle(path)
    path.write_text(text.replace("mass_kg: 20.0", "mass_kg: 0.0"))
    with pytest.raises(VehicleFileError, match="mass_kg must be above zero"):
        load_vehicle(path)
    path.write_text(text.replace("  mass_kg: 20.0\n", ""))
    with pytest.raises(VehicleFileError, match="missing keys \\['mass_kg'\\]"):
        load_vehicle(path)


# what it says about itself


def test_heartbeat_parameters_and_messages_of_a_rover():
    client = start()
    client.run(1.5)
    assert client.heard["HEARTBEAT"].type == mavlink.MAV_TYPE_GROUND_ROVER
    parameters = client.simulation.autopilot.parameters
    assert parameters["RA_WHEEL_BASE"] == pytest.approx(0.321)
    assert parameters["RTL_RETURN_ALT"] == 60.0
    assert not {"MPC_XY_P", "MC_YAW_P", "LNDMC_XY_VEL_MAX", "CA_ROTOR_COUNT"} & set(parameters)
    heard = {message.get_type() for _, message in client.log}
    assert {"ODOMETRY", "LOCAL_POSITION_NED", "SERVO_OUTPUT_RAW", "VFR_HUD", "EXTENDED_SYS_STATE"} <= heard
    assert not {"ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED"} & heard
    assert client.command(511, mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET, 20_000) == [4]


def test_same_seed_same_bytes_and_another_seed_others():
    def drive(seed: int) -> bytes:
        client = start(seed, wander=True)
        stream(client, velocity=(1.0, 0.5, 0.0))
        client.run(0.5)
        client.mode(6)
        client.arm()
        client.run(4.0)
        return b"".join(client.raw)

    assert drive(1) == drive(1)
    assert drive(1) != drive(2)


# OFFBOARD


def test_position_goal_is_reached_and_held_with_the_heading_it_came_with():
    client = offboard(position=(8.0, 0.0, 0.0), yaw=2.0)
    client.run(6.0)
    assert client.truth.position_ned[:2] == pytest.approx((8.0, 0.0), abs=0.15)
    assert yaw(client) == pytest.approx(0.0, abs=0.05)  # the yaw asked for is ignored
    place = client.truth.position_ned
    client.run(5.0)
    assert math.dist(place, client.truth.position_ned) < 1e-3


def test_goal_height_is_ignored():
    client = offboard(position=(4.0, 0.0, -3.0))
    client.run(6.0)
    assert client.truth.position_ned[0] == pytest.approx(4.0, abs=0.15)
    assert client.truth.position_ned[2] == pytest.approx(-0.10)


@pytest.mark.parametrize(("north", "east"), [(1.0, 0.0), (0.0, 1.0), (-1.0, 1.0), (0.0, -2.0)])
def test_velocity_is_a_speed_along_its_direction(north: float, east: float):
    client = offboard(velocity=(north, east, 0.0))
    client.run(9.0)
    assert abs(math.remainder(yaw(client) - math.atan2(east, north), math.tau)) < 0.02
    wanted = math.hypot(north, east)
    # feed-forward only: the speed is what the throttle makes of it, in PX4's recording 1.15 to 1.38 for 1 m/s
    assert speed(client) == pytest.approx(math.sqrt((wanted / 3.2 * 400.0 - 58.9) / 41.7), rel=0.01)


def test_velocity_backwards_turns_round_and_never_reverses():
    client = offboard(velocity=(-1.0, 0.0, 0.0))
    speeds = []
    for _ in range(60):
        client.run(0.1)
        speeds.append(speed(client))
    assert min(speeds) >= 0.0
    assert abs(yaw(client)) == pytest.approx(math.pi, abs=0.02)


def test_body_frame_velocity_backwards_turns_as_well():
    client = start()
    wanted = client.setpoint(velocity=(-1.0, 0.0, 0.0), frame=8)
    client.stream = lambda t: wanted
    client.run(0.5)
    client.mode(6)
    client.arm()
    client.run(2.0)
    assert speed(client) > 0.5
    assert abs(turn_rate(client)) > 0.5  # the setpoint turns with the body: it goes in circles


def test_zero_velocity_stops_and_turns_north_on_the_way():
    client = offboard(velocity=(0.0, 1.0, 0.0))
    client.run(6.0)
    assert yaw(client) == pytest.approx(math.pi / 2.0, abs=0.02)
    east = client.truth.position_ned[1]
    stream(client, velocity=(0.0, 0.0, 0.0))
    stopped = client.run(3.0, lambda: speed(client) == 0.0)
    assert stopped == pytest.approx(0.67, abs=0.15)  # recorded
    assert client.truth.position_ned[1] - east == pytest.approx(0.52, abs=0.1)
    assert math.degrees(yaw(client)) == pytest.approx(90.0 - 16.0, abs=5.0)
    client.run(3.0)
    assert speed(client) == 0.0


def test_too_slow_to_start_but_not_to_be_taken_for_lost():
    """Static friction: below 0.78 m/s of 3.2 m/s at full throttle nothing moves."""
    client = offboard(velocity=(0.7, 0.0, 0.0))
    client.run(4.0)
    assert client.truth.position_ned[0] == 0.0
    assert mode(client) == OFFBOARD
    stream(client, velocity=(0.9, 0.0, 0.0))
    client.run(2.0)
    assert speed(client) > 0.5


def test_acceleration_alone_leaves_the_actuators_as_they_are():
    client = offboard(velocity=(1.0, 0.0, 0.0))
    client.run(3.0)
    throttle = inner(client).actuators.throttle
    stream(client, acceleration=(-2.0, 0.0, 0.0))
    client.run(2.0)
    assert inner(client).actuators.throttle == throttle
    assert mode(client) == OFFBOARD


def test_heading_change_of_90_degrees_at_1_m_s():
    client = offboard(velocity=(1.0, 0.0, 0.0))
    client.run(5.0)
    stream(client, velocity=(0.0, 1.0, 0.0))
    north = client.truth.position_ned[0]
    rise = client.run(5.0, lambda: yaw(client) > 0.9 * math.pi / 2.0)
    assert rise == pytest.approx(1.3, rel=0.2)  # recorded
    most = 0.0
    for _ in range(100):
        client.run(0.02)
        most = max(most, yaw(client))
    assert math.degrees(most) - 90.0 < 5.0
    assert client.truth.position_ned[0] - north == pytest.approx(1.2, rel=0.3)


def test_return_ends_at_home_landed_and_disarmed():
    client = offboard(velocity=(0.0, 2.0, 0.0))
    client.run(4.0)
    client.stream = None
    client.run(30.0, lambda: client.simulation.autopilot.landed)
    assert math.dist(client.truth.position_ned[:2], (0.0, 0.0)) < 0.6
    assert client.run(5.0, lambda: not client.truth.armed) == pytest.approx(2.0, abs=0.1)
    client.run(2.0)
    assert speed(client) == 0.0
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == 1


# landed state


def test_armed_means_in_the_air_after_half_a_second_and_disarmed_landed():
    client = start()
    stream(client, velocity=(0.0, 0.0, 0.0))
    client.run(0.5)
    client.mode(6)
    assert client.simulation.autopilot.landed
    client.arm()
    assert client.run(1.0, lambda: not client.simulation.autopilot.landed) == pytest.approx(0.5, abs=0.05)
    client.run(0.5)
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == 2
    assert client.command(400, 0) == [0]
    client.run(0.1)
    assert client.simulation.autopilot.landed


def test_disarming_while_driving_is_accepted_and_cuts_the_throttle():
    client = offboard(velocity=(2.0, 0.0, 0.0))
    client.run(4.0)
    assert client.command(400, 0) == [0]
    client.run(0.1)
    assert not client.truth.armed
    assert inner(client).actuators.throttle == 0.0
    client.run(2.0)
    assert speed(client) == 0.0


# sticks


@pytest.mark.parametrize("name", MODES)
def test_any_manual_mode_arms_and_centred_sticks_keep_it_still(name: str):
    driver = by_sticks(name)
    driver.run(3.0)
    assert driver.truth.position_ned[:2] == (0.0, 0.0)


@pytest.mark.parametrize("name", MODES)
def test_reverse_by_sticks_drives_straight_back(name: str):
    driver = by_sticks(name)
    driver.sticks = (-0.5, 0.0)
    driver.run(5.0)
    assert speed(driver) < -1.5
    assert driver.truth.position_ned[0] < -6.0
    assert abs(driver.truth.position_ned[1]) < 0.05


@pytest.mark.parametrize(
    ("name", "sticks", "degrees"),
    [
        ("POSCTL", (0.5, 0.3), 40.0),
        ("POSCTL", (0.25, -0.3), -40.0),
        ("POSCTL", (-0.5, 0.3), -40.0),
        ("POSCTL", (-0.5, -0.3), 40.0),
        ("ACRO", (0.5, 0.3), 54.0),
        ("ACRO", (-0.5, 0.3), -54.0),
        ("STABILIZED", (0.5, 0.3), 40.0),
    ],
)
def test_yaw_rate_asked_for_by_sticks(name: str, sticks: tuple[float, float], degrees: float):
    """Recorded setpoints; in reverse the sign turns, as a car does. Forwards the loop is closed."""
    driver = by_sticks(name)
    driver.sticks = (sticks[0], 0.0)
    if name == "POSCTL" and abs(sticks[0]) < 0.5:
        driver.sticks = (0.5, 0.0)  # 0.25 does not start it from rest
    driver.run(2.0)
    driver.sticks = sticks
    driver.run(3.0)
    assert math.degrees(inner(driver).yaw_rate) == pytest.approx(degrees, abs=0.1)
    assert math.degrees(turn_rate(driver)) == pytest.approx(degrees, rel=0.20)
    if sticks[0] > 0.0:
        assert math.degrees(turn_rate(driver)) == pytest.approx(degrees, rel=0.08)


def test_position_mode_asks_for_three_metres_a_second_at_full_stick():
    driver = by_sticks("POSCTL")
    driver.sticks = (0.5, 0.0)
    driver.run(4.0)
    assert inner(driver).speed == 1.5
    assert speed(driver) == pytest.approx(1.75, abs=0.05)  # recorded: 1.60 to 1.90 by direction
    assert abs(yaw(driver)) < 0.01


@pytest.mark.parametrize("name", ["POSCTL"])
def test_a_quarter_of_the_stick_does_not_start_it_from_rest(name: str):
    driver = by_sticks(name)
    for throttle in (0.25, -0.25):
        driver.sticks = (throttle, 0.0)
        driver.run(3.0)
        assert driver.truth.position_ned[:2] == (0.0, 0.0)


def test_manual_mode_goes_straight_to_the_actuators():
    driver = by_sticks("MANUAL")
    driver.sticks = (0.5, 0.3)
    driver.run(3.0)
    actuators = inner(driver).actuators
    assert (actuators.throttle, actuators.steering) == pytest.approx((0.5, 0.3), abs=1e-9)
    assert math.degrees(turn_rate(driver)) == pytest.approx(40.0, rel=0.08)  # recorded


def test_throttle_below_zero_in_the_message_is_neutral():
    driver = by_sticks("MANUAL")
    driver.sticks = (-2.0, 0.0)  # z = -500
    driver.run(3.0)
    assert driver.truth.position_ned[:2] == (0.0, 0.0)


def offboard_with_a_driver():
    simulation = Simulation(BareWorld(), rover(), 1)
    companion, driver = Client(simulation), Driver(simulation)
    stream(companion, velocity=(1.0, 0.0, 0.0))
    driver.run(0.3)
    companion.run(0.3)
    companion.mode(6)
    companion.arm()
    return companion, driver


def test_sticks_do_nothing_in_offboard():
    companion, driver = offboard_with_a_driver()
    for _ in range(100):
        companion.run(0.02)
        driver.sticks = (-1.0, 1.0)
        driver.run(0.02)
    assert mode(companion) == OFFBOARD
    assert speed(companion) > 0.5
    assert yaw(companion) == pytest.approx(0.0, abs=0.02)


def test_sticks_lost_hold_then_home_and_sticks_back_do_not_end_it():
    driver = by_sticks("POSCTL")
    driver.sticks = (0.6, 0.0)
    driver.run(6.0)
    driver.sticks = None
    assert driver.run(2.0, lambda: mode(driver) == LOITER) == pytest.approx(0.5, abs=0.15)
    hold = driver.run(8.0, lambda: mode(driver) == RTL)
    assert hold == pytest.approx(5.0, abs=0.15)
    driver.sticks = (0.0, 0.0)
    driver.run(2.5)
    assert mode(driver) == RTL
    assert speed(driver) > 1.0
    assert driver.command(400, 0) == [0]
    driver.run(0.1)
    assert mode(driver) == POSCTL  # the mode falls back to the sticks'


def test_hand_over_from_offboard_to_sticks_and_back():
    companion, driver = offboard_with_a_driver()
    for wanted, sticks, direction in ((6, (0.0, 0.0), 1.0), (3, (-0.5, 0.0), -1.0), (6, (0.0, 0.0), 1.0)):
        assert companion.mode(wanted) == [0, 0]
        driver.sticks = sticks
        for _ in range(100):
            companion.run(0.02)
            driver.run(0.02)
        assert speed(companion) * direction > 0.5


def test_position_mode_without_sticks_is_refused():
    client = offboard(velocity=(1.0, 0.0, 0.0))
    client.run(1.0)
    assert client.mode(3) == [0, 1]
    assert mode(client) == OFFBOARD


# the small rover


@pytest.mark.parametrize("goal", [(4.0, 1.0), (-3.0, 0.0), (1.0, 3.0), (8.0, 0.0)])
def test_the_small_rover_parks_at_a_goal(goal: tuple[float, float]):
    client = Client(Simulation(BareWorld(), rover(name="rover"), 1), kind=6)
    stream(client, position=(*goal, 0.0))
    client.run(0.5)
    client.mode(6)
    client.arm()
    client.run(12.0)
    begin = client.truth.position_ned
    client.run(1.0)
    assert math.dist(client.truth.position_ned[:2], goal) < 0.2
    assert math.dist(client.truth.position_ned, begin) < 1e-3
