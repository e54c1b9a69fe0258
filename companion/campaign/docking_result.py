"""What one docking came to."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from companion.campaign.result import Outcome
from companion.messages.docking import DockingMode, DockingSwitch
from companion.recording import to_plain


@dataclass(frozen=True, slots=True, kw_only=True)
class DockingResult:
    """The figures of one docking, against the truth."""

    outcome: Outcome  # docked, held (given up, clear of the target) or failed
    success: bool  # in contact within the world's limits
    reason: str  # one plain sentence
    policy: str
    position_error_m: float | None  # distance from the docked pose at the contact; None: no contact
    angular_error_rad: float | None  # at the contact
    closing_speed_mps: float | None  # at the contact
    lateral_speed_mps: float | None  # at the contact
    duration_s: float  # from the start until the contact, or until the mission ended
    impulse_ns: float  # of all nozzles until then
    reorient_range_m: float | None  # r2, estimated, as the policy saw it
    align_range_m: float | None  # r1 of the first attempt
    attempts: int  # runs at the docking face, the last one included
    outliers: int  # ranges until then that were outliers,
    outliers_rejected: int  # those of them that the gate rejected,
    ranges: int  # ranges that the gate was asked about and that were no outliers,
    ranges_rejected: int  # those of them that it rejected all the same
    mode_history: tuple[DockingSwitch, ...]
    wall_s: float  # time on the wall that it took to simulate
    seed: int

    def as_json(self, *, with_wall: bool = True) -> dict[str, Any]:
        """Give plain values.

        Args:
            with_wall: keep `wall_s`; without it equal seeds give equal values, as a recording needs them.
        """
        plain: dict[str, Any] = to_plain(self)
        if not with_wall:
            del plain["wall_s"]
        return plain

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> DockingResult:
        """Read what `as_json` gave.

        Raises:
            KeyError, TypeError, ValueError: it is something else.
        """
        values = {field.name: data[field.name] for field in dataclasses.fields(cls)}
        values["outcome"] = Outcome(values["outcome"])
        values["mode_history"] = tuple(
            DockingSwitch(**{**switch, "mode": DockingMode(switch["mode"])}) for switch in values["mode_history"]
        )
        return cls(**values)
