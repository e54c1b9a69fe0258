from __future__ import annotations

import argparse
import json
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest
from campaign_results import made_result

from companion.campaign import run as run_module
from companion.campaign.named_files import named_files
from companion.campaign.result import FlightResult
from companion.campaign.run import RunRecord, Task
from companion.campaign.runner import Options, run_tasks, tasks_of
from companion.campaign.seeds import SeedChoice, drawn_seeds, parse_seeds
from companion.campaign.spec import Camera, CaseKind, load_campaign
from companion.campaign.table import report_case
from companion.campaign.versions import current_commit, fingerprint, project_root
from companion.cli import campaign as cli
from companion.cli import flights
from companion.errors import InputError
from companion.recording import RECORDING_NAME, Recorder, read_recording

ROOT = project_root()
SPEC = """\
version: 1
name: test
cases:
  - name: random pad for 60 s, then stops
    missions: [{mission}]
    seeds: 4
    required: {{success_fraction: 1.0, mean_position_error_m: 0.05}}
"""


def fake_flight(
    mission_path: Path, *, seed: int, camera: Camera, overrides: Sequence[str], recorder: Recorder | None
) -> FlightResult:
    """Good on most seeds; 13 lands badly, 14 crashes, 15 has bad input, 16 does not repeat itself."""
    if seed == 14:
        raise RuntimeError("division by cucumber")
    if seed == 15:
        raise InputError.single(source="x.yaml", wrong="bad", right="good")
    if recorder is not None:
        recorder.record("a", 0.0, {"pid": os.urandom(4).hex() if seed == 16 else "same"})
        recorder.close()
    return made_result(seed, success=seed != 13)


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    path = tmp_path / "campaign.yaml"
    mission = os.path.relpath(ROOT / "missions" / "land_static.yaml", tmp_path)
    path.write_text(SPEC.format(mission=mission))
    return path


def fly(spec: Path, seeds: str, options: Options) -> tuple[dict[Task, RunRecord], list[int]]:
    done: list[int] = []
    tasks = tasks_of(load_campaign(spec), parse_seeds(seeds), None, options)
    records = run_tasks(tasks, fake_flight, options, lambda task, record: done.append(task.seed))
    return records, done


@pytest.mark.parametrize(
    ("text", "choice"),
    [
        ("auto", SeedChoice()),
        ("auto:30", SeedChoice(count=30)),
        ("1,2, 3", SeedChoice(given=(1, 2, 3))),
        ("7", SeedChoice(given=(7,))),
        ("5..8", SeedChoice(given=(5, 6, 7, 8))),
        ("3,3,1", SeedChoice(given=(3, 1))),
    ],
)
def test_seeds_are_read(text: str, choice: SeedChoice) -> None:
    assert parse_seeds(text) == choice


@pytest.mark.parametrize("text", ["", "auto:0", "auto:x", "8..5", "1;2", "-3", "1.5", "99999999999", "auto:99999999"])
def test_other_seeds_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="names no seeds"):
        parse_seeds(text)


def test_drawn_seeds_are_distinct_and_depend_on_commit_and_case() -> None:
    seeds = drawn_seeds("a" * 40, "static", 1000)
    assert len(set(seeds)) == 1000
    assert all(0 <= seed < 2**31 for seed in seeds)
    assert drawn_seeds("a" * 40, "static", 10) == seeds[:10]
    assert not set(drawn_seeds("b" * 40, "static", 100)) & set(seeds)
    assert not set(drawn_seeds("a" * 40, "moving", 100)) & set(seeds)


def test_the_project_s_campaign_is_what_must_be_shown() -> None:
    campaign = load_campaign(ROOT / "config" / "campaigns" / "first_flight.yaml")
    flights = [case for case in campaign.cases if case.kind is CaseKind.FLIGHTS]
    assert [(case.seeds, case.required.mean_position_error_m) for case in flights] == [
        (30, 0.040),
        (30, 0.042),
        (20, 0.080),
    ]
    assert all(case.camera == "rendered" and case.required.success_fraction == 1.0 for case in flights)
    truthful = next(case for case in campaign.cases if case.kind is CaseKind.CONSISTENCY)
    assert truthful.seeds * len(truthful.missions) == 50
    assert truthful.required.inside_fraction == 0.90


def test_a_wrong_campaign_is_refused_with_its_place(spec: Path) -> None:
    good = spec.read_text()
    for change, message in (
        (("seeds: 4", "seeds: 0"), "seeds"),
        (("seeds: 4", "seed: 4"), "did you mean seeds"),
        (("land_static", "land_statik"), "there is no file"),
        (("cases:", "cases:\n" + good.split("cases:\n")[1].rstrip()), "two cases are called"),
    ):
        spec.write_text(good.replace(*change))
        with pytest.raises(InputError, match=message):
            load_campaign(spec)


def test_seeds_are_drawn_for_each_mission_of_a_case() -> None:
    campaign = load_campaign(ROOT / "config" / "campaigns" / "first_flight.yaml")
    tasks = tasks_of(campaign, SeedChoice(), "c" * 40, Options())
    truthful = [task for task in tasks if task.kind is CaseKind.CONSISTENCY]
    assert len({(task.mission, task.seed) for task in truthful}) == 50
    assert len({task.seed for task in truthful}) == 50
    assert len({task.file_name for task in tasks}) == len(tasks)


def test_settings_change_where_a_run_is_kept(spec: Path) -> None:
    campaign = load_campaign(spec)
    names = {
        tasks_of(campaign, SeedChoice(given=(1,)), None, options)[0].file_name
        for options in (Options(), Options(camera="corners"), Options(overrides=("a.b=1",)))
    }
    assert len(names) == 3


def test_finished_runs_are_not_flown_again(spec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = Options(processes=1, store=tmp_path / "store")
    first, done = fly(spec, "1..4", options)
    assert done == [1, 2, 3, 4]
    next((tmp_path / "store").rglob("*-2.json")).write_text("{torn")
    flown: list[int] = []
    monkeypatch.setattr(
        "companion.campaign.runner.perform",
        lambda task, run: (flown.append(task.seed), run_module.perform(task, run))[1],
    )
    again, _ = fly(spec, "1..5", options)
    assert flown == [2, 5]
    assert [record.result for record in again.values()][:4] == [record.result for record in first.values()]


def test_a_run_that_ends_in_other_code_is_not_kept(spec: Path, tmp_path: Path) -> None:
    fly(spec, "1,2", Options(processes=1, store=tmp_path / "store", code_is_the_same=lambda: False))
    assert not list(tmp_path.rglob("*.json"))


def test_a_crash_is_a_failure_that_is_not_kept(spec: Path, tmp_path: Path) -> None:
    records, _ = fly(spec, "13,14,1", Options(processes=1, store=tmp_path / "store"))
    assert [record.success for record in records.values()] == [False, False, True]
    assert "cucumber" in list(records.values())[1].reason
    assert len(list((tmp_path / "store").rglob("*.json"))) == 2


def test_bad_input_ends_the_campaign(spec: Path) -> None:
    with pytest.raises(InputError, match="bad; good"):
        fly(spec, "1,15", Options(processes=1))


def test_two_processes_give_what_one_gives(spec: Path) -> None:
    one, _ = fly(spec, "1,2,3,13", Options(processes=1))
    two, _ = fly(spec, "1,2,3,13", Options(processes=2))
    assert {t.seed: r.result for t, r in one.items()} == {t.seed: r.result for t, r in two.items()}


def test_a_campaign_can_leave_recordings(spec: Path, tmp_path: Path) -> None:
    fly(spec, "1", Options(processes=1, record_dir=tmp_path / "kept"))
    [path] = (tmp_path / "kept").rglob(RECORDING_NAME)
    recording = read_recording(path)
    assert recording.metadata["run"]["seed"] == "1"
    assert "takeoff" in recording.metadata["mission"]["yaml"]
    assert "effective configuration" in recording.metadata["configuration"]["yaml"]
    assert json.loads((path.parent / "summary.json").read_text())["wall_s"] == 1.0


def test_a_flight_that_does_not_repeat_itself_fails(spec: Path) -> None:
    spec.write_text(spec.read_text().replace("seeds: 4", "seeds: 4\n    kind: repeat"))
    records, _ = fly(spec, "1,16", Options(processes=1))
    assert [record.success for record in records.values()] == [True, False]
    assert "differ" in list(records.values())[1].reason
    report = report_case(load_campaign(spec).cases[0], list(records.values()))
    assert not report.passed


def test_the_report_holds_figures_against_requirements(spec: Path) -> None:
    case = load_campaign(spec).cases[0]
    good = [RunRecord(mission="m", seed=k, result=made_result(k, position_error_m=0.02 * k)) for k in range(1, 4)]
    report = report_case(case, good)
    figure = report.figures["position_error_m"]
    assert (figure.mean, figure.median, figure.largest) == pytest.approx((0.04, 0.04, 0.06))
    assert report.passed
    late = [*good, RunRecord(mission="m", seed=9, result=made_result(9, position_error_m=0.5))]
    assert [check.passed for check in report_case(case, late).checks] == [True, False]
    fallen = [*good, RunRecord(mission="m", seed=9, crash="Traceback\nValueError: x")]
    assert [check.passed for check in report_case(case, fallen).checks] == [False, True]
    assert report_case(case, fallen).failures == (("m", 9, "ValueError: x"),)
    assert not report_case(case, [fallen[-1]]).passed


def arguments(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    cli.add_arguments(parser)
    return parser.parse_args(list(words))


def test_the_command_line_reports_and_decides(
    spec: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    store = str(tmp_path / "store")
    words = [str(spec), "--processes", "1", "--store", store, "--json"]
    assert cli.fly(arguments(*words, "--seeds", "1..3"), fake_flight) == 0
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert printed["passed"] is True
    assert printed["cases"][0]["figures"]["position_error_m"]["mean"] == pytest.approx(0.02)
    assert cli.fly(arguments(*words, "--seeds", "12,13,14"), fake_flight) == 1
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert printed["cases"][0]["successes"] == 1
    assert len(printed["cases"][0]["failures"]) == 2
    versions = iter(["a", "a", "b", "b"])
    with monkeypatch.context() as patch:
        patch.setattr(flights, "fingerprint", lambda root: next(versions))
        assert cli.fly(arguments(*words, "--seeds", "1"), fake_flight) == 1
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["code_changed"] is True
    with pytest.raises(InputError, match='there are "random pad'):
        cli.fly(arguments(*words, "--seeds", "1", "--case", "hard"), fake_flight)
    with pytest.raises(InputError, match="processes"):
        cli.fly(arguments(*words, "--seeds", "1", "--processes", "0"), fake_flight)


def test_the_table_fits_a_terminal_of_80_columns(
    spec: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    cli.fly(arguments(str(spec), "--processes", "1", "--fresh", "--seeds", "12,13"), fake_flight)
    lines = capsys.readouterr().out.splitlines()
    [succeeded] = [line.split() for line in lines if "flights that succeed" in line]
    assert succeeded[-3:] == ["1/2", "all", "FAIL"]
    [error] = [line for line in lines if "position error [m]" in line]
    assert error.split()[3:] == ["0.020", "0.020", "0.020", "mean", "<=", "0.05", "pass"]
    assert "…" not in "".join(lines)


def test_the_commit_is_asked_of_git(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        subprocess.run(
            ["git", "-c", "user.name=t", "-c", "user.email=t@example.org", *words],
            cwd=tmp_path,
            check=True,
            capture_output=True,
        )

    with pytest.raises(InputError, match="not a git checkout"):
        current_commit(tmp_path)
    git("init", "-q")
    (tmp_path / "a").write_text("1")
    git("add", "a")
    git("commit", "-qm", "first")
    commit = current_commit(tmp_path)
    assert len(commit.hash) == 40
    assert not commit.changed
    (tmp_path / "a").write_text("2")
    assert current_commit(tmp_path).changed


def test_the_fingerprint_follows_the_code_that_flies(tmp_path: Path) -> None:
    for name in ("companion/a.py", "config/x.yaml", "config/campaigns/c.yaml", "companion/report/r.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1")
    before = fingerprint(tmp_path)
    (tmp_path / "config/campaigns/c.yaml").write_text("2")
    (tmp_path / "companion/report/r.py").write_text("2")
    assert fingerprint(tmp_path) == before
    for name in ("companion/a.py", "config/x.yaml", "sitl_stub/vehicle/px4_parameters.json"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("2")
        assert fingerprint(tmp_path) != before, name
        before = fingerprint(tmp_path)


def test_a_run_is_kept_under_all_that_its_mission_names(tmp_path: Path) -> None:
    root, mine, world = tmp_path / "project", tmp_path / "mine", tmp_path / "mine" / "world.yaml"
    for folder in (root / "missions", mine):
        folder.mkdir(parents=True)
    inside, mission = root / "missions" / "m.yaml", mine / "m.yaml"
    inside.write_text("name: inside")
    world.write_text("wind: 0")
    mission.write_text("simulation: {world: world.yaml}\nconfig: ../project/missions/m.yaml")
    seen = [named_files(mission, ()), named_files(inside, ()), named_files(inside, (f"simulation={{world: {world}}}",))]
    for path, text in ((world, "wind: 1"), (inside, "name: other"), (mission, "simulation: {world: world.yaml}")):
        path.write_text(text)
        seen.append(named_files(mission, ()))
    seen.append(named_files(inside, (f"simulation={{world: {world}}}",)))
    assert len(set(seen)) == len(seen)
    for strange in ("{ broken", "a: &a [*a]", f"a: {'x' * 300}.yaml", 'a: "\\0"', "a: ~nobody/x.yaml"):
        mission.write_text(strange)
        assert named_files(mission, ())


def test_a_run_whose_world_is_edited_while_it_flies_is_not_kept(tmp_path: Path) -> None:
    mission, world = tmp_path / "m.yaml", tmp_path / "w.yaml"
    mission.write_text("simulation: {world: w.yaml}")
    world.write_text("wind: 0")
    task = Task(
        case="c", kind=CaseKind.FLIGHTS, mission=mission, seed=1, camera="corners", overrides=(), record_dir=None
    )

    def edits(path: Path, **_: object) -> FlightResult:
        world.write_text("wind: 9")
        return made_result(1)

    options = Options(processes=1, store=tmp_path / "store")
    run_tasks([task], edits, options, lambda *_: None)
    assert not list((tmp_path / "store").rglob("*.json"))
