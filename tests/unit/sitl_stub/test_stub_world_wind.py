"""Wind: its statistics, its gusts, its repeatability."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from sitl_stub.world.documents import Interval
from sitl_stub.world.wind import CALM, Wind, WindConfig

STEADY = dataclasses.replace(WindConfig(), gust_interval=math.inf, direction=Interval(0.0, 0.0))


def blow(config: WindConfig, seconds: float, *, seed: int = 3, step: float = 0.05) -> np.ndarray:
    wind = Wind(config, np.random.default_rng(seed))
    return np.array([wind.step(step) for _ in range(round(seconds / step))])


def test_mean_deviation_and_correlation_time() -> None:
    config = STEADY
    history = blow(config, 8000.0)
    assert history.mean(axis=0) == pytest.approx([3.0, 0.0, 0.0], abs=0.1)
    assert history.std(axis=0) == pytest.approx([config.turbulence] * 2 + [config.vertical_turbulence], rel=0.08)
    for axis, time in ((0, config.turbulence_time), (2, config.vertical_time)):
        lag = round(time / 0.05)
        value = history[:, axis] - history[:, axis].mean()
        assert (value[lag:] * value[:-lag]).mean() / (value**2).mean() == pytest.approx(math.exp(-1.0), abs=0.08)


def test_the_turbulence_does_not_depend_on_the_step() -> None:
    assert blow(STEADY, 4000.0, step=0.2).std(axis=0) == pytest.approx(blow(STEADY, 4000.0).std(axis=0), rel=0.1)


def test_gusts_come_and_go_smoothly() -> None:
    config = dataclasses.replace(CALM, gust=Interval(2.0, 2.0), gust_length=Interval(2.0, 2.0), gust_interval=10.0)
    history = np.hypot(*blow(config, 1000.0, step=0.004)[:, :2].T)
    assert history.max() == pytest.approx(2.0, abs=1e-3)
    assert 0.10 < (history > 0.0).mean() < 0.25  # 2 s in 12
    assert np.abs(np.diff(history)).max() / 0.004 < 2.0 * math.pi / 2.0 + 0.01


def test_calm_is_calm() -> None:
    assert not blow(CALM, 20.0).any()


def test_the_mean_is_drawn_from_its_range_and_told() -> None:
    config = dataclasses.replace(WindConfig(), mean=Interval(2.0, 4.0))
    winds = [Wind(config, np.random.default_rng(seed)) for seed in range(50)]
    speeds = [wind.mean_speed for wind in winds]
    assert min(speeds) < 2.5
    assert max(speeds) > 3.5
    assert speeds == pytest.approx([math.hypot(*wind.mean_ned) for wind in winds])


def test_direction_is_drawn_and_seeds_repeat() -> None:
    directions = [math.atan2(*reversed(Wind(WindConfig(), np.random.default_rng(s)).mean_ned[:2])) for s in range(200)]
    assert np.histogram(directions, bins=4, range=(-math.pi, math.pi))[0].min() > 30
    assert np.array_equal(blow(WindConfig(), 10.0, seed=5), blow(WindConfig(), 10.0, seed=5))
    assert not np.array_equal(blow(WindConfig(), 10.0, seed=5), blow(WindConfig(), 10.0, seed=6))
