"""Program `sitl-stub`: a simulated vehicle in a simulated world, in real time; or one of the two halves alone."""

import argparse
import asyncio
import contextlib
import json
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace

from sitl_stub.external.program import main as world_main
from sitl_stub.external.program import port_number, seconds
from sitl_stub.ranging_output import PORT
from sitl_stub.server import HOST, Server, ServerPorts
from sitl_stub.simulation import Simulation
from sitl_stub.summary import summary
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.world.mjpeg import MjpegServer
from sitl_stub.world.world import World

OK, BAD_INPUT = 0, 2


def _whole(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="sitl-stub",
        description="A PX4-like vehicle and a world with targets: MAVLink on UDP, camera on HTTP.",
        epilog="The halves alone: `sitl-stub vehicle --help`, `sitl-stub world --help`.",
    )
    parser.add_argument("--world", required=True, help="name or file of the world")
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
    _add_vehicle(parser)
    return parser.parse_args(words)


def _vehicle_alone(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="sitl-stub vehicle",
        description="The vehicle without targets and camera: an autopilot that simulates its own vehicle.",
    )
    parser.add_argument("--world", default="flat_ground", help="the world whose wind blows (default flat_ground: none)")
    _add_vehicle(parser)
    return parser.parse_args(words, argparse.Namespace(camera="corners", mjpeg_port=0, ranging_port=PORT))


def _add_vehicle(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--vehicle", default="x500", help="name or file of the vehicle (default x500)")
    parser.add_argument("--seed", type=int, default=1, help="all dice come from it (default 1)")
    parser.add_argument(
        "--onboard-port", type=port_number, default=14540, help="UDP port on which the companion listens"
    )
    parser.add_argument(
        "--ground-port", type=port_number, default=14550, help="UDP port on which the ground station listens"
    )
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="FAULT[@SECONDS]",
        help="refuse_arming=gps, gnss_lost@30, position_jump=3,0,0@40, battery=6@60, reboot@50 … (again for more)",
    )
    parser.add_argument("--duration", type=seconds, help="stop after so many seconds")
    parser.add_argument("--json", action="store_true", help="print the final true state as one JSON line")


async def _run(arguments: argparse.Namespace, simulation: Simulation) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            loop.add_signal_handler(number, stop.set)
    ports = ServerPorts(onboard=arguments.onboard_port, ground=arguments.ground_port, ranging=arguments.ranging_port)
    video = MjpegServer(arguments.mjpeg_port) if arguments.camera == "rendered" else None
    if video is not None:
        await video.start()
    server = Server(simulation, ports, video)
    camera = f"http://{HOST}:{video.port}/camera.mjpeg" if video is not None else "none (corners)"
    print(f"sitl-stub: MAVLink to udp {HOST}:{ports.onboard} (companion), {HOST}:{ports.ground} (ground station)")
    print(f"sitl-stub: camera {camera}; world {arguments.world}, seed {arguments.seed}; stop with Ctrl-C", flush=True)
    try:
        await server.run(stop, arguments.duration)
    finally:
        if video is not None:
            await video.close()
    if server.lost_time > 0.0:
        print(f"sitl-stub: too slow for real time by {server.lost_time:.1f} s", file=sys.stderr)
    if arguments.json:
        print(json.dumps(summary(simulation.truth())), flush=True)


def main(words: Sequence[str] | None = None) -> int:
    """Run the program; returns 0, 2 on bad input, and for `world` 3 without an autopilot."""
    words = sys.argv[1:] if words is None else words
    if words[:1] == ["world"]:
        return world_main(words[1:])
    alone = words[:1] == ["vehicle"]
    arguments = _vehicle_alone(words[1:]) if alone else _whole(words)
    try:
        world = World.load(arguments.world)
        simulation = Simulation(
            replace(world, targets=(), ranging=None) if alone else world,
            load_vehicle(arguments.vehicle),
            arguments.seed,
            arguments.camera,
            faults=arguments.fault,
        )
        asyncio.run(_run(arguments, simulation))
    except (ValueError, OSError) as error:
        print(f"sitl-stub: {error}", file=sys.stderr)
        return BAD_INPUT
    return OK


if __name__ == "__main__":
    sys.exit(main())
