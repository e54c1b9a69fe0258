"""The MAVLink protocol of the companion, without I/O: bytes and the time go in, bytes and facts come out."""

from __future__ import annotations

from collections.abc import Callable

from companion.link import incoming, outgoing
from companion.link.arming import RefusalCollector
from companion.link.desk import CommandDesk
from companion.link.events import (
    AutopilotIdentified,
    AutopilotRestarted,
    Connected,
    EstimatorReset,
    LinkEvent,
    Lost,
    ModeChanged,
    StatusText,
)
from companion.link.frames import FrameReader
from companion.link.identity import Identity
from companion.link.modes import vehicle_type_name
from companion.link.odometry import OwnshipBuilder
from companion.link.operator_commands import OperatorCommands
from companion.link.parameter_reads import ParameterCache
from companion.link.parameters import LinkParameters
from companion.link.pilot_link import PilotLink
from companion.link.rates import RateKeeper
from companion.link.signing import Signing
from companion.link.statistics import LinkStatistics
from companion.link.status import Health, StatusTracker
from companion.link.texts import TextAssembler
from companion.link.timesync import TimesyncClient
from companion.messages.motion import AnySetpoint, SticksSetpoint
from companion.messages.ownship import FlightMode, OwnshipState, VehicleStatus
from companion.messages.pilot import LandingTarget
from companion.messages.thrust import AttitudeThrust

_QUEUE = 4096  # ownship states or events that nobody takes; older ones are dropped
_STAMP_NONSENSE = 0.5  # [s] a mapped stamp further than this from its arrival is not believed


class AutopilotLink:
    """One vehicle, seen and commanded over MAVLink.

    It only executes: whether a mode may be asked for is the guardian's decision. A mode request that is under way is
    dropped when somebody else changes the mode.

    Args:
        parameters: who talks to whom, and the tuning.
        signing: with the key that the autopilot has; nothing that it does not verify is looked at. None: whatever comes
            is believed, signed or not (PX4 without a key signs with zeros).
        ground_station: a ground station has an address of its own; see `pilot.take_ground`. What it gets is signed too.
    """

    def __init__(
        self, parameters: LinkParameters, signing: Signing | None = None, *, ground_station: bool = False
    ) -> None:
        self._parameters = parameters
        self._signing = signing
        system, component = parameters.system_id, parameters.component_id
        self._reader = FrameReader(
            incoming.WANTED,
            system=system,
            component=component,
            believes=None
            if signing is None
            else lambda frame, signed: signing.verify(frame, signed=signed, source=(system, component)),
        )
        own = parameters.own_component_id
        self._encoder = outgoing.Encoder(system=system, component=component, own_component=own, signing=signing)
        ground = None
        if ground_station:
            ground = outgoing.Encoder(system=system, component=component, own_component=own, signing=signing)
        self.pilot = PilotLink(parameters.pilot, self._encoder, ground)
        self._timesync = TimesyncClient(parameters.timesync)
        self._ownship = OwnshipBuilder(parameters.odometry)
        self._status = StatusTracker(parameters.status)
        self._rates = RateKeeper(parameters.rates)
        self._refusals = RefusalCollector(parameters.arming)
        self._texts = TextAssembler()
        self._parameter_cache = ParameterCache(parameters.parameter_reads)
        self._desk = CommandDesk(self._encoder, self._refusals, parameters.commands)
        self._operator = OperatorCommands(
            parameters.operator,
            system=system,
            own_component=parameters.own_component_id,
            encoder=self._encoder,
            signing=signing,
        )
        self._identity = Identity(parameters.vehicle_types, wanted=parameters.vehicle_wanted)
        self._states: list[OwnshipState] = []
        self._events: list[LinkEvent] = []
        self._next_heartbeat = float("-inf")
        self._reset_counter: int | None = None
        self._connected = False
        self._datagrams = 0
        self._undecodable = 0
        self._handlers: dict[int, Callable[[bytes, float], None]] = {
            incoming.HEARTBEAT: self._on_heartbeat,
            incoming.SYS_STATUS: lambda p, t: self._status.sensors(incoming.sys_status(p), t),
            incoming.PARAM_VALUE: lambda p, _: self._parameter_cache.take(incoming.param_value(p)),
            incoming.PARAM_ERROR: lambda p, _: self._parameter_cache.refuse(incoming.param_error(p)),
            incoming.COMMAND_ACK: self._on_ack,
            incoming.TIMESYNC: self._on_timesync,
            incoming.BATTERY_STATUS: lambda p, t: self._status.battery(incoming.battery_status(p), t),
            incoming.AUTOPILOT_VERSION: self._on_version,
            incoming.ESTIMATOR_STATUS: lambda p, t: self._status.estimator(incoming.estimator_status(p), t),
            incoming.EXTENDED_SYS_STATE: lambda p, t: self._status.landed(incoming.landed_state(p), t),
            incoming.STATUSTEXT: self._on_text,
            incoming.ODOMETRY: self._on_odometry,
            incoming.EVENT: self._on_event,
            incoming.RC_CHANNELS: lambda p, t: self._status.channels(incoming.rc_channels(p), t),
            incoming.MANUAL_CONTROL: lambda p, t: self._status.manual(incoming.manual_control(p), t),
            incoming.CURRENT_MODE: self._on_current_mode,
        }

    # ---- in

    def receive(self, datagram: bytes, t: float) -> None:
        """Take one datagram that arrived at `t` [s]. Never raises for its content."""
        self._datagrams += 1
        if self._signing is not None:
            self._signing.advance(t)
        self._operator.receive(datagram)
        for frame in self._reader.read(datagram):
            self._rates.arrived(frame.message_id)
            try:
                self._handlers[frame.message_id](frame.payload, t)
            except (ValueError, OverflowError):  # the last net; the fuzz tests expect it to stay empty
                self._undecodable += 1

    def recognises(self, datagram: bytes) -> bool:
        """Tell whether a datagram holds a sound frame of the configured vehicle; others are counted as foreign.

        With a key it must be signed with it, but may be old: an autopilot that has restarted stamps its frames with the
        time of the key's set-up until it has heard a newer one from us. `receive` does not look at an old frame.
        """
        signing = self._signing
        reader = FrameReader(
            incoming.WANTED,
            system=self._parameters.system_id,
            component=self._parameters.component_id,
            believes=None if signing is None else lambda frame, signed: signed and signing.authentic(frame),
        )
        found = bool(reader.read(datagram))
        self._reader.add_foreign(reader)
        self._reader.unbelieved += reader.unbelieved
        return found

    # ---- out

    def poll(self, t: float) -> list[bytes]:
        """Give the datagrams that are due at `t` [s]. Call it at every tick; setpoints go another way."""
        self._watch_connection(t)
        if self._signing is not None:
            self._signing.advance(t)
        due: list[bytes] = []
        if t >= self._next_heartbeat - 1e-6:
            self._next_heartbeat = t + 1.0 / self._parameters.heartbeat_rate
            due.append(self.pilot.heartbeat())
        datagrams, ended = self._desk.poll(t, self._status.sys_status, self._status.mode)
        due += datagrams
        self._emit(*ended)
        self._emit_texts(self._texts.poll(t))
        if self._connected:
            due += self._requests_due(t)
        due += self.pilot.poll(t, connected=self._connected, boot_time=self._timesync.boot_time(t))
        return due

    def _requests_due(self, t: float) -> list[bytes]:
        due: list[bytes] = []
        stamp = self._timesync.request(t)
        if stamp is not None:
            due.append(self._encoder.timesync_request(stamp))
        ask, short = self._rates.poll(t)
        due += [self._encoder.message_interval(need.message_id, 1.0 / need.rate) for need in ask]
        self._emit(*short)
        if self._identity.request_due(t):
            due.append(self._encoder.request_message(incoming.AUTOPILOT_VERSION))
        names, answers = self._parameter_cache.poll(t)
        due += [self._encoder.read_parameter(name) for name in names]
        self._emit(*answers)
        return due

    def setpoint(self, setpoint: AnySetpoint, t: float) -> bytes:
        """Give the datagram of one setpoint: sticks, or LOCAL_NED with position (where given), velocity and so on.

        Raises:
            ValueError: a number is not finite, or a stick beyond its end.
        """
        if isinstance(setpoint, SticksSetpoint):
            return self._encoder.sticks(setpoint)
        if isinstance(setpoint, AttitudeThrust):
            return self._encoder.attitude_thrust(setpoint, int(self._timesync.boot_time(t) * 1e3))
        return self._encoder.setpoint(setpoint, int(self._timesync.boot_time(t) * 1e3))

    def landing_target(self, target: LandingTarget) -> list[bytes]:
        """Give the datagram of a landing target, stamped with the autopilot's time at capture; see `PilotLink`.

        Raises:
            ValueError: a number is not finite.
        """
        return self.pilot.landing_target(target, self._timesync.boot_time(target.t)) if self._connected else []

    # ---- facts

    def take_ownship(self) -> list[OwnshipState]:
        """Give the states that have come since the last call, in order of time."""
        states, self._states = self._states, []
        return states

    def events(self) -> list[LinkEvent]:
        """Give what has happened since the last call, in order."""
        events, self._events = self._events, []
        return events

    def status(self, t: float) -> VehicleStatus:
        """Give the vehicle's mode and health at `t` [s]."""
        return self._status.at(t)

    def health(self) -> Health:
        """Give the newest of what the autopilot says of its sensors and its estimator."""
        return self._status.health_reported()

    def statistics(self) -> LinkStatistics:
        """Give what has been counted since the start."""
        return LinkStatistics(
            datagrams=self._datagrams,
            frames=self._reader.frames,
            lost=self._reader.lost,
            bad_bytes=self._reader.bad_bytes,
            foreign=self._reader.foreign,
            foreign_sources=dict(self._reader.foreign_sources),
            unbelieved=self._reader.unbelieved,
            signing=None if self._signing is None else self._signing.statistics(),
            odometry_invalid=self._ownship.invalid,
            odometry_stale=self._ownship.stale,
            undecodable=self._undecodable,
            rates=self._rates.measured(),
            timesync=self._timesync.statistics(),
        )

    @property
    def identified(self) -> AutopilotIdentified | None:
        """The autopilot's software, once it has said it."""
        return self._identity.software

    # ---- commands

    def request_mode(self, mode: FlightMode, t: float) -> None:
        """Ask for a flight mode; ends with a CommandFinished.

        Raises:
            ValueError: the companion never asks for this mode.
        """
        self._desk.request_mode(mode, t, obstacle=self._obstacle(t))

    def arm(self, t: float) -> None:
        """Ask to arm; ends with a CommandFinished, and an ArmingRefused where the autopilot says no."""
        self._desk.arm(True, t, obstacle=self._obstacle(t))

    def disarm(self, t: float) -> None:
        """Ask to disarm, never forced; ends with a CommandFinished."""
        self._desk.arm(False, t, obstacle=self._obstacle(t))

    def cancel_commands(self, reason: str) -> None:
        """Give up every command that is under way: none of them is sent again."""
        self._desk.cancel_all(reason)

    def request_parameter(self, name: str) -> None:
        """Ask for a parameter; ends with a ParameterRead. A value that is known is given again.

        Raises:
            ValueError: not the name of a parameter.
        """
        self._parameter_cache.request(name)

    def parameter(self, name: str) -> float | None:
        """Give a parameter that has been read, or None."""
        return self._parameter_cache.value(name)

    @property
    def operator(self) -> OperatorCommands:
        """Orders of the operator by MAVLink."""
        return self._operator

    def _obstacle(self, t: float) -> str | None:
        """Say why no command can be sent, or None."""
        if self._identity.obstacle is not None:
            return self._identity.obstacle
        return None if self._status.connected(t) else "no vehicle is connected"

    # ---- handlers

    def _on_heartbeat(self, payload: bytes, t: float) -> None:
        heartbeat = incoming.heartbeat(payload)
        wrong = self._identity.heartbeat(heartbeat, t)
        if wrong is not None:
            self._emit(wrong)
        previous = self._status.mode
        self._status.heartbeat(heartbeat, t)
        if not self._connected:
            self._connected = True
            self._rates.restart()
            self._identity.connected(t)
            name = vehicle_type_name(heartbeat.vehicle_type)
            self._emit(Connected(t=t, system=self._parameters.system_id, vehicle_type=name))
        self._desk.observe_armed(heartbeat.armed)
        self._mode_seen(previous, t)

    def _on_current_mode(self, payload: bytes, t: float) -> None:
        previous = self._status.mode
        self._status.current_mode(incoming.current_mode(payload), t)
        self._mode_seen(previous, t)

    def _mode_seen(self, previous: FlightMode, t: float) -> None:
        mode = self._status.mode
        commanded = self._desk.observe_mode(mode, previous)
        if mode != previous:
            self._emit(ModeChanged(t=t, mode=mode, previous=previous, commanded=commanded))

    def _on_ack(self, payload: bytes, t: float) -> None:
        ack = incoming.command_ack(payload)
        ours = (self._parameters.system_id, self._parameters.own_component_id)
        if (ack.target_system, ack.target_component) in (ours, (0, 0)):
            self._desk.acknowledge(ack, t)

    def _on_timesync(self, payload: bytes, t: float) -> None:
        answer = incoming.timesync(payload)
        # Requests (tc1 = 0) are not answered: an answer at the next tick is too slow for PX4, which then complains.
        if answer.tc1 != 0:
            self._timesync.answer(tc1=answer.tc1, ts1=answer.ts1, t=t)

    def _on_version(self, payload: bytes, t: float) -> None:
        self._emit(self._identity.version(incoming.autopilot_version(payload), t))

    def _on_event(self, payload: bytes, t: float) -> None:
        event = incoming.event(payload)
        self._refusals.take_event(event)
        self._status.event(event.id, t)

    def _on_text(self, payload: bytes, t: float) -> None:
        self._emit_texts(self._texts.take(incoming.status_text(payload), t))

    def _on_odometry(self, payload: bytes, t: float) -> None:
        odometry = incoming.odometry(payload)
        if self._ownship.restarted(odometry):
            self._restart(t)
        state = self._ownship.take(odometry, self._stamp(odometry.time_usec * 1e-6, t))
        if state is None:
            return
        if self._reset_counter is not None and state.reset_counter != self._reset_counter:
            self._emit(EstimatorReset(t=t, before=self._reset_counter, after=state.reset_counter))
        self._reset_counter = state.reset_counter
        self._status.odometry(t)
        self._states.append(state)
        del self._states[:-_QUEUE]

    def _stamp(self, boot: float, t_arrival: float) -> float:
        mapped = self._timesync.map(boot, t_arrival)
        return mapped if t_arrival - mapped <= _STAMP_NONSENSE else t_arrival

    def _restart(self, t: float) -> None:
        self._ownship.forget()
        self._timesync.forget()
        self._status.restarted()
        self._rates.restart()
        self._parameter_cache.forget()
        self._desk.cancel_all("the autopilot has restarted")
        self._emit(AutopilotRestarted(t=t))

    def _watch_connection(self, t: float) -> None:
        if self._connected and not self._status.connected(t):
            self._connected = False
            self._parameter_cache.forget()
            self._desk.cancel_all("the vehicle is lost")
            self._emit(Lost(t=t, silence=self._status.silence(t)))

    def _emit_texts(self, texts: list[StatusText]) -> None:
        for text in texts:
            self._refusals.take_text(text.text)
        self._emit(*texts)

    def _emit(self, *events: LinkEvent) -> None:
        self._events += events
        del self._events[:-_QUEUE]
