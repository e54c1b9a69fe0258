"""Rows of the estimate: how far it wanders from the truth, how slowly, and how the vehicle follows it."""

from collections.abc import Iterator, Sequence

import numpy as np

from sitl_stub.fidelity import motion
from sitl_stub.fidelity.flight import Array, Flight
from sitl_stub.fidelity.row import Row, factor

LIMIT = 1.5
INTERVAL = 0.04
AXES = ("north", "east", "down")

POSITION_STD = (0.09, 0.19, 0.32)
"""Estimate minus truth, median of 17 flights of PX4 [m] (figures.json)."""
CORRELATION = (4.2, 3.7, 5.6)
"""Lag [s] at which that error's autocorrelation has fallen to 1/e: median of the same flights, by this measure."""
VELOCITY_STD = (0.116, 0.282, 0.211)
"""Velocity error [m/s], q01."""
ESTIMATE_STD = (0.128, 0.316, 0.172)
"""Estimate about its mean [m]: how well the controller holds what it believes, q01."""
TRUTH_STD = (0.209, 0.492, 0.597)
"""Truth about its mean [m], q01."""


def wander(flights: Sequence[Flight], begin: float, end: float) -> Iterator[Row]:
    """Compare hovering flights between two times [s]: the median over `flights` beside PX4's figures."""
    measured = [_measures(flight, begin, end) for flight in flights]
    kinds = (
        ("estimate minus truth, std", "m", POSITION_STD),
        ("estimate minus truth, correlation time", "s", CORRELATION),
        ("velocity error, std", "m/s", VELOCITY_STD),
        ("estimate about its mean, std", "m", ESTIMATE_STD),
        ("truth about its mean, std", "m", TRUTH_STD),
    )
    for kind, (words, unit, px4) in enumerate(kinds):
        for axis in range(3):
            stub = float(np.median([measures[kind][axis] for measures in measured]))
            yield factor(f"hover: {words}, {AXES[axis]} [{unit}]", stub, px4[axis], LIMIT)


def _measures(flight: Flight, begin: float, end: float) -> tuple[Array, ...]:
    truth, estimate = flight.truth.between(begin, end), flight.estimate.between(begin, end)
    t = np.arange(max(truth.t[0], estimate.t[0]), min(truth.t[-1], estimate.t[-1]), INTERVAL)
    at = motion.signal_at(truth.t, truth.position, t)
    believed = motion.signal_at(estimate.t, estimate.position, t)
    error = believed - at
    velocity_error = motion.signal_at(estimate.t, estimate.velocity, t) - motion.signal_at(truth.t, truth.velocity, t)
    correlation = np.array([motion.correlation_time(t, error[:, axis]) for axis in range(3)])
    return (
        error.std(axis=0),
        correlation,
        velocity_error.std(axis=0),
        believed.std(axis=0),
        at.std(axis=0),
    )
