"""Modes, arming and failsafes: what PX4's commander decides. Knows nothing of MAVLink's bytes."""

import math
from collections.abc import Mapping
from enum import IntEnum

from sitl_stub.vehicle import notices
from sitl_stub.vehicle.faults import HealthProblem
from sitl_stub.vehicle.modes import AUTO, NEEDS_STICKS, NO_ARMING, TITLES, Mode
from sitl_stub.vehicle.navigator import Sticks
from sitl_stub.vehicle.notices import ERROR, PROTOCOL, WARNING, Event, Notice

STICK_FILTER_TIME = 0.1
"""Time constant [s] behind which the sticks' speed is judged."""


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class SystemStatus(IntEnum):
    """MAV_STATE as PX4 uses it."""

    UNINITIALISED = 0
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    TERMINATION = 8


OFFBOARD_LOSS_ACTIONS = {
    0: Mode.POSCTL,
    1: Mode.ALTCTL,
    2: Mode.MANUAL,
    3: Mode.AUTO_RTL,
    4: Mode.AUTO_LAND,
    5: Mode.AUTO_LOITER,
    6: Mode.TERMINATION,
}
"""COM_OBL_RC_ACT."""
STICK_LOSS_ACTIONS = {1: Mode.AUTO_LOITER, 2: Mode.AUTO_RTL, 3: Mode.AUTO_LAND, 5: Mode.TERMINATION}
"""NAV_RCL_ACT."""
BY_COMMAND, BY_LANDING, BY_PREFLIGHT_TIMEOUT = 4, 6, 7
FORCE = 21196.0
"""Second parameter of a forced disarm."""


class Commander:
    """State of the autopilot's decisions; `step` once per physics step."""

    def __init__(self, parameters: Mapping[str, float], problem: HealthProblem | None) -> None:
        self._parameters = parameters
        self.problem = problem
        self.t = 0.0
        self.armed = False
        self.intended = Mode.AUTO_LOITER
        """The mode the user asked for."""
        self.mode = Mode.AUTO_LOITER
        """The mode in force; differs from `intended` in a failsafe."""
        self.failsafe = False
        self.notices: list[Notice] = []
        self.sticks = Sticks()
        self.landed = True
        self._after_disarm = Mode.AUTO_LOITER
        self._setpoint_time = -math.inf
        self._sticks_time = -math.inf
        self._stick_speed = 0.0
        self._sticks_at_arming = False
        self._sticks_lost_since = math.inf
        self._stick_failsafe = False
        self._mode_chosen = False
        self._armed_since = 0.0
        self._has_flown = False
        self._landed_since = 0.0
        self._reported: tuple[int, ...] = ()

    # what the vehicle can do now

    @property
    def offboard_signal(self) -> bool:
        """Whether setpoints arrive (COM_OF_LOSS_T)."""
        return self.t - self._setpoint_time < self._parameters["COM_OF_LOSS_T"]

    @property
    def sticks_alive(self) -> bool:
        """Whether stick positions arrive (COM_RC_LOSS_T)."""
        return self.t - self._sticks_time < self._parameters["COM_RC_LOSS_T"]

    def can_run(self, mode: Mode) -> bool:
        """Whether the mode's needs are met."""
        if mode is Mode.OFFBOARD:
            return self.offboard_signal
        if mode in NEEDS_STICKS:
            return self.sticks_alive
        return mode is not Mode.AUTO_MISSION

    @property
    def can_arm(self) -> bool:
        """Whether arming would be accepted in the mode in force."""
        return not self._health_problems(self.intended)

    @property
    def system_status(self) -> SystemStatus:
        """MAV_STATE of HEARTBEAT."""
        if self.mode is Mode.TERMINATION:
            return SystemStatus.TERMINATION
        if self.armed:
            return SystemStatus.CRITICAL if self.failsafe else SystemStatus.ACTIVE
        return SystemStatus.STANDBY if self.can_arm else SystemStatus.UNINITIALISED

    def _health_problems(self, mode: Mode) -> list[Event]:
        """Events that speak against arming in `mode`."""
        problems = []
        if self.problem is not None:
            problems.append(self.problem.event)
        if mode is Mode.TERMINATION:
            problems.append(_check(29532170, "ffffffff14", notices.CRITICAL))
        elif mode is Mode.OFFBOARD and not self.offboard_signal:
            problems.append(_check(19865031, "0040000014", ERROR))
        elif mode in NEEDS_STICKS and not self.sticks_alive:
            problems.append(_check(17231145, "ffffffff07", WARNING))
        elif mode is Mode.AUTO_MISSION:
            problems.append(_check(17154777, "0800000014", notices.INFO))
        elif mode in NO_ARMING:
            problems.append(_check(18648929, "20303c0014", notices.INFO))
        return problems

    def report_health(self) -> None:
        """Send the arming checks as events: a summary, each problem, and a health summary."""
        problems = self._health_problems(self.intended)
        state = int(self.can_arm)
        summary = bytes.fromhex("000000100080000000b03a7f80b03a7f80" if state else "000000120180000000802a0180803a0180")
        health = bytes.fromhex("000a1c0238" if state else "00020c0238")
        events = [
            Event(number=27825120, level=PROTOCOL, internal=PROTOCOL, arguments=summary),
            *problems,
            Event(number=18691879, level=PROTOCOL, internal=PROTOCOL, arguments=health),
        ]
        self.notices.extend(Notice(event=event) for event in events)
        if self.problem is not None:
            self.notices.append(Notice(severity=notices.CRITICAL, text=self.problem.text))

    # what others ask for

    def setpoint_arrived(self) -> None:
        """An offboard setpoint that counts has come."""
        self._setpoint_time = self.t

    def sticks_arrived(self, sticks: Sticks) -> None:
        """Stick positions have come."""
        elapsed = max(self.t - self._sticks_time, 1e-3)
        if elapsed < self._parameters["COM_RC_LOSS_T"]:
            old = self.sticks
            moved = max(abs(sticks.forward - old.forward), abs(sticks.right - old.right), abs(sticks.yaw - old.yaw))
            share = elapsed / (elapsed + STICK_FILTER_TIME)
            self._stick_speed += (moved / elapsed - self._stick_speed) * share
        else:
            self._stick_speed = 0.0
        self.sticks = sticks
        self._sticks_time = self.t
        if not self.armed and not self._mode_chosen:
            self._intend(Mode.POSCTL)  # PX4's first mode with sticks
        self._take_over_by_sticks()

    def _take_over_by_sticks(self) -> None:
        allowed = int(self._parameters["COM_RC_OVERRIDE"])
        automatic = self.mode in AUTO and allowed & 1
        offboard = self.mode is Mode.OFFBOARD and allowed & 2
        fast = self._stick_speed > 0.01 * self._parameters["COM_RC_STICK_OV"]
        if self.armed and fast and (automatic or offboard) and not self._stick_failsafe:
            self._intend(Mode.POSCTL)
            self.notices.append(notices.STICKS_TOOK_OVER)

    def request_mode(self, mode: Mode) -> Result:
        """A user asks for a mode. Disarmed all are taken; in the air only those that can run."""
        if self.mode is Mode.TERMINATION:
            return Result.TEMPORARILY_REJECTED
        if self.armed and not self.can_run(mode):
            self.notices.append(notices.mode_not_available(TITLES[mode], mode.navigation_state))
            return Result.TEMPORARILY_REJECTED
        self._intend(mode)
        return Result.ACCEPTED

    def _intend(self, mode: Mode) -> None:
        self.intended = mode
        self._mode_chosen = True
        self._stick_failsafe = False
        if mode not in NO_ARMING and mode is not Mode.AUTO_TAKEOFF:
            self._after_disarm = mode

    def request_arm(self) -> Result:
        """Arm; refused while any check fails (no magic number gets around that)."""
        if self.armed:
            return Result.ACCEPTED
        if not self.can_arm:
            self.notices.append(notices.ARM_DENIED)
            return Result.TEMPORARILY_REJECTED
        self.armed = True
        self._armed_since = self.t
        self._has_flown = False
        self._sticks_at_arming = self.sticks_alive
        self.notices.append(notices.armed_by(BY_COMMAND))
        return Result.ACCEPTED

    def request_disarm(self, *, force: bool) -> Result:
        """Disarm; in the air only by force."""
        if not self.armed:
            return Result.ACCEPTED
        if not self.landed and not force:
            self.notices.append(notices.DISARM_DENIED)
            return Result.TEMPORARILY_REJECTED
        self._disarm(BY_COMMAND)
        return Result.ACCEPTED

    def request_termination(self) -> Result:
        """Kill: the motors stop; there is no way back but a reboot."""
        self.intended = Mode.TERMINATION
        self._after_disarm = Mode.TERMINATION
        return Result.ACCEPTED

    def _disarm(self, reason: int) -> None:
        self.armed = False
        self.failsafe = False
        self._stick_failsafe = False
        self.intended = self._after_disarm
        self.notices.append(notices.disarmed_by(reason))

    # what happens by itself

    def step(self, t: float, *, landed: bool) -> None:
        """Advance to `t` [s]; `landed` from the land detector."""
        self.t = t
        self._watch_landing(landed)
        before, was_failsafe = self.mode, self.failsafe
        self.mode, self.failsafe = self._choose_mode()
        if self.failsafe and (not was_failsafe or self.mode is not before):
            self.notices.append(notices.failsafe_to(self.mode.navigation_state))
        problems = tuple(event.number for event in self._health_problems(self.intended))
        if problems != self._reported:
            self._reported = problems
            self.report_health()

    def _watch_landing(self, landed: bool) -> None:
        if landed and not self.landed:
            self._landed_since = self.t
            if self.armed:
                self.notices.append(notices.LANDING_DETECTED)
        elif not landed and self.landed:
            self._has_flown = True
            self.notices.append(notices.TAKEOFF_DETECTED)
        self.landed = landed
        if not (self.armed and landed):
            return
        wait = self._parameters["COM_DISARM_LAND"]
        if self._has_flown and wait > 0.0 and self.t - self._landed_since >= wait:
            self._disarm(BY_LANDING)
        wait = self._parameters["COM_DISARM_PRFLT"]
        if self.armed and not self._has_flown and wait > 0.0 and self.t - self._armed_since >= wait:
            self._disarm(BY_PREFLIGHT_TIMEOUT)

    def _choose_mode(self) -> tuple[Mode, bool]:
        """The mode in force, and whether a failsafe put it there. Loss of setpoints ends by itself when they return."""
        intended = self.intended
        if not self.armed or intended is Mode.TERMINATION:
            return intended, intended is Mode.TERMINATION and self.armed
        by_sticks = self._stick_loss()
        if by_sticks is not None:
            return by_sticks, True
        if self.can_run(intended):
            return intended, False
        if intended is Mode.OFFBOARD:
            action = OFFBOARD_LOSS_ACTIONS.get(int(self._parameters["COM_OBL_RC_ACT"]), Mode.AUTO_RTL)
            return (action if self.can_run(action) else Mode.AUTO_RTL), True
        return Mode.AUTO_RTL, True

    def _stick_loss(self) -> Mode | None:
        """Failsafe of lost sticks: Hold for COM_FAIL_ACT_T, then NAV_RCL_ACT; sticks that return do not end it."""
        action = STICK_LOSS_ACTIONS.get(int(self._parameters["NAV_RCL_ACT"]))
        if action is None or not self._sticks_at_arming:
            return None
        if not self.sticks_alive and not self._stick_failsafe:
            self._stick_failsafe = True
            self._sticks_lost_since = self.t
            self.notices.append(notices.STICKS_LOST)
        if not self._stick_failsafe:
            return None
        waiting = self.t - self._sticks_lost_since < self._parameters["COM_FAIL_ACT_T"]
        return Mode.AUTO_LOITER if waiting else action


def _check(number: int, arguments: str, level: int) -> Event:
    return Event(number=number, level=level, internal=level, arguments=bytes.fromhex(arguments))
