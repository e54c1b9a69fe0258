"""`companion ctl`: the operator's word to a flight that is running on this computer."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from companion.cli.main import NOT_ACHIEVED, SUCCESS
from companion.config import load_config
from companion.config.sections import OperatorSection
from companion.runtime.operator_socket import ORDERS, STATUS, ask

_HELP = """\
engage  begin the mission, or go on with it after somebody has taken the vehicle
hold    brake and give the vehicle to the autopilot's Hold; the mission waits for engage
land    brake and give the vehicle to the autopilot's Land; the mission waits for engage
abort   as hold, and the mission is over
status  say how things stand"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion ctl`."""
    parser.description = f"{parser.description}\n\n{_HELP}"
    parser.add_argument("order", choices=[*ORDERS, STATUS], help="see above")
    place = parser.add_mutually_exclusive_group()
    place.add_argument("--config", metavar="FILE", help="the flight's configuration; its operator.socket is used")
    place.add_argument(
        "--socket", metavar="PATH", type=Path, help=f"the flight's socket (default {OperatorSection().socket})"
    )
    parser.add_argument("--json", action="store_true", help="print the whole reply as one JSON object")


def run(args: argparse.Namespace) -> int:
    """Ask; 0 where the order is accepted, 1 where it is not, 3 where no flight is running."""
    path = args.socket or (load_config(args.config).operator if args.config else OperatorSection()).socket
    reply = ask(path, args.order)
    if args.json:
        print(json.dumps(reply))
    else:
        if reply.get("text"):
            print(reply["text"])
        status = reply.get("status")
        if args.order == STATUS and isinstance(status, dict):
            width = max(map(len, status), default=0)
            for name, value in status.items():
                print(f"{name.replace('_', ' '):<{width}}  {value}")
    return SUCCESS if reply.get("accepted") is True else NOT_ACHIEVED
