import math
from pathlib import Path

import numpy as np
import pytest

from companion.errors import InputError
from companion.perception.pad import Pad, PadTag, single_tag_pad
from companion.perception.pad_file import load_pad

DEFAULT = Path(__file__).resolve().parents[3] / "config" / "pads" / "landing_pad_0p8.yaml"

GOOD = """\
version: 1
name: test pad
family: 36h11
size_m: [1.0, 1.0]
landing_point_m: [0.0, 0.0]
landing_heading_deg: 0.0
tags:
  - {id: 3, size_m: 0.3, x_m: 0.2, y_m: -0.2, heading_deg: 0}
  - {id: 7, size_m: 0.1, x_m: -0.2, y_m: 0.2, heading_deg: 30}
"""


def test_the_default_pad_has_its_corners_where_the_frames_page_says():
    pad = load_pad(DEFAULT)
    assert pad.ids == tuple(range(12))
    half = 0.13
    x, y = 0.235, -0.235
    wanted = [(x + half, y - half, 0), (x + half, y + half, 0), (x - half, y + half, 0), (x - half, y - half, 0)]
    np.testing.assert_allclose(pad.corners[0], wanted)


def test_corners_are_relative_to_the_landing_point_and_heading():
    tag = PadTag(id=1, size=0.2, x=0.3, y=0.1, heading=math.radians(90.0))
    pad = Pad(name="p", size=(1.0, 1.0), landing_point=(0.3, 0.0), landing_heading=math.radians(90.0), tags=(tag,))
    # on the board the tag's top points along +y, as the landing heading does: in `pad` it points along +x
    np.testing.assert_allclose(pad.corners[1].mean(axis=0), [0.1, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(pad.corners[1][0] - pad.corners[1][3], [0.2, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(pad.corners[1][1] - pad.corners[1][0], [0.0, 0.2, 0.0], atol=1e-12)


def test_a_single_tag_is_a_pad():
    np.testing.assert_allclose(single_tag_pad(5, 0.2).corners[5][0], [0.1, -0.1, 0.0])


@pytest.mark.parametrize(
    ("old", "new", "words", "line"),
    [
        ("id: 7", "id: 3", "on the pad already", 9),
        ("id: 7", "id: 587", "587", 9),
        ("id: 7", "id: -1", "-1", 9),
        ("size_m: 0.1", "size_m: -0.1", "greater than 0", 9),
        ("size_m: 0.1", "size_m: 0", "greater than 0", 9),
        ("size_m: 0.1", "size_m: .nan", "not-a-number", 9),
        ("x_m: -0.2", "x_m: .inf", "finite", 9),
        ("x_m: -0.2, y_m: 0.2", "x_m: 0.2, y_m: -0.2", "overlaps tag 3", 9),
        ("x_m: -0.2", "x_m: -0.49", "rim", 9),
        ("heading_deg: 30", "heading: 30", "heading", 9),
        ("family: 36h11", "family: 16h5", "36h11", 3),
        ("[1.0, 1.0]", "[1.0, -1.0]", "greater than 0", 4),
        ("point_m: [0.0, 0.0]", "point_m: [0.0, 3.0]", "beside the board", 5),
        ("landing_heading_deg: 0.0", "colour: red", "colour", 6),
    ],
)
def test_a_wrong_pad_file_names_line_and_remedy(tmp_path, old, new, words, line):
    path = tmp_path / "pad.yaml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError) as caught:
        load_pad(path)
    assert words.lower() in str(caught.value).lower()
    assert line in [problem.line for problem in caught.value.problems]


def test_all_problems_are_named_at_once(tmp_path):
    path = tmp_path / "pad.yaml"
    path.write_text(
        GOOD.replace("id: 7", "id: 600").replace("size_m: 0.3", "size_m: -1").replace("version: 1", "version: 9")
    )
    with pytest.raises(InputError) as caught:
        load_pad(path)
    assert {problem.line for problem in caught.value.problems} == {1, 8, 9}


def test_the_good_file_is_good(tmp_path):
    path = tmp_path / "pad.yaml"
    path.write_text(GOOD)
    assert load_pad(path).ids == (3, 7)


def test_a_turned_tag_overlaps_where_its_corner_reaches():
    def pad(gap):
        tags = (
            PadTag(id=0, size=0.2, x=0.0, y=-0.1, heading=0.0),
            PadTag(id=1, size=0.2, x=0.0, y=math.sqrt(0.02) + gap, heading=math.radians(45.0)),
        )
        return Pad(name="p", size=(2.0, 2.0), landing_point=(0.0, 0.0), landing_heading=0.0, tags=tags)

    pad(0.001)
    with pytest.raises(InputError, match="overlaps"):
        pad(-0.001)


def test_numbers_in_memory_are_checked_too():
    with pytest.raises(InputError, match="positive size"):
        single_tag_pad(1, math.nan)
