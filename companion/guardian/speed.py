"""What the autopilot flies on top of the velocity that is sent, kept near the speed limits.

To that velocity it adds its gain times the error of position, so a command whose own velocity keeps the limit may be
flown much faster. `GuardianParameters.speed_reserve` is what is granted above the limits.
"""

from __future__ import annotations

import math

from companion.guardian.limiter import Command
from companion.guardian.motion import Vector, add
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
