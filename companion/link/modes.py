"""PX4's modes and MAVLink's vehicle types."""

from __future__ import annotations

from companion.messages.ownship import FlightMode

_VEHICLE_TYPES = {
    0: "generic vehicle",
    1: "fixed wing",
    2: "quadrotor",
    3: "coaxial helicopter",
    4: "helicopter",
    5: "antenna tracker",
    6: "ground station",
    7: "airship",
    8: "balloon",
    9: "rocket",
    10: "ground rover",
    11: "boat",
    12: "submarine",
    13: "hexarotor",
    14: "octorotor",
    15: "tricopter",
    16: "flapping wing",
    17: "kite",
    18: "onboard computer",
    19: "VTOL tail-sitter (2 rotors)",
    20: "VTOL tail-sitter (4 rotors)",
    21: "VTOL tilt-rotor",
    22: "VTOL",
    23: "VTOL tail-sitter",
    24: "VTOL tilt-wing",
    25: "VTOL",
    28: "parafoil",
    29: "dodecarotor",
    35: "decarotor",
    45: "spacecraft",
}

_AUTOPILOTS = {0: "generic autopilot", 3: "ArduPilot", 8: "no autopilot", 12: "PX4"}
PX4 = 12

# (main mode, sub mode) of PX4's custom_mode.
_MODES = {
    (1, 0): FlightMode.MANUAL,
    (2, 0): FlightMode.ALTCTL,
    (3, 0): FlightMode.POSCTL,
    (4, 2): FlightMode.AUTO_TAKEOFF,
    (4, 3): FlightMode.AUTO_LOITER,
    (4, 4): FlightMode.AUTO_MISSION,
    (4, 5): FlightMode.AUTO_RTL,
    (4, 6): FlightMode.AUTO_LAND,
    (4, 8): FlightMode.AUTO_FOLLOW,
    (4, 9): FlightMode.AUTO_PRECLAND,
    (5, 0): FlightMode.ACRO,
    (6, 0): FlightMode.OFFBOARD,
    (7, 0): FlightMode.STABILIZED,
    (10, 0): FlightMode.TERMINATION,
}
_NUMBERS = {mode: numbers for numbers, mode in _MODES.items()}

# Bit of the mode in PX4's navigation_mode_group: 1 << nav_state.
_NAVIGATION_STATE = {
    FlightMode.MANUAL: 0,
    FlightMode.ALTCTL: 1,
    FlightMode.POSCTL: 2,
    FlightMode.AUTO_MISSION: 3,
    FlightMode.AUTO_LOITER: 4,
    FlightMode.AUTO_RTL: 5,
    FlightMode.ACRO: 10,
    FlightMode.OFFBOARD: 14,
    FlightMode.STABILIZED: 15,
    FlightMode.AUTO_TAKEOFF: 17,
    FlightMode.AUTO_LAND: 18,
    FlightMode.AUTO_FOLLOW: 19,
    FlightMode.AUTO_PRECLAND: 20,
}

# Modes that the companion may ask for: to fly itself, or to hand the vehicle over.
REQUESTABLE = frozenset(
    {
        FlightMode.OFFBOARD,
        FlightMode.ACRO,
        FlightMode.AUTO_LOITER,
        FlightMode.AUTO_LAND,
        FlightMode.AUTO_RTL,
        FlightMode.AUTO_PRECLAND,
        FlightMode.POSCTL,
        FlightMode.ALTCTL,
    }
)


def flight_mode(custom_mode: int) -> FlightMode:
    """Give the mode of a HEARTBEAT's or CURRENT_MODE's custom_mode."""
    return _MODES.get(((custom_mode >> 16) & 0xFF, (custom_mode >> 24) & 0xFF), FlightMode.OTHER)


def mode_numbers(mode: FlightMode) -> tuple[int, int]:
    """Give the main and sub mode for DO_SET_MODE.

    Raises:
        ValueError: the companion never asks for this mode.
    """
    if mode not in REQUESTABLE:
        raise ValueError(f"mode {mode.value} is not one that the companion may ask for")
    return _NUMBERS[mode]


def mode_group_bit(mode: FlightMode) -> int:
    """Give the mode's bit in the mode masks of PX4's arming checks; all bits for a mode without one."""
    state = _NAVIGATION_STATE.get(mode)
    return 0xFFFFFFFF if state is None else 1 << state


def vehicle_type_name(vehicle_type: int) -> str:
    """Give the plain name of a MAV_TYPE."""
    return _VEHICLE_TYPES.get(vehicle_type, f"vehicle type {vehicle_type}")


def autopilot_name(autopilot: int) -> str:
    """Give the plain name of a MAV_AUTOPILOT."""
    return _AUTOPILOTS.get(autopilot, f"autopilot {autopilot}")
