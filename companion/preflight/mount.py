"""The tilt test: does the camera look where its mount in the configuration says?

A pad that lies level shows the camera where down is; the autopilot's attitude says it too. Both in the level frame that
turns with the vehicle's heading, they differ by

    d_i = R(-heading_i) s + (-e_y, e_x),

s the slope of the pad (north, east) and e the small rotation by which the true mount differs from the configured one
(e_x about forward: roll, e_y about right: pitch). At one heading only the sum shows; when the vehicle is turned about,
least squares tell the two apart. What attitude and camera cannot tell: an error of the mount's yaw, and a level of the
autopilot that is itself off (that is taken as the mount's).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array
from companion.geometry.rotations import rotation_about_z, yaw_of
from companion.preflight.finding import Finding, judged, not_checked
from companion.preflight.parameters import CameraLimits

_SAMPLES_LEAST = 5
_TURNED = 0.7  # length of the mean heading vector below which the vehicle counts as turned about: some 90 degrees
_ADVICE = (
    "lay the pad level, hold the vehicle about a metre above it, and turn it half round while this runs "
    "(--seconds 30); propellers off"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TiltSample:
    """The pad in one picture, and the vehicle's attitude at its capture."""

    frd_from_pad: Array  # (3, 3) by the picture and the configured mount
    ned_from_frd: Array  # (3, 3) by the autopilot


@dataclass(frozen=True, slots=True, kw_only=True)
class TiltResult:
    """What the samples say. To put the mount right, add the angles to camera.mount."""

    samples: int
    separated: bool  # the pad's own slope is told apart
    roll: float  # [rad] of the mount; together with the pad's slope where they are not told apart
    pitch: float  # [rad] likewise
    slope: float | None  # [rad] of the pad, None where not told apart
    scatter: float  # [rad] rms of what remains


def measure_tilt(samples: Sequence[TiltSample]) -> TiltResult | None:
    """Fit the equation above; None for too few samples."""
    if len(samples) < _SAMPLES_LEAST:
        return None
    headings = np.array([yaw_of(sample.ned_from_frd) for sample in samples])
    seen = np.array([_down(sample, heading)[:2] for sample, heading in zip(samples, headings, strict=True)])
    separated = float(abs(np.mean(np.exp(1j * headings)))) < _TURNED
    slope: Array = np.zeros(2)
    common = seen.mean(axis=0)
    if separated:
        turns = [rotation_about_z(-heading)[:2, :2] for heading in headings]
        rows = np.vstack([np.hstack([turn, np.eye(2)]) for turn in turns])
        solution = np.linalg.lstsq(rows, seen.ravel(), rcond=None)[0]
        slope, common = solution[:2], solution[2:]
        remains = seen.ravel() - rows @ solution
    else:
        remains = (seen - common).ravel()
    return TiltResult(
        samples=len(samples),
        separated=separated,
        roll=float(common[1]),
        pitch=float(-common[0]),
        slope=float(np.hypot(*slope)) if separated else None,
        scatter=float(np.sqrt(np.mean(remains**2) * 2.0)),
    )


def _down(sample: TiltSample, heading: float) -> Array:
    """Give the pad's downward axis (3,) in the level frame that has the vehicle's heading."""
    down: Array = rotation_about_z(-heading) @ sample.ned_from_frd @ sample.frd_from_pad[:, 2]
    return down


def judge_mount(result: TiltResult | None, pad: str | None, limits: CameraLimits) -> Finding:
    """Judge the camera's mount by the tilt test."""
    if result is None:
        why = "no pad is known" if pad is None else f"the pad {pad} was not in sight"
        return not_checked("camera mount", why, "name the pad: --mission MISSION.yaml" if pad is None else _ADVICE)
    roll, pitch = math.degrees(result.roll), math.degrees(result.pitch)
    tilt = math.hypot(roll, pitch)
    figures: dict[str, float | str | bool | None] = {
        "tilt_deg": tilt,
        "roll_deg": roll,
        "pitch_deg": pitch,
        "scatter_deg": math.degrees(result.scatter),
        "pad_slope_deg": None if result.slope is None else math.degrees(result.slope),
        "samples": result.samples,
    }
    words = f"{tilt:.1f} deg off (roll {roll:+.1f}, pitch {pitch:+.1f}; scatter {math.degrees(result.scatter):.1f})"
    if result.slope is None:
        found = f"mount and pad together {words}"
        wanted = f"at most {limits.tilt_most_deg:g} deg; to tell the mount from a pad that slopes: {_ADVICE}"
    else:
        found = f"{words}; the pad slopes {math.degrees(result.slope):.1f} deg"
        correction = f"add {roll:+.1f} to camera.mount.roll_deg and {pitch:+.1f} to pitch_deg"
        wanted = f"at most {limits.tilt_most_deg:g} deg; {correction}"
    return judged("camera mount", tilt <= limits.tilt_most_deg, found, wanted, figures)
