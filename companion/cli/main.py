"""`companion VERB ...`: one module for each verb, imported only when it is chosen."""

from __future__ import annotations

import argparse
import dataclasses
import difflib
import importlib
import importlib.metadata
import json
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from companion.errors import CameraError, CameraNotReadyError, CompanionError, InputError, RecordingError, VehicleError

SUCCESS, NOT_ACHIEVED, BAD_INPUT, NO_VEHICLE, PLANNER_DIED = 0, 1, 2, 3, 4

EXIT_CODES = """\
exit codes:
  0  success
  1  the mission was not achieved
  2  bad input: a file or an option is wrong, nothing was started
  3  no vehicle, the wrong vehicle, or the vehicle was lost; no camera; no flight to talk to
  4  the planner's process died; the vehicle was given to the autopilot"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verb:
    """One verb of the command line."""

    module: str  # has `add_arguments(parser)` and `run(args) -> int`
    summary: str  # one line for the help


class VerbModule(Protocol):
    """What the module of a verb offers."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the verb's arguments."""

    def run(self, args: argparse.Namespace) -> int:
        """Do it; give the exit code."""


VERBS = {
    "sim": Verb(module="companion.cli.sim", summary="fly a mission in the built-in simulator, in one process"),
    "fly": Verb(module="companion.cli.fly", summary="fly a mission on a real or simulated PX4, over MAVLink"),
    "check": Verb(module="companion.cli.check", summary="check a mission and every file that it names"),
    "ctl": Verb(module="companion.cli.ctl", summary="tell a flight that is running: engage, hold, land, abort, status"),
    "doctor": Verb(
        module="companion.cli.doctor", summary="check link, autopilot, camera, ranges and computer before a flight"
    ),
    "detect": Verb(module="companion.cli.detect", summary="show what the tag detector sees in pictures or a camera"),
    "calibrate": Verb(
        module="companion.cli.calibrate", summary="find where the ranging anchors stand, from a recorded flight"
    ),
    "campaign": Verb(module="companion.cli.campaign", summary="fly many simulated missions and report the statistics"),
    "papers": Verb(
        module="companion.cli.papers", summary="fly a paper's experiments and hold them against its figures"
    ),
    "study": Verb(module="companion.cli.study", summary="work out, before a flight, what a mission needs"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; give the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    return guarded(lambda: _run(words), as_json="--json" in words)


def guarded(run: Callable[[], int], *, as_json: bool = False) -> int:
    """Run a part of the program; say what went wrong, and give the exit code.

    Args:
        run: the part; gives its exit code.
        as_json: say it on standard output, too, as one JSON object.
    """
    try:
        return _told(run) if as_json else run()
    except InputError as error:
        return _fail(str(error), BAD_INPUT)
    except CameraNotReadyError as error:
        return _fail(str(error), NO_VEHICLE)
    except (CameraError, RecordingError) as error:
        return _fail(str(error), BAD_INPUT)
    except VehicleError as error:
        return _fail(str(error), NO_VEHICLE)
    except CompanionError as error:
        return _fail(str(error), NOT_ACHIEVED)
    except KeyboardInterrupt:
        return _fail("interrupted", NOT_ACHIEVED)
    except BrokenPipeError:  # the reader of our output has gone, as with `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NOT_ACHIEVED


def _told(run: Callable[[], int]) -> int:
    """Run a part; tell an error as one JSON object before it goes on."""
    try:
        return run()
    except CompanionError as error:
        problems = error.problems if isinstance(error, InputError) else ()
        told = [dataclasses.asdict(problem) for problem in problems] or [{"wrong": str(error)}]
        print(json.dumps({"ok": False, "problems": told}))
        raise


def _run(words: list[str]) -> int:
    parser = _overview()
    name = words[0] if words else "--help"
    if name in VERBS:
        verb = VERBS[name]
        chosen = argparse.ArgumentParser(
            prog=f"companion {name}",
            description=f"{verb.summary[0].upper()}{verb.summary[1:]}.",
            epilog=EXIT_CODES,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module = _load(name)
        module.add_arguments(chosen)
        return module.run(chosen.parse_args(words[1:]))
    if not name.startswith("-"):
        raise InputError.single(source="companion", wrong=f'there is no verb "{name}"', right=_suggestion(name))
    if parser.parse_args(words or ["--help"]).version:
        print(f"companion {importlib.metadata.version('companion')}")
    return SUCCESS


def _load(name: str) -> VerbModule:
    module_name = VERBS[name].module
    try:
        module: VerbModule = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        missing = error.name or "a module"
        if missing == module_name:
            wrong, right = f"the verb {name} is not part of this installation", "use another verb"
        elif missing.split(".")[0] in ("companion", "sitl_stub"):
            raise
        else:
            wrong = f"the Python package {missing.split('.')[0]} is not installed"
            right = 'install the simulation extras: pip install "companion[sim]"'
        raise InputError.single(source=f"companion {name}", wrong=wrong, right=right) from None
    return module


def _overview() -> argparse.ArgumentParser:
    width = max(len(name) for name in VERBS)
    verbs = "\n".join(f"  {name:<{width}}  {verb.summary}" for name, verb in VERBS.items())
    parser = argparse.ArgumentParser(
        prog="companion",
        usage="companion VERB [options]",
        description="Find, follow, meet and land on a moving target with one camera, on PX4.\n\n"
        f"verbs:\n{verbs}\n\n`companion VERB --help` explains each.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="show the version and end")
    return parser


def _suggestion(word: str) -> str:
    near = difflib.get_close_matches(word.lower(), list(VERBS), n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"the verbs are {', '.join(VERBS)}"


def _fail(message: str, code: int) -> int:
    sys.stdout.flush()
    print(message, file=sys.stderr)
    return code
