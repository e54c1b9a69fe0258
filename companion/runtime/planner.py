"""The planner's side: from telemetry and observations to what is handed to the guardian.

It cannot send anything to the autopilot. In flight it runs in a process of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from companion.estimation.coarse_pad import CoarsePad
from companion.estimation.ground_odometry import Odometry
from companion.geometry.transform import RigidTransform
from companion.guardian.handover import Handover, Order
from companion.guidance.policy import Policy
from companion.guidance.view import View
from companion.link.remarks import remark
from companion.messages.coarse import CoarseTarget
from companion.messages.decision import Decision
from companion.messages.guardian import GuardianOutput, GuardianState
from companion.messages.motion import AnySetpoint, SticksSetpoint, Trajectory
from companion.messages.news import MissionNews
from companion.messages.ownship import FlightMode, OwnshipState, VehicleStatus
from companion.messages.perception import CameraFrame, PadObservation
from companion.messages.proximity import RangeReading
from companion.messages.target import MeasurementVerdict, TargetPose
from companion.messages.thrust import AttitudeThrust
from companion.planning.coupled.plan import CoupledPlan
from companion.planning.coupled.trajectory import RoverTrajectory
from companion.recording.recorder import Recorder
from companion.recording.serialise import to_record
from companion.runtime.conductor import Conductor
from companion.runtime.landing_targets import LandingTargets
from companion.runtime.mission_announcer import MissionAnnouncer, MissionGlance
from companion.runtime.pilot import Pilot
from companion.runtime.ports import DetectionRequest, MissionState, MissionStatus
from companion.runtime.telemetry import Telemetry
from companion.runtime.tracking import NOTHING_SEEN, Fusion, Picture, Tracking

TICK_S = 0.02  # [s] between steps: the guardian's rate is 50 Hz
_FRESH_S = 0.3  # [s] odometry older than this does not count as arriving
_RANGES_FRESH_S = 1.0  # [s] ranges that stop for longer keep a mission that needs them on the ground
_FLYING = frozenset({GuardianState.FOLLOWING, GuardianState.HOLDING, GuardianState.BLIND, GuardianState.GAP})
_GIVEN_UP = frozenset({GuardianState.MUTED, GuardianState.HANDOVER, GuardianState.LEAVING})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """What the last step knew and decided, for displays and measurements."""

    t: float
    ownship: OwnshipState | None
    vehicle: VehicleStatus
    picture: Picture
    decision: Decision | None
    guardian: GuardianOutput
    coarse: CoarseTarget | None = None  # where the pad should be without the camera
    remarks: tuple[str, ...] = ()  # what the link has to tell of this step


class Planner:
    """Holds the parts; `step` runs them in the order in which data flow."""

    def __init__(
        self,
        *,
        odometry: Odometry,
        tracking: Tracking,
        guidance: Policy,
        piloting: Pilot,
        conductor: Conductor,
        announcer: MissionAnnouncer,
        landing_targets: LandingTargets | None,
        recorder: Recorder,
        gear_height: float,
        coarse: CoarsePad | None = None,
    ) -> None:
        self._odometry = odometry
        self._tracking = tracking
        self._guidance = guidance
        self._piloting = piloting
        self._conductor = conductor
        self._announcer = announcer
        self._landing_targets = landing_targets
        self._recorder = recorder
        self._kept_plan: CoupledPlan | None = None
        self._gear_height = gear_height
        self._coarse = coarse
        self._coarse_target: CoarseTarget | None = None
        self._t_range = -math.inf  # [s] of the newest range
        self._t: float | None = None
        self._decision: Decision | None = None
        self._picture = NOTHING_SEEN
        self._fusions: list[Fusion] = []
        self._target: TargetPose | None = None
        self.snapshot: Snapshot | None = None

    @property
    def mission(self) -> MissionStatus:
        """How the mission stands."""
        return self._conductor.status

    def stop(self, t: float, reason: str = "stopped by the operator") -> None:
        """End the mission."""
        self._conductor.stop(t, reason)

    def detection_request(self, frame: CameraFrame) -> DetectionRequest:
        """Give the search to be made in a frame that has just arrived."""
        return DetectionRequest(frame=frame, predicted=self._expected(frame.t))

    def _expected(self, t: float) -> RigidTransform | None:
        return self._tracking.expected_pad(t)

    def step(
        self, telemetry: Telemetry, observations: Sequence[PadObservation], ranges: Sequence[RangeReading] = ()
    ) -> Handover:
        """Run one step; `conclude` it when what became of it is known.

        Args:
            telemetry: facts of the guardian's side; its time increases from step to step.
            observations: answers to detection requests since the last step.
            ranges: to the anchors, since the last step.
        """
        t, vehicle = telemetry.t, telemetry.vehicle
        dt = TICK_S if self._t is None else t - self._t
        self._t = t
        for t_arrival, datagram in telemetry.datagrams:
            self._recorder.record_bytes("mavlink_in", t_arrival, datagram)
        standing = _is_standing(telemetry)
        for state in telemetry.states:
            landmark = self._piloting.landmark(state)
            taken = self._odometry.take(state, standing=standing, landmark=landmark)
            self._follow_ownship(taken, vehicle)
        self._fusions = self._tracking.fuse(observations)
        ownship = self._tracking.history.at(t)
        self._estimate_coarsely(ranges, ownship)
        picture = self._picture = self._tracking.look(t)
        orders = self._conduct(telemetry)
        trajectory = self._guide(telemetry, dt, ownship, picture, vehicle)
        self._target = None
        if picture.prediction is not None:  # for the guardian, which goes by the autopilot's odometry
            target = picture.prediction.at(t)
            self._target = replace(
                target,
                position_ned=self._odometry.point_told(target.position_ned),
                velocity_ned=self._odometry.vector_told(target.velocity_ned),
            )
        mission = self.mission
        return Handover(
            t=t,
            stage=mission.stage,
            reason=mission.reason,
            trajectory=trajectory,
            target=self._target,
            orders=frozenset(orders),
            receiver=self._receiver(),
            news=self._report(t),
        )

    def _receiver(self) -> FlightMode:
        """Give who is to fly after this program: Hold, or where the mission asks for it Return or the landing."""
        if self._guidance.wants_precision_landing:
            return FlightMode.AUTO_PRECLAND
        return FlightMode.AUTO_RTL if self._guidance.wants_return else FlightMode.AUTO_LOITER

    def _report(self, t: float) -> MissionNews:
        """Give what the guardian's side is to pass on."""
        landing_target = None
        if self._landing_targets is not None:
            landing_target = self._landing_targets.newest(self._fusions, self._tracking)
            if landing_target is not None:
                self._keep("landing_target", t, landing_target)
        glance = MissionGlance(
            t=t,
            mission=self.mission,
            decision=self._decision,
            track=self._picture.track,
            intercept=self._picture.intercept,
            t_frame=self._tracking.t_frame,
            coarse=self._coarse_target,
        )
        return self._announcer.report(glance, landing_target)

    def conclude(self, telemetry: Telemetry, output: GuardianOutput | None, sent: Sequence[bytes]) -> None:
        """Record the step.

        Args:
            telemetry: of the step.
            output: of the guardian, the newest known; None: there is none yet.
            sent: datagrams, since the last step, to the autopilot.
        """
        if output is None:
            return
        self.snapshot = Snapshot(
            t=telemetry.t,
            ownship=self._tracking.history.newest,
            vehicle=telemetry.vehicle,
            picture=self._picture,
            decision=self._decision,
            guardian=output,
            coarse=self._coarse_target,
            remarks=tuple(text for event in telemetry.events if (text := remark(event)) is not None),
        )
        self._record(self.snapshot, sent)

    def _estimate_coarsely(self, ranges: Sequence[RangeReading], ownship: OwnshipState | None) -> None:
        """Take what says where the pad is without the camera, and what the camera has said."""
        for reading in ranges:
            self._keep("range", reading.t, reading)
            self._t_range = max(self._t_range, reading.t)
        if self._coarse is None:
            return
        self._coarse.add_ranges(ranges)
        for fusion in self._fusions:
            then = None if fusion.measurement is None else self._tracking.history.at(fusion.measurement.t)
            if fusion.measurement is not None and then is not None and fusion.verdict is MeasurementVerdict.FUSED:
                self._coarse.add_sighting(fusion.measurement, then)
        self._coarse_target = None if ownship is None else self._coarse.at(ownship)

    def _missing_ranges(self, t: float, vehicle: VehicleStatus) -> str:
        """Say what stands against taking off for a mission that flies by ranges; empty where nothing does."""
        needed = self._coarse is not None and self._coarse.by_ranges and not vehicle.armed
        if not needed or t - self._t_range < _RANGES_FRESH_S:
            return ""
        return "no ranges come, and the mission flies by them; check radio and anchors (companion doctor)"

    def _follow_ownship(self, state: OwnshipState, vehicle: VehicleStatus) -> None:
        before = self._tracking.history.newest
        reset = self._tracking.add_ownship(state)
        if self._coarse is not None and vehicle.connected and self._tracking.history.newest is state:
            self._coarse.add_ownship(state, reset, standing=not vehicle.armed)
        self._piloting.add_ownship(state)
        if reset is not None and before is not None:
            self._guidance.rebase(state.position_ned - before.position_ned, reset.yaw, before.position_ned)
            self._piloting.rebase(reset)

    def _conduct(self, telemetry: Telemetry) -> list[Order]:
        newest, before = self._tracking.history.newest, self.mission.state
        orders = self._conductor.update(
            t=telemetry.t,
            vehicle=telemetry.vehicle,
            telemetry_fresh=newest is not None and telemetry.t - newest.t < _FRESH_S,
            events=telemetry.events,
            decision=self._decision,
            muted=telemetry.state is GuardianState.MUTED,
            taken_over=telemetry.taken_over,
            guardian=telemetry.guardian_reason,
            heard=telemetry.heard,
            operator=telemetry.orders,
            missing=self._missing_ranges(telemetry.t, telemetry.vehicle),
        )
        if before is MissionState.STANDBY and self.mission.state is MissionState.RUNNING:
            self._guidance.restart()
            self._decision = None
        return orders

    def _guide(
        self, telemetry: Telemetry, dt: float, ownship: OwnshipState | None, picture: Picture, vehicle: VehicleStatus
    ) -> Trajectory | None:
        t = telemetry.t
        if ownship is None or self.mission.ended or self.mission.state is MissionState.STANDBY:
            self._piloting.clear()
            return None
        view = View(
            t=t,
            ownship=ownship,
            status=vehicle,
            commanding=telemetry.state in _FLYING,
            taken_over=telemetry.state in _GIVEN_UP,
            guardian_reason=telemetry.guardian_reason,
            at_fence=telemetry.output is not None and "fence" in telemetry.output.clips,
            track=picture.track,
            prediction=picture.prediction,
            intercept=picture.intercept,
            t_frame=self._tracking.t_frame,
            gear_height=self._gear_height,
            velocity_bias_ned=self._piloting.velocity_bias_ned,
            relative_velocity_ned=(
                None if picture.sighted_ned is None else self._piloting.relative_velocity_ned(ownship)
            ),
            lean_ned=self._piloting.lean_ned - picture.slope_ned,
            planned_speed=self._planned_speed(t),
            coarse=self._coarse_target,
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
            picture=picture,
        )

    def _planned_speed(self, t: float) -> float:
        plan = self._piloting.plan
        return math.inf if plan is None else math.hypot(*plan.at(t).velocity_ned[:2].tolist())

    def _record(self, snapshot: Snapshot, sent: Sequence[bytes]) -> None:
        t = snapshot.t
        for datagram in sent:
            self._recorder.record_bytes("mavlink_out", t, datagram)
        for fusion in self._fusions:
            self._keep("observation", t, fusion.observation)
            if fusion.measurement is not None:
                self._keep("measurement", t, fusion.measurement)
        if snapshot.ownship is not None:
            self._keep("ownship", t, snapshot.ownship)
        if snapshot.picture.track is not None:
            self._keep("track", t, snapshot.picture.track)
        if snapshot.coarse is not None:
            self._keep("coarse", t, snapshot.coarse)
        if snapshot.picture.intercept is not None:
            self._keep("intercept", t, snapshot.picture.intercept)
        if self._target is not None:
            self._keep("target", t, self._target)
        if snapshot.decision is not None:
            self._keep("decision", t, snapshot.decision)
        plan = self._piloting.plan
        if isinstance(plan, RoverTrajectory) and plan.plan is not self._kept_plan:
            self._kept_plan = plan.plan
            self._keep("plan", t, plan)
        setpoint = snapshot.guardian.setpoint
        if setpoint is not None:
            self._keep(_channel_of(setpoint), t, setpoint)

    def _keep(self, channel: str, t: float, message: object) -> None:
        self._recorder.record(channel, t, to_record(message))


def _channel_of(setpoint: AnySetpoint) -> str:
    if isinstance(setpoint, SticksSetpoint):
        return "sticks"
    return "thrust" if isinstance(setpoint, AttitudeThrust) else "setpoint"


def _is_standing(telemetry: Telemetry) -> bool:
    """Say whether a rover is told to stand, or cannot do anything else."""
    output = telemetry.output
    if not telemetry.vehicle.armed:
        return True
    return output is not None and isinstance(output.setpoint, SticksSetpoint) and output.setpoint.speed == 0.0
