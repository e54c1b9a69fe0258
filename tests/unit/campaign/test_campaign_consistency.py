from __future__ import annotations

import math

import numpy as np
import pytest

from companion.campaign.consistency import NeesSeries, consistency, nees_of
from companion.recording import MemoryRecorder, Recording

SIGMA = np.array([0.05, 0.08, 0.03, 0.02])


def flight(rng: np.random.Generator, *, stated: float = 1.0, seconds: float = 6.0) -> Recording:
    """A vehicle that turns and drifts beside a turning pad; a track with errors of SIGMA, stated times `stated`."""
    recorder = MemoryRecorder()
    corner = rng.normal(size=(4, 4)) * 0.3 + np.eye(4)
    root = np.diag(SIGMA) @ corner
    covariance = np.zeros((8, 8))
    covariance[:4, :4] = root @ root.T * stated**2
    covariance[4:, 4:] = np.eye(4)
    for k in range(int(seconds * 50)):
        t = k / 50
        yaw, pad_yaw = 3.0 + 0.4 * t, 3.1 + 0.5 * t
        vehicle, pad = np.array([0.3 * t, -0.1, -3.0 * min(1.0, t / 0.4)]), np.array([1.0 + 0.5 * t, 2.0, -0.15])
        feet = 4 if t < 0.1 or t > 5.0 else 0
        if abs(t - 0.12) < 0.005:  # it lifts off unevenly and touches the ground once more
            feet = 0
        elif abs(t - 0.14) < 0.005:
            feet = 1
        recorder.record(
            "truth",
            t,
            {
                "t": t,
                "position_ned": vehicle.tolist(),
                "velocity_ned": [0.3, 0.0, 0.0],
                "quaternion": [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)],
                "armed": True,
                "feet_in_contact": feet,
                "targets": [
                    {
                        "name": "pad",
                        "position_ned": pad.tolist(),
                        "yaw": pad_yaw,
                        "velocity_ned": [0.5, 0.0, 0.0],
                        "moving": True,
                    }
                ],
            },
        )
        if t < 0.5:
            continue
        offset = pad - vehicle
        level = [
            math.cos(yaw) * offset[0] + math.sin(yaw) * offset[1],
            -math.sin(yaw) * offset[0] + math.cos(yaw) * offset[1],
            offset[2],
        ]
        error = root @ rng.normal(size=4) if k % 5 == 0 else np.full(4, 9.0)  # only the first of an epoch counts
        state = np.concatenate((np.array([*level, pad_yaw - yaw + 2.0 * math.pi]) + error, np.zeros(4)))
        recorder.record("track", t, {"t": t, "state": state.tolist(), "covariance": covariance.tolist()})
    return recorder.recording()


def runs(stated: float) -> list[NeesSeries]:
    rng = np.random.default_rng(5)
    return [nees_of(flight(rng, stated=stated)) for _ in range(30)]


def test_a_truthful_covariance_is_found_consistent() -> None:
    found = consistency(runs(1.0))
    assert found.runs == 30
    assert found.epochs == 46  # from 0.5 s to the contact at 5 s
    assert found.inside >= 0.85
    assert found.mean == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize(("stated", "side"), [(0.7, "above"), (1.4, "below")])
def test_a_covariance_that_lies_is_found_out(stated: float, side: str) -> None:
    found = consistency(runs(stated))
    assert found.inside < 0.3
    assert getattr(found, side) > 0.7


def test_epochs_with_few_runs_are_left_out() -> None:
    long = NeesSeries(epoch=np.arange(10.0), nees=np.full(10, 4.0))
    short = NeesSeries(epoch=np.arange(5.0), nees=np.full(5, 4.0))
    assert consistency([long, short, short]).epochs == 5
    assert consistency([long, short, short], least_runs=1).epochs == 10


def test_without_tracks_there_is_nothing_to_say() -> None:
    empty = nees_of(MemoryRecorder().recording())
    assert empty.epoch.size == 0
    assert consistency([empty]).epochs == 0
    assert consistency([empty]).inside == 0.0
