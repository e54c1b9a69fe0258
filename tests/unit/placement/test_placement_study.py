"""Places and ways as Algorithm 1 sees them, maps, and the search."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from proximity_world import SETUP

from companion.geometry.arrays import Array
from companion.guidance.docking.policies import MarkovSwitching
from companion.messages.docking import DockingMode, SwitchingSituation
from companion.perception.docking_port import load_port
from companion.placement.area import Area, assess_area
from companion.placement.assessment import CONSISTENT, assess, corridor, foresee, reorient_range
from companion.placement.geometry import flatness
from companion.placement.mounting import Mounting, box_round
from companion.placement.scene import Scene
from companion.placement.search import Objective, Proposal, propose, quality

ROOT = Path(__file__).resolve().parents[3]
PORT = load_port(ROOT / "config/docks/cubesat_port.yaml")
SCENE = Scene(setup=SETUP, start_quaternion=np.array([1.0, 0.0, 0.0, 0.0]), port=PORT)
START = np.array([0.0, 1.0, 0.0])
BODY = box_round(SETUP.anchors)
BUNCHED = np.array([[1.0, -0.2, 0.5], [1.0, 0.2, 0.3], [1.0, 0.2, -0.1], [0.7, -0.2, 0.5]])
PLACES = np.concatenate(
    [np.linspace(np.array(s), PORT.docked_position, 3) for s in [START, (1.4, 0.6, 0.8), (-1, 1, 0)]]
)


def test_a_place_is_seen_by_algorithm_1_as_by_the_policy_in_flight() -> None:
    place = assess(SCENE, PORT.docked_position + 0.5 * PORT.outward)
    assert place.range == pytest.approx(0.5)
    assert place.seen_docking
    assert not place.seen_at_start
    turn = math.sin(math.radians(60.0))  # half of the 120 degrees between both attitudes
    for mode, name in ((DockingMode.APPROACH, "a11"), (DockingMode.REORIENT, "steady_align")):
        verdict = MarkovSwitching().decide(
            SwitchingSituation(
                mode=mode,
                range=0.5,
                reorient_range=reorient_range(SCENE, PORT),
                misalignment=turn,
                position_std=place.known_std,
                mahalanobis=CONSISTENT,
                vision=True,
            )
        )
        assert verdict.probabilities is not None
        assert getattr(place.chain, name) == pytest.approx(getattr(verdict.probabilities, name))
    assert place.known_std < 0.1 * place.worst_std  # the camera knows better


def test_a11_reaches_its_threshold_where_the_turn_is_foreseen() -> None:
    chosen = reorient_range(SCENE, PORT)
    assert 0.3 < chosen < 1.0
    away = (START - PORT.docked_position) / np.linalg.norm(START - PORT.docked_position)
    assert assess(SCENE, PORT.docked_position + chosen * away).chain.a11 == pytest.approx(0.4)


def test_far_away_nothing_is_asked_of_algorithm_1() -> None:
    place = assess(SCENE, START)
    assert math.isnan(place.chain.a11)
    assert math.isnan(place.chain.steady_align)
    assert np.max(place.axis_std) <= place.worst_std + 1e-12
    assert place.mirror == pytest.approx(
        2.0 * abs(np.array([0.0, 2.5, 1.0]) @ (START + SETUP.lever_arm)) / math.hypot(2.5, 1.0)
    )


def test_the_way_to_the_port_has_its_worst_place() -> None:
    way = corridor(SCENE, PORT, START, places=9)
    assert way.places[0].position == pytest.approx(START)
    assert way.places[-1].position == pytest.approx(PORT.docked_position)
    assert way.worst.known_std == max(place.known_std for place in way.places)
    assert 0.1 <= way.align_range < way.reorient_range
    steady = [place.chain.steady_align for place in way.places if place.range < way.reorient_range]
    assert all(0.6 < value <= 1.0 for value in steady[:-1])


def test_the_worse_the_position_is_known_the_earlier_the_chaser_aligns() -> None:
    """Section V-D: the steady state follows from the steady-state covariance."""
    foreseen = [foresee(SCENE, PORT, std) for std in (0.0, 0.003, 0.01, 0.02, 0.05, math.inf)]
    ranges = [one.align_range for one in foreseen]
    assert ranges == sorted(ranges)
    assert ranges[0] == 0.1
    assert 0.3 < ranges[-1] < reorient_range(SCENE, PORT)
    least = [one.least_steady_align for one in foreseen]
    assert least == sorted(least, reverse=True)
    assert least[0] == 1.0


def test_nobody_starts_inside_or_behind_the_mother_ship_or_beside_the_target() -> None:
    area = Area(x=np.array([0.0, 1.0]), y=np.array([-1.0, 0.0, 1.0, 1.95]), z=np.array([-0.4, 1.0]), kept_out=BODY)
    found = assess_area(SCENE, area)
    stds = found.values(lambda place: place.worst_std)
    assert stds.shape == (2, 4, 2)
    assert np.isnan(stds[0, :2]).all()  # behind it, and inside
    assert np.isnan(stds[1, 3, 1])  # beside the target
    assert np.isfinite(stds[1, 2]).all()
    assert found.best.worst_std == np.nanmin(stds)
    assert found.worst.worst_std == np.nanmax(stds)
    assert len(area.positions(SCENE)) == len(found.starts) == np.isfinite(stds).sum()
    anchor = SETUP.anchors[0]
    assert not Area(x=anchor[:1], y=anchor[1:2], z=anchor[2:]).open_to(SCENE, anchor + 0.05)
    assert SCENE.by_ranges(anchor - SETUP.lever_arm) is None  # the radio at the anchor
    nowhere = Area(x=np.zeros(1), y=np.zeros(1), z=np.zeros(1), kept_out=BODY)
    with pytest.raises(ValueError, match="no place of the region"):
        assess_area(SCENE, nowhere)


def found_for(anchors: Array, *, seed: int = 1, objective: Objective = Objective.RMS, count: int = 4) -> Proposal:
    mounting = Mounting(box=BODY, count=count)
    return propose(SCENE.with_anchors(anchors), mounting, PLACES, np.random.default_rng(seed), objective=objective)


@pytest.mark.parametrize("objective", list(Objective))
def test_bunched_anchors_are_spread(objective: Objective) -> None:
    heard: list[tuple[int, int]] = []
    scene, mounting = SCENE.with_anchors(BUNCHED), Mounting(box=BODY)
    proposal = propose(
        scene, mounting, PLACES, np.random.default_rng(1), objective=objective, report=lambda *part: heard.append(part)
    )
    assert not proposal.kept
    assert proposal.improvement(objective) > 0.2
    assert quality(scene.with_anchors(proposal.anchors), PLACES) == proposal.proposed
    assert mounting.on_face(proposal.anchors).all()
    assert mounting.admits(proposal.anchors[None]).all()
    assert flatness(proposal.anchors) >= 0.1
    assert [done for done, _ in heard] == list(range(1, heard[-1][1] + 1))


def test_the_same_seed_gives_the_same_places() -> None:
    assert np.array_equal(found_for(BUNCHED).anchors, found_for(BUNCHED).anchors)


def test_a_proposal_is_never_worse_than_what_it_was_given() -> None:
    once = found_for(BUNCHED)
    again = found_for(once.anchors, seed=2)
    assert again.proposed.rms <= once.proposed.rms
    assert again.improvement(Objective.RMS) < 0.03  # other dice find nearly the same
    if again.kept:
        assert np.array_equal(again.anchors, once.anchors)


def test_another_number_of_anchors_is_proposed() -> None:
    proposal = found_for(BUNCHED, count=6)
    assert proposal.anchors.shape == (6, 3)


def test_anchors_that_do_not_fit_are_refused() -> None:
    mounting = Mounting(box=BODY, count=8, spacing=1.5)
    with pytest.raises(ValueError, match="do not fit"):
        propose(SCENE, mounting, PLACES, np.random.default_rng(1))
