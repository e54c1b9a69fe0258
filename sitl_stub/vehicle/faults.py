"""Faults that can be put into the autopilot, to see how a companion takes them."""

from collections.abc import Sequence
from dataclasses import dataclass

from sitl_stub.vehicle.notices import CRITICAL, ERROR, Event

VEHICLE_TYPES = {"multirotor": 2, "fixed_wing": 1, "rover": 10, "vtol": 22, "helicopter": 4}
"""MAV_TYPE of HEARTBEAT."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthProblem:
    """Something that PX4 would refuse to arm for."""

    text: str
    """STATUSTEXT for ground stations."""
    event: Event
    """EVENT that names it."""
    sensor_bit: int
    """Bit of SYS_STATUS.onboard_control_sensors_health that goes out."""


HEALTH_PROBLEMS = {
    "gps": HealthProblem(
        text="Preflight Fail: GPS fix too low",
        event=Event(number=29146769, level=ERROR, internal=ERROR, arguments=bytes.fromhex("7c007e0003")),
        sensor_bit=0x20,
    ),
    "heading": HealthProblem(
        text="Preflight Fail: heading estimate not stable",
        event=Event(number=33420013, level=ERROR, internal=ERROR, arguments=bytes.fromhex("7ed17e0011")),
        sensor_bit=0x4000,
    ),
    "position": HealthProblem(
        text="Preflight Fail: No valid position estimate",
        event=Event(number=30612409, level=ERROR, internal=ERROR, arguments=bytes.fromhex("7c007e0011")),
        sensor_bit=0x4000,
    ),
    "battery": HealthProblem(
        text="Preflight Fail: Low battery",
        event=Event(number=21826980, level=CRITICAL, internal=CRITICAL, arguments=bytes.fromhex("ffffffff0b")),
        sensor_bit=0x2000000,
    ),
}


class FaultError(ValueError):
    """A fault that the simulator does not know."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """Which faults are in force."""

    refuse_arming: HealthProblem | None = None
    heartbeat: bool = True
    vehicle_type: int | None = None
    """MAV_TYPE that HEARTBEAT pretends; None: the vehicle's own."""

    @classmethod
    def parse(cls, words: Sequence[str]) -> "Faults":
        """Read faults: `no_heartbeat`, `refuse_arming=REASON`, `vehicle_type=TYPE`.

        Raises `FaultError` for anything else; the message lists what there is.
        """
        problem, heartbeat, kind = None, True, None
        for word in words:
            name, _, value = word.partition("=")
            if name == "no_heartbeat" and not value:
                heartbeat = False
            elif name == "refuse_arming" and (value or "gps") in HEALTH_PROBLEMS:
                problem = HEALTH_PROBLEMS[value or "gps"]
            elif name == "vehicle_type" and value in VEHICLE_TYPES:
                kind = VEHICLE_TYPES[value]
            else:
                raise FaultError(
                    f"unknown fault {word!r}; known: no_heartbeat, refuse_arming=({'|'.join(HEALTH_PROBLEMS)}), "
                    f"vehicle_type=({'|'.join(VEHICLE_TYPES)})"
                )
        return cls(refuse_arming=problem, heartbeat=heartbeat, vehicle_type=kind)
