"""How far the position and the heading that are sent may lead the vehicle.

To the velocity that is sent the autopilot adds its gain times the error of position, and likewise to the yaw rate: a
command whose own rates keep the limits may be flown much faster. `GuardianParameters.speed_reserve` is what is granted
above the speed limits.
"""

from __future__ import annotations

import math

from companion.geometry.angles import wrap_angle
from companion.guardian.limiter import Command
from companion.guardian.motion import TOLERANCE, Vector, add
from companion.guardian.parameters import GuardianParameters
from companion.messages.motion import MotionLimits


def leading_position(command: Command, here: Vector, limits: MotionLimits, parameters: GuardianParameters) -> Vector:
    """Give the position [m] to send: the command's, ahead of the vehicle's by no more than is safe.

    The autopilot flies at the velocity that is sent plus its gain times the position error. The sum keeps the speed
    limits with `speed_reserve` on top, horizontally, upwards and downwards: what moves at the limit can still take
    out an error, its own velocity's among them. A lead that needs no limit is sent as it is.

    Args:
        command: with the velocity that is sent, feedback included.
        here: position of the vehicle [m], ned.
        limits: of the vehicle.
        parameters: of the guardian.
    """
    position, velocity = command.motion.position, add(command.motion.velocity, command.feedback_velocity)
    lead = add(position, here, -1.0)
    level, vertical = parameters.autopilot_position_gain
    pull = level * lead[0], level * lead[1], vertical * lead[2]
    reserve = parameters.speed_reserve
    share = _share_within(velocity, pull, limits.speed_horizontal + reserve)
    least, most = (
        min(0.0, -limits.speed_up - reserve - velocity[2]),
        max(0.0, limits.speed_down + reserve - velocity[2]),
    )
    if share == 1.0 and least <= pull[2] <= most:
        return position
    return (
        here[0] + share * lead[0],
        here[1] + share * lead[1],
        here[2] + max(least, min(most, pull[2])) / vertical,
    )


def leading_yaw(command: Command, here: float, limits: MotionLimits, parameters: GuardianParameters) -> float:
    """Give the heading [rad] to send: the command's with feedback, ahead of the vehicle's by no more than is safe.

    The autopilot turns at the rate that is sent plus its gain times the heading error; the sum keeps the limit.

    Args:
        command: with the rate that is sent.
        here: heading of the vehicle [rad].
        limits: of the vehicle.
        parameters: of the guardian.
    """
    lead = wrap_angle(command.heading.yaw + command.feedback_yaw - here)
    room, rate, gain = limits.yaw_rate * TOLERANCE, command.heading.rate, parameters.autopilot_heading_gain
    least, most = (-room - rate) / gain, (room - rate) / gain
    return wrap_angle(here + max(least, min(most, lead)))


def _share_within(base: Vector, more: Vector, limit: float) -> float:
    """Give the largest share s in [0, 1] with |base + s more| <= limit horizontally; of a base beyond it, none."""
    if math.hypot(base[0] + more[0], base[1] + more[1]) <= limit:
        return 1.0
    size = more[0] ** 2 + more[1] ** 2
    along = base[0] * more[0] + base[1] * more[1]
    room = limit * limit - base[0] ** 2 - base[1] ** 2
    if room < 0.0 or size == 0.0:
        return 0.0
    return min(1.0, (math.sqrt(along * along + size * room) - along) / size)
