"""Judge what a camera has given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from companion.camera.source import CameraEvent, CameraRecovered
from companion.messages.perception import PadObservation
from companion.preflight.finding import Finding, judged, not_checked
from companion.preflight.parameters import CameraLimits
from companion.preflight.picture import PictureQuality


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraReport:
    """What a camera has given while it was looked at."""

    source: str
    failure: str | None  # why it could not be opened
    arrivals: Sequence[float]  # [s] of every new picture
    qualities: Sequence[PictureQuality]  # of some of them
    observations: Sequence[PadObservation]  # of the same, where a pad was looked for
    pad: str | None  # which was looked for
    troubles: Sequence[CameraEvent]


def judge_camera(report: CameraReport, limits: CameraLimits, calibrated: tuple[int, int]) -> list[Finding]:
    """Judge a camera.

    Args:
        report: what it has given.
        limits: what is asked of it.
        calibrated: width and height that the calibration holds for [px].
    """
    size = f"{calibrated[0]}x{calibrated[1]}"
    if report.failure is not None:
        return [judged("camera", False, report.failure, f"opens, and gives pictures of {size} as its calibration says")]
    opened = judged("camera", True, f"{report.source}, {size} as calibrated", "opens", {"source": report.source})
    return [opened, _rate(report, limits), *_pictures(report, limits), _calibration(report, limits)]


def _rate(report: CameraReport, limits: CameraLimits) -> Finding:
    wanted = f"{limits.rate_least_hz:g} Hz or more, no gap above {limits.gap_most_s:g} s"
    gaps = np.diff(np.array(report.arrivals))
    if gaps.size < 2:
        return judged("frame rate", False, f"{len(report.arrivals)} pictures", wanted)
    rate, longest = gaps.size / float(gaps.sum()), float(gaps.max())
    stopped = [event for event in report.troubles if not isinstance(event, CameraRecovered)]
    found = f"{rate:.1f} Hz, longest gap {1e3 * longest:.0f} ms"
    if stopped:
        found += f", stopped {len(stopped)} times"
    fine = rate >= limits.rate_least_hz and longest <= limits.gap_most_s and not stopped
    return judged("frame rate", fine, found, wanted, {"rate_hz": rate, "longest_gap_s": longest})


def _pictures(report: CameraReport, limits: CameraLimits) -> list[Finding]:
    bright_enough = f"mean grey level {limits.mean_least:g} to {limits.mean_most:g}"
    exposure_wanted = f"{bright_enough}, at most {100 * limits.clipped_most:g} % black or burnt out"
    sharp_wanted = f"blur at most {limits.blur_most:g}: focus the lens, clean it, keep the vehicle still"
    if not report.qualities:
        return [
            not_checked("exposure", "no picture", exposure_wanted),
            not_checked("sharpness", "no picture", sharp_wanted),
        ]
    mean = median(q.mean for q in report.qualities)
    clipped = median(q.dark + q.bright for q in report.qualities)
    contrast = median(q.contrast for q in report.qualities)
    blur = median(q.blur for q in report.qualities)
    exposed = limits.mean_least <= mean <= limits.mean_most and clipped <= limits.clipped_most
    exposure = judged(
        "exposure",
        exposed,
        f"mean grey level {mean:.0f}, {100 * clipped:.0f} % black or burnt out",
        exposure_wanted,
        {"mean_grey": mean, "clipped_share": clipped},
    )
    if contrast < limits.contrast_least:
        found = f"nothing to see (contrast {contrast:.1f} grey levels)"
        sharpness = judged("sharpness", False, found, "uncover the lens; show it something with edges")
    else:
        figures = {"blur": blur, "contrast_grey": contrast}
        sharpness = judged("sharpness", blur <= limits.blur_most, f"blur {blur:.2f}", sharp_wanted, figures)
    return [exposure, sharpness]


def _calibration(report: CameraReport, limits: CameraLimits) -> Finding:
    wanted = f"the pad's corners within {limits.reprojection_most_px:g} px of where the calibration puts them"
    if report.pad is None:
        return not_checked("calibration", "the size fits; no pad is known", "name the pad: --mission MISSION.yaml")
    seen = [observation for observation in report.observations if observation.seen]
    if not seen:
        found = f"the size fits; the pad {report.pad} was not in sight"
        return not_checked("calibration", found, "hold the vehicle about a metre above the pad")
    error = median(observation.hypotheses[0].reprojection_rms for observation in seen)
    found = f"the size fits; the pad's corners {error:.2f} px off, in {len(seen)} pictures"
    figures = {"reprojection_px": error, "pictures": len(seen)}
    return judged("calibration", error <= limits.reprojection_most_px, found, wanted, figures)
