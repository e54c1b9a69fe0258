"""Parameters of the ranging input; they are the section `ranging` of a configuration."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from annotated_types import Interval, MinLen

from companion.ranging.survey import LARGEST_ID

NO_INPUT = "none"
Offset = Annotated[float, Interval(ge=-10.0, le=10.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RangingParameters:
    """Ranges to anchors, by ultra-wideband radio."""

    # none, udp://address:port to listen on, serial:///dev/DEVICE?baud=RATE, or tcp://address:port that gives such lines
    input: Annotated[str, MinLen(1)] = NO_INPUT
    survey: Path | None = None  # file with the anchors; counts from this file's folder; needed with an input
    # of one range [m]: DWM1000 radios scatter by 2 to 3 cm in sight of each other, which is the paper's figure too
    std_m: Annotated[float, Interval(gt=0.0, le=1.0)] = 0.02
    # [s] from sending to arrival, beyond the age that a message states. A packet by wire takes a millisecond; a serial
    # line of 120 characters at 115200 bit/s takes 10 ms, and a DWM1001 measures up to 0.1 s before it prints
    latency_s: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.005
    # antenna of the vehicle's radio: forward, right, down of the body origin (of a free-flyer: in `d`)
    tag_lever_arm_m: tuple[Offset, Offset, Offset] = (0.0, 0.0, 0.0)
    # while a serial input is silent, a DWM1001's shell is opened and told `lec`; not for other devices
    dwm1001_shell: bool = False
    tag: Annotated[int, Interval(ge=0, le=LARGEST_ID)] | None = None  # id of this radio; none: the first that is heard
    silence_s: Annotated[float, Interval(gt=0.0, le=60.0)] = 1.0  # without a range: told to the operator
    range_most_m: Annotated[float, Interval(gt=0.0, le=1000.0)] = 300.0  # no such radio reaches farther
    age_most_s: Annotated[float, Interval(gt=0.0, le=10.0)] = 0.5  # stated; older ranges would only confuse
