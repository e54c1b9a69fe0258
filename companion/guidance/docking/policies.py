"""When to begin to turn, and when to move in front of the docking face: policies with one interface."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Protocol

from annotated_types import Gt

from companion.guidance.docking.parameters import MarkovSwitchingParameters
from companion.guidance.switching_chain import approach_kept, reorient_again, reorient_kept, steady_state_align
from companion.messages.decision import TransitionProbabilities
from companion.messages.docking import DockingMode, SwitchingSituation, SwitchingVerdict

COMES_TO_REST = SwitchingVerdict(switch=False, reason="comes to rest in front of the docking face first")
"""The answer in ALIGN of policies that know nothing of going on without a stop."""


class SwitchingPolicy(Protocol):
    """Decides by one situation alone; holds no state."""

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        """Say whether to leave the mode, and why."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedDistances:
    """Switch at set ranges: the paper's baseline."""

    reorient_range: Annotated[float, Gt(0.0)] = 0.8  # [m] r2 (Parikh et al., table II)
    align_range: Annotated[float, Gt(0.0)] = 0.3  # [m] r1

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        """Say whether the mode's range is reached; in front of the docking face it always comes to rest."""
        if situation.mode is DockingMode.ALIGN:
            return COMES_TO_REST
        limit = self.reorient_range if situation.mode is DockingMode.APPROACH else self.align_range
        switch = situation.range <= limit
        return SwitchingVerdict(
            switch=switch, reason=f"range {situation.range:.3f} m {'<=' if switch else '>'} {limit:.3f} m"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkovSwitching:
    """Switch by the probabilities of a Markov chain: Parikh et al., Algorithm 1, as printed.

    The printed loop runs while r <= r_t and r > r1. Above r2 it asks A11; below, the steady state. So at the first
    value of r2 the chaser turns whatever A11 is, and at the first value of r1 it aligns whatever the steady state is.
    """

    parameters: MarkovSwitchingParameters = field(default_factory=MarkovSwitchingParameters)

    def decide(self, situation: SwitchingSituation) -> SwitchingVerdict:
        """Say whether the probabilities, or the algorithm's first distances, ask for the next mode."""
        p, s = self.parameters, situation
        if s.mode is DockingMode.ALIGN:
            return COMES_TO_REST
        if s.range > p.activation_range:
            return SwitchingVerdict(
                switch=False, reason=f"range {s.range:.3f} m > r_t = {p.activation_range:.3f} m: not asked yet"
            )
        numbers = self._probabilities(s)
        if s.mode is DockingMode.APPROACH:
            name, number, threshold = "A11", numbers.a11, p.keep_approach_threshold
            first, floor = "r2", p.reorient_floor
        else:
            name, number, threshold = "P(align)", numbers.steady_align, p.align_threshold
            first, floor = "r1", p.align_floor
        if s.range <= floor:
            reason = f"range {s.range:.3f} m <= {first} = {floor:.3f} m"
            return SwitchingVerdict(switch=True, reason=reason, probabilities=numbers)
        switch = number <= threshold
        reason = (
            f"{name} = {number:.3f} {'<=' if switch else '>'} {threshold:.2f} at range {s.range:.3f} m, "
            f"d {s.mahalanobis:.2f}, misalignment {s.misalignment:.2f}, "
            f"position known to {1000.0 * s.position_std:.1f} mm"
        )
        return SwitchingVerdict(switch=switch, reason=reason, probabilities=numbers)

    def _probabilities(self, s: SwitchingSituation) -> TransitionProbabilities:
        p = self.parameters
        reorient_range = p.reorient_floor if s.reorient_range is None else s.reorient_range
        a22 = reorient_kept(distance=s.range, reorient_range=reorient_range, inconsistency=s.mahalanobis)
        a32 = reorient_again(
            distance=s.range,
            reorient_range=reorient_range,
            docked_range=p.docked_range,
            position_std=s.position_std,
            coarse_std=p.coarse_std,
        )
        a11 = approach_kept(
            distance=s.range,
            activation_range=p.activation_range,
            inconsistency=s.mahalanobis,
            misalignment=s.misalignment,
        )
        return TransitionProbabilities(a11=a11, a22=a22, a32=a32, steady_align=steady_state_align(a22, a32))
