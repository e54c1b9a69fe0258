"""The battery: drains while armed, is full again when disarmed, and warns in three steps.

As PX4's battery simulator and battery library: SIM_BAT_DRAIN [s] from full to empty, SIM_BAT_MIN_PCT [%] at which it
stops, BAT1_V_EMPTY to BAT1_V_CHARGED [V] a cell. The reported charge lags about one second behind
(recorded: q17_battery, low 52.05 s after arming at a drain of 60 s).
"""

import math
from collections.abc import Mapping

LAG = 1.005
"""Time constant [s] of the reported charge: a filter of 1 s at 100 Hz (lib/battery: _cell_voltage_filter_v)."""
NONE, LOW, CRITICAL, EMERGENCY = 0, 1, 2, 3


class Battery:
    """Charge 0 to 1, true and as reported, and the warning level."""

    __slots__ = ("_parameters", "charge", "held", "reported", "warning")

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters
        self.charge = 1.0
        """True charge."""
        self.reported = 1.0
        self.warning = NONE
        self.held = False
        """A fault has set the charge: it does not drain or fill by itself any more."""

    def set(self, charge: float) -> None:
        """Put the charge (0 to 1) where a fault wants it, for good."""
        self.charge, self.held = charge, True

    def step(self, dt: float, *, armed: bool) -> None:
        """Drain for `dt` [s]."""
        if not self.held:
            floor = 0.01 * self._parameters["SIM_BAT_MIN_PCT"]
            drained = self.charge - dt / max(self._parameters["SIM_BAT_DRAIN"], 1.0)
            self.charge = max(floor, drained) if armed else 1.0
        self.reported += (self.charge - self.reported) * dt / LAG
        parameters = self._parameters
        if self.reported < parameters["BAT_EMERGEN_THR"]:
            self.warning = EMERGENCY
        elif self.reported < parameters["BAT_CRIT_THR"]:
            self.warning = CRITICAL
        elif self.reported < parameters["BAT_LOW_THR"]:
            self.warning = LOW
        else:
            self.warning = NONE

    @property
    def millivolts(self) -> int:
        """Voltage of all cells [mV]."""
        parameters = self._parameters
        empty, full = parameters["BAT1_V_EMPTY"], parameters["BAT1_V_CHARGED"]
        return round(1e3 * parameters["BAT1_N_CELLS"] * (empty + (full - empty) * self.charge))

    @property
    def percent(self) -> int:
        """Reported charge, rounded up as PX4 does."""
        return math.ceil(100.0 * self.reported - 1e-9)

    @property
    def charge_state(self) -> int:
        """MAV_BATTERY_CHARGE_STATE: 1 OK, 2 low, 3 critical, 4 emergency."""
        return 1 + self.warning
