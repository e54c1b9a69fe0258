"""The rigid body and the nozzles: conserved quantities, exact impulses, an analytic tumble."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation
from stub_cubesat_support import DOCKING, NONE, VEHICLE, as_designed, calm, only, wrench_per_second

from sitl_stub.cubesat.body import FreeBody
from sitl_stub.cubesat.nozzles import BuiltNozzle, Nozzles
from sitl_stub.cubesat.rotation import matrix_of
from sitl_stub.cubesat.simulation import CubesatSimulation

HERE = (0.0, 0.0, 0.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
TENSOR = ((0.0035, -0.0004, 0.0002), (-0.0004, 0.0041, 0.0003), (0.0002, 0.0003, 0.0029))
ROUND = ((0.0035, 0.0, 0.0), (0.0, 0.0035, 0.0), (0.0, 0.0, 0.0020))


def body(**changed: object) -> FreeBody:
    kept = {"mass": 2.0, "inertia": TENSOR, "mass_centre": HERE, "position": HERE, "quaternion": LEVEL}
    return FreeBody(**{**kept, **changed})  # type: ignore[arg-type]


def run(moved: FreeBody, seconds: float, h: float = 0.01, force=HERE, torque=HERE) -> FreeBody:
    for _ in range(round(seconds / h)):
        moved.step(h, force, torque)
    return moved


# the body


def test_a_free_tumble_keeps_angular_momentum_and_energy():
    tumbling = body(rate=(0.9, -0.4, 0.6), velocity=(0.01, 0.02, -0.03))
    inertia = np.array(TENSOR)

    def kept() -> tuple[np.ndarray, float]:
        momentum = inertia @ np.array(tumbling.rate)
        return np.array(matrix_of(tumbling.quaternion)) @ momentum, 0.5 * momentum @ np.array(tumbling.rate)

    momentum, energy = kept()
    run(tumbling, 60.0)
    after, energy_after = kept()
    assert after == pytest.approx(momentum, rel=1e-8)
    assert energy_after == pytest.approx(energy, rel=1e-8)
    assert tumbling.position == pytest.approx((0.6, 1.2, -1.8), abs=1e-12)
    assert math.dist(tumbling.rate, (0.9, -0.4, 0.6)) > 0.1  # the test is none for a body that merely spins


def test_a_symmetric_top_precesses_as_the_textbook_says():
    rate, across, along = np.array([0.5, 0.2, 1.1]), ROUND[0][0], ROUND[2][2]
    start = Rotation.from_rotvec([0.3, -0.5, 0.8])
    x, y, z, w = start.as_quat()
    top = body(inertia=ROUND, rate=tuple(rate), quaternion=(w, x, y, z))
    momentum = start.apply(np.diag(ROUND) * rate)
    seconds = 20.0
    run(top, seconds)
    # turns about the angular momentum, and at the same time about its own axis
    spin = Rotation.from_rotvec([0.0, 0.0, rate[2] * (1.0 - along / across) * seconds])
    expected = Rotation.from_rotvec(momentum / across * seconds) * start * spin
    assert np.array(matrix_of(top.quaternion)) == pytest.approx(expected.as_matrix(), abs=1e-8)
    assert top.rate == pytest.approx(spin.inv().apply(rate), abs=1e-8)


def test_a_force_on_a_turning_body_does_not_depend_on_the_step():
    coarse, fine = (body(rate=(0.1, 0.3, -0.2), mass_centre=(0.001, -0.002, 0.0005)) for _ in range(2))
    push = {"force": (0.02, -0.01, 0.03), "torque": (1e-4, -2e-4, 1e-4)}
    run(coarse, 4.0, 0.01, **push)
    run(fine, 4.0, 0.001, **push)
    assert coarse.position == pytest.approx(fine.position, abs=1e-10)
    assert coarse.quaternion == pytest.approx(fine.quaternion, abs=1e-10)


def test_a_residual_acceleration_is_a_parabola():
    drifting = run(body(residual_acceleration=(2e-5, 0.0, -1e-5), rate=(0.1, 0.2, 0.3)), 100.0)
    assert drifting.position == pytest.approx((0.1, 0.0, -0.05), abs=1e-12)
    assert drifting.velocity == pytest.approx((2e-3, 0.0, -1e-3), abs=1e-14)


def test_a_body_turns_about_its_centre_of_mass_and_not_about_its_middle():
    offset = (0.01, 0.0, 0.0)
    spinning = body(inertia=ROUND, mass_centre=offset, rate=(0.0, 0.0, 1.0), velocity=(0.0, -0.01, 0.0))
    run(spinning, math.pi, math.pi / 400)  # the centre of mass is at rest at (0.01, 0, 0); half a turn
    assert spinning.position == pytest.approx((0.02, 0.0, 0.0), abs=1e-9)
    assert spinning.velocity == pytest.approx((0.0, 0.01, 0.0), abs=1e-9)


# the nozzles


def test_nozzles_stand_as_an_x_on_two_faces_and_push_every_way():
    root = math.sqrt(0.91)
    expected = []
    for side in (1.0, -1.0):
        for k in range(4):
            place = math.radians(45 + 90 * k)
            push = place + math.pi + (math.pi / 2 if k % 2 == 0 else -math.pi / 2)
            corner = 0.04 * math.sqrt(2.0)
            expected.append(
                (
                    *(side * 0.05, corner * math.cos(place), corner * math.sin(place)),
                    *(-side * 0.3, root * math.cos(push), root * math.sin(push)),
                )
            )
        expected.append((side * 0.05, 0.0, 0.0, -side, 0.0, 0.0))
    found = [(*nozzle.position, *nozzle.direction) for nozzle in VEHICLE.propulsion.nozzles]
    assert np.array(found) == pytest.approx(np.array(expected), abs=1e-7)
    wrench = wrench_per_second(VEHICLE)
    assert np.linalg.matrix_rank(wrench) == 6
    for wanted in np.vstack([np.eye(6), -np.eye(6)]):
        assert nnls(wrench, wanted)[1] < 1e-9


@pytest.mark.parametrize("on_time", [0.01, 0.0237, 0.1])
@pytest.mark.parametrize("delay", [0.0, 0.003])
def test_an_opening_gives_thrust_times_on_time_after_the_delay(on_time, delay):
    vehicle = as_designed()
    vehicle = replace(vehicle, propulsion=replace(vehicle.propulsion, valve_delay=delay))
    flown = CubesatSimulation(vehicle, calm(), 1)
    flown.command(0.0, only(9, on_time))
    flown.advance(delay)
    assert flown.truth.velocity == HERE
    flown.advance(1.0)
    gained = 0.025 * on_time / 2.0
    truth = flown.truth
    assert truth.velocity == pytest.approx((gained, 0.0, 0.0), abs=1e-15)
    assert truth.position[0] == pytest.approx(gained * (1.0 - delay - 0.5 * on_time), abs=1e-15)
    assert truth.impulse_ns == pytest.approx(0.025 * on_time, abs=1e-15)
    assert truth.openings == 1


def test_momentum_is_the_sum_of_many_pulses_of_a_turning_body():
    flown = CubesatSimulation(as_designed(), calm(), 1)
    generator = np.random.default_rng(4)
    for period in range(50):
        flown.command(flown.t, np.where(generator.random(10) < 0.4, generator.uniform(0.01, 0.1, 10), 0.0).tolist())
        flown.advance((period + 1) / 10)
    flown.advance(6.0)
    spin = np.linalg.norm(np.array(flown.truth.rate))
    assert spin > 0.02
    # each nozzle's impulse is exact however the body turns: the sum of thrusts and times
    generator = np.random.default_rng(4)
    expected = 0.0
    for _ in range(50):
        opened = generator.random(10) < 0.4
        expected += 0.025 * float(np.where(opened, generator.uniform(0.01, 0.1, 10), 0.0).sum())
    assert flown.truth.impulse_ns == pytest.approx(expected, abs=1e-9)


def test_an_opening_below_the_least_on_time_is_not_made():
    flown = CubesatSimulation(as_designed(), calm(), 1)
    flown.command(0.0, only(9, 0.0099))
    flown.advance(0.1)
    assert flown.truth.velocity == HERE
    assert flown.truth.openings == 0


def test_a_valve_that_is_open_all_the_time_opens_once():
    flown = CubesatSimulation(as_designed(), calm(), 1)
    for period in range(10):
        flown.command(flown.t, only(4, 0.1))
        flown.advance((period + 1) / 10)
    flown.advance(1.1)
    assert flown.truth.openings == 1
    assert flown.truth.impulse_ns == pytest.approx(0.025, abs=1e-12)
    assert flown.truth.velocity[0] == pytest.approx(-0.0125, abs=1e-12)


def test_central_nozzles_turn_a_body_whose_centre_of_mass_is_off():
    built = replace(as_designed().as_built, mass_centre_std=0.001)
    flown = CubesatSimulation(replace(as_designed(), as_built=built), calm(), 2)
    _, y, z = flown.built.mass_centre
    flown.command(0.0, only(9, 0.1))
    flown.advance(0.5)
    assert flown.truth.rate[1:] == pytest.approx((-z * 0.0025 / 0.0035, y * 0.0025 / 0.0033), rel=1e-3)


def test_errors_of_the_built_vehicle_have_the_spread_that_the_file_says():
    drawn = [CubesatSimulation(VEHICLE, DOCKING, seed).built for seed in range(101, 301)]
    thrusts = np.array([[nozzle.thrust for nozzle in built.nozzles] for built in drawn]) / 0.025
    designed = np.array([nozzle.direction for nozzle in VEHICLE.propulsion.nozzles])
    forces = np.array([[nozzle.force for nozzle in built.nozzles] for built in drawn])
    across = np.linalg.norm(np.cross(designed, forces), axis=-1) / np.linalg.norm(forces, axis=-1)
    assert thrusts.std() == pytest.approx(0.05, rel=0.08)
    assert np.sqrt((across**2).mean() / 2.0) == pytest.approx(math.radians(1.0), rel=0.08)
    assert np.std([built.mass for built in drawn]) == pytest.approx(0.04, rel=0.2)
    assert np.std([built.mass_centre for built in drawn]) == pytest.approx(0.001, rel=0.15)


@pytest.mark.parametrize(
    ("t", "on_times", "complaint"),
    [
        (0.0, [0.0] * 9, "9 on-times for 10 nozzles"),
        (0.0, only(3, 0.11), "nozzle 3: must be 0 to 0.1 s"),
        (0.0, only(3, -0.01), "nozzle 3: must be 0 to 0.1 s"),
        (0.0, only(3, math.nan), "nozzle 3: must be 0 to 0.1 s"),
        (0.1, NONE, "commands begin at the simulation's time"),
    ],
)
def test_a_command_that_cannot_be_is_refused(t, on_times, complaint):
    flown = CubesatSimulation(VEHICLE, DOCKING, 1)
    with pytest.raises(ValueError, match=complaint):
        flown.command(t, on_times)


def test_a_second_command_in_a_control_period_is_refused():
    nozzle = BuiltNozzle(thrust=1.0, force=(1.0, 0.0, 0.0), torque=HERE)
    nozzles = Nozzles(VEHICLE.propulsion, [nozzle])
    nozzles.command(0.0, [0.05])
    with pytest.raises(ValueError, match=r"inside the control period that ends at 0\.1"):
        nozzles.command(0.06, [0.05])
    nozzles.command(0.1, [0.05])
