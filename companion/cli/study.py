"""`companion study WHAT`: work out a set-up before it is flown; one module for each WHAT."""

from __future__ import annotations

import argparse
from typing import Protocol

from companion.cli import study_anchors


class StudyModule(Protocol):
    """What the module of a study offers."""

    SUMMARY: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the study's arguments."""

    def run(self, args: argparse.Namespace) -> int:
        """Do it; give the exit code."""


STUDIES: dict[str, StudyModule] = {"anchors": study_anchors}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion study`."""
    chosen = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    for name, module in STUDIES.items():
        module.add_arguments(chosen.add_parser(name, help=module.SUMMARY, description=f"{module.SUMMARY}."))


def run(args: argparse.Namespace) -> int:
    """Do the chosen study; give its exit code."""
    return STUDIES[args.what].run(args)
