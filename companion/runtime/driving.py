"""From a goal to the trajectory that the guardian drives: the coupled planner's, anew from where the rover is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.config.driving import DrivingSection
from companion.control.corrected import CorrectedTrajectory
from companion.estimation.bias_observer import BiasObserver
from companion.estimation.ground_odometry import Odometry
from companion.estimation.ownship import OwnshipReset
from companion.estimation.target_rest import TargetRest
from companion.estimation.target_speed import TargetSpeed, crossing_speed
from companion.geometry.angles import wrap_angle
from companion.geometry.arrays import Array
from companion.guidance.goals import Goal
from companion.messages.motion import MotionState, Trajectory
from companion.messages.ownship import OwnshipState
from companion.messages.target import Prediction, TargetTrack
from companion.planning.coupled.model import CostWeights, CoupledRequest, RoverMotion
from companion.planning.coupled.plan import CoupledPlan
from companion.planning.coupled.scp import CoupledPlanner
from companion.planning.coupled.trajectory import RoverTrajectory
from companion.planning.run_up import Motion, RunUp
from companion.planning.shortest.meeting import Meeting, Reach, earliest_meeting
from companion.planning.shortest.path import Pose
from companion.planning.stopping import fastest
from companion.runtime.pilot import DirectTrajectory
from companion.runtime.tracking import Picture

_FRESH_S = 0.3  # [s] an older sighting is no landmark
_UPRIGHT = np.zeros(2)
_STILL = np.zeros(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Start:
    """Where a plan begins."""

    north: float  # [m]
    east: float  # [m]
    yaw: float  # [rad]
    speed: float  # [m/s]
    yaw_rate: float  # [rad/s]


class Driving:
    """Holds the present plan between steps.

    A plan begins with the pose that the rover has, `lead_s` ahead, and with the speed and turn that it has been told:
    its position is fed back by planning anew, its speed by the guardian's inner loop.

    What is planned for is the middle of the rear axle, which moves along the heading also in a turn.

    Args:
        section: how plans are made.
        motion: what the rover can do.
        rear_axle: behind the body origin [m].
        odometry: that the forecast and the rover's own motion are given in.
        reach: foresees where a place that is not near is met; None: each instant of a plan goes by the place as it
            will be then.
    """

    def __init__(
        self,
        section: DrivingSection,
        motion: RoverMotion,
        *,
        rear_axle: float,
        odometry: Odometry,
        reach: Reach | None = None,
    ) -> None:
        self._p = section
        self._motion = motion
        self._rear = rear_axle
        self._odometry = odometry
        self._reach = reach
        self._meeting: Meeting | None = None
        self._planner = CoupledPlanner(motion, section.planner)
        self._relative = BiasObserver(bandwidth=section.bias_bandwidth, bias_max=section.relative_max_mps)
        self._rest = TargetRest(section.target_rest)
        self._speed = TargetSpeed(section.target_speed)
        self._course = _STILL  # the direction of the target's heading, in the frame to go by
        self._run_up = RunUp(section.run_up, motion)
        self._t_sighted = -math.inf
        self._crossing: float | None = None  # [m/s] the target's speed, where it crosses the rover's way in its view
        self._told_velocity = _STILL  # [m/s] the autopilot's, in the frame to go by
        self._rolling = _STILL  # [m/s] of that, what wheels can have done: nothing sideways but in a turn
        self._stuck_since: float | None = None
        self._waiting_since: float | None = None
        self._solution: CoupledPlan | None = None
        self._plan: Trajectory | None = None
        self._t_planned = -math.inf

    @property
    def plan(self) -> Trajectory | None:
        """The present plan without feedback."""
        return self._plan

    @property
    def solution(self) -> CoupledPlan | None:
        """The newest answer of the coupled planner."""
        return self._solution

    @property
    def meeting(self) -> Meeting | None:
        """When the place is met, counted from the newest plan's beginning, its end at the earliest; None: not asked."""
        return self._meeting

    @property
    def velocity_bias_ned(self) -> Array:
        """Of the velocity that it goes by (3,) [m/s]: none."""
        return _STILL

    def relative_velocity_ned(self, ownship: OwnshipState) -> Array | None:  # noqa: ARG002  # the interface's
        """Give the velocity relative to the target as the sightings show it (3,) [m/s], None before it is known."""
        if not self._relative.settled:
            return None
        return self._rolling - self._relative.bias_ned

    def landmark(self, state: OwnshipState) -> Array | None:
        """Give the velocity by the sight of a target that stands, or drives at a known speed; see `Pilot.landmark`."""
        self._told_velocity = self._odometry.turned(state.velocity_ned)
        north, east, _ = self._odometry.turned(np.array([math.cos(state.yaw), math.sin(state.yaw), 0.0])).tolist()
        along = north * float(self._told_velocity[0]) + east * float(self._told_velocity[1])
        aside = self._rear * float(state.angular_velocity_frd[2])
        self._rolling = np.array([along * north - aside * east, along * east + aside * north, 0.0])
        self._crossing = None
        if not self._relative.settled or state.t - self._t_sighted >= _FRESH_S:
            return None
        relative: Array = self._rolling - self._relative.bias_ned
        self._crossing = crossing_speed(
            relative,
            course=(north, east),
            target_course=(float(self._course[0]), float(self._course[1])),
            aside=aside,
            least=self._p.target_speed.crossing,
        )
        speed = 0.0 if self._rest.resting else self._speed.speed if self._crossing is None else self._crossing
        return None if speed is None else relative + speed * self._course

    @property
    def lean_ned(self) -> Array:
        """A rover stands upright."""
        return _UPRIGHT

    def add_ownship(self, state: OwnshipState) -> None:
        """Take the next odometry message: nothing to be done with what is gone by."""

    def clear(self) -> None:
        """Forget the plan."""
        self._plan = self._solution = None
        self._run_up.forget()

    def rebase(self, reset: OwnshipReset) -> None:  # noqa: ARG002  # the interface's
        """Follow a reset of the autopilot's estimator: the trajectory belongs to the old frame.

        The controls do not: they are relative to the rover, and the next plan begins with them.
        """
        self._plan = None
        self._relative.forget()
        self._rest.forget()
        self._speed.forget()

    def update(
        self,
        *,
        t: float,
        dt: float,  # noqa: ARG002  # the interface's
        goal: Goal,
        switched: bool,
        ownship: OwnshipState,
        picture: Picture,
    ) -> Trajectory:
        """Plan where due; see `Pilot.update`."""
        prediction = picture.prediction
        self._t_sighted = picture.t_sighted
        self._watch_target(t, ownship, prediction, picture.sighted_ned)
        if not goal.relative or prediction is None:
            return self._stand(t, goal, ownship)
        motion = self._last_centimetres(t, goal, ownship)
        if motion is not None:
            self._solution, self._t_planned = None, -math.inf
            self._plan = self._straight(t, motion, ownship)
            return self._corrected(self._plan, ownship)
        due = t - self._t_planned >= self._p.replan_s - 1e-6
        if self._plan is None or switched or due:
            self._plan = self._planned(t, goal, prediction, ownship, picture.track)
            self._t_planned = t
        return self._corrected(self._plan, ownship)

    def _corrected(self, plan: Trajectory, ownship: OwnshipState) -> CorrectedTrajectory:
        sent = self._odometry.vector_told(self._told_velocity - ownship.velocity_ned)
        return CorrectedTrajectory(base=plan, acceleration_ned=_STILL, velocity_ned=sent)

    def _last_centimetres(self, t: float, goal: Goal, ownship: OwnshipState) -> Motion | None:
        """Give what a run-up asks for beside a target that stands and is seen, None where plans are made."""
        if not self._rest.resting or t - self._t_sighted > _FRESH_S:
            self._run_up.forget()
            return None
        wanted, yaw = goal.at(t), ownship.yaw
        cosine, sine = math.cos(wanted.yaw), math.sin(wanted.yaw)
        turned = wrap_angle(wanted.yaw - yaw)
        north = float(wanted.position_ned[0] - ownship.position_ned[0]) - self._rear * (cosine - math.cos(yaw))
        east = float(wanted.position_ned[1] - ownship.position_ned[1]) - self._rear * (sine - math.sin(yaw))
        along, across = cosine * north + sine * east, cosine * east - sine * north
        return self._run_up.update(t, along=along, across=across, heading=turned)

    def _straight(self, t: float, motion: Motion, ownship: OwnshipState) -> Trajectory:
        """Give one speed and turn as a trajectory, until the next step."""
        yaw, place = ownship.yaw, ownship.position_ned
        velocity = motion.speed * np.array([math.cos(yaw), math.sin(yaw), 0.0])

        def at(when: float) -> MotionState:
            return MotionState(
                position_ned=place + (when - t) * velocity,
                velocity_ned=velocity,
                acceleration_ned=_STILL,
                yaw=yaw + (when - t) * motion.yaw_rate,
                yaw_rate=motion.yaw_rate,
            )

        end = t + self._p.expiry_s
        return DirectTrajectory(motion=at, t_start=t, t_end=end, t_expiry=end, reset_counter=ownship.reset_counter)

    def _watch_target(
        self, t: float, ownship: OwnshipState, prediction: Prediction | None, sighted_ned: Array | None
    ) -> None:
        """Observe the velocity relative to the target, and whether the target stands."""
        if prediction is None or sighted_ned is None:
            self._rest.forget()
            self._speed.forget()
            return
        self._relative.add(
            t=ownship.t,
            reset_counter=ownship.reset_counter,
            velocity_ned=self._rolling,
            position_ned=ownship.position_ned - sighted_ned,
        )
        north, east, _ = self._odometry.point_told(sighted_ned).tolist()
        target = prediction.at(t)
        surely = self._odometry.resting or self._crossing is not None
        speed = math.hypot(*target.velocity_ned[:2].tolist()) if self._crossing is None else abs(self._crossing)
        self._rest.update(t, north=north, east=east, speed=speed, surely=surely)
        self._course = np.array([math.cos(target.yaw), math.sin(target.yaw), 0.0])
        if self._rest.resting:
            self._speed.forget()
        elif t - self._t_sighted < _FRESH_S:
            ahead, aside, _ = self._odometry.vector_told(self._course).tolist()
            self._speed.update(t, north=north, east=east, course=(ahead, aside), crossing=self._crossing)

    def _stand(self, t: float, goal: Goal, ownship: OwnshipState) -> Trajectory:
        self.clear()
        return DirectTrajectory(
            motion=goal.at, t_start=t, t_end=t, t_expiry=t + self._p.expiry_s, reset_counter=ownship.reset_counter
        )

    def _planned(
        self, t: float, goal: Goal, prediction: Prediction, ownship: OwnshipState, track: TargetTrack | None
    ) -> RoverTrajectory:
        p = self._p
        waiting = self._waits(t, ownship)
        if waiting and self._solution is not None:
            self._solution = replace(self._solution, t_start=t)
        start = self._start(t, ownship, standing=waiting)
        cosine, sine = math.cos(start.yaw), math.sin(start.yaw)
        poses, places = [], []
        place = self._axle_there(goal.at(t if self._rest.resting else t + p.lead_s), start)
        near = math.hypot(*place[:2]) < p.station_m
        self._meeting = None if near or self._rest.resting else self._met(t + p.lead_s, goal, start)
        # when the place is met is the plan's to find; where it ends before, it leads to where that will be
        later = 0.0 if self._meeting is None else self._meeting.elapsed - p.planner.horizon * p.step_s
        for k in range(p.planner.horizon + 1):
            # a forecast of a target that stands makes it drive: it is uncertain, and another one each time
            when = t if self._rest.resting else t + p.lead_s + k * p.step_s
            poses.append(self._axle_there(goal.at(when + later), start))
            target = prediction.at(when).position_ned
            north, east = float(target[0]) - start.north, float(target[1]) - start.east
            places.append((cosine * north + sine * east, cosine * east - sine * north))
        last = None if self._is_stuck(t, place) else self._solution
        seen = t - self._t_sighted < _FRESH_S
        station = seen and near and not self._rest.resting
        correction = p.correction_mps if near and self._rest.resting else math.inf
        moving = math.hypot(*prediction.at(t).velocity_ned[:2].tolist())
        solution = self._planner.plan(
            CoupledRequest(
                t_start=t,
                step=p.step_s,
                goal=np.array(poses),
                speed=start.speed,
                yaw_rate=start.yaw_rate,
                target=np.array(places),
                weights=self._station_weights(moving) if station else None,
                forward_only=station and math.hypot(*places[0]) - self._rear > p.station_near_m,
                speed_most=min(
                    moving + p.station_faster_mps if station else correction,
                    self._stoppable(t, goal, prediction, ownship, track, start.speed),
                ),
                speed_wanted=moving if station else 0.0,
            ),
            last=last,
        )
        self._solution = solution
        return RoverTrajectory(
            plan=solution,
            origin_ned=(start.north, start.east, float(ownship.position_ned[2])),
            yaw=start.yaw,
            midpoint=p.planner.midpoint,
            t_expiry=t + p.expiry_s,
            reset_counter=ownship.reset_counter,
        )

    def _stoppable(
        self,
        t: float,
        goal: Goal,
        prediction: Prediction,
        ownship: OwnshipState,
        track: TargetTrack | None,
        speed: float,
    ) -> float:
        """Give the speed [m/s] from which it stops in time if the target brakes now, or what one step comes down to."""
        target, place = prediction.at(t), goal.at(t)
        north, east = (target.position_ned - ownship.position_ned)[:2].tolist()
        gap = math.hypot(north, east)
        if gap < 1e-6:
            return math.inf
        # the track knows of a braking target before the forecast does; one that sets off may wait until both do
        speeds = [target.velocity_ned] if track is None else [target.velocity_ned, track.velocity_ned]
        most = fastest(
            gap=gap,
            standoff=math.hypot(*(target.position_ned - place.position_ned)[:2].tolist()),
            ahead=(math.cos(ownship.yaw) * north + math.sin(ownship.yaw) * east) / gap,
            away=min(float(v[0]) * north + float(v[1]) * east for v in speeds) / gap,
            braking=self._motion.acceleration,
            parameters=self._p.stopping,
        )
        return max(most, speed - self._motion.acceleration * self._p.step_s)

    def _station_weights(self, moving: float) -> CostWeights:
        """Give the weights beside a target that drives at `moving` [m/s].

        At that speed v, turned by e against it, the rover goes v sin(e) across the target's heading: the faster both
        are, the more a turn matters. To second order that is one more v^2 to the weight of the heading.
        """
        p = self._p
        more = p.station_drift * moving * moving
        return replace(
            p.station, stage_heading=p.station.stage_heading + more, final_heading=p.station.final_heading + more
        )

    def _axle_there(self, wanted: MotionState, start: _Start) -> Pose:
        """Give the rear axle's pose in a wanted motion, as seen from that at the start."""
        cosine, sine = math.cos(start.yaw), math.sin(start.yaw)
        north = float(wanted.position_ned[0]) - self._rear * math.cos(wanted.yaw) - start.north
        east = float(wanted.position_ned[1]) - self._rear * math.sin(wanted.yaw) - start.east
        return cosine * north + sine * east, cosine * east - sine * north, wrap_angle(wanted.yaw - start.yaw)

    def _met(self, t: float, goal: Goal, start: _Start) -> Meeting | None:
        """Find when, from a plan's end on, the place can be reached from a start at `t` [s]; None: not asked."""
        reach = self._reach
        if reach is None:
            return None

        def needed(elapsed: float) -> float:
            wanted = goal.at(t + elapsed)
            along = math.cos(wanted.yaw) * wanted.velocity_ned[0] + math.sin(wanted.yaw) * wanted.velocity_ned[1]
            return reach.time_to(self._axle_there(wanted, start), speed=start.speed, speed_end=float(along))

        p = self._p
        return earliest_meeting(needed, p.meeting.horizon_s, first=p.planner.horizon * p.step_s)

    def _is_stuck(self, t: float, place: tuple[float, float, float]) -> bool:
        """Say whether plans have stood still for a while, and not at the place: then one begins without the last."""
        p, solution = self._p, self._solution
        away = math.hypot(place[0], place[1]) > p.stuck_m or abs(place[2]) > p.stuck_rad
        if not away or solution is None or float(np.abs(solution.controls[: p.stuck_steps, 0]).max()) > p.stuck_mps:
            self._stuck_since = None
            return False
        self._stuck_since = t if self._stuck_since is None else self._stuck_since
        if t - self._stuck_since < p.stuck_s:
            return False
        self._stuck_since = None
        return True

    def _waits(self, t: float, ownship: OwnshipState) -> bool:
        """Say whether the rover has been told to set off and still stands: then the plan waits for it.

        Friction holds it for half a second. A plan that went on meanwhile would be another one each time.
        """
        speed, _ = self._told(t)
        stands = self._rest.resting and abs(_along(ownship)) < self._p.standing_mps
        if not stands or speed is None or speed == 0.0:
            self._waiting_since = None
            return False
        self._waiting_since = t if self._waiting_since is None else self._waiting_since
        return t - self._waiting_since < self._p.start_s

    def _start(self, t: float, ownship: OwnshipState, *, standing: bool) -> _Start:
        """Give the rear axle's pose in `lead_s`, with the speed that is asked for; far from that, the measured one."""
        yaw = ownship.yaw
        measured = _along(ownship)
        speed, yaw_rate = (0.0, 0.0) if standing else self._told(t)
        if speed is None or abs(speed - measured) > self._p.reference_leash_mps:
            speed = max(-self._motion.speed_reverse, min(self._motion.speed_forward, measured))
        most = abs(speed) / self._motion.turning_radius
        yaw_rate = max(-most, min(most, yaw_rate))
        lead = self._p.lead_s
        course = yaw + 0.5 * lead * yaw_rate
        way = 0.5 * (measured + speed) * lead
        return _Start(
            north=float(ownship.position_ned[0]) - self._rear * math.cos(yaw) + way * math.cos(course),
            east=float(ownship.position_ned[1]) - self._rear * math.sin(yaw) + way * math.sin(course),
            yaw=yaw + lead * yaw_rate,
            speed=speed,
            yaw_rate=yaw_rate,
        )

    def _told(self, t: float) -> tuple[float | None, float]:
        """Give speed and yaw rate that the last plan asks for now."""
        solution = self._solution
        if solution is None:
            return None, 0.0
        elapsed = (t - solution.t_start) / solution.step
        index = int(elapsed)
        if not 0.0 <= elapsed < len(solution.controls):
            return None, 0.0
        speed, yaw_rate = solution.controls[index].tolist()
        return speed, yaw_rate


def _along(ownship: OwnshipState) -> float:
    """Give the speed [m/s] along the heading."""
    north, east = float(ownship.velocity_ned[0]), float(ownship.velocity_ned[1])
    return math.cos(ownship.yaw) * north + math.sin(ownship.yaw) * east
