"""The option `--set`, the same for every verb that reads a mission."""

from __future__ import annotations

import argparse


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """Declare `--set a.b=value`; the texts are collected in `overrides`."""
    parser.add_argument(
        "--set",
        metavar="a.b=value",
        dest="overrides",
        action="append",
        default=[],
        help="replace one value of the mission or of the configuration; may be given several times",
    )
