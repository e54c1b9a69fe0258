"""Program `sitl-stub world`: camera and targets for an autopilot that runs elsewhere."""

import argparse
import asyncio
import contextlib
import json
import math
import signal
import sys
from collections.abc import Sequence

from sitl_stub.external.external_world import ExternalWorld
from sitl_stub.external.follower import SLOW_SHARE, Follower, NoAutopilotError
from sitl_stub.external.port import AutopilotPort, parse_url
from sitl_stub.ranging_output import PORT, RangingOutput
from sitl_stub.server import HOST
from sitl_stub.summary import summary
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.world.mjpeg import MjpegServer
from sitl_stub.world.world import World

OK, BAD_INPUT, NO_AUTOPILOT = 0, 2, 3


def _say(text: str) -> None:
    print(f"sitl-stub world: {text}", file=sys.stderr, flush=True)


def _arguments(words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="sitl-stub world",
        description="Camera and targets for an autopilot that simulates its own vehicle (PX4 with SIH).",
    )
    parser.add_argument(
        "--autopilot",
        default="udp://127.0.0.1:14550",
        metavar="URL",
        help="where the autopilot sends to, and this listens",
    )
    parser.add_argument("--world", required=True, help="name or file of the world")
    parser.add_argument("--vehicle", default="x500", help="name or file of the vehicle that carries the camera")
    parser.add_argument("--seed", type=int, default=1, help="all dice of the world come from it (default 1)")
    parser.add_argument("--camera", choices=("rendered", "corners"), default="rendered", help="corners: no pictures")
    parser.add_argument(
        "--mjpeg-port", type=port_number, default=8080, help="HTTP port of the camera (0: any free one)"
    )
    parser.add_argument(
        "--ranging-port",
        type=port_number,
        default=PORT,
        help=f"UDP port on which the companion takes ranges, where the world has radios (default {PORT})",
    )
    parser.add_argument("--system", type=int, help="the autopilot's system id (default: the first that is heard)")
    parser.add_argument("--timeout", type=seconds, default=10.0, help="seconds to wait for the autopilot (default 10)")
    parser.add_argument("--duration", type=seconds, help="stop after so many seconds of the autopilot's time")
    parser.add_argument("--json", action="store_true", help="print the final true state as one JSON line")
    return parser.parse_args(words)


def port_number(word: str) -> int:
    """Read a port, for argparse."""
    number = int(word)
    if not 0 <= number <= 65535:
        raise argparse.ArgumentTypeError(f"{number} is no port: 0 to 65535")
    return number


def seconds(word: str) -> float:
    """Read a length of time [s], for argparse."""
    number = float(word)
    if not (math.isfinite(number) and number > 0.0):
        raise argparse.ArgumentTypeError(f"{word} is no length of time: more than 0 seconds")
    return number


async def _run(arguments: argparse.Namespace, world: ExternalWorld, port: AutopilotPort) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            loop.add_signal_handler(number, stop.set)
    video = MjpegServer(arguments.mjpeg_port) if arguments.camera == "rendered" else None
    if video is not None:
        await video.start()
    camera = f"http://{HOST}:{video.port}/camera.mjpeg" if video is not None else "none (corners)"
    host, listening = port.address
    print(f"sitl-stub world: listens to the autopilot on udp {host}:{listening}")
    print(
        f"sitl-stub world: camera {camera}; world {arguments.world}, seed {arguments.seed}; stop with Ctrl-C",
        flush=True,
    )
    ranging = RangingOutput(arguments.ranging_port)
    follower = Follower(world, port, patience=arguments.timeout, video=video, say=_say, ranging=ranging)
    try:
        await follower.run(stop, arguments.duration)
    finally:
        ranging.close()
        if video is not None:
            await video.close()
    if follower.slow_share > SLOW_SHARE:
        _say(
            f"too slow for the autopilot's clock: {100.0 * follower.slow_share:.0f} % of its telemetry was read late, "
            f"{world.left_out} of its steps got no picture; give the machine less to do"
        )
    if arguments.json and world.truth is not None:
        print(json.dumps(summary(world.truth)), flush=True)


def main(words: Sequence[str] | None = None) -> int:
    """Run the program; returns 0, 2 on bad input, 3 without an autopilot that can be followed."""
    arguments = _arguments(words)
    try:
        world = ExternalWorld(
            World.load(arguments.world),
            load_vehicle(arguments.vehicle),
            arguments.seed,
            arguments.camera,
            system=arguments.system,
        )
        port = AutopilotPort(parse_url(arguments.autopilot))
        with contextlib.closing(port):
            asyncio.run(_run(arguments, world, port))
    except NoAutopilotError as error:
        _say(str(error))
        return NO_AUTOPILOT
    except (ValueError, OSError) as error:
        _say(str(error))
        return BAD_INPUT
    return OK
