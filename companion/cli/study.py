"""`companion study`: what can be worked out before a flight."""

from __future__ import annotations

import argparse
import importlib

_STUDIES = {
    "anchors": ("companion.cli.study_anchors", "how well ranging anchors fix a place, and where they would do better"),
    "policy": ("companion.cli.study_policy", "learn the optimal switching policy of a docking"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of every study; each is a module as those of the verbs are."""
    studies = parser.add_subparsers(dest="study", metavar="STUDY", required=True)
    for name, (module, summary) in _STUDIES.items():
        own = studies.add_parser(name, help=summary, description=f"{summary[0].upper()}{summary[1:]}.")
        study = importlib.import_module(module)
        study.add_arguments(own)
        own.set_defaults(run_study=study.run)


def run(args: argparse.Namespace) -> int:
    """Do the chosen study; give the exit code."""
    code: int = args.run_study(args)
    return code
