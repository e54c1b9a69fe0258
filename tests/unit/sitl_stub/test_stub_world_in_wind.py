"""A world in another wind, and targets that wait for the vehicle."""

from __future__ import annotations

import numpy as np
import pytest

from companion.campaign.versions import project_root
from companion.config import load_flight
from companion.errors import InputError
from sitl_stub.world.wind import CALM, Wind, WindConfig
from sitl_stub.world.world import World

FOLLOW = project_root() / "missions" / "papers" / "patel_uav_follow.yaml"


def blown(config: WindConfig, seed: int = 1) -> np.ndarray:
    wind = Wind(config, np.random.default_rng(seed))
    return np.array([wind.step(0.1) for _ in range(20_000)])


def test_the_default_wind_is_that_of_3_mps_and_none_is_calm() -> None:
    assert WindConfig.of_mean(3.0) == WindConfig()
    assert WindConfig.of_mean(0.0) == CALM
    assert not blown(WindConfig.of_mean(0.0)).any()


def test_strength_and_turbulence_are_in_proportion_to_the_mean() -> None:
    weak, strong = blown(WindConfig.of_mean(2.5)), blown(WindConfig.of_mean(5.0))
    assert np.hypot(*strong.mean(axis=0)[:2]) == pytest.approx(2.0 * np.hypot(*weak.mean(axis=0)[:2]), rel=0.2)
    assert strong[:, 2].std() == pytest.approx(0.5, rel=0.1)  # a tenth of the mean wind, MIL-F-8785C
    assert weak[:, 2].std() == pytest.approx(0.25, rel=0.1)


def test_a_mission_may_ask_for_another_wind() -> None:
    assert load_flight(FOLLOW).mission.wind_mps is None
    assert load_flight(FOLLOW, overrides=["simulation.wind_mps=5"]).mission.wind_mps == 5.0
    with pytest.raises(InputError, match="at least 0 and at most 20"):
        load_flight(FOLLOW, overrides=["simulation.wind_mps=-1"])


def test_only_the_wind_changes() -> None:
    calm = World.load("patel_uav_4")
    windy = calm.in_wind(5.0)
    assert calm.wind == CALM
    assert windy.wind == WindConfig.of_mean(5.0)
    assert (windy.targets, windy.light, windy.camera_faults) == (calm.targets, calm.light, calm.camera_faults)


@pytest.mark.parametrize("number", range(1, 8))
def test_the_profiles_are_those_of_the_table(number: int) -> None:
    speeds = [(0.5, 0.5), (1.0, 1.0), (0.5, 0.5), (0.0, 0.5), (0.0, 0.5), (0.0, 1.0), (0.0, 1.0)]
    turns = [False, False, True, False, True, False, True]
    [target] = World.load(f"patel_uav_{number}").targets
    motion = target.motion
    assert (motion.speed.low, motion.speed.high) == speeds[number - 1]
    assert (motion.turn_rate.low, motion.turn_rate.high) == ((-1.0, 1.0) if turns[number - 1] else (0.0, 0.0))
    assert (motion.period, motion.duration.low, motion.duration.high) == (0.1, 60.0, 60.0)
    assert target.pad.size == (0.8, 0.8)
    assert target.starts.vehicle_above > 0.0
