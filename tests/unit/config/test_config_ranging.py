from __future__ import annotations

import json
from pathlib import Path

import pytest

from companion.config import config_schema, load_config, load_flight
from companion.errors import InputError
from companion.ranging.survey_file import load_survey

ROOT = Path(__file__).resolve().parents[3]
MISSION = ROOT / "missions" / "land_static.yaml"


def test_without_a_word_there_is_no_ranging() -> None:
    assert load_config(ROOT / "config" / "x500_sim.yaml").ranging.input == "none"


def test_the_survey_counts_from_the_configurations_folder(tmp_path: Path) -> None:
    text = (ROOT / "config" / "x500_sim.yaml").read_text()
    path = tmp_path / "x500.yaml"
    path.write_text(f"{text}\nranging: {{input: 'udp://0.0.0.0:14660', survey: anchors/four.yaml}}\n")
    assert load_config(path).ranging.survey == tmp_path / "anchors" / "four.yaml"


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["ranging.input=udp://0.0.0.0:14660"], ["ranging.survey", "anchors are not known"]),
        (["ranging.input=udp://0.0.0.0"], ["ranging.input", "port is missing"]),
        (["ranging.input=usb"], ["ranging.input", "serial:///dev/ttyUSB0?baud=115200"]),
        (["ranging.survey=nowhere.yaml"], ["nowhere.yaml", "no such file"]),
        (["ranging.std_m=0"], ["ranging.std_m", "greater than 0"]),
    ],
)
def test_what_is_wrong_is_told_with_the_key(overrides: list[str], words: list[str]) -> None:
    with pytest.raises(InputError) as raised:
        load_flight(MISSION, overrides=overrides)
    for word in words:
        assert word in str(raised.value)


def test_a_missing_survey_is_told_once_also_where_the_mission_flies_by_ranges() -> None:
    with pytest.raises(InputError) as raised:
        load_flight(ROOT / "missions" / "land_uwb_then_vision.yaml", overrides=["ranging.survey=nowhere.yaml"])
    (problem,) = raised.value.problems
    assert problem.key == "ranging.survey"


def test_a_whole_ranging_input_is_in_order() -> None:
    survey = ROOT / "config" / "anchors" / "pad_four.yaml"
    flight = load_flight(MISSION, overrides=["ranging.input=udp://0.0.0.0:14660", f"ranging.survey={survey}"])
    assert flight.config.ranging.survey == survey


def test_the_schema_does_not_depend_on_what_was_read_before() -> None:
    load_survey(ROOT / "config" / "anchors" / "pad_four.yaml")
    written = (ROOT / "config" / "schema" / "config.schema.json").read_text(encoding="utf-8")
    assert json.dumps(config_schema(), indent=2, ensure_ascii=False) + "\n" == written
