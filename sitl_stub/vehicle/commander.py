"""Modes, arming and failsafes: what PX4's commander decides. Knows nothing of MAVLink's bytes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from sitl_stub.truth import Vector
from sitl_stub.vehicle import geofence, health, notices
from sitl_stub.vehicle.battery import EMERGENCY, Battery
from sitl_stub.vehicle.ekf_resets import EstimateHealth
from sitl_stub.vehicle.failsafe import FailsafeMachine
from sitl_stub.vehicle.failsafe_actions import Action, FailsafeFlags
from sitl_stub.vehicle.failsafe_conditions import FailsafeConditions
from sitl_stub.vehicle.faults import Faults, HealthProblem
from sitl_stub.vehicle.modes import AUTO, NEEDS_STICKS, PREVENTS_ARMING, TITLES, Mode
from sitl_stub.vehicle.notices import Notice
from sitl_stub.vehicle.sticks import CENTRED, ManualControl, PilotRequest, Sticks

CHECK_INTERVAL = 0.1
"""The checks run at 10 Hz, and at once when something was asked for."""


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


BY_GESTURE, BY_SWITCH, BY_COMMAND, BY_LANDING, BY_PREFLIGHT_TIMEOUT, BY_KILL, BY_FAILSAFE = 1, 2, 4, 6, 7, 8, 14
FORCE = 21196.0
"""Second parameter of a forced disarm."""


@dataclass(slots=True, kw_only=True)
class Surroundings:
    """What the commander looks at; the autopilot keeps it up to date."""

    estimate: EstimateHealth
    battery: Battery
    landed: bool = True
    position: Vector = (0.0, 0.0, 0.0)
    """Estimated position [m], local ned."""
    home: Vector = (0.0, 0.0, 0.0)


class Commander:
    """State of the autopilot's decisions; `step` once per physics step."""

    def __init__(self, parameters: Mapping[str, float], faults: Faults, surroundings: Surroundings, t: float) -> None:
        self._parameters = parameters
        self._faults = faults
        self._surroundings = surroundings
        self.t = t
        self.armed = False
        self.killed = False
        """The pilot's kill switch is on: the motors stand still."""
        self.intended = Mode.AUTO_LOITER
        """The mode the user asked for."""
        self.mode = Mode.AUTO_LOITER
        """The mode in force; differs from `intended` in a failsafe."""
        self.failsafe = False
        self.notices: list[Notice] = []
        self.pilot = ManualControl(parameters)
        self.flags = FailsafeFlags()
        self.landed = True
        self.can_arm = False
        """Whether arming would be accepted now."""
        self._machine = FailsafeMachine(parameters, t)
        self._conditions = FailsafeConditions(parameters)
        self._reporter = health.HealthReporter()
        self._checks: list[health.Check] = []
        self._breach = ""
        self._after_disarm = Mode.AUTO_LOITER
        self._setpoint_time = -math.inf
        self._setpoint_needs = (False, False, False)
        self._ground_station_time = -math.inf
        self._sticks_seen = -math.inf
        self._sticks_wanted = False
        self._mode_changed = False
        self._mode_chosen = False
        self._due = t
        self._killed_since = 0.0
        self._armed_since = 0.0
        self._has_flown = False
        self._landed_since = 0.0

    # what the vehicle can do now

    @property
    def problem(self) -> HealthProblem | None:
        """The health problem that a fault has put in."""
        return self._faults.refuse_arming

    @property
    def offboard_signal(self) -> bool:
        """Whether setpoints arrive (COM_OF_LOSS_T) and the estimate they need is valid."""
        if self.t - self._setpoint_time >= self._parameters["COM_OF_LOSS_T"]:
            return False
        position, velocity, _ = self._setpoint_needs
        if position and self.flags.position_invalid:
            return False
        return position or not (velocity and self.flags.velocity_invalid)

    @property
    def ever_had_setpoint(self) -> bool:
        """Whether a setpoint has arrived since the boot."""
        return self._setpoint_time > -math.inf

    @property
    def sticks(self) -> Sticks:
        """Stick positions; centred when none arrive."""
        return self.pilot.sticks if self.sticks_alive else CENTRED

    @property
    def sticks_alive(self) -> bool:
        """Whether stick positions arrive (COM_RC_LOSS_T)."""
        return self.pilot.valid(self.t)

    @property
    def battery_warning(self) -> int:
        """0 none, 1 low, 2 critical, 3 emergency."""
        return self.flags.battery_warning

    def can_run(self, mode: Mode) -> bool:
        """Whether the mode's needs are met, stick input included."""
        return self.flags.can_run(mode) and not (mode in NEEDS_STICKS and self.flags.manual_control_lost)

    @property
    def system_status(self) -> SystemStatus:
        """MAV_STATE of HEARTBEAT."""
        if self.mode is Mode.TERMINATION:
            return SystemStatus.TERMINATION
        if self.armed:
            return SystemStatus.CRITICAL if self.failsafe else SystemStatus.ACTIVE
        return SystemStatus.STANDBY if self.can_arm else SystemStatus.UNINITIALISED

    def report_health(self) -> None:
        """Send the arming checks as events: a summary, each check, and a health summary."""
        self._check()
        self.notices.extend(self._reporter.update(self.t, self._checks, self.intended, force=True))

    # what others ask for

    def setpoint_arrived(self, *, position: bool, velocity: bool, acceleration: bool) -> None:
        """An offboard setpoint that counts has come; which quantities it sets."""
        self._setpoint_time = self.t
        self._setpoint_needs = (position, velocity, acceleration)
        if self.flags.offboard_signal_lost:
            self._due = self.t

    def ground_station_heard(self) -> None:
        """A ground station's heartbeat has come."""
        self._ground_station_time = self.t

    def request_mode(self, mode: Mode, *, allow_fallback: bool = False) -> Result:
        """A user asks for a mode. Disarmed all are taken; in the air only those that can run."""
        if self.mode is Mode.TERMINATION:
            return Result.TEMPORARILY_REJECTED
        possible = self.can_run(mode) or (allow_fallback and mode is Mode.POSCTL and self.can_run(Mode.ALTCTL))
        if self.armed and not possible:
            self.notices.append(notices.mode_not_available(TITLES[mode], mode.navigation_state))
            return Result.TEMPORARILY_REJECTED
        self.intended = mode
        self._mode_changed = self._mode_chosen = True
        if mode not in PREVENTS_ARMING and mode is not Mode.AUTO_TAKEOFF:
            self._after_disarm = mode
        self._due = self.t
        return Result.ACCEPTED

    def request_arm(self, reason: int = BY_COMMAND) -> Result:
        """Arm; refused while any check fails (no magic number gets around that)."""
        if self.armed:
            return Result.ACCEPTED
        self._check()
        if not self.can_arm:
            self.notices.extend(self._reporter.flush(self.t, self._checks, self.intended))
            self.notices.append(notices.ARM_DENIED)
            return Result.TEMPORARILY_REJECTED
        self.armed = True
        self._armed_since = self.t
        self._has_flown = False
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
        self.intended = self._after_disarm = Mode.TERMINATION
        self._mode_changed = True
        self._due = self.t
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
        self.intended = self._after_disarm
        self._due = self.t
        self.notices.append(notices.disarmed_by(reason))

    # what happens by itself

    def step(self, t: float) -> None:
        """Advance to `t` [s]."""
        self.t = t
        self._watch_landing(self._surroundings.landed)
        if self.killed and self.armed and t - self._killed_since >= self._parameters["COM_KILL_DISARM"]:
            self._disarm(BY_KILL)
        if self.pilot.requests:
            self._obey_pilot()
        if self.armed and self.pilot.moving and self.sticks_alive:
            self._sticks_moved()
        if t + 1e-9 < self._due:
            return
        self._due = t + CHECK_INTERVAL
        self._check()
        self._decide()
        self.notices.extend(self._reporter.update(t, self._checks, self.intended))

    def _obey_pilot(self) -> None:
        requests, self.pilot.requests = self.pilot.requests, []
        for request in requests:
            self._obey(request)

    def _obey(self, request: PilotRequest) -> None:
        reason = BY_SWITCH if int(self._parameters["RC_MAP_ARM_SW"]) else BY_GESTURE
        if request.mode is not None:
            self.request_mode(request.mode)
        if request.arm is not None and request.arm:
            self.request_arm(reason)
        elif request.arm is not None:
            self.request_disarm(force=False, reason=reason)
        if request.kill is not None:
            self.request_kill(request.kill)
        if request.terminate:
            self.request_termination()

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
        seen, flags = self._surroundings, self.flags
        estimate = seen.estimate
        flags.position_invalid = flags.velocity_invalid = not estimate.position_valid
        flags.global_position_invalid = not estimate.position_valid
        flags.altitude_invalid = not estimate.heading_stable
        flags.home_invalid = not estimate.ever_had_position
        flags.ground_station_lost = self.t - self._ground_station_time >= self._parameters["COM_DL_LOSS_T"]
        flags.offboard_signal_lost = not self.offboard_signal
        self._check_sticks()
        self._check_battery(seen.battery)
        in_air = self.armed and not self.landed
        self._breach = geofence.breach(self._parameters, seen.position, seen.home) if in_air else ""
        flags.geofence_breached = bool(self._breach)
        condition = health.Condition(
            flags=flags,
            intended=self.intended,
            armed=self.armed,
            heading_stable=estimate.heading_stable,
            gnss_missing=not (self._faults.gnss or estimate.gnss_used),
            geofence=self._breach,
            charge=seen.battery.reported,
            problem=self.problem,
        )
        self._checks = health.failed_checks(condition, self._parameters)
        self.can_arm = health.can_arm(self._checks, self.intended)

    def _check_sticks(self) -> None:
        lost = not self.sticks_alive
        if lost and not self.flags.manual_control_lost:
            self.pilot.lost()
            self.notices.append(notices.STICKS_LOST)
        elif not lost:
            if self.flags.manual_control_lost and self._sticks_seen > -math.inf:
                self.notices.append(notices.sticks_regained(self.t - self._sticks_seen))
            self._sticks_seen = self.t
            if not self.armed and not self._mode_chosen and self.pilot.chooses_no_mode:
                self.request_mode(Mode.POSCTL)  # PX4's first mode with sticks
        self.flags.manual_control_lost = lost

    def _check_battery(self, battery: Battery) -> None:
        if battery.warning == EMERGENCY and self.flags.battery_warning != EMERGENCY and self.armed:
            self.notices.append(notices.NO_SHUTDOWN)
        self.flags.battery_warning = battery.warning

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
            mode_changed=self._mode_changed,
            sticks=self._sticks_wanted,
        )
        self._mode_changed = self._sticks_wanted = False
        self.intended = state.intended
        if state.notifications:
            self.notices.extend(self._reporter.flush(self.t, self._checks, self.intended))
            self.notices.extend(map(notices.failsafe_entered, state.notifications))
        if state.took_over:
            self.notices.append(notices.STICKS_ENDED_FAILSAFE)
        if state.action is Action.DISARM and self.armed:
            self._disarm(BY_FAILSAFE)
        self.mode = state.mode
        self.failsafe = self._machine.active and (self.armed or self.mode is Mode.TERMINATION)

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
