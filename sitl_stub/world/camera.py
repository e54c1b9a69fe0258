"""The camera as a device: its data, when it takes pictures, when they arrive, and which of them are lost."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from sitl_stub.truth import Truth
from sitl_stub.world.documents import FRACTION, NOT_NEGATIVE, POSITIVE, Bounds, Section
from sitl_stub.world.exposure import Exposure, Mount, Scene
from sitl_stub.world.lens import Intrinsics
from sitl_stub.world.pads import Pad
from sitl_stub.world.sight import Blindness, Misplacement, cover

Image = npt.NDArray[np.uint8]
TagCorners = tuple[int, npt.NDArray[np.float64]]

_PIXELS = Bounds(low=16, high=4096)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraConfig:
    """The camera's data: the `camera:` mapping of a vehicle file."""

    intrinsics: Intrinsics
    mount: Mount
    rate: float = 30.0  # [Hz]
    exposure: float = 0.004  # [s]
    latency: float = 0.040  # [s] from the middle of the exposure to delivery, at least
    latency_jitter: float = 0.001  # [s] standard deviation of what comes on top (half normal)
    lens_blur: float = 0.5  # [px] standard deviation of the lens's point spread
    vignetting: float = 0.25  # share of light lost in the picture's corners
    read_noise: float = 1.2  # [grey levels] standard deviation
    full_well: float = 10_000.0  # [electrons] at grey level 255: sets the shot noise

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any], where: str = "camera") -> CameraConfig:
        """Check and take over the `camera:` mapping of a vehicle file; raises `WorldFileError`.

        `where` names the file in complaints. Keys: width, height [px], fx, fy, cx, cy [px], distortion
        [k1, k2, p1, p2, k3], mount_position_frd_m, mount_turned_deg [roll, pitch, yaw] (from straight down with the
        picture's top towards the nose), rate_hz, exposure_s, latency_s, latency_jitter_s, lens_blur_px,
        vignetting, read_noise, full_well.
        """
        section = Section(values, where=where)
        d1, d2, d3, d4, d5 = section.vector("distortion", 5, (0.0,) * 5, Bounds(low=-10.0, high=10.0))
        turned = section.vector("mount_turned_deg", 3, (0.0, 0.0, 0.0), Bounds(low=-180.0, high=180.0))
        config = cls(
            intrinsics=Intrinsics(
                width=section.integer("width", 640, _PIXELS),
                height=section.integer("height", 480, _PIXELS),
                fx=section.number("fx", bounds=POSITIVE),
                fy=section.number("fy", bounds=POSITIVE),
                cx=section.number("cx"),
                cy=section.number("cy"),
                distortion=(d1, d2, d3, d4, d5),
            ),
            mount=Mount.looking_down(
                section.vector("mount_position_frd_m", 3, bounds=Bounds(low=-10.0, high=10.0)),
                [math.radians(angle) for angle in turned],
            ),
            rate=section.number("rate_hz", 30.0, Bounds(above=0.0, high=1000.0)),
            exposure=section.number("exposure_s", 0.004, Bounds(above=0.0, high=0.1)),
            latency=section.number("latency_s", 0.040, Bounds(low=0.0, high=2.0)),
            latency_jitter=section.number("latency_jitter_s", 0.001, Bounds(low=0.0, high=0.1)),
            lens_blur=section.number("lens_blur_px", 0.5, Bounds(low=0.0, high=5.0)),
            vignetting=section.number("vignetting", 0.25, FRACTION),
            read_noise=section.number("read_noise", 1.2, NOT_NEGATIVE),
            full_well=section.number("full_well", 10_000.0, POSITIVE),
        )
        section.finish()
        if config.exposure * config.rate > 0.9:
            raise section.error("exposure_s", f"{config.exposure:g} does not fit between frames at {config.rate:g} Hz")
        return config


@dataclass(frozen=True, slots=True, kw_only=True)
class Dropout:
    """A time without frames."""

    begin: float  # [s]
    length: float  # [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFaults:
    """What goes wrong now and then: the `camera:` mapping of a world file."""

    lost: float = 0.005  # share of frames that never arrive
    bad: float = 0.002  # share of frames that arrive spoilt
    dropouts: tuple[Dropout, ...] = ()
    dropout_period: float = math.inf  # [s] the schedule repeats with this period
    blindness: Blindness = field(default_factory=Blindness)
    corrupted: float = 0.0  # share of frames in which the targets stand at a random range and bearing
    interval: float = 0.0  # [s] between two frames at least: those between are not taken

    @classmethod
    def read(cls, section: Section) -> CameraFaults:
        """Read the `camera:` mapping of a world file."""
        dropouts = []
        for part in section.sections("dropouts"):
            dropouts.append(
                Dropout(begin=part.number("at_s", bounds=NOT_NEGATIVE), length=part.number("for_s", bounds=POSITIVE))
            )
            part.finish()
        repeats = section.has("dropout_period_s")
        faults = cls(
            lost=section.number("lost_fraction", 0.005, FRACTION),
            bad=section.number("bad_fraction", 0.002, FRACTION),
            dropouts=tuple(dropouts),
            dropout_period=section.number("dropout_period_s", bounds=POSITIVE) if repeats else math.inf,
            blindness=Blindness.read(section.section("blind")),
            corrupted=section.number("corrupted_fraction", 0.0, FRACTION),
            interval=section.number("interval_s", 0.0, NOT_NEGATIVE),
        )
        section.finish()
        return faults

    def drops(self, t: float) -> bool:
        """Whether the schedule swallows a frame captured at `t` [s]."""
        if self.blindness.at(t) == "no_frames":
            return True
        if not self.dropouts:
            return False
        phase = t % self.dropout_period if math.isfinite(self.dropout_period) else t
        return any(part.begin <= phase < part.begin + part.length for part in self.dropouts)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """One picture, or what a detector would have found in it."""

    t_capture: float  # [s] simulation time, middle of the exposure
    t_delivery: float  # [s] simulation time at which it can be had
    sequence: int  # counts exposures: a lost frame leaves a gap
    image: Image | None  # (height, width) grey, or None
    tags: tuple[TagCorners, ...] | None  # (id, corners (4, 2) [px], in the order of the printed tag), or None
    sigmas: tuple[float, ...] | None = None  # [px] deviation of each tag's corner coordinates, as a detector states it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Content:
    """What one exposure yields; fields as in `Frame`."""

    image: Image | None = None
    tags: tuple[TagCorners, ...] | None = None
    sigmas: tuple[float, ...] | None = None


class Imager(Protocol):
    """Makes the content of a frame."""

    def capture(self, exposure: Exposure, *, bad: bool) -> Content:
        """Give the content; `bad` asks for a spoilt one."""


class CameraSensor:
    """Takes pictures at its rate, from a phase drawn once, and delivers them after the latency."""

    def __init__(
        self,
        config: CameraConfig,
        faults: CameraFaults,
        imager: Imager,
        pads: Sequence[Pad],
        rng: np.random.Generator,
    ) -> None:
        self._config = config
        self._faults = faults
        self._imager = imager
        self._pads = tuple(pads)
        self._rng = rng
        (self._corrupting,) = rng.spawn(1)
        self._first = 0.5 * config.exposure + float(rng.random()) / config.rate  # [s] middle of the first exposure
        self._sequence = 0
        self._t_taken = -math.inf  # [s] middle of the last exposure that was not left out
        self._states: list[Truth] = []  # from just before the shutter opened
        self._queue: deque[Frame] = deque()
        self._plan()

    def _plan(self) -> None:
        middle = self._first + self._sequence / self._config.rate
        self._t_open = middle - 0.5 * self._config.exposure
        self._t_close = middle + 0.5 * self._config.exposure

    def step(self, t: float, truth: Truth) -> None:
        """Take note of the true state at `t` [s]; called at every step of the physics, in order."""
        if t < self._t_open:
            if self._states:
                self._states[0] = truth
            else:
                self._states.append(truth)
            return
        self._states.append(truth)
        while t >= self._t_close:
            self._shoot()
        if t < self._t_open:
            self._states = [truth]

    def _shoot(self) -> None:
        t_middle = 0.5 * (self._t_open + self._t_close)
        if t_middle - self._t_taken < self._faults.interval - 0.5 / self._config.rate:
            self._plan_next()
            return
        self._t_taken = t_middle
        exposure = Exposure(
            self._states,
            self._t_open,
            self._t_close,
            mount=self._config.mount,
            pads=self._pads,
            shown=self._seen_instead(t_middle),
        )
        lost, bad = self._rng.random(2)
        jitter = abs(float(self._rng.standard_normal())) * self._config.latency_jitter
        t_capture = exposure.t_middle
        if lost >= self._faults.lost and not self._faults.drops(t_capture):
            content = self._imager.capture(exposure, bad=bool(bad < self._faults.bad))
            self._queue.append(
                Frame(
                    t_capture=t_capture,
                    t_delivery=t_capture + self._config.latency + jitter,
                    sequence=self._sequence,
                    image=content.image,
                    tags=content.tags,
                    sigmas=content.sigmas,
                )
            )
        self._plan_next()

    def _plan_next(self) -> None:
        self._sequence += 1
        self._plan()

    def _seen_instead(self, t: float) -> Callable[[Scene], Scene] | None:
        """Give what the world file wants seen at `t` [s] in the place of the truth."""
        faults = self._faults
        if faults.blindness.at(t) is not None:
            return cover
        if faults.corrupted > 0.0 and self._corrupting.random() < faults.corrupted:
            return Misplacement(self._pads, self._corrupting)
        return None

    def skip(self, t: float) -> None:
        """Leave out the exposures that would end by `t` [s]; their numbers are missing from the sequence."""
        while self._t_close <= t:
            self._plan_next()
        self._states.clear()

    def frames(self, t: float) -> list[Frame]:
        """Give the frames whose delivery time has come by `t` [s], oldest first, each once."""
        ready = []
        while self._queue and self._queue[0].t_delivery <= t:
            ready.append(self._queue.popleft())
        return ready
