"""COMMAND_LONG and COMMAND_INT: what the autopilot does on each, and how it answers."""

import math
from collections.abc import Callable
from typing import Protocol

from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.vehicle import notices
from sitl_stub.vehicle.autopilot import Autopilot
from sitl_stub.vehicle.commander import Commander
from sitl_stub.vehicle.modes import Mode, find_mode, known_main_mode
from sitl_stub.vehicle.system_state import FORCE, Result

Parameters = tuple[float, float, float, float, float, float, float]
CUSTOM_MODE_ENABLED = 1
NAV_PRECLAND = 23
"""PX4's VEHICLE_CMD_NAV_PRECLAND; MAVLink calls 23 MAV_CMD_NAV_LAND_LOCAL."""


MISSION_PLANNER = 190
"""MAV_COMP_ID_MISSIONPLANNER: who is told in words that DO_SET_MODE was refused."""
ENTERED = {
    Mode.AUTO_RTL: notices.RETURN_ASKED,
    Mode.AUTO_LAND: notices.LANDING_ASKED,
    Mode.AUTO_PRECLAND: notices.PRECISION_LANDING_ASKED,
}
"""What PX4 says when a command of its own asks for a mode."""


class Streams(Protocol):
    """Messages of the link on which a command came."""

    def send_once(self, number: int) -> bool:
        """Send one message of this id now; False when the autopilot has none such."""

    def set_interval(self, number: int, interval: float) -> bool:
        """Set the interval [s] of a stream: 0 default, below 0 off. False when there is no such message."""

    def send_interval(self, number: int) -> None:
        """Send MESSAGE_INTERVAL."""


Handler = Callable[[Streams, Parameters], Result | None]


class CommandHandler:
    """Carries out commands. `handle` returns the results to acknowledge, in order; none: PX4 stays silent."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._handlers: dict[int, Handler] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: self._report_health,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._request_version,
            mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot,
            mavlink.MAV_CMD_PREFLIGHT_CALIBRATION: self._calibrate,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._enter(Mode.AUTO_TAKEOFF),
            mavlink.MAV_CMD_NAV_LAND: self._enter(Mode.AUTO_LAND),
            NAV_PRECLAND: self._enter(Mode.AUTO_PRECLAND),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self._enter(Mode.AUTO_RTL),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self._enter(Mode.AUTO_LOITER),
        }

    @property
    def _commander(self) -> Commander:
        return self._autopilot.commander

    def handle(self, link: Streams, command: int, parameters: Parameters, *, component: int) -> list[Result]:
        """Carry out one command, asked for by this component."""
        if command == mavlink.MAV_CMD_DO_SET_MODE:
            # PX4 acknowledges twice: at once without looking, then with the real result
            return [Result.ACCEPTED, self.set_mode(parameters, component=component)]
        handler = self._handlers.get(command)
        if handler is None:
            return [Result.UNSUPPORTED]
        result = handler(link, parameters)
        return [] if result is None else [result]

    def set_mode(self, parameters: Parameters, *, component: int) -> Result:
        """DO_SET_MODE's real result, for the component that asks. Land is always taken: if need be as a descent."""
        if not all(map(math.isfinite, parameters[:3])) or not int(parameters[0]) & CUSTOM_MODE_ENABLED:
            self._commander.notices.append(notices.UNKNOWN_BASE_MODE)
            return Result.TEMPORARILY_REJECTED
        main, sub = int(parameters[1]), int(parameters[2])
        mode = find_mode(main, sub)
        if mode is None or mode is Mode.TERMINATION:
            known = known_main_mode(main) and main == Mode.AUTO_LOITER.main
            self._commander.notices.append(notices.UNKNOWN_AUTO_MODE if known else notices.UNKNOWN_MAIN_MODE)
            return Result.TEMPORARILY_REJECTED
        return self._commander.request_mode(mode, force=mode is Mode.AUTO_LAND, tell=component == MISSION_PLANNER)

    def _enter(self, mode: Mode) -> Handler:
        def handler(_link: Streams, _parameters: Parameters) -> Result:
            result = self._commander.request_mode(mode, force=mode is Mode.AUTO_LAND)
            if result is Result.ACCEPTED and mode in ENTERED:
                self._commander.notices.append(ENTERED[mode])
            return result

        return handler

    def _arm_disarm(self, _link: Streams, parameters: Parameters) -> Result | None:
        wanted = parameters[0]
        if wanted == 1.0:
            return self._commander.request_arm()
        if wanted == 0.0 or math.isnan(wanted):
            return self._commander.request_disarm(force=parameters[1] == FORCE)
        self._commander.notices.append(notices.unsupported_arm_parameter(wanted))
        return None

    def _terminate(self, _link: Streams, parameters: Parameters) -> Result:
        if parameters[0] > 0.5:
            return self._commander.request_termination()
        return Result.DENIED

    def _report_health(self, _link: Streams, _parameters: Parameters) -> Result:
        if self._commander.armed:
            return Result.TEMPORARILY_REJECTED
        self._commander.report_health()
        return Result.ACCEPTED

    def _request_message(self, link: Streams, parameters: Parameters) -> Result:
        return Result.ACCEPTED if _is_id(parameters[0]) and link.send_once(int(parameters[0])) else Result.DENIED

    def _set_interval(self, link: Streams, parameters: Parameters) -> Result:
        message, interval = parameters[0], parameters[1]
        if not _is_id(message) or not math.isfinite(interval) or int(message) == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return Result.FAILED
        return Result.ACCEPTED if link.set_interval(int(message), interval * 1e-6) else Result.FAILED

    def _get_interval(self, link: Streams, parameters: Parameters) -> Result:
        if _is_id(parameters[0]):
            link.send_interval(int(parameters[0]))
        return Result.ACCEPTED

    def _request_version(self, link: Streams, _parameters: Parameters) -> Result:
        link.send_once(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        return Result.ACCEPTED

    def _reboot(self, _link: Streams, parameters: Parameters) -> Result:
        """Reboot on the ground; in the air and for anything but a reboot PX4 refuses."""
        if self._commander.armed or parameters[0] != 1.0:
            return Result.DENIED
        self._autopilot.reboot()
        return Result.ACCEPTED

    def _calibrate(self, _link: Streams, parameters: Parameters) -> Result:
        """Calibration: refused while armed; of the simulated sensors only the gyros have one."""
        if parameters[0] == 1.0:
            return self._commander.request_gyro_calibration()
        return Result.TEMPORARILY_REJECTED if self._commander.armed else Result.ACCEPTED


def _is_id(value: float) -> bool:
    return math.isfinite(value) and 0.0 <= value < 2.0**24
