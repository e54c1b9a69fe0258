"""What goes to people: over the autopilot, which forwards it, and to a ground station's own address where there is one.

The two receivers get the same messages with sequence numbers of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from companion.link.outgoing import Encoder
from companion.link.pilot_desk import PilotDesk, PilotParameters, custom_mode, mav_state
from companion.messages.decision import Mode
from companion.messages.pilot import LandingTarget, PilotText, Stand

_TICK = 1e-6  # [s] ticks that fall on a due time up to rounding count as there


class PilotLink:
    """Sends texts, numbers, heartbeats and landing targets.

    Args:
        parameters: rates.
        autopilot: builds datagrams for the autopilot.
        ground: builds datagrams for the ground station's own address; None: there is none.
    """

    def __init__(self, parameters: PilotParameters, autopilot: Encoder, ground: Encoder | None) -> None:
        self._p = parameters
        self._autopilot = autopilot
        self._ground = ground
        self._desk = PilotDesk(parameters, (autopilot,) if ground is None else (autopilot, ground))
        self._stand, self._mode = Stand.WAITING, Mode.PREFLIGHT
        self._for_ground: list[bytes] = []
        self._t_target = -math.inf

    def present(self, stand: Stand, mode: Mode) -> None:
        """Set what the next heartbeats say."""
        self._stand, self._mode = stand, mode

    def say(self, text: PilotText) -> None:
        """Tell a sentence."""
        self._desk.say(text)

    def show(self, values: Mapping[str, float]) -> None:
        """Give the numbers as they are now, by name of at most nine characters."""
        self._desk.show(values)

    def heartbeat(self) -> bytes:
        """Give the heartbeat that is due for the autopilot; the ground station's goes with it."""
        state, mode = mav_state(self._stand), custom_mode(self._stand, self._mode)
        if self._ground is not None:
            self._for_ground.append(self._ground.heartbeat(state, mode))
        return self._autopilot.heartbeat(state, mode)

    def poll(self, t: float, *, connected: bool, boot_time: float) -> list[bytes]:
        """Give what is due for the autopilot at `t` [s].

        Args:
            t: now [s].
            connected: the autopilot is there; without it, and without a ground station of its own, texts wait.
            boot_time: the autopilot's time now [s].
        """
        if not connected and self._ground is None:
            return []
        datagrams = self._desk.poll(t, int(boot_time * 1e3))
        self._for_ground += datagrams[1:]
        return list(datagrams[:1])

    def landing_target(self, target: LandingTarget, boot_time: float) -> list[bytes]:
        """Give the datagram of a landing target, empty where the last one is too recent.

        Args:
            target: where the pad was at capture.
            boot_time: the autopilot's time at capture [s].

        Raises:
            ValueError: a number is not finite.
        """
        if boot_time < 0.0 or target.t - self._t_target < 1.0 / self._p.target_rate - _TICK:
            return []
        self._t_target = target.t
        return [self._autopilot.landing_target(target, int(boot_time * 1e6))]

    def take_ground(self) -> list[bytes]:
        """Give the datagrams for the ground station's own address since the last call."""
        datagrams, self._for_ground = self._for_ground, []
        return datagrams
