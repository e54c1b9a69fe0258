"""Real time: the pipeline as an asyncio program, against an autopilot on a transport and a camera."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Annotated, Protocol

from annotated_types import Gt

from companion.camera.source import CameraEvent, CameraFrozen, CameraSource, CameraStalled
from companion.clock import Clock
from companion.link.transport import Transport
from companion.messages.perception import CameraFrame, PadObservation
from companion.recording.recorder import Recorder
from companion.runtime.pipeline import TICK_S, Pipeline
from companion.runtime.ports import DetectionRequest, Inbox, MissionStatus
from companion.runtime.service import ServiceNotifier

Positive = Annotated[float, Gt(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightParameters:
    """Patience at the end, and how often the camera is looked at."""

    drain_s: Positive = 3.0  # steps run on for this long after the end, to leave OFFBOARD properly
    idle_s: Positive = 0.002  # pause between looks at the camera
    watch_s: Positive = 0.1  # pause between looks at the camera's troubles


class GroundStation(Protocol):
    """A ground station with an address of its own."""

    def send(self, data: bytes) -> None:
        """Send one datagram; must not block."""


class SlowDetector(Protocol):
    """Searches frames beside the ticks."""

    async def observe(self, request: DetectionRequest) -> PadObservation | None:
        """Search one frame; None where the search failed."""


class Observer(Protocol):
    """Is told what happens; must not block."""

    def tick(self, t: float) -> None:
        """A step was made at `t` [s]."""

    def note(self, t: float, text: str) -> None:
        """Something worth telling happened at `t` [s]."""


@dataclass(slots=True, kw_only=True)
class TickStatistics:
    """How well the ticks kept their time."""

    ticks: int = 0
    missed: int = 0  # periods in which there was no tick
    late_max_s: float = 0.0  # longest delay of a tick
    step_max_s: float = 0.0  # longest tick
    frames: int = 0  # searched by the detector


class FlightLoop:
    """Runs the pipeline at 50 Hz, and the camera and its detector beside it.

    A tick that comes late is run at once and the next one keeps its place; ticks that were missed altogether are not
    made up for. Of the camera's frames the newest wins.

    Args:
        pipeline: what is run.
        transport: to the autopilot, open.
        camera: running.
        detector: running.
        clock: the one that stamps datagrams and frames.
        parameters: patience.
        notifier: of the service manager; its watchdog is kicked by the ticks.
        observer: told of each tick.
        frames_to: recorder that keeps the camera's pictures; None: they are not kept.
        ground: takes what is for the ground station's own address; None: there is none.
    """

    def __init__(
        self,
        *,
        pipeline: Pipeline,
        transport: Transport,
        camera: CameraSource,
        detector: SlowDetector,
        clock: Clock,
        parameters: FlightParameters,
        notifier: ServiceNotifier,
        observer: Observer,
        frames_to: Recorder | None = None,
        ground: GroundStation | None = None,
    ) -> None:
        self._pipeline = pipeline
        self._transport = transport
        self._camera = camera
        self._detector = detector
        self._clock = clock
        self._p = parameters
        self._notifier = notifier
        self._observer = observer
        self._frames_to = frames_to
        self._ground = ground
        self._observations: list[PadObservation] = []
        self._stop = asyncio.Event()
        self.statistics = TickStatistics()

    def stop(self) -> None:
        """Ask for an orderly end: brake, hand over to the autopilot's Hold, then return."""
        self._stop.set()

    async def run(self) -> MissionStatus:
        """Fly until the mission has ended and the vehicle is given back."""
        async with asyncio.TaskGroup() as tasks:
            beside = [tasks.create_task(self._search()), tasks.create_task(self._watch_camera())]
            try:
                await self._tick_on()
            finally:
                for task in beside:
                    task.cancel()
        return self._pipeline.mission

    async def _tick_on(self) -> None:
        due, t_end = self._clock.now(), None
        while True:
            now = self._clock.now()
            if now < due:
                await asyncio.sleep(due - now)
                continue
            self._tick(now)
            self._note_time(due, now)
            due = max(due + TICK_S, now)
            if self._stop.is_set() and not self._pipeline.mission.ended:
                self._pipeline.stop(now)
            if t_end is None and self._pipeline.mission.ended:
                t_end = now + self._p.drain_s
            if t_end is not None and (now >= t_end or self._pipeline.quiet):
                return
            await asyncio.sleep(0.0)

    def _tick(self, t: float) -> None:
        observations, self._observations = self._observations, []
        inbox = Inbox(datagrams=self._transport.receive(), observations=observations)
        outbox = self._pipeline.step(t, inbox)
        for datagram in outbox.datagrams:
            self._transport.send(datagram)
        if self._ground is not None:
            for datagram in outbox.ground:
                self._ground.send(datagram)
        self._notifier.tick(t)
        self._observer.tick(t)

    def _note_time(self, due: float, began: float) -> None:
        late, statistics = began - due, self.statistics
        statistics.ticks += 1
        statistics.missed += int(late / TICK_S)
        statistics.late_max_s = max(statistics.late_max_s, late)
        statistics.step_max_s = max(statistics.step_max_s, self._clock.now() - began)

    async def _search(self) -> None:
        """Hand the newest frame to the detector whenever it is free."""
        last = -1
        while True:
            frame = self._camera.newest()
            if frame is None or frame.sequence == last:
                await asyncio.sleep(self._p.idle_s)
                continue
            last = frame.sequence
            self._keep(frame)
            observation = await self._detector.observe(self._pipeline.detection_request(frame))
            if observation is None:
                self._observer.note(self._clock.now(), "the detector process died; it is started anew")
                continue
            self.statistics.frames += 1
            self._observations.append(observation)

    def _keep(self, frame: CameraFrame) -> None:
        if self._frames_to is None:
            return
        height, width = frame.image.shape
        about = {"t": frame.t, "sequence": frame.sequence, "width": width, "height": height}
        self._frames_to.record("frame", frame.t_arrival, about)
        self._frames_to.record_bytes("picture", frame.t_arrival, frame.image.tobytes())

    async def _watch_camera(self) -> None:
        """Tell of the camera's troubles; what they mean for the mission, guidance sees by the missing frames."""
        while True:
            for event in self._camera.events():
                self._observer.note(event.t, camera_words(event))
            await asyncio.sleep(self._p.watch_s)


def camera_words(event: CameraEvent) -> str:
    """Say what has happened to the camera."""
    if isinstance(event, CameraStalled):
        return f"the camera has given no picture for {event.silence:.1f} s: {event.reason}"
    if isinstance(event, CameraFrozen):
        return f"the camera has repeated one picture for {event.t - event.since:.1f} s"
    return "the camera gives pictures again"
