"""Flies a recording's inputs through the stub, and notes what an observer sees of it."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.fidelity.estimate_errors import RecordedEstimator
from sitl_stub.fidelity.flight import (
    ACK_GROUND,
    ACK_ONBOARD,
    ARMED,
    HEARTBEAT,
    LANDED,
    LANDED_STATE,
    MODE,
    STATE,
    TEXT,
    Angles,
    Array,
    Flight,
    Report,
    Track,
    Value,
    from_start,
)
from sitl_stub.fidelity.open_air import OpenAir
from sitl_stub.fidelity.recording import Input, Link, Recording
from sitl_stub.fidelity.simulator_faults import simulator_faults
from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.autopilot import REBOOT_TIME
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.vehicle.ekf_resets import READY_AFTER
from sitl_stub.vehicle.faults import FaultError, Faults
from sitl_stub.vehicle.mavlink_io import PORTS
from sitl_stub.vehicle.receiver import COMPONENT, frame_source
from sitl_stub.vehicle.status_telemetry import StatusTelemetry

LOOK_INTERVAL = 0.02
"""How often the flight is looked at [s]."""
COMPANION_COMPONENT, GROUND_SYSTEM, GROUND_COMPONENT = 191, 255, 190
LEAD = 1
"""The replay begins at least so long [s] before the recording: what was coming then has been noticed when it begins."""
STREAM_GAP, LANDING_WAIT = 0.1, 25.0
"""An input younger than this [s] is still being repeated; a landing is waited for at most so long [s]."""
STREAMS = ("cmd", "manual", "rcovr")
Errors = Literal["none", "own", "recorded"]
"""Whose errors the estimate has: nobody's, the stub's own, or those of the recording."""
HEARD = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    }
)
"""Messages that are decoded; the others only cost time."""


class Replay:
    """One flight of the stub along a recording."""

    def __init__(self, recording: Recording, vehicle: VehicleConfig, *, seed: int, errors: Errors) -> None:
        self._recording = recording
        vehicle = replace(vehicle, estimator=replace(vehicle.estimator, enabled=errors == "own"))
        self._air = OpenAir(
            north=-recording.parameters.get("SIH_WIND_N", 0.0), east=-recording.parameters.get("SIH_WIND_E", 0.0)
        )
        # boot time = begin + simulation time: so that HEARTBEAT comes when PX4's came
        from_boot = recording.start < READY_AFTER
        whole = math.floor(recording.start - recording.heartbeat_phase) - LEAD
        self._begin = -REBOOT_TIME if from_boot else recording.heartbeat_phase + whole
        self._simulation = simulation = _start(
            self._air, vehicle, seed, faults=[*(["reboot"] * from_boot), *simulator_faults(recording, self._begin)]
        )
        if errors == "recorded":
            autopilot = simulation.autopilot
            autopilot.estimator = RecordedEstimator(
                vehicle.estimator, simulation.body, recording.errors, estimate=autopilot.estimate, t=self._begin
            )
        self._encoders: dict[Link, Any] = {
            "onboard": mavlink.MAVLink(None, srcSystem=1, srcComponent=COMPANION_COMPONENT),
            "ground": mavlink.MAVLink(None, srcSystem=GROUND_SYSTEM, srcComponent=GROUND_COMPONENT),
        }
        self._status = StatusTelemetry(simulation.autopilot)
        self._decoder = mavlink.MAVLink(None)
        self._reports: list[Report] = []
        self._inside: dict[str, Value] = {}
        self._motion: list[list[float]] = []
        self._stream: Input | None = None
        self._delay = 0.0
        self._now = self._beaten = self._begin
        self._known = set(self._simulation.autopilot.parameters)
        for name, value in recording.parameters.items():
            self._set_parameter(name, value)

    def fly(self) -> Flight:
        """Fly from the recording's first input to its end."""
        landings = self._recording.flight.landings()
        for t, action in self._timeline():
            if landings and t >= landings[0]:
                landings = []
                self._wait_for_landing(t)
            self._advance(t)
            if action is None:
                self._look()
            else:
                action()
        return self._flight(np.array(self._motion))

    def _advance(self, t: float) -> None:
        """Advance to where the recording is at boot time `t`."""
        self._now = t + self._delay
        self._simulation.advance(self._now - self._begin)

    def _wait_for_landing(self, t: float) -> None:
        """Keep the last input up until the stub has landed too: whoever made the recording waited for that.

        How long PX4 takes from contact to landed depends on chance; what came after the landing comes that much later.
        """
        stream = self._stream if self._stream is not None and t - self._stream.t < STREAM_GAP else None
        waited = self._delay
        while self._delay - waited < LANDING_WAIT and not self._landed:
            self._delay += LOOK_INTERVAL
            self._advance(t)
            if stream is not None:
                self._put_in(stream)
            if self._now - self._beaten >= 1.0:
                self._beat()
            self._look()

    def _timeline(self) -> list[tuple[float, Callable[[], None] | None]]:
        """Inputs, heartbeats of both partners, and looks (None), in the order of the recording's time."""
        recording, begin = self._recording, self._begin
        plan: list[tuple[float, int, Callable[[], None] | None]] = []
        plan += [(entry.t, 1, partial(self._put_in, entry)) for entry in recording.inputs if entry.t >= begin]
        plan += [(t, 1, partial(self._put_in, entry)) for t, entry in _earlier(recording, begin)]
        plan += [(t, 0, self._beat) for t in np.arange(begin, recording.end, 1.0).tolist()]
        plan += [(t, 2, None) for t in np.arange(begin, recording.end, LOOK_INTERVAL).tolist()]
        plan.sort(key=lambda item: (item[0], item[1]))
        return [(t, action) for t, _, action in plan]

    # what goes in

    def _send(self, link: Link, message: Any) -> None:
        encoder = self._encoders[link]
        self._simulation.receive(link, bytes(message.pack(encoder)))
        encoder.seq = (encoder.seq + 1) & 0xFF

    def _beat(self) -> None:
        self._beaten = self._now
        self._send("onboard", mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
        self._send("ground", mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    def _put_in(self, entry: Input) -> None:
        if entry.kind == "parameter":
            self._set_parameter(str(entry.values["name"]), float(entry.values["value"]))
            return
        if entry.kind == "evin":
            return  # it carries PX4's truth; the stub's estimator has its own, jumps are put in as faults
        if entry.kind in STREAMS:
            self._stream = entry
        self._send(entry.link, _message(entry, milliseconds=int(self._now * 1e3)))

    def _set_parameter(self, name: str, value: float) -> None:
        """Set a parameter by the ground station; those of PX4's simulator turn the stub's own knobs."""
        if name == "SIH_WIND_N":
            self._air.north = -value
        elif name == "SIH_WIND_E":
            self._air.east = -value
        elif name in self._known and not (self._recording.clean and name.startswith("EKF2_")):
            autopilot = self._simulation.autopilot
            autopilot.parameters[name] = type(autopilot.parameters[name])(value)
            autopilot.parameter_changed()

    # what comes out

    def _look(self) -> None:
        """Note the motion, what the autopilot has sent, and the states inside."""
        t, simulation = self._now, self._simulation
        for link in PORTS:
            for frame in simulation.transmit(link):
                number, _, component = frame_source(frame)
                if number in HEARD and component == COMPONENT:  # not what is forwarded from the other partner
                    message = self._decoder.decode(bytearray(frame))
                    self._reports.extend(_reports(message, t, onboard=link == "onboard"))
        commander, estimate = simulation.autopilot.commander, simulation.autopilot.estimate
        inside: tuple[tuple[str, Value], ...] = (
            (MODE, (commander.mode.name,)),
            (ARMED, (int(commander.armed),)),
            (STATE, _state(self._status.heartbeat())),
        )
        for channel, value in inside:
            if self._inside.get(channel) != value:
                self._inside[channel] = value
                self._reports.append(Report(t=t, channel=channel, value=value))
        vehicle = simulation.truth().vehicle
        angles = (estimate.roll, estimate.pitch, estimate.yaw)
        self._motion.append(
            [t, *vehicle.position_ned, *vehicle.velocity_ned, *estimate.position, *estimate.velocity, *angles]
        )

    @property
    def _landed(self) -> bool:
        return any(report.words.startswith(LANDED) for report in self._reports)

    def _flight(self, motion: Array) -> Flight:
        t = motion[:, 0]
        ground = motion[0, 1:4]
        return Flight(
            truth=Track(t=t, position=motion[:, 1:4] - ground, velocity=motion[:, 4:7]),
            estimate=Track(t=t, position=motion[:, 7:10], velocity=motion[:, 10:13]),
            attitude=Angles(t=t, roll_pitch_yaw=motion[:, 13:16]),
            reports=tuple(from_start(self._reports, self._recording.start)),
        )


def _start(air: OpenAir, vehicle: VehicleConfig, seed: int, *, faults: Sequence[str]) -> Simulation:
    """Start a flight with the faults that the stub knows; those that it does not know show in the comparison."""
    known = []
    for fault in faults:
        try:
            Faults.parse([fault])
        except FaultError:
            continue
        known.append(fault)
    return Simulation(air, vehicle, seed, faults=known)


def _earlier(recording: Recording, begin: float) -> Iterator[tuple[float, Input]]:
    """Inputs that had been coming since before the recording begins: a stream that runs at its start ran already."""
    first = {entry.kind: entry for entry in reversed(recording.inputs) if entry.kind in STREAMS}
    for entry in first.values():
        if entry.t - recording.start < STREAM_GAP:
            yield from ((t, entry) for t in np.arange(begin, recording.start, STREAM_GAP / 2).tolist())


def _message(entry: Input, *, milliseconds: int) -> Any:
    """Make the MAVLink message of an input."""
    values = entry.values
    if entry.kind == "command":
        return mavlink.MAVLink_command_long_message(
            values["target_system"], values["target_component"], values["command"], 0, *values["params"]
        )

    def cell(name: str) -> float:
        return float(values.get(name, 0.0))

    if entry.kind == "cmd":
        fields = [cell(name) for name in ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "yaw", "yaw_rate")]
        frame, mask = int(cell("frame")), int(cell("type_mask"))
        return mavlink.MAVLink_set_position_target_local_ned_message(milliseconds, 1, 1, frame, mask, *fields)
    if entry.kind == "manual":
        sticks = [int(cell(name)) for name in ("x", "y", "z", "r")]
        return mavlink.MAVLink_manual_control_message(1, *sticks, 0)
    channels = [int(cell(name)) for name in ("x", "y", "z", "r")]
    return mavlink.MAVLink_rc_channels_override_message(1, 1, *channels, 0, 0, 0, 0)


def _state(beat: Any) -> Value:
    """Main mode, sub mode, base mode and system status of a HEARTBEAT."""
    return (beat.custom_mode >> 16 & 0xFF, beat.custom_mode >> 24, beat.base_mode, beat.system_status)


def _reports(message: Any, t: float, *, onboard: bool) -> Iterator[Report]:
    kind = message.get_type()
    if kind == "COMMAND_ACK":
        channel = ACK_ONBOARD if onboard else ACK_GROUND
        yield Report(t=t, channel=channel, value=(message.command, message.result))
    elif kind == "HEARTBEAT" and onboard:
        yield Report(t=t, channel=HEARTBEAT, value=_state(message))
    elif kind == "EXTENDED_SYS_STATE" and onboard:
        yield Report(t=t, channel=LANDED_STATE, value=(message.landed_state,))
    elif kind == "STATUSTEXT" and not onboard and message.chunk_seq == 0:
        words = message.text if isinstance(message.text, str) else message.text.decode()
        yield Report(t=t, channel=TEXT, value=(message.severity,), words=words.strip())
