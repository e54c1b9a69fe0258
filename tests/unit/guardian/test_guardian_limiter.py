"""The stop at hand, the fence, and the command that never steps."""

import math

import numpy as np
import pytest
from guardian_bench import LIMITS
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.geometry.angles import wrap_angle
from companion.guardian.fence import Fence
from companion.guardian.leading import leading_position, leading_yaw
from companion.guardian.limiter import (
    Reference,
    Target,
    brake,
    follow,
    hold_here,
    keep_near,
    on_leash,
    shifted,
)
from companion.guardian.motion import Heading, Motion, acceleration_use, clamp_acceleration, clamp_speed, speed_use
from companion.guardian.parameters import GuardianParameters
from companion.guardian.stop import hull, plan_stop, stop_at

PARAMETERS = GuardianParameters()
ZERO = (0.0, 0.0, 0.0)


def vectors(size):
    return st.tuples(*[st.floats(-size, size)] * 3)


speeds = vectors(4).map(lambda v: clamp_speed(v, LIMITS))
accelerations = vectors(4).map(lambda a: clamp_acceleration(a, LIMITS))


@given(v=speeds, a=accelerations)
@settings(max_examples=100, deadline=None)
def test_the_stop_is_one_motion_inside_the_limits(v, a):
    stop = plan_stop(Motion((1.0, 2.0, -3.0), v, a), LIMITS)
    total = stop.release + 2 * stop.ramp + stop.flat
    first, end = stop_at(stop, 0.0), stop_at(stop, total + 1e-9)
    for got, wanted in zip(first, stop.start, strict=True):
        assert got == pytest.approx(wanted, abs=1e-7)
    assert end.position == pytest.approx(stop.end)
    assert end.velocity == end.acceleration == ZERO
    viable = speed_use(stop.released_velocity, LIMITS) <= 1.0
    h, before = max(total, 1e-3) / 400, first
    for k in range(1, 401):
        now = stop_at(stop, k * h)
        assert acceleration_use(now.acceleration, LIMITS) <= 1 + 1e-6
        if viable:
            assert speed_use(now.velocity, LIMITS) <= 1 + 1e-6
        jerk = (np.array(now.acceleration) - before.acceleration) / h
        assert np.abs(jerk).max() <= LIMITS.jerk * 1.001 + 1e-6
        moved = (np.array(before.velocity) + now.velocity) / 2 * h
        assert np.array(now.position) - before.position == pytest.approx(moved, abs=1e-5)
        gained = (np.array(before.acceleration) + now.acceleration) / 2 * h
        assert np.array(now.velocity) - before.velocity == pytest.approx(gained, abs=3e-4)
        before = now


@given(v=speeds, a=accelerations, direction=vectors(1))
@settings(max_examples=60, deadline=None)
def test_the_whole_stop_lies_in_the_hull_of_its_points(v, a, direction):
    stop = plan_stop(Motion(ZERO, v, a), LIMITS)
    corners = [stop.start.position, *hull(stop)]
    furthest = max(np.dot(direction, c) for c in corners)
    total = stop.release + 2 * stop.ramp + stop.flat
    for share in np.linspace(0, 1, 50):
        assert np.dot(direction, stop_at(stop, share * total).position) <= furthest + 1e-9


@given(point=vectors(100), inside=vectors(8), margin=st.sampled_from([0.0, 1.0]))
@settings(max_examples=100, deadline=None)
def test_the_fence_brings_points_inside_and_never_further_from_what_is_inside(point, inside, margin):
    fence = Fence(radius=10.0, north_max=6.0, height_max=8.0, height_min=-8.0, centre_east=1.0)
    clamped = fence.clamp(point, margin)
    assert fence.excess(clamped, margin) <= 1e-9
    if fence.excess(point, margin) <= 0.0:
        assert clamped == pytest.approx(point)
    inside = fence.clamp(inside, margin)
    assert math.dist(clamped, inside) <= math.dist(point, inside) + 1e-9


def test_a_fence_that_is_no_space_is_refused():
    with pytest.raises(ValueError, match="centre"):
        Fence(north_min=5.0)
    with pytest.raises(ValueError, match="height"):
        Fence(height_min=5.0, height_max=5.0)
    assert Fence(height_min=0.0, height_max=1.0, margin=1.0).clamp((0.0, 0.0, -9.0), 1.0) == (0.0, 0.0, -0.5)


def reference(position, velocity=ZERO, acceleration=ZERO, yaw=0.0, rate=0.0, feedback=ZERO):
    return Reference(Motion(position, velocity, acceleration), Heading(yaw, rate), feedback)


def chase(wanted, *, seconds, target=None, start=(0.0, 0.0, -3.0), dt=0.02, parameters=PARAMETERS):
    """Follow a reference given by time; the vehicle is where the command is."""
    command, history = hold_here(start, 0.0, LIMITS), []
    for k in range(1, round(seconds / dt) + 1):
        here = command.motion.position
        command, clips = follow(command, wanted(k * dt), here, target, dt, LIMITS, parameters)
        history.append((command, clips))
    return history


def test_a_reference_that_can_be_followed_is_followed_exactly():
    def wanted(t):
        return reference((0.25 * t * t * t, 0.0, -3.0), (0.75 * t * t, 0.0, 0.0), (1.5 * t, 0.0, 0.0))

    for k, (command, clips) in enumerate(chase(wanted, seconds=1.4), start=1):
        assert command.motion == wanted(0.02 * k).motion
        assert clips == ()


@given(step=vectors(0.9))
@settings(max_examples=30, deadline=None)
def test_a_step_of_the_reference_is_smoothed_and_reached(step):
    goal = (step[0], step[1], step[2] - 3.0)
    history = chase(lambda _: reference(goal), seconds=8.0)
    assert history[-1][0].motion.position == pytest.approx(goal, abs=0.01)
    overshoot = max(math.dist(c.motion.position, (0, 0, -3)) for c, _ in history) - math.dist(goal, (0, 0, -3))
    assert overshoot < 0.06


def test_a_reference_that_is_too_fast_is_followed_at_the_limit():
    history = chase(lambda t: reference((9.0 * t, 0.0, -3.0), (9.0, 0.0, 0.0)), seconds=6.0)
    assert "speed" in history[-1][1]
    assert history[-1][0].motion.velocity[0] == pytest.approx(3.0, abs=0.02)


def test_closing_in_on_the_target_is_capped():
    target = Target((12.0, 0.0, -3.0), (-0.5, 0.0, 0.0))
    history = chase(lambda t: reference((2.5 * t, 0.0, -3.0), (2.5, 0.0, 0.0)), seconds=4.0, target=target)
    closing = [c.motion.velocity[0] + 0.5 for c, _ in history]
    assert "closing_speed" in history[-1][1]
    assert max(closing) <= 1.5 + 0.02
    away = chase(lambda t: reference((-2.5 * t, 0.0, -3.0), (-2.5, 0.0, 0.0)), seconds=9.0, target=target)
    assert away[-1][0].motion.velocity[0] == pytest.approx(-2.5, abs=0.05)


def test_near_the_target_its_direction_says_nothing():
    target = Target((0.1, 0.0, -3.0), (-5.0, 0.0, 0.0))
    _, clips = chase(lambda _: reference((0.0, 0.0, -3.0)), seconds=0.02, target=target)[0]
    assert clips == ()


@pytest.mark.parametrize("velocity", [(3.0, 0.0, 0.0), (2.0, 2.0, 0.0), (0.0, 0.0, -1.5), (1.0, -2.0, -1.0)])
def test_it_stops_in_front_of_the_fence(velocity):
    parameters = GuardianParameters(fence=Fence(radius=10.0, height_max=10.0))
    history = chase(
        lambda t: reference(tuple(p + v * t for p, v in zip((0, 0, -3), velocity, strict=True)), velocity),
        seconds=15.0,
        parameters=parameters,
    )
    assert max(parameters.fence.excess(c.motion.position, 1.0) for c, _ in history) <= 1e-6
    assert parameters.fence.excess(history[-1][0].motion.position, 1.0) > -0.4
    assert "fence" in history[-1][1]
    assert history[-1][0].motion.velocity == pytest.approx(ZERO, abs=0.05)


def test_feedback_is_sent_but_does_not_move_the_command():
    wanted = reference((0.0, 0.0, -3.0), feedback=(0.8, 0.0, 0.0))
    history = chase(lambda _: wanted, seconds=1.0)
    assert history[-1][0].motion == wanted.motion
    assert history[-1][0].acceleration == pytest.approx((0.8, 0.0, 0.0))
    sent = [c.acceleration[0] for c, _ in history]
    assert max(np.diff([0.0, *sent])) <= LIMITS.jerk * 0.02 + 1e-9


def test_the_heading_turns_the_short_way_within_its_limits():
    history = chase(lambda _: reference((0.0, 0.0, -3.0), yaw=-3.0), seconds=8.0)
    yaws = np.unwrap([c.heading.yaw for c, _ in history])
    rates = [c.heading.rate for c, _ in history]
    assert yaws[-1] == pytest.approx(-3.0, abs=1e-3)
    assert max(map(abs, rates)) <= LIMITS.yaw_rate
    assert max(map(abs, np.diff([0.0, *rates]))) <= LIMITS.yaw_acceleration * 0.02 + 1e-9
    assert min(yaws) > -3.0 - 0.06
    assert "yaw_rate" in history[10][1]


def test_the_leash_holds_level_and_height_apart():
    assert on_leash((3.0, 4.0, 0.5), ZERO, PARAMETERS) == pytest.approx((0.6, 0.8, 0.5))
    assert on_leash((0.1, 0.0, -7.0), ZERO, PARAMETERS) == pytest.approx((0.1, 0.0, -1.0))
    assert on_leash((0.1, 0.0, -0.7), ZERO, PARAMETERS) == (0.1, 0.0, -0.7)


def test_a_reset_moves_the_command_and_its_stop():
    command = hold_here((1.0, 2.0, -3.0), 0.5, LIMITS)
    moved = shifted(command, (1.0, 1.0, 1.0), 0.25)
    assert moved.motion.position == (2.0, 3.0, -2.0)
    assert moved.heading.yaw == 0.75
    assert stop_at(moved.stop, 1.0).position == (2.0, 3.0, -2.0)


def test_near_the_vehicle_means_inside_the_fence_where_the_vehicle_is():
    parameters = GuardianParameters(fence=Fence(radius=10.0))
    command, moved = keep_near(hold_here((10.5, 0.0, -3.0), 0.0, LIMITS), (9.8, 0.0, -3.0), parameters)
    assert moved
    assert command.motion.position == pytest.approx((10.0, 0.0, -3.0))
    outside, moved = keep_near(hold_here((5.0, 0.0, -3.0), 0.0, LIMITS), (12.0, 0.0, -3.0), parameters)
    assert moved
    assert outside.motion.position == pytest.approx((11.0, 0.0, -3.0))


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.6, -0.8, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
def test_a_reference_that_speeds_up_through_the_limit_does_not_take_the_command_along(direction):
    parameters = GuardianParameters(fence=Fence(radius=1e4, height_max=1e4))

    def wanted(t):
        return reference(*(tuple(factor * d for d in direction) for factor in (0.95 * t * t, 1.9 * t, 1.9)))

    history = chase(wanted, seconds=4.0, start=ZERO, parameters=parameters)
    uses = [speed_use(command.motion.velocity, LIMITS) for command, _ in history]
    assert max(uses) <= 1 + 1e-6
    assert uses[-1] > 0.97


def test_a_reference_that_pulls_too_hard_is_clipped():
    wanted = reference((0.0, 0.0, -3.0), acceleration=(9.0, 0.0, 0.0))
    _, clips = chase(lambda _: wanted, seconds=0.02)[0]
    assert "acceleration" in clips


def test_the_velocity_feedback_is_bounded_and_slewed():
    wanted = Reference(Motion((0.0, 0.0, -3.0), ZERO, ZERO), Heading(0.0, 0.0), ZERO, (5.0, -0.3, 0.0))
    history = chase(lambda _: wanted, seconds=1.0)
    sent = np.array([ZERO, *(command.feedback_velocity for command, _ in history)])
    assert sent[-1] == pytest.approx([PARAMETERS.feedback_velocity_max, -0.3, 0.0])
    assert np.abs(np.diff(sent, axis=0)).max() <= LIMITS.acceleration_horizontal * 0.02 + 1e-9
    assert history[-1][0].motion == wanted.motion


@given(velocity=vectors(9.0), feedback=vectors(5.0))
@settings(max_examples=30, deadline=None)
def test_what_is_sent_with_the_velocity_feedback_keeps_the_speed_limits(velocity, feedback):
    def wanted(t):
        place = (velocity[0] * t, velocity[1] * t, velocity[2] * t - 3.0)
        return Reference(Motion(place, velocity, ZERO), Heading(0.0, 0.0), ZERO, feedback)

    for command, _ in chase(wanted, seconds=2.0):
        sent = tuple(v + f for v, f in zip(command.motion.velocity, command.feedback_velocity, strict=True))
        assert speed_use(sent, LIMITS) <= 1.0 + 1e-6


def test_braking_lets_the_feedback_fade():
    """Nobody corrects any more: what was added for the planner's target must not go on pushing."""
    wanted = Reference(Motion((0.0, 0.0, -3.0), ZERO, ZERO), Heading(0.0, 0.0), ZERO, (0.6, -0.3, 0.0))
    command = chase(lambda _: wanted, seconds=2.0)[-1][0]
    for _ in range(round(2.0 / 0.02)):
        command = brake(command, 0.02, LIMITS)
    assert command.feedback_velocity == pytest.approx(ZERO)


def test_the_heading_feedback_is_bounded_and_never_jumps():
    steps = np.random.default_rng(3).uniform(-2.0, 2.0, 200)

    def wanted(t):
        return Reference(
            Motion((0.0, 0.0, -3.0), ZERO, ZERO), Heading(0.0, 0.0), ZERO, feedback_yaw=float(steps[int(t / 0.1)])
        )

    turns = [command.feedback_yaw for command, _ in chase(wanted, seconds=10.0)]
    assert max(map(abs, turns)) == pytest.approx(PARAMETERS.feedback_yaw_max)
    assert max(map(abs, np.diff([0.0, *turns]))) <= PARAMETERS.feedback_yaw_slew * 0.02 + 1e-9


def test_braking_lets_the_heading_feedback_fade():
    wanted = Reference(Motion((0.0, 0.0, -3.0), ZERO, ZERO), Heading(0.0, 0.0), ZERO, feedback_yaw=0.3)
    command = chase(lambda _: wanted, seconds=2.0)[-1][0]
    assert command.feedback_yaw == pytest.approx(0.3)
    for _ in range(round(2.0 / 0.02)):
        before, command = command, brake(command, 0.02, LIMITS)
        assert 0.0 <= before.feedback_yaw - command.feedback_yaw <= 0.2 * LIMITS.yaw_rate * 0.02 + 1e-12
    assert command.feedback_yaw == 0.0


@given(v=speeds, feedback=vectors(0.8), lead=vectors(1.0))
@settings(max_examples=300, deadline=None)
def test_the_position_sent_never_makes_the_autopilot_fly_faster_than_the_limit(v, feedback, lead):
    feedback = tuple(np.subtract(clamp_speed(tuple(np.add(v, feedback)), LIMITS), v))
    here, place = (5.0, -2.0, -3.0), tuple(np.add((5.0, -2.0, -3.0), lead))
    command = hold_here(place, 0.0, LIMITS)._replace(motion=Motion(place, v, ZERO), feedback_velocity=feedback)
    gain = np.array(PARAMETERS.autopilot_position_gain)[[0, 0, 1]]
    sent = np.array(leading_position(command, here, LIMITS, PARAMETERS)) - here
    flown, wanted = np.add(v, feedback) + gain * sent, np.add(v, feedback) + gain * lead
    reserve = PARAMETERS.speed_reserve
    most, up, down = LIMITS.speed_horizontal + reserve, LIMITS.speed_up + reserve, LIMITS.speed_down + reserve
    assert math.hypot(*flown[:2]) <= most + 1e-6
    assert -up - 1e-6 <= flown[2] <= down + 1e-6
    # towards the place, no farther, and as far as the limit lets it
    assert sent[0] * lead[1] - sent[1] * lead[0] == pytest.approx(0.0, abs=1e-9)
    assert (np.array(sent) * np.sign(lead) + 1e-9 >= 0.0).all()
    assert (np.abs(sent) <= np.abs(lead) + 1e-9).all()
    if math.hypot(*wanted[:2]) > most:
        assert math.hypot(*flown[:2]) == pytest.approx(most)
    elif -up <= wanted[2] <= down:
        assert leading_position(command, here, LIMITS, PARAMETERS) == place


@given(yaw=st.floats(-3.1, 3.1), here=st.floats(-3.1, 3.1), rate=st.floats(-1.0, 1.0), feedback=st.floats(-0.4, 0.4))
@settings(max_examples=200, deadline=None)
def test_the_heading_sent_never_makes_the_autopilot_turn_faster_than_the_limit(yaw, here, rate, feedback):
    command = hold_here(ZERO, yaw, LIMITS)._replace(heading=Heading(yaw, rate * LIMITS.yaw_rate), feedback_yaw=feedback)
    sent = leading_yaw(command, here, LIMITS, PARAMETERS)
    lead = wrap_angle(sent - here)
    turning = command.heading.rate + PARAMETERS.autopilot_heading_gain * lead
    assert abs(turning) <= LIMITS.yaw_rate * (1 + 1e-6)
    wanted = wrap_angle(yaw + feedback - here)
    if abs(command.heading.rate + PARAMETERS.autopilot_heading_gain * wanted) <= LIMITS.yaw_rate:
        assert sent == pytest.approx(wrap_angle(yaw + feedback), abs=1e-9)
