"""Tuning of the refinement of a tag's corners by its edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeParameters:
    """Tuning of the edge fit."""

    rows: Annotated[int, Interval(ge=6, le=64)] = 14  # lines of pixels across each side, with up to four tags
    fewest_rows: Annotated[int, Interval(ge=6, le=64)] = 8  # with many tags: together they have enough
    reach: Annotated[float, Interval(ge=1.5, le=8.0)] = 4.5  # [px] furthest pixel from the edge that is used
    # share of the black frame's width that is used: beyond it the fit would see the tag's inner cells
    frame_share: Annotated[float, Interval(gt=0.2, le=1.0)] = 0.55
    corner_margin: Annotated[float, Interval(ge=0.02, le=0.3)] = 0.08  # share of the side left out at each end
    corner_margin_px: Annotated[float, Interval(ge=0.0, le=6.0)] = 1.5  # [px] at least this much
    rounds: Annotated[int, Interval(ge=1, le=5)] = 2  # times the pixels are chosen anew around the improved edge
    iterations: Annotated[int, Interval(ge=1, le=10)] = 6  # Levenberg-Marquardt steps in the last round, at most
    early_iterations: Annotated[int, Interval(ge=1, le=10)] = 3  # ... and in the rounds before it
    converged: Annotated[float, Gt(0.0)] = 0.03  # [px] steps smaller than this end the last round
    nearly: Annotated[float, Gt(0.0)] = 0.3  # [px] ... and the rounds before it
    smallest_contrast: Annotated[float, Gt(0.0)] = 12.0  # [grey levels] white minus black
    smallest_contrast_to_noise: Annotated[float, Gt(0.0)] = 5.0  # white minus black over the residuals' deviation
    largest_shift: Annotated[float, Interval(gt=0.0, le=0.5)] = 0.12  # of the side: a corner that moves more is refused
    largest_shift_px: Annotated[float, Gt(0.0)] = 2.5  # [px] a corner may always move this far
    smallest_side: Annotated[float, Gt(4.0)] = 9.0  # [px] smaller tags are not refined
    sigma_floor: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.02  # [px] what no fit can promise to beat
    # where the blur s reaches across the frame's width f, the inner cells pull the edge: by about sigma_cells s (s/f)^2
    sigma_cells: Annotated[float, Interval(ge=0.0, le=5.0)] = 0.7
    sigma_cells_limit: Annotated[float, Interval(ge=0.0, le=5.0)] = 0.25  # of s, at most
