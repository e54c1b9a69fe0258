"""While the autopilot lands by itself: is it doing so, has somebody else taken over, did it land on the pad?

The companion flies nothing here. It goes on telling the autopilot where the pad is, and watches.
"""

from __future__ import annotations

from companion.guidance.memory import Context
from companion.guidance.modes import Event
from companion.guidance.view import RelativeState, View
from companion.messages.decision import Mode
from companion.messages.ownship import FlightMode, LandedState

_TAKE_UP_S = 6.0  # [s] within which the autopilot must have taken up the landing, or shown another mode
_NEAR_HEIGHT, _NEAR_LATERAL = 0.5, 0.3  # [m] last seen this near above the pad: it is the pad on which it lands
_FRESH_S = 0.5  # [s] age of a track that says where the vehicle is now
_IN_FLIGHT = frozenset(Mode) - {Mode.PREFLIGHT, Mode.TOUCHDOWN, Mode.AUTOPILOT_LAND, Mode.DONE, Mode.ABORT}


def by_autopilot(c: Context) -> bool:
    """Whether the mission lands by the autopilot's precision landing."""
    return c.plan.land is not None and c.plan.land.by_autopilot


def check_precland_asked(c: Context, view: View) -> tuple[Event, str] | None:
    """Look whether somebody else, the pilot, has asked for the precision landing that this mission is for."""
    asked = view.status.armed and view.status.mode is FlightMode.AUTO_PRECLAND
    if asked and by_autopilot(c) and c.memory.mode in _IN_FLIGHT:
        return Event.PRECLAND, "precision landing asked for by somebody else: telling where the pad is"
    return None


def check_autopilot_land(c: Context, view: View, relative: RelativeState | None) -> tuple[Event, str] | None:
    """Look how the autopilot's landing goes on."""
    m, mode = c.memory, view.status.mode
    if not m.precland_seen and mode is not FlightMode.AUTO_PRECLAND:
        return _check_take_up(c, view)
    m.precland_seen = True
    if relative is not None and view.track is not None and view.track.age < _FRESH_S:
        m.last_seen = (view.t, relative.lateral, relative.height)
    if view.landed:
        return _where_landed(c, view)
    on_ground = view.status.landed is LandedState.ON_GROUND  # it disarms, and the mode goes back to what it was
    if view.status.armed and mode is not FlightMode.AUTO_PRECLAND and not on_ground:
        return Event.TAKEN_OVER, f"the precision landing was broken off: mode {mode.value}"
    return None


def _where_landed(c: Context, view: View) -> tuple[Event, str]:
    """Judge by the last sight of the pad: standing on it, it is not seen."""
    if c.memory.last_seen is None:
        return Event.LANDED_ELSEWHERE, "landed by the autopilot, which the pad was not seen under"
    t, lateral, height = c.memory.last_seen
    sight = f"the pad was last seen {view.t - t:.0f} s before, {lateral:.2f} m beside and {height:.2f} m below"
    if height < _NEAR_HEIGHT and lateral < _NEAR_LATERAL:
        return Event.LANDED, f"landed by the autopilot; {sight}"
    return Event.LANDED_ELSEWHERE, f"landed by the autopilot, but not on the pad: {sight}"


def _check_take_up(c: Context, view: View) -> tuple[Event, str] | None:
    mode = view.status.mode
    if mode is FlightMode.OFFBOARD:
        waited = view.t - c.memory.t_entered
        if waited < _TAKE_UP_S:
            return None
        return Event.NOT_TAKEN_UP, f"the autopilot did not begin its precision landing in {waited:.0f} s"
    if mode is FlightMode.AUTO_LOITER:
        return Event.NOT_TAKEN_UP, "the autopilot refused its precision landing, and holds"
    return Event.TAKEN_OVER, f"the vehicle is flown by somebody else: mode {mode.value}"
