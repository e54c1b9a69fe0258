from __future__ import annotations

import numpy as np
import pytest

from companion.config.tree import ControlSection
from companion.control.motion_observer import MotionObserver
from companion.geometry.arrays import Array
from companion.messages.ownship import OwnshipState


def at_rest(t: float, velocity_ned: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> OwnshipState:
    return OwnshipState(
        t=t,
        position_ned=np.zeros(3),
        velocity_ned=np.array(velocity_ned),
        acceleration_ned=np.zeros(3),
        ned_from_frd=np.eye(3),
        angular_velocity_frd=np.zeros(3),
        reset_counter=0,
    )


def watched(observer: MotionObserver, relative_velocity: Array, seconds: float = 3.0) -> MotionObserver:
    """Let a vehicle at rest watch its position relative to something that moves."""
    for t in np.arange(0.0, seconds, 0.02):
        observer.add(at_rest(float(t)), relative_velocity * t)
    return observer


@pytest.mark.parametrize("speed", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("course", [0.0, 0.8, -2.0])
def test_above_a_target_the_bias_is_its_whole_velocity(speed: float, course: float) -> None:
    """A target faster than any bias of an autopilot is no bias that must not be believed."""
    target = speed * np.array([np.cos(course), np.sin(course), 0.0])
    observer = watched(MotionObserver(ControlSection().relative_observer), -target)
    assert observer.settled
    assert observer.bias_ned == pytest.approx(target, abs=0.01)


def test_a_large_bias_of_the_autopilot_is_not_believed() -> None:
    observer = watched(MotionObserver(ControlSection().observer), np.array([-5.0, 0.0, 0.0]))
    assert observer.bias_ned[0] == ControlSection().observer.bias_max
