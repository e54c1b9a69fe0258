from __future__ import annotations

import json

import numpy as np
import pytest

from companion.campaign.path import FlightPath, PathRecorder


def truth(t: float, *, north: float = 0.0, yaw: float = 0.0, moving: bool = False) -> dict[str, object]:
    target = {"name": "pad", "position_ned": [1.0, 0.0, -0.15], "yaw": 0.5, "velocity_ned": [0.0, 0.0, 0.0]}
    return {
        "t": t,
        "position_ned": [north, 0.0, -3.0],
        "velocity_ned": [0.0, 0.0, 0.0],
        "quaternion": [np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)],
        "armed": True,
        "feet_in_contact": 0,
        "targets": [{**target, "moving": moving}],
    }


def test_a_path_is_kept_ten_times_a_second_and_comes_back() -> None:
    recorder = PathRecorder()
    for step in range(101):
        t = 0.02 * step
        recorder.record("truth", t, truth(t, north=t, yaw=3.0, moving=t > 1.05))
        recorder.record("track", t, {"t": t})
        recorder.record_bytes("mavlink_in", t, b"x")
    recorder.close()
    path = FlightPath.from_json(json.loads(json.dumps(recorder.path.as_json())))
    assert path.t == pytest.approx(np.arange(0.0, 2.01, 0.1))
    assert path.vehicle_ned[:, 0] == pytest.approx(path.t)
    assert path.lateral == pytest.approx(np.abs(1.0 - path.t))
    assert path.heading_error == pytest.approx(np.full(21, 2.5), abs=1e-3)
    assert path.t_moved == pytest.approx(1.1)


def test_a_target_that_never_moves_says_so() -> None:
    recorder = PathRecorder()
    recorder.record("truth", 0.0, truth(0.0))
    assert recorder.path.t_moved is None


def test_something_else_is_no_path() -> None:
    with pytest.raises(ValueError, match="reshape"):
        FlightPath.from_json([[1.0, 2.0]])
