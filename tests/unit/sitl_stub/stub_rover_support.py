"""A rover in memory, driven by setpoints or sticks, for the tests."""

from dataclasses import replace

from pymavlink.dialects.v20 import all as mavlink
from stub_vehicle_support import BareWorld, Client

from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.config import VehicleFile
from sitl_stub.vehicle.kinds import load_vehicle

OFFBOARD, POSCTL, LOITER, RTL = 6 << 16, 3 << 16, 4 << 16 | 3 << 24, 4 << 16 | 5 << 24
MODES = {"MANUAL": 1, "POSCTL": 3, "ACRO": 5, "STABILIZED": 7}


def rover(*, wander: bool = False, name: str = "sih_rover") -> VehicleFile:
    config = load_vehicle(name)
    return config if wander else replace(config, estimator=replace(config.estimator, enabled=False))


def start(seed: int = 1, **options: bool) -> Client:
    client = Client(Simulation(BareWorld(), rover(**options), seed), kind=6)
    client.run(0.3)
    return client


def offboard(**setpoint) -> Client:
    """Arm in OFFBOARD with a velocity of zero, then stream a setpoint."""
    client = start()
    stream(client, velocity=(0.0, 0.0, 0.0))
    client.run(0.5)
    assert client.mode(6) == [0, 0]
    assert client.arm() == [0]
    if setpoint:
        stream(client, **setpoint)
    return client


def stream(client: Client, **setpoint) -> None:
    wanted = client.setpoint(**setpoint)
    client.stream = lambda t: wanted


class Driver(Client):
    """A ground station with sticks."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation, "ground", kind=6)
        self.sticks: tuple[float, float] | None = (0.0, 0.0)

    def run(self, duration: float, until=None) -> float:
        begin = self.simulation.t
        while self.simulation.t < begin + duration - 1e-9:
            if self.sticks is not None:
                throttle, steering = self.sticks
                z, y = round(500.0 + 500.0 * throttle), round(1000.0 * steering)
                self.send(mavlink.MAVLink_manual_control_message(1, 0, y, z, 0, 0))
            super().run(min(0.04, begin + duration - self.simulation.t), until)
            if until is not None and until():
                break
        return self.simulation.t - begin


def by_sticks(mode: str, **options: bool) -> Driver:
    driver = Driver(Simulation(BareWorld(), rover(**options), 1))
    driver.run(0.3)
    assert driver.mode(MODES[mode]) == [0, 0]
    driver.run(0.1)
    assert driver.arm() == [0]
    return driver


def yaw(client: Client) -> float:
    return client.simulation.autopilot.estimate.yaw


def speed(client: Client) -> float:
    return client.simulation.body.speed


def turn_rate(client: Client) -> float:
    return client.truth.angular_velocity_frd[2]


def inner(client: Client):
    return client.simulation.autopilot.drive


def mode(client: Client) -> int:
    return client.simulation.autopilot.commander.mode.custom_mode
