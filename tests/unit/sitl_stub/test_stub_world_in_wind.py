"""A world in another wind or with other dropouts, and targets that wait for the vehicle."""

from __future__ import annotations

import numpy as np
import pytest

from companion.campaign.versions import project_root
from companion.config import load_flight
from companion.errors import InputError
from sitl_stub.world.documents import WorldFileError
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


def test_a_mission_may_ask_for_other_dropouts() -> None:
    assert load_flight(FOLLOW).mission.dropout_s is None
    assert load_flight(FOLLOW, overrides=["simulation.dropout_s=7"]).mission.dropout_s == 7.0
    with pytest.raises(InputError, match="at least 0 and at most 60"):
        load_flight(FOLLOW, overrides=["simulation.dropout_s=61"])


def test_only_the_length_of_the_dropouts_changes() -> None:
    given = World.load("patel_uav_dropouts")
    begin, sight = given.camera_faults.blindness.begin, given.camera_faults.blindness.sight
    longer = given.with_dropouts(12.0)
    lost = [longer.camera_faults.drops(begin + t) for t in (0.0, sight - 0.1, sight + 0.1, sight + 11.9, sight + 12.1)]
    assert lost == [False, False, True, True, False]
    assert (longer.targets, longer.wind, longer.light) == (given.targets, given.wind, given.light)
    assert not given.with_dropouts(0.0).camera_faults.drops(begin + sight + 0.1)


def test_dropouts_want_a_world_that_has_them() -> None:
    with pytest.raises(WorldFileError, match=r"no dropouts .* camera\.blind"):
        World.load("patel_uav_1").with_dropouts(5.0)
    assert World.load("patel_uav_1").with_dropouts(0.0) == World.load("patel_uav_1")


def test_the_target_sets_off_in_sight_and_stops_in_sight() -> None:
    """It waits 15 s above 2.5 m: off at 25 to 26 s, the stop 60 s later; docs/papers.md."""
    world = World.load("patel_uav_dropouts")
    for length in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0):
        faults = world.with_dropouts(length).camera_faults
        assert not any(faults.drops(t) for t in np.arange(0.0, 30.0, 0.1))
        assert not any(faults.drops(t) for t in np.arange(81.0, 120.0, 0.1))
        assert sum(faults.drops(t) for t in np.arange(30.0, 81.0, 0.1)) > 8.0 / 0.1


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
