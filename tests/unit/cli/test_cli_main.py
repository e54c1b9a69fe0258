import json
import subprocess
import sys
import types
from pathlib import Path

import pytest

from companion.cli import main as cli
from companion.errors import CameraError, CameraNotReadyError, CompanionError, InputError, RecordingError, VehicleError

ROOT = Path(__file__).parents[3]
MISSION = str(ROOT / "missions" / "land_static.yaml")


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"]])
def test_help_lists_verbs_and_exit_codes(words, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(words)
    assert ended.value.code == 0
    shown = capsys.readouterr().out
    assert all(verb in shown for verb in ("sim", "fly", "check", "detect", "campaign"))
    for line in ("0  success", "1  the mission was not achieved", "2  bad input", "3  no vehicle"):
        assert line in shown


def test_version(capsys) -> None:
    assert cli.main(["--version"]) == 0
    name, version = capsys.readouterr().out.split()
    assert name == "companion"
    assert version[0].isdigit()


@pytest.mark.parametrize(
    ("word", "part"), [("chek", "did you mean check?"), ("x" * 9, "the verbs are sim, fly, check")]
)
def test_unknown_verb(word: str, part: str, capsys) -> None:
    assert cli.main([word]) == 2
    assert part in capsys.readouterr().err


def test_unknown_option(capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["check", MISSION, "--nope"])
    assert ended.value.code == 2
    assert "--nope" in capsys.readouterr().err


def test_help_loads_no_heavy_module() -> None:
    code = (
        "import sys\nfrom companion.cli import main\n"
        "try: main.main(['--help'])\nexcept SystemExit: pass\n"
        "print([m for m in ('numpy', 'cv2', 'yaml', 'pydantic', 'pymavlink', 'asyncio') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.fixture
def verb(monkeypatch):
    """Install a verb `try` that does what the test says."""

    def install(run) -> None:
        module = types.ModuleType("companion_verb_for_test")
        module.add_arguments = lambda parser: parser.add_argument("--number", type=int, default=0)
        module.run = run
        monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.setitem(cli.VERBS, "try", cli.Verb(module=module.__name__, summary="try"))

    return install


def test_a_verb_gets_its_arguments_and_gives_the_exit_code(verb) -> None:
    verb(lambda args: args.number)
    assert cli.main(["try", "--number", "1"]) == 1


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InputError.single(source="f.yaml", wrong="bad", right="good"), 2),
        (CameraError("no camera"), 2),
        (CameraNotReadyError("no camera yet"), 3),
        (RecordingError("no space"), 2),
        (VehicleError("no heartbeat"), 3),
        (CompanionError("something"), 1),
        (KeyboardInterrupt(), 1),
    ],
)
def test_errors_become_a_message_and_an_exit_code(verb, error, code: int, capsys) -> None:
    def fail(args) -> int:
        raise error

    verb(fail)
    assert cli.main(["try"]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert (str(error) or "interrupted") in captured.err
    assert "Traceback" not in captured.err


def test_our_own_mistakes_are_not_hidden(verb) -> None:
    def fail(args) -> int:
        raise ZeroDivisionError

    verb(fail)
    with pytest.raises(ZeroDivisionError):
        cli.main(["try"])


@pytest.mark.parametrize(
    ("module", "part"),
    [("companion.cli.not_there", "not part of this installation"), ("companion_needs_extra", "pip install")],
)
def test_a_verb_that_cannot_be_loaded(module: str, part: str, monkeypatch, tmp_path, capsys) -> None:
    (tmp_path / "companion_needs_extra.py").write_text("import surely_not_installed\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(cli.VERBS, "try", cli.Verb(module=module, summary="try"))
    assert cli.main(["try"]) == 2
    assert part in capsys.readouterr().err


def test_check_says_what_will_be_done(capsys) -> None:
    assert cli.main(["check", MISSION]) == 0
    shown = capsys.readouterr().out
    assert "take off to 4 m, then search" in shown
    assert "limits   3 m/s, up 1.5, down 1, towards the target 1.5; 2.5 m/s^2; fence 50 m around" in shown
    assert "unseen   fly on for 4 s, hold for 5 s, search for 60 s, then hold" in shown
    assert "all in order" in shown


def test_check_reports_every_problem_on_stderr(capsys) -> None:
    assert cli.main(["check", MISSION, "--set", "name=3", "--set", "vehicle.type=plane", "--set", "x=1"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 3


def test_check_knows_the_worlds_of_the_simulator(capsys) -> None:
    assert cli.main(["check", MISSION, "--set", "simulation.world=moon", "--set", "name=3"]) == 2
    captured = capsys.readouterr()
    assert "no world 'moon'" in captured.err
    assert len(captured.err.splitlines()) == 2


def test_check_json(capsys) -> None:
    assert cli.main(["check", MISSION, "--json"]) == 0
    good = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert good["ok"] is True
    assert good["problems"] == []
    assert len(good["steps"]) == 3
    assert cli.main(["check", MISSION, "--json", "--set", "steps.0.takeoff.height_m=-1"]) == 2
    bad = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert bad["ok"] is False
    assert bad["problems"][0]["key"] == "steps.0.takeoff.height_m"
    assert set(bad["problems"][0]) == {"source", "line", "column", "key", "wrong", "right"}


@pytest.mark.parametrize("verb", ["sim", "fly", "check"])
def test_bad_input_is_one_json_object_where_a_program_asks(verb: str, capsys) -> None:
    assert cli.main([verb, MISSION, "--json", "--set", "steps.0.takeoff.height_m=-1"]) == 2
    captured = capsys.readouterr()
    (line,) = captured.out.splitlines()
    told = json.loads(line)
    assert told["ok"] is False
    assert told["problems"][0]["key"] == "steps.0.takeoff.height_m"
    assert "height_m" in captured.err


def test_check_dump_shows_the_effective_configuration(capsys) -> None:
    assert cli.main(["check", MISSION, "--dump", "--set", "camera.latency_s=0.123"]) == 0
    shown = capsys.readouterr().out
    assert "latency_s: 0.123" in shown
    assert shown.startswith("# effective configuration, sha256 ")


def test_every_step_is_described() -> None:
    from companion.cli.check import describe_step
    from companion.mission import Follow, FollowUntil, Hold, Land, Search, Takeoff

    texts = [
        describe_step(step)
        for step in (
            Takeoff(),
            Search(),
            Follow(),
            Follow(for_s=60.0),
            Follow(for_s=60.0, until=FollowUntil.TARGET_STOPPED),
            Land(),
            Hold(),
        )
    ]
    assert len(set(texts)) == len(texts)
    assert "until it stops, for 60 s at least" in texts[4]


def test_python_m_companion() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "companion", "check", "nope.yaml"], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 2
    assert done.stderr.startswith("nope.yaml: no such file")
