"""PX4's multicopter land detector: ground contact, maybe landed, landed, each held for a third of a second."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sitl_stub.vehicle.estimator import Estimate
from sitl_stub.vehicle.range_trust import RangeTrust

HOLD_TIME = 1.0 / 3.0
"""Time [s] each stage must hold before it counts; three times as long where the range to the ground is not trusted."""
FREE_FALL_TIME = 0.3
CLOSE_TO_GROUND = 1.0


class Hysteresis:
    """True only after the input was true for a time; false at once."""

    __slots__ = ("_since", "state", "time")

    def __init__(self, state: bool, time: float) -> None:
        self.state, self.time = state, time
        self._since = 0.0

    def update(self, wanted: bool, dt: float) -> bool:
        """Take one input that has held for `dt` [s]."""
        if not wanted:
            self.state, self._since = False, 0.0
        elif not self.state:
            self._since += dt
            if self._since >= self.time:
                self.state = True
        return self.state


@dataclass(slots=True, kw_only=True)
class LandInputs:
    """What the detector looks at besides the estimate."""

    armed: bool
    climb_rate_controlled: bool
    wanted_down_rate: float
    """Down velocity of the trajectory setpoint [m/s]; NaN when it has none."""
    thrust: float
    """Collective thrust setpoint 0 to 1."""
    hover_thrust: float


class LandDetector:
    """Holds the three stages. Without a *commanded* finite descent it never leaves the air."""

    __slots__ = (
        "_free_fall",
        "_ground_contact",
        "_landed",
        "_maybe_landed",
        "_range",
        "_range_trusted",
        "_rotation_max",
        "_speed_max",
        "_thrust_min",
        "_vertical_max",
    )

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._ground_contact = Hysteresis(True, HOLD_TIME)
        self._maybe_landed = Hysteresis(True, HOLD_TIME)
        self._landed = Hysteresis(True, HOLD_TIME)
        self._free_fall = Hysteresis(False, FREE_FALL_TIME)
        self._range = RangeTrust()
        self._range_trusted = True
        self.configure(parameters)

    def configure(self, parameters: Mapping[str, float]) -> None:
        """Take over thresholds from the autopilot's parameters."""
        self._vertical_max = min(
            parameters["LNDMC_Z_VEL_MAX"], min(parameters["MPC_LAND_CRWL"], parameters["MPC_LAND_SPEED"]) / 1.2
        )
        self._speed_max = parameters["LNDMC_XY_VEL_MAX"]
        self._rotation_max = math.radians(parameters["LNDMC_ROT_MAX"])
        self._thrust_min = parameters["MPC_THR_MIN"]

    @property
    def ground_contact(self) -> bool:
        """First stage: low thrust, commanded descent and no motion."""
        return self._ground_contact.state

    @property
    def maybe_landed(self) -> bool:
        """Second stage: minimum thrust as well."""
        return self._maybe_landed.state

    @property
    def landed(self) -> bool:
        """Third stage."""
        return self._landed.state

    def update(self, estimate: Estimate, inputs: LandInputs, dt: float) -> bool:
        """Advance by `dt` [s] and return whether the vehicle counts as landed."""
        self._range_trusted = self._range.update(estimate, landed=self.landed, dt=dt)
        hold = HOLD_TIME if self._range_trusted else 3.0 * HOLD_TIME
        self._ground_contact.time = self._maybe_landed.time = self._landed.time = hold
        f0, f1, f2 = estimate.specific_force
        self._free_fall.update(f0 * f0 + f1 * f1 + f2 * f2 < 4.0, dt)
        disarmed = not inputs.armed
        self._ground_contact.update(disarmed or self._touching(estimate, inputs), dt)
        self._maybe_landed.update(disarmed or self._idle(estimate, inputs), dt)
        return self._landed.update(disarmed or self._maybe_landed.state, dt)

    def _touching(self, estimate: Estimate, inputs: LandInputs) -> bool:
        vertical = self._vertical_max * (2.5 if self.landed else 1.0)
        still = abs(estimate.v_down) < vertical or abs(estimate.down_rate) < vertical
        slow = math.hypot(estimate.v_north, estimate.v_east) <= self._speed_max
        span = inputs.hover_thrust - self._thrust_min
        touching = inputs.thrust <= self._thrust_min + span * 0.6
        if inputs.climb_rate_controlled and not (self.maybe_landed or self.landed):
            touching = touching and inputs.wanted_down_rate >= 1.1 * self._vertical_max
        near = estimate.range_down < CLOSE_TO_GROUND or not self._range_trusted
        return near and touching and still and slow

    def _idle(self, estimate: Estimate, inputs: LandInputs) -> bool:
        rotation = self._rotation_max * (2.5 if self.landed else 1.0)
        if math.hypot(estimate.p, estimate.q) > rotation or self._free_fall.state or not self.ground_contact:
            return False
        return inputs.thrust <= self._thrust_min + (inputs.hover_thrust - self._thrust_min) * 0.1
