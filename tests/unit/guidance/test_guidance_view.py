"""Where a leaning vehicle will stand once it has set down."""

import math

import pytest
from guidance_views import GEAR, track, view

from companion.guidance.parameters import DescentParameters
from companion.guidance.view import View, relative_state, tip_offset


def leaning(
    *, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, velocity: tuple[float, float] = (0.0, 0.0)
) -> View:
    return view(velocity=(*velocity, 0.0), attitude=(roll, pitch, yaw), track=track())


def test_leaning_forward_it_will_stand_behind() -> None:
    """Nose down, the feet point backwards: that is where it tips to."""
    north, east = tip_offset(leaning(pitch=-0.1), DescentParameters(tip_factor=1.0))
    assert north == pytest.approx(-GEAR * math.sin(0.1))
    assert east == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_above_the_foot_offset_it_stands_on_the_point(yaw: float) -> None:
    """A vehicle that keeps the offset upwind of the pad has no error when it stands, in any heading."""
    descent = DescentParameters(tip_factor=1.0)
    looking = leaning(roll=0.05, pitch=-0.1, yaw=yaw)
    north, east = tip_offset(looking, descent)
    c, s = math.cos(yaw), math.sin(yaw)
    pad = track(x=c * north + s * east, y=-s * north + c * east)
    relative = relative_state(looking, pad, descent)
    assert relative.standing == pytest.approx(0.0, abs=1e-12)
    assert relative.lateral == pytest.approx(math.hypot(north, east))


def test_upright_and_still_it_stands_where_it_is() -> None:
    relative = relative_state(leaning(), track(x=0.03, y=-0.04, heading=0.02), DescentParameters())
    assert relative.standing == relative.standing_soon == pytest.approx(0.05)
    assert relative.standing_turn == pytest.approx(0.02)


def test_only_speed_across_the_lean_turns_it() -> None:
    descent = DescentParameters(tip_turn_s_per_m=3.0)
    along = relative_state(leaning(pitch=-0.1, velocity=(0.2, 0.0)), track(), descent)
    across = relative_state(leaning(pitch=-0.1, velocity=(0.0, 0.2)), track(), descent)
    other = relative_state(leaning(pitch=-0.1, velocity=(0.0, -0.2)), track(), descent)
    assert along.standing_turn == pytest.approx(0.0, abs=1e-12)
    assert across.standing_turn == pytest.approx(3.0 * math.sin(0.1) * 0.2)
    assert other.standing_turn == pytest.approx(-across.standing_turn)
