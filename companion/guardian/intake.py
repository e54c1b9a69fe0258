"""What the guardian accepts of what it is given: finite, plausible, in time, of the same estimate."""

from __future__ import annotations

from companion.guardian.limiter import Reference, Target
from companion.guardian.motion import Heading, Motion, Vector
from companion.guardian.parameters import GuardianParameters
from companion.messages.motion import Trajectory
from companion.messages.ownship import OwnshipState
from companion.messages.target import TargetPose

_LARGEST = 1e6  # in any unit: nothing that flies here is further or faster
_FUTURE = 0.1  # [s] by which a stamp may be ahead of the tick
_TARGET_AGE = 1.0  # [s] by which a target's pose may be away from the tick


def plausible(numbers: list[float]) -> bool:
    """Say whether all numbers are finite and not absurd."""
    return all(-_LARGEST < number < _LARGEST for number in numbers)


def vector(values: list[float]) -> Vector:
    """Take three numbers."""
    return values[0], values[1], values[2]


def newest_ownship(known: OwnshipState | None, given: OwnshipState | None, t: float) -> OwnshipState | None:
    """Give the newer of two own states; one that is not finite, from the future or out of order is passed over."""
    if given is None or given is known:
        return known
    numbers = [given.t - t, *given.position_ned.tolist(), *given.velocity_ned.tolist(), given.yaw]
    if not plausible(numbers) or given.t > t + _FUTURE:
        return known
    return known if known is not None and given.t < known.t else given


def reference_from(
    trajectory: Trajectory | None, t: float, reset_counter: int, parameters: GuardianParameters
) -> tuple[Reference | None, str]:
    """Give what a trajectory wants at `t` [s], or why it cannot be followed."""
    if trajectory is None:
        return None, "the planner has given no trajectory"
    if trajectory.reset_counter != reset_counter:
        return None, f"the trajectory belongs to estimate {trajectory.reset_counter}, now it is {reset_counter}"
    if not t <= trajectory.t_expiry:
        return None, f"the trajectory expired {t - trajectory.t_expiry:.2f} s ago"
    if not t >= trajectory.t_start - parameters.trajectory_early:
        return None, f"the trajectory begins only in {trajectory.t_start - t:.2f} s"
    try:
        state = trajectory.at(t)
    except (ArithmeticError, ValueError) as error:
        return None, f"the trajectory cannot be evaluated: {error}"
    position, velocity = state.position_ned.tolist(), state.velocity_ned.tolist()
    acceleration = state.acceleration_ned.tolist()
    feedback_velocity = state.feedback_velocity_ned.tolist()
    feedback_acceleration = state.feedback_acceleration_ned.tolist()
    numbers = [*position, *velocity, *acceleration, *feedback_velocity, *feedback_acceleration]
    if not plausible([*numbers, state.yaw, state.yaw_rate, state.feedback_yaw]):
        return None, "the trajectory is not finite, or absurd"
    return Reference(
        Motion(vector(position), vector(velocity), vector(acceleration)),
        Heading(state.yaw, state.yaw_rate),
        vector(feedback_acceleration),
        vector(feedback_velocity),
        state.feedback_yaw,
    ), "following the trajectory"


def target_now(target: TargetPose | None, t: float) -> Target | None:
    """Give the target at `t` [s], moved on at its velocity; None where it is unknown, too old or not finite."""
    if target is None or not abs(t - target.t) <= _TARGET_AGE:
        return None
    position, velocity = target.position_ned.tolist(), target.velocity_ned.tolist()
    if not plausible([*position, *velocity]):
        return None
    later = t - target.t
    moved = [x + later * v for x, v in zip(position, velocity, strict=True)]
    return Target(vector(moved), vector(velocity))
