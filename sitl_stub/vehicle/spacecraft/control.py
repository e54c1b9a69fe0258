"""PX4's spacecraft module in the plane: position, attitude and rate control, and what each mode asks of them.

Follows modules/spacecraft of PX4 v1.17: SpacecraftPositionControl at 100 Hz, SpacecraftAttitudeControl and
SpacecraftRateControl at 250 Hz. Its oddities are kept, since a companion meets them:

- a position that no setpoint gives counts as zero: Hold, Return, Land and OFFBOARD with position setpoints (which the
  module never receives) all drive to the origin of the local frame, at SPC_POS_P times the distance;
- the turn rate of an attitude setpoint is not fed forward;
- a control level without a source keeps the last attitude and the last thrust.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Flag, auto

from sitl_stub.truth import Quaternion, Vector
from sitl_stub.vehicle.estimator import Estimate
from sitl_stub.vehicle.modes import AUTO, Mode
from sitl_stub.vehicle.spacecraft.allocation import Allocation
from sitl_stub.vehicle.spacecraft.thrusters import SHUT
from sitl_stub.vehicle.sticks import Sticks

STICK_TURN_DEAD = -0.9
"""Throttle stick below which the yaw stick turns nothing."""
ACRO_RATE = 5.0
"""Turn rate of the full yaw stick in ACRO [rad/s]: PX4 writes it so, whatever SC_ACRO_Y_MAX says."""
INTEGRAL_FADES_AT = math.radians(400.0)
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)


class Loops(Flag):
    """What PX4's vehicle_control_mode switches on."""

    ALLOCATION = auto()
    RATE = auto()
    ATTITUDE = auto()
    POSITION = auto()


TURNED = Loops.ALLOCATION | Loops.RATE
STEERED = TURNED | Loops.ATTITUDE
LOOPS = {
    Mode.MANUAL: Loops.ALLOCATION,
    Mode.ACRO: TURNED,
    Mode.STABILIZED: STEERED,
    Mode.ALTCTL: STEERED,
    Mode.POSCTL: STEERED | Loops.POSITION,
    Mode.DESCEND: STEERED,
    Mode.TERMINATION: Loops(0),
    **dict.fromkeys(AUTO - {Mode.DESCEND}, STEERED | Loops.POSITION),
}
"""Which loops a mode runs (commander/ModeUtil/control_mode.cpp); OFFBOARD's depend on the setpoint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeSetpoint:
    """Attitude ned_from_frd (w, x, y, z) and normalised thrust -1 to 1 along forward, right, down."""

    attitude: Quaternion = LEVEL
    thrust: Vector = (0.0, 0.0, 0.0)

    @property
    def yaw(self) -> float:
        """Heading [rad]."""
        w, x, y, z = self.attitude
        return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


class SpacecraftControl:
    """Holds setpoints and the rate integral between steps; `duties` are the thrusters' commands."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self.setpoint = AttitudeSetpoint()
        """What attitude control follows."""
        self.yaw_rate = 0.0
        """Turn rate asked for [rad/s]."""
        self.torque = 0.0
        """Normalised yaw torque asked for."""
        self._integral = 0.0
        self._last_rate: float | None = None
        self._loops = Loops(0)
        self._place: tuple[float, float] | None = None
        self._stick_yaw: float | None = None
        self._direct: tuple[float, float, float] | None = None
        self.configure()

    def configure(self) -> None:
        """Take over the geometry from the autopilot's parameters; gains are read as they are used."""
        self._allocation = Allocation(self._parameters)

    # setpoints, 100 Hz

    def by_mode(self, mode: Mode, estimate: Estimate, sticks: Sticks, dt: float) -> None:
        """Set what a mode with sticks or an automatic one wants, `dt` [s] after the last step."""
        self._begin(LOOPS[mode])
        self._direct = None
        if mode is Mode.MANUAL:
            most, turn = self._parameters["SC_MAN_F_MAX"], self._parameters["SC_MAN_T_MAX"]
            self._direct = (_unit(sticks.forward * most), _unit(sticks.right * most), _unit(sticks.yaw * turn))
        elif mode is Mode.ACRO:
            self.turn_at(ACRO_RATE * sticks.yaw)
        elif mode is Mode.STABILIZED:
            rate = math.radians(self._parameters["SC_MAN_Y_SCALE"]) * sticks.yaw
            self.setpoint = AttitudeSetpoint(attitude=_facing(self._turned(estimate, sticks, rate, dt)))
        elif mode is Mode.POSCTL:
            self._position_by_sticks(estimate, sticks, dt)
        elif Loops.POSITION in self._loops:
            self.to_origin(estimate)

    def by_offboard(self, loops: Loops, estimate: Estimate) -> None:
        """Set what OFFBOARD wants; attitude setpoints and turn rates have been taken over on their arrival."""
        self._begin(loops)
        self._direct = None
        if Loops.POSITION in loops:
            self.to_origin(estimate)

    def turn_at(self, yaw_rate: float) -> None:
        """Take a turn rate [rad/s] without an attitude: PX4's receiver gives a spacecraft no thrust with it."""
        self.yaw_rate = yaw_rate
        self.setpoint = AttitudeSetpoint(attitude=self.setpoint.attitude)

    def _begin(self, loops: Loops) -> None:
        if loops != self._loops:
            self._loops = loops
            self._place = self._stick_yaw = None

    def _turned(self, estimate: Estimate, sticks: Sticks, rate: float, dt: float) -> float:
        """Heading [rad] that the yaw stick has turned to, at `rate` [rad/s]."""
        yaw = estimate.yaw if self._stick_yaw is None else self._stick_yaw
        if sticks.up >= STICK_TURN_DEAD:
            yaw += rate * dt
        self._stick_yaw = math.remainder(yaw, math.tau)
        return self._stick_yaw

    def _position_by_sticks(self, estimate: Estimate, sticks: Sticks, dt: float) -> None:
        """Move the held place with the sticks, north and east, at up to 1 m/s."""
        yaw = self._turned(estimate, sticks, math.radians(self._parameters["SPC_MAN_Y_MAX"]) * sticks.yaw, dt)
        north, east = (estimate.north, estimate.east) if self._place is None else self._place
        self._place = (north + sticks.forward * dt, east + sticks.right * dt)
        self._follow(estimate, self._place, (sticks.forward, sticks.right), _facing(yaw))

    def to_origin(self, estimate: Estimate) -> None:
        """Drive to the origin of the local frame with the present heading: what a missing setpoint comes to."""
        self._follow(estimate, (0.0, 0.0), (0.0, 0.0), estimate.quaternion)

    def _follow(
        self,
        estimate: Estimate,
        place: tuple[float, float],
        velocity: tuple[float, float],
        attitude: Quaternion,
    ) -> None:
        """P on position, P on velocity; the acceleration is the thrust, cut axis by axis in north and east."""
        p = self._parameters
        gain, most, fastest = p["SPC_VEL_P"], p["SPC_THR_MAX"], p["SPC_VEL_MAX"]
        errors = (place[0] - estimate.north, place[1] - estimate.east)
        speeds = (estimate.v_north, estimate.v_east)
        north, east = (
            _clip(gain * (_clip(v + p["SPC_POS_P"] * e, fastest) - speed), most)
            for e, v, speed in zip(errors, velocity, speeds, strict=True)
        )
        cosine, sine = math.cos(estimate.yaw), math.sin(estimate.yaw)
        thrust = (cosine * north + sine * east, cosine * east - sine * north, 0.0)
        self.setpoint = AttitudeSetpoint(attitude=attitude, thrust=thrust)

    # attitude, rate and allocation, 250 Hz

    def duties(self, estimate: Estimate, *, armed: bool, dt: float) -> list[float]:
        """Duties of the thrusters, 0 to 1; all shut when disarmed."""
        acceleration = 0.0 if self._last_rate is None else (estimate.r - self._last_rate) / dt
        self._last_rate = estimate.r
        if not armed:
            self._integral = 0.0
            return list(SHUT)
        if self._direct is not None:
            return self._allocation.duties(*self._direct)
        if Loops.RATE not in self._loops:
            return list(SHUT)
        if Loops.ATTITUDE in self._loops:
            self._face(estimate.yaw)
        self._hold_rate(estimate.r, acceleration, dt)
        forward, right, _ = self.setpoint.thrust
        return self._allocation.duties(forward, right, self.torque)

    def _face(self, yaw: float) -> None:
        """Heading to turn rate; PX4 takes twice the vector part of the error quaternion."""
        p = self._parameters
        error = math.remainder(self.setpoint.yaw - yaw, math.tau)
        self.yaw_rate = _clip(2.0 * math.sin(0.5 * error) * p["SC_YAW_P"], math.radians(p["SC_YAWRATE_MAX"]))

    def _hold_rate(self, rate: float, acceleration: float, dt: float) -> None:
        """Turn rate to normalised torque: PID with feed-forward; the integral fades where the error is large."""
        p = self._parameters
        error, scale = self.yaw_rate - rate, p["SC_YAWRATE_K"]
        held = scale * (p["SC_YAWRATE_P"] * error - p["SC_YAWRATE_D"] * acceleration)
        self.torque = held + self._integral + p["SC_YAWRATE_FF"] * self.yaw_rate
        fading = max(0.0, 1.0 - (error / INTEGRAL_FADES_AT) ** 2)
        self._integral = _clip(self._integral + fading * scale * p["SC_YAWRATE_I"] * error * dt, p["SC_YR_INT_LIM"])


def _facing(yaw: float) -> Quaternion:
    """Level attitude with a heading [rad]."""
    return (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))


def _clip(value: float, most: float) -> float:
    return max(-most, min(most, value))


def _unit(value: float) -> float:
    return _clip(value, 1.0)
