from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from companion.cli.main import main
from companion.geometry.rotations import rotation_about_z, rotation_from_euler
from companion.messages.ownship import OwnshipState
from companion.messages.proximity import RangeReading
from companion.messages.target import TargetMeasurement
from companion.ranging.survey import SurveyFrame
from companion.ranging.survey_file import load_survey
from companion.recording import McapRecorder, read_recording, to_record

ANCHORS = np.array([[3.0, -3.0, -0.1], [3.0, 3.0, -1.2], [-3.0, 3.0, -0.1], [-3.0, -3.0, -1.2]])  # [m] in pad
LEVER_ARM = np.array([0.1, -0.2, 0.05])  # [m]
PAD = np.array([20.0, -7.0, 0.4])  # [m] in ned
PAD_HEADING = 0.7  # [rad]
USED = "version: 1\nname: roughly paced\nframe: pad\nanchors:\n" + "".join(
    f"  - {{id: 0x{0xA0 + k:X}, position_m: [{k}, 0, 0], delay_m: {0.1 * k}}}\n" for k in range(4)
)


def record_flight(folder: Path, *, flat: bool = False, pad: bool = True, reset_at: float = -1.0) -> Path:
    """Record a minute over a pad, with ranges of the antenna and a rocking vehicle; give the flight's folder."""
    (folder / "used.yaml").write_text(USED)
    lever = ", ".join(map(str, LEVER_ARM))
    configuration = f"ranging: {{survey: {folder / 'used.yaml'}, std_m: 0.02, tag_lever_arm_m: [{lever}]}}\n"
    recorder = McapRecorder(folder / "flight" / "flight.mcap", {"configuration": {"yaml": configuration}})
    rng = np.random.default_rng(1)
    anchors = ANCHORS @ rotation_about_z(PAD_HEADING).T + PAD
    for k in range(3000):
        t = 100.0 + 0.02 * k
        reset = reset_at >= 0.0 and t >= reset_at
        yaw = 0.05 * k * 0.02
        attitude = rotation_from_euler(0.1 * math.sin(0.9 * t), 0.1 * math.cos(0.7 * t), yaw)
        height = 2.0 if flat else 2.0 + 1.2 * math.sin(0.15 * t)
        position = PAD + np.array([3.0 * math.cos(0.5 * t), 3.0 * math.sin(0.4 * t), -height])
        told = position + np.array([5.0, 0.0, 0.0]) * reset
        state = OwnshipState(
            t=t,
            position_ned=told,
            velocity_ned=np.zeros(3),
            acceleration_ned=np.zeros(3),
            ned_from_frd=attitude,
            angular_velocity_frd=np.zeros(3),
            reset_counter=int(reset),
        )
        recorder.record("ownship", t, to_record(state))
        anchor = k % 4
        distance = np.linalg.norm(position + attitude @ LEVER_ARM - anchors[anchor]) + rng.normal(0.0, 0.02)
        recorder.record("range", t, to_record(RangeReading(t=t, anchor=anchor, range=float(distance))))
        if pad and k % 10 == 0:
            measurement = TargetMeasurement(
                t=t,
                position_level=rotation_about_z(-yaw) @ (PAD - position),
                heading=PAD_HEADING - yaw,
                covariance=np.eye(4) * 1e-4,
            )
            recorder.record("measurement", t, to_record(measurement))
    recorder.close()
    return folder / "flight"


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_flight(tmp_path_factory.mktemp("flown"))


def test_the_channel_of_ranges_keeps_readings(flight: Path) -> None:
    recording = read_recording(flight / "flight.mcap", ("range",))
    assert len(recording.of("range")) == 3000
    assert set(recording.of("range")[0].data) == {"t", "anchor", "range"}


def test_a_recorded_flight_gives_a_survey_in_the_pads_frame(flight: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out.yaml"
    assert main(["calibrate", "anchors", str(flight), "--survey", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    survey = load_survey(out)
    assert survey.frame is SurveyFrame.PAD
    assert survey.name == "roughly paced"
    assert [anchor.id for anchor in survey.anchors] == [0xA0, 0xA1, 0xA2, 0xA3]
    assert np.linalg.norm(survey.positions - ANCHORS, axis=1).max() < 0.05
    # the ranges had been freed of the delays of the survey in use: those add up
    assert [anchor.delay for anchor in survey.anchors] == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=0.05)
    assert all(row["position_std_m"] < 0.05 for row in said["anchors"])


def test_an_existing_file_is_kept_unless_forced(flight: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out.yaml"
    out.write_text("mine")
    words = ["calibrate", "anchors", str(flight / "flight.mcap"), "--survey", str(out), "--frame", "ned"]
    assert main(words) == 2
    assert "--force" in capsys.readouterr().err
    assert out.read_text() == "mine"
    assert main([*words, "--force"]) == 0
    shown = capsys.readouterr().out
    assert "0x00A2" in shown
    assert "begins anew" in shown
    survey = load_survey(out)
    assert survey.frame is SurveyFrame.NED
    expected = ANCHORS @ rotation_about_z(PAD_HEADING).T + PAD
    assert np.linalg.norm(survey.positions - expected, axis=1).max() < 0.05


def test_a_wrong_lever_arm_shows(flight: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out.yaml"
    words = ["calibrate", "anchors", str(flight), "--survey", str(out), "--json", "--lever-arm", "0", "0", "-0.6"]
    assert main(words) == 0
    capsys.readouterr()
    assert np.linalg.norm(load_survey(out).positions - ANCHORS, axis=1).min() > 0.3


def test_a_flat_flight_is_refused_and_nothing_written(tmp_path: Path, capsys) -> None:
    out = tmp_path / "out.yaml"
    words = ["calibrate", "anchors", str(record_flight(tmp_path, flat=True)), "--survey", str(out), "--lever-arm"]
    assert main([*words, "0", "0", "0"]) == 1
    assert "two heights" in capsys.readouterr().out
    assert not out.exists()


def test_a_jump_of_the_estimate_is_left_out(tmp_path: Path, capsys) -> None:
    out = tmp_path / "out.yaml"
    folder = record_flight(tmp_path, pad=False, reset_at=150.0)
    assert main(["calibrate", "anchors", str(folder), "--survey", str(out)]) == 0
    assert "jumped once or more (1)" in capsys.readouterr().out
    expected = ANCHORS @ rotation_about_z(PAD_HEADING).T + PAD
    assert np.linalg.norm(load_survey(out).positions - expected, axis=1).max() < 0.06
    assert main(["calibrate", "anchors", str(folder), "--survey", str(out), "--force", "--frame", "pad"]) == 2
    assert "saw the pad hardly" in capsys.readouterr().err


def test_a_recording_without_ranges_is_told(tmp_path: Path, capsys) -> None:
    recorder = McapRecorder(tmp_path / "flight.mcap")
    recorder.record("ownship", 1.0, {"t": 1.0})
    recorder.close()
    assert main(["calibrate", "anchors", str(tmp_path), "--survey", str(tmp_path / "out.yaml")]) == 2
    assert "ranging.input" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("recording", "options", "told"),
    [
        ("nothing", [], "nothing: no such file or folder; give the folder that `--record` of companion fly"),
        (".", [], "this folder holds no flight.mcap; give one of its flights: {0}/flight"),
        ("used.yaml", [], "not an MCAP recording"),
        ("flight", ["--flown-with", "nowhere.yaml"], "nowhere.yaml: no such file"),
        ("flight", ["--lever-arm", "nan", "0", "0"], "--lever-arm: not three finite numbers"),
        ("flight", ["--survey", "{0}/none/x.yaml"], "there is no folder {0}/none; make it"),
    ],
)
def test_bad_input_is_told_with_what_would_be_right(
    flight: Path, tmp_path: Path, capsys, recording: str, options: list[str], told: str
) -> None:
    folder = flight.parent
    words = ["calibrate", "anchors", str(folder / recording), "--survey", str(tmp_path / "x.yaml")]
    assert main([*words, *(word.format(folder) for word in options)]) == 2
    assert told.format(folder) in capsys.readouterr().err
    assert not (tmp_path / "x.yaml").exists()
