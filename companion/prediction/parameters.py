"""Parameters of the predictors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt

Positive = Annotated[float, Gt(0.0)]
NotNegative = Annotated[float, Ge(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class EvidenceParameters:
    """Tuning of the method `evidence`."""

    spacing: Positive = 0.25  # [s] between the track states that are kept
    samples: Annotated[int, Ge(8)] = 60  # of them
    span: Positive = 60.0  # [s] how far back they may reach, dropouts included
    part: Positive = 0.02  # [s] from one of the seven parts of weighing a state to the next; all are done with the next
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
class WindingParameters:
    """A target that drives along its heading and winds about regularly."""

    spacing: Positive = 0.25  # [s] between the headings that are regressed
    period_least: Positive = 4.0  # [s]
    period_most: Positive = 60.0  # [s]
    periods: Annotated[int, Ge(2)] = 200  # between the two, their frequencies equally far apart
    harmonics: Annotated[int, Ge(1), Le(8)] = 3
    memory: Positive = 45.0  # [s] time constant of the forgetting
    begun: Positive = 0.4  # [m] from where it was first seen, or
    begun_turn: Positive = 0.05  # [rad] turned from there, it has set off: before, its heading does not count
    deviation: Positive = 0.03  # [rad] of a heading from the sines
    heading: Positive = 3.0  # [rad] prior of the mean heading,
    size: Positive = 0.6  # [rad] of the first harmonic,
    size_overtone: Positive = 0.1  # [rad] of the others
    step: Positive = 0.1  # [s] of the course that is kept,
    back: Positive = 1.5  # [s] from so long ago
    ahead: Positive = 12.0  # [s] to so far ahead
    lead: Positive = 3.0  # [s] how far ahead the forecasts are compared,
    patience: Positive = 5.0  # [s] over how long,
    judged_least: Annotated[int, Ge(1)] = 8  # and how many of them at least
    floor: Positive = 0.05  # [rad] what they may miss by without a choice between them
    share_least: Annotated[float, Gt(0.0), Lt(1.0)] = 0.02  # a smaller share of the winding is none
    recent: Positive = 1.0  # [s] over which the heading must have gone as expected,
    surprise: Positive = 0.08  # [rad] to about so much


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictorParameters:
    """Tuning of the predictor."""

    # none: the target stays where it was last seen, for comparisons
    # winding: evidence, for a target that drives along its heading and may wind about regularly
    method: Literal["evidence", "winding", "regularised", "paper", "none"] = "evidence"
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
    winding: WindingParameters = field(default_factory=WindingParameters)  # of the method of that name
