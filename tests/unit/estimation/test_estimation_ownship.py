"""The ownship history: interpolation, resets, refusals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.estimation.ownship import OwnshipHistory, OwnshipHistoryParameters, OwnshipVerdict
from companion.geometry.angles import wrap_angle
from companion.geometry.rotations import rotation_about_z, rotation_from_euler, vector_from_rotation
from companion.messages.ownship import OwnshipState


def state_at(t: float, counter: int = 11) -> OwnshipState:
    return OwnshipState(
        t=t,
        position_ned=np.array([math.sin(t), t * t, -2.0 + 0.5 * t]),
        velocity_ned=np.array([math.cos(t), 2.0 * t, 0.5]),
        acceleration_ned=np.array([-math.sin(t), 2.0, 0.0]),
        ned_from_frd=rotation_from_euler(0.1, -0.2, 3.0 + 0.5 * t),
        angular_velocity_frd=rotation_from_euler(0.1, -0.2, 0.0).T @ np.array([0.0, 0.0, 0.5]),
        reset_counter=counter,
    )


def filled(until: float = 2.0, rate: float = 30.0, **parameters: float) -> OwnshipHistory:
    history = OwnshipHistory(OwnshipHistoryParameters(**parameters))  # type: ignore[arg-type]
    for k in range(int(until * rate) + 1):
        assert history.add(state_at(k / rate)) is None
    return history


@pytest.mark.parametrize("t", [0.5, 0.517, 1.3333, 1.99, 2.05])
def test_between_samples_and_shortly_after(t: float) -> None:
    history = filled()
    got, want = history.at(t), state_at(t)
    assert got is not None
    np.testing.assert_allclose(got.position_ned, want.position_ned, atol=2e-4)
    np.testing.assert_allclose(got.velocity_ned, want.velocity_ned, atol=2e-3)
    assert np.linalg.norm(vector_from_rotation(got.ned_from_frd.T @ want.ned_from_frd)) < 1e-6
    pose = history.pose_at(t)
    assert pose is not None
    np.testing.assert_allclose(pose[:3], got.position_ned, atol=1e-12)
    assert wrap_angle(pose.yaw - got.yaw) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(pose.axes, got.ned_from_frd[:, :2], atol=1e-12)


def test_outside_there_is_nothing() -> None:
    history = filled(extrapolation=0.1)
    for t in (-0.01, 2.11, math.nan, math.inf):
        assert history.at(t) is None
        assert history.pose_at(t) is None
    assert OwnshipHistory().at(0.0) is None


def test_nothing_is_interpolated_inside_a_gap() -> None:
    history = filled()
    history.add(state_at(4.0))
    assert history.at(2.1) is not None
    assert history.at(3.0) is None
    assert history.at(4.0) is not None


def test_bad_inputs_are_left_out() -> None:
    history = filled()
    good = state_at(2.5)
    for bad, verdict in (
        (state_at(2.0), OwnshipVerdict.IGNORED_DUPLICATE),
        (state_at(1.0), OwnshipVerdict.IGNORED_OLD),
        (replace(good, t=math.nan), OwnshipVerdict.REFUSED_INVALID),
        (replace(good, position_ned=np.array([0.0, math.nan, 0.0])), OwnshipVerdict.REFUSED_INVALID),
        (replace(good, velocity_ned=np.array([math.inf, 0.0, 0.0])), OwnshipVerdict.REFUSED_INVALID),
        (replace(good, ned_from_frd=np.eye(3) * 1.1), OwnshipVerdict.REFUSED_INVALID),
        (replace(good, ned_from_frd=np.diag([1.0, 1.0, -1.0])), OwnshipVerdict.REFUSED_INVALID),
    ):
        assert history.add(bad) is None
        assert history.verdict is verdict
    assert history.refused == 7
    assert history.newest is not None
    assert history.newest.t == 2.0


@pytest.mark.parametrize("counter", [12, 14, 0])
def test_reset_keeps_the_history_continuous(counter: int) -> None:
    history, yaw, shift = filled(), 0.7, np.array([14.8, -76.7, 2.0])
    turn = rotation_about_z(yaw)
    before = [history.at(t) for t in (1.5, 1.9)]
    old = state_at(2.02)
    reset = history.add(
        replace(
            old,
            position_ned=turn @ old.position_ned + shift,
            velocity_ned=turn @ old.velocity_ned,
            ned_from_frd=turn @ old.ned_from_frd,
            reset_counter=counter,
        )
    )
    assert reset is not None
    assert reset.counter == counter
    assert history.verdict is OwnshipVerdict.RESET
    assert wrap_angle(reset.yaw - yaw) == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_allclose(reset.position(old.position_ned), turn @ old.position_ned + shift, atol=1e-3)
    for t, past in zip((1.5, 1.9), before, strict=True):
        now = history.at(t)
        assert past is not None
        assert now is not None
        assert now.reset_counter == counter
        np.testing.assert_allclose(now.position_ned, reset.position(past.position_ned), atol=1e-9)
        np.testing.assert_allclose(now.velocity_ned, reset.rotation @ past.velocity_ned, atol=1e-9)
        np.testing.assert_allclose(now.ned_from_frd, reset.rotation @ past.ned_from_frd, atol=1e-9)


def test_memory_is_bounded() -> None:
    history = OwnshipHistory(OwnshipHistoryParameters(duration=1.0, capacity=200))
    for k in range(5000):
        history.add(state_at(0.02 * k))
        assert len(history) <= 200
    burst = OwnshipHistory(OwnshipHistoryParameters(duration=10.0, capacity=50))
    for k in range(500):
        burst.add(state_at(0.001 * k))
        assert len(burst) <= 50
    assert burst.at(0.49) is not None
