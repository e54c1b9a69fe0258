"""Parameters of the preflight checks."""

from __future__ import annotations

from dataclasses import dataclass, field

from companion.preflight.autopilot_parameters import WantedParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class PreflightParameters:
    """What must be in order before a flight."""

    autopilot: WantedParameters = field(default_factory=WantedParameters)  # looked at before each arming
