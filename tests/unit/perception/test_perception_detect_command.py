import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from perception_render import look_down, render

from companion.cli.main import main

PAD_FILE = Path(__file__).resolve().parents[3] / "config" / "pads" / "landing_pad_0p8.yaml"
MATRIX = np.array([[460.0, 0, 319.5], [0, 460.0, 239.5], [0, 0, 1.0]])
CALIBRATION = """\
image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [460, 0, 319.5, 0, 460, 239.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""
POSE = look_down(1.0, tilt=0.3, axis=1.0)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tags = [(0, 0.26, 0.235, -0.235, 0.0), (5, 0.1, 0.0, 0.235, 0.0), (400, 0.1, -0.235, -0.235, 0.0)]
    cv2.imwrite("pad.png", render(tags, POSE, MATRIX, blur=0.6, samples=3))
    cv2.imwrite("empty.png", np.full((480, 640), 90, np.uint8))
    Path("camera.yaml").write_text(CALIBRATION)
    return tmp_path


def last_json(capsys):
    return json.loads(capsys.readouterr().out.strip().splitlines()[-1])


def test_every_id_is_found_without_a_pad(folder, capsys):
    assert main(["detect", "pad.png", "empty.png", "--json"]) == 0
    pad, empty = last_json(capsys)["images"]
    assert (pad["file"], empty["file"]) == ("pad.png", "empty.png")
    assert [tag["id"] for tag in pad["tags"]] == [0, 5, 400]
    assert all(np.shape(tag["corners"]) == (4, 2) for tag in pad["tags"])
    assert empty["tags"] == []
    assert not (folder / "detections").exists()


def test_the_pads_pose_is_solved_jointly(folder, capsys):
    assert main(["detect", "pad.png", "--pad", str(PAD_FILE), "--calibration", "camera.yaml", "--json"]) == 0
    (image,) = last_json(capsys)["images"]
    assert [tag["id"] for tag in image["tags"]] == [0, 5]
    pose = image["pad"]["poses"][0]
    np.testing.assert_allclose(pose["translation"], POSE[1], atol=2e-3)
    np.testing.assert_allclose(pose["rotation"], POSE[0], atol=5e-3)
    assert np.shape(pose["covariance"]) == (6, 6)


def test_single_tags_have_poses_where_their_size_is_given(folder, capsys):
    assert main(["detect", "pad.png", "--tag-size", "0.26", "--calibration", "camera.yaml", "--json"]) == 0
    tag = last_json(capsys)["images"][0]["tags"][0]
    wanted = POSE[0] @ [0.235, -0.235, 0] + POSE[1]
    np.testing.assert_allclose(tag["poses"][0]["translation"], wanted, atol=2e-3)


def test_annotated_copies_are_written_and_never_over_one_another(folder, capsys):
    Path("other").mkdir()
    Path("other/pad.png").write_bytes(Path("pad.png").read_bytes())
    words = ["detect", "pad.png", "other/pad.png", "--annotate", "out/deep"]
    assert main([*words, "--calibration", "camera.yaml", "--pad", str(PAD_FILE)]) == 0
    assert sorted(path.name for path in Path("out/deep").iterdir()) == ["pad_2_tags.png", "pad_tags.png"]
    drawn = cv2.imread("out/deep/pad_tags.png")
    original = cv2.imread("pad.png")
    assert drawn.shape == original.shape
    assert (drawn != original).any()
    assert "annotated copy" in capsys.readouterr().out


def test_everything_wrong_is_said_at_once(folder, capsys):
    Path("words.png").write_text("no picture")
    words = [
        "detect",
        "absent.png",
        "words.png",
        "--calibration",
        "absent.yaml",
        "--pad",
        "none.yaml",
        "--tag-size",
        "-1",
    ]
    assert main(words) == 2
    told = capsys.readouterr()
    assert told.out == ""
    for word in ("absent.png", "words.png", "absent.yaml", "none.yaml", "--tag-size"):
        assert word in told.err


def test_a_calibration_for_another_size_is_refused(folder, capsys):
    cv2.imwrite("large.png", np.zeros((720, 1280), np.uint8))
    assert main(["detect", "large.png", "--calibration", "camera.yaml"]) == 2
    assert "1280x720" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [[], ["pad.png", "--tag-size", "nan"], ["pad.png", "--tag-size", "0.2"], ["pad.png", "--annotate", "pad.png"]],
)
def test_options_that_make_no_sense_are_refused(folder, capsys, words):
    assert main(["detect", *words]) == 2
    assert capsys.readouterr().err


def test_a_film_is_a_camera_too_and_a_missing_one_is_bad_input(folder, capsys):
    film = cv2.VideoWriter("film.avi", cv2.VideoWriter_fourcc(*"MJPG"), 30, (640, 480))
    for _ in range(3):
        film.write(cv2.imread("pad.png"))
    film.release()
    assert main(["detect", "--camera", "film.avi", "--json"]) == 0
    assert [tag["id"] for tag in last_json(capsys)["images"][0]["tags"]] == [0, 5, 400]
    assert main(["detect", "--camera", "absent.avi"]) == 2
    assert "absent.avi" in capsys.readouterr().err
