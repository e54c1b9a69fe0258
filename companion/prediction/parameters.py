"""Parameters of the predictors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Lt

Positive = Annotated[float, Gt(0.0)]
NotNegative = Annotated[float, Ge(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceParameters:
    """Tuning of the method `evidence`."""

    spacing: Positive = 0.25  # [s] between the track states that are kept
    samples: Annotated[int, Ge(8)] = 60  # of them
    span: Positive = 60.0  # [s] how far back they may reach, dropouts included
    # Deviation of track states from a motion: as if by a process with this deviation and this correlation time. Three
    # guesses each; the data choose.
    deviation: tuple[Positive, Positive, Positive] = (0.04, 0.15, 0.4)  # [m]
    deviation_time: tuple[Positive, Positive, Positive] = (0.7, 0.7, 1.5)  # [s]
    deviation_heading: tuple[Positive, Positive, Positive] = (0.01, 0.06, 0.8)  # [rad]
    deviation_time_heading: tuple[Positive, Positive, Positive] = (3.0, 4.0, 40.0)  # [s]
    # What a target may do, before it has shown anything: deviations.
    place: Positive = 0.15  # [m] of the line of the segment from the newest pose
    speed: Positive = 0.5  # [m/s] per axis
    acceleration: Positive = 0.1  # [m/s^2]
    jerk: Positive = 0.1  # [m/s^3]
    place_heading: Positive = 0.5  # [rad]
    turn_rate: Positive = 0.3  # [rad/s]
    change_rate: Annotated[float, Gt(0.0), Lt(1.0)] = 0.05  # [1/s] how often a target begins a new motion
    # The forecast.
    curve_s: Positive = 0.7  # [s] after which acceleration and jerk are no longer carried on
    speed_floor: Positive = 0.3  # [m/s] a target that has shown less may yet do this
    acceleration_floor: Positive = 0.3  # [m/s^2]
    turn_rate_floor: Positive = 0.1  # [rad/s]
    # Growth of the variance before calibration.
    manoeuvre: NotNegative = 0.07  # [m/s per sqrt(s)] random walk of the velocity
    manoeuvre_heading: NotNegative = 0.01  # [rad/s per sqrt(s)]


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictorParameters:
    """Tuning of the predictor."""

    # none: the target stays where it was last seen, for comparisons
    method: Literal["evidence", "regularised", "paper", "none"] = "evidence"
    samples: Annotated[int, Ge(5)] = 31  # track states regressed (L), by the methods paper and regularised
    spacing: Positive = 0.1  # [s] between them
    horizon: Positive = 6.0  # [s]
    gap: Positive = 1.0  # [s] without a track after which the history begins anew
    # Regularised method.
    cubic_horizon: Positive = 2.0  # [s] after which the velocity is held
    sample_deviation: Positive = 0.2  # [m] of a past position from a cubic through the present
    sample_deviation_heading: Positive = 0.2  # [rad]
    acceleration_prior: Positive = 0.2  # [m/s^2]
    acceleration_prior_heading: Positive = 0.2  # [rad/s^2]
    jerk_prior: Positive = 0.2  # [m/s^3]
    jerk_prior_heading: Positive = 0.2  # [rad/s^3]
    reversion: Positive = 0.1  # [m/s] how closely the last velocity returns to the window's mean
    reversion_heading: Positive = 0.1  # [rad/s]
    reversion_span: Positive = 1.0  # [s] of history below which it does not
    # Growth of the variance before calibration; calibration scales it by what past forecasts missed by.
    manoeuvre_horizontal: NotNegative = 0.08  # [m/s]
    manoeuvre_vertical: NotNegative = 0.08  # [m/s]
    manoeuvre_heading: NotNegative = 0.01  # [rad/s]
    wander_horizontal: NotNegative = 0.04  # [m/sqrt(s)]
    wander_vertical: NotNegative = 0.04  # [m/sqrt(s)]
    wander_heading: NotNegative = 0.01  # [rad/sqrt(s)]
    calibration_weight: Annotated[float, Ge(0.0), Lt(1.0)] = 0.05  # of one past forecast; 0 switches it off
    calibration_lead: Positive = 1.0  # [s] how old the forecasts that are checked are
    fresh: Positive = 0.3  # [s] a track older than this neither checks nor is checked
    evidence: EvidenceParameters = field(default_factory=EvidenceParameters)  # of the method of that name
