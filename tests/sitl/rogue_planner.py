"""`companion fly` with a planner that climbs, descends, and in mid-descent does what ROGUE says: run it as a program.

It flies blind: up to 3 m, then down at 0.3 m/s. Then
    garbage   floods the guardian with random bytes
    replay    floods it with its last sound frame
    wild      floods it with sound frames that want the absurd, with every order
    steady    goes on
"""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from companion.cli import fly
from companion.cli.main import main
from companion.guardian.handover import Handover, Order, Stage
from companion.guardian.handover_frame import encode
from companion.guardian.sampled import SampledTrajectory
from companion.messages.guardian import GuardianState
from companion.runtime.channel import GuardianPort

TOP, CLIMB, SINK = 3.0, 0.8, 0.3  # [m], [m/s]
MISBEHAVE_BELOW = 2.4  # [m]


class Rogue:
    """Climbs, then descends."""

    def __init__(self) -> None:
        self.start = None
        self.t_top = None
        self.low = False

    def handover(self, telemetry) -> Handover:
        orders, trajectory = set(), None
        if telemetry.state is GuardianState.MUTED:
            orders.add(Order.ENGAGE)
        elif not telemetry.vehicle.armed:
            orders.add(Order.ARM)
        if telemetry.states:
            self.here = telemetry.states[-1]
        if telemetry.vehicle.armed:
            trajectory = self._line(telemetry.t)
        return Handover(
            t=telemetry.t, stage=Stage.RUNNING, reason="rogue", trajectory=trajectory, orders=frozenset(orders)
        )

    def _line(self, t: float) -> SampledTrajectory:
        if self.start is None:
            self.start, self.t_start = self.here.position_ned.copy(), t
        t_top = self.t_start + TOP / CLIMB + 3.0
        rows = []
        for k in range(40):
            when = t + 0.02 * k
            up = min(CLIMB * (when - self.t_start), TOP)
            speed = -CLIMB if up < TOP else 0.0
            if when > t_top:
                up, speed = TOP - SINK * (when - t_top), SINK
            place = self.start - np.array([0.0, 0.0, up])
            rows.append([when, *place, 0.0, 0.0, speed, 0.0, 0.0, 0.0, self.here.yaw, 0.0])
        height = float(self.start[2] - self.here.position_ned[2])
        self.low = t > t_top and height < MISBEHAVE_BELOW
        return SampledTrajectory(samples=np.array(rows), t_expiry=t + 0.5, reset_counter=self.here.reset_counter)


def flood(kind: str, port: GuardianPort, handover: Handover, sequence: int) -> Iterator[bytes]:
    dice = np.random.default_rng(1)
    last = encode(handover, sequence)
    while True:
        if kind == "garbage":
            yield dice.bytes(int(dice.integers(1, 8000)))
        elif kind == "replay":
            yield last
        else:
            sequence += 1
            rows = dice.uniform(-1.0, 1.0, (2, 12)) * [0, *[9e5] * 3, *[1e3] * 3, *[1e3] * 3, 1e3, 1e3]
            rows[:, 0] = handover.t + np.array([0.0, 60.0])
            wild = SampledTrajectory(samples=rows, t_expiry=1e6, reset_counter=handover.trajectory.reset_counter)
            orders = frozenset({Order.ENGAGE, Order.ARM})
            yield encode(replace(handover, trajectory=wild, orders=orders), sequence)


def rogue_main(setup, end) -> None:
    kind = os.environ["ROGUE"]
    port, rogue, sequence = GuardianPort(end), Rogue(), 0
    port._send(encode(Handover(t=0.0, stage=Stage.WAITING, reason="rogue"), sequence))
    while not port.closed:
        select.select([end], [], [], 0.1)
        telemetry = port.receive()
        if telemetry is None:
            continue
        handover = rogue.handover(telemetry)
        sequence += 1
        if rogue.low and kind != "steady":
            sys.stderr.write("rogue: misbehaving\n")
            sys.stderr.flush()
            for frame in flood(kind, port, handover, sequence):
                port._send(frame)
                while port._receive(1 << 20) is not None:
                    pass
                if port.closed:
                    sys.exit(1)
        port._send(encode(handover, sequence))
    sys.exit(1)


if __name__ == "__main__":
    fly.planner_main = rogue_main
    sys.exit(main(sys.argv[1:]))
