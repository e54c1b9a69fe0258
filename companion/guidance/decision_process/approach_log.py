"""What is kept of an approach to learn from: the situations at which something was decided, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from companion.messages.docking import SwitchingSituation, SwitchingVerdict


class Action(IntEnum):
    """What a policy can do; the numbers are those of the model."""

    KEEP = 0  # the mode
    SWITCH = 1  # leave the mode
    SWITCH_NEAR = 2  # likewise, out of REORIENT: align as near as a curved way in allows
    AHEAD = 3  # keep APPROACH, and aim ahead from now on, at a point in front of the docking face

    @classmethod
    def of(cls, verdict: SwitchingVerdict) -> Action:
        """Give what a verdict asks for; `near` means something in REORIENT only, `ahead` in APPROACH."""
        if not verdict.switch:
            return cls.AHEAD if verdict.ahead else cls.KEEP
        return cls.SWITCH_NEAR if verdict.near else cls.SWITCH


@dataclass(frozen=True, slots=True, kw_only=True)
class Epoch:
    """One decision and what it cost until the next one, or until the end."""

    situation: SwitchingSituation
    action: Action
    elapsed: float  # [s]
    impulse: float  # [N s] given by the nozzles


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedApproach:
    """One approach from its first decision to its end."""

    seed: int
    epochs: tuple[Epoch, ...]  # in their order; the last one's costs run to the end
    docked: bool  # False: a miss, whatever kind
    # (position error / what counts as docked)^2 + (attitude error / likewise)^2 at contact; 0 for a miss, which is
    inaccuracy: float = 0.0  # priced by itself


@dataclass(slots=True)
class _Open:
    t: float
    situation: SwitchingSituation
    action: Action
    impulse: float


class ApproachRecorder:
    """Cuts an approach into epochs: each 0.025 m of range, or 2 s, and at every action but keep.

    A decision is made at every step of the guidance; neighbouring ones are alike, and one epoch stands for them. An
    epoch by range alone would never end where the chaser waits for its turn.
    """

    def __init__(self, *, range_step: float = 0.025, time_step: float = 2.0) -> None:
        """`range_step`: [m], `time_step`: [s]."""
        self._range_step, self._time_step = range_step, time_step
        self._open: _Open | None = None
        self._epochs: list[Epoch] = []

    def observe(self, t: float, situation: SwitchingSituation, *, action: Action, impulse: float) -> None:
        """Take in one step at which the policy was asked.

        Args:
            t: [s].
            situation: what it was asked about.
            action: what was done.
            impulse: [N s] given by the nozzles since the start of the flight.
        """
        last = self._open
        if last is not None and action is Action.KEEP:
            nearer = last.situation.range - situation.range >= self._range_step
            other = situation.mode is not last.situation.mode
            if not (nearer or other or t - last.t >= self._time_step):
                return
        self._close(t, impulse)
        self._open = _Open(t, situation, action, impulse)

    def finish(self, t: float, *, seed: int, docked: bool, impulse: float, inaccuracy: float = 0.0) -> LoggedApproach:
        """Close the log at the end of the flight; arguments as in `observe` and `LoggedApproach`.

        Raises:
            ValueError: nothing was observed.
        """
        if self._open is None:
            raise ValueError(f"the approach of seed {seed} has no decision: log it from its first step on")
        self._close(t, impulse)
        self._open = None
        return LoggedApproach(seed=seed, epochs=tuple(self._epochs), docked=docked, inaccuracy=inaccuracy)

    def _close(self, t: float, impulse: float) -> None:
        if self._open is not None:
            o = self._open
            self._epochs.append(
                Epoch(situation=o.situation, action=o.action, elapsed=t - o.t, impulse=impulse - o.impulse)
            )
