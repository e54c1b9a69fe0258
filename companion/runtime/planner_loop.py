"""The planner's process in real time: a step for each telemetry of the guardian, the camera and its detector beside."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Protocol

from annotated_types import Gt

from companion.camera.source import CameraEvent, CameraFrozen, CameraSource, CameraStalled
from companion.clock import Clock
from companion.guardian.handover import Handover, Stage
from companion.messages.perception import CameraFrame, PadObservation
from companion.messages.proximity import RangeReading
from companion.ranging.source import RangingEvent
from companion.recording.recorder import Recorder
from companion.runtime.channel import GuardianPort
from companion.runtime.planner import Planner
from companion.runtime.ports import DetectionRequest, MissionStatus
from companion.runtime.telemetry import Telemetry, TickStatistics

Positive = Annotated[float, Gt(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerLoopParameters:
    """How often the camera is looked at."""

    idle_s: Positive = 0.002  # pause between looks at the camera
    watch_s: Positive = 0.1  # pause between looks at the camera's troubles


class SlowDetector(Protocol):
    """Searches frames beside the ticks."""

    async def observe(self, request: DetectionRequest) -> PadObservation | None:
        """Search one frame; None where the search failed."""


class RangeSource(Protocol):
    """The ranging radio."""

    def poll(self, t: float) -> Sequence[RangeReading]:
        """Give the readings that have come until `t` [s]; each once."""

    def events(self) -> list[RangingEvent]:
        """Give what has happened since the last call."""


class Observer(Protocol):
    """Is told what happens; must not block."""

    def tick(self, t: float) -> None:
        """A step was made at `t` [s]."""

    def note(self, t: float, text: str) -> None:
        """Something worth telling happened at `t` [s]."""


class PlannerLoop:
    """Steps the planner with the telemetry of the guardian's process, until that ends the connection.

    Of the camera's frames the newest wins. A telemetry that finds the planner busy is joined with the next.

    Args:
        planner: what is run.
        guardian: the other process.
        camera: running.
        detector: running.
        clock: the one that stamps datagrams and frames.
        parameters: patience.
        observer: told of each step.
        frames_to: recorder that keeps the camera's pictures; None: they are not kept.
        ranging: the ranging radio; None: there is none.
    """

    def __init__(
        self,
        *,
        planner: Planner,
        guardian: GuardianPort,
        camera: CameraSource,
        detector: SlowDetector,
        clock: Clock,
        parameters: PlannerLoopParameters,
        observer: Observer,
        frames_to: Recorder | None = None,
        ranging: RangeSource | None = None,
    ) -> None:
        self._planner = planner
        self._guardian = guardian
        self._camera = camera
        self._detector = detector
        self._clock = clock
        self._p = parameters
        self._observer = observer
        self._frames_to = frames_to
        self._ranging = ranging
        self._observations: list[PadObservation] = []
        self.statistics: TickStatistics | None = None  # of the guardian, as it last told; None: it never did
        self.frames = 0  # searched by the detector

    async def run(self) -> MissionStatus:
        """Plan until the guardian's process ends the connection."""
        self._guardian.send(Handover(t=self._clock.now(), stage=Stage.WAITING, reason="camera and detector are ready"))
        async with asyncio.TaskGroup() as tasks:
            beside = [tasks.create_task(self._search()), tasks.create_task(self._watch_camera())]
            try:
                await self._step_on()
            finally:
                for task in beside:
                    task.cancel()
        self._planner.stop(self._clock.now(), "the guardian's process has ended")
        return self._planner.mission

    async def _step_on(self) -> None:
        arrived = asyncio.Event()
        loop, descriptor = asyncio.get_running_loop(), self._guardian.fileno()
        loop.add_reader(descriptor, arrived.set)
        try:
            while not self._guardian.closed:
                await arrived.wait()
                arrived.clear()
                telemetry = self._guardian.receive()
                if telemetry is not None:
                    self._step(telemetry)
        finally:
            loop.remove_reader(descriptor)

    def _step(self, telemetry: Telemetry) -> None:
        observations, self._observations = self._observations, []
        self._guardian.send(self._planner.step(telemetry, observations, self._ranges(telemetry.t)))
        self._planner.conclude(telemetry, telemetry.output, telemetry.sent)
        self.statistics = telemetry.ticks
        self._observer.tick(telemetry.t)

    def _ranges(self, t: float) -> Sequence[RangeReading]:
        """Take the newest ranges, and tell of the radio's troubles."""
        if self._ranging is None:
            return ()
        readings = self._ranging.poll(t)
        for event in self._ranging.events():
            self._observer.note(event.t, str(event))
        return readings

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
            observation = await self._detector.observe(self._planner.detection_request(frame))
            if observation is None:
                self._observer.note(self._clock.now(), "the detector process died; it is started anew")
                continue
            self.frames += 1
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
