"""Real time: the pipeline as an asyncio program, against an autopilot on a transport and a camera."""

from __future__ import annotations

import asyncio
import multiprocessing
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt

from companion.camera.source import CameraSource
from companion.clock import Clock
from companion.errors import CameraError, VehicleError
from companion.geometry.transform import RigidTransform
from companion.link.transport import Transport
from companion.messages.perception import CameraFrame, PadObservation
from companion.perception.pad_detector import PadDetector
from companion.runtime.pipeline import TICK_S, Pipeline
from companion.runtime.ports import Detector, Inbox, MissionStatus
from companion.runtime.service import ServiceNotifier

Positive = Annotated[float, Gt(0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightParameters:
    """Patience with the outside world."""

    vehicle_timeout_s: Positive = 10.0  # a heartbeat must have come by then
    lost_timeout_s: Positive = 10.0  # silence of the autopilot after which the mission is given up
    drain_s: Positive = 3.0  # steps run on for this long after the end, to leave OFFBOARD properly
    idle_s: Positive = 0.002  # pause between looks at the camera


class FlightLoop:
    """Runs the pipeline at 50 Hz, the camera beside it, and the detector in a process of its own.

    A tick that comes late is run at once and the next one keeps its place; ticks that were missed altogether are not
    made up for. Of the camera's frames the newest wins.
    """

    def __init__(
        self,
        *,
        pipeline: Pipeline,
        transport: Transport,
        camera: CameraSource,
        detector: Detector,
        workers: Executor,
        clock: Clock,
        parameters: FlightParameters,
        notifier: ServiceNotifier,
        on_tick: Callable[[float], None],
    ) -> None:
        self._pipeline = pipeline
        self._transport = transport
        self._camera = camera
        self._detector = detector
        self._workers = workers
        self._clock = clock
        self._p = parameters
        self._notifier = notifier
        self._on_tick = on_tick
        self._observations: list[PadObservation] = []
        self._stop = asyncio.Event()
        self._t_heard: float | None = None
        self._camera_error: CameraError | None = None

    def stop(self) -> None:
        """Ask for an orderly end: leave OFFBOARD, then return."""
        self._stop.set()

    async def run(self) -> MissionStatus:
        """Fly until the mission has ended.

        Raises:
            VehicleError: no heartbeat within the time, or the autopilot fell silent for good.
        """
        try:
            async with asyncio.TaskGroup() as tasks:
                watching = tasks.create_task(self._watch())
                try:
                    await self._tick_on()
                finally:
                    watching.cancel()
        except* (VehicleError, CameraError) as group:
            raise group.exceptions[0] from None
        return self._pipeline.mission

    async def _tick_on(self) -> None:
        started = self._clock.now()
        due, t_end = started, None
        while True:
            now = self._clock.now()
            if now < due:
                await asyncio.sleep(due - now)
                continue
            self._tick(now)
            due = max(due + TICK_S, now)
            if self._stop.is_set() and t_end is None:
                self._pipeline.stop(now)
                t_end = now + self._p.drain_s
            if self._pipeline.mission.ended and t_end is None:
                t_end = now + self._p.drain_s
            if t_end is not None and (now >= t_end or self._pipeline.quiet):
                return
            self._check_silence(now, started)
            await asyncio.sleep(0.0)

    def _tick(self, t: float) -> None:
        received = self._transport.receive()
        if received:
            self._t_heard = received[-1].t
        observations, self._observations = self._observations, []
        outbox = self._pipeline.step(t, Inbox(datagrams=received, observations=observations))
        for datagram in outbox.datagrams:
            self._transport.send(datagram)
        self._notifier.tick(t)
        self._on_tick(t)

    def _check_silence(self, now: float, started: float) -> None:
        if self._t_heard is None and now - started > self._p.vehicle_timeout_s:
            raise VehicleError(
                f"no vehicle: nothing heard from an autopilot in {self._p.vehicle_timeout_s:.0f} s; check that it is "
                "powered, that its MAVLink stream goes to the address of --connect, and its system id"
            )
        if self._t_heard is not None and now - self._t_heard > self._p.lost_timeout_s:
            raise VehicleError(f"vehicle lost: nothing heard from the autopilot for {now - self._t_heard:.0f} s")

    async def _watch(self) -> None:
        """Hand the newest frame to the detector whenever it is free."""
        loop = asyncio.get_running_loop()
        last = -1
        while True:
            frame = self._camera.newest()
            if frame is None or frame.sequence == last:
                await asyncio.sleep(self._p.idle_s)
                continue
            last = frame.sequence
            request = self._pipeline.detection_request(frame)
            try:
                observation = await loop.run_in_executor(
                    self._workers, _observe, self._detector, request.frame, request.predicted
                )
            except BrokenProcessPool:
                raise CameraError("the detector process died; its cause is in the system's log") from None
            self._observations.append(observation)


_detector: PadDetector | None = None


def _load_detector(detector: PadDetector) -> None:
    global _detector  # noqa: PLW0603 - one detector for each worker process, built once
    _detector = detector


class WorkerDetector:
    """Stands for the detector that lives in the worker process."""

    def observe(self, frame: CameraFrame, predicted: RigidTransform | None) -> PadObservation:
        """Search one frame, in the worker."""
        if _detector is None:
            raise RuntimeError("the worker has no detector")
        return _detector.observe(frame, predicted)


def _observe(detector: Detector, frame: CameraFrame, predicted: RigidTransform | None) -> PadObservation:
    return detector.observe(frame, predicted)


def detector_process(detector: PadDetector) -> ProcessPoolExecutor:
    """Start the process in which frames are searched: it never holds up a tick."""
    return ProcessPoolExecutor(
        max_workers=1,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_load_detector,
        initargs=(detector,),
    )
