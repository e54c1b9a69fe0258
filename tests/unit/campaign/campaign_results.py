"""A flight's result, for tests of what is made of it."""

from __future__ import annotations

from typing import Any

from companion.campaign.result import FlightResult, Outcome


def made_result(seed: int, *, success: bool = True, **changed: Any) -> FlightResult:
    """Give the result of a landing that went well, or not; `changed` are fields with other values."""
    fields: dict[str, Any] = {
        "position_error_m": 0.02,
        "angular_error_rad": 0.001,
        "station_keeping": None,
        "duration_s": 40.0,
        "touchdown_speed_mps": 0.3,
        "mode_history": (),
        "limits_violated": (),
        "tracking_gap_s": 0.1,
        "wall_s": 1.0,
    }
    return FlightResult(
        outcome=Outcome.LANDED if success else Outcome.FAILED,
        success=success,
        reason="as told",
        seed=seed,
        **(fields | changed),
    )
