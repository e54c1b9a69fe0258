"""What the planner's side tells the pilot and the ground station: every change of the mission, once, in plain words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from companion.messages.coarse import CoarseTarget
from companion.messages.decision import Decision, Mode, Switch
from companion.messages.news import TEXTS_MAX, End, MissionNews
from companion.messages.pilot import LandingTarget, PilotText, Severity
from companion.messages.target import POSITION, Intercept, TargetTrack
from companion.runtime.landing_targets import position_std
from companion.runtime.ports import MissionState, MissionStatus

_GOOD_ENDS = frozenset({MissionState.LANDED, MissionState.HELD})
_BAD_ENDS = frozenset({MissionState.REFUSED, MissionState.WRONG_VEHICLE, MissionState.NO_VEHICLE, MissionState.LOST})
_LOOKING = frozenset({Mode.APPROACH, Mode.REORIENT, Mode.FOLLOW, Mode.ALIGN, Mode.LAND, Mode.AUTOPILOT_LAND})
_REPEATED_S = 0.5  # [s] for which a text is handed over again: a handover can get lost
_SWITCHES = {
    Mode.ABORT: Severity.ERROR,
    Mode.GO_AROUND: Severity.WARNING,
    Mode.HOLD: Severity.NOTICE,
    Mode.AUTOPILOT_LAND: Severity.NOTICE,
    Mode.DONE: Severity.NOTICE,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MissionGlance:
    """What one step offers to be told."""

    t: float  # [s]
    mission: MissionStatus
    decision: Decision | None  # of this step
    track: TargetTrack | None
    intercept: Intercept | None
    t_frame: float  # [s] capture time of the newest picture, -inf before the first
    coarse: CoarseTarget | None = None  # where the pad should be without the camera


class MissionAnnouncer:
    """Compares each step with the one before; tells what is new.

    Args:
        unseen_s: time [s] without the pad, or without pictures, until that is told.
        gear_height: the body origin above the feet [m].
    """

    def __init__(self, *, unseen_s: float, gear_height: float) -> None:
        self._unseen = unseen_s
        self._gear_height = gear_height
        self._switch: Switch | None = None
        self._state = MissionState.WAITING
        self._reason = ""
        self._pad_lost = self._camera_lost = False
        self._t_running = math.inf
        self._said = 0
        self._recent: list[tuple[float, PilotText]] = []

    def report(self, g: MissionGlance, landing_target: LandingTarget | None) -> MissionNews:
        """Give what the guardian's side is to pass on in this step."""
        texts = self.news(g)
        self._said += len(texts)
        self._recent += [(g.t, text) for text in texts]
        self._recent = [(t, text) for t, text in self._recent[-TEXTS_MAX:] if g.t - t < _REPEATED_S]
        end = None
        if g.mission.ended:
            end = End.AS_ASKED if g.mission.state in _GOOD_ENDS else End.OTHERWISE
        return MissionNews(
            mode=g.mission.mode,
            end=end,
            said=self._said,
            texts=tuple(text for _, text in self._recent),
            values=self.values(g),
            landing_target=landing_target,
        )

    def news(self, g: MissionGlance) -> list[PilotText]:
        """Give what is to be told of this step, in the order of its happening."""
        return self._of_switch(g) + self._of_mission(g) + self._of_sight(g)

    def values(self, g: MissionGlance) -> dict[str, float]:
        """Give the numbers for the pilot: all of the pad, so none without a track; of the ranges where they come."""
        track = g.track
        ranges = {} if g.coarse is None or not g.coarse.by_ranges else {"rng_maha": g.coarse.mahalanobis}
        if track is None:
            return ranges | ({} if g.coarse is None else {"pad_std": g.coarse.position_std})
        forward, right, down = (float(value) for value in track.state[POSITION])
        values = ranges | {
            "pad_dist": math.hypot(forward, right),
            "pad_hgt": down - self._gear_height,
            "pad_std": position_std(track),
            "pad_age": track.age,
        }
        if g.intercept is not None and g.intercept.feasible:
            values["pad_tgo"] = max(0.0, g.intercept.t - g.t)
        return values

    def _of_switch(self, g: MissionGlance) -> list[PilotText]:
        switch = None if g.decision is None else g.decision.switched
        if switch is None or switch is self._switch:
            return []
        self._switch = switch
        severity = _SWITCHES.get(switch.mode, Severity.INFO)
        return [PilotText(severity=severity, text=f"{switch.mode.value}: {switch.reason}")]

    def _of_mission(self, g: MissionGlance) -> list[PilotText]:
        mission = g.mission
        standby = mission.state is MissionState.STANDBY
        if mission.state is self._state and not (standby and mission.reason != self._reason):
            return []
        self._state, self._reason = mission.state, mission.reason
        if standby:
            return [PilotText(severity=Severity.NOTICE, text=mission.reason)]
        if mission.state is MissionState.WAITING:
            return [PilotText(severity=Severity.WARNING, text=mission.reason)]
        if mission.state is MissionState.RUNNING:
            self._t_running = g.t
            return [PilotText(severity=Severity.INFO, text=f"mission begins: {mission.reason}")]
        if mission.state in _BAD_ENDS:
            return [PilotText(severity=Severity.ERROR, text=f"mission {mission.state.value}: {mission.reason}")]
        severity = Severity.NOTICE if mission.state in _GOOD_ENDS else Severity.ERROR
        said = mission.reason == (self._switch.reason if self._switch is not None else None)
        words = "" if said else f": {mission.reason}"
        return [PilotText(severity=severity, text=f"mission over, {mission.state.value}{words}")]

    def _of_sight(self, g: MissionGlance) -> list[PilotText]:
        if g.mission.state is not MissionState.RUNNING:
            return []
        silent = g.t - max(g.t_frame, self._t_running)
        if (silent > self._unseen) != self._camera_lost:
            self._camera_lost = not self._camera_lost
            if not self._camera_lost:
                return [PilotText(severity=Severity.NOTICE, text="camera: pictures again")]
            return [PilotText(severity=Severity.ERROR, text=f"camera: no pictures for {silent:.1f} s")]
        return [] if self._camera_lost else self._of_pad(g)

    def _of_pad(self, g: MissionGlance) -> list[PilotText]:
        mode = g.mission.mode
        if g.track is not None and g.track.age <= self._unseen:
            lost, self._pad_lost = self._pad_lost, False
            return [PilotText(severity=Severity.NOTICE, text="pad in sight again")] if lost else []
        if self._pad_lost or mode not in _LOOKING:
            return []
        self._pad_lost = True
        if mode is Mode.AUTOPILOT_LAND:
            text = "pad lost: the autopilot may search, then land where it is"
            return [PilotText(severity=Severity.CRITICAL, text=text)]
        return [PilotText(severity=Severity.WARNING, text=f"pad not seen for {self._unseen:.1f} s")]
