"""Naming one value of a section changes that one, whatever its other defaults come from."""

from dataclasses import dataclass, field

import pytest

from companion.config.load import load_config
from companion.documents import parse_document, validate
from companion.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    speed: float = 1.0
    turn: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Planner:
    weights: Weights = field(default_factory=lambda: Weights(speed=5.0))
    steps: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Root:
    planner: Planner = field(default_factory=lambda: Planner(weights=Weights(speed=7.0, turn=8.0), steps=9))
    plain: Planner | None = None


def read(text: str) -> Root:
    return validate(parse_document(text, source="test.yaml"), Root)


def test_what_is_left_out_of_a_section_is_the_default_of_its_field() -> None:
    assert read("planner: {weights: {turn: 2.0}}").planner == Planner(weights=Weights(speed=7.0, turn=2.0), steps=9)
    assert read("planner: {steps: 4}").planner == Planner(weights=Weights(speed=7.0, turn=8.0), steps=4)


def test_a_section_without_such_a_default_has_the_class_s() -> None:
    assert read("plain: {weights: {turn: 2.0}}").plain == Planner(weights=Weights(speed=5.0, turn=2.0))


def test_a_wrong_name_is_still_wrong() -> None:
    with pytest.raises(InputError, match="wieghts"):
        read("planner: {wieghts: {turn: 2.0}}")


def test_an_override_of_the_rover_s_weights_changes_one_of_them() -> None:
    before = load_config("config/rover_sim.yaml").driving
    after = load_config("config/rover_sim.yaml", ["driving.station.speed=0.7"]).driving
    assert after.station.speed == 0.7
    assert after.station.clearance == before.station.clearance > 0.0
    assert after.planner == before.planner
