"""Radios that measure distances: anchors around a pad, one radio on the vehicle, and what goes over the wire.

What the vehicle's radio sends is the UDP packet "companion ranging" (docs/components/ranging.md), written here anew
from that page, so that a mistake on either side shows.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sitl_stub.truth import TargetTruth, Truth, Vector
from sitl_stub.world.camera import Dropout
from sitl_stub.world.documents import FRACTION, NOT_NEGATIVE, POSITIVE, Bounds, Interval, Section
from sitl_stub.world.targets import TargetConfig

TAG = 0xA11CE  # hardware id of the vehicle's radio
_UNKNOWN_QUALITY = 255
_EARLY = 1e-6  # [s] of rounding in a time that is due
_IDS = Bounds(low=0, high=2**64 - 1)
_NEAR = Bounds(low=-100.0, high=100.0)  # [m] of a pad's anchors


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorConfig:
    """One anchor."""

    id: int  # of its hardware
    position: Vector  # [m] in the pad's frame: along the landing heading, to the right, down


@dataclass(frozen=True, slots=True, kw_only=True)
class RangingConfig:
    """The `ranging:` mapping of a world file."""

    target: str  # the platform that the anchors belong to, and move with
    anchors: tuple[AnchorConfig, ...]
    rate: float  # [Hz] of single ranges; the anchors take turns
    std: float  # [m] of one range
    outlier_fraction: float  # too long by `outlier`: the direct way was blocked, an echo was taken
    outlier: Interval  # [m] least and most
    lost_fraction: float  # never measured
    latency: float  # [s] from the measurement to the arrival
    reach: float  # [m] of the radios
    silences: tuple[Dropout, ...]  # times without any range = ()

    @classmethod
    def read(cls, section: Section, targets: tuple[TargetConfig, ...]) -> RangingConfig:
        """Read the mapping; `targets` are the world's, one of which carries the anchors."""
        names = [target.name for target in targets]
        config = cls(
            target=section.choice("target", names, names[0] if names else None),
            anchors=_anchors(section),
            rate=section.number("rate_hz", 50.0, Bounds(above=0.0, high=250.0)),
            std=section.number("std_m", 0.05, NOT_NEGATIVE),  # what DWM1001s show in the open
            outlier_fraction=section.number("outlier_fraction", 0.05, FRACTION),
            outlier=section.interval("outlier_m", Interval(0.15, 1.0), POSITIVE),
            lost_fraction=section.number("lost_fraction", 0.02, FRACTION),
            latency=section.number("latency_s", 0.005, Bounds(low=0.0, high=1.0)),
            reach=section.number("reach_m", 60.0, POSITIVE),
            silences=_silences(section),
        )
        section.finish()
        return config


def _anchors(section: Section) -> tuple[AnchorConfig, ...]:
    anchors: list[AnchorConfig] = []
    for part in section.sections("anchors"):
        north, east, down = part.vector("position_m", 3, bounds=_NEAR)
        anchor = AnchorConfig(id=part.integer("id", bounds=_IDS), position=(north, east, down))
        if any(anchor.id == other.id for other in anchors):
            raise part.error("id", f"{anchor.id:#06x} is taken")
        part.finish()
        anchors.append(anchor)
    if not anchors:
        raise section.error("anchors", "at least one anchor is wanted: {id: 0x022E, position_m: [3.0, -3.0, -0.1]}")
    return tuple(anchors)


def _silences(section: Section) -> tuple[Dropout, ...]:
    silences = []
    for part in section.sections("silences"):
        begin, length = part.number("at_s", bounds=NOT_NEGATIVE), part.number("for_s", bounds=POSITIVE)
        silences.append(Dropout(begin=begin, length=length))
        part.finish()
    return tuple(silences)


class Ranging:
    """The radios of a running world.

    Args:
        config: of the world.
        rng: dice of its own.
    """

    def __init__(self, config: RangingConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._places = np.array([anchor.position for anchor in config.anchors])
        self._next = 0.0  # [s] when the next anchor is asked
        self._turn = 0
        self._sequence = 0
        self._on_the_way: deque[tuple[float, bytes]] = deque()

    def step(self, truth: Truth, antenna_frd: Vector) -> None:
        """Measure what is due at the truth's time.

        Args:
            truth: of vehicle and pads.
            antenna_frd: place of the vehicle's antenna [m], forward, right, down of the body origin.
        """
        if truth.t + _EARLY < self._next:
            return
        self._next = max(self._next + 1.0 / self._config.rate, truth.t)
        index, self._turn = self._turn, (self._turn + 1) % len(self._places)
        distance = self._measure(truth, index, np.array(antenna_frd))
        if distance is not None:
            packet = encode(sequence=self._sequence, anchor=self._config.anchors[index].id, distance=distance)
            self._on_the_way.append((truth.t + self._config.latency, packet))
            self._sequence = (self._sequence + 1) % 2**32

    def take(self, t: float) -> list[bytes]:
        """Take the packets that have arrived by `t` [s]."""
        arrived = []
        while self._on_the_way and self._on_the_way[0][0] <= t + _EARLY:
            arrived.append(self._on_the_way.popleft()[1])
        return arrived

    def _measure(self, truth: Truth, index: int, antenna: npt.NDArray[np.float64]) -> float | None:
        """Give the measured distance [m] to an anchor; None where there is none. Always takes the same dice."""
        config = self._config
        lost, noise, struck, excess = self._rng.random(), self._rng.standard_normal(), *self._rng.random(2)
        target = next(target for target in truth.targets if target.name == config.target)
        distance = float(np.linalg.norm(_antenna_place(truth, antenna) - _on_pad(target, self._places[index])))
        silent = any(s.begin <= truth.t < s.begin + s.length for s in config.silences)
        if silent or lost < config.lost_fraction or distance > config.reach:
            return None
        distance += config.std * noise
        if struck < config.outlier_fraction:
            distance += config.outlier.low + (config.outlier.high - config.outlier.low) * excess
        return max(distance, 1e-3)


def _antenna_place(truth: Truth, antenna: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    w, x, y, z = truth.vehicle.quaternion
    axis = np.array([x, y, z])
    across = 2.0 * np.cross(axis, antenna)
    place: npt.NDArray[np.float64] = (
        np.array(truth.vehicle.position_ned) + antenna + w * across + np.cross(axis, across)
    )
    return place


def _on_pad(target: TargetTruth, position: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    c, s = math.cos(target.yaw), math.sin(target.yaw)
    ahead, right, down = position.tolist()
    offset = np.array([c * ahead - s * right, s * ahead + c * right, down])
    place: npt.NDArray[np.float64] = np.array(target.position_ned) + offset
    return place


def encode(*, sequence: int, anchor: int, distance: float) -> bytes:
    """Write a packet with one range [m], measured just now."""
    head = b"CRNG" + struct.pack("<BBIQ", 1, 1, sequence, TAG)
    body = head + struct.pack("<QIIB", anchor, round(1000.0 * distance), 0, _UNKNOWN_QUALITY)
    return body + struct.pack("<I", zlib.crc32(body))
