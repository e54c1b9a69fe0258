"""The heading keeps up with a target that turns, on a vehicle that turns late."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from companion.control.heading_feedback import HeadingFeedback
from companion.control.relative_feedback import RelativeFeedbackParameters
from companion.geometry.angles import wrap_angle
from companion.messages.motion import MotionState

GAIN, RATE_MAX = 2.8, 1.0
DT, FRAME, SEEN_LATE = 0.02, 5, 3  # [s], steps within which the target keeps its turn rate, steps of delay
PARAMETERS = RelativeFeedbackParameters()


def heading(yaw: float, rate: float = 0.0) -> MotionState:
    zero = np.zeros(3)
    return MotionState(position_ned=zero, velocity_ned=zero, acceleration_ned=zero, yaw=yaw, yaw_rate=rate)


def made() -> HeadingFeedback:
    return HeadingFeedback(PARAMETERS, gain=GAIN, rate_max=RATE_MAX, near=0.15)


class Vehicle:
    """Turns as an X500 under PX4: torque 0.2 of the rate's error, smoothed with 2 Hz, rotors of 35 ms."""

    def __init__(self, power: float = 16.3) -> None:
        self._power = power  # [rad/s^2] for a whole torque
        self.yaw = self.rate = self._torque = self._rotors = 0.0

    def turn(self, wanted_rate: float) -> None:
        for _ in range(5):
            dt = DT / 5
            self._torque += (0.2 * (wanted_rate - self.rate) - self._torque) * dt * 4.0 * math.pi
            self._rotors += (self._torque - self._rotors) * dt / 0.035
            self.rate += self._power * self._rotors * dt
            self.yaw += self.rate * dt


def follow(
    target: np.ndarray,
    *,
    calm: bool,
    forecast_rate: Callable[[int], float] = lambda _: 0.0,
    vehicle: Vehicle | None = None,
) -> np.ndarray:
    """Follow a course of headings [rad], one for each step, seen late; the plan lags behind what is seen."""
    feedback, errors, planned = made(), [], float(target[0])
    vehicle = vehicle or Vehicle()
    for step, true in enumerate(target):
        seen = max(0, step - SEEN_LATE)
        rate = forecast_rate(seen)
        yaw_seen = float(target[seen]) + rate * (step - seen) * DT

        def goal(t: float, yaw: float = yaw_seen, rate: float = rate, now: float = step * DT) -> MotionState:
            return heading(yaw + rate * (t - now), rate)

        planned += (yaw_seen - planned) * DT / 0.25 + rate * DT
        plan = heading(planned, rate)
        turn = feedback.update(step * DT, DT, goal=goal, calm=calm, plan=plan, yaw=vehicle.yaw, yaw_rate=vehicle.rate)
        demand = plan.yaw_rate + GAIN * wrap_angle(plan.yaw + turn - vehicle.yaw)
        vehicle.turn(max(-RATE_MAX, min(RATE_MAX, demand)))
        errors.append(wrap_angle(float(true) - vehicle.yaw))
    return np.array(errors)


def drawn_at_random(seed: int) -> np.ndarray:
    """Patel et al., table 4: a new turn rate in [-1, 1] rad/s ten times a second, for 60 s."""
    rates = np.random.default_rng(seed).uniform(-1.0, 1.0, 600).repeat(FRAME)
    return np.cumsum(rates) * DT


def test_it_keeps_up_with_a_heading_that_walks_at_random() -> None:
    """With the vehicle's own lag and 60 ms of delay no linear feedback does better than 0.07 rad."""
    quick = np.mean([np.abs(follow(drawn_at_random(seed), calm=True)).mean() for seed in range(4)])
    gentle = np.mean([np.abs(follow(drawn_at_random(seed), calm=False)).mean() for seed in range(4)])
    assert quick < 0.09
    assert quick < 0.8 * gentle


@pytest.mark.parametrize("rate", [-0.5, 0.2, 0.8])
def test_nothing_is_left_behind_a_target_that_turns_steadily(rate: float) -> None:
    course = rate * DT * np.arange(1000)
    assert np.abs(follow(course, calm=True, forecast_rate=lambda _: rate)[-50:]).max() < 0.02


@pytest.mark.parametrize("calm", [True, False])
def test_it_settles_on_a_heading_without_swinging(calm: bool) -> None:
    errors = follow(np.full(500, 0.1), calm=calm)
    assert np.abs(errors[-50:]).max() < 0.002
    assert errors.min() > -0.02


@pytest.mark.parametrize("power", [6.0, 40.0])
def test_another_airframe_does_not_swing_either(power: float) -> None:
    errors = follow(np.full(500, 0.2), calm=True, vehicle=Vehicle(power))
    assert np.abs(errors[-150:]).max() < 0.005
    assert errors.min() > -0.25 * 0.2


def test_a_landing_is_turned_gently() -> None:
    feedback, last = made(), 0.0
    for step in range(200):
        turn = feedback.update(
            step * DT,
            DT,
            goal=lambda _: heading(0.14),
            calm=False,
            plan=heading(-0.5),
            yaw=0.0,
            yaw_rate=0.6 * math.sin(step),
        )
        assert abs(turn) <= PARAMETERS.heading_max_rad
        assert abs(turn - last) <= PARAMETERS.heading_slew_radps * DT + 1e-12
        last = turn
    assert last != 0.0
    feedback.reset()
    still = feedback.update(0.0, DT, goal=lambda _: heading(0.0), calm=False, plan=heading(0.0), yaw=0.0, yaw_rate=0.0)
    assert still == 0.0


def test_it_asks_for_no_more_than_the_yaw_rate_and_goes_the_short_way() -> None:
    for yaw, wanted in ((3.0, -3.0), (-3.0, 3.0), (0.0, 2.0)):
        turn = made().update(
            0.0, DT, goal=lambda _, to=wanted: heading(to), calm=True, plan=heading(yaw), yaw=yaw, yaw_rate=0.0
        )
        assert abs(GAIN * turn) <= RATE_MAX + 1e-9
        assert turn * wrap_angle(wanted - yaw) > 0.0
