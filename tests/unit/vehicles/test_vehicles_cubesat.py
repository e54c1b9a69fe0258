"""The CubeSat's limits fit its nozzles and its size."""

import numpy as np

from companion.control.rigid_body.allocation import NozzleAllocator
from companion.control.rigid_body.nozzles import effectiveness
from companion.vehicles.cubesat import CubeSat
from companion.vehicles.free_flyer import FreeFlyer
from companion.vehicles.multicopter import SetpointForm


def test_it_flies_on_nozzle_on_times():
    assert CubeSat().setpoint_form is SetpointForm.NOZZLE_ON_TIMES
    assert FreeFlyer().setpoint_form is not CubeSat().setpoint_form


def test_it_stops_within_a_quarter_of_its_side():
    p = CubeSat().parameters
    assert p.approach_speed**2 / (2.0 * p.acceleration) <= 0.025 + 1e-12
    assert CubeSat().closing_speed <= p.reorient_speed <= p.approach_speed


def test_planned_accelerations_leave_thrust_over_in_every_direction_while_it_starts_to_turn():
    p = CubeSat().parameters
    control = p.control
    effect = effectiveness(control.nozzle_places, control.nozzle_directions, control.thrust)
    allocator = NozzleAllocator(effect, control.period)
    rng = np.random.default_rng(1)
    for _ in range(200):
        direction = rng.normal(size=3)
        force = 1.5 * control.mass * p.acceleration * control.period * direction / np.linalg.norm(direction)
        axis = rng.normal(size=3)
        torque = 1e-4 * control.period * axis / np.linalg.norm(axis)
        given = allocator.allocate(np.concatenate([force, torque]))
        assert given.share == given.torque_share == 1.0


def test_a_turn_starts_within_a_second():
    control = CubeSat().parameters.control
    effect = effectiveness(control.nozzle_places, control.nozzle_directions, control.thrust)
    allocator = NozzleAllocator(effect, 1.0)
    for inertia, axis in zip(control.inertia, np.eye(3), strict=True):
        given = allocator.allocate(np.concatenate([np.zeros(3), inertia * CubeSat().turn_rate * axis]))
        assert given.torque_share == 1.0
