"""A helm with a fake autopilot on its wire, for the tests: virtual time, real bytes."""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import common as mavlink

from companion.guardian.guardian import Guardian
from companion.guardian.handover import Handover, Order, Stage
from companion.guardian.holonomic import HolonomicShaper
from companion.guardian.parameters import GuardianParameters
from companion.link.autopilot_link import AutopilotLink
from companion.link.event_names import event_id
from companion.link.parameters import LinkParameters
from companion.messages.motion import MotionState
from companion.messages.operator import OperatorOrder
from companion.runtime.guardian_announcer import GuardianAnnouncer
from companion.runtime.helm import Helm, HelmParameters
from companion.vehicles.multicopter import Multicopter

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "link"))
from link_fake_autopilot import OFFBOARD, FakeAutopilot, event_frame, raw_frame

TICK = 0.02
SETPOINT, COMMAND_LONG = 84, 76  # message ids
POSITION = (0.0, 0.0, -3.0)


class Path_:
    """A slow line to the north."""

    t_start, t_end, reset_counter = -1e3, 1e6, 11

    def __init__(self, t_expiry: float) -> None:
        self.t_expiry = t_expiry

    def at(self, t: float) -> MotionState:
        zero = np.zeros(3)
        return MotionState(
            position_ned=np.array(POSITION), velocity_ned=zero, acceleration_ned=zero, yaw=0.0, yaw_rate=0.0
        )


class Rig:
    """Ticks a helm; the planner hands over in each tick what `orders`, `stage` and `planning` say."""

    def __init__(self, *, auto: bool = False, armed: bool = True, landing_targets: bool = False) -> None:
        self.helm = Helm(
            link=AutopilotLink(LinkParameters()),
            guardian=Guardian(GuardianParameters(), HolonomicShaper(Multicopter().limits)),
            parameters=HelmParameters(auto_engage=auto, landing_targets=landing_targets),
            announcer=GuardianAnnouncer(gear_height=0.2),
        )
        self.autopilot = FakeAutopilot()
        self.autopilot.armed = armed
        self.landed = 2 if armed else 1
        self.system_status = 4
        self.t = 200.0
        self.count = 0
        self.extra: list[tuple[float, bytes]] = []  # further datagrams with their arrival
        self.orders: frozenset[Order] = frozenset()
        self.stage = Stage.STANDBY
        self.more: dict = {}  # further fields of the handover
        self.planning = True  # the planner is there
        self.streaming = True  # odometry comes
        self.sent: list[tuple[float, bytes]] = []  # what the helm has sent

    def heartbeat(self) -> bytes:
        base = 29 | (128 if self.autopilot.armed else 0)
        message = mavlink.MAVLink_heartbeat_message(2, 12, base, self.autopilot.mode, self.system_status, 3)
        return self.autopilot.pack(message)

    def _telemetry(self, t: float) -> list[bytes]:
        autopilot = self.autopilot
        out = [autopilot.odometry(t, position=POSITION, velocity=(0.0, 0.0, 0.0))] if self.streaming else []
        if self.count % 50 == 0:
            out.append(self.heartbeat())
        if self.count % 10 == 0:
            out += [autopilot.estimator(), autopilot.current_mode()]
        if self.count % 3 == 0:
            out.append(autopilot.pack(mavlink.MAVLink_extended_sys_state_message(0, self.landed)))
        return out

    def tick(self, dt: float = TICK) -> None:
        before, self.t = self.t, self.t + dt
        datagrams = [(self.t - 0.002, data) for data in self._telemetry(self.t - 0.003)]
        datagrams += [(t, data) for t, data in self.extra if t <= self.t]
        self.extra = [(t, data) for t, data in self.extra if t > self.t]
        self.count += 1
        self.telemetry = self.helm.receive(self.t, sorted(datagrams, key=lambda pair: pair[0]))
        handover = None
        if self.planning:
            trajectory = Path_(self.t + 0.5) if self.stage is Stage.RUNNING else None
            handover = Handover(
                t=self.t, stage=self.stage, reason="", trajectory=trajectory, orders=self.orders, **self.more
            )
        self.output = self.helm.tick(self.t, handover)
        self.sent += [(self.t, data) for data in self.output.datagrams]
        asked = [data for data in self.output.datagrams if data[7] != SETPOINT]
        self.extra += [(self.t + 0.001, data) for data in self.autopilot.hear(asked, self.t)]
        assert before < self.t

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            self.tick()

    def engaged(self, seconds: float = 1.5) -> Rig:
        """Bring it to OFFBOARD by the operator's word."""
        self.run(1.5)
        assert self.helm.order(OperatorOrder.ENGAGE).accepted, self.helm.order(OperatorOrder.ENGAGE).text
        self.stage, self.orders = Stage.RUNNING, frozenset({Order.ENGAGE})
        self.tick()
        self.orders = frozenset()
        self.run(seconds)
        return self

    @property
    def setpoints(self) -> list[float]:
        """When setpoints were sent."""
        return [t for t, data in self.sent if data[7] == SETPOINT]

    @property
    def commands(self) -> list[tuple[float, int, float]]:
        """When which command was sent, with its second parameter."""
        found = []
        for t, data in self.sent:
            if data[7] == COMMAND_LONG:
                (message,) = mavlink.MAVLink(None).parse_buffer(data)
                found.append((t, message.command, message.param2))
        return found

    def sent_messages(self, kind: str) -> list:
        """Give the messages of one kind that were sent, decoded."""
        parsed = [mavlink.MAVLink(None).parse_buffer(data)[0] for _, data in self.sent]
        return [message for message in parsed if message.get_type() == kind]

    @property
    def texts(self) -> list[str]:
        """What people were told."""
        return [message.text for message in self.sent_messages("STATUSTEXT")]

    def asked(self) -> list[int]:
        """Give the commands that change mode or arm."""
        return [command for _, command, _ in self.commands if command in (176, 400)]


def rc_channels(*channels: int) -> bytes:
    raw = (*channels, *(0xFFFF,) * (18 - len(channels)))
    return raw_frame(65, struct.pack("<I18HBB", 1, *raw, len(channels), 255), 118)


def manual_control(pitch: int, roll: int, throttle: int, yaw: int) -> bytes:
    return raw_frame(69, struct.pack("<4hHB", pitch, roll, throttle, yaw, 0, 1), 243)


def alarm(name: str) -> bytes:
    return event_frame(event_id(name), log_level=2)


__all__ = ["OFFBOARD", "POSITION", "TICK", "Rig", "alarm", "manual_control", "raw_frame", "rc_channels"]
