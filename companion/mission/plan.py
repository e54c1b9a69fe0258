"""A mission as the guidance sees it."""

from __future__ import annotations

from companion.guidance.plan import (
    FlightPlan,
    FollowPlan,
    FollowUntil,
    GroundPlan,
    LandPlan,
    LostPlan,
    SearchPlan,
    SwitchingPolicy,
    TransitPlan,
)
from companion.mission.schema import (
    AfterSearch,
    Coarse,
    Follow,
    Hold,
    Intercept,
    Land,
    Mission,
    Output,
    Search,
    Takeoff,
    Transit,
)


def flight_plan(mission: Mission) -> FlightPlan:
    """Translate a checked mission, whose steps are in order and not repeated."""
    takeoff, hold = Takeoff(), Hold(for_s=0.0)
    search: Search | None = None
    transit: TransitPlan | None = None
    follow: FollowPlan | None = None
    land: LandPlan | None = None
    ground: GroundPlan | None = None
    for step in mission.steps:
        match step:
            case Takeoff():
                takeoff = step
            case Search():
                search = step
            case Transit():
                transit = TransitPlan(height_m=step.height_m, by_ranges=step.by is Coarse.RANGES)
            case Intercept():
                ground = GroundPlan(standoff_m=step.standoff_m, at_most_s=step.at_most_s)
            case Follow() if step.standoff_m is not None:
                ground = _ground_plan(step, step.standoff_m)
            case Follow():
                follow = _follow_plan(step)
            case Land():
                land = _land_plan(step, by_autopilot=mission.output is Output.LANDING_TARGET)
            case Hold():
                hold = step
    if search is None:  # the guidance looks for the target in any case
        search = Search(height_m=takeoff.height_m)
    lost = mission.on_target_lost
    return FlightPlan(
        takeoff_height_m=takeoff.height_m,
        transit=transit,
        search=SearchPlan(height_m=search.height_m, radius_m=search.radius_m, timeout_s=search.timeout_s),
        follow=follow,
        land=land,
        ground=ground,
        hold_s=hold.for_s,
        lost=LostPlan(
            coast_s=lost.coast_s,
            hold_s=lost.hold_s,
            search_s=lost.search_s,
            no_camera_s=lost.no_camera_s,
            then_return=lost.then is AfterSearch.RETURN,
        ),
    )


def _land_plan(step: Land, *, by_autopilot: bool) -> LandPlan:
    return LandPlan(
        policy=SwitchingPolicy(step.policy.value),
        deviate_at_m=LandPlan().deviate_at_m if step.deviate_at_m is None else step.deviate_at_m,
        max_attempts=step.max_attempts,
        by_autopilot=by_autopilot,
    )


def _follow_plan(step: Follow) -> FollowPlan:
    return FollowPlan(
        height_m=FollowPlan().height_m if step.height_m is None else step.height_m,
        until=FollowUntil(step.ends.value),
        for_s=step.for_s,
        at_most_s=step.at_most_s,
        match_heading=step.match_heading,
    )


def _ground_plan(step: Follow, standoff: float) -> GroundPlan:
    return GroundPlan(
        standoff_m=standoff,
        until=FollowUntil(step.ends.value),
        for_s=step.for_s,
        at_most_s=step.at_most_s,
        keeps_station=True,
    )
