"""What the simulated PX4 trusts: the range to the ground, vision, old setpoints; and its rotors after termination."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rulebook_bench import commander, companion, flying, map_radio, run_with_radio
from stub_vehicle_support import BareWorld, Client

from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.vehicle.ekf_resets import EstimateHealth
from sitl_stub.vehicle.estimator import Estimate
from sitl_stub.vehicle.land_detector import LandDetector, LandInputs
from sitl_stub.vehicle.range_trust import RangeTrust
from sitl_stub.vehicle.system_state import SystemStatus
from sitl_stub.vehicle.takeoff import TakeoffState

DT = 0.01


def estimate(*, distance: float = 0.2, speed: float = 0.0, tilt: float = 0.0) -> Estimate:
    made = Estimate()
    made.range_down, made.v_north = distance, speed
    made.qw, made.qx = math.cos(0.5 * tilt), math.sin(0.5 * tilt)
    return made


def trusted_after(trust: RangeTrust, seconds: float, reading: Estimate, *, landed: bool = False) -> bool:
    for _ in range(round(seconds / DT)):
        trust.update(reading, landed=landed, dt=DT)
    return trust.update(reading, landed=landed, dt=DT)


def test_without_a_sound_reading_the_ground_is_known_for_a_second() -> None:
    trust, below = RangeTrust(), estimate(distance=-0.01, speed=3.0)
    assert trusted_after(trust, 0.9, below)
    assert not trusted_after(trust, 0.2, below)
    assert trusted_after(trust, 0.0, estimate())


def test_slow_and_low_the_range_is_the_height_and_stays_known() -> None:
    trust = RangeTrust()
    assert trusted_after(trust, 5.0, estimate(distance=-0.01, speed=0.9))
    assert not trusted_after(trust, 1.5, estimate(distance=-0.01, speed=1.1))
    assert not trusted_after(trust, 1.5, estimate(distance=-0.01))  # that does not begin without a reading
    assert trusted_after(trust, 0.0, estimate(distance=-0.01), landed=True)


@pytest.mark.parametrize(("tilt", "takes"), [(0.3, 0.34), (1.0, 1.0)])
def test_a_disarmed_vehicle_on_its_side_counts_as_landed_later(tilt: float, takes: float) -> None:
    detector = LandDetector(companion().simulation.autopilot.parameters)
    flying_ = LandInputs(
        armed=True, climb_rate_controlled=True, wanted_down_rate=math.nan, thrust=0.5, hover_thrust=0.5
    )
    for _ in range(200):
        detector.update(estimate(tilt=tilt, speed=2.0), flying_, DT)
    assert not detector.landed
    taken = 0.0
    while not detector.update(estimate(tilt=tilt), replace(flying_, armed=False), DT):
        taken += DT
    assert taken == pytest.approx(takes, abs=0.03)  # q15_flight_termination: 1.0


@pytest.mark.parametrize(("source", "invalid", "valid"), [("gnss", 5.19, 2.23), ("vision", 4.6, 1.18)])
def test_each_position_source_is_missed_and_trusted_again_in_its_time(
    source: str, invalid: float, valid: float
) -> None:
    health = EstimateHealth(np.random.default_rng(1))
    there = {"gnss": True, "vision": True}
    gone = {**there, source: False}
    t = 0.0

    def until(value: bool, sources: dict[str, bool]) -> float:
        nonlocal t
        begin = t
        while health.position_valid is not value:
            t += 0.004
            health.step(t, 0.004, **sources)
        return t - begin

    assert until(False, gone) == pytest.approx(invalid, abs=0.02)  # q13_gps_loss, q13_ekf_reset
    assert until(True, there) == pytest.approx(valid, abs=0.02)


def test_a_setpoint_from_before_the_motors_have_spooled_up_starts_no_take_off() -> None:
    client = companion()
    goal = client.setpoint(position=(0.0, 0.0, -3.0))
    client.stream = lambda t: goal
    client.run(0.5)
    client.mode(6)
    client.arm()
    client.run(0.9)
    client.stream = None
    client.run(0.5)
    takeoff = client.simulation.autopilot.control.takeoff
    assert takeoff.state is TakeoffState.READY  # q11_arm_without_gps
    client.stream = lambda t: goal
    client.run(0.1)
    assert takeoff.state is TakeoffState.RAMP_UP


@pytest.mark.parametrize(("name", "turn"), [("x500", False), ("sih_quadrotor", True)])
def test_termination_stops_the_rotors_but_not_those_of_sih(name: str, turn: bool) -> None:
    client = Client(Simulation(BareWorld(), VehicleConfig.load(name), 1))
    client.run(0.2)
    client.take_off(3.0)
    client.command(185, 1)
    client.run(0.3)
    assert (min(client.simulation.body.thrusts) > 0.2) is turn


def test_a_killed_vehicle_shows_flight_termination() -> None:
    client = flying()
    map_radio(client)
    run_with_radio(client, 0.5)
    run_with_radio(client, 0.2, kill=2000)
    assert commander(client).system_status is SystemStatus.TERMINATION
