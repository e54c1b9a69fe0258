"""Feedback gains from the model: a linear-quadratic regulator of one axis.

The vehicle is a double integrator that is commanded once in a pulse period T:

    x = [position error, velocity error],    A = [[1, T], [0, 1]],    B = [T^2/2, T]

The gain K of u = -K x minimises the sum of x' Q x + R u^2 (Anderson & Moore, Optimal Control: Linear Quadratic Methods,
1990, section 2.4). The Riccati equation is iterated until it stands.
"""

from __future__ import annotations

import numpy as np

from companion.control.free_flyer.parameters import FreeFlyerControlParameters

_ITERATIONS = 5000
_STANDS = 1e-12  # relative change of the gain


def feedback_gains(parameters: FreeFlyerControlParameters) -> tuple[float, float]:
    """Give the gains on the error of position [1/s^2] and of velocity [1/s]."""
    period = parameters.pulse_period
    a = np.array([[1.0, period], [0.0, 1.0]])
    b = np.array([[0.5 * period * period], [period]])
    q = np.diag([parameters.position_scale**-2, parameters.velocity_scale**-2])
    r = parameters.acceleration_scale**-2
    p, gain = q, np.zeros((1, 2))
    for _ in range(_ITERATIONS):
        before = gain
        gain = (b.T @ p @ a) / (r + float((b.T @ p @ b)[0, 0]))
        p = q + a.T @ p @ (a - b @ gain)
        if float(np.abs(gain - before).max()) < _STANDS * float(np.abs(gain).max()):
            break
    return float(gain[0, 0]), float(gain[0, 1])
