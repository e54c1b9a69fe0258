"""Modes, arming and failsafes: what PX4's commander decides. Knows nothing of MAVLink's bytes."""

import math
from collections.abc import Mapping

from sitl_stub.vehicle import notices
from sitl_stub.vehicle.battery import EMERGENCY
from sitl_stub.vehicle.checks import Checks
from sitl_stub.vehicle.failsafe import FailsafeMachine
from sitl_stub.vehicle.failsafe_actions import Action, FailsafeFlags
from sitl_stub.vehicle.failsafe_conditions import FailsafeConditions
from sitl_stub.vehicle.faults import Faults
from sitl_stub.vehicle.gyro_calibration import GyroCalibration
from sitl_stub.vehicle.landing_watch import LandingWatch
from sitl_stub.vehicle.mode_intention import ModeIntention
from sitl_stub.vehicle.modes import AUTO, NEEDS_STICKS, Mode
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.pilot_orders import obey_pilot
from sitl_stub.vehicle.sticks import CENTRED, ManualControl, Sticks
from sitl_stub.vehicle.system_state import (
    BY_COMMAND,
    BY_FAILSAFE,
    BY_KILL,
    Result,
    Surroundings,
    SystemStatus,
)

CHECK_INTERVAL = 0.108
"""The checks run when 100 ms are over, which PX4 notices in a loop of 12 ms, and at once when something changes [s]."""


class Commander:
    """State of the autopilot's decisions; `step` once per physics step."""

    def __init__(
        self,
        parameters: Mapping[str, float],
        faults: Faults,
        surroundings: Surroundings,
        t: float,
        *,
        booted_at: float = -math.inf,
    ) -> None:
        self._parameters = parameters
        self._surroundings = surroundings
        self.t = t
        self.armed = False
        self.killed = False
        """The pilot's kill switch is on: the motors stand still."""
        self.mode = Mode.AUTO_LOITER
        """The mode in force; differs from `intended` in a failsafe."""
        self.failsafe = False
        self.notices: list[Notice] = []
        self.pilot = ManualControl(parameters)
        self._machine = FailsafeMachine(parameters, t)
        self._conditions = FailsafeConditions(parameters)
        self.checks = Checks(parameters, faults, surroundings, booted_at)
        """What is wrong."""
        self._intention = ModeIntention()
        self._landing = LandingWatch(parameters)
        self._calibration: GyroCalibration | None = None
        self._sticks_wanted = False
        self._sticks_seen = -math.inf
        self._due = t
        self._killed_since = 0.0

    # what the vehicle can do now

    @property
    def intended(self) -> Mode:
        """The mode the user asked for."""
        return self._intention.mode

    @property
    def landed(self) -> bool:
        """Whether the vehicle has landed, or has not taken off."""
        return self._landing.landed

    @property
    def flags(self) -> FailsafeFlags:
        """What is wrong."""
        return self.checks.flags

    @property
    def sticks(self) -> Sticks:
        """Stick positions; centred when none arrive."""
        return self.pilot.sticks if self.sticks_alive else CENTRED

    @property
    def sticks_alive(self) -> bool:
        """Whether stick positions arrive (COM_RC_LOSS_T)."""
        return self.pilot.valid(self.t)

    def can_run(self, mode: Mode) -> bool:
        """Whether the mode's needs are met, stick input included."""
        return self.flags.can_run(mode) and not (mode in NEEDS_STICKS and self.flags.manual_control_lost)

    @property
    def system_status(self) -> SystemStatus:
        """MAV_STATE of HEARTBEAT."""
        if self.mode is Mode.TERMINATION or self.killed:
            return SystemStatus.TERMINATION
        if self.armed:
            return SystemStatus.CRITICAL if self.failsafe else SystemStatus.ACTIVE
        if self._calibration is not None:
            return SystemStatus.CALIBRATING
        return SystemStatus.STANDBY if self.checks.can_arm else SystemStatus.UNINITIALISED

    def report_health(self) -> None:
        """Send the arming checks as events: a summary, each check, and a health summary."""
        self._check()
        self._report(force=True)

    # what others ask for

    def setpoint_arrived(self, *, position: bool, velocity: bool, acceleration: bool) -> None:
        """An offboard setpoint that counts has come; which quantities it sets."""
        self.checks.setpoint_arrived(self.t, (position, velocity, acceleration))
        if self.flags.offboard_signal_lost:
            self._due = self.t

    def request_mode(
        self, mode: Mode, *, allow_fallback: bool = False, force: bool = False, tell: bool = True
    ) -> Result:
        """A user asks for a mode. Disarmed all are taken; in the air only those that can run.

        Args:
            mode: what is asked for.
            allow_fallback: take Position where only Altitude can run.
            force: take it in any case; if it cannot run, a failsafe follows.
            tell: say so when it is refused.
        """
        if self.t + 1e-9 >= self._due:
            self._check()  # PX4 handles commands after the checks of the same loop: a first setpoint counts at once
        possible = force or not self.armed or self.can_run(mode)
        possible |= allow_fallback and mode is Mode.POSCTL and self.can_run(Mode.ALTCTL)
        if self.mode is Mode.TERMINATION or not possible:
            if tell:
                self.notices.extend(self._intention.refusal(mode, self.t))
            return Result.TEMPORARILY_REJECTED
        self._intention.change(mode)
        self._due = self.t
        return Result.ACCEPTED

    def request_arm(self, reason: int = BY_COMMAND) -> Result:
        """Arm; refused while any check fails (no magic number gets around that)."""
        if self.armed:
            return Result.ACCEPTED
        if self._calibration is not None:
            self.notices.append(notices.ARM_DENIED_CALIBRATING)
            return Result.TEMPORARILY_REJECTED
        self._check()
        self._report()
        if not self.checks.can_arm:
            self.notices.append(notices.ARM_DENIED)
            return Result.TEMPORARILY_REJECTED
        self.armed = True
        self._landing.armed(self.t)
        self._due = self.t
        self.notices.append(notices.armed_by(reason))
        return Result.ACCEPTED

    def request_disarm(self, *, force: bool, reason: int = BY_COMMAND) -> Result:
        """Disarm; in the air only by force."""
        if not self.armed:
            return Result.ACCEPTED
        if not self.landed and not force:
            self.notices.append(notices.DISARM_DENIED)
            return Result.TEMPORARILY_REJECTED
        self._disarm(reason)
        return Result.ACCEPTED

    def request_termination(self) -> Result:
        """Flight termination: the motors stop; there is no way back but a reboot."""
        self._intention.change(Mode.TERMINATION)
        self._due = self.t
        return Result.ACCEPTED

    def request_gyro_calibration(self) -> Result:
        """Calibrate the gyros: refused while armed, or while it runs."""
        if self.armed or self._calibration is not None:
            return Result.TEMPORARILY_REJECTED
        self._calibration = GyroCalibration(self.t)
        return Result.ACCEPTED

    def request_kill(self, killed: bool) -> None:
        """The pilot's kill switch."""
        if killed and not self.killed:
            self._killed_since = self.t
            self.notices.append(notices.killed(self.landed))
        elif self.killed and not killed:
            self.notices.append(notices.KILL_RELEASED)
        self.killed = killed

    def _disarm(self, reason: int) -> None:
        self.armed = False
        self._intention.disarmed()
        self._due = self.t
        self.notices.append(notices.disarmed_by(reason))

    # what happens by itself

    def step(self, t: float) -> None:
        """Advance to `t` [s]."""
        self.t = t
        self._watch_landing()
        if self._calibration is not None:
            self.notices.extend(self._calibration.take_notices(t))
            if self._calibration.finished(t):
                self._calibration = None
        if self.killed and self.armed and t - self._killed_since >= self._parameters["COM_KILL_DISARM"]:
            self._disarm(BY_KILL)
        if self.pilot.requests:
            obey_pilot(self)
        if self.armed and self.pilot.moving and self.sticks_alive:
            self._sticks_moved()
        if t + 1e-9 < self._due:
            return
        self._due = t + CHECK_INTERVAL
        self._check()
        self._report()
        before = self.mode, self._machine.action
        self._decide()
        if before != (self.mode, self._machine.action):
            self._check()
            self._report()

    def _report(self, *, force: bool = False) -> None:
        """Tell of the checks what has changed, if it is time for that; or everything."""
        self.notices.extend(self.checks.report(self.t, self.intended, force=force))

    def _sticks_moved(self) -> None:
        """Moved sticks take over from AUTO or OFFBOARD if COM_RC_OVERRIDE lets them."""
        self.pilot.moving = False
        allowed = int(self._parameters["COM_RC_OVERRIDE"])
        if not ((self.mode in AUTO and allowed & 1) or (self.mode is Mode.OFFBOARD and allowed & 2)):
            return
        if self._machine.active:
            self._sticks_wanted, self._due = True, self.t
        elif self.request_mode(Mode.POSCTL, allow_fallback=True) is Result.ACCEPTED:
            self.notices.append(notices.STICKS_TOOK_OVER)

    def _check(self) -> None:
        """Look at everything that could be wrong."""
        self._check_sticks()
        charge = self._surroundings.battery.warning
        if charge == EMERGENCY and self.flags.battery_warning != EMERGENCY and self.armed:
            self.notices.append(notices.NO_SHUTDOWN)
        self.checks.update(
            self.t, intended=self.intended, mode=self.mode, armed=self.armed, in_air=self.armed and not self.landed
        )

    def _check_sticks(self) -> None:
        lost = not self.sticks_alive
        if lost and not self.flags.manual_control_lost:
            self.pilot.lost()
            self.notices.append(notices.STICKS_LOST)
        elif not lost:
            if self.flags.manual_control_lost and self._sticks_seen > -math.inf:
                self.notices.append(notices.sticks_regained(self.t - self._sticks_seen))
            self._sticks_seen = self.t
            if not self.armed and not self._intention.chosen and self.pilot.chooses_no_mode:
                self.request_mode(Mode.POSCTL)  # PX4's first mode with sticks
        self.flags.manual_control_lost = lost

    def _decide(self) -> None:
        """Run the failsafe machine and take over its mode."""
        failures = self._conditions.failures(self.flags, armed=self.armed, intended=self.intended)
        state = self._machine.update(
            self.t,
            failures,
            lambda mode: self._conditions.fallback(self.flags, mode),
            self.flags,
            armed=self.armed,
            intended=self.intended,
            mode_changed=self._intention.take_asked(),
            sticks=self._sticks_wanted,
        )
        self._sticks_wanted = False
        if state.intended is not self.intended:
            self._intention.change(state.intended)
            self._intention.take_asked()
        if state.notifications:
            self.notices.extend(self.checks.flush(self.t, self.intended))
            self.notices.extend(map(notices.failsafe_entered, state.notifications))
        if state.took_over:
            self.notices.append(notices.STICKS_ENDED_FAILSAFE)
        if state.action is Action.DISARM and self.armed:
            self._disarm(BY_FAILSAFE)
        self.mode = state.mode
        self.failsafe = self._machine.active and (self.armed or self.mode is Mode.TERMINATION)

    def _watch_landing(self) -> None:
        self.notices.extend(self._landing.update(self.t, landed=self._surroundings.landed, armed=self.armed))
        reason = self._landing.disarm_reason(self.t) if self.armed else None
        if reason is not None:
            self._disarm(reason)
