"""Control allocation: what gives way to what when rotors saturate."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl_stub.vehicle.mixer import PITCH, ROLL, SHARE, YAW, Mixer

TORQUE = st.floats(-1.0, 1.0)
THRUST = st.floats(0.0, 1.0)


def made(commands: list[float]) -> tuple[float, float, float, float]:
    """Torques and thrust that rotor commands produce, in units of the setpoints."""
    u = np.array(commands)
    return float(u @ ROLL) / 2.0, float(u @ PITCH) / 2.0, float(u @ YAW) / 4.0, float(u.sum()) / 4.0


@settings(deadline=None)
@given(roll=st.floats(-0.1, 0.1), pitch=st.floats(-0.1, 0.1), yaw=st.floats(-0.1, 0.1), thrust=st.floats(0.35, 0.65))
def test_without_saturation_each_axis_gets_what_it_asks_for(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    mixer = Mixer()
    assert made(mixer.mix(roll, pitch, yaw, thrust)) == pytest.approx((roll, pitch, yaw, thrust), abs=1e-9)
    assert mixer.saturated == [0, 0, 0]


@settings(deadline=None)
@given(roll=TORQUE, pitch=TORQUE, yaw=TORQUE, thrust=THRUST)
def test_commands_stay_in_range_and_thrust_is_not_raised_for_torque(
    roll: float, pitch: float, yaw: float, thrust: float
) -> None:
    commands = Mixer().mix(roll, pitch, yaw, thrust)
    assert all(0.0 <= command <= 1.0 for command in commands)
    # half of a cut may be given back after thrust was reduced, and outputs are clipped: never more than that
    assert made(commands)[3] <= max(thrust, 0.5) + 1e-9


def test_on_the_ground_without_thrust_there_is_no_torque() -> None:
    assert max(Mixer().mix(0.5, -0.3, 0.4, 0.001)) < 0.01


def test_thrust_gives_way_to_roll() -> None:
    roll, _, _, thrust = made(Mixer().mix(0.3, 0.0, 0.0, 1.0))
    assert roll == pytest.approx(0.3)
    assert thrust == pytest.approx(1.0 - SHARE * 0.3)


def test_yaw_in_hover_may_use_all_of_the_thrust_below_and_gives_way_to_roll() -> None:
    mixer = Mixer()
    assert made(mixer.mix(0.0, 0.0, 0.9, 0.49))[2] == pytest.approx(0.49, abs=0.01)
    assert mixer.saturated[2] == 1
    roll, _, yaw, _ = made(mixer.mix(0.4, 0.0, 0.9, 0.49))
    assert roll == pytest.approx(0.4, abs=1e-6)
    assert yaw < 0.49 - SHARE * 0.4 + 0.01


def test_yaw_keeps_a_margin_at_full_thrust() -> None:
    _, _, yaw, thrust = made(Mixer().mix(0.0, 0.0, 0.5, 1.0))
    assert yaw == pytest.approx(0.15, abs=0.01)
    assert thrust < 1.0
