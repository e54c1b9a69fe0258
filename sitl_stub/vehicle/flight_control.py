"""The cascade from trajectory setpoint to rotor commands, with take-off ramp, hover thrust and land detector."""

import math
from collections.abc import Mapping

from sitl_stub.truth import Vector
from sitl_stub.vehicle.attitude_control import AttitudeController, RateController
from sitl_stub.vehicle.estimator import Estimate
from sitl_stub.vehicle.land_detector import LandDetector, LandInputs
from sitl_stub.vehicle.position_control import (
    NAN,
    NO_SETPOINT,
    NO_THRUST,
    PositionController,
    TrajectorySetpoint,
    VelocityLimits,
)
from sitl_stub.vehicle.takeoff import HoverThrust, Takeoff, TakeoffState

FALLBACK_TIME = 0.2
"""For so long [s] the last flyable setpoint is flown when an unflyable one arrives; then the vehicle stops."""
TILT_SLEW = 0.2
"""How fast the tilt limit may change [rad/s]."""
OFF = [0.0, 0.0, 0.0, 0.0]


class FlightControl:
    """All controllers of one vehicle. `position_step` runs at about 100 Hz, `rate_step` at every physics step."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self.position = PositionController(parameters)
        self.attitude = AttitudeController(parameters)
        self.rates = RateController(parameters)
        self.takeoff = Takeoff(parameters)
        self.land_detector = LandDetector(parameters)
        self.hover_thrust = HoverThrust(float(parameters["MPC_THR_HOVER"]))
        self.setpoint = NO_SETPOINT
        """The trajectory setpoint in force, as the land detector sees it."""
        self.rate_setpoint: Vector = (0.0, 0.0, 0.0)
        self.commands = list(OFF)
        self._tilt_limit = math.radians(parameters["MPC_TILTMAX_LND"])
        self._velocity: Vector = (0.0, 0.0, 0.0)
        self._velocity_rate = [0.0, 0.0, 0.0]
        self._last_flyable = NO_SETPOINT
        self._last_flyable_age = math.inf

    def configure(self) -> None:
        """Take over changed parameters."""
        for part in (self.position, self.attitude, self.rates, self.takeoff, self.land_detector):
            part.configure(self._parameters)

    def follow_reset(self, velocity_step: Vector) -> None:
        """The estimated velocity has been reset by a step [m/s]: it is no acceleration."""
        v0, v1, v2 = self._velocity
        self._velocity = (v0 + velocity_step[0], v1 + velocity_step[1], v2 + velocity_step[2])

    @property
    def flying(self) -> bool:
        """Whether the take-off ramp is over."""
        return self.takeoff.state >= TakeoffState.FLIGHT

    @property
    def taking_off(self) -> bool:
        """Whether the take-off has begun, or is over."""
        return self.takeoff.state >= TakeoffState.RAMP_UP

    def position_step(
        self, estimate: Estimate, setpoint: TrajectorySetpoint, *, armed: bool, wants_takeoff: bool, dt: float
    ) -> None:
        """One step of position control and land detection, `dt` [s] after the last."""
        parameters = self._parameters
        self.setpoint = setpoint
        self._differentiate(estimate, dt)
        landed = self.land_detector.landed
        state = self.takeoff.update(armed=armed, landed=landed, wanted=wants_takeoff, dt=dt)
        flying = state >= TakeoffState.FLIGHT
        self._estimate_hover_thrust(estimate, flying and not landed, dt)
        if state < TakeoffState.RAMP_UP or (flying and self.land_detector.ground_contact):
            setpoint = NO_THRUST
            self.position.integral = [0.0, 0.0, 0.0]
        elif state == TakeoffState.RAMP_UP and math.isfinite(setpoint.velocity[2]):
            a0, a1, _ = setpoint.acceleration
            setpoint = TrajectorySetpoint(
                position=setpoint.position,
                velocity=setpoint.velocity,
                acceleration=(a0, a1, NAN),
                yaw=setpoint.yaw,
                yaw_rate=setpoint.yaw_rate,
            )
        self._limit_tilt(flying, dt)
        limits = VelocityLimits(
            horizontal=parameters["MPC_XY_VEL_MAX"],
            up=self.takeoff.climb_limit(parameters["MPC_Z_VEL_MAX_UP"], dt),
            down=parameters["MPC_Z_VEL_MAX_DN"],
        )
        self._fly(estimate, setpoint, limits, flying, dt)
        self._detect_landing(estimate, armed, dt)

    def _differentiate(self, estimate: Estimate, dt: float) -> None:
        """Velocity derivative behind PX4's low-pass MPC_VELD_LP."""
        velocity = estimate.velocity
        smooth = dt / (dt + 1.0 / (2.0 * math.pi * self._parameters["MPC_VELD_LP"]))
        rate = self._velocity_rate
        for i in range(3):
            rate[i] += ((velocity[i] - self._velocity[i]) / dt - rate[i]) * smooth
        self._velocity = velocity

    def _estimate_hover_thrust(self, estimate: Estimate, in_air: bool, dt: float) -> None:
        if not in_air:
            self.position.hover_thrust = self.hover_thrust.value
            return
        x, y = estimate.qx, estimate.qy
        vertical = self.position.thrust * (1.0 - 2.0 * (x * x + y * y))
        self.position.set_hover_thrust(self.hover_thrust.update(vertical, self._velocity_rate[2], dt))

    def _limit_tilt(self, flying: bool, dt: float) -> None:
        goal = math.radians(self._parameters["MPC_TILTMAX_AIR" if flying else "MPC_TILTMAX_LND"])
        step = TILT_SLEW * dt
        self._tilt_limit += max(-step, min(step, goal - self._tilt_limit))

    def _fly(
        self, estimate: Estimate, setpoint: TrajectorySetpoint, limits: VelocityLimits, flying: bool, dt: float
    ) -> None:
        velocity = estimate.velocity
        down = setpoint.velocity[2]
        if not math.isfinite(setpoint.position[2]) and math.isfinite(down) and abs(down) > 1e-6:
            # a vertical speed without a height: the height's derivative has less bias than the velocity estimate
            weight = min(abs(down) / self._parameters["MPC_LAND_SPEED"], 1.0)
            velocity = (velocity[0], velocity[1], estimate.down_rate * weight + velocity[2] * (1.0 - weight))
        if not (_pair(setpoint.velocity) or _pair(setpoint.position)):
            self.position.integral[0] = self.position.integral[1] = 0.0
        self._last_flyable_age += dt
        if self._update(estimate, setpoint, velocity, limits, flying, dt):
            self._last_flyable, self._last_flyable_age = setpoint, 0.0
            return
        if self._last_flyable_age < FALLBACK_TIME and self._update(
            estimate, self._last_flyable, velocity, limits, flying, dt
        ):
            return
        stop = TrajectorySetpoint(velocity=(0.0, 0.0, 0.0))
        self._update(estimate, stop, velocity, limits, flying, dt)

    def _update(
        self,
        estimate: Estimate,
        setpoint: TrajectorySetpoint,
        velocity: Vector,
        limits: VelocityLimits,
        flying: bool,
        dt: float,
    ) -> bool:
        rate = self._velocity_rate
        return self.position.update(
            setpoint,
            estimate.position,
            velocity,
            (rate[0], rate[1], rate[2]),
            estimate.yaw,
            limits=limits,
            tilt_max=self._tilt_limit,
            thrust_min=self._parameters["MPC_THR_MIN"] if flying else 0.0,
            thrust_max=self._parameters["MPC_THR_MAX"],
            dt=dt,
        )

    def _detect_landing(self, estimate: Estimate, armed: bool, dt: float) -> None:
        inputs = LandInputs(
            armed=armed,
            climb_rate_controlled=True,
            wanted_down_rate=self.setpoint.velocity[2],
            thrust=self.position.thrust,
            hover_thrust=self.position.hover_thrust,
        )
        self.land_detector.update(estimate, inputs, dt)

    def rate_step(self, estimate: Estimate, *, armed: bool, dt: float) -> list[float]:
        """One step of attitude and rate control; returns the rotor commands."""
        if not armed:
            self.rates.reset()
            self.commands = list(OFF)
            return self.commands
        control = self.position
        self.rate_setpoint = self.attitude.update(estimate.quaternion, control.attitude, control.yaw_rate)
        rates = (estimate.p, estimate.q, estimate.r)
        landed = self.land_detector.landed or self.land_detector.maybe_landed
        self.commands = self.rates.update(rates, self.rate_setpoint, control.thrust, dt=dt, landed=landed)
        return self.commands


def _pair(vector: Vector) -> bool:
    return math.isfinite(vector[0]) and math.isfinite(vector[1])
