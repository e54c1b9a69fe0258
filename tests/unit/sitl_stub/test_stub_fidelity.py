"""The stub beside PX4, in short: the committed extract of the recordings, and the measures themselves."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sitl_stub.fidelity import __main__ as program
from sitl_stub.fidelity import motion, sequence
from sitl_stub.fidelity.differences import MOST, reasoned_differences
from sitl_stub.fidelity.experiments import experiment_rows, position_steps
from sitl_stub.fidelity.flight import MODE, TEXT, Flight, Report, from_start
from sitl_stub.fidelity.recording import Recording, RecordingError, read_recording
from sitl_stub.fidelity.replay import Replay
from sitl_stub.fidelity.row import Row
from sitl_stub.vehicle.config import VehicleConfig

ROOT = Path(__file__).resolve().parents[3]
EXTRACT = ROOT / "tests" / "data" / "px4_sih"


def read(name: str) -> Recording:
    return read_recording(EXTRACT, name)


def failing(rows: list[Row]) -> list[Row]:
    return [row for row in rows if not row.passed and row.name not in reasoned_differences()]


@pytest.mark.parametrize("name", ["q02_position_steps_clean", "q06_yaw"])
def test_the_stub_moves_as_px4(name: str) -> None:
    rows = list(experiment_rows(read(name)))
    assert len(rows) > 20
    assert failing(rows) == []


@pytest.mark.parametrize("name", ["q15_force_disarm"])
def test_the_stub_reports_as_px4(name: str) -> None:
    rows = list(experiment_rows(read(name)))
    assert len(rows) == 7
    assert failing(rows) == []


def test_the_stub_touches_down_as_px4() -> None:
    rows = {row.name: row for row in experiment_rows(read("q07_descent_05"))}
    assert rows["q07_descent_05: contact to landed [s]"].passed
    assert rows["q07_descent_05: landed state"].passed
    assert rows["q07_descent_05: text severities"].passed


def test_with_px4s_estimate_errors_the_stub_flies_px4s_path() -> None:
    recording = read("q07_descent_05")
    flight = Replay(recording, VehicleConfig.load("sih_quadrotor"), seed=1, errors="recorded").fly()
    begin, end = recording.mark("altitude reached")[0], recording.flight.landings()[0] - 3.0
    stub, px4 = flight.truth.between(begin, end), recording.flight.truth.between(begin, end)
    assert motion.rms_difference(px4.t, px4.position, stub.t, stub.position) < 0.15
    assert np.ptp(px4.position[:, 1]) > 0.3  # PX4 did wander


def test_a_vehicle_with_other_gains_is_not_px4() -> None:
    recording = read("q02_position_steps_clean")
    vehicle = replace(VehicleConfig.load("sih_quadrotor"), autopilot={"MPC_XY_P": 0.5})
    rows = list(position_steps(recording, Replay(recording, vehicle, seed=1, errors="none").fly()))
    assert any(not row.passed for row in rows)


def test_the_differences_are_few_and_told() -> None:
    reasons = reasoned_differences()
    page = (ROOT / "docs" / "components" / "fidelity.md").read_text(encoding="utf-8")
    assert len(reasons) <= MOST
    assert [name for name in reasons if name not in page] == []


def test_too_many_differences_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "differences.yaml"
    file.write_text("".join(f"row {i}: because\n" for i in range(MOST + 1)), encoding="utf-8")
    with pytest.raises(ValueError, match="at most 5"):
        reasoned_differences(file)
    file.write_text("row: ''\n", encoding="utf-8")
    with pytest.raises(ValueError, match="needs its reason"):
        reasoned_differences(file)


def test_the_program_says_that_it_uses_the_extract(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code = program.main(["--reference", str(tmp_path / "none"), "--only", "q06", "--json"])
    out, told = capsys.readouterr()
    rows = json.loads(out)["rows"]
    assert code == 0
    assert "extract" in told
    assert {row["verdict"] for row in rows} == {"pass"}


def test_an_experiment_that_does_not_exist_is_bad_input(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main(["--reference", str(EXTRACT), "--only", "q99"]) == 2
    assert "q99" in capsys.readouterr().err


def test_a_broken_recording_names_its_file(tmp_path: Path) -> None:
    (tmp_path / "q02.events.jsonl").write_text("{}", encoding="utf-8")
    with pytest.raises(RecordingError, match="q02"):
        read_recording(tmp_path, "q02")


# the measures


def test_rise_time_and_overshoot_of_a_known_response() -> None:
    t = np.linspace(0.0, 10.0, 2001)
    assert motion.rise_time(t, np.clip(t / 2.0, 0.0, 1.0)) == pytest.approx(1.6, abs=1e-6)
    damped = 1.0 - np.exp(-0.5 * t) * np.cos(2.0 * t)
    assert motion.overshoot(damped) == pytest.approx(100.0 * float(np.max(damped) - 1.0))
    assert motion.overshoot(np.clip(t / 20.0, 0.0, 1.0)) == 0.0
    assert math.isnan(motion.rise_time(t, t / 100.0))


def test_correlation_time_of_a_gauss_markov_process() -> None:
    rng, dt, time = np.random.default_rng(1), 0.05, 2.0
    values = np.zeros(40_000)
    for i in range(1, len(values)):
        values[i] = values[i - 1] * (1.0 - dt / time) + math.sqrt(2.0 * dt / time) * rng.standard_normal()
    assert motion.correlation_time(np.arange(len(values)) * dt, values) == pytest.approx(time, rel=0.15)


def with_reports(flight: Flight, reports: list[Report]) -> Flight:
    return replace(flight, reports=tuple(reports))


def test_order_and_time_of_reports_both_count() -> None:
    recording = read("q15_force_disarm")
    px4 = list(recording.flight.reports)
    assert sequence.compare(recording, with_reports(recording.flight, px4), MODE).passed
    late = [replace(r, t=r.t + 0.5) if r.channel == MODE and r.value == ("OFFBOARD",) else r for r in px4]
    assert not sequence.compare(recording, with_reports(recording.flight, late), MODE).passed
    without = [report for report in px4 if report.words != "Takeoff detected"]
    assert not sequence.compare(recording, with_reports(recording.flight, without), TEXT).passed


def test_after_a_landing_times_count_from_it() -> None:
    recording = read("q07_descent_05")
    landing = recording.flight.landings()[0]
    later = [replace(r, t=r.t + 3.0) if r.t >= landing - 0.1 else r for r in recording.flight.reports]
    assert sequence.compare(recording, with_reports(recording.flight, later), TEXT).passed


def test_of_what_was_before_the_start_only_the_state_counts() -> None:
    reports = [
        Report(t=0.0, channel=MODE, value=("AUTO_LOITER",)),
        Report(t=1.0, channel=MODE, value=("OFFBOARD",)),
        Report(t=1.0, channel=TEXT, value=(6,)),
        Report(t=3.0, channel=TEXT, value=(2,)),
    ]
    assert [(r.t, r.value) for r in from_start(reports, 2.0)] == [(2.0, ("OFFBOARD",)), (3.0, (2,))]
