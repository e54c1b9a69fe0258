"""The ground part of a mission: wait for the vehicle, engage, arm, and finish."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

from companion.config.sections import EngagementSection
from companion.link import events as link_events
from companion.messages.decision import Decision, Mode, Switch
from companion.messages.ownship import FlightMode, VehicleStatus
from companion.preflight.autopilot_parameters import ParameterGate, WantedParameters
from companion.runtime.ports import MissionState, MissionStatus

_ENGAGE_AGAIN_S = 0.5  # an obstacle may have passed by then, such as a late odometry message


class Order(Enum):
    """What the conductor asks for in one step."""

    READ_PARAMETERS = "read the autopilot's parameters"
    ENGAGE = "engage the guardian"
    ARM = "arm"
    FINISH = "leave OFFBOARD and stop"


class Conductor:
    """Holds the mission's state between steps.

    Args:
        parameters: patience.
        wanted: what the autopilot's parameters must be; otherwise the mission is refused before it begins.
    """

    def __init__(self, parameters: EngagementSection, wanted: WantedParameters) -> None:
        self._p = parameters
        self._gate = ParameterGate(wanted)
        self._asked = False  # for the autopilot's parameters
        self._ready_since: float | None = None
        self._t_first: float | None = None
        self._t_connected: float | None = None
        self._t_engaged: float | None = None
        self._t_engage_try = self._t_armed_try = -1e9
        self._tries = 0
        self._followed: Switch | None = None
        self._refusals: list[str] = []
        self.status = MissionStatus(
            state=MissionState.WAITING, mode=Mode.PREFLIGHT, reason="waiting for the vehicle", t=0.0
        )

    def stop(self, t: float) -> None:
        """End the mission at the operator's wish."""
        if not self.status.ended:
            self._set(t, MissionState.ABORTED, self.status.mode, "stopped by the operator")

    def _set(self, t: float, state: MissionState, mode: Mode, reason: str) -> None:
        self.status = MissionStatus(state=state, mode=mode, reason=reason, t=t)

    def update(
        self,
        *,
        t: float,
        vehicle: VehicleStatus,
        telemetry_fresh: bool,
        events: Sequence[link_events.LinkEvent],
        decision: Decision | None,
        idle: bool,
        guardian: str,
        heard: Callable[[], str],
    ) -> list[Order]:
        """Give the orders of this step.

        Args:
            t: now [s].
            vehicle: mode and health.
            telemetry_fresh: odometry is arriving.
            events: from the link, since the last step.
            decision: the newest of the guidance; one that is older than a step is not followed again.
            idle: the guardian has not begun to stream, although nobody has taken the vehicle: it found an obstacle.
            guardian: why it is in its state, in plain words.
            heard: says what the link has heard instead of the vehicle, empty where nothing.
        """
        if self._t_first is None:
            self._t_first = t
        if vehicle.connected and self._t_connected is None:
            self._t_connected = t
        if self.status.ended:
            return []
        running = self.status.state is MissionState.RUNNING
        if self._ended_by(t, vehicle, events):
            return [Order.FINISH] if running else []
        if not running:
            return [*self._read_parameters(vehicle), *self._wait(t, vehicle, telemetry_fresh, heard)]
        if decision is not None and self._follow(t, decision):
            return [Order.FINISH]
        if decision is not None and decision.mode is Mode.PREFLIGHT:
            return self._arm(t, vehicle, guardian, idle)
        return []

    def _ended_by(self, t: float, vehicle: VehicleStatus, events: Sequence[link_events.LinkEvent]) -> bool:
        for event in events:
            self._note(t, event)
        if self.status.state is MissionState.RUNNING and not vehicle.connected:
            self._set(t, MissionState.LOST, self.status.mode, "the vehicle is lost: its heartbeat has stopped")
        return self.status.ended

    def _note(self, t: float, event: link_events.LinkEvent) -> None:
        if isinstance(event, link_events.ArmingRefused):
            self._refusals.extend(reason for reason in event.reasons if reason not in self._refusals)
            if self._tries >= self._p.arm_tries and not self.status.ended:
                self._refuse(t, f"the autopilot refused to arm {self._tries} times")
        if isinstance(event, link_events.ParameterRead):
            self._gate.take(event.name, event.value)
        if isinstance(event, link_events.Connected | link_events.AutopilotRestarted):
            self._gate.forget()
            self._asked = False
        if isinstance(event, link_events.WrongVehicle) and not self.status.ended:
            text = f"the vehicle is a {event.type_name} flown by {event.autopilot}; {event.wanted}"
            self._set(t, MissionState.WRONG_VEHICLE, self.status.mode, text)

    def _refuse(self, t: float, what: str) -> None:
        reasons = "; ".join(self._refusals) or "it gave no reason"
        self._set(t, MissionState.REFUSED, Mode.PREFLIGHT, f"{what}: {reasons}")

    def _read_parameters(self, vehicle: VehicleStatus) -> list[Order]:
        if self._asked or not vehicle.connected:
            return []
        self._asked = True
        return [Order.READ_PARAMETERS]

    def _wait(self, t: float, vehicle: VehicleStatus, telemetry_fresh: bool, heard: Callable[[], str]) -> list[Order]:
        ready = vehicle.connected and telemetry_fresh and vehicle.estimate_valid
        if not ready:
            self._ready_since = None
            self._lose_patience(t, telemetry_fresh, heard)
            return []
        if vehicle.armed:
            self._set(
                t,
                MissionState.REFUSED,
                Mode.PREFLIGHT,
                "the vehicle is already armed: a mission begins on the ground, disarmed",
            )
            return []
        if self._ready_since is None:
            self._ready_since = t
        if t - self._ready_since < self._p.ready_s or not self._gate.complete:
            return []
        objections = self._gate.objections()
        if objections:
            advice = "set them with the ground station, or accept them in preflight.autopilot of the configuration"
            text = f"the autopilot's parameters are not safe: {'; '.join(objections)}: {advice}"
            self._set(t, MissionState.REFUSED, Mode.PREFLIGHT, text)
            return []
        self._t_engaged = self._t_engage_try = t
        self._set(t, MissionState.RUNNING, Mode.PREFLIGHT, "telemetry is good: engaging")
        return [Order.ENGAGE]

    def _lose_patience(self, t: float, telemetry_fresh: bool, heard: Callable[[], str]) -> None:
        if self._t_connected is not None:
            if t - self._t_connected > self._p.ready_timeout_s:
                missing = "no odometry arrives" if not telemetry_fresh else "its position estimate is not valid"
                self._set(t, MissionState.REFUSED, Mode.PREFLIGHT, f"the autopilot is not ready to fly: {missing}")
        elif self._t_first is not None and t - self._t_first > self._p.vehicle_timeout_s:
            found = heard() or "nothing at all was heard; check the autopilot's power and where its MAVLink goes"
            text = f"no vehicle: no heartbeat within {self._p.vehicle_timeout_s:g} s; {found}"
            self._set(t, MissionState.NO_VEHICLE, Mode.PREFLIGHT, text)

    def _arm(self, t: float, vehicle: VehicleStatus, guardian: str, idle: bool) -> list[Order]:
        if vehicle.mode is not FlightMode.OFFBOARD:
            if self._t_engaged is not None and t - self._t_engaged > self._p.offboard_timeout_s:
                said = f" (guardian: {guardian})" if guardian else ""
                self._refuse(t, f"the autopilot did not enter OFFBOARD{said}")
                return [Order.FINISH]
            if idle and t - self._t_engage_try >= _ENGAGE_AGAIN_S:
                self._t_engage_try = t
                return [Order.ENGAGE]
            return []
        if vehicle.armed or t - self._t_armed_try < self._p.arm_interval_s:
            return []
        if self._tries >= self._p.arm_tries:
            self._refuse(t, f"the autopilot did not arm in {self._tries} tries")
            return [Order.FINISH]
        self._tries += 1
        self._t_armed_try = t
        return [Order.ARM]

    def _follow(self, t: float, decision: Decision) -> bool:
        if decision.switched is None or decision.switched is self._followed:
            return False
        self._followed = decision.switched
        state = MissionState.RUNNING
        if decision.mode is Mode.DONE:
            on_ground = self.status.mode in (Mode.TOUCHDOWN, Mode.AUTOPILOT_LAND)
            state = MissionState.LANDED if on_ground else MissionState.HELD
        elif decision.mode is Mode.ABORT:
            state = MissionState.ABORTED
        self._set(t, state, decision.mode, decision.switched.reason)
        return self.status.ended or decision.mode is Mode.AUTOPILOT_LAND
