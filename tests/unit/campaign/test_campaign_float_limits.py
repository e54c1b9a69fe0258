"""What a free-flyer's flight must keep to: its top speed, and clear of the target's boards."""

import math
from pathlib import Path

import numpy as np
import pytest

from companion.campaign.float_limits import FloatLimits, FloatMonitor
from companion.campaign.truth import TargetSample, TruthSample
from companion.messages.motion import SticksSetpoint
from companion.messages.thrust import AttitudeThrust
from companion.perception.pad_file import load_pad

DOCK = load_pad(Path(__file__).parents[3] / "config" / "pads" / "free_flyer_dock.yaml")


def monitor() -> FloatMonitor:
    return FloatMonitor(FloatLimits(speed=0.1, footprint_radius=0.22, clearance=DOCK.clearance))


def broken(*, ahead=0.0, right=0.0, speed=0.05, yaw=0.7) -> list[str]:
    """Put the vehicle beside the target, in the target's axes; give what is broken."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    target = TargetSample(
        name="t", position_ned=(3.0, -1.0, 0.0), yaw=yaw, velocity_ned=(0.0, 0.0, 0.0), yaw_rate=0.0, moving=True
    )
    watched = monitor()
    watched.truth(
        TruthSample(
            t=1.0,
            position_ned=(3.0 + cosine * ahead - sine * right, -1.0 + sine * ahead + cosine * right, -0.25),
            velocity_ned=(0.0, speed, 0.0),
            yaw=0.0,
            armed=True,
            feet_in_contact=4,
            surface="ground",
            targets=(target,),
        ),
        target,
    )
    return [violation.limit for violation in watched.violations]


def test_at_its_place_and_beside_it_nothing_is_broken() -> None:
    assert broken() == []
    assert broken(ahead=0.0, right=1.0) == []


@pytest.mark.parametrize("place", [(0.3, 0.0), (0.65, 0.3), (0.95, 0.0), (0.65, 0.0)])
def test_at_the_boards_it_has_touched_them(place) -> None:
    assert broken(ahead=place[0], right=place[1]) == ["nearness to the target"]


def test_sideways_speed_counts_too() -> None:
    assert broken(speed=-0.3) == ["speed"]


def test_thrust_is_its_form_of_setpoint() -> None:
    watched = monitor()
    watched.setpoint(AttitudeThrust(t=0.0, yaw=0.0, thrust_body=np.array([1.0, -1.0, 0.0])))
    assert watched.violations == ()
    watched.setpoint(SticksSetpoint(t=0.0, speed=0.0, yaw_rate=0.0, throttle=0.0, steering=0.0))
    assert [violation.limit for violation in watched.violations] == ["setpoint form"]


@pytest.mark.parametrize("part", [0, 1])
def test_a_thrust_that_is_no_number_is_broken(part) -> None:
    thrust = np.zeros(3)
    thrust[part] = math.nan
    watched = monitor()
    watched.setpoint(AttitudeThrust(t=1.0, yaw=0.0, thrust_body=thrust))
    assert [violation.limit for violation in watched.violations] == ["setpoint thrust"]
