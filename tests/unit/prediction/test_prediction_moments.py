"""The products that are kept up to date pose by pose, against the same from scratch."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.estimation.ownship import OwnshipReset
from companion.prediction.moments import JITTER, SegmentMoments
from companion.prediction.motion_choice import MotionChoice
from companion.prediction.parameters import EvidenceParameters

DEVIATION, TIME = (0.04, 0.15, 0.4), (0.7, 0.7, 1.5)


def from_scratch(
    times: np.ndarray, values: np.ndarray, sigma: float, tau: float, smooth: bool
) -> tuple[np.ndarray, float]:
    """Give the whitened products of a segment by the Cholesky factor of its noise, and the log of the whitening."""
    since = times - times[-1]
    rows = np.column_stack([np.vander(since, 4, increasing=True), values - values[-1]])
    lag = np.abs(times[:, None] - times) / tau
    shape = np.exp(-lag) * ((1.0 + lag) if smooth else 1.0)
    lower = np.linalg.cholesky(sigma**2 * (shape + JITTER * np.eye(len(times))))
    white = np.linalg.solve(lower, rows)
    log = -np.log(np.diagonal(lower)).sum() - 0.5 * len(times) * np.log(2.0 * np.pi)
    return white.T @ white, float(log)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    gaps=st.lists(st.one_of(st.floats(0.2, 0.4), st.floats(0.4, 15.0)), min_size=4, max_size=40),
    smooth=st.booleans(),
    seed=st.integers(0, 1000),
    start=st.floats(0.0, 1e5),
    again=st.booleans(),
)
def test_sums_are_those_of_a_fit_from_scratch(
    gaps: list[float], smooth: bool, seed: int, start: float, again: bool
) -> None:
    """Whatever the gaps, with more poses than beginnings are kept, far from the origin, and after a reset."""
    capacity, rng = 20, np.random.default_rng(seed)
    times = start + np.cumsum(gaps)
    values = 100.0 + np.cumsum(0.3 * rng.standard_normal((len(times), 2)), axis=0)
    moments = SegmentMoments(deviation=DEVIATION, time=TIME, smooth=smooth, values=2, capacity=capacity)
    if again:
        for k in range(7):
            moments.add(k + 0.5, np.array([3.0, k]))
        moments.reset()
    for t, value in zip(times, values, strict=True):
        moments.add(float(t), value)
    lengths = sorted({3, len(times) // 2 + 1, len(times)} & set(range(1, capacity + 1)))
    products, logs = moments.segments(lengths)
    for w, length in enumerate(lengths):
        for noise in range(3):
            want, log = from_scratch(times[-length:], values[-length:], DEVIATION[noise], TIME[noise], smooth)
            size = np.sqrt(np.outer(np.diagonal(want), np.diagonal(want)))
            size[size == 0.0] = 1.0
            np.testing.assert_allclose(products[w, noise] / size, want / size, atol=1e-7)
            np.testing.assert_allclose(logs[w, noise], log, rtol=1e-9, atol=1e-9)


def test_values_in_another_frame_give_the_sums_of_that_frame() -> None:
    rng, matrix, shift = np.random.default_rng(4), np.array([[0.6, -0.8], [0.8, 0.6]]), np.array([40.0, -7.0])
    moved, plain = (
        SegmentMoments(deviation=DEVIATION, time=TIME, smooth=True, values=2, capacity=12) for _ in range(2)
    )
    for k in range(16):
        value = rng.standard_normal(2)
        if k == 9:
            moved.transform(matrix, shift)
        moved.add(0.25 * k, matrix @ value + shift if k >= 9 else value)
        plain.add(0.25 * k, matrix @ value + shift)
    for found, want in zip(moved.segments([4, 12]), plain.segments([4, 12]), strict=True):
        np.testing.assert_allclose(found, want, rtol=1e-7, atol=1e-7)


def test_motion_does_not_depend_on_how_its_parts_are_spread() -> None:
    """Calls often enough for one part each, and so rarely that all are left for the next pose."""
    rng, often, seldom = (
        np.random.default_rng(5),
        MotionChoice(EvidenceParameters()),
        MotionChoice(EvidenceParameters()),
    )
    for k in range(30):
        t, pose = 0.25 * k, np.array([0.4 * k, 0.02 * k * k, 0.0, 0.1 * k]) + 0.02 * rng.standard_normal(4)
        often.add(t, pose)
        seldom.add(t, pose)
        for call in range(1, 12):
            often.advance(t + 0.02 * call)
        if k == 20:
            for choice in (often, seldom):
                choice.rebase(OwnshipReset(t=t, translation_ned=np.array([5.0, -9.0, 1.0]), yaw=0.3, counter=1))
    seldom.advance(0.25 * 29 + 0.2)
    assert often.motion is not None
    assert seldom.motion is not None
    np.testing.assert_array_equal(often.motion.coefficients, seldom.motion.coefficients)
    np.testing.assert_array_equal(often.motion.rate_variance, seldom.motion.rate_variance)
    assert often.motion.t == seldom.motion.t == 0.25 * 29


def test_no_call_does_more_than_one_part_at_the_usual_rate() -> None:
    choice, rng = MotionChoice(EvidenceParameters()), np.random.default_rng(6)
    known = []
    for k in range(8 * 13):
        t = 0.02 * k
        if k % 13 == 0:
            choice.add(t, rng.standard_normal(4))
        else:
            before = choice._parts
            choice.advance(t)
            assert choice._parts - before <= 1
        known.append(choice.motion.t if choice.motion is not None else -1.0)
    delays = [0.02 * k - t for k, t in enumerate(known) if t > 0.0]
    assert min(delays) < 0.13
    assert max(delays) < 0.26 + 0.13
