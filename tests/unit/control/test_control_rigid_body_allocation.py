"""The nozzle allocation against scipy's linear programs, and the pulses made of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from companion.control.rigid_body.allocation import NozzleAllocator
from companion.control.rigid_body.nozzles import effectiveness
from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.control.rigid_body.pulses import PulseMaker

P = RigidBodyParameters()
EFFECT = effectiveness(P.nozzle_places, P.nozzle_directions, P.thrust)
BANDS = {"position_band": P.position_band, "attitude_band": P.attitude_band}


@pytest.fixture(scope="module")
def allocator():
    return NozzleAllocator(EFFECT, P.period)


def optimum(wrench):
    """Least total on-time [s], or None where the wrench cannot be given; the truth to compare with."""
    scale = np.repeat([P.thrust, 0.05 * P.thrust], 3)
    solution = linprog(
        np.ones(10), A_eq=EFFECT / scale[:, None], b_eq=wrench / scale, bounds=(0.0, P.period), method="highs"
    )
    return solution.fun if solution.status == 0 else None


def wrenches(count):
    """Inside and on the edge of what can be given, along single axes, and beyond."""
    rng = np.random.default_rng(1)
    for k in range(count):
        kind = k % 4
        if kind == 0:
            yield EFFECT @ rng.uniform(0.0, P.period, 10)
        elif kind == 1:
            yield EFFECT @ (rng.uniform(0.0, P.period, 10) * (rng.random(10) < 0.4))
        elif kind == 2:
            axis = np.zeros(6)
            axis[rng.integers(6)] = rng.normal()
            yield axis * np.repeat([1.5e-3, 5e-5], 3)
        else:
            yield rng.normal(size=6) * np.repeat([1.5e-3, 5e-5], 3)


def test_as_good_as_a_linear_program(allocator):
    met = 0
    for wrench in wrenches(1000):
        best, ours = optimum(wrench), allocator.allocate(wrench)
        assert (ours.on_times >= 0.0).all()
        assert (ours.on_times <= P.period).all()
        np.testing.assert_allclose(EFFECT @ ours.on_times, ours.wrench, rtol=0.0, atol=1e-12)
        if best is None:
            assert min(ours.share, ours.torque_share) < 1.0
            continue
        met += 1
        assert ours.share == ours.torque_share == 1.0
        np.testing.assert_array_equal(ours.wrench, wrench)
        assert ours.on_times.sum() == pytest.approx(best, abs=1e-9)
    assert 700 < met < 1000


def test_beyond_reach_the_torque_comes_first_and_directions_stay(allocator):
    force, torque = np.array([0.003, -0.004, 0.002]), np.array([2e-5, -4e-5, 3e-5])
    ours = allocator.allocate(np.concatenate([force, torque]))
    assert ours.torque_share == 1.0
    assert 0.0 < ours.share < 1.0
    np.testing.assert_allclose(EFFECT @ ours.on_times, [*(ours.share * force), *torque], rtol=0.0, atol=1e-12)
    assert optimum(np.concatenate([(ours.share + 1e-3) * force, torque])) is None

    ours = allocator.allocate(np.concatenate([force, 100.0 * torque]))
    assert 0.0 < ours.torque_share < 1.0
    np.testing.assert_allclose(EFFECT @ ours.on_times, [*(ours.share * force), *(100.0 * ours.torque_share * torque)],
                               rtol=0.0, atol=1e-12)  # fmt: skip


def test_a_layout_without_symmetry_is_allocated_too():
    rng = np.random.default_rng(3)
    directions = np.array(P.nozzle_directions) + 0.2 * rng.normal(size=(10, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    effect = effectiveness(P.nozzle_places, directions.tolist(), P.thrust)
    allocator = NozzleAllocator(effect, P.period)
    for _ in range(100):
        wrench = effect @ (rng.uniform(0.0, P.period, 10) * (rng.random(10) < 0.6))
        solution = linprog(np.ones(10), A_eq=effect / effect.max(), b_eq=wrench / effect.max(), bounds=(0.0, P.period))
        assert allocator.allocate(wrench).on_times.sum() == pytest.approx(solution.fun, abs=1e-9)


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        (EFFECT[:, :5], "six degrees of freedom"),
        (EFFECT * np.array([1, 1, 1, 1, 1, 0])[:, None], "six degrees of freedom"),
        (np.abs(EFFECT) + 0.01 * np.eye(6, 10), "one way only"),
    ],
)
def test_nozzles_that_cannot_do_it_are_refused(effect, message):
    with pytest.raises(ValueError, match=message):
        NozzleAllocator(effect, P.period)


def test_no_pulse_is_too_short_or_too_long():
    maker, rng = PulseMaker(P), np.random.default_rng(2)
    for k in range(1500):
        size = (0.003, 0.1, 1.0)[k % 3]
        on_times = maker.update(size * rng.normal(size=6) * np.repeat([1.5e-3, 5e-5], 3), **BANDS).on_times
        opened = on_times[on_times > 0.0]
        assert (opened >= P.least_on_time - 1e-12).all()
        assert (opened <= P.period + 1e-12).all()


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_small_wishes_are_collected_not_lost(axis, sign):
    """A fifth of a least pulse in each period comes out, but for what the feedback sees by itself."""
    maker = PulseMaker(P)
    wish = np.zeros(6)
    wish[axis] = sign * 0.2 * P.least_on_time * P.thrust * (1.0 if axis < 3 else 0.05)
    given = sum(maker.update(wish, **BANDS).wrench for _ in range(500))
    if axis < 3:  # of the force, k_v T is left to the feedback
        assert 0.3 < given[axis] / (500 * wish[axis]) <= 1.02
    assert np.abs(maker.owed).max() < 5.0 * P.least_on_time * P.thrust
    assert given[axis] * sign >= 0.0


def test_less_than_the_band_opens_nothing():
    maker = PulseMaker(P)
    rng = np.random.default_rng(4)
    for _ in range(300):
        assert not maker.update(rng.normal(size=6) * np.repeat([2e-6, 1e-7], 3), **BANDS).on_times.any()


def test_a_wider_band_saves_pulses():
    def spent(scale):
        maker, rng = PulseMaker(P), np.random.default_rng(5)
        bands = {name: scale * value for name, value in BANDS.items()}
        return sum(
            maker.update(rng.normal(size=6) * np.repeat([1e-4, 3e-6], 3), **bands).on_times.sum() for _ in range(300)
        )

    assert spent(3.0) < 0.7 * spent(1.0)


def test_reset_forgets_what_is_owed():
    maker = PulseMaker(P)
    maker.update(np.array([2e-5, 0.0, 0.0, 0.0, 0.0, 0.0]), **BANDS)
    assert maker.owed.any()
    maker.reset()
    assert not maker.owed.any()


def test_a_dearer_pulse_is_given_less():
    def spent(price):
        maker, rng = PulseMaker(replace(P, pulse_price=price)), np.random.default_rng(6)
        wishes = rng.normal(size=(300, 6)) * np.repeat([1e-4, 5e-6], 3)
        return sum(maker.update(wish, **BANDS).on_times.sum() for wish in wishes)

    assert spent(1.0) < spent(0.1)
