"""Runs an external world on a UDP port, against the wall clock."""

import asyncio
from collections.abc import Callable

from sitl_stub.external.external_world import ExternalWorld
from sitl_stub.external.port import Address, AutopilotPort, clock
from sitl_stub.ranging_output import RangingOutput
from sitl_stub.server import Video

REQUEST_INTERVAL = 1.0
"""Wall time [s] without truth after which it is asked for, again and again."""
LATE = 0.25
"""Datagrams that have waited longer than this [s, wall] get no pictures, until the program has caught up."""
POLL = 0.1
SLOW = 0.05
"""Telemetry read later than this after its arrival [s, wall] means pictures that come too late."""
SLOW_SHARE = 0.01
"""Share of slow readings from which on the flight does not count."""
RESULTS = ("ACCEPTED", "TEMPORARILY_REJECTED", "DENIED", "UNSUPPORTED", "FAILED")


class NoAutopilotError(Exception):
    """There is no autopilot to follow; the message says what is missing."""


class Follower:
    """Runs an external world on a port, in the autopilot's time.

    Args:
        world: what follows.
        port: open.
        patience: wall time [s] to wait for a heartbeat, and then for the truth.
        video: where pictures go.
        say: told, in words, when the truth stops and returns.
        ranging: where ranges go; None: nowhere.
    """

    def __init__(
        self,
        world: ExternalWorld,
        port: AutopilotPort,
        *,
        patience: float,
        video: Video | None,
        say: Callable[[str], None],
        ranging: RangingOutput | None = None,
    ) -> None:
        self._world = world
        self._port = port
        self._patience = patience
        self._video = video
        self._say = say
        self._ranging = ranging
        self._peer: Address | None = None
        self._asked = 0
        self._silent = False
        self._read = self._slow = 0

    @property
    def slow_share(self) -> float:
        """Share of the telemetry that was read so late that pictures came too late."""
        return self._slow / self._read if self._read else 0.0

    async def run(self, stop: asyncio.Event, duration: float | None) -> None:
        """Follow until `stop` is set or `duration` [s, autopilot's time] is over; raises `NoAutopilotError`."""
        loop = asyncio.get_running_loop()
        begin = heard_truth = asked = loop.time()
        truths = self._world.truths
        while not stop.is_set() and not _over(self._world, duration):
            await self._port.wait(POLL)
            self._take()
            now = loop.time()
            if self._world.truths > truths:
                truths, heard_truth = self._world.truths, now
                self._tell_of_return()
            if self._peer is not None and (not self._asked or now - max(heard_truth, asked) > REQUEST_INTERVAL):
                asked = now
                self._ask()
            if self._world.truth is None and now - begin > self._patience * (1.0 if self._peer is None else 2.0):
                raise NoAutopilotError(self._complaint())
            await asyncio.sleep(0.0)

    def _take(self) -> None:
        for arrival, datagram, sender in self._port.receive():
            waited = clock() - arrival
            if not self._world.receive(arrival, datagram, late=waited > LATE):
                continue
            self._read += 1
            self._slow += waited > SLOW
            if self._peer != sender:
                self._peer = sender
                self._check_standing()
            self._publish()

    def _publish(self) -> None:
        if self._ranging is not None:
            self._ranging.send(self._world.ranges())
        for frame in self._world.frames():
            if self._video is not None and frame.image is not None:
                self._video.publish(frame.image, frame.t_capture, frame.sequence)

    def _check_standing(self) -> None:
        if self._world.truth is None and self._world.armed:
            raise NoAutopilotError(
                f"system {self._world.system} is armed: start the world while the vehicle stands on the ground, "
                "disarmed; its place becomes the world's origin"
            )

    def _ask(self) -> None:
        if self._peer is None:
            return
        if self._world.truth is not None and not self._silent:
            self._silent = True
            self._say(f"no truth for {REQUEST_INTERVAL:g} s: asking system {self._world.system} for it again")
        self._asked += 1
        for datagram in self._world.requests():
            self._port.send(datagram, self._peer)

    def _tell_of_return(self) -> None:
        if self._silent:
            self._silent = False
            self._say("the truth is back")

    def _complaint(self) -> str:
        world, (host, port) = self._world, self._port.address
        if self._peer is None:
            others = f" (heard: system {', '.join(map(str, sorted(world.others)))})" if world.others else ""
            return (
                f"no heartbeat of an autopilot on udp {host}:{port} within {self._patience:g} s{others}: "
                "start it first, and see to which port it sends"
            )
        answer = "no answer" if world.answer is None else f"answered {_result(world.answer)}"
        if world.truths == 0:
            return (
                f"system {world.system} sends no HIL_STATE_QUATERNION, asked {self._asked} times ({answer}): "
                "only an autopilot that simulates its own vehicle has it, as PX4 with SIH"
            )
        return (
            f"system {world.system} sends HIL_STATE_QUATERNION without a time, and no HIGHRES_IMU to date it ({answer})"
        )


def _result(number: int) -> str:
    return RESULTS[number] if number < len(RESULTS) else str(number)


def _over(world: ExternalWorld, duration: float | None) -> bool:
    return duration is not None and world.truth is not None and world.truth.t >= duration
