"""Six-degree-of-freedom control of a spacecraft that is not the controller's model."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rigid_body import TASKS, fly
from rigid_body_truth import PERFECT, Imperfection, Spacecraft, about, matrix, product

from companion.control.rigid_body.attitude import AttitudeFeedback
from companion.control.rigid_body.controller import RigidBodyController
from companion.control.rigid_body.gains import attitude_gains, translation_gains
from companion.control.rigid_body.parameters import RigidBodyParameters
from companion.control.rigid_body.translation import TranslationFeedback
from companion.messages.proximity import PoseGoal

P = RigidBodyParameters()
HOLD, LINE, TURN, DOCK = TASKS
SHORT_HOLD = replace(HOLD, seconds=60.0)
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def rest(quaternion=IDENTITY, position=(0.0, 0.0, 0.0)):
    zero = np.zeros(3)
    return PoseGoal(position=np.array(position), velocity=zero, acceleration=zero, quaternion=quaternion, rate=zero)


def craft_at(quaternion=IDENTITY, imperfection=PERFECT, seed=1, parameters=P):
    return Spacecraft(
        parameters, imperfection, np.random.default_rng(seed), position=np.zeros(3), quaternion=quaternion
    )


# --- gains


def test_translation_gains_are_stable_and_optimal():
    gains, dt = translation_gains(P), P.period

    def cost(k):
        a = np.array([[1.0, dt, 0.0], [0.0, 1.0, 0.0], [dt, 0.0, 1.0]])
        b = np.array([0.5 * dt * dt, dt, 0.0])
        x, total = np.array([0.01, 0.0, 0.0]), 0.0
        scales = np.array([P.position_scale, P.velocity_scale, P.integral_scale])
        for _ in range(6000):
            u = -float(k @ x)
            total += float(((x / scales) ** 2).sum()) + (u / P.acceleration_scale) ** 2
            x = a @ x + b * u
        assert abs(x[:2]).max() < 1e-6
        return total

    best = np.array([gains.position, gains.velocity, gains.integral])
    optimum = cost(best)
    for k in range(3):
        for factor in (0.9, 1.1):
            other = best.copy()
            other[k] *= factor
            assert cost(other) > optimum


def test_attitude_gains_are_those_of_an_oscillator():
    gains = attitude_gains(replace(P, natural_frequency=0.5, damping=0.7))
    assert gains.attitude == pytest.approx(0.25)
    assert gains.rate == pytest.approx(0.7)


# --- attitude feedback


def test_torque_turns_the_short_way_round_whatever_the_sign_of_the_quaternion():
    feedback, still = AttitudeFeedback(P), np.zeros(3)
    error = about(np.array([0.0, 0.0, 1.0]), math.radians(10.0))
    torque = feedback.torque(error, still, still)
    assert torque[2] > 0.0
    np.testing.assert_allclose(feedback.torque(-error, still, still), torque)
    beyond_half_a_turn = about(np.array([0.0, 0.0, 1.0]), math.radians(200.0))
    assert feedback.torque(beyond_half_a_turn, still, still)[2] < 0.0


def test_a_steady_turn_needs_the_gyroscopic_torque_alone():
    parameters = replace(P, inertia=(0.002, 0.003, 0.004), rate_max=1.0)
    rate = np.array([0.2, -0.1, 0.3])
    torque = AttitudeFeedback(parameters).torque(IDENTITY, rate, rate)
    np.testing.assert_allclose(torque, np.cross(rate, np.array(parameters.inertia) * rate), atol=1e-15)


def test_it_is_soft_near_the_goal_and_critically_damped_far_from_it():
    parameters = replace(P, rate_max=100.0)
    feedback, gains, still = AttitudeFeedback(parameters), attitude_gains(parameters), np.zeros(3)

    def pull(angle):
        error = np.array([1.0, 0.0, 0.5 * angle, 0.0])
        return feedback.torque(error, still, still)[1] / P.inertia[1]

    band = P.attitude_band_max
    assert pull(0.9 * band) == pytest.approx(gains.attitude * 0.9 * band)
    assert pull(1.5) - pull(0.5) == pytest.approx(0.25 * gains.rate**2)
    assert pull(band * 1.001) == pytest.approx(pull(band * 0.999), rel=0.01)


def test_the_wanted_rate_is_bounded():
    feedback, gains = AttitudeFeedback(P), attitude_gains(P)
    for angle in (0.5, 1.0, 2.0, 3.0):
        torque = feedback.torque(about(np.array([1.0, 1.0, 0.0]), angle), np.array([0.0, 0.3, 0.0]), np.zeros(3))
        assert np.linalg.norm(torque / P.inertia / gains.rate) <= P.rate_max * (1.0 + 1e-9)


# --- translation feedback


def test_inside_the_band_nothing_is_asked_for_and_outside_it_is_the_regulator():
    feedback, gains, still = TranslationFeedback(P), translation_gains(P), np.zeros(3)
    band = feedback.band(np.zeros((6, 6)))
    np.testing.assert_allclose(band, P.position_band)
    assert not feedback.acceleration(0.9 * band, still, band).any()
    error = np.array([0.010, -0.005, 0.0])
    expected = gains.position * (error - np.sign(error) * band)
    np.testing.assert_allclose(feedback.acceleration(error, still, band), expected)


def test_the_band_is_as_wide_as_the_estimate_is_uncertain():
    feedback, gains = TranslationFeedback(P), translation_gains(P)
    covariance = np.diag([1e-6, 4e-6, 0.0, 0.0, 1e-6, 100.0])
    covariance[1, 4] = covariance[4, 1] = -1e-6
    lead = gains.velocity / gains.position
    band = feedback.band(covariance)
    assert band[0] == pytest.approx(P.noise_band * 1e-3)
    assert band[1] == pytest.approx(P.noise_band * 1e-3 * math.sqrt(4.0 - 2.0 * lead + lead * lead))
    assert band[2] == P.position_band_max


def test_the_correction_has_a_top_speed():
    feedback, gains = TranslationFeedback(P), translation_gains(P)
    far = np.array([3.0, -4.0, 0.0])
    wanted = feedback.acceleration(far, np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(wanted / gains.velocity, P.correction_speed_max * far / 5.0)


def test_the_integral_is_bounded_and_ignores_errors_that_are_no_disturbance():
    feedback, band = TranslationFeedback(P), np.full(3, P.position_band)
    feedback.integrate(np.array([5.0, 0.0, 0.0]), band)
    feedback.integrate(0.9 * band, band)
    assert not feedback.disturbance.any()
    for _ in range(100_000):
        feedback.integrate(np.array([0.01, -0.01, 0.0]), band)
    np.testing.assert_allclose(feedback.disturbance, [P.disturbance_max, -P.disturbance_max, 0.0])
    feedback.reset()
    assert not feedback.disturbance.any()


# --- one step


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_pushes_towards_the_goal_in_the_frame_of_the_body(axis, sign):
    """Breaks if c_from_d is used the wrong way round."""
    quaternion = about(np.array([0.2, 0.9, -0.4]), 1.9)
    craft = craft_at(quaternion)
    aside = np.zeros(3)
    aside[axis] = 0.2 * sign
    pulses = RigidBodyController(P).step(0.0, craft.state(), rest(quaternion, aside))
    push = matrix(quaternion) @ pulses.force
    assert push[axis] * sign > 0.9 * np.linalg.norm(push) > 0.0


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_turns_towards_the_goal(axis, sign):
    start = about(np.array([0.2, 0.9, -0.4]), 1.9)
    about_axis = np.zeros(3)
    about_axis[axis] = sign
    pulses = RigidBodyController(P).step(0.0, craft_at(start).state(), rest(product(start, about(about_axis, 0.3))))
    assert pulses.torque[axis] * sign > 0.9 * np.linalg.norm(pulses.torque) > 0.0


def test_goal_acceleration_is_fed_forward():
    goal = replace(rest(), acceleration=np.array([0.004, 0.0, -0.003]))
    force = RigidBodyController(P).step(0.0, craft_at().state(), goal).force
    np.testing.assert_allclose(force, P.mass * goal.acceleration, atol=0.15 * P.mass * 0.005)


def test_a_goal_rate_is_seen_from_the_body():
    """The goal is turned by 90 deg about x and turns about its own y, which is the body's z; half a turn of limit."""
    parameters = replace(P, rate_max=10.0)
    goal = replace(rest(about(np.array([1.0, 0.0, 0.0]), 0.5 * math.pi)), rate=np.array([0.0, 0.05, 0.0]))
    with_rate = RigidBodyController(parameters).step(0.0, craft_at().state(), goal)
    without = RigidBodyController(parameters).step(0.0, craft_at().state(), replace(goal, rate=np.zeros(3)))
    assert with_rate.torque[2] > without.torque[2] + 1e-5


def test_an_old_estimate_opens_no_valve():
    craft = craft_at()
    pulses = RigidBodyController(P).step(P.blind_after + 0.01, craft.state(), rest(position=(0.2, 0.0, 0.0)))
    assert not any(pulses.on_times)
    assert any(RigidBodyController(P).step(0.4, craft.state(), rest(position=(0.2, 0.0, 0.0))).on_times)


def test_pulses_under_way_are_not_asked_for_twice():
    """An estimate from before the pulses: what they will do is known, so the second command is for after them."""
    craft, controller = craft_at(), RigidBodyController(P)
    goal = replace(rest(), velocity=np.array([0.02, 0.0, 0.0]))
    late = controller.step(0.0, craft.state(), goal)
    again = controller.step(0.1, craft.state(), goal)
    fresh = RigidBodyController(P).step(0.1, craft.state(), goal)
    assert late.force[0] > 0.0
    assert again.force[0] < fresh.force[0]


def test_reset_and_repetition_give_the_same_bits():
    craft = craft_at(imperfection=Imperfection())
    controller = RigidBodyController(P)
    goal = rest(about(np.array([0.0, 1.0, 1.0]), 0.2), (0.02, 0.01, -0.03))

    def some():
        return [controller.step(0.1 * k, replace(craft.state(), t=0.1 * k), goal).on_times for k in range(20)]

    first = some()
    controller.reset()
    assert some() == first


# --- whole flights, a spacecraft with strength errors of 5 %, its centre of mass 1 mm off, 2e-5 m/s^2 pushing


@pytest.mark.parametrize("seed", [1, 2])
def test_it_holds_its_place_with_little_propellant(seed):
    flight = fly(HOLD, seed, Imperfection(), noisy=False)
    assert flight.position.max() < 0.002
    assert flight.attitude.max() < math.radians(0.3)
    assert flight.impulse < 0.060  # N s in 120 s; the disturbance alone needs 5 mN s along x


def test_without_disturbance_it_spends_nothing():
    assert fly(SHORT_HOLD, 1, PERFECT, noisy=False).openings == 0


def test_noise_of_the_estimate_makes_little_chatter():
    flight = fly(SHORT_HOLD, 1, Imperfection(), noisy=True)
    assert flight.position.max() < 0.015
    assert flight.openings < 3.5 * SHORT_HOLD.seconds
    reckless = replace(P, noise_band=0.0, rate_noise=0.0)
    assert flight.impulse < 0.5 * fly(SHORT_HOLD, 1, Imperfection(), noisy=True, parameters=reckless).impulse


def test_it_moves_along_a_line_and_stops():
    flight = fly(LINE, 1, Imperfection(), noisy=False)
    assert flight.position.max() < 0.003
    assert flight.impulse < 0.2


def test_it_turns_by_120_degrees_while_it_moves():
    start, goals = craft_at(TURN.goal(0.0).quaternion).quaternion, TURN.goal(6.0).quaternion
    controller, craft = RigidBodyController(P), craft_at(start, Imperfection(), 2)
    angles, rates, errors = [], [], []
    for k in range(750):
        goal = TURN.goal(0.1 * k)
        craft.advance(controller.step(0.1 * k, craft.state(), goal))
        done = product(start * np.array([1.0, -1.0, -1.0, -1.0]), craft.quaternion)
        angles.append(2.0 * math.acos(min(1.0, abs(done[0]))))
        rates.append(float(np.linalg.norm(craft.rate)))
        errors.append(float(np.linalg.norm(goal.position - craft.position)))
    assert max(rates) < P.rate_max + 0.005
    assert max(angles) < math.radians(122.0)
    left = product(goals * np.array([1.0, -1.0, -1.0, -1.0]), craft.quaternion)
    assert 2.0 * np.linalg.norm(left[1:]) < math.radians(0.5)
    assert min(angles[500:]) > math.radians(119.0)
    assert max(errors) < 0.01
    assert errors[-1] < 0.003


def test_it_docks_straight():
    for seed in (1, 2):
        flight = fly(DOCK, seed, Imperfection(), noisy=False)
        assert flight.lateral.max() < 0.002
        assert flight.attitude.max() < math.radians(0.5)
