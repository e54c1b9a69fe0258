"""Nozzles behind on/off valves: pulses as commanded, late by the valve's delay, as strong as the vehicle was built.

An opening's impulse is thrust times on-time, exactly: the integration stops at every edge.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass

from sitl_stub.cubesat.vehicle import PropulsionFile
from sitl_stub.truth import Vector

SAME_TIME = 1e-9
"""Times [s] nearer than this are one."""
SHUT: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltNozzle:
    """One nozzle as it really is."""

    thrust: float
    """[N]"""
    force: Vector
    """On the body [N], in d."""
    torque: Vector
    """About the true centre of mass [N m], in d."""


class Nozzles:
    """Which valves are open, and what that does to the body.

    `force` [N] and `torque` [N m] are in d, `thrust` [N] is the sum over the open nozzles, `next_edge` [s] the next
    time at which they change, `openings` how often a valve went from shut to open.
    """

    __slots__ = (
        "_busy_until",
        "_edges",
        "_nozzles",
        "_open",
        "_propulsion",
        "force",
        "next_edge",
        "openings",
        "thrust",
        "torque",
    )

    def __init__(self, propulsion: PropulsionFile, nozzles: Sequence[BuiltNozzle]) -> None:
        self._propulsion = propulsion
        self._nozzles = tuple(nozzles)
        self._edges: list[tuple[float, int, bool]] = []
        self._open: frozenset[int] = frozenset()
        self._busy_until = -math.inf
        self.openings = 0
        self.next_edge = math.inf
        self.force = self.torque = SHUT
        self.thrust = 0.0

    def command(self, t: float, on_times: Sequence[float]) -> None:
        """Take the openings of the control period that begins at `t` [s].

        Args:
            t: now; a control period or more after the last command.
            on_times: of each nozzle [s], 0 to the control period; shorter than the least on-time: it stays shut.

        Raises:
            ValueError: a number of nozzles, an on-time or a time that cannot be.
        """
        parameters = self._propulsion
        if len(on_times) != len(self._nozzles):
            raise ValueError(f"{len(on_times)} on-times for {len(self._nozzles)} nozzles")
        if t < self._busy_until - SAME_TIME:
            raise ValueError(f"command at {t:.6f} s, inside the control period that ends at {self._busy_until:.6f} s")
        for number, on_time in enumerate(on_times):
            if not 0.0 <= on_time <= parameters.period + SAME_TIME:
                raise ValueError(f"on-time {on_time!r} s of nozzle {number}: must be 0 to {parameters.period:g} s")
        self._busy_until = t + parameters.period
        opens = t + parameters.valve_delay
        for number, on_time in enumerate(on_times):
            if on_time >= parameters.on_time_min - SAME_TIME:
                insort(self._edges, (opens, number, True))
                insort(self._edges, (opens + on_time, number, False))
        self.next_edge = self._edges[0][0] if self._edges else math.inf

    def switch(self, t: float) -> None:
        """Open and shut what is due at `t` [s]; one that shuts and opens at once stays open."""
        due = [edge for edge in self._edges if edge[0] <= t + SAME_TIME]
        if not due:
            return
        self._edges = self._edges[len(due) :]
        shut = {number for _, number, opens in due if not opens}
        before, self._open = self._open, (self._open - shut) | {number for _, number, opens in due if opens}
        self.openings += len(self._open - before)
        self._sum()

    def stop(self) -> None:
        """Shut all valves and forget what was commanded."""
        self._edges, self._open = [], frozenset()
        self._sum()

    def _sum(self) -> None:
        self.next_edge = self._edges[0][0] if self._edges else math.inf
        fx = fy = fz = tx = ty = tz = thrust = 0.0
        for number in sorted(self._open):
            nozzle = self._nozzles[number]
            thrust += nozzle.thrust
            fx, fy, fz = fx + nozzle.force[0], fy + nozzle.force[1], fz + nozzle.force[2]
            tx, ty, tz = tx + nozzle.torque[0], ty + nozzle.torque[1], tz + nozzle.torque[2]
        self.force, self.torque, self.thrust = (fx, fy, fz), (tx, ty, tz), thrust
