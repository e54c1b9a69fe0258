"""Scripted flights in memory: take-off, steps, landing, failsafes; and that runs repeat byte for byte."""

import csv
import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from stub_vehicle_support import BareTargets, BareWorld, Client, SteadyWind, vehicle

from sitl_stub.simulation import Simulation

OFFBOARD, LOITER, RTL, LAND = 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 5 << 24, 4 << 16 | 6 << 24


def fly(seed: int = 1, *, wander: bool = False, world: BareWorld | None = None, **options) -> Client:
    client = Client(Simulation(world or BareWorld(), vehicle(wander=wander), seed, **options))
    client.run(0.2)
    return client


def hold(client: Client, north: float, east: float, down: float) -> None:
    goal = client.setpoint(position=(north, east, down), yaw=client.heard["ATTITUDE"].yaw)
    client.stream = lambda t: goal


def descend(client: Client, rate: float) -> None:
    goal = client.setpoint(velocity=(0.0, 0.0, rate), yaw=client.heard["ATTITUDE"].yaw)
    client.stream = lambda t: goal


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_take_off_step_and_land_with_wandering_estimate_and_wind(seed):
    client = fly(seed, wander=True, world=BareWorld(wind=SteadyWind((2.0, -2.0, 0.0))))
    client.take_off(3.0)
    hold(client, 5.0, 0.0, -3.0)
    client.run(6.0)
    assert client.truth.position_ned[0] == pytest.approx(5.0, abs=1.0)
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == 2
    descend(client, 0.5)
    client.run(15.0, lambda: client.truth.feet_in_contact > 0)
    to_landed = client.run(20.0, lambda: client.simulation.autopilot.landed)
    assert 1.0 < to_landed < 8.0  # recorded: 1.5 to 7.2
    to_disarmed = client.run(5.0, lambda: not client.truth.armed)
    assert to_disarmed == pytest.approx(2.0, abs=0.1)
    client.run(1.2)
    assert client.truth.feet_in_contact == 4
    assert client.heard["EXTENDED_SYS_STATE"].landed_state == 1
    assert 4 not in {m.landed_state for m in client.of("EXTENDED_SYS_STATE")}  # never LANDING in OFFBOARD
    assert client.heard["HEARTBEAT"].base_mode & 128 == 0


def test_offboard_may_be_asked_for_right_behind_the_first_setpoint():
    # as MAVSDK does: PX4 looks at the new setpoint before it looks at the command
    client = fly()
    client.take_off(3.0)
    assert client.mode(4, 3) == [0, 0]
    goal, client.stream = client.stream(client.simulation.t), None
    client.run(2.0)
    assert client.mode(6) == [0, 1]
    client.send_setpoint(goal)
    assert client.mode(6) == [0, 0]


def test_take_off_times_are_px4s():
    client = fly()
    goal = client.setpoint(position=(0.0, 0.0, -5.0))
    client.stream = lambda t: goal
    client.run(1.0)
    client.mode(6)
    client.arm()
    start = client.simulation.t
    client.run(5.0, lambda: not client.simulation.autopilot.landed)
    assert client.simulation.t - start == pytest.approx(1.9, abs=0.3)
    client.run(5.0, lambda: client.truth.position_ned[2] < -0.3)
    assert client.simulation.t - start == pytest.approx(3.3, abs=0.5)
    client.run(5.0, lambda: client.truth.position_ned[2] < -4.7)
    assert client.simulation.t - start == pytest.approx(6.15, abs=1.0)


def recorded_step() -> tuple[np.ndarray, np.ndarray]:
    """The first 5 m step of q02_position_steps_clean, from 1 s before it reached 10 %."""
    reference = Path(__file__).parents[3].parent / "shared/reference/px4_sih/q02_position_steps_clean.csv.gz"
    if not reference.exists():
        pytest.skip("no reference recordings here")
    rows = []
    with gzip.open(reference, "rt") as file:
        for row in csv.DictReader(file):
            if row["kind"] == "lpos":
                rows.append((float(row["t_s"]), float(row["x"])))
    t, x = np.array(rows).T
    begin = t[np.argmax(x > 0.5)]
    part = (t > begin - 0.5) & (t < begin + 3.0)
    return t[part] - begin, x[part]


def own_step() -> tuple[np.ndarray, np.ndarray]:
    client = fly()
    client.take_off(5.0)
    client.run(4.0)
    start = client.heard["LOCAL_POSITION_NED"].x
    hold(client, 5.0, 0.0, -5.0)
    rows = []
    for _ in range(200):
        client.run(0.02)
        rows.append((client.simulation.t, client.simulation.autopilot.estimate.north - start))
    t, x = np.array(rows).T
    begin = t[np.argmax(x > 0.5)]
    return t - begin, x


def test_step_response_is_shaped_like_the_recorded_one():
    t, x = own_step()
    rise = t[np.argmax(x > 4.5)] - t[np.argmax(x > 0.5)]
    assert 1.2 < rise < 2.1  # recorded 1.75, with more drag
    assert 5.0 < x.max() < 6.0
    t_recorded, x_recorded = recorded_step()
    ours = np.interp(t_recorded, t, x)
    assert np.sqrt(np.mean((ours - x_recorded) ** 2)) < 0.6


def test_velocity_setpoints_are_followed():
    client = fly()
    client.take_off(4.0)
    goal = client.setpoint(velocity=(2.0, 0.0, 0.0))
    client.stream = lambda t: goal
    client.run(0.5)
    assert 0.3 < client.truth.velocity_ned[0] / 2.0 < 0.75
    client.run(4.5)
    assert client.truth.velocity_ned[0] == pytest.approx(2.0, abs=0.25)


def test_a_long_step_saturates_without_winding_up():
    client = fly()
    client.take_off(5.0)
    client.run(3.0)
    hold(client, 20.0, 0.0, -5.0)
    farthest, fastest = 0.0, 0.0
    for _ in range(400):
        client.run(0.02)
        farthest = max(farthest, client.truth.position_ned[0])
        fastest = max(fastest, client.truth.velocity_ned[0])
    assert 8.0 < fastest < 12.0  # recorded 8.3, with more drag
    assert farthest < 20.0 * 1.08  # recorded 2.6 %
    assert client.truth.position_ned[2] == pytest.approx(-5.2, abs=0.5)


def test_yaw_step_is_px4s():
    client = fly()
    client.take_off(4.0, yaw=0.0)
    client.run(4.0)
    goal = client.setpoint(position=(0.0, 0.0, -4.0), yaw=math.pi / 2.0)
    client.stream = lambda t: goal
    times = {}
    start = client.simulation.t
    for _ in range(200):
        client.run(0.02)
        for share in (0.1, 0.9):
            if share not in times and client.simulation.autopilot.estimate.yaw > share * math.pi / 2.0:
                times[share] = client.simulation.t - start
    assert 0.35 < times[0.9] - times[0.1] < 1.0  # recorded 0.59
    assert client.simulation.autopilot.estimate.yaw == pytest.approx(math.pi / 2.0, abs=0.05)


def test_lands_on_a_moving_platform_and_rides_it():
    targets = BareTargets(platform_top=0.15)
    client = fly(world=BareWorld(targets))
    client.take_off(2.0)
    client.run(3.0)
    targets.speed = 0.4
    begin = client.simulation.t

    def follow(t: float):
        place = 0.4 * (t - begin)
        if t < begin + 4.0:
            return client.setpoint(position=(place, 0.0, -2.0), velocity=(0.4, 0.0, 0.0))
        sent = client.setpoint(position=(place, 0.0, math.nan), velocity=(0.4, 0.0, 0.5))
        sent["mask"] |= 4
        return sent

    client.stream = follow
    client.run(30.0, lambda: not client.truth.armed)
    assert not client.truth.armed
    client.run(3.0)
    assert (client.truth.surface, client.truth.feet_in_contact) == ("pad", 4)
    assert abs(client.truth.position_ned[0] - targets.north) < 0.25
    assert client.truth.velocity_ned[0] == pytest.approx(0.4, abs=1e-3)


def test_offboard_loss_fails_over_after_one_second_and_returns_by_itself():
    client = fly()
    client.take_off(3.0)
    stream, client.stream = client.stream, None
    client.run(0.9)
    assert client.simulation.autopilot.commander.mode.custom_mode == OFFBOARD
    lost = client.run(0.5, lambda: client.simulation.autopilot.commander.failsafe)
    assert 0.999 <= 0.9 + lost <= 1.12  # recorded 1.01 to 1.11
    client.run(1.5)
    assert (client.heard["HEARTBEAT"].custom_mode, client.heard["HEARTBEAT"].system_status) == (RTL, 5)
    client.stream = stream
    client.run(0.04)
    assert client.simulation.autopilot.commander.mode.custom_mode == OFFBOARD
    client.run(1.2)
    assert (client.heard["HEARTBEAT"].custom_mode, client.heard["HEARTBEAT"].system_status) == (OFFBOARD, 4)


def test_short_gaps_do_nothing():
    client = fly()
    client.take_off(3.0)
    stream = client.stream
    for gap in (0.5, 0.9):
        client.stream = None
        client.run(gap)
        client.stream = stream
        client.run(0.1)
    assert not client.of("EVENT") or all(event.id != 31382480 for event in client.of("EVENT"))


def test_lost_for_ever_returns_lands_disarms_and_stands_in_offboard():
    client = fly()
    client.take_off(3.0)
    client.stream = None
    client.run(40.0, lambda: not client.truth.armed)
    assert not client.truth.armed
    assert math.hypot(*client.truth.position_ned[:2]) < 0.5
    client.run(1.2)
    assert client.heard["HEARTBEAT"].custom_mode == OFFBOARD
    assert 4 in {m.landed_state for m in client.of("EXTENDED_SYS_STATE")}


def test_auto_land_and_loiter():
    client = fly()
    client.take_off(4.0)
    goal = client.setpoint(velocity=(3.0, 0.0, 0.0))
    client.stream = lambda t: goal
    client.run(3.0)
    assert client.mode(4, 3) == [0, 0]
    start = client.truth.position_ned[0]
    client.run(8.0)
    assert math.hypot(*client.truth.velocity_ned) < 0.2
    assert 1.0 < client.truth.position_ned[0] - start < 8.0
    assert client.mode(4, 6) == [0, 0]
    client.run(30.0, lambda: not client.truth.armed)
    assert not client.truth.armed
    assert client.truth.feet_in_contact == 4


def test_position_setpoints_below_ground_never_land():
    client = fly()
    client.take_off(1.0)
    hold(client, 0.0, 0.0, 1.0)
    client.run(15.0)
    assert client.truth.feet_in_contact == 4
    assert not client.simulation.autopilot.landed
    assert client.command(400, 0) == [1]  # disarming refused: not landed


def test_termination_and_force_disarm_stop_the_motors():
    client = fly()
    client.take_off(3.0)
    assert client.command(185, 1) == [0]
    client.run(3.0)
    assert client.truth.feet_in_contact > 0
    assert (client.heard["HEARTBEAT"].custom_mode, client.heard["HEARTBEAT"].system_status) == (10 << 16, 8)
    assert client.command(185, 0) == [2]
    assert client.mode(6)[-1] == 1
    assert client.arm() == [0]  # it still is armed

    client = fly()
    client.take_off(3.0)
    assert client.command(400, 0) == [1]
    assert client.command(400, 0, 21196) == [0]
    assert not client.truth.armed


def test_armed_without_take_off_disarms_after_ten_seconds():
    client = fly()
    assert client.mode(4, 3) == [0, 0]
    assert client.arm() == [0]
    assert client.run(15.0, lambda: not client.truth.armed) == pytest.approx(10.0, abs=0.1)


def test_take_off_command_and_return():
    client = fly()
    assert client.command(22) == [0]
    assert client.arm() == [0]
    client.run(15.0, lambda: client.simulation.autopilot.commander.mode.custom_mode == LOITER)
    assert client.truth.position_ned[2] == pytest.approx(-2.7, abs=0.8)
    assert client.command(20) == [0]
    client.run(40.0, lambda: not client.truth.armed)
    assert not client.truth.armed


def test_runs_repeat_byte_for_byte_and_seeds_differ():
    def bytes_of(seed: int) -> bytes:
        client = fly(seed, wander=True)
        client.take_off(2.0)
        return b"".join(client.raw)

    assert bytes_of(5) == bytes_of(5)
    assert bytes_of(5) != bytes_of(6)
