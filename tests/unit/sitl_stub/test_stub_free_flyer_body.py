"""The free-flyer's thrusters and body: impulses, momentum, dead band, allocation."""

import math

import numpy as np
import pytest
from stub_free_flyer_support import MOTION, body_parameters, free_flyer, start

from sitl_stub.truth import GROUND
from sitl_stub.vehicle.config import VEHICLES, VehicleFileError
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.vehicle.spacecraft.allocation import Allocation
from sitl_stub.vehicle.spacecraft.body import FreeFlyerBody
from sitl_stub.vehicle.spacecraft.thrusters import COUNT, PLACES, SHUT, Thrusters

DT = 0.004
CALM = (0.0, 0.0, 0.0)


def flat(north, east):
    return 0.0, GROUND, CALM, 0.0


def impulse(duties, duration=0.3, dt=DT, **changed):
    """Impulse forward and right [N s] and turning impulse [N m s] of one period with these duties."""
    thrusters = Thrusters(body_parameters(**{**MOTION, **changed}))
    total = np.zeros(3)
    for i in range(round(duration / dt)):
        total += np.array(thrusters.step(dt, list(duties) if i * dt < 0.05 else list(SHUT))) * dt
    return total


def only(i, duty):
    return [duty if k == i else 0.0 for k in range(COUNT)]


# thrusters


@pytest.mark.parametrize("i", range(COUNT))
@pytest.mark.parametrize("duty", [0.05, 0.137, 0.5, 1.0])
def test_impulse_is_thrust_times_on_time_along_each_thruster(i, duty):
    parameters = body_parameters(**MOTION)
    (x, y), (fx, fy) = PLACES[i]
    lever = parameters.thruster_lever_m
    size = parameters.thrust_n * duty * parameters.pulse_period_s
    expected = (size * fx, size * fy, size * lever * (x * fy - y * fx))
    assert impulse(only(i, duty)) == pytest.approx(expected, abs=1e-9)


def test_least_impulse_and_dead_band():
    parameters = body_parameters()
    least = parameters.pulse_on_time_min_s / parameters.pulse_period_s
    assert impulse(only(0, 0.999 * least)) == pytest.approx((0.0, 0.0, 0.0), abs=0.0)
    assert impulse(only(0, 1.001 * least))[0] == pytest.approx(0.010, rel=0.002)


def test_a_valve_opens_once_a_period_and_takes_its_duty_at_the_beginning():
    thrusters = Thrusters(body_parameters(**MOTION))
    total = 0.0
    for i in range(25):
        # asked for only in the middle of the period: missed
        total += thrusters.step(DT, only(0, 1.0 if 5 <= i < 20 else 0.0))[0]
    assert total == 0.0
    assert thrusters.openings == 0


def test_open_valves_share_the_pressure():
    alone, both = impulse(only(0, 0.5), pressure_drop=0.02), impulse([0.5, 0, 0.5, 0, 0, 0, 0, 0], pressure_drop=0.02)
    assert both[0] == pytest.approx(2.0 * alone[0] * 0.98, rel=3e-3)  # the tail of the thrust is alone again


def test_impulse_does_not_depend_on_the_step():
    duties = [0.31, 0.0, 0.64, 0.0, 0.17, 0.0, 0.0, 0.42]
    assert impulse(duties, dt=0.001) == pytest.approx(impulse(duties, dt=0.004), abs=1e-9)


# body


def flown(duties, duration, dt=DT, heading=0.3, **changed):
    body = FreeFlyerBody(body_parameters(**{**MOTION, **changed}), heading=heading)
    for i in range(round(duration / dt)):
        body.step(dt, duties(i * dt), CALM, flat)
    return body


def test_momentum_is_the_impulse_turned_into_the_floor():
    on = [0.4, 0.0, 0.4, 0.0, 0.2, 0.0, 0.2, 0.0]  # forward and right, no torque
    body = flown(lambda t: on if t < 1.95 else list(SHUT), 3.0)
    parameters = body_parameters()
    forward, right = (2.0 * parameters.thrust_n * duty * 2.0 / parameters.mass_kg for duty in (0.4, 0.2))
    assert body.r == pytest.approx(0.0, abs=1e-12)
    assert body.v_north == pytest.approx(math.cos(0.3) * forward - math.sin(0.3) * right, rel=1e-9)
    assert body.v_east == pytest.approx(math.sin(0.3) * forward + math.cos(0.3) * right, rel=1e-9)


def test_angular_momentum_is_the_turning_impulse():
    turn = [0.25, 0.0, 0.0, 0.25, 0.25, 0.0, 0.0, 0.25]
    body = flown(lambda t: turn if t < 0.95 else list(SHUT), 2.0)
    parameters = body_parameters()
    torque = 4.0 * parameters.thrust_n * parameters.thruster_lever_m * 0.25
    assert body.r == pytest.approx(torque * 1.0 / parameters.yaw_inertia_kg_m2, rel=1e-9)
    assert math.hypot(body.v_north, body.v_east) < 1e-12


def test_motion_converges_with_the_step():
    duties = [0.5, 0.0, 0.3, 0.0, 0.2, 0.1, 0.0, 0.0]
    coarse, fine = (flown(lambda t: duties, 3.0, dt) for dt in (0.004, 0.001))
    assert math.dist(coarse.position, fine.position) < 2e-3
    assert coarse.heading == pytest.approx(fine.heading, abs=1e-3)


def test_it_is_held_until_it_fires_and_then_slides_down_the_floor():
    slope = {**MOTION, "floor_slope_deg": 0.03, "floor_downhill_deg": 60.0}
    held = flown(lambda t: list(SHUT), 5.0, **slope)
    assert held.position[:2] == (0.0, 0.0)
    freed = flown(lambda t: [0.05] * COUNT if t < 0.05 else list(SHUT), 20.0, **slope)
    assert math.degrees(math.atan2(freed.v_east, freed.v_north)) == pytest.approx(60.0, abs=1.0)
    assert math.hypot(freed.v_north, freed.v_east) == pytest.approx(20.0 * 9.80665 * math.radians(0.03), rel=0.01)


def test_drag_slows_it_and_air_carries_it():
    push = [0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    drag = {**MOTION, "film_drag_n_per_mps": 0.5}
    body = flown(lambda t: push if t < 0.95 else list(SHUT), 21.0, **drag)
    assert math.hypot(body.v_north, body.v_east) == pytest.approx(0.2 * math.exp(-0.05 * 20.5), rel=0.01)
    body = FreeFlyerBody(body_parameters(**{**MOTION, "air_drag_n_per_mps2": 0.08}), heading=0.0)
    for i in range(5000):
        body.step(DT, [0.05] * COUNT if i == 0 else list(SHUT), (1.0, 0.0, 0.0), flat)
    assert 0.1 < body.v_north < 0.2  # 0.08 N on 10 kg, for 20 s


def test_it_can_do_what_the_vehicle_file_promises():
    parameters = body_parameters()
    acceleration = 2.0 * parameters.thrust_n * (1.0 - parameters.pressure_drop) / parameters.mass_kg
    assert 0.8 * acceleration >= 0.3
    body = flown(lambda t: [1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, pressure_drop=0.02)
    assert body.v_north**2 + body.v_east**2 == pytest.approx(acceleration**2, rel=0.02)


# allocation


def allocation():
    return Allocation(start().inner.parameters)


def wrench(duties):
    """Normalised force forward and right and torque of duties."""
    forward = sum(d * fx for d, (_, (fx, _)) in zip(duties, PLACES, strict=True)) / 2.0
    right = sum(d * fy for d, (_, (_, fy)) in zip(duties, PLACES, strict=True)) / 2.0
    torque = sum(d * (x * fy - y * fx) for d, ((x, y), (fx, fy)) in zip(duties, PLACES, strict=True)) / 4.0
    return forward, right, torque


def test_geometry_of_the_body_is_what_the_autopilot_was_told():
    parameters, body = start().inner.parameters, body_parameters()
    for i, ((x, y), (fx, fy)) in enumerate(PLACES):
        told = [parameters[f"CA_ROTOR{i}_{name}"] for name in ("PX", "PY", "AX", "AY", "CT")]
        lever = body.thruster_lever_m
        assert told == pytest.approx([lever * x, lever * y, fx, fy, body.thrust_n]), i


def test_allocation_is_exact_where_the_thrusters_can_do_it():
    mixer, rng = allocation(), np.random.default_rng(5)
    for _ in range(300):
        torque = float(rng.uniform(-1.0, 1.0))
        forward, right = (float(v) for v in rng.uniform(-1.0, 1.0, 2) * (1.0 - abs(torque)))
        duties = mixer.duties(forward, right, torque)
        assert wrench(duties) == pytest.approx((forward, right, torque), abs=1e-9)
        assert all(0.0 <= duty <= 1.0 for duty in duties)
        # of two thrusters on one line only one is open
        assert all(min(duties[a], duties[b]) == 0.0 for a, b in ((0, 1), (2, 3), (4, 5), (6, 7)))


def test_beyond_that_it_loses_torque_and_force_but_never_turns_one_around():
    mixer = allocation()
    forward, _, torque = wrench(mixer.duties(1.0, 0.0, 0.5))
    assert 0.5 < forward < 1.0
    assert 0.2 < torque < 0.5


# the file


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass_kg: 10.0", "mass_kg: 0.0", "body.mass_kg must be above zero"),
        ("pulse_on_time_min_s: 0.005", "pulse_on_time_min_s: 0.2", "must be below pulse_period_s"),
        ("thrust_n: 2.0", "thrust: 2.0", "unknown keys"),
    ],
)
def test_wrong_files_are_refused(tmp_path, old, new, message):
    path = tmp_path / "flyer.yaml"
    path.write_text((VEHICLES / "free_flyer.yaml").read_text().replace(old, new, 1))
    with pytest.raises(VehicleFileError, match=message):
        load_vehicle(path)


def test_the_file_has_its_kind():
    assert free_flyer().name == "free_flyer"
