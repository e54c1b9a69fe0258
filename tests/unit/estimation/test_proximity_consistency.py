"""Is the proximity filter as good as it says, and is its steady state the one that Riccati's equation gives?"""

from __future__ import annotations

import math

import numpy as np
import pytest
from proximity_consistency import examine
from proximity_world import DOCKING, SETUP, World, build, feed

from companion.estimation.consistency import average_bounds
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.estimation.proximity.steady_state import steady_state
from companion.geometry.rotations import quaternion_from_rotation

NEAR = World(duration=5.0, begin=(0.85, 1.5, 0.85), turn_from=1.0, vision_from=3.5)


@pytest.mark.parametrize("structure", ["tandem", "compounded"])
def test_nees_of_a_few_runs_is_inside_wide_bounds(structure):
    outcome = examine(list(range(101, 109)), NEAR, ProximityParameters(structure=structure))
    low, high = average_bounds(9, len(outcome.nees), 0.999)
    mean = outcome.nees.mean(axis=0)
    assert np.mean((mean > low) & (mean < high)) >= 0.9
    assert np.nanmean(outcome.ranges) == pytest.approx(1.0, abs=0.1)
    assert outcome.counts.get("outlier accepted", 0) == 0


@pytest.mark.parametrize("with_vision", [False, True])
def test_the_steady_state_is_that_of_the_filter_run_for_long(with_vision):
    world = World(duration=60.0, moving=False, vision_from=0.0 if with_vision else math.inf, outliers=0.0)
    parameters = ProximityParameters()
    last = feed(build(9, world), parameters, 60.0)[1][-1]
    pose = np.array(world.ends), quaternion_from_rotation(DOCKING)
    expected = steady_state(SETUP, parameters, *pose, with_vision=with_vision)
    ratio = np.sqrt(np.diag(last.covariance) / np.diag(expected))
    assert np.all((ratio > 0.85) & (ratio < 1.15)), ratio


def test_ranges_beside_pictures_help_and_distance_hurts():
    quaternion = quaternion_from_rotation(DOCKING)
    near, far = np.array([1.0, 1.6, 1.0]), np.array([1.0, 1.2, 1.0])
    alone, both = ProximityParameters(), ProximityParameters(ranges_with_vision=True)

    def trace(parameters, place):
        return float(np.trace(steady_state(SETUP, parameters, place, quaternion, with_vision=True)[:3, :3]))

    assert trace(both, near) < trace(alone, near) < trace(alone, far)


def test_anchors_in_a_line_are_refused():
    fields = {
        name: getattr(SETUP, name)
        for name in ("lever_arm", "markers", "c_from_t", "d_from_cam", "mass", "control_period")
    }
    line = ProximitySetup(anchors=np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), **fields)
    with pytest.raises(ValueError, match="three or more"):
        steady_state(line, ProximityParameters(), np.ones(3), np.array([1.0, 0.0, 0.0, 0.0]), with_vision=False)
