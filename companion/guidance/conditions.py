"""What holds now: how well the target is known and seen, whether it is lost or at rest, what the Markov model says."""

from __future__ import annotations

import math
from dataclasses import replace

from companion.guidance.goals import allowed_lateral_error
from companion.guidance.markov import transition_probabilities
from companion.guidance.memory import Context
from companion.guidance.parameters import AcquisitionParameters
from companion.guidance.plan import SwitchingPolicy
from companion.guidance.view import RelativeState, View, relative_state
from companion.messages.decision import Mode, TransitionProbabilities
from companion.messages.target import TURN_RATE, TargetTrack

TRACKING_MODES = frozenset({Mode.APPROACH, Mode.REORIENT, Mode.FOLLOW, Mode.ALIGN, Mode.LAND, Mode.GO_AROUND})


def probabilities(c: Context, relative: RelativeState | None) -> TransitionProbabilities | None:
    """Give the Markov model's numbers, None where it is not asked."""
    m = c.memory
    if relative is None or m.mode not in TRACKING_MODES or relative.range > c.parameters.markov.activation_range_m:
        return None
    if c.plan.land is not None and c.plan.land.policy is not SwitchingPolicy.MARKOV:
        return None
    markov = c.parameters.markov
    if m.coarse_std is not None:
        markov = replace(markov, coarse_position_std_m=m.coarse_std)
    return transition_probabilities(
        range_m=relative.range,
        reorient_range_m=m.reorient_range or max(relative.range, c.parameters.markov.reorient_floor_m),
        inconsistency=relative.inconsistency,
        heading_error=relative.heading_error,
        position_std=relative.position_std,
        parameters=markov,
    )


def is_acquired(c: Context, view: View, relative: RelativeState) -> bool:
    """Say whether the track may be trusted."""
    a, track = c.parameters.acquisition, view.track
    return (
        track is not None
        and view.prediction is not None
        and track.fused >= a.measurements
        and relative.position_std < a.position_std_m
        and track.age < c.plan.lost.coast_s
    )


def is_sighted(c: Context, track: TargetTrack | None) -> bool:
    """Say whether the target is in sight: a track that coasts is a forecast, and nothing is settled by it."""
    return track is not None and track.age < c.parameters.acquisition.coasting_s


def is_looking(c: Context, view: View, relative: RelativeState) -> bool:
    """Say whether an approach still begins: the vehicle comes to rest where it sees the target, and looks."""
    a, waited = c.parameters.approach, view.t - c.memory.t_entered
    far = relative.lateral > aside_in_view(c, relative) + a.look_near_m
    return waited < (a.look_most_s if far else a.look_s)


def aside_in_view(c: Context, relative: RelativeState) -> float:
    """Give how far aside [m] a target may be, to be in the picture even though the vehicle leans."""
    return max(0.0, relative.height) / c.parameters.approach.look_slope


def without_frames(acquisition: AcquisitionParameters, view: View) -> str | None:
    """Say for how long no camera frames have come, None while they come."""
    silence = view.t - view.t_frame
    if silence <= acquisition.camera_silence_s:
        return None
    return f"no camera frames for {silence:.1f} s" if math.isfinite(silence) else "no camera frames at all"


def why_lost(c: Context, view: View, relative: RelativeState | None, *, descending: bool = False) -> str | None:
    """Say why the target counts as lost, or None.

    While coasting the mission says for how long to fly on; how well the position is known then says only how near the
    target will be when it comes back into sight. Not so in a descent.
    """
    track, a = view.track, c.parameters.acquisition
    if track is None or relative is None or view.prediction is None:
        return without_frames(c.parameters.acquisition, view) or "no track of the target"
    if track.age > c.plan.lost.coast_s:
        blind = without_frames(a, view) or f"target not seen for {track.age:.1f} s, though frames come"
        return f"{blind} (coasting is allowed for {c.plan.lost.coast_s:.1f} s)"
    position_std = a.descent_position_std_m if descending else a.position_std_m
    if relative.position_std > position_std and (descending or is_sighted(c, track)):
        return f"position known to {relative.position_std:.2f} m only (at most {position_std:.2f} m)"
    if track.nis_mean > a.nis_mean:
        return f"estimate not consistent: mean NIS {track.nis_mean:.1f} (at most {a.nis_mean:.1f})"
    return None


def deviation_floor(c: Context) -> float:
    """Give the horizontal distance [m] at which, at the latest, the vehicle turns to the point above the pad."""
    land = c.plan.land
    if land is not None and land.policy is SwitchingPolicy.FIXED:
        return land.deviate_at_m
    return c.parameters.markov.reorient_floor_m


def has_stopped(c: Context, view: View, track: TargetTrack) -> bool:
    """Say whether the target has been at rest for the dwell time."""
    m, p = c.memory, c.parameters.follow
    speed = math.hypot(float(track.velocity_ned[0]), float(track.velocity_ned[1]))
    quiet = (
        is_sighted(c, track)
        and speed < p.stopped_speed_mps
        and abs(float(track.state[TURN_RATE])) < p.stopped_turn_radps
    )
    if not quiet:
        m.stopped_since = None
        return False
    if m.stopped_since is None:
        m.stopped_since = view.t
    return view.t - m.stopped_since >= p.stopped_dwell_s


def is_on_pad(c: Context, view: View) -> bool:
    """Say whether the feet are seen to touch the pad."""
    track = view.track
    if track is None or not is_sighted(c, track):
        return False
    d = c.parameters.descent
    return relative_state(view, track, d).height <= d.contact_height_m


def cone(c: Context, height: float) -> float:
    """Give the radius [m] of the descent cone at a height [m] of the feet above the pad."""
    d = c.parameters.descent
    return allowed_lateral_error(height, half_angle=d.cone_half_angle_rad, floor=d.cone_floor_m)


def is_complete(c: Context) -> bool:
    """Whether nothing is left but the final hold."""
    if c.plan.land is not None:
        return False
    return c.memory.followed if c.plan.follow is not None else c.memory.found
