"""The autopilot's state as MAVLink messages: modes, health, battery, version."""

import math
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.vehicle.autopilot import Autopilot
from sitl_stub.vehicle.modes import AUTO, NEEDS_STICKS, TITLES, Mode

SENSORS_PRESENT, SENSORS_ENABLED, SENSORS_HEALTHY, PREARM_CHECK = 50348079, 50413615, 52480063, 0x10000000
POSITION_CONTROL, RADIO, BATTERY = 0x4000, 0x10000, 0x2000000
ESTIMATES, HORIZONTAL = 895, 2 | 8 | 16 | 256 | 512
"""ESTIMATOR_STATUS.flags of PX4 when all is well, and the bits that need a horizontal position."""
UNIX_TIME_AT_START_US = 1_795_302_900_000_000
"""SYSTEM_TIME's wall clock at simulation time 0: fixed, so that runs repeat."""
STANDARD_MODES = {
    Mode.POSCTL: 1,
    Mode.ALTCTL: 4,
    Mode.AUTO_RTL: 5,
    Mode.AUTO_MISSION: 6,
    Mode.AUTO_LAND: 7,
    Mode.AUTO_TAKEOFF: 8,
}
"""MAV_STANDARD_MODE, as recorded in CURRENT_MODE; all others 0."""
NAN = math.nan


class StatusTelemetry:
    """Makes messages."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot

    def heartbeat(self) -> Any:
        """HEARTBEAT with PX4's base mode bits."""
        commander = self._autopilot.commander
        mode = commander.mode
        base = 1 | (128 if commander.armed else 0)
        if mode in AUTO:
            base |= 4 | 8 | 16
        elif mode is Mode.OFFBOARD:
            base |= 16 if commander.checks.ever_had_setpoint else 0
        elif mode in NEEDS_STICKS:
            base |= 64 | (16 if mode not in (Mode.MANUAL, Mode.ACRO) else 0)
        return mavlink.MAVLink_heartbeat_message(
            self._vehicle_type(), 12, base, mode.custom_mode, int(commander.system_status), 3
        )

    def _vehicle_type(self) -> int:
        pretended = self._autopilot.faults.vehicle_type
        return int(self._autopilot.parameters["MAV_TYPE"]) if pretended is None else pretended

    def sys_status(self) -> Any:
        """SYS_STATUS with the pre-arm bit and, when a check fails, the failing sensor's bit cleared."""
        autopilot = self._autopilot
        problem, flags = autopilot.commander.checks.problem, autopilot.commander.flags
        healthy = SENSORS_HEALTHY
        if problem is not None:
            healthy &= ~problem.sensor_bit
        if flags.position_invalid:
            healthy &= ~POSITION_CONTROL
        if flags.battery_warning:
            healthy &= ~BATTERY
        if not flags.manual_control_lost:
            healthy |= RADIO
        if autopilot.commander.checks.can_arm:
            healthy |= PREARM_CHECK
        return mavlink.MAVLink_sys_status_message(
            SENSORS_PRESENT,
            SENSORS_ENABLED,
            healthy,
            80,
            autopilot.battery.millivolts,
            -100,
            autopilot.battery.percent,
            0,
            0,
            0,
            0,
            0,
            0,
        )

    def system_time(self) -> Any:
        """SYSTEM_TIME."""
        microseconds = UNIX_TIME_AT_START_US + int(self._autopilot.t * 1e6)
        return mavlink.MAVLink_system_time_message(microseconds, int(self._autopilot.boot_time * 1e3) & 0xFFFFFFFF)

    def battery_status(self) -> Any:
        """BATTERY_STATUS."""
        battery = self._autopilot.battery
        cells = [battery.millivolts] + [65535] * 9
        return mavlink.MAVLink_battery_status_message(
            0, 1, 1, 32767, cells, -100, 0, -1, battery.percent, 0, battery.charge_state
        )

    def autopilot_version(self) -> Any:
        """AUTOPILOT_VERSION of PX4 v1.17."""
        commit = (0, 0, 0, 253, 175, 214, 222, 89)
        return mavlink.MAVLink_autopilot_version_message(
            59647, 17891392, 17891392, 101854463, 1, commit, commit, (0,) * 8, 0, 0, 5283920058631409231
        )

    def estimator_status(self) -> Any:
        """ESTIMATOR_STATUS: without a trusted position its horizontal parts go out."""
        invalid = self._autopilot.commander.flags.position_invalid
        return mavlink.MAVLink_estimator_status_message(
            int(self._autopilot.boot_time * 1e6),
            ESTIMATES & ~HORIZONTAL if invalid else ESTIMATES,
            0.02,
            0.009,
            0.006,
            0.13,
            0.05,
            NAN,
            0.29,
            0.035,
        )

    def extended_sys_state(self) -> Any:
        """EXTENDED_SYS_STATE: 1 on ground, 2 in air, 4 landing (AUTO modes only)."""
        autopilot = self._autopilot
        if autopilot.landed:
            state = 1
        elif autopilot.landing:
            state = 4
        else:
            state = 2
        return mavlink.MAVLink_extended_sys_state_message(0, state)

    def current_mode(self) -> Any:
        """CURRENT_MODE."""
        commander = self._autopilot.commander
        standard = STANDARD_MODES.get(commander.mode, 0)
        return mavlink.MAVLink_current_mode_message(
            standard, commander.mode.custom_mode, commander.intended.custom_mode
        )

    def available_modes(self) -> list[Any]:
        """AVAILABLE_MODES, one message for each mode that can be asked for."""
        modes = [mode for mode in Mode if mode not in (Mode.DESCEND, Mode.TERMINATION)]
        return [
            mavlink.MAVLink_available_modes_message(
                len(modes), i, STANDARD_MODES.get(mode, 0), mode.custom_mode, 0, TITLES[mode].encode()
            )
            for i, mode in enumerate(modes, start=1)
        ]
