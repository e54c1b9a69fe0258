"""The handover frame: what goes in comes out; what is damaged, or absurd, never comes out."""

import struct
import zlib

import numpy as np
import pytest
from guardian_bench import LIMITS, Path, motion
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.control.corrected import CorrectedTrajectory
from companion.guardian.handover import RECEIVERS, Handover, Order, Stage
from companion.guardian.handover_frame import MAX_FRAME, FrameError, check, decode, encode
from companion.guardian.sampled import SampledTrajectory
from companion.messages.decision import Mode
from companion.messages.news import TEXTS_MAX, VALUES_MAX, End, MissionNews
from companion.messages.pilot import LandingTarget, PilotText, Severity
from companion.messages.target import TargetPose
from companion.planning.minimum_snap import PlanParameters, PlanRequest, plan_to_moving_goal

HEAD, BODY, NEWS = struct.calcsize("<4sBII"), struct.calcsize("<QdBBBBBHH"), struct.calcsize("<IBBBBB")
START = HEAD + BODY + NEWS  # of the trajectory, without a reason, news and a target


def target(t=10.0):
    return TargetPose(
        t=t,
        position_ned=np.array([1.0, 2.0, 0.5]),
        velocity_ned=np.array([0.3, -0.2, 0.0]),
        acceleration_ned=np.zeros(3),
        yaw=0.3,
        yaw_rate=0.0,
        covariance=np.eye(4),
    )


def plan(t=10.0):
    request = PlanRequest(
        start=motion((0, 0, -3), velocity=(1, 0, 0)),
        t_start=t,
        goal=lambda when: motion((4 + 0.5 * (when - t), 1, -2), velocity=(0.5, 0, 0), yaw=0.4),
        t_goal_hint=t + 4.0,
        limits=LIMITS,
        closing_speed=2.0,
        t_expiry=t + 0.5,
        reset_counter=255,
        parameters=PlanParameters(),
    )
    return CorrectedTrajectory(
        base=plan_to_moving_goal(request).trajectory,
        acceleration_ned=np.array([0.1, -0.2, 0.3]),
        velocity_ned=np.array([0.01, 0.02, -0.03]),
        yaw=0.05,
    )


def wave(t=10.0):
    def at(when):
        s = when - t
        return motion(
            (np.sin(s), np.cos(s), -3 + 0.3 * s),
            velocity=(np.cos(s), -np.sin(s), 0.3),
            acceleration=(-np.sin(s), -np.cos(s), 0.0),
            yaw=3.0 + 0.5 * s,
            yaw_rate=0.5,
        )

    return Path(at, t_start=t, t_end=t + 1.0, t_expiry=t + 0.5, reset_counter=3)


def handover(**changes):
    values = {"t": 10.0, "stage": Stage.RUNNING, "reason": "landing: höher", "trajectory": plan(), "target": target()}
    return Handover(**(values | changes))


def resealed(frame):
    """The same frame with the checksum made right."""
    frame = bytes(frame)
    return frame[: HEAD - 4] + struct.pack("<I", zlib.crc32(frame[HEAD:])) + frame[HEAD:]


@pytest.mark.parametrize("stage", Stage)
@pytest.mark.parametrize("receiver", RECEIVERS)
def test_the_plain_parts_come_back(stage, receiver):
    for orders in (frozenset(), frozenset({Order.ARM}), frozenset(Order)):
        given_ = handover(stage=stage, receiver=receiver, orders=orders, trajectory=None, target=None)
        found = decode(encode(given_, 7))
        assert (found.t, found.stage, found.reason, found.orders, found.receiver) == (
            10.0,
            stage,
            given_.reason,
            orders,
            receiver,
        )
        assert found.trajectory is None
        assert found.target is None
        assert check(encode(given_, 7)).sequence == 7


@pytest.mark.parametrize(("make", "tolerance"), [(plan, 1e-12), (wave, 2e-5)])
def test_a_trajectory_comes_back_as_the_same_motion(make, tolerance):
    before = make()
    after = decode(encode(handover(trajectory=before), 1)).trajectory
    assert (after.t_expiry, after.reset_counter) == (before.t_expiry, before.reset_counter)
    for t in np.linspace(10.0, 10.5, 41):
        a, b = before.at(t), after.at(t)
        for name in ("position_ned", "velocity_ned", "feedback_velocity_ned", "feedback_acceleration_ned"):
            assert getattr(b, name) == pytest.approx(getattr(a, name), abs=tolerance)
        assert b.acceleration_ned == pytest.approx(
            a.acceleration_ned, abs=max(tolerance, 1e-3) if make is wave else 1e-12
        )
        assert (b.yaw, b.yaw_rate, b.feedback_yaw) == pytest.approx((a.yaw, a.yaw_rate, a.feedback_yaw), abs=1e-9)


def test_the_target_comes_back():
    found = decode(encode(handover(), 1)).target
    assert found.t == 10.0
    assert found.position_ned == pytest.approx([1.0, 2.0, 0.5])
    assert found.velocity_ned == pytest.approx([0.3, -0.2, 0.0])


def news(**changes):
    values = {
        "mode": Mode.AUTOPILOT_LAND,
        "end": None,
        "said": 9,
        "texts": (PilotText(severity=Severity.CRITICAL, text="one"), PilotText(severity=Severity.INFO, text="")),
        "values": {"pad_dist": 1.5, "pad_hgt": -2.25},
        "landing_target": landing_target(),
    }
    return MissionNews(**(values | changes))


def landing_target():
    return LandingTarget(
        t=9.9,
        position_ned=np.array([1.0, -2.0, 0.25]),
        yaw=0.1,
        position_std=0.02,
        distance=3.0,
        angle_right=0.03,
        angle_down=-0.04,
        size_right=0.2,
        size_down=0.3,
    )


@pytest.mark.parametrize("end", [None, *End])
@pytest.mark.parametrize("mode", Mode)
def test_the_news_come_back(mode, end):
    given_ = news(mode=mode, end=end)
    frame = encode(handover(news=given_), 3)
    found = decode(frame)
    after = found.news
    assert (after.mode, after.end, after.said, after.texts) == (mode, end, 9, given_.texts)
    assert after.values == given_.values
    for name in LandingTarget.__slots__:
        assert getattr(after.landing_target, name) == pytest.approx(getattr(landing_target(), name))
    assert found.target is not None  # what comes behind is found
    assert found.trajectory.t_expiry == pytest.approx(10.5)
    assert decode(encode(handover(), 3)).news.landing_target is None


def test_long_texts_are_cut_and_others_than_ascii_replaced():
    texts = (PilotText(severity=Severity.INFO, text="höher " * 100),)
    (found,) = decode(encode(handover(news=news(texts=texts)), 1)).news.texts
    assert found.text.startswith("h?her h?her")
    assert len(found.text) < 256


def test_too_much_news_is_a_mistake():
    text = PilotText(severity=Severity.INFO, text="x")
    for much in (news(texts=(text,) * (TEXTS_MAX + 1)), news(values={f"v{k}": 0.0 for k in range(VALUES_MAX + 1)})):
        with pytest.raises(ValueError, match="at most"):
            encode(handover(news=much), 1)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (4, 200),  # a mode that there is not
        (5, 7),  # an end
        (6, 255),  # texts
        (7, 255),  # numbers
        (8, 2),  # landing targets
        (9, 0),  # EMERGENCY, which the planner has no right to
    ],
)
def test_news_that_mean_nothing_are_refused(place, value):
    frame = bytearray(encode(handover(reason="", news=news()), 1))
    frame[HEAD + BODY + place] = value
    with pytest.raises(FrameError):
        decode(resealed(frame))


def test_a_number_without_a_name_is_refused():
    for name in ("", "\n"):
        with pytest.raises(FrameError, match="name"):
            decode(encode(handover(news=news(values={name: 1.0})), 1))


def test_a_long_reason_is_cut_between_characters():
    found = decode(encode(handover(reason="ä" * 900), 1))
    assert found.reason == "ä" * 500


def test_frames_stay_within_the_bound():
    far = Path(wave().at, t_start=10.0, t_end=20.0, t_expiry=1e6)
    assert len(encode(handover(trajectory=far, reason="x" * 5000), 1)) <= MAX_FRAME


def test_one_wrong_bit_anywhere_is_noticed():
    frame = encode(handover(), 5)
    for place in range(0, len(frame), 7):
        damaged = bytearray(frame)
        damaged[place] ^= 1 << place % 8
        with pytest.raises(FrameError):
            check(bytes(damaged))


def test_a_cut_or_lengthened_frame_is_noticed():
    frame = encode(handover(), 5)
    for wrong in (b"", frame[:10], frame[:-1], frame + b"\0", b"\0" * (MAX_FRAME + 1)):
        with pytest.raises(FrameError):
            check(wrong)


@pytest.mark.parametrize(
    ("place", "value"),
    [(16, 0xFF), (17, 9), (18, 9), (19, 7), (20, 2), (21, 255)],
    ids=["orders", "receiver", "stage", "kind", "target", "reason"],
)
def test_numbers_that_mean_nothing_are_refused(place, value):
    frame = bytearray(encode(handover(reason="", trajectory=None, target=None), 1))
    frame[HEAD + place] = value
    with pytest.raises(FrameError):
        decode(resealed(frame))


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -1e9])
@pytest.mark.parametrize("make", [plan, wave])
def test_no_number_that_is_not_finite_gets_through(make, bad):
    frame = encode(handover(trajectory=make(), reason=""), 1)
    for place in [HEAD + 8, *range(HEAD + BODY, len(frame) - 7, 97)]:
        damaged = bytearray(frame)
        damaged[place : place + 8] = struct.pack("<d", bad)
        try:
            found = decode(resealed(damaged))
        except FrameError:
            continue
        state = found.trajectory.at(10.2)  # it hit the middle of two numbers: what comes out is finite all the same
        assert np.isfinite(state.position_ned).all()


@pytest.mark.parametrize("count", [0, 33, 102, 65535])
def test_a_wrong_count_is_refused(count):
    for make in (plan, wave):
        frame = bytearray(encode(handover(trajectory=make()), 1))
        frame[HEAD + 23 : HEAD + 25] = struct.pack("<H", count)
        with pytest.raises(FrameError):
            decode(resealed(frame))


def test_pieces_without_duration_and_samples_that_go_back_are_refused():
    frame = bytearray(encode(handover(reason="", target=None), 1))
    frame[START + 73 : START + 81] = struct.pack("<d", 0.0)  # the first duration
    with pytest.raises(FrameError, match="positive"):
        decode(resealed(frame))
    frame = bytearray(encode(handover(reason="", target=None, trajectory=wave()), 1))
    frame[START + 73 : START + 81] = struct.pack("<d", 99.0)  # the first sample's time
    with pytest.raises(FrameError, match="increase"):
        decode(resealed(frame))


@given(st.binary(max_size=600))
@settings(max_examples=300, deadline=None)
def test_garbage_is_never_anything_but_refused(data):
    with pytest.raises(FrameError):
        decode(data)
    if len(data) >= BODY:  # the same with a right head
        sealed = struct.pack("<4sBII", b"CPHO", 2, HEAD + len(data), zlib.crc32(data)) + data
        try:
            found = decode(sealed)
        except FrameError:
            return
        assert isinstance(found, Handover)


def test_samples_go_on_at_their_end_velocity():
    rows = [[t, t, 0, -3, 1, 0, 0, 0, 0, 0, 0.1 * t, 0.1] for t in (0.0, 0.02, 0.04)]
    trajectory = SampledTrajectory(samples=np.array(rows, float), t_expiry=1.0, reset_counter=0)
    assert (trajectory.t_start, trajectory.t_end) == (0.0, 0.04)
    for t in (-0.5, 0.0, 0.013, 0.04, 0.5):
        state = trajectory.at(t)
        assert state.position_ned == pytest.approx([t, 0, -3])
        assert state.velocity_ned == pytest.approx([1, 0, 0])
        assert state.yaw == pytest.approx(0.1 * t)


def test_samples_turn_the_short_way():
    rows = [[0.0, *[0] * 9, 3.1, 0.0], [0.1, *[0] * 9, -3.1, 0.0]]
    trajectory = SampledTrajectory(samples=np.array(rows, float), t_expiry=1.0, reset_counter=0)
    assert abs(trajectory.at(0.05).yaw) == pytest.approx(np.pi, abs=0.01)


@pytest.mark.parametrize("rows", [np.zeros((0, 12)), np.zeros((2, 12))])
def test_samples_must_have_times_that_increase(rows):
    with pytest.raises(ValueError, match="increase"):
        SampledTrajectory(samples=rows, t_expiry=1.0, reset_counter=0)
