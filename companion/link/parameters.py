"""Who talks to whom on the autopilot's link, and the tuning of its parts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Gt, Le

from companion.link.arming import ArmingParameters
from companion.link.commands import CommandParameters
from companion.link.odometry import OdometryParameters
from companion.link.operator_commands import OperatorParameters
from companion.link.parameter_reads import ParameterReadParameters
from companion.link.pilot_desk import PilotParameters
from companion.link.rates import RateParameters
from companion.link.status import StatusParameters
from companion.link.timesync import TimesyncParameters
from companion.vehicles.multicopter import MULTICOPTER_MAV_TYPES


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkParameters:
    """Who talks to whom, and the tuning of the parts."""

    system_id: Annotated[int, Ge(1), Le(255)] = 1  # of the vehicle; the companion uses the same
    component_id: Annotated[int, Ge(1), Le(255)] = 1  # of its autopilot
    own_component_id: Annotated[int, Ge(1), Le(255)] = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
    operator: OperatorParameters = field(default_factory=OperatorParameters)  # whose orders are obeyed
    heartbeat_rate: Annotated[float, Gt(0.0), Le(10.0)] = 1.0  # [Hz]
    vehicle_types: tuple[int, ...] = tuple(sorted(MULTICOPTER_MAV_TYPES))  # MAV_TYPEs that the program flies
    vehicle_wanted: str = "a multicopter with PX4 is needed"  # the same in words
    timesync: TimesyncParameters = field(default_factory=TimesyncParameters)
    odometry: OdometryParameters = field(default_factory=OdometryParameters)
    status: StatusParameters = field(default_factory=StatusParameters)
    rates: RateParameters = field(default_factory=RateParameters)
    commands: CommandParameters = field(default_factory=CommandParameters)
    arming: ArmingParameters = field(default_factory=ArmingParameters)
    parameter_reads: ParameterReadParameters = field(default_factory=ParameterReadParameters)
    pilot: PilotParameters = field(default_factory=PilotParameters)  # texts and numbers for people
