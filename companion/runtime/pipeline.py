"""The heart: one synchronous step from bytes and observations to bytes.

It reads no clock, opens no socket and rolls no dice. `flight` drives it in real time, `lockstep` in virtual time.
"""

from __future__ import annotations

from dataclasses import dataclass

from companion.geometry.transform import RigidTransform
from companion.guardian.guardian import Guardian
from companion.guidance.machine import Guidance
from companion.guidance.view import View
from companion.link.autopilot_link import AutopilotLink
from companion.link.events import Connected, LinkEvent
from companion.link.remarks import remark
from companion.messages.decision import Decision
from companion.messages.guardian import GuardianOutput, GuardianState, ModeRequest
from companion.messages.motion import Trajectory
from companion.messages.ownship import FlightMode, OwnshipState, VehicleStatus
from companion.messages.perception import CameraFrame
from companion.messages.target import TargetPose
from companion.preflight.autopilot_parameters import PARAMETER_NAMES
from companion.recording.recorder import Recorder
from companion.recording.serialise import to_record
from companion.runtime.announcer import NEAR_GROUND_PARAMETER, Announcer, Glance
from companion.runtime.conductor import Conductor, Order
from companion.runtime.landing_targets import LandingTargets
from companion.runtime.piloting import Piloting
from companion.runtime.ports import DetectionRequest, Inbox, MissionStatus, Outbox
from companion.runtime.tracking import Fusion, Picture, Tracking

TICK_S = 0.02  # [s] between steps: the guardian's rate is 50 Hz
_FRESH_S = 0.3  # [s] odometry older than this does not count as arriving
_FLYING = frozenset({GuardianState.FOLLOWING, GuardianState.HOLDING, GuardianState.BLIND, GuardianState.GAP})
_GIVEN_UP = frozenset({GuardianState.MUTED, GuardianState.HANDOVER, GuardianState.LEAVING})
_PRECLAND_TRIES = 2  # times that the precision landing is asked for; then Hold
_MODES = {ModeRequest.OFFBOARD: FlightMode.OFFBOARD, ModeRequest.HOLD: FlightMode.AUTO_LOITER}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """What the last step knew and decided, for displays and measurements."""

    t: float
    ownship: OwnshipState | None
    vehicle: VehicleStatus
    picture: Picture
    decision: Decision | None
    guardian: GuardianOutput
    remarks: tuple[str, ...] = ()  # what the link has to tell of this step


class Pipeline:
    """Holds the parts; `step` runs them in the order in which data flow."""

    def __init__(
        self,
        *,
        link: AutopilotLink,
        tracking: Tracking,
        guidance: Guidance,
        piloting: Piloting,
        guardian: Guardian,
        conductor: Conductor,
        announcer: Announcer,
        landing_targets: LandingTargets | None,
        recorder: Recorder,
        gear_height: float,
    ) -> None:
        self._link = link
        self._tracking = tracking
        self._guidance = guidance
        self._piloting = piloting
        self._guardian = guardian
        self._conductor = conductor
        self._announcer = announcer
        self._landing_targets = landing_targets
        self._precland_asked = 0
        self._recorder = recorder
        self._gear_height = gear_height
        self._t: float | None = None
        self._decision: Decision | None = None
        self._remarks: tuple[str, ...] = ()
        self.snapshot: Snapshot | None = None

    @property
    def mission(self) -> MissionStatus:
        """How the mission stands."""
        return self._conductor.status

    @property
    def quiet(self) -> bool:
        """Whether the mission has ended and nothing more will be sent but heartbeats."""
        return self.mission.ended and self._guardian.state is GuardianState.MUTED

    def recognises(self, datagram: bytes) -> bool:
        """Tell whether a datagram comes from the configured vehicle."""
        return self._link.recognises(datagram)

    def stop(self, t: float) -> None:
        """End the mission at the operator's wish: the vehicle is handed to the autopilot's Hold."""
        self._conductor.stop(t)
        self._guardian.disengage(t)

    def detection_request(self, frame: CameraFrame) -> DetectionRequest:
        """Give the search to be made in a frame that has just arrived."""
        return DetectionRequest(frame=frame, predicted=self._expected(frame.t))

    def _expected(self, t: float) -> RigidTransform | None:
        return self._tracking.expected_pad(t)

    def step(self, t: float, inbox: Inbox) -> Outbox:
        """Run one step.

        Args:
            t: now [s], companion clock; it increases from step to step.
            inbox: what arrived since the last step.
        """
        dt = TICK_S if self._t is None else t - self._t
        self._t = t
        for t_arrival, datagram in inbox.datagrams:
            self._recorder.record_bytes("mavlink_in", t_arrival, datagram)
            self._link.receive(datagram, t_arrival)
        for state in self._link.take_ownship():
            self._follow_ownship(state)
        fusions = self._tracking.fuse(inbox.observations)
        vehicle = self._link.status(t)
        newest = self._tracking.history.newest
        ownship = self._tracking.history.at(t)
        picture = self._tracking.look(t)
        events = self._link.events()
        self._conduct(t, vehicle, newest, events)
        trajectory = self._guide(t, dt, vehicle, ownship, picture)
        target = picture.prediction.at(t) if picture.prediction is not None else None
        output = self._guardian.tick(t, newest, vehicle, trajectory, target)
        self._announce(t, vehicle, picture, output, events)
        datagrams = self._send(t, output, fusions)
        self.snapshot = Snapshot(
            t=t,
            ownship=newest,
            vehicle=vehicle,
            picture=picture,
            decision=self._decision,
            guardian=output,
            remarks=self._remarks,
        )
        self._record(fusions, newest, target, datagrams)
        return Outbox(datagrams=datagrams, ground=self._link.pilot.take_ground())

    def _follow_ownship(self, state: OwnshipState) -> None:
        before = self._tracking.history.newest
        reset = self._tracking.add_ownship(state)
        self._piloting.add_ownship(state)
        if reset is not None and before is not None:
            self._guidance.rebase(state.position_ned - before.position_ned, reset.yaw, before.position_ned)
            self._piloting.rebase(reset)

    def _conduct(self, t: float, vehicle: VehicleStatus, newest: OwnshipState | None, events: list[LinkEvent]) -> None:
        self._remarks = tuple(text for event in events if (text := remark(event)) is not None)
        orders = self._conductor.update(
            t=t,
            vehicle=vehicle,
            telemetry_fresh=newest is not None and t - newest.t < _FRESH_S,
            events=events,
            decision=self._decision,
            idle=self._guardian.state is GuardianState.MUTED and not self._guardian.taken_over,
            guardian="" if self.snapshot is None else self.snapshot.guardian.reason,
            heard=lambda: self._link.statistics().heard_instead,
        )
        for order in orders:
            if order is Order.READ_PARAMETERS:
                for name in PARAMETER_NAMES:
                    self._link.request_parameter(name)
            elif order is Order.ENGAGE:
                self._guardian.engage(t)
            elif order is Order.ARM:
                self._link.arm(t)
            elif vehicle.armed:
                self._guardian.disengage(t)
            else:
                self._guardian.finish(t)

    def _guide(
        self, t: float, dt: float, vehicle: VehicleStatus, ownship: OwnshipState | None, picture: Picture
    ) -> Trajectory | None:
        if ownship is None or self.mission.ended:
            self._piloting.clear()
            return None
        view = View(
            t=t,
            ownship=ownship,
            status=vehicle,
            commanding=self._guardian.state in _FLYING,
            taken_over=self._guardian.state in _GIVEN_UP,
            guardian_reason="" if self.snapshot is None else self.snapshot.guardian.reason,
            track=picture.track,
            prediction=picture.prediction,
            intercept=picture.intercept,
            t_frame=self._tracking.t_frame,
            gear_height=self._gear_height,
            velocity_bias_ned=self._piloting.velocity_bias_ned,
            approach_ned=self._piloting.approach_ned(ownship) if picture.sighted_ned is not None else None,
            lean_ned=self._piloting.lean_ned,
        )
        self._decision = self._guidance.update(view)
        goal = self._guidance.goal(view, dt)
        if goal is None:
            self._piloting.clear()
            return None
        return self._piloting.update(
            t=t,
            dt=dt,
            goal=goal,
            switched=self._decision.switched is not None,
            ownship=ownship,
            prediction=picture.prediction,
            sighted_ned=picture.sighted_ned,
        )

    def _mode_for(self, request: ModeRequest) -> FlightMode:
        """Translate the guardian's request.

        Hold becomes Return where the mission asks to fly home at the end, and the precision landing where the
        autopilot is to land; if that is not taken up, Hold after all.
        """
        if request is ModeRequest.HOLD and self._guidance.wants_precision_landing:
            self._precland_asked += 1
            return FlightMode.AUTO_PRECLAND if self._precland_asked <= _PRECLAND_TRIES else FlightMode.AUTO_LOITER
        if request is ModeRequest.HOLD and self._guidance.wants_return:
            return FlightMode.AUTO_RTL
        return _MODES[request]

    def _announce(
        self, t: float, vehicle: VehicleStatus, picture: Picture, output: GuardianOutput, events: list[LinkEvent]
    ) -> None:
        """Tell the pilot what is new."""
        if self._landing_targets is not None and any(isinstance(event, Connected) for event in events):
            self._link.request_parameter(NEAR_GROUND_PARAMETER)
        glance = Glance(
            t=t,
            vehicle=vehicle,
            mission=self.mission,
            decision=self._decision,
            guardian=output,
            track=picture.track,
            intercept=picture.intercept,
            t_frame=self._tracking.t_frame,
            events=events,
        )
        pilot = self._link.pilot
        for text in self._announcer.news(glance):
            pilot.say(text)
        pilot.show(self._announcer.values(glance))
        pilot.present(self._announcer.stand(glance), self.mission.mode)

    def _send(self, t: float, output: GuardianOutput, fusions: list[Fusion]) -> list[bytes]:
        if output.request is not None:
            self._link.request_mode(self._mode_for(output.request), t)
        datagrams = self._link.poll(t)
        if self._landing_targets is not None:
            landing_target = self._landing_targets.newest(fusions, self._tracking)
            if landing_target is not None:
                datagrams += self._link.landing_target(landing_target)
                self._keep("landing_target", t, landing_target)
        if output.setpoint is not None:
            datagrams.append(self._link.setpoint(output.setpoint, t))
        return datagrams

    def _record(
        self, fusions: list[Fusion], newest: OwnshipState | None, target: TargetPose | None, datagrams: list[bytes]
    ) -> None:
        snapshot = self.snapshot
        if snapshot is None:
            return
        t = snapshot.t
        for datagram in datagrams:
            self._recorder.record_bytes("mavlink_out", t, datagram)
        for fusion in fusions:
            self._keep("observation", t, fusion.observation)
            if fusion.measurement is not None:
                self._keep("measurement", t, fusion.measurement)
        if newest is not None:
            self._keep("ownship", t, newest)
        if snapshot.picture.track is not None:
            self._keep("track", t, snapshot.picture.track)
        if snapshot.picture.intercept is not None:
            self._keep("intercept", t, snapshot.picture.intercept)
        if target is not None:
            self._keep("target", t, target)
        if snapshot.decision is not None:
            self._keep("decision", t, snapshot.decision)
        if snapshot.guardian.setpoint is not None:
            self._keep("setpoint", t, snapshot.guardian.setpoint)

    def _keep(self, channel: str, t: float, message: object) -> None:
        self._recorder.record(channel, t, to_record(message))
