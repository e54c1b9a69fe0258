"""The coupled plan, made anew from where the rover is: for the place, for the meeting, or for station beside a target.

What is planned for is the middle of the rear axle (`start.py`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.clock import Clock
from companion.config.driving import DrivingSection
from companion.geometry.arrays import Array
from companion.guidance.goals import Goal
from companion.messages.ownship import OwnshipState
from companion.messages.target import Prediction, TargetTrack
from companion.planning.coupled.model import CostWeights, CoupledRequest, RoverMotion
from companion.planning.coupled.plan import CoupledPlan, Deadline
from companion.planning.coupled.scp import CoupledPlanner
from companion.planning.coupled.trajectory import RoverTrajectory
from companion.planning.shortest.meeting import Meeting, Reach, earliest_meeting
from companion.planning.shortest.path import Pose
from companion.planning.stopping import fastest
from companion.runtime.driving.start import PlanStart, plan_start, speed_along


@dataclass(frozen=True, slots=True, kw_only=True)
class Occasion:
    """What a plan is made for."""

    t: float  # [s] now
    goal: Goal
    ownship: OwnshipState  # in the frame to go by
    prediction: Prediction
    track: TargetTrack | None
    target_rests: bool
    target_seen: bool  # of late


class Replanning:
    """Holds the planner's newest answer, with which the next one begins.

    A plan begins with the pose that the rover has, `lead_s` ahead, and with the speed and turn that it has been told:
    its position is fed back by planning anew, its speed by the guardian's inner loop.

    Args:
        section: how plans are made.
        motion: what the rover can do.
        rear_axle: behind the body origin [m].
        reach: foresees where a place that is not near is met; None: each instant of a plan goes by the place as it
            will be then.
        clock: by which a plan keeps `deadline_s`; None: it takes as long as it takes.
    """

    def __init__(
        self,
        section: DrivingSection,
        motion: RoverMotion,
        *,
        rear_axle: float,
        reach: Reach | None = None,
        clock: Clock | None = None,
    ) -> None:
        self._p = section
        self._motion = motion
        self._rear = rear_axle
        self._reach = reach
        self._clock = clock
        self._planner = CoupledPlanner(motion, section.planner)
        self._solution: CoupledPlan | None = None
        self._meeting: Meeting | None = None
        self._stuck_since: float | None = None
        self._waiting_since: float | None = None
        self._gear = 0.0  # 1 forward, -1 backwards, 0 standing: as was asked for last
        self._t_gear = -math.inf  # [s] since when

    @property
    def solution(self) -> CoupledPlan | None:
        """The newest answer of the coupled planner."""
        return self._solution

    @property
    def meeting(self) -> Meeting | None:
        """When the place is met, counted from the newest plan's beginning, its end at the earliest; None: not asked."""
        return self._meeting

    def forget(self) -> None:
        """Begin the next plan without the last one."""
        self._solution = None

    def plan(self, occasion: Occasion) -> RoverTrajectory:
        """Plan from where the rover is in `lead_s`."""
        p, t, ownship, clock = self._p, occasion.t, occasion.ownship, self._clock
        deadline = None if clock is None else Deadline(clock=clock.now, t=clock.now() + p.deadline_s)
        waiting = self._waits(occasion)
        if waiting and self._solution is not None:
            self._solution = replace(self._solution, t_start=t)
        asked = self._told(t)
        told, held = (0.0, 0.0) if waiting else asked, self._held(t, asked[0])
        start = plan_start(ownship, told=told, section=p, motion=self._motion, rear_axle=self._rear, held=held)
        now = t if occasion.target_rests else t + p.lead_s
        place = start.axle_pose(occasion.goal.at(now), self._rear)
        near = math.hypot(*place[:2]) < p.station_m
        self._meeting = None if near or occasion.target_rests else self._met(t + p.lead_s, occasion.goal, start)
        request = self._request(occasion, start, near=near)
        last = None if self._is_stuck(t, place) else self._solution
        self._solution = self._planner.plan(request, last=last, deadline=deadline)
        return RoverTrajectory(
            plan=self._solution,
            origin_ned=(start.north, start.east, float(ownship.position_ned[2])),
            yaw=start.yaw,
            midpoint=p.planner.midpoint,
            t_expiry=t + p.expiry_s,
            reset_counter=ownship.reset_counter,
        )

    def _request(self, occasion: Occasion, start: PlanStart, *, near: bool) -> CoupledRequest:
        """Give what the planner is asked for; `near`: the place is so near that station beside the target counts."""
        p, t, rests = self._p, occasion.t, occasion.target_rests
        poses, places = self._course_of(occasion, start)
        station = occasion.target_seen and near and not rests and not occasion.goal.backs_out
        correction = p.correction_mps if near and rests else math.inf
        moving = math.hypot(*occasion.prediction.at(t).velocity_ned[:2].tolist())
        return CoupledRequest(
            t_start=t,
            step=p.step_s,
            goal=np.array(poses),
            speed=start.speed,
            yaw_rate=start.yaw_rate,
            target=np.array(places),
            weights=self._weights(occasion, self._station_weights(moving) if station else p.planner.weights),
            forward_only=station and math.hypot(*places[0]) - self._rear > p.station_near_m,
            speed_most=min(
                moving + p.station_faster_mps if station else correction, self._stoppable(occasion, start.speed)
            ),
            speed_wanted=moving if station else 0.0,
        )

    def _course_of(self, occasion: Occasion, start: PlanStart) -> tuple[list[Pose], list[tuple[float, float]]]:
        """Give the rear axle's wanted poses and the target's places [m] at the plan's instants, as seen from its start.

        When the place is met is the plan's to find; where it ends before, it leads to where that will be.
        """
        p, t = self._p, occasion.t
        poses, places = [], []
        later = 0.0 if self._meeting is None else self._meeting.elapsed - p.planner.horizon * p.step_s
        for k in range(p.planner.horizon + 1):
            # a forecast of a target that stands makes it drive: it is uncertain, and another one each time
            when = t if occasion.target_rests else t + p.lead_s + k * p.step_s
            poses.append(start.axle_pose(occasion.goal.at(when + later), self._rear))
            places.append(start.ahead_and_right(occasion.prediction.at(when).position_ned))
        return poses, places

    def _stoppable(self, occasion: Occasion, speed: float) -> float:
        """Give the speed [m/s] from which it stops in time if the target brakes now, or what one step comes down to.

        One that is out of sight may have braked when it was seen last, and stand.
        """
        ownship, track = occasion.ownship, occasion.track
        target, place = occasion.prediction.at(occasion.t), occasion.goal.at(occasion.t)
        standoff = math.hypot(*(target.position_ned - place.position_ned)[:2].tolist())
        # the track knows of a braking target before the forecast does; one that sets off may wait until both do
        velocities = [target.velocity_ned] if track is None else [target.velocity_ned, track.velocity_ned]
        most = self._behind(ownship, target.position_ned, standoff, velocities)
        seen = occasion.goal.may_stand_at
        if seen is not None:
            braked_s = 0.5 * math.hypot(*seen.velocity_ned[:2].tolist()) / self._p.stopping.target_braking_mps2
            stands_ned = seen.position_ned + braked_s * seen.velocity_ned
            most = min(most, self._behind(ownship, stands_ned, standoff, [np.zeros(3)]))
        return max(most, speed - self._motion.acceleration * self._p.step_s)

    def _behind(self, ownship: OwnshipState, target_ned: Array, standoff: float, velocities: list[Array]) -> float:
        """Give the speed [m/s] from which it stops behind a target here that drives away as the slowest of these do."""
        north, east = (target_ned - ownship.position_ned)[:2].tolist()
        gap = math.hypot(north, east)
        if gap < 1e-6:
            return math.inf
        return fastest(
            gap=gap,
            standoff=standoff,
            ahead=(math.cos(ownship.yaw) * north + math.sin(ownship.yaw) * east) / gap,
            away=min(float(v[0]) * north + float(v[1]) * east for v in velocities) / gap,
            braking=self._motion.acceleration,
            parameters=self._p.stopping,
        )

    def _weights(self, occasion: Occasion, weights: CostWeights) -> CostWeights:
        """Give the weights with more for the camera's term while the target is out of sight, though it moves.

        Where a forecast leads, each second makes the place that is driven to worse: to see it again is worth a detour.
        """
        track = occasion.track
        if track is None or track.age < self._p.unseen_s or occasion.target_rests:
            return weights
        return replace(weights, view=weights.view * self._p.unseen_view)

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

    def _met(self, t: float, goal: Goal, start: PlanStart) -> Meeting | None:
        """Find when, from a plan's end on, the place can be reached from a start at `t` [s]; None: not asked."""
        reach = self._reach
        if reach is None:
            return None

        def needed(elapsed: float) -> float:
            wanted = goal.at(t + elapsed)
            along = math.cos(wanted.yaw) * wanted.velocity_ned[0] + math.sin(wanted.yaw) * wanted.velocity_ned[1]
            return reach.time_to(start.axle_pose(wanted, self._rear), speed=start.speed, speed_end=float(along))

        p = self._p
        return earliest_meeting(needed, p.meeting.horizon_s, first=p.planner.horizon * p.step_s)

    def _is_stuck(self, t: float, place: Pose) -> bool:
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

    def _waits(self, occasion: Occasion) -> bool:
        """Say whether the rover has been told to set off and still stands: then the plan waits for it.

        Friction holds it for half a second. A plan that went on meanwhile would be another one each time.
        """
        t = occasion.t
        speed, _ = self._told(t)
        stands = occasion.target_rests and abs(speed_along(occasion.ownship)) < self._p.standing_mps
        if not stands or speed is None or speed == 0.0:
            self._waiting_since = None
            return False
        self._waiting_since = t if self._waiting_since is None else self._waiting_since
        return t - self._waiting_since < self._p.start_s

    def _held(self, t: float, speed: float | None) -> bool:
        """Say whether friction may still hold a rover that has been told to set off, at `speed` [m/s] now.

        Meanwhile plans go on from the speed that is asked for: if each began with the standstill, none would push for
        long enough to break loose.
        """
        gear = math.copysign(1.0, speed) if speed else 0.0
        if gear != self._gear:
            self._gear, self._t_gear = gear, t
        return gear != 0.0 and t - self._t_gear < self._p.start_s

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
