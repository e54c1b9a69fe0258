"""A session with MAVSDK's Python binding (version 4), run as a program of its own.

    PYTHON mavsdk_session.py flight|refusals UDP_PORT

Prints one JSON object a step: what was asked, and the value or the client's own error. Knows nothing of the simulator.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk import Configuration, Mavsdk, System
from mavsdk.component_type import ComponentType
from mavsdk.exceptions import MavsdkError
from mavsdk.plugins.action import Action
from mavsdk.plugins.info import Info
from mavsdk.plugins.offboard import Offboard, PositionNedYaw, VelocityBodyYawspeed, VelocityNedYaw
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

HEIGHT = 3.0


def step(name: str, call: Callable[[], Any]) -> Any:
    """Do one thing and say how it went."""
    try:
        value = call()
    except MavsdkError as error:
        result = getattr(error, "result", None)
        print(json.dumps({"step": name, "error": getattr(result, "name", str(error))}), flush=True)
        return None
    print(
        json.dumps({"step": name, "value": value if isinstance(value, int | float | str | list) else None}), flush=True
    )
    return value


def until(name: str, wanted: Callable[[], bool], limit: float) -> bool:
    """Wait for a state."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if wanted():
            break
        time.sleep(0.05)
    return bool(step(name, lambda: bool(wanted())))


class Session:
    """The plugins around one system."""

    def __init__(self, system: System) -> None:
        self.action, self.offboard, self.param = Action(system), Offboard(system), Param(system)
        self.telemetry, self.info = Telemetry(system), Info(system)

    def mode(self) -> str:
        return str(self.telemetry.flight_mode().name)

    def ned(self) -> tuple[float, float, float]:
        place = self.telemetry.position_velocity_ned().position
        return place.north_m, place.east_m, place.down_m

    def speed(self) -> float:
        velocity = self.telemetry.position_velocity_ned().velocity
        return math.hypot(velocity.north_m_s, velocity.east_m_s)

    def near(self, north: float, east: float, down: float) -> bool:
        return math.dist(self.ned(), (north, east, down)) < 0.5


def flight(s: Session) -> None:
    """Connect, health, telemetry, parameters, take-off, offboard, hold, land."""
    until("health", s.telemetry.health_all_ok, 20.0)
    step("version", lambda: s.info.get_version().flight_sw_major)
    step("product", lambda: s.info.get_product().vendor_id)
    step("identification", lambda: s.info.get_identification().legacy_uid)
    until("gps", lambda: s.telemetry.gps_info().num_satellites >= 6, 10.0)
    until("battery", lambda: s.telemetry.battery().remaining_percent > 50.0, 10.0)
    until("home", lambda: abs(s.telemetry.home().latitude_deg) > 1.0, 10.0)
    until("on ground", lambda: s.telemetry.landed_state().name == "ON_GROUND", 10.0)
    step("attitude rate", lambda: s.telemetry.set_rate_attitude_quaternion(20.0))
    step("takeoff altitude", lambda: s.action.set_takeoff_altitude(HEIGHT))
    step("takeoff altitude read", s.action.get_takeoff_altitude)
    parameters = s.param.get_all_params()
    step("all parameters", lambda: len(parameters.int_params) + len(parameters.float_params))
    step("float", lambda: s.param.get_param_float("MPC_XY_VEL_MAX"))
    step("float set", lambda: s.param.set_param_float("MPC_XY_VEL_MAX", 11.0))
    step("float read", lambda: s.param.get_param_float("MPC_XY_VEL_MAX"))
    step("int", lambda: s.param.get_param_int("COM_RC_OVERRIDE"))
    step("int set", lambda: s.param.set_param_int("COM_RC_OVERRIDE", 3))
    step("int read", lambda: s.param.get_param_int("COM_RC_OVERRIDE"))
    step("arm", s.action.arm)
    until("armed", s.telemetry.armed, 5.0)
    step("takeoff", s.action.takeoff)
    until("in air", s.telemetry.in_air, 10.0)
    down = s.ned()[2]
    until("climbed", lambda: s.ned()[2] < down - 0.7 * HEIGHT, 20.0)
    until("holds", lambda: s.mode() == "HOLD", 15.0)
    offboard(s)
    step("hold", s.action.hold)
    until("mode hold", lambda: s.mode() == "HOLD", 5.0)
    until("stands", lambda: s.speed() < 0.5, 10.0)
    step("land", s.action.land)
    until("mode land", lambda: s.mode() == "LAND", 5.0)
    until("landed", lambda: not s.telemetry.in_air(), 90.0)
    until("disarmed", lambda: not s.telemetry.armed(), 20.0)


def offboard(s: Session) -> None:
    """Positions and velocities."""
    north, east, down = s.ned()
    goal = (north + 3.0, east - 2.0, down)
    step("position", lambda: s.offboard.set_position_ned(PositionNedYaw(*goal, 0.0)))
    step("offboard", s.offboard.start)
    until("mode offboard", lambda: s.mode() == "OFFBOARD", 5.0)
    step("active", lambda: int(s.offboard.is_active()))
    until("there", lambda: s.near(*goal), 15.0)
    step("velocity", lambda: s.offboard.set_velocity_ned(VelocityNedYaw(1.0, 0.0, 0.0, 0.0)))
    until("moves", lambda: s.speed() > 0.6, 10.0)
    step("body velocity", lambda: s.offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 20.0)))
    until("turns", lambda: s.telemetry.attitude_euler().yaw_deg > 20.0, 10.0)
    step("offboard stop", s.offboard.stop)
    until("left offboard", lambda: s.mode() == "HOLD", 5.0)


def refusals(s: Session) -> None:
    """What the client must report as failed, and how."""
    until("health", s.telemetry.health_all_ok, 20.0)
    until("on ground", lambda: s.telemetry.landed_state().name == "ON_GROUND", 10.0)
    step("offboard without a setpoint", s.offboard.start)
    step("unknown parameter", lambda: s.param.get_param_float("NO_SUCH_PARAM"))
    step("wrong type read", lambda: s.param.get_param_int("MPC_XY_VEL_MAX"))
    step("wrong type set", lambda: s.param.set_param_int("MPC_XY_VEL_MAX", 3))
    step("relay", lambda: s.action.set_actuator(1, 0.5))
    step("vtol", s.action.transition_to_fixedwing)
    step("arm", s.action.arm)
    until("armed", s.telemetry.armed, 5.0)
    step("takeoff", s.action.takeoff)
    down = s.ned()[2]
    until("climbed", lambda: s.ned()[2] < down - 1.0, 20.0)
    step("disarm in the air", s.action.disarm)
    step("reboot in the air", s.action.reboot)
    step("land", s.action.land)
    until("disarmed", lambda: not s.telemetry.armed(), 90.0)
    step("disarm again", s.action.disarm)


def unready(s: Session) -> None:
    """A vehicle whose checks fail."""
    until("on ground", lambda: s.telemetry.landed_state().name == "ON_GROUND", 10.0)
    step("healthy", lambda: int(s.telemetry.health_all_ok()))
    step("arm", s.action.arm)


def main() -> int:
    what, port = sys.argv[1:3]
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    connected = mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
    step("connection", lambda: str(getattr(connected, "name", connected)))
    system = mavsdk.first_autopilot(15.0)
    step("system", lambda: system.get_system_id() if system is not None else -1)
    if system is None:
        return 1
    {"flight": flight, "refusals": refusals, "unready": unready}[what](Session(system))
    return 0


if __name__ == "__main__":
    sys.exit(main())
