"""The earliest intercept and the reachable sets."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from companion.messages.target import Prediction, TargetPose
from companion.prediction.intercept import earliest_intercept
from companion.prediction.reach import AcceleratingReach, ConstantSpeedReach


@dataclass(kw_only=True)
class Straight:
    """A forecast that answers one instant at a time."""

    position: np.ndarray
    velocity: np.ndarray
    sigma: float = 0.1
    t: float = 10.0
    horizon: float = 6.0
    reset_counter: int = 0
    asked: list[float] = field(default_factory=list)

    def at(self, t: float) -> TargetPose:
        self.asked.append(t)
        return TargetPose(
            t=t,
            position_ned=self.position + self.velocity * (t - self.t),
            velocity_ned=self.velocity,
            acceleration_ned=np.zeros(3),
            yaw=0.0,
            yaw_rate=0.0,
            covariance=np.eye(4) * self.sigma**2,
        )


@dataclass(kw_only=True)
class StraightAtOnce(Straight):
    """The same for many instants at once."""

    def positions_ned(self, times: np.ndarray) -> np.ndarray:
        return self.position + np.outer(times - self.t, self.velocity)


def meet(prediction: Prediction, reach: object = ConstantSpeedReach(speed=2.0), **changes: object):  # type: ignore[no-untyped-def]
    arguments: dict[str, object] = {
        "position_ned": np.zeros(3),
        "velocity_ned": np.zeros(3),
        "t": 10.0,
        "horizon": 6.0,
        "tolerance": 1e-4,
    }
    return earliest_intercept(prediction=prediction, reach=reach, **(arguments | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [Straight, StraightAtOnce])
@pytest.mark.parametrize(
    ("velocity", "expected"),
    [((0.0, 0.0, 0.0), 3.0 / 2.0), ((1.0, 0.0, 0.0), 3.0), ((-1.0, 0.0, 0.0), 1.0), ((0.0, 1.0, 0.0), 3.0 / 3.0**0.5)],
)
def test_time_of_meeting_is_the_exact_one(
    kind: type[Straight], velocity: tuple[float, float, float], expected: float
) -> None:
    found = meet(kind(position=np.array([3.0, 0.0, 0.0]), velocity=np.array(velocity)))
    assert found.feasible
    assert found.t - 10.0 == pytest.approx(expected, abs=3e-3)
    assert found.margin == pytest.approx(0.0, abs=0.01)
    assert found.pose.t == found.t
    assert found.probability == pytest.approx(0.5, abs=0.05)


def test_earliest_of_two_crossings_is_taken() -> None:
    class ThereAndBack(StraightAtOnce):
        def positions_ned(self, times: np.ndarray) -> np.ndarray:
            s = times - self.t
            inside = np.where((s < 2.0) & (s > 1.5), 0.5, 20.0)
            return np.stack([inside, 0.0 * s, 0.0 * s], axis=1)

        def at(self, t: float) -> TargetPose:
            self.position = self.positions_ned(np.array([t]))[0]
            return super().at(self.t)

    found = meet(ThereAndBack(position=np.zeros(3), velocity=np.zeros(3)), ConstantSpeedReach(speed=5.0))
    assert found.t - 10.0 == pytest.approx(1.5, abs=0.01)


def test_fallback_at_the_horizon() -> None:
    found = meet(StraightAtOnce(position=np.array([10.0, 0.0, 0.0]), velocity=np.array([3.0, 0.0, 0.0])))
    assert not found.feasible
    assert found.t == 16.0
    assert found.margin == pytest.approx(12.0 - 28.0)
    assert found.probability < 1e-6


def test_already_there() -> None:
    found = meet(StraightAtOnce(position=np.array([0.02, 0.0, 0.0]), velocity=np.zeros(3)), tolerance=0.05)
    assert found.feasible
    assert found.t == 10.0
    assert found.probability < 0.5


def test_probability_counts_the_spread_along_the_line_of_sight() -> None:
    rng = np.random.default_rng(0)
    prediction = StraightAtOnce(position=np.array([2.0, 1.0, -2.0]), velocity=np.zeros(3), sigma=0.05)
    for tolerance in (0.05, -0.08):
        found = meet(prediction, tolerance=tolerance)
        places = found.pose.position_ned + 0.05 * rng.standard_normal((20000, 3))
        share = np.mean(np.linalg.norm(places, axis=1) <= 2.0 * (found.t - 10.0))
        assert found.probability == pytest.approx(float(share), abs=0.02)


@pytest.mark.parametrize("speed", [0.0, 0.7, 2.0, 3.0])
def test_every_place_of_the_accelerating_reach_can_be_flown_to(speed: float) -> None:
    reach = AcceleratingReach(speed=2.0, acceleration=1.5, reaction=0.2)
    velocity = np.array([speed, 0.0, 0.0])
    start = min(speed, 2.0) * np.array([1.0, 0.0, 0.0])
    turning = (2.0 + float(np.linalg.norm(start))) / 1.5
    rng = np.random.default_rng(1)
    for _ in range(50):
        wanted = rng.standard_normal(3)
        wanted *= 2.0 * rng.random() / np.linalg.norm(wanted)
        t, dt, place, now = float(rng.uniform(0.3, 6.0)), 1e-3, np.zeros(3), start.copy()
        for k in range(int(t / dt)):
            if k * dt >= 0.2 and (k * dt - 0.2) < turning:
                acceleration = (wanted - start) / turning
                assert np.linalg.norm(acceleration) <= 1.5 + 1e-9
                now = now + acceleration * dt
            assert np.linalg.norm(now) <= 2.0 + 1e-2
            place = place + now * dt
        margin = reach.margin(np.array([t]), place[None], velocity)[0]
        bound = margin * (1.0 if np.linalg.norm(wanted) < 2.0 else 0.0)
        assert bound >= -0.02


def test_accelerating_reach_from_rest_is_the_exact_one() -> None:
    reach = AcceleratingReach(speed=2.0, acceleration=1.0)
    times = np.array([0.0, 1.0, 2.0, 5.0])
    margin = reach.margin(times, np.zeros((4, 3)), np.zeros(3))
    np.testing.assert_allclose(margin, [0.0, 0.5, 2.0, 8.0], atol=1e-12)
