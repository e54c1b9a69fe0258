"""The planner's handover as bytes: one frame, checked as a whole, and nothing in it is trusted.

Little-endian. `size` counts the whole frame; `crc` is CRC-32 of everything behind it.

    magic 4s | version u8 | size u32 | crc u32
    sequence u64 | t f64 | orders u8 (bits) | receiver u8 | stage u8 | kind u8 | target u8 (0, 1) | reason size u16
    | count u16
    reason: UTF-8
    news: said u32 | mode u8 | end u8 (0: not ended) | texts u8 | values u8 | landing target u8 (0, 1)
    news, texts: severity u8 | size u8 | ASCII; values: name 9s, f64
    news, landing target: t, position 3, yaw, position std, distance, angles 2, sizes 2, all f64
    target: t, position 3, velocity 3, all f64
    kind 1 and 2: t_start, t_expiry f64 | reset counter u8 | feedback: acceleration 3, velocity 3, yaw, all f64
    kind 1, polynomial: durations (count), position (count, 8, 3), yaw (count, 4), all f64
    kind 2, samples: (count, 12) f64, see `SampledTrajectory`
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

import numpy as np

from companion.control.corrected import CorrectedTrajectory
from companion.geometry.arrays import Array
from companion.guardian.handover import RECEIVERS, Handover, Order, Stage
from companion.guardian.sampled import COLUMNS, SampledTrajectory
from companion.messages.decision import Mode
from companion.messages.motion import Trajectory
from companion.messages.news import TEXTS_MAX, VALUES_MAX, End, MissionNews
from companion.messages.pilot import LandingTarget, PilotText, Severity
from companion.messages.target import TargetPose
from companion.planning.polynomial import PolynomialTrajectory

MAX_FRAME = 16384  # [bytes]
MAX_PIECES, MAX_SAMPLES = 32, 101
SAMPLE_S = 0.02  # [s] between the samples of a trajectory that has no pieces
_REASON_MAX = 1000  # [bytes]
_TEXT_SIZE = 200  # [bytes]; the link cuts shorter
_NAME_SIZE = 9  # [bytes]
_LARGEST = 1e7  # in any unit

_MAGIC, _VERSION = b"CPHO", 2
_HEAD = struct.Struct("<4sBII")
_BODY = struct.Struct("<QdBBBBBHH")
_TARGET = struct.Struct("<7d")
_MOTION = struct.Struct("<ddB7d")
_NEWS = struct.Struct("<IBBBBB")
_TEXT = struct.Struct("<BB")
_VALUE = struct.Struct("<9sd")
_LANDING_TARGET = struct.Struct("<11d")
_NONE, _POLYNOMIAL, _SAMPLES = 0, 1, 2
_ORDERS, _STAGES, _MODES, _ENDS = tuple(Order), tuple(Stage), tuple(Mode), (None, *End)


class FrameError(ValueError):
    """Bytes that are no sound handover."""


def encode(handover: Handover, sequence: int) -> bytes:
    """Give the frame of a handover.

    Raises:
        ValueError: the receiver is none of `RECEIVERS`, there is too much news, or the trajectory cannot be evaluated.
    """
    kind, count, motion = _encode_trajectory(handover.trajectory, handover.t)
    reason = handover.reason.encode()[:_REASON_MAX].decode(errors="ignore").encode()
    orders = sum(1 << _ORDERS.index(order) for order in handover.orders)
    target = b""
    if handover.target is not None:
        pose = handover.target
        target = _TARGET.pack(pose.t, *pose.position_ned.tolist(), *pose.velocity_ned.tolist())
    fixed = _BODY.pack(
        sequence,
        handover.t,
        orders,
        RECEIVERS.index(handover.receiver),
        _STAGES.index(handover.stage),
        kind,
        bool(target),
        len(reason),
        count,
    )
    rest = b"".join((fixed, reason, _encode_news(handover.news), target, motion))
    return _HEAD.pack(_MAGIC, _VERSION, _HEAD.size + len(rest), zlib.crc32(rest)) + rest


def _encode_news(news: MissionNews) -> bytes:
    if len(news.texts) > TEXTS_MAX or len(news.values) > VALUES_MAX:
        raise ValueError(f"{len(news.texts)} texts and {len(news.values)} values: at most {TEXTS_MAX}, {VALUES_MAX}")
    there = news.landing_target is not None
    parts = [
        _NEWS.pack(
            news.said & 0xFFFFFFFF,
            _MODES.index(news.mode),
            _ENDS.index(news.end),
            len(news.texts),
            len(news.values),
            there,
        )
    ]
    for text in news.texts:
        words = text.text.encode("ascii", errors="replace")[:_TEXT_SIZE]
        parts += [_TEXT.pack(text.severity, len(words)), words]
    parts += [_VALUE.pack(name.encode("ascii", errors="replace"), value) for name, value in news.values.items()]
    if news.landing_target is not None:
        parts.append(_encode_landing_target(news.landing_target))
    return b"".join(parts)


def _encode_landing_target(target: LandingTarget) -> bytes:
    return _LANDING_TARGET.pack(
        target.t,
        *target.position_ned.tolist(),
        target.yaw,
        target.position_std,
        target.distance,
        target.angle_right,
        target.angle_down,
        target.size_right,
        target.size_down,
    )


def _encode_trajectory(trajectory: Trajectory | None, t: float) -> tuple[int, int, bytes]:
    if trajectory is None:
        return _NONE, 0, b""
    now = trajectory.at(t)
    head = _MOTION.pack(
        trajectory.t_start,
        trajectory.t_expiry,
        trajectory.reset_counter,
        *now.feedback_acceleration_ned.tolist(),
        *now.feedback_velocity_ned.tolist(),
        now.feedback_yaw,
    )
    base = trajectory.base if isinstance(trajectory, CorrectedTrajectory) else trajectory
    if isinstance(base, PolynomialTrajectory) and len(base.durations) <= MAX_PIECES:
        numbers = (np.asarray(base.durations), base.position, base.yaw)
        return _POLYNOMIAL, len(base.durations), head + b"".join(_doubles(array) for array in numbers)
    count = max(2, min(MAX_SAMPLES, int((trajectory.t_expiry - t) / SAMPLE_S) + 2))
    samples = np.array([_sample(trajectory, t + k * SAMPLE_S) for k in range(count)])
    return _SAMPLES, count, head + _doubles(samples)


def _doubles(array: Array) -> bytes:
    return np.ascontiguousarray(array, dtype="<f8").tobytes()


def _sample(trajectory: Trajectory, t: float) -> list[float]:
    state = trajectory.at(t)
    vectors = (state.position_ned, state.velocity_ned, state.acceleration_ned)
    return [t, *(number for vector in vectors for number in vector.tolist()), state.yaw, state.yaw_rate]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameHead:
    """What of a sound frame is known before its trajectory is read."""

    sequence: int
    orders: frozenset[Order]


def check(frame: bytes) -> FrameHead:
    """Check a frame as a whole.

    Raises:
        FrameError: it is not sound.
    """
    if not _HEAD.size + _BODY.size <= len(frame) <= MAX_FRAME:
        raise FrameError(f"{len(frame)} bytes are no frame")
    magic, version, size, crc = _HEAD.unpack_from(frame)
    if (magic, version, size) != (_MAGIC, _VERSION, len(frame)) or crc != zlib.crc32(frame[_HEAD.size :]):
        raise FrameError("magic, version, size or checksum is wrong")
    sequence, _, orders, receiver, stage, kind, target, _, _ = _BODY.unpack_from(frame, _HEAD.size)
    if (
        orders >> len(_ORDERS)
        or receiver >= len(RECEIVERS)
        or stage >= len(_STAGES)
        or kind not in (_NONE, _POLYNOMIAL, _SAMPLES)
        or target > 1
    ):
        raise FrameError("a number in the frame means nothing")
    return FrameHead(sequence=sequence, orders=frozenset(order for k, order in enumerate(_ORDERS) if orders & 1 << k))


def decode(frame: bytes) -> Handover:
    """Read a frame.

    Raises:
        FrameError: it is not sound, or a number in it is not finite or absurd.
    """
    head = check(frame)
    _, t, _, receiver, stage, kind, has_target, reason_size, count = _BODY.unpack_from(frame, _HEAD.size)
    reader = _Reader(frame, _HEAD.size + _BODY.size)
    reason = reader.take(reason_size).decode(errors="replace")
    news = _news(reader)
    target = _target(reader.doubles(7)) if has_target else None
    trajectory = None if kind == _NONE else _trajectory(reader, kind, count)
    if reader.left or not abs(t) < _LARGEST:
        raise FrameError("the frame's parts do not fill it, or its time is absurd")
    return Handover(
        t=t,
        stage=_STAGES[stage],
        reason=reason,
        trajectory=trajectory,
        target=target,
        orders=head.orders,
        receiver=RECEIVERS[receiver],
        news=news,
    )


class _Reader:
    """Takes a frame apart from front to back."""

    def __init__(self, frame: bytes, place: int) -> None:
        self._frame, self._place = frame, place

    @property
    def left(self) -> int:
        return len(self._frame) - self._place

    def take(self, size: int) -> bytes:
        if size > self.left:
            raise FrameError("the frame ends too early")
        self._place += size
        return self._frame[self._place - size : self._place]

    def doubles(self, count: int) -> Array:
        numbers: Array = np.frombuffer(self.take(8 * count), dtype="<f8")
        if not bool((np.abs(numbers) < _LARGEST).all()):  # not so for what is not a number
            raise FrameError("a number is not finite, or absurd")
        return numbers


def _news(reader: _Reader) -> MissionNews:
    said, mode, end, texts, values, landing_target = _NEWS.unpack(reader.take(_NEWS.size))
    if (
        mode >= len(_MODES)
        or end >= len(_ENDS)
        or texts > TEXTS_MAX
        or values > VALUES_MAX
        or landing_target > 1
        or texts > said
    ):
        raise FrameError("a number in the news means nothing")
    return MissionNews(
        mode=_MODES[mode],
        end=_ENDS[end],
        said=said,
        texts=tuple(_text(reader) for _ in range(texts)),
        values=dict(_value(reader) for _ in range(values)),
        landing_target=_landing_target(reader.doubles(11)) if landing_target else None,
    )


def _text(reader: _Reader) -> PilotText:
    severity, size = _TEXT.unpack(reader.take(_TEXT.size))
    words = reader.take(size).decode("ascii", errors="replace")
    try:
        return PilotText(severity=Severity(severity), text=words)
    except ValueError as error:
        raise FrameError(str(error)) from None


def _value(reader: _Reader) -> tuple[str, float]:
    name = reader.take(_NAME_SIZE).rstrip(b"\0")
    if not name or not name.isascii() or not name.decode("ascii").isprintable():
        raise FrameError(f"{name!r} is no name of a number")
    return name.decode("ascii"), float(reader.doubles(1)[0])


def _landing_target(numbers: Array) -> LandingTarget:
    t, _, _, _, yaw, position_std, distance, angle_right, angle_down, size_right, size_down = numbers.tolist()
    return LandingTarget(
        t=t,
        position_ned=numbers[1:4],
        yaw=yaw,
        position_std=position_std,
        distance=distance,
        angle_right=angle_right,
        angle_down=angle_down,
        size_right=size_right,
        size_down=size_down,
    )


def _target(numbers: Array) -> TargetPose:
    return TargetPose(
        t=float(numbers[0]),
        position_ned=numbers[1:4],
        velocity_ned=numbers[4:7],
        acceleration_ned=np.zeros(3),
        yaw=0.0,
        yaw_rate=0.0,
        covariance=np.zeros((4, 4)),
    )


def _trajectory(reader: _Reader, kind: int, count: int) -> Trajectory:
    if not 1 <= count <= (MAX_PIECES if kind == _POLYNOMIAL else MAX_SAMPLES):
        raise FrameError(f"{count} pieces or samples")
    t_start, t_expiry = reader.doubles(2).tolist()
    reset_counter = reader.take(1)[0]
    feedback = reader.doubles(7)
    base: Trajectory
    try:
        if kind == _POLYNOMIAL:
            base = PolynomialTrajectory(
                t_start=t_start,
                durations=tuple(reader.doubles(count).tolist()),
                position=reader.doubles(24 * count).reshape(count, 8, 3),
                yaw=reader.doubles(4 * count).reshape(count, 4),
                t_expiry=t_expiry,
                reset_counter=reset_counter,
            )
        else:
            samples = reader.doubles(COLUMNS * count).reshape(count, COLUMNS)
            base = SampledTrajectory(samples=samples, t_expiry=t_expiry, reset_counter=reset_counter)
    except FrameError:
        raise
    except ValueError as error:
        raise FrameError(str(error)) from None
    return CorrectedTrajectory(
        base=base, acceleration_ned=feedback[:3], velocity_ned=feedback[3:6], yaw=float(feedback[6])
    )
