"""A guardian with a perfect vehicle behind it, for the tests."""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.geometry.rotations import rotation_about_z
from companion.guardian.guardian import Guardian
from companion.guardian.holonomic import HolonomicShaper
from companion.guardian.parameters import GuardianParameters
from companion.messages.guardian import GuardianState, ModeRequest
from companion.messages.motion import MotionState
from companion.messages.ownship import FlightMode, LandedState, OwnshipState, SystemStatus, VehicleStatus
from companion.vehicles.multicopter import Multicopter

LIMITS = Multicopter().limits
DT = 0.02


def motion(position, velocity=(0, 0, 0), acceleration=(0, 0, 0), yaw=0.0, yaw_rate=0.0):
    return MotionState(
        position_ned=np.array(position, float),
        velocity_ned=np.array(velocity, float),
        acceleration_ned=np.array(acceleration, float),
        yaw=yaw,
        yaw_rate=yaw_rate,
    )


@dataclass
class Path:
    """A trajectory from any function of time."""

    function: object
    t_start: float = -100.0
    t_end: float = 1e9
    t_expiry: float = 1e9
    reset_counter: int = 0

    def at(self, t):
        return self.function(t)


def line(start, velocity, t0, **more):
    start, velocity = np.array(start, float), np.array(velocity, float)
    return Path(lambda t: motion(start + velocity * (t - t0), velocity), **more)


def status(**changes):
    values = {
        "t": 0.0,
        "connected": True,
        "armed": True,
        "mode": FlightMode.POSCTL,
        "landed": LandedState.IN_AIR,
        "system_status": SystemStatus.ACTIVE,
        "estimate_valid": True,
        "battery_remaining": None,
    }
    return VehicleStatus(**(values | changes))


class Bench:
    """Ticks the guardian; the vehicle is where it was told to be, the autopilot does what it is asked."""

    def __init__(self, **parameters):
        self.parameters = GuardianParameters(**parameters)
        self.guardian = Guardian(self.parameters, HolonomicShaper(LIMITS))
        self.t = 0.0
        self.position = np.array([0.0, 0.0, -3.0])
        self.velocity = np.zeros(3)
        self.yaw = 0.0
        self.reset_counter = 0
        self.status = status()
        self.odometry = True
        self.stuck = False  # the vehicle does not move
        self.obeys = True  # the autopilot grants modes
        self.trajectory = None
        self.target = None
        self.ownship = None
        self.out = None
        self.requests = []

    def tick(self, dt=DT):
        self.t += dt
        if self.odometry:
            self.ownship = OwnshipState(
                t=self.t,
                position_ned=self.position,
                velocity_ned=self.velocity,
                acceleration_ned=np.zeros(3),
                ned_from_frd=rotation_about_z(self.yaw),
                angular_velocity_frd=np.zeros(3),
                reset_counter=self.reset_counter,
            )
        self.out = self.guardian.tick(self.t, self.ownship, self.status, self.trajectory, self.target)
        if self.out.request is not None:
            self.requests.append((self.t, self.out.request))
            if self.obeys:
                self.status = replace(self.status, mode=self.out.request.mode)
        setpoint = self.out.setpoint
        if setpoint is not None and self.status.mode is FlightMode.OFFBOARD and not self.stuck:
            self.velocity = setpoint.velocity_ned.copy()
            if setpoint.position_ned is not None:
                self.position = setpoint.position_ned.copy()
            else:
                self.position = self.position + self.velocity * dt
            self.yaw = setpoint.yaw
        return self.out

    def run(self, seconds, dt=DT):
        return [self.tick(dt) for _ in range(max(1, round(seconds / dt)))]

    def engaged(self):
        """Bring it to holding in OFFBOARD."""
        self.guardian.engage(self.t)
        self.run(1.2)
        assert self.out.state is GuardianState.HOLDING, self.out
        return self

    def following(self, velocity=(0.5, 0.0, 0.0), seconds=1.0):
        self.engaged()
        self.trajectory = line(self.position, velocity, self.t)
        self.run(seconds)
        assert self.out.state is GuardianState.FOLLOWING, self.out
        return self


ROOM = 1 + 1e-6


def bound_violations(s):
    """Name what one setpoint has beyond the limits."""
    numbers = [
        *s.velocity_ned,
        *s.acceleration_ned,
        s.yaw,
        s.yaw_rate,
        *(s.position_ned if s.position_ned is not None else ()),
    ]
    (vn, ve, vd), (an, ae, ad) = s.velocity_ned.tolist(), s.acceleration_ned.tolist()
    checks = {
        "finite": np.isfinite(numbers).all(),
        "speed": math.hypot(vn, ve) <= LIMITS.speed_horizontal * ROOM,
        "speed up": -vd <= LIMITS.speed_up * ROOM,
        "speed down": vd <= LIMITS.speed_down * ROOM,
        "acceleration": math.hypot(an, ae) <= LIMITS.acceleration_horizontal * ROOM,
        "acceleration down": abs(ad) <= LIMITS.acceleration_vertical * ROOM,
        "yaw rate": abs(s.yaw_rate) <= LIMITS.yaw_rate * ROOM,
    }
    return [name for name, holds in checks.items() if not holds]


def step_violations(before, s):
    """Name what steps beyond the limits from one setpoint to the next."""
    dt = s.t - before.t
    change = (s.velocity_ned - before.velocity_ned) / dt
    jerk = np.abs(s.acceleration_ned - before.acceleration_ned).max() / dt
    checks = {
        "step of velocity": math.hypot(change[0], change[1]) <= LIMITS.acceleration_horizontal * ROOM + 1e-6,
        "step of velocity down": abs(change[2]) <= LIMITS.acceleration_vertical * ROOM + 1e-6,
        "step of acceleration": jerk <= LIMITS.jerk * ROOM + 1e-6,
        "step of yaw rate": abs(s.yaw_rate - before.yaw_rate) <= LIMITS.yaw_acceleration * dt * ROOM + 1e-6,
    }
    return [name for name, holds in checks.items() if not holds]


def violations(outputs):
    """Name everything that is or steps beyond the limits in outputs that follow each other."""
    wrong, before = [], None
    for out in outputs:
        if out.setpoint is not None:
            wrong += bound_violations(out.setpoint)
            if before is not None:
                wrong += step_violations(before, out.setpoint)
        before = out.setpoint
    return wrong


HOLD, OFFBOARD = ModeRequest.HOLD, ModeRequest.OFFBOARD
