"""Eight cold-gas thrusters that are open or shut, driven by pulses.

Once in every period, at its beginning, the timer takes over the wanted duty of each valve (a hardware timer preloads
its compare register) and opens the valve for that share of the period. An opening below the least on-time is not made.
The thrust follows the valve with a first-order lag, so that its impulse is thrust times on-time, exactly:

    time_constant dc/dt = open - c,    force = thrust (1 - pressure_drop (others open)) c
"""

import math

from sitl_stub.vehicle.spacecraft.config import FreeFlyerBodyParameters

COUNT = 8
SHUT = (0.0,) * COUNT
# PX4's ATMOS airframe (70000_atmos): corner in units of the lever, (forward, right), and direction of the force.
PLACES = (
    ((-1.0, -1.0), (1.0, 0.0)),
    ((1.0, -1.0), (-1.0, 0.0)),
    ((-1.0, 1.0), (1.0, 0.0)),
    ((1.0, 1.0), (-1.0, 0.0)),
    ((1.0, -1.0), (0.0, 1.0)),
    ((1.0, 1.0), (0.0, -1.0)),
    ((-1.0, -1.0), (0.0, 1.0)),
    ((-1.0, 1.0), (0.0, -1.0)),
)


class Thrusters:
    """State of the valves and of the thrust behind them."""

    __slots__ = ("_arms", "_body", "_elapsed", "_flow", "_on_time", "openings")

    def __init__(self, body: FreeFlyerBodyParameters) -> None:
        self._body = body
        offset_forward, offset_right, _ = body.mass_centre_offset_m
        lever = body.thruster_lever_m
        # yaw torque of a unit force: forward distance times right force minus right distance times forward force
        self._arms = tuple(
            (lever * x - offset_forward) * fy - (lever * y - offset_right) * fx for (x, y), (fx, fy) in PLACES
        )
        self._elapsed = body.pulse_period_s
        self._on_time = list(SHUT)
        self._flow = list(SHUT)
        self.openings = 0
        """How often valves have opened so far."""

    def step(self, dt: float, duties: list[float]) -> tuple[float, float, float]:
        """Advance by `dt` [s] with the wanted duty, 0 to 1, of each valve.

        Returns the mean force forward and right [N] and the mean yaw torque [N m] over the step, frd.
        """
        body = self._body
        if self._elapsed >= body.pulse_period_s - 1e-9:
            self._elapsed = 0.0
            self._begin_period(duties)
        begin, end = self._elapsed, self._elapsed + dt
        self._elapsed = end
        openings = [_overlap(begin, end, on) / dt for on in self._on_time]
        loss = body.pressure_drop
        total = sum(openings)
        keep = math.exp(-dt / body.thrust_time_constant_s) if body.thrust_time_constant_s > 0.0 else 0.0
        forward = right = torque = 0.0
        for i, opening in enumerate(openings):
            before = self._flow[i]
            if opening == 0.0 and before < 1e-9:
                self._flow[i] = 0.0
                continue
            after = opening + keep * (before - opening)
            self._flow[i] = after
            # integral of the flow over the step, from the lag's equation
            mean = opening - (after - before) * body.thrust_time_constant_s / dt
            force = body.thrust_n * mean * (1.0 - loss * max(0.0, total - opening))
            fx, fy = PLACES[i][1]
            forward += force * fx
            right += force * fy
            torque += force * self._arms[i]
        return forward, right, torque

    def _begin_period(self, duties: list[float]) -> None:
        body = self._body
        for i, duty in enumerate(duties):
            on = min(max(duty, 0.0), 1.0) * body.pulse_period_s
            self._on_time[i] = on if on >= body.pulse_on_time_min_s else 0.0
            self.openings += self._on_time[i] > 0.0


def _overlap(begin: float, end: float, on: float) -> float:
    """Time [s] within begin and end in which a valve is open that opened at 0 for `on` [s]."""
    return max(0.0, min(end, on) - begin)
