"""The predictors behind one interface."""

from __future__ import annotations

from typing import Protocol

from companion.estimation.ownship import OwnshipReset
from companion.messages.target import Prediction, TargetTrack
from companion.prediction.evidence import EvidencePredictor
from companion.prediction.parameters import PredictorParameters
from companion.prediction.polynomial import PolynomialPredictor
from companion.prediction.standing import StandingPredictor
from companion.prediction.winding_forecast import WindingPredictor


class Predictor(Protocol):
    """Keeps what it needs of the track, in the autopilot's local frame, and extrapolates it."""

    def reset(self) -> None:
        """Forget everything."""

    def rebase(self, reset: OwnshipReset) -> None:
        """Follow a reset of the autopilot's estimator."""

    def add(self, track: TargetTrack) -> None:
        """Append a state of the track; one that is not newer is ignored."""

    def predict(self) -> Prediction | None:
        """Give the forecast from the newest state; None before the first."""


def make_predictor(parameters: PredictorParameters) -> Predictor:
    """Make the predictor that `method` names."""
    if parameters.method == "none":
        return StandingPredictor(parameters)
    if parameters.method == "evidence":
        return EvidencePredictor(parameters)
    if parameters.method == "winding":
        return WindingPredictor(parameters)
    return PolynomialPredictor(parameters)
