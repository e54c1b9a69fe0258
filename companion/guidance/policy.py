"""What decides the mode of a mission and says where to go: one for vehicles in the air, one for those on the ground."""

from __future__ import annotations

from typing import Protocol

from companion.geometry.arrays import Array
from companion.guidance.goals import Goal
from companion.guidance.view import View
from companion.messages.decision import Decision, Mode


class Policy(Protocol):
    """Holds the mode between steps; `update` decides, `goal` says where to go."""

    @property
    def mode(self) -> Mode:
        """The present mode."""

    @property
    def wants_return(self) -> bool:
        """Whether the autopilot is to be asked for Return instead of Hold."""

    @property
    def wants_precision_landing(self) -> bool:
        """Whether the autopilot is to be asked for its precision landing instead of Hold."""

    def rebase(self, translation_ned: Array, yaw: float, pivot_ned: Array) -> None:
        """Follow a reset of the autopilot's estimator.

        Args:
            translation_ned: jump of the position (3,) [m].
            yaw: jump of the heading [rad].
            pivot_ned: position before the jump (3,) [m], about which the heading turns.
        """

    def update(self, view: View) -> Decision:
        """Decide the mode of this step."""

    def restart(self) -> None:
        """Begin anew, as the operator engages again."""

    def goal(self, view: View, dt: float) -> Goal | None:
        """Give the goal of the present mode, None where nothing is to be done.

        Args:
            view: of this step.
            dt: time since the last call [s].
        """
