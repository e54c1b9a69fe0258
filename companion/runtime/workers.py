"""The detector in a process of its own: it never holds up a tick."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

import cv2
import numpy as np

from companion.errors import CameraError
from companion.geometry.transform import RigidTransform
from companion.messages.perception import CameraFrame, PadObservation
from companion.perception.camera_model import CameraModel
from companion.perception.pad import Pad
from companion.perception.pad_detector import PadDetector, PerceptionParameters
from companion.runtime.ports import DetectionRequest


class DetectorProcess:
    """Searches frames in another process. One that dies is replaced; its frame counts as never seen.

    Args:
        pad: what is looked for.
        camera: calibrated.
        parameters: tuning of the detector.
    """

    def __init__(self, pad: Pad, camera: CameraModel, parameters: PerceptionParameters) -> None:
        self._setup = (pad, camera, parameters)
        self._size = camera.height, camera.width
        self._pool = self._new_pool()
        self.deaths = 0  # processes that had to be replaced

    async def start(self) -> None:
        """Start the process and search an empty frame, so that the first real one does not wait for it.

        Raises:
            CameraError: the process does not come up.
        """
        blank = CameraFrame(t=0.0, t_arrival=0.0, sequence=0, image=np.zeros(self._size, dtype=np.uint8))
        if await self.observe(DetectionRequest(frame=blank, predicted=None)) is None:
            raise CameraError("the detector process does not start; its cause stands above")

    async def observe(self, request: DetectionRequest) -> PadObservation | None:
        """Search one frame; None where the process died over it."""
        loop = asyncio.get_running_loop()
        pool = self._pool
        try:
            return await loop.run_in_executor(pool, _observe, request.frame, request.predicted)
        except BrokenProcessPool:
            self.deaths += 1
            pool.shutdown(wait=False)
            self._pool = self._new_pool()
            return None

    def close(self) -> None:
        """End the process; a search that is under way is not waited for."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            max_workers=1,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_begin,
            initargs=self._setup,
        )


_detector: PadDetector | None = None


def _begin(pad: Pad, camera: CameraModel, parameters: PerceptionParameters) -> None:
    """Build the detector, once in each worker process."""
    global _detector  # noqa: PLW0603 - the state of a worker process
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the main process stops in good order, and ends this one
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()
    cv2.setNumThreads(1)
    _detector = PadDetector(pad, camera, parameters)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(0)


def _observe(frame: CameraFrame, predicted: RigidTransform | None) -> PadObservation:
    if _detector is None:
        raise RuntimeError("the worker has no detector")
    return _detector.observe(frame, predicted)
