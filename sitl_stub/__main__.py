"""Program `sitl-stub`: a simulated vehicle in a simulated world, in real time."""

import argparse
import asyncio
import contextlib
import json
import signal
import sys
from collections.abc import Sequence

from sitl_stub.server import HOST, Server, ServerPorts
from sitl_stub.simulation import Simulation
from sitl_stub.truth import Truth
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.world.mjpeg import MjpegServer
from sitl_stub.world.world import World

OK, BAD_INPUT = 0, 2


def _arguments(words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="sitl-stub", description="A PX4-like vehicle and a world with targets: MAVLink on UDP, camera on HTTP."
    )
    parser.add_argument("--vehicle", default="x500", help="name or file of the vehicle (default x500)")
    parser.add_argument("--world", required=True, help="name or file of the world")
    parser.add_argument("--seed", type=int, default=1, help="all dice come from it (default 1)")
    parser.add_argument("--camera", choices=("rendered", "corners"), default="rendered", help="corners: no pictures")
    parser.add_argument("--onboard-port", type=_port, default=14540, help="UDP port on which the companion listens")
    parser.add_argument("--ground-port", type=_port, default=14550, help="UDP port on which the ground station listens")
    parser.add_argument("--mjpeg-port", type=_port, default=8080, help="HTTP port of the camera (0: any free one)")
    parser.add_argument(
        "--fault", action="append", default=[], metavar="FAULT", help="refuse_arming=gps, no_heartbeat …"
    )
    parser.add_argument("--duration", type=float, help="stop after so many seconds")
    parser.add_argument("--json", action="store_true", help="print the final true state as one JSON line")
    return parser.parse_args(words)


def _port(word: str) -> int:
    number = int(word)
    if not 0 <= number <= 65535:
        raise argparse.ArgumentTypeError(f"{number} is no port: 0 to 65535")
    return number


def summary(truth: Truth) -> dict[str, object]:
    """Give the true state as plain data, the vehicle's place also relative to each target."""
    vehicle = truth.vehicle
    north, east, down = vehicle.position_ned
    return {
        "t": truth.t,
        "position_ned": vehicle.position_ned,
        "velocity_ned": vehicle.velocity_ned,
        "quaternion": vehicle.quaternion,
        "feet_in_contact": vehicle.feet_in_contact,
        "surface": vehicle.surface,
        "armed": vehicle.armed,
        "targets": [
            {
                "name": target.name,
                "position_ned": target.position_ned,
                "yaw": target.yaw,
                "vehicle_minus_target_ned": [
                    north - target.position_ned[0],
                    east - target.position_ned[1],
                    down - target.position_ned[2],
                ],
            }
            for target in truth.targets
        ],
    }


async def _run(arguments: argparse.Namespace, simulation: Simulation) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            loop.add_signal_handler(number, stop.set)
    ports = ServerPorts(onboard=arguments.onboard_port, ground=arguments.ground_port)
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
    """Run the program; returns 0, or 2 on bad input."""
    arguments = _arguments(words)
    try:
        simulation = Simulation(
            World.load(arguments.world),
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
