"""From a wanted reference to a command that never steps beyond the limits.

Run-time assurance: in each tick a candidate for the next command is proposed, the reference itself where it can be
reached, otherwise a step of a tracking law. It is taken only if, from there, the stop of `stop.py` stays inside the
speed and acceleration limits and the fence. Otherwise the stop of the last command that was taken is followed one
tick further, which by induction is inside. So velocity, acceleration and jerk of the command are bounded whatever
the reference does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from companion.geometry.angles import wrap_angle
from companion.guardian.fence import Fence
from companion.guardian.motion import (
    TOLERANCE,
    Heading,
    Motion,
    Vector,
    acceleration_use,
    add,
    clamp_acceleration,
    clamp_speed,
    largest,
    scale,
    speed_use,
)
from companion.guardian.parameters import GuardianParameters
from companion.guardian.stop import Stop, hull, plan_stop, stop_at
from companion.messages.motion import MotionLimits

_REST: Vector = (0.0, 0.0, 0.0)


class Command(NamedTuple):
    """What is commanded now, and the stop that is at hand."""

    motion: Motion  # its acceleration is the rate of its velocity
    heading: Heading
    stop: Stop  # planned from the last command that was taken
    stop_elapsed: float  # [s] followed of it so far
    acceleration: Vector  # [m/s^2] sent: the motion's, with the planner's feedback
    feedback_velocity: Vector = _REST  # [m/s] sent on top of the motion's velocity
    feedback_yaw: float = 0.0  # [rad] sent on top of the heading


class Reference(NamedTuple):
    """What the planner wants now."""

    motion: Motion  # its acceleration is the rate of its velocity
    heading: Heading
    feedback: Vector  # [m/s^2] to be added to the acceleration that is sent, not to the motion
    feedback_velocity: Vector = _REST  # [m/s] likewise to the velocity: the bias of the autopilot's estimate
    feedback_yaw: float = 0.0  # [rad] likewise to the heading


class Target(NamedTuple):
    """Where the target is now."""

    position: Vector  # [m] ned
    velocity: Vector  # [m/s] ned


def hold_here(position: Vector, yaw: float, limits: MotionLimits) -> Command:
    """Command to stay at a place."""
    motion = Motion(position, _REST, _REST)
    return Command(motion, Heading(yaw, 0.0), plan_stop(motion, limits), 0.0, _REST)


def brake(command: Command, dt: float, limits: MotionLimits) -> Command:
    """Follow the stop at hand for `dt` [s], stop turning, and let the planner's feedback fade."""
    elapsed = command.stop_elapsed + dt
    heading = _steer_heading(command.heading, None, dt, limits)
    motion = stop_at(command.stop, elapsed)
    acceleration = _slew(command.acceleration, motion.acceleration, limits.jerk * dt)
    feedback = _slew(command.feedback_velocity, _REST, 0.5 * limits.acceleration_horizontal * dt)
    step = 0.2 * limits.yaw_rate * dt
    turn = max(command.feedback_yaw - step, min(command.feedback_yaw + step, 0.0))
    return Command(motion, heading, command.stop, elapsed, acceleration, feedback, turn)


def follow(
    command: Command,
    reference: Reference,
    here: Vector,
    target: Target | None,
    dt: float,
    limits: MotionLimits,
    parameters: GuardianParameters,
) -> tuple[Command, tuple[str, ...]]:
    """Move the command towards the reference for `dt` [s].

    Args:
        command: the last one.
        reference: what is wanted now.
        here: the vehicle's position now [m], ned.
        target: for the closing speed; None where there is none.
        dt: since the last command [s], positive.
        limits: of the vehicle.
        parameters: of the guardian.

    Returns:
        The new command, and the names of the limits that changed the reference.
    """
    wanted, clips = _bound(reference.motion, command.motion, here, target, limits, parameters)
    heading = _steer_heading(command.heading, reference.heading, dt, limits)
    if abs(wrap_angle(heading.yaw - reference.heading.yaw)) > 1e-3:
        clips.append("yaw_rate")
    candidate = wanted
    if not _reachable(command.motion, wanted, dt, limits, parameters.position_step):
        clips.append("jerk")
        candidate = _steer(command.motion, wanted, target, dt, limits, parameters)
    stop = plan_stop(candidate, limits)
    elapsed = 0.0
    if not _viable(command.motion, candidate, stop, limits, parameters.fence):
        clips.append("braking")
        stop, elapsed = command.stop, command.stop_elapsed + dt
        candidate = stop_at(stop, elapsed)
    sent = clamp_acceleration(add(candidate.acceleration, reference.feedback), limits)
    sent = _slew(command.acceleration, sent, limits.jerk * dt)
    bias = _slew(
        command.feedback_velocity,
        _within(reference.feedback_velocity, parameters.feedback_velocity_max),
        limits.acceleration_horizontal * dt,
    )
    bias = add(clamp_speed(add(candidate.velocity, bias), limits), candidate.velocity, -1.0)
    step = parameters.feedback_yaw_slew * dt
    turn = max(-parameters.feedback_yaw_max, min(parameters.feedback_yaw_max, reference.feedback_yaw))
    turn = max(command.feedback_yaw - step, min(command.feedback_yaw + step, turn))
    return Command(candidate, heading, stop, elapsed, sent, bias, turn), tuple(clips)


def keep_near(command: Command, here: Vector, parameters: GuardianParameters) -> tuple[Command, bool]:
    """Shift the command's position onto the leash around the vehicle, and into the fence where the vehicle is inside.

    Velocity and acceleration stay: on the ground a commanded descent must go on for the land detection.
    """
    position = command.motion.position
    near = on_leash(position, here, parameters)
    if parameters.fence.excess(here) <= 0.0:
        near = parameters.fence.clamp(near)
    if near == position:
        return command, False
    return shifted(command, add(near, position, -1.0)), True


def shifted(command: Command, offset: Vector, turn: float = 0.0) -> Command:
    """Move the whole command by an offset [m] and turn its heading [rad], as an estimator reset does."""
    start = command.stop.start._replace(position=add(command.stop.start.position, offset))
    return Command(
        command.motion._replace(position=add(command.motion.position, offset)),
        Heading(wrap_angle(command.heading.yaw + turn), command.heading.rate),
        command.stop._replace(
            start=start,
            released_position=add(command.stop.released_position, offset),
            end=add(command.stop.end, offset),
        ),
        command.stop_elapsed,
        command.acceleration,
        command.feedback_velocity,
        command.feedback_yaw,
    )


def on_leash(position: Vector, here: Vector, parameters: GuardianParameters) -> Vector:
    """Bring a position [m] within the leash of the vehicle's."""
    north, east, down = add(position, here, -1.0)
    distance = math.hypot(north, east)
    factor = parameters.leash_horizontal / distance if distance > parameters.leash_horizontal else 1.0
    vertical = parameters.leash_vertical
    if factor == 1.0 and -vertical <= down <= vertical:
        return position
    return here[0] + factor * north, here[1] + factor * east, here[2] + max(-vertical, min(vertical, down))


def _bound(
    motion: Motion,
    now: Motion,
    here: Vector,
    target: Target | None,
    limits: MotionLimits,
    parameters: GuardianParameters,
) -> tuple[Motion, list[str]]:
    """Bring a reference inside leash, fence, speed, acceleration and closing speed."""
    clips = []
    position, velocity, acceleration = motion
    near = on_leash(position, here, parameters)
    if near != position:
        clips.append("leash")
    inside = parameters.fence.clamp(near, parameters.fence.margin)
    if largest(add(inside, near, -1.0)) > 1e-9:
        clips.append("fence")
        velocity, acceleration = _REST, _REST
    if speed_use(velocity, limits) > TOLERANCE:
        clips.append("speed")
        velocity, acceleration = clamp_speed(velocity, limits), _REST
    if acceleration_use(acceleration, limits) > TOLERANCE:
        clips.append("acceleration")
        acceleration = clamp_acceleration(acceleration, limits)
    slower = _limit_closing(velocity, now.position, target, parameters)
    if slower is not velocity:
        clips.append("closing_speed")
        velocity, acceleration = clamp_speed(slower, limits), _REST
    return Motion(inside, velocity, acceleration), clips


def _limit_closing(velocity: Vector, position: Vector, target: Target | None, parameters: GuardianParameters) -> Vector:
    """Take away what of a velocity [m/s] closes in on the target too fast; the same object where nothing does."""
    if target is None:
        return velocity
    gap = add(target.position, position, -1.0)
    distance = math.sqrt(gap[0] ** 2 + gap[1] ** 2 + gap[2] ** 2)
    if distance < parameters.closing_range:
        return velocity
    towards = scale(gap, 1.0 / distance)
    relative = add(velocity, target.velocity, -1.0)
    closing = relative[0] * towards[0] + relative[1] * towards[1] + relative[2] * towards[2]
    if closing <= parameters.closing_speed * TOLERANCE:
        return velocity
    return add(velocity, towards, parameters.closing_speed - closing)


def _reachable(now: Motion, wanted: Motion, dt: float, limits: MotionLimits, position_step: float) -> bool:
    """Say whether the command may become `wanted` within `dt` [s] without a step in jerk, acceleration or place."""
    if largest(add(wanted.acceleration, now.acceleration, -1.0)) > limits.jerk * dt * TOLERANCE:
        return False
    if acceleration_use(scale(add(wanted.velocity, now.velocity, -1.0), 1.0 / dt), limits) > TOLERANCE:
        return False
    moved = scale(add(wanted.velocity, now.velocity), 0.5 * dt)
    return largest(add(add(wanted.position, now.position, -1.0), moved, -1.0)) <= position_step


def _steer(
    now: Motion,
    wanted: Motion,
    target: Target | None,
    dt: float,
    limits: MotionLimits,
    parameters: GuardianParameters,
) -> Motion:
    """Take one step of the tracking law, with the jerk constant over `dt` [s].

    With e the position error, the velocity wanted is v_r + e min(k, sqrt(2 a / |e|)); with u the error of the
    velocity to that, the acceleration wanted is a_r + u min(k_v, sqrt(2 j / |u|)). The square roots leave room to
    take speed and acceleration back in time when the errors are large.
    """
    position_gain, velocity_gain = parameters.position_gain, 4.0 * parameters.position_gain
    error = add(wanted.position, now.position, -1.0)
    distance = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
    softest = 0.5 * min(limits.acceleration_horizontal, limits.acceleration_vertical)
    if position_gain * position_gain * distance > 2.0 * softest:
        position_gain = math.sqrt(2.0 * softest / distance)
    velocity = clamp_speed(add(wanted.velocity, error, position_gain), limits)
    velocity = clamp_speed(_limit_closing(velocity, now.position, target, parameters), limits)
    lacking = add(velocity, now.velocity, -1.0)
    size = math.sqrt(lacking[0] ** 2 + lacking[1] ** 2 + lacking[2] ** 2)
    if velocity_gain * velocity_gain * size > 1.4 * limits.jerk:
        velocity_gain = math.sqrt(1.4 * limits.jerk / size)
    acceleration = clamp_acceleration(add(wanted.acceleration, lacking, velocity_gain), limits)
    acceleration = _slew(now.acceleration, acceleration, limits.jerk * dt)
    return Motion(
        add(
            add(now.position, now.velocity, dt),
            add(scale(now.acceleration, 2.0), acceleration),
            dt * dt / 6.0,
        ),
        add(now.velocity, add(now.acceleration, acceleration), 0.5 * dt),
        acceleration,
    )


def _slew(now: Vector, wanted: Vector, step: float) -> Vector:
    """Move straight from one vector towards another, no component by more than `step`."""
    change = add(wanted, now, -1.0)
    size = largest(change)
    return wanted if size <= step else add(now, change, step / size)


def _within(vector: Vector, limit: float) -> Vector:
    """Bring every component within +-limit."""
    north, east, down = (max(-limit, min(limit, x)) for x in vector)
    return north, east, down


def _viable(now: Motion, candidate: Motion, stop: Stop, limits: MotionLimits, fence: Fence) -> bool:
    """Say whether the candidate and the stop from it stay inside the limits and do not go further out of the fence."""
    if speed_use(candidate.velocity, limits) > TOLERANCE or speed_use(stop.released_velocity, limits) > TOLERANCE:
        return False
    allowed = max(fence.excess(now.position, fence.margin), 0.0) + 1e-9
    if fence.excess(candidate.position, fence.margin) > allowed:
        return False
    return all(fence.excess(point, fence.margin) <= allowed for point in hull(stop))


def _steer_heading(now: Heading, wanted: Heading | None, dt: float, limits: MotionLimits) -> Heading:
    """Turn towards a heading, or to a stop where none is wanted, within rate and acceleration."""
    step = limits.yaw_acceleration * dt
    rate = 0.0
    if wanted is not None:
        error = wrap_angle(wanted.yaw - now.yaw)
        exact = max(-limits.yaw_rate, min(limits.yaw_rate, wanted.rate))
        if abs(exact - now.rate) <= step * TOLERANCE and abs(error - 0.5 * (now.rate + exact) * dt) <= 1e-3:
            return Heading(wrap_angle(wanted.yaw), exact)
        pull = min(2.0 * abs(error), math.sqrt(limits.yaw_acceleration * abs(error)))
        rate = max(-limits.yaw_rate, min(limits.yaw_rate, exact + math.copysign(pull, error)))
    rate = max(now.rate - step, min(now.rate + step, rate))
    return Heading(wrap_angle(now.yaw + 0.5 * (now.rate + rate) * dt), rate)
