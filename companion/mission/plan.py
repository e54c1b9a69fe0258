"""A mission as the guidance sees it."""

from __future__ import annotations

from companion.guidance.plan import FlightPlan, FollowPlan, FollowUntil, GroundPlan, LandPlan, LostPlan, SearchPlan
from companion.mission.schema import AfterSearch, Follow, Hold, Intercept, Land, Mission, Output, Search, Takeoff


def flight_plan(mission: Mission) -> FlightPlan:
    """Translate a checked mission, whose steps are in order and not repeated."""
    takeoff, hold = Takeoff(), Hold(for_s=0.0)
    search: Search | None = None
    follow: FollowPlan | None = None
    land: LandPlan | None = None
    ground: GroundPlan | None = None
    for step in mission.steps:
        match step:
            case Takeoff():
                takeoff = step
            case Search():
                search = step
            case Intercept():
                ground = GroundPlan(standoff_m=step.standoff_m, at_most_s=step.at_most_s)
            case Follow() if step.standoff_m is not None:
                ground = _ground_plan(step, step.standoff_m)
            case Follow():
                follow = _follow_plan(step)
            case Land():
                by_autopilot = mission.output is Output.LANDING_TARGET
                land = LandPlan(max_attempts=step.max_attempts, by_autopilot=by_autopilot)
            case Hold():
                hold = step
    if search is None:  # the guidance looks for the target in any case
        search = Search(height_m=takeoff.height_m)
    lost = mission.on_target_lost
    return FlightPlan(
        takeoff_height_m=takeoff.height_m,
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
