"""The autopilot's parameters on which driving by sticks rests: read and judged, never changed.

Sources, PX4 v1.17: manual_control/ManualControlSelector.cpp, commander/failsafe/failsafe.cpp, rover_ackermann.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from companion.control.drive import DriveParameters
from companion.preflight.autopilot_parameters import Rules, WantedChoice, WantedRange, WantedValue


@dataclass(frozen=True, slots=True, kw_only=True)
class WantedRoverParameters:
    """What each parameter must be, by PX4's names; a rover with another value is not armed."""

    # whose sticks count: with 5 and 7 a transmitter, as soon as it is switched on, before this program's
    COM_RC_IN_MODE: WantedChoice = field(default_factory=lambda: WantedChoice(values=(5, 7)))
    # [s] after which our sticks count as lost
    COM_RC_LOSS_T: WantedRange = field(default_factory=lambda: WantedRange(least=0.2, most=1.0))
    # when our sticks stop, also at the mission's end: Hold or Disarm. Return would drive home by itself
    NAV_RCL_ACT: WantedChoice = field(default_factory=lambda: WantedChoice(values=(1, 6)))
    # at the geofence: Hold or Return
    GF_ACTION: WantedChoice = field(default_factory=lambda: WantedChoice(values=(2, 3)))

    def rules(self, drive: DriveParameters) -> Rules:
        """Give what each parameter must be; those of the drive train as the configuration has them."""
        return {
            "COM_RC_IN_MODE": self.COM_RC_IN_MODE,
            "COM_RC_LOSS_T": self.COM_RC_LOSS_T,
            "NAV_RCL_ACT": self.NAV_RCL_ACT,
            "GF_ACTION": self.GF_ACTION,
            "RA_WHEEL_BASE": WantedValue(value=drive.wheel_base),
            "RA_MAX_STR_ANG": WantedValue(value=drive.steering_angle),
            "RO_MAX_THR_SPEED": WantedValue(value=drive.full_speed),
            "RO_YAW_RATE_LIM": WantedValue(value=math.degrees(drive.yaw_rate_full)),
            "RO_YAW_RATE_P": WantedValue(value=drive.yaw_rate_gain),
            "RO_YAW_EXPO": WantedValue(value=0.0),
            "RO_YAW_SUPEXPO": WantedValue(value=0.0),
        }
