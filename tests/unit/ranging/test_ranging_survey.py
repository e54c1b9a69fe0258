from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from companion.errors import InputError
from companion.ranging.survey import Anchor, AnchorSurvey, SurveyFrame, geometry_remarks
from companion.ranging.survey_file import load_survey, survey_text, write_survey

ROOT = Path(__file__).resolve().parents[3]


def survey_of(*places: tuple[float, float, float]) -> AnchorSurvey:
    anchors = tuple(Anchor(id=index, position=place) for index, place in enumerate(places))
    return AnchorSurvey(name="test", frame=SurveyFrame.PAD, anchors=anchors)


def written(folder: Path, *anchors: str) -> Path:
    path = folder / "anchors.yaml"
    lines = "".join(f"  - {{{anchor}}}\n" for anchor in anchors)
    path.write_text(f"version: 1\nname: test\nframe: pad\nanchors:\n{lines}")
    return path


@pytest.mark.parametrize("path", sorted((ROOT / "config" / "anchors").glob("*.yaml")), ids=lambda path: path.stem)
def test_each_survey_of_the_project_is_in_order(path: Path) -> None:
    assert len(load_survey(path).anchors) == 4


def test_the_papers_anchors_lie_in_one_plane_and_those_of_the_pad_do_not() -> None:
    (remark,) = geometry_remarks(load_survey(ROOT / "config/anchors/cubesat_mothership.yaml"))
    assert "one plane" in remark
    assert geometry_remarks(load_survey(ROOT / "config/anchors/pad_four.yaml")) == ()


@pytest.mark.parametrize(
    ("places", "word"),
    [
        ([(0, 0, 0)], "one anchor"),
        ([(0, 0, 0), (1, 0, 0)], "two anchors"),
        ([(0, 0, 0), (1, 1, 1), (2, 2, 2.01)], "one line"),
        ([(0, 0, 0), (3, 0, 0), (0, 3, 0)], "add an anchor"),
        ([(0, 0, 0), (3, 0, 0), (0, 3, 0), (3, 3, 0.02)], "move one anchor"),
    ],
)
def test_what_the_geometry_leaves_in_doubt_is_said(places, word) -> None:
    (remark,) = geometry_remarks(survey_of(*places))
    assert word in remark


def test_ids_are_hexadecimal_text_or_numbers(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        'id: "022E", position_m: [0, 0, 0]',
        "id: 0x9280, position_m: [1, 0, 0]",
        "id: 17, position_m: [0, 1, 0]",
        'id: "0xDECA22C0FFEE0001", position_m: [0, 0, 1], delay_m: 0.12',
    )
    survey = load_survey(path)
    assert [anchor.id for anchor in survey.anchors] == [0x022E, 0x9280, 17, 0xDECA22C0FFEE0001]
    assert [anchor.delay for anchor in survey.anchors] == [0.0, 0.0, 0.0, 0.12]


@pytest.mark.parametrize(
    ("anchors", "words"),
    [
        (['id: "xyz", position_m: [0, 0, 0]'], ["anchors.0.id", "no hexadecimal number", "0x022E"]),
        (["id: 1, position_m: [0, 0, 0]", 'id: "01", position_m: [1, 0, 0]'], ["anchors.1.id", "anchor 1 has"]),
        (["id: 1, position_m: [0, 0, 0]", "id: 2, position_m: [0, 0.01, 0]"], ["anchors.1.position_m", "same place"]),
        (["id: 1, position_m: [0, .nan, 0]"], ["position_m.1", "not-a-number"]),
        (["id: -1, position_m: [0, 0, 0]"], ["anchors.0.id", "at least 0"]),
        ([f"id: {k}, position_m: [{k}, 0, 0]" for k in range(9)], ["anchors"]),
        ([], ["anchors"]),
    ],
)
def test_each_mistake_is_named_with_its_place(tmp_path: Path, anchors, words) -> None:
    with pytest.raises(InputError) as raised:
        load_survey(written(tmp_path, *anchors))
    for word in words:
        assert word in str(raised.value)


def test_a_written_survey_reads_back_and_is_not_overwritten(tmp_path: Path) -> None:
    survey = AnchorSurvey(
        name='the "north" field: #2',
        frame=SurveyFrame.NED,
        anchors=(
            Anchor(id=0x022E, position=(1.25, -3.5, -0.1), delay=-0.0312),
            Anchor(id=2**64 - 1, position=(0.0, 0.0, 4.0)),
        ),
    )
    path = tmp_path / "out.yaml"
    write_survey(path, survey, remarks=["made by a test"])
    assert load_survey(path) == survey
    assert yaml.safe_load(survey_text(survey))["anchors"][0]["id"] == 0x022E
    with pytest.raises(InputError, match="--force"):
        write_survey(path, survey)
    write_survey(path, survey, replace=True)
    with pytest.raises(InputError, match="cannot be written"):
        write_survey(tmp_path / "nowhere" / "out.yaml", survey)
