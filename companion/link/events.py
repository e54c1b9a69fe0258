"""What the link reports besides ownship and status."""

from __future__ import annotations

from dataclasses import dataclass

from companion.messages.ownship import FlightMode


@dataclass(frozen=True, slots=True, kw_only=True)
class Connected:
    """The vehicle's first heartbeat, or the first after a loss."""

    t: float  # [s]
    system: int
    vehicle_type: str  # plain name


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """No heartbeat within the timeout."""

    t: float  # [s]
    silence: float  # [s] since the last heartbeat


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeChanged:
    """The autopilot is in another mode."""

    t: float  # [s]
    mode: FlightMode
    previous: FlightMode
    commanded: bool  # we asked for it, and it came while the request was under way


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandFinished:
    """A command of ours has ended."""

    t: float  # [s]
    command: str  # "mode OFFBOARD", "arm", "disarm"
    accepted: bool  # acknowledged, and the state followed
    result: int | None  # MAV_RESULT of the last ACK; None: there was none
    text: str  # plain


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotEvent:
    """One EVENT of the autopilot."""

    id: int
    name: str | None  # PX4's name where known
    text: str | None  # plain words where known
    log_level: int  # 0 emergency … 3 error, 4 warning, 6 info

    def __str__(self) -> str:
        """Give the words, the name and the id: as much as is known."""
        label = f"event {self.id}" if self.name is None else f"{self.name}, event {self.id}"
        return label if self.text is None else f"{self.text} ({label})"


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmingRefused:
    """The autopilot does not arm; everything that it gives as its reason."""

    t: float  # [s]
    result: str  # of the ACK, plain
    unhealthy: tuple[str, ...]  # unhealthy bits of SYS_STATUS, plain names
    autopilot_events: tuple[AutopilotEvent, ...]  # worst first
    status_texts: tuple[str, ...]  # STATUSTEXT since the request

    @property
    def reasons(self) -> tuple[str, ...]:
        """Everything as plain lines, the most telling first."""
        lines = [str(event) for event in self.autopilot_events]
        lines += self.status_texts
        lines += [f"unhealthy: {name}" for name in self.unhealthy]
        return (*lines, f"answer to the arm command: {self.result}")


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusText:
    """A text of the autopilot, its chunks put together."""

    t: float  # [s]
    severity: int  # MAV_SEVERITY: 0 emergency … 7 debug
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorReset:
    """The autopilot's estimator has jumped: the local frame is a new one."""

    t: float  # [s]
    before: int  # reset counter, 0..255
    after: int


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotRestarted:
    """The autopilot's boot time went back."""

    t: float  # [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongVehicle:
    """The vehicle is not one that this program flies."""

    t: float  # [s]
    type_name: str  # what it says it is, plain
    autopilot: str  # what runs on it, plain
    wanted: str  # what would be right


@dataclass(frozen=True, slots=True, kw_only=True)
class RateShort:
    """A message does not come as often as was asked, and asking again has not helped."""

    t: float  # [s]
    message: str
    asked: float  # [Hz]
    measured: float  # [Hz]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRead:
    """The answer to a request for a parameter."""

    t: float  # [s]
    name: str
    value: float | None  # None: the autopilot gave none


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotIdentified:
    """The autopilot has said which software it runs."""

    t: float  # [s]
    version: str  # "1.17.0 alpha (59ded6afd…)"
    numbers: tuple[int, int, int]  # 1, 17, 0


LinkEvent = (
    Connected
    | Lost
    | ModeChanged
    | CommandFinished
    | ArmingRefused
    | StatusText
    | EstimatorReset
    | AutopilotRestarted
    | WrongVehicle
    | RateShort
    | ParameterRead
    | AutopilotIdentified
)
