"""Control allocation of a spacecraft: thrust and yaw torque to the duties of its thrusters, as PX4 does it.

PX4 inverts the effectiveness of all actuators (pseudo-inverse), scales each column so that a unit setpoint opens the
thrusters it needs fully, and cuts what is below 0 or above 1 (ControlAllocationPseudoInverse.cpp with CA_METHOD 0,
ActuatorEffectivenessSpacecraft.cpp). Thrusters that push against each other along one line share its command by sign,
so within the limits what comes out is what was asked for. Only the plane's axes are modelled: CA_ROTORn_KM must be 0.
"""

from collections.abc import Mapping

import numpy as np

from sitl_stub.vehicle.spacecraft.thrusters import COUNT

SMALL = 1e-3
"""PX4 sets smaller entries of the mix to zero."""


class Allocation:
    """The mix for one set of CA_ROTORn parameters."""

    __slots__ = ("_mix",)

    def __init__(self, parameters: Mapping[str, float]) -> None:
        effectiveness = np.array([_effect(parameters, i) for i in range(COUNT)]).T
        mix = np.linalg.pinv(effectiveness)
        scales = (_mean_size(mix[:, 0]), _mean_size(mix[:, 1]), float(mix[:, 2].max()))
        scaled = mix / [scale if scale > 0.0 else 1.0 for scale in scales]
        scaled[np.abs(scaled) < SMALL] = 0.0
        self._mix = [(float(row[0]), float(row[1]), float(row[2])) for row in scaled]

    def duties(self, forward: float, right: float, yaw: float) -> list[float]:
        """Duties 0 to 1 of the thrusters for normalised thrust forward and right and normalised yaw torque."""
        return [min(max(a * forward + b * right + c * yaw, 0.0), 1.0) for a, b, c in self._mix]


def _effect(parameters: Mapping[str, float], i: int) -> tuple[float, float, float]:
    """Force forward and right and yaw torque of one thruster."""
    strength = parameters[f"CA_ROTOR{i}_CT"]
    fx, fy = strength * parameters[f"CA_ROTOR{i}_AX"], strength * parameters[f"CA_ROTOR{i}_AY"]
    return fx, fy, parameters[f"CA_ROTOR{i}_PX"] * fy - parameters[f"CA_ROTOR{i}_PY"] * fx


def _mean_size(column: np.ndarray) -> float:
    """Mean size of the entries that are not zero."""
    sizes = np.abs(column)
    used = sizes > 1e-7
    return float(sizes[used].mean()) if used.any() else 0.0
