from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from companion.errors import RecordingError
from companion.messages.decision import Mode
from companion.messages.docking import DockingMode
from companion.recording import McapRecorder, MemoryRecorder, Recorder
from companion.report import draw_flight, write_page
from companion.report.picture import figure_of, open_flight
from companion.report.series import flight_of
from companion.report.style import MODE_COLOURS
from companion.report.words import headline

OFFSET = (0.3, -0.4)  # of the vehicle from the landing point [m]
ESTIMATE_ERROR = np.array([0.03, 0.04, 0.0, 0.02])


def fill(recorder: Recorder, *, result: dict[str, Any] | None = None, modes: bool = True) -> None:
    """Ten seconds beside a pad that drives east; a contact at 8 s; the track has a constant error."""
    for k in range(500):
        t = k / 50
        yaw, pad_yaw = 0.6, 0.5
        pad = np.array([2.0, 0.5 * t, -0.15])
        height = max(0.2, 3.0 - 0.35 * t)
        vehicle = pad + np.array([*OFFSET, -height])
        recorder.record(
            "truth",
            t,
            {
                "t": t,
                "position_ned": vehicle.tolist(),
                "velocity_ned": [0.0, 0.5, 0.35],
                "quaternion": [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)],
                "armed": True,
                "feet_in_contact": 4 if height <= 0.2 else 0,
                "targets": [
                    {
                        "name": "pad",
                        "position_ned": pad.tolist(),
                        "yaw": pad_yaw,
                        "velocity_ned": [0.0, 0.5, 0.0],
                        "half_size": [0.4, 0.4],
                        "moving": True,
                    }
                ],
            },
        )
        offset = pad - vehicle
        cosine, sine = math.cos(yaw), math.sin(yaw)
        level = [cosine * offset[0] + sine * offset[1], -sine * offset[0] + cosine * offset[1], offset[2]]
        state = np.array([*level, pad_yaw - yaw]) + ESTIMATE_ERROR
        recorder.record(
            "track", t, {"t": t, "state": [*state, 0.0, 0.0, 0.0, 0.0], "covariance": (0.01 * np.eye(8)).tolist()}
        )
        if modes:
            numbers = {"a11": 0.1, "a22": 0.2, "a32": 0.3, "steady_align": 0.4} if 3.0 <= t < 6.0 else None
            mode = "approach" if t < 4.0 else "land"
            recorder.record("decision", t, {"t": t, "mode": mode, "switched": None, "probabilities": numbers})
        recorder.record("observation", t, {"t": t, "hypotheses": [{}] if k % 2 else []})
    if result is not None:
        recorder.record("result", 10.0, result)
    recorder.close()


RESULT = {
    "outcome": "landed",
    "success": True,
    "reason": "landed <well> & straight",
    "position_error_m": 0.021,
    "angular_error_rad": 0.0034,
    "station_keeping": {"position_mean_m": 0.1, "position_std_m": 0.02, "angle_mean_rad": 0.01, "angle_std_rad": 0.0},
    "duration_s": 40.0,
    "touchdown_speed_mps": 0.31,
    "mode_history": [{"t": 1.0, "mode": "go_around", "reason": "0.4 > 0.3 <m>"}],
    "limits_violated": [],
    "seed": 3,
}


def memory(run: dict[str, str] | None = None, **changes: Any) -> MemoryRecorder:
    recorder = MemoryRecorder({"run": {"mission": "test", "seed": "3", **(run or {})}})
    fill(recorder, **changes)
    return recorder


def test_the_series_hold_true_errors() -> None:
    flight = flight_of(memory().recording())
    assert flight is not None
    assert flight.track is not None
    assert flight.truth.lateral == pytest.approx(0.5)
    assert flight.truth.heading_error == pytest.approx(0.1)
    assert flight.track.position_error == pytest.approx(0.05)
    assert flight.track.heading_error == pytest.approx(0.02)
    assert flight.track.position_sigma == pytest.approx(0.1)
    contact = flight.truth.contact
    assert contact is not None
    assert flight.truth.t[contact] == pytest.approx(8.0, abs=0.03)
    # The estimate laid on the true vehicle misses the pad by the estimate's error alone.
    missed = flight.track.pad_position - flight.truth.pad_position[:, :2]
    assert np.hypot(*missed.T) == pytest.approx(0.05)


def test_modes_are_spans_that_meet() -> None:
    flight = flight_of(memory().recording())
    assert flight is not None
    assert [(span.mode, span.start, span.end) for span in flight.modes] == [
        ("approach", 0.0, 4.0),
        ("land", 4.0, pytest.approx(9.98)),
    ]
    t, values = flight.probabilities["a22"]
    assert np.array_equal(np.isfinite(values), (t >= 3.0) & (t < 6.0))


def test_behind_a_target_what_counts_is_the_distance_to_the_place_there() -> None:
    flight = flight_of(memory({"standoff_m": "1.25"}).recording())
    assert flight is not None
    assert flight.standoff == 1.25
    assert flight.target_word == "target"
    pad_yaw = 0.5
    place = -1.25 * np.array([math.cos(pad_yaw), math.sin(pad_yaw)])  # from the target, north and east
    assert flight.truth.distance_to_place(1.25) == pytest.approx(math.hypot(*(np.array(OFFSET) - place)))
    landing = flight_of(memory().recording())
    assert landing is not None
    assert landing.standoff is None


def test_the_picture_of_a_drive_shows_no_height_and_its_place(tmp_path: Path) -> None:
    flight = open_flight(memory({"standoff_m": "1.25"}, result=RESULT).recording())
    labels = [axes.get_ylabel() for axes in figure_of(flight).axes]
    assert "height above\nthe pad [m]" not in labels
    assert "position\nerror [m]" in labels
    assert "target seen" in labels
    assert "height above\nthe pad [m]" in [
        axes.get_ylabel() for axes in figure_of(open_flight(memory().recording())).axes
    ]


@pytest.mark.parametrize(
    ("metres", "radians", "words"),
    [(0.021, 0.0034, "2.1 cm from the landing point, 3.4 mrad"), (7.16, 0.4, "7.2 m from the landing point, 23 deg")],
)
def test_the_headline_gives_sizes_as_people_do(metres: float, radians: float, words: str) -> None:
    result = {**RESULT, "position_error_m": metres, "angular_error_rad": radians}
    assert words in headline(open_flight(memory(result=result).recording()))


def test_every_mode_has_a_colour_of_its_own() -> None:
    assert {mode.value for mode in (*Mode, *DockingMode)} == set(MODE_COLOURS)
    assert len(set(MODE_COLOURS.values())) == len(MODE_COLOURS)


def test_a_picture_is_drawn_and_repeats_itself(tmp_path: Path) -> None:
    recorder = McapRecorder(tmp_path / "flight.mcap", {"run": {"mission": "test", "seed": "3"}})
    fill(recorder, result=RESULT)
    for name in ("a.png", "deep/b.png"):
        draw_flight(tmp_path / "flight.mcap", tmp_path / name)
    picture = matplotlib.image.imread(tmp_path / "a.png")
    assert picture.shape[1] > 1500
    assert float(picture[..., :3].std()) > 0.05  # not an empty sheet
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "deep" / "b.png").read_bytes()


def test_a_flight_of_which_little_is_known_is_drawn_too(tmp_path: Path) -> None:
    draw_flight(memory(modes=False).recording(), tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000


def test_the_page_needs_nothing_else(tmp_path: Path) -> None:
    write_page(memory(result=RESULT).recording(), tmp_path / "flight.html")
    page = (tmp_path / "flight.html").read_text()
    assert "data:image/png;base64," in page
    assert not re.search(r'(src|href)="(?!data:)', page)
    assert "landed &lt;well&gt; &amp; straight" in page
    assert "0.4 &gt; 0.3 &lt;m&gt;" in page
    assert "2.1 cm from the landing point" in page
    assert "0.100 ± 0.020 m" in page


def test_a_failure_says_why(tmp_path: Path) -> None:
    failed = {**RESULT, "outcome": "failed", "success": False, "reason": "it stands on grass"}
    failed["limits_violated"] = [{"limit": "yaw rate", "allowed": 1.0, "worst": 2.0, "t": 3.0}]
    write_page(memory(result=failed).recording(), tmp_path / "flight.html")
    page = (tmp_path / "flight.html").read_text()
    assert "Failed: it stands on grass" in page
    assert "limits broken: yaw rate" in page


def test_without_truth_there_is_no_picture(tmp_path: Path) -> None:
    recorder = MemoryRecorder()
    recorder.record("ownship", 0.0, {"t": 0.0})
    with pytest.raises(RecordingError, match="no truth"):
        draw_flight(recorder.recording(), tmp_path / "a.png")


def test_a_place_that_cannot_be_written_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    recording = memory().recording()
    with pytest.raises(RecordingError, match="cannot be written"):
        draw_flight(recording, tmp_path / "file" / "a.png")
    with pytest.raises(RecordingError, match="cannot be written"):
        write_page(recording, tmp_path / "file" / "a.html")
