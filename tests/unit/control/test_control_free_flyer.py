"""Control of the free-flyer: gains, observer, pulses, saturation, heading."""

import math
from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.control.free_flyer.controller import FreeFlyerController
from companion.control.free_flyer.gains import feedback_gains
from companion.control.free_flyer.observer import CommandHistory, PlaneObserver
from companion.control.free_flyer.parameters import FreeFlyerControlParameters
from companion.control.free_flyer.pulses import PulseMaker
from companion.geometry.rotations import rotation_about_z
from companion.messages.motion import MotionState
from companion.messages.ownship import OwnshipState

PARAMETERS = FreeFlyerControlParameters()
TICK = 0.02


def odometry(t, position=(0.0, 0.0), velocity=(0.0, 0.0), yaw=0.0, rate=0.0, counter=0):
    return OwnshipState(
        t=t,
        position_ned=np.array([*position, -0.25]),
        velocity_ned=np.array([*velocity, 0.0]),
        acceleration_ned=np.zeros(3),
        ned_from_frd=rotation_about_z(yaw),
        angular_velocity_frd=np.array([0.0, 0.0, rate]),
        reset_counter=counter,
    )


def wanted(position=(0.0, 0.0), velocity=(0.0, 0.0), acceleration=(0.0, 0.0), yaw=0.0, yaw_rate=0.0):
    return MotionState(
        position_ned=np.array([*position, 1.0]),
        velocity_ned=np.array([*velocity, 0.3]),
        acceleration_ned=np.array([*acceleration, 0.1]),
        yaw=yaw,
        yaw_rate=yaw_rate,
    )


def controller(speed_max=0.2, **changed):
    return FreeFlyerController(FreeFlyerControlParameters(**changed), speed_max=speed_max)


def thrust(step):
    return step.setpoint.thrust_body.tolist()


# gains


def cost(k_p, k_v, parameters=PARAMETERS):
    period, total = parameters.pulse_period, 0.0
    for p, v in ((1.0, 0.0), (0.0, 1.0)):
        for _ in range(600):
            u = -k_p * p - k_v * v
            total += (p / parameters.position_scale) ** 2 + (v / parameters.velocity_scale) ** 2
            total += (u / parameters.acceleration_scale) ** 2
            p, v = p + v * period + 0.5 * u * period**2, v + u * period
    return total


def test_no_other_gains_are_cheaper():
    k_p, k_v = feedback_gains(PARAMETERS)
    best = cost(k_p, k_v)
    for d_p in (-0.05, 0.0, 0.05):
        for d_v in (-0.05, 0.0, 0.05):
            assert cost(k_p * (1.0 + d_p), k_v * (1.0 + d_v)) >= best * (1.0 - 1e-9)


@given(
    position=st.floats(0.005, 0.5),
    velocity=st.floats(0.01, 1.0),
    acceleration=st.floats(0.02, 1.0),
    period=st.floats(0.02, 0.3),
)
@settings(max_examples=40, deadline=None)
def test_every_choice_of_weights_is_stable(position, velocity, acceleration, period):
    parameters = FreeFlyerControlParameters(
        position_scale=position, velocity_scale=velocity, acceleration_scale=acceleration, pulse_period=period
    )
    k_p, k_v = feedback_gains(parameters)
    step = np.array([[1.0, period], [0.0, 1.0]]) - np.outer([0.5 * period**2, period], [k_p, k_v])
    assert max(abs(np.linalg.eigvals(step))) < 1.0


# observer


def observed(bias=(0.0, 0.0), disturbance=(0.02, -0.01), seconds=8.0, push=0.05):
    """Let it watch a vehicle that is pushed, with a velocity that the autopilot gets wrong."""
    history, observer = CommandHistory(), PlaneObserver(4.0, 0.06)
    position, velocity = np.zeros(2), np.zeros(2)
    for i in range(round(seconds / TICK)):
        t = i * TICK
        u = push * math.sin(t)
        observer.add(odometry(t, position, velocity + bias), history)
        history.add(t, u, 0.0)
        acceleration = np.array([u, 0.0]) + disturbance
        position = position + velocity * TICK + 0.5 * acceleration * TICK**2
        velocity = velocity + acceleration * TICK
    return observer, history, position, velocity, t + TICK


def test_it_finds_position_velocity_and_disturbance():
    observer, history, position, velocity, t = observed()
    assert observer.disturbance == pytest.approx((0.02, -0.01), abs=1e-4)
    predicted = observer.predict(t, history)
    assert predicted[0] == pytest.approx(position, abs=1e-4)
    assert predicted[1] == pytest.approx(velocity, abs=1e-3)


def test_a_biased_velocity_is_not_believed():
    clean, biased = observed(), observed(bias=(0.1, -0.08))
    assert biased[0].velocity == pytest.approx(clean[0].velocity, abs=1e-6)
    assert biased[0].disturbance == pytest.approx(clean[0].disturbance, abs=1e-6)


def test_a_disturbance_beyond_belief_is_bounded_and_a_reset_keeps_it():
    observer, history, *_ = observed(disturbance=(0.5, 0.0))
    assert observer.disturbance[0] == 0.06
    observer.add(odometry(observer.t + TICK, (7.0, -3.0), (0.1, 0.0), counter=1), history)
    assert observer.position == (7.0, -3.0)
    assert observer.velocity == (0.1, 0.0)
    assert observer.disturbance[0] == 0.06
    before = (observer.t, observer.position)
    observer.add(odometry(observer.t, (9.0, 9.0), counter=1), history)  # not newer
    assert (observer.t, observer.position) == before


def test_the_mean_command_counts_each_for_its_time():
    history = CommandHistory()
    assert history.mean(0.0, 1.0) == (0.0, 0.0)
    for t, north in ((1.0, 1.0), (2.0, 3.0), (4.0, -1.0)):
        history.add(t, north, 2.0 * north)
    assert history.mean(0.0, 2.0) == pytest.approx((0.5, 1.0))
    assert history.mean(1.5, 4.5) == pytest.approx(((0.5 + 6.0 - 0.5) / 3.0, (0.5 + 6.0 - 0.5) / 1.5))
    assert history.mean(5.0, 9.0) == pytest.approx((-1.0, -2.0))
    assert history.mean(3.0, 3.0) == (0.0, 0.0)
    history.forget_before(3.0)
    assert history.mean(2.5, 4.5) == pytest.approx((2.0, 4.0))


# pulses


@given(small=st.floats(-0.0799, 0.0799))
@settings(max_examples=40, deadline=None)
def test_small_thrusts_become_pulses_of_the_same_impulse(small):
    maker, total, seconds = PulseMaker(0.08, 0.1), 0.0, 40.0
    for i in range(round(seconds / TICK)):
        given_thrust = maker.update(i * TICK, small)
        assert given_thrust in (0.0, math.copysign(0.08, small))
        total += given_thrust * TICK
    assert total == pytest.approx(small * seconds, abs=0.08 * 0.1)


def test_a_pulse_lasts_one_period_whatever_the_ticks():
    for tick in (0.02, 0.01, 0.025):
        maker, flown = PulseMaker(0.08, 0.1), []
        for i in range(round(20.0 / tick)):
            flown.append(maker.update(i * tick, 0.02) > 0.0)
        lengths = [len(run) for run in "".join("x" if on else " " for on in flown).split() if run]
        assert set(lengths[:-1]) == {round(0.1 / tick)}


def test_large_thrusts_pass_and_settle_the_debt():
    maker = PulseMaker(0.08, 0.1)
    for i in range(4):
        maker.update(i * TICK, 0.07)
    assert maker.update(0.08, -0.5) == -0.5
    assert maker.update(0.10, 0.0) == 0.0
    maker.update(0.12, 0.07)
    maker.reset()
    assert maker.update(0.14, 0.0) == 0.0


# controller


def test_thrust_points_from_the_vehicle_to_the_reference_in_the_body():
    """North of a vehicle that faces east is its left."""
    step = controller().update(0.0, wanted((0.05, 0.0), yaw=0.5 * math.pi), odometry(0.0, yaw=0.5 * math.pi))
    forward, right, down = thrust(step)
    assert right < -0.1
    assert forward == pytest.approx(0.0, abs=1e-9)
    assert down == 0.0
    assert step.position_error == pytest.approx((0.05, 0.0))


@given(heading=st.floats(-3.1, 3.1), bearing=st.floats(-3.1, 3.1))
@settings(max_examples=40, deadline=None)
def test_the_floor_has_no_preferred_direction(heading, bearing):
    def shot(turn):
        at = (0.1 * math.cos(bearing + turn), 0.1 * math.sin(bearing + turn))
        step = controller().update(0.0, wanted(at, yaw=heading + turn), odometry(0.0, yaw=heading + turn))
        return thrust(step)

    assert shot(0.7) == pytest.approx(shot(0.0), abs=1e-9)


def test_saturation_keeps_the_direction_and_leaves_room_for_turning():
    flyer = controller(speed_max=5.0)
    step = flyer.update(0.0, wanted(acceleration=(1.0, 0.5)), odometry(0.0))
    forward, right, _ = thrust(step)
    assert forward == pytest.approx(1.0 - PARAMETERS.turning_share)
    assert right == pytest.approx(0.5 * forward)
    # the way and the speed that the acceleration brings until the command acts are wanted too
    asked = 1.0 + flyer.gains[1] * PARAMETERS.delay + 0.5 * flyer.gains[0] * PARAMETERS.delay**2
    assert step.share == pytest.approx(forward * PARAMETERS.thrust_acceleration / asked, rel=1e-9)


def test_feedback_never_asks_for_more_than_the_top_speed():
    """At the top speed already, an error ahead asks for no more thrust; one behind brakes."""
    for place, sign in ((2.0, 0.0), (-2.0, -1.0)):
        step = controller(speed_max=0.1).update(0.0, wanted((place, 0.0), (0.1, 0.0)), odometry(0.0, velocity=(0.1, 0)))
        assert np.sign(np.round(thrust(step)[0], 9)) == sign


def test_old_odometry_means_no_thrust():
    flyer = controller()
    state = odometry(0.0)
    assert not flyer.update(0.4, wanted((0.5, 0.0)), state).blind
    step = flyer.update(0.6, wanted((0.5, 0.0)), state)
    assert step.blind
    assert thrust(step) == [0.0, 0.0, 0.0]


def test_heading_takes_the_short_way_leads_a_turn_and_is_bounded():
    flyer = controller()
    most = PARAMETERS.yaw_rate_max / PARAMETERS.heading_gain
    assert flyer.update(0.0, wanted(yaw=-3.0), odometry(0.0, yaw=3.0)).setpoint.yaw == pytest.approx(
        3.0 + (2.0 * math.pi - 6.0)
    )
    assert flyer.update(0.02, wanted(yaw=0.2, yaw_rate=0.3), odometry(0.02, yaw=0.2)).setpoint.yaw == pytest.approx(0.3)
    assert flyer.update(0.04, wanted(yaw=2.0), odometry(0.04)).setpoint.yaw == pytest.approx(most)
    assert flyer.update(0.06, wanted(yaw=-2.0), odometry(0.06)).setpoint.yaw == pytest.approx(-most)


def flown(flyer, *, seconds=40.0, delay=0.06, weak=1.0, bias=(0.0, 0.0), disturbance=(0.01, -0.005), start=(-0.3, 0.2)):
    """A double integrator that moves as commanded, late, weaker and pushed aside; gives its errors."""
    position, velocity, waiting = np.array(start), np.zeros(2), deque()
    errors = []
    for i in range(round(seconds / TICK)):
        t = i * TICK
        target = np.array([0.05 * t, -0.02 * t])
        step = flyer.update(t, wanted(target, (0.05, -0.02)), odometry(t, position, velocity + bias))
        waiting.append((t + delay, weak * PARAMETERS.thrust_acceleration * step.setpoint.thrust_body[:2]))
        while len(waiting) > 1 and waiting[1][0] <= t:
            waiting.popleft()
        push = waiting[0][1] if waiting[0][0] <= t else np.zeros(2)
        acceleration = push + np.array(disturbance)
        position = position + velocity * TICK + 0.5 * acceleration * TICK**2
        velocity = velocity + acceleration * TICK
        errors.append(math.dist(position, target + np.array([0.05, -0.02]) * TICK))
    return np.array(errors)


@pytest.mark.parametrize(("delay", "weak"), [(0.06, 1.0), (0.02, 1.3), (0.12, 0.7)])
def test_it_stands_on_the_moving_reference_despite_slope_bias_and_a_wrong_model(delay, weak):
    errors = flown(controller(), delay=delay, weak=weak, bias=(0.08, -0.05))
    assert errors[-500:].max() < 0.006
    assert errors[250:].max() < 0.05


def test_without_taking_out_the_disturbance_it_would_stand_aside():
    errors = flown(controller(disturbance_max=1e-6))
    assert errors[-500:].mean() > 0.002
    assert flown(controller())[-500:].mean() < 0.0015


def test_a_reset_forgets_and_the_same_flight_is_the_same_to_the_bit():
    flyer = controller()
    first = flown(flyer, seconds=5.0)
    flyer.reset()
    assert np.array_equal(flown(flyer, seconds=5.0), first)
