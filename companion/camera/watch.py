"""Notice a camera that has stopped, or that repeats one picture for ever."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from companion.camera.source import CameraEvent, CameraFrozen, CameraRecovered, CameraStalled
from companion.geometry.arrays import Image


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchParameters:
    """When a camera counts as stopped."""

    stall_timeout: Annotated[float, Gt(0.0)] = 0.5  # [s] without a picture
    frozen_timeout: Annotated[float, Gt(0.0)] = 0.5  # [s] of equal pictures
    frozen_pictures: Annotated[int, Ge(2)] = 4  # and at least so many of them
    stride: Annotated[int, Ge(1)] = 7  # [px] every so many rows and columns are compared


class CameraWatch:
    """Follows the arrivals of one camera. Real pictures are never equal: every sensor has noise.

    Args:
        parameters: when it counts as stopped.
        t: [s] instant at which the camera began.
    """

    def __init__(self, parameters: WatchParameters, t: float) -> None:
        self._parameters = parameters
        self._t_arrival = t
        self._t_changed = t
        self._checksum: int | None = None
        self._equal = 0
        self._trouble: type[CameraStalled] | type[CameraFrozen] | None = None

    @property
    def frozen(self) -> bool:
        """Whether the newest pictures are only repetitions."""
        return self._trouble is CameraFrozen

    def arrived(self, image: Image, t: float) -> list[CameraEvent]:
        """Take a picture that arrived at `t` [s]."""
        step = self._parameters.stride
        checksum = zlib.crc32(image[::step, ::step].tobytes())
        self._t_arrival = t
        if checksum != self._checksum:
            self._checksum = checksum
            self._t_changed = t
            self._equal = 1
            return self._recover(t)
        self._equal += 1
        long_enough = t - self._t_changed >= self._parameters.frozen_timeout
        if long_enough and self._equal >= self._parameters.frozen_pictures and self._trouble is not CameraFrozen:
            self._trouble = CameraFrozen
            return [CameraFrozen(t=t, since=self._t_changed)]
        return []

    def look(self, t: float, reason: str) -> list[CameraEvent]:
        """Look at `t` [s] whether pictures still come; `reason` is what is known of the cause if not."""
        silence = t - self._t_arrival
        if silence < self._parameters.stall_timeout or self._trouble is CameraStalled:
            return []
        self._trouble = CameraStalled
        self._equal = 0
        self._checksum = None
        return [CameraStalled(t=t, silence=silence, reason=reason)]

    def _recover(self, t: float) -> list[CameraEvent]:
        if self._trouble is None:
            return []
        self._trouble = None
        return [CameraRecovered(t=t)]
