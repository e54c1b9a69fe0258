"""The recording of a docking as arrays over time: what its picture draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.geometry.arrays import Array
from companion.recording import Record, Recording
from companion.report.series import ModeSpan, mode_spans, probabilities_over

DOCKING_CHANNELS = frozenset(("scene", "truth", "proximity", "docking", "pose_goal", "features", "result"))
_PICTURE_AGE = 0.11  # [s] two pictures of 20 Hz: the port is in sight while the newest is not older
_ATTITUDE = slice(6, 9)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """What stands where, in c, as known to the chaser."""

    anchors: Array  # (n, 3) [m]
    target_position: Array  # (3,) [m]
    target_quaternion: Array  # (4,) c_from_t, and the docking attitude
    target_side: float  # [m]
    docked_position: Array  # (3,) [m] of the docked chaser's centre
    camera_position: Array  # (3,) [m], in d
    camera_quaternion: Array  # (4,) d_from_cam
    camera_half_angle: float  # [rad] of its cone of sight
    true_docked_position: Array  # (3,) [m], in c: where the target really stands
    true_target_quaternion: Array  # (4,)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChaserSeries:
    """True motion of the chaser, in c."""

    t: Array  # (n,) [s]
    position: Array  # (n, 3) [m]
    velocity: Array  # (n, 3) [m/s]
    quaternion: Array  # (n, 4) c_from_d
    impulse: Array  # (n,) [N s] of all nozzles so far


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EstimateSeries:
    """The estimate's true errors beside what it says of them."""

    t: Array  # (n,) [s]
    position_error: Array  # (n, 3) [m] estimate minus truth, in c
    position_std: Array  # (n, 3) [m]
    attitude_error: Array  # (n,) [rad]
    attitude_std: Array  # (n,) [rad] of the worst axis


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DockingRun:
    """Everything that the picture of a docking shows."""

    scene: Scene
    truth: ChaserSeries
    estimate: EstimateSeries
    range: Array  # (n,) [m] true distance from the true docked place
    attitude: Array  # (n,) [rad] true angle from the docking attitude
    goal_speed: tuple[Array, Array]  # times (n,) and the goal's speed (n,) [m/s]
    modes: tuple[ModeSpan, ...]
    probabilities: Mapping[str, tuple[Array, Array]]  # name -> times (n,), values (n,)
    seen: tuple[Array, Array]  # times (n,) and 1.0 where the port was in sight
    result: Mapping[str, Any] | None
    metadata: Mapping[str, Mapping[str, str]]
    complete: bool  # False: the recording ends early

    @property
    def t(self) -> Array:
        """(n,) [s] times of the truth."""
        return self.truth.t


def docking_of(recording: Recording) -> DockingRun | None:
    """Take apart the recording of a docking; None where it is none, or holds no truth to draw."""
    scene, states = _scene(recording.of("scene")), recording.of("proximity")
    if scene is None or not states or not recording.of("truth"):
        return None
    truth = _truth(recording.of("truth"))
    decisions = recording.of("docking")
    goals = recording.of("pose_goal")
    verdicts = [Record(t=r.t, data={"t": r.t, **(r.data.get("verdict") or {})}) for r in decisions]
    return DockingRun(
        scene=scene,
        truth=truth,
        estimate=_estimate(states, truth),
        range=np.linalg.norm(truth.position - scene.true_docked_position, axis=1),
        attitude=_angles(truth.quaternion, scene.true_target_quaternion),
        goal_speed=(
            np.array([record.t for record in goals]),
            np.linalg.norm(np.array([record.data["velocity"] for record in goals]), axis=1),
        ),
        modes=mode_spans(decisions, float(truth.t[-1])),
        probabilities=probabilities_over(verdicts),
        seen=_seen(truth.t, np.array([record.t for record in recording.of("features")])),
        result=recording.last("result"),
        metadata=recording.metadata,
        complete=recording.complete,
    )


def _scene(records: Sequence[Record]) -> Scene | None:
    if not records:
        return None
    data = records[0].data
    arrays = {
        name: np.array(data[name], dtype=float)
        for name in (
            "anchors",
            "target_position",
            "target_quaternion",
            "docked_position",
            "camera_position",
            "camera_quaternion",
            "true_docked_position",
            "true_target_quaternion",
        )
    }
    return Scene(target_side=float(data["target_side"]), camera_half_angle=float(data["camera_half_angle"]), **arrays)


def _truth(records: Sequence[Record]) -> ChaserSeries:
    return ChaserSeries(
        t=np.array([record.t for record in records]),
        position=np.array([record.data["position"] for record in records]),
        velocity=np.array([record.data["velocity"] for record in records]),
        quaternion=np.array([record.data["quaternion"] for record in records]),
        impulse=np.array([record.data["impulse_ns"] for record in records]),
    )


def _estimate(records: Sequence[Record], truth: ChaserSeries) -> EstimateSeries:
    """Lay the estimate beside the truth of the same step: both are recorded once in each control period."""
    t = np.array([record.t for record in records])
    at = np.searchsorted(truth.t, t - 1e-6).clip(max=len(truth.t) - 1)
    covariance = np.array([record.data["covariance"] for record in records])
    stds = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).clip(0.0))
    return EstimateSeries(
        t=t,
        position_error=np.array([record.data["position"] for record in records]) - truth.position[at],
        position_std=stds[:, :3],
        attitude_error=_angles(np.array([record.data["quaternion"] for record in records]), truth.quaternion[at]),
        attitude_std=stds[:, _ATTITUDE].max(axis=1),
    )


def _angles(one: Array, other: Array) -> Array:
    """Give the angles (n,) [rad] between attitudes (n, 4) and (n, 4) or (4,)."""
    angles: Array = 2.0 * np.arccos(np.abs(np.sum(one * other, axis=1)).clip(max=1.0))
    return angles


def _seen(t: Array, pictures: Array) -> tuple[Array, Array]:
    if not pictures.size:
        return t, np.zeros(len(t))
    newest = pictures[(np.searchsorted(pictures, t, side="right") - 1).clip(0)]
    return t, ((t >= newest) & (t - newest <= _PICTURE_AGE)).astype(float)
