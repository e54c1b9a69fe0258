"""Virtual time: the pipeline and a simulator in one process, as fast as the CPU allows, bit-reproducible."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol

import numpy as np
from annotated_types import Ge

from companion.messages.perception import CameraFrame, PadObservation, TagDetection
from companion.perception.pad_detector import PadDetector
from companion.runtime.pipeline import TICK_S, Pipeline
from companion.runtime.ports import Inbox

_PARTS = 5  # of a tick, after each of which arrivals are stamped


Port = Literal["onboard", "ground"]


class SimulatedFrame(Protocol):
    """A camera frame of the simulator: a picture, or the tag corners directly."""

    @property
    def t_capture(self) -> float:
        """Middle of the exposure [s]."""

    @property
    def t_delivery(self) -> float:
        """When the companion receives it [s]."""

    @property
    def sequence(self) -> int:
        """Frame counter."""

    @property
    def image(self) -> np.ndarray | None:
        """The grey picture, or None."""

    @property
    def tags(self) -> Sequence[tuple[int, np.ndarray]] | None:
        """Tag ids with corners (4, 2) [px], or None."""

    @property
    def sigmas(self) -> Sequence[float] | None:
        """Stated standard deviation of the corners of each tag [px], or None."""


class SimulatedVehicle(Protocol):
    """What lockstep needs of a simulator."""

    def advance(self, until: float) -> None:
        """Run the simulation up to an instant [s]."""

    def receive(self, port: Port, datagram: bytes) -> None:
        """Hand a datagram to the autopilot."""

    def transmit(self, port: Port) -> list[bytes]:
        """Take the datagrams that the autopilot has sent since the last call."""

    def frames(self) -> Sequence[SimulatedFrame]:
        """Take the frames delivered since the last call."""

    def ranges(self) -> list[bytes]:
        """Take the packets of the ranging radio that have arrived since the last call."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LockstepParameters:
    """Modelled delays."""

    detection_s: Annotated[float, Ge(0.0)] = 0.012  # [s] from a frame's arrival to its observation


class Lockstep:
    """Drives a pipeline against a simulator."""

    def __init__(
        self,
        *,
        pipeline: Pipeline,
        simulation: SimulatedVehicle,
        detector: PadDetector,
        parameters: LockstepParameters,
    ) -> None:
        self._pipeline = pipeline
        self._simulation = simulation
        self._detector = detector
        self._p = parameters
        self._pending: list[tuple[float, int, PadObservation]] = []
        self._count = 0
        self.t = 0.0

    def step(self) -> None:
        """Advance by one tick of the pipeline."""
        datagrams: list[tuple[float, bytes]] = []
        ranges: list[tuple[float, bytes]] = []
        for part in range(1, _PARTS + 1):  # the wire is read more often than the pipeline runs, as in flight
            t = (self._count + part / _PARTS) * TICK_S
            self._simulation.advance(t)
            datagrams.extend((t, datagram) for datagram in self._simulation.transmit("onboard"))
            ranges.extend((t, packet) for packet in self._simulation.ranges())
        self._count += 1
        self.t = self._count * TICK_S
        for frame in self._simulation.frames():
            observation = self._observe(frame)
            heapq.heappush(self._pending, (frame.t_delivery + self._p.detection_s, frame.sequence, observation))
        observations = []
        while self._pending and self._pending[0][0] <= self.t:
            observations.append(heapq.heappop(self._pending)[2])
        inbox = Inbox(datagrams=datagrams, observations=observations, ranges=ranges)
        for datagram in self._pipeline.step(self.t, inbox).datagrams:
            self._simulation.receive("onboard", datagram)

    def run(self, until: float, on_step: Callable[[float], bool]) -> None:
        """Step until an instant [s], or until `on_step` answers False."""
        while self.t < until:
            self.step()
            if not on_step(self.t):
                return

    def _observe(self, frame: SimulatedFrame) -> PadObservation:
        if frame.image is None:
            given = frame.tags or ()
            tags = [
                TagDetection(id=tag, corners=corners, corner_sigma=sigma, method="given")
                for (tag, corners), sigma in zip(given, frame.sigmas or (0.1,) * len(given), strict=True)
            ]
            return self._detector.observe_corners(frame.t_capture, frame.sequence, tags)
        request = self._pipeline.detection_request(
            CameraFrame(t=frame.t_capture, t_arrival=frame.t_delivery, sequence=frame.sequence, image=frame.image)
        )
        return self._detector.observe(request.frame, request.predicted)
