"""A free-flyer in memory, driven by attitude and body thrust, for the tests."""

from dataclasses import replace
from typing import Any

import numpy as np
from stub_vehicle_support import BareWorld, Client

from companion.link.attitude_target import AttitudeTarget
from companion.messages.thrust import AttitudeThrust
from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.vehicle.spacecraft.config import FreeFlyerBodyParameters, FreeFlyerConfig

OFFBOARD, LOITER, POSCTL = 6 << 16, 4 << 16 | 3 << 24, 3 << 16
RATES_IGNORE, THRUST_BODY, ATTITUDE_IGNORE = 7, 32, 128
MOTION = {
    "film_drag_n_per_mps": 0.0,
    "film_turn_drag_nm_per_radps": 0.0,
    "air_drag_n_per_mps2": 0.0,
    "floor_slope_deg": 0.0,
    "pressure_drop": 0.0,
    "mass_centre_offset_m": (0.0, 0.0, 0.0),
}


def free_flyer(*, wander: bool = False, **body: Any) -> FreeFlyerConfig:
    config = load_vehicle("free_flyer")
    assert isinstance(config, FreeFlyerConfig)
    config = replace(config, body=replace(config.body, **body))
    return config if wander else replace(config, estimator=replace(config.estimator, enabled=False))


def body_parameters(**changed: Any) -> FreeFlyerBodyParameters:
    return free_flyer(**changed).body


def attitude_target(
    mask: int,
    yaw: float,
    thrust_body: tuple[float, float, float],
    rates: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> AttitudeTarget:
    """Give the companion's message with any mask and turn rates [rad/s]: it never sends others than its own."""
    message = AttitudeTarget(AttitudeThrust(t=0.0, yaw=yaw, thrust_body=np.array(thrust_body)), 1, 1, 0)
    message.type_mask = mask
    message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate = rates
    return message


class Pilot(Client):
    """A companion that sends attitude and body thrust 50 times a second."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation)
        self.target: AttitudeTarget | None = None

    def run(self, duration: float, until=None) -> float:
        begin = self.simulation.t
        while self.simulation.t < begin + duration - 1e-9:
            if self.target is not None:
                self.send(self.target)
            super().run(0.02, until)
            if until is not None and until():
                break
        return self.simulation.t - begin

    def push(self, yaw: float, forward: float, right: float = 0.0) -> None:
        self.target = attitude_target(RATES_IGNORE | THRUST_BODY, yaw, (forward, right, 0.0))

    @property
    def inner(self):
        return self.simulation.autopilot

    @property
    def mode_word(self) -> int:
        return self.inner.commander.mode.custom_mode


def start(seed: int = 1, *, config: FreeFlyerConfig | None = None) -> Pilot:
    pilot = Pilot(Simulation(BareWorld(), config or free_flyer(), seed))
    pilot.run(0.3)
    return pilot


def offboard(**options: Any) -> Pilot:
    """Arm in OFFBOARD without thrust, facing as it stands."""
    pilot = start(**options)
    pilot.push(pilot.simulation.body.heading, 0.0)
    pilot.run(0.3)
    assert pilot.mode(6) == [0, 0]
    assert pilot.arm() == [0]
    return pilot
