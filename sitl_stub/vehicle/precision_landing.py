"""PX4's precision landing on LANDING_TARGET messages (navigator/precland.cpp, v1.17)."""

import math
from collections.abc import Mapping
from enum import Enum

from sitl_stub.truth import Vector
from sitl_stub.vehicle.estimator import Estimate

SETTLE_TIME = 2.0
"""So long [s] the vehicle must have been above the target before it comes down."""

LOST_TIME_LOW = 0.5
"""Near the ground a target unseen for so long [s] is not waited for: the vehicle lands."""


class Stage(Enum):
    """Where in the landing the vehicle is."""

    SEARCH = "search"
    APPROACH = "approach"
    DESCENT = "descent"
    FINAL = "final"
    FALLBACK = "fallback"
    """No target: an ordinary landing."""


class PrecisionLanding:
    """Holds the newest target, an absolute place in the local frame, and the stage of the landing."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self.stage = Stage.SEARCH
        self._target: Vector | None = None
        self._age = math.inf
        self._above_for = 0.0
        self._searched_for = 0.0
        self._searches = 0

    def target_arrived(self, target: Vector) -> None:
        """Take a target [m], local ned; it is used for PLD_BTOUT seconds."""
        self._target, self._age = target, 0.0

    def start(self) -> None:
        """Begin a landing."""
        self.stage = Stage.SEARCH
        self._searches = 0
        self._above_for = self._searched_for = 0.0

    def step(self, estimate: Estimate, dt: float) -> tuple[Vector | None, bool]:
        """Advance by `dt` [s]; returns where to be (None: where the vehicle is) and whether to come down."""
        self._age += dt
        seen = self._age < self._parameters["PLD_BTOUT"]
        if self.stage is Stage.SEARCH:
            self._search(seen, dt)
        elif self.stage is Stage.APPROACH:
            self._approach(estimate, seen, dt)
        elif self.stage is Stage.DESCENT:
            self._descend(estimate, seen)
        if self.stage in (Stage.SEARCH, Stage.FALLBACK):
            return None, self.stage is Stage.FALLBACK
        return self._target, self.stage is not Stage.APPROACH

    def _search(self, seen: bool, dt: float) -> None:
        self._searched_for += dt
        if seen:
            self.stage, self._above_for = Stage.APPROACH, 0.0
        elif self._searched_for > self._parameters["PLD_SRCH_TOUT"]:
            self.stage = Stage.FALLBACK

    def _approach(self, estimate: Estimate, seen: bool, dt: float) -> None:
        """Fly to where the target was seen last; there it must be in view."""
        if not self._above(estimate):
            self._above_for = 0.0
        elif not seen:
            self._lost()
        else:
            self._above_for += dt
            if self._above_for > SETTLE_TIME:
                self.stage = Stage.DESCENT

    def _descend(self, estimate: Estimate, seen: bool) -> None:
        target = self._target
        low = target is not None and target[2] - estimate.down < self._parameters["PLD_FAPPR_ALT"]
        if seen and (not low or self._age < LOST_TIME_LOW):
            return
        if seen and low:
            self.stage = Stage.FINAL
        else:
            self._lost()

    def _lost(self) -> None:
        self._searches += 1
        self._searched_for = 0.0
        self.stage = Stage.SEARCH if self._searches < self._parameters["PLD_MAX_SRCH"] else Stage.FALLBACK

    def _above(self, estimate: Estimate) -> bool:
        """Within PLD_HACC_RAD of the target along each axis."""
        radius, target = self._parameters["PLD_HACC_RAD"], self._target
        if target is None:
            return False
        return abs(target[0] - estimate.north) < radius and abs(target[1] - estimate.east) < radius
