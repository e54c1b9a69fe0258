"""The autopilot's parameters on which flying a spacecraft by thrust rests: read and judged, never changed.

Sources: PX4's modules/spacecraft, control_allocator and airframe 70000_atmos; commander/failsafe/failsafe.cpp.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from companion.control.free_flyer.parameters import FreeFlyerControlParameters
from companion.preflight.autopilot_parameters import Rules, WantedChoice, WantedRange, WantedValue


@dataclass(frozen=True, slots=True, kw_only=True)
class WantedFreeFlyerParameters:
    """What each parameter must be, by PX4's names; a free-flyer with another value is not armed."""

    # [s] after which our setpoints count as lost
    COM_OF_LOSS_T: WantedRange = field(default_factory=lambda: WantedRange(least=0.2, most=1.0))
    # pseudo-inverse: sequential desaturation does not know thrust in all directions
    CA_METHOD: WantedChoice = field(default_factory=lambda: WantedChoice(values=(0,)))
    # Hold, where a flight ends: with another gain it drives to the origin of the autopilot's frame
    SPC_POS_P: WantedValue = field(default_factory=lambda: WantedValue(value=0.0))
    # setpoints lost and no sticks: Hold
    NAV_RCL_ACT: WantedChoice = field(default_factory=lambda: WantedChoice(values=(1,)))
    CA_AIRFRAME: WantedChoice = field(default_factory=lambda: WantedChoice(values=(13, 14)))

    def rules(self, control: FreeFlyerControlParameters) -> Rules:
        """Give what each parameter must be; those of the control loops as the configuration has them."""
        return {
            "COM_OF_LOSS_T": self.COM_OF_LOSS_T,
            "SPC_POS_P": self.SPC_POS_P,
            "NAV_RCL_ACT": self.NAV_RCL_ACT,
            "CA_METHOD": self.CA_METHOD,
            "CA_AIRFRAME": self.CA_AIRFRAME,
            "SC_YAW_P": WantedValue(value=control.heading_gain),
            **{f"CA_ROTOR{i}_KM": WantedValue(value=0.0) for i in range(8)},
        }
