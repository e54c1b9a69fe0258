"""A flying simulated PX4 and its two clients, for the tests of the rulebook."""

import struct
from typing import Any

from pymavlink.dialects.v20 import all as mavlink
from stub_vehicle_support import BareWorld, Client, vehicle

from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.commander import Commander
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.notices import number

GCS = mavlink.MAV_TYPE_GCS


def companion(*, seed: int = 1, wander: bool = False, faults=()) -> Client:
    client = Client(Simulation(BareWorld(), vehicle(wander=wander), seed, faults=faults))
    client.run(0.2)
    return client


def flying(height: float = 3.0, **options: Any) -> Client:
    """A companion whose vehicle holds in OFFBOARD, streaming."""
    client = companion(**options)
    client.take_off(height)
    return client


def ground_station(client: Client) -> Client:
    """The ground station of the same vehicle; run the companion to let time pass, then read this one."""
    ground = Client(client.simulation, "ground", kind=GCS)
    ground.send(mavlink.MAVLink_heartbeat_message(GCS, 8, 0, 0, 4, 3))
    ground.read()
    client.partners.append(ground)
    return ground


def commander(client: Client) -> Commander:
    return client.simulation.autopilot.commander


def mode(client: Client) -> Mode:
    return commander(client).mode


def set_parameter(client: Client, name: str, value: float | int) -> None:
    """PARAM_SET over MAVLink."""
    whole = isinstance(client.simulation.autopilot.parameters[name], int)
    coded = struct.unpack("<f", struct.pack("<i", int(value)))[0] if whole else float(value)
    client.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), coded, 6 if whole else 9))
    assert client.simulation.autopilot.parameters[name] == value


def wait_for(client: Client, wanted: Mode, limit: float) -> float:
    """Run until the mode is in force; return how long that took."""
    taken = client.run(limit, lambda: mode(client) is wanted)
    assert mode(client) is wanted, mode(client)
    return taken


def event_numbers(client: Client) -> list[int]:
    return [event.id for event in client.of("EVENT")]


def event_named(client: Client, name: str) -> bool:
    return number(name) in event_numbers(client)


def texts(client: Client) -> list[tuple[int, str]]:
    """Whole STATUSTEXTs with their severities."""
    whole: dict[int, tuple[int, str]] = {}
    for message in client.of("STATUSTEXT"):
        severity, before = whole.get(message.id, (message.severity, ""))
        whole[message.id] = (severity, before + message.text)
    return [(severity, text.strip()) for severity, text in whole.values()]


def sticks(client: Client, *, pitch: int = 0, roll: int = 0, throttle: int = 500, yaw: int = 0) -> None:
    client.send(mavlink.MAVLink_manual_control_message(1, pitch, roll, throttle, yaw, 0))


def run_with_sticks(client: Client, duration: float, **positions: int) -> None:
    """Let time pass with sticks at 25 Hz."""
    for _ in range(round(duration / 0.04)):
        sticks(client, **positions)
        client.run(0.04)


def channels(client: Client, *values: int) -> None:
    raw = list(values) + [0] * (18 - len(values))
    client.send(mavlink.MAVLink_rc_channels_override_message(1, 1, *raw))


def map_radio(client: Client) -> None:
    """Parameters of q14_rc_channels_override, and a mode and a kill switch."""
    for name, value in {
        "COM_RC_IN_MODE": 0,
        "RC_CHAN_CNT": 8,
        "RC_MAP_ROLL": 1,
        "RC_MAP_PITCH": 2,
        "RC_MAP_THROTTLE": 3,
        "RC_MAP_YAW": 4,
        "RC3_TRIM": 1000.0,
        "RC_MAP_FLTMODE": 5,
        "COM_FLTMODE1": 2,
        "COM_FLTMODE6": 7,
        "RC_MAP_KILL_SW": 6,
    }.items():
        set_parameter(client, name, value)


def run_with_radio(client: Client, duration: float, *, roll: int = 1500, flight: int = 2000, kill: int = 1000) -> None:
    for _ in range(round(duration / 0.04)):
        channels(client, roll, 1500, 1500, 1500, flight, kill)
        client.run(0.04)
