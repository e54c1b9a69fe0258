"""Rigid body and landing gear."""

import math
from dataclasses import replace

import pytest
from stub_vehicle_support import CALM, BareTargets, tilt, vehicle

from sitl_stub.vehicle.config import VEHICLES, VehicleConfig, VehicleFileError
from sitl_stub.vehicle.rigid_body import GRAVITY, RigidBody

IDLE = [0.0, 0.0, 0.0, 0.0]
DT = 0.004


def make_body(**changes: float) -> RigidBody:
    config = vehicle()
    return RigidBody(replace(config.body, **changes), config.gear, heading=0.3)


def run(body: RigidBody, seconds: float, commands: list[float], targets: BareTargets, wind=CALM) -> None:
    for _ in range(round(seconds / DT)):
        targets.step(targets.t + DT, None)  # type: ignore[arg-type]
        body.step(DT, commands, wind, targets.surface_under)


def test_free_fall_without_air_is_exact():
    body = make_body(drag_linear_n_per_mps=0.0, drag_quadratic_n_per_mps2=0.0)
    body.down = -100.0
    run(body, 1.0, IDLE, BareTargets())
    assert body.v_down == pytest.approx(GRAVITY, rel=1e-9)
    assert body.acceleration[2] == pytest.approx(GRAVITY, rel=1e-9)


def test_stands_still_on_the_ground_in_gusts():
    body = make_body()
    run(body, 3.0, IDLE, BareTargets())
    start = body.position
    run(body, 20.0, IDLE, BareTargets(), wind=(6.0, 3.0, 0.0))
    assert body.gear.count == 4
    assert body.gear.surface == "ground"
    assert math.dist(start[:2], body.position[:2]) < 2e-3
    assert math.hypot(body.v_north, body.v_east) < 1e-3
    assert tilt(body.quaternion) < math.radians(0.5)


def test_rotor_signs():
    for commands, axis, sign in (
        ([0.4, 0.6, 0.6, 0.4], "p", 1.0),  # left rotors stronger: roll right
        ([0.6, 0.4, 0.6, 0.4], "q", 1.0),  # front rotors stronger: nose up
        ([0.6, 0.6, 0.4, 0.4], "r", 1.0),  # counter-clockwise rotors stronger: nose right
    ):
        body = make_body()
        body.down = -50.0
        run(body, 0.1, commands, BareTargets())
        rates = {"p": body.p, "q": body.q, "r": body.r}
        assert rates.pop(axis) * sign > 0.05
        assert max(abs(rate) for rate in rates.values()) < 1e-6


def test_platform_carries_the_vehicle_and_the_vehicle_stays_on_it():
    targets = BareTargets(platform_top=0.15)
    body = make_body()
    body.down -= 0.15
    run(body, 1.0, IDLE, targets)
    assert (body.gear.count, body.gear.surface) == (4, "pad")
    targets.speed = 0.5
    run(body, 10.0, IDLE, targets)
    assert body.north - targets.north == pytest.approx(0.0, abs=0.02)
    assert body.v_north == pytest.approx(0.5, abs=1e-3)
    targets.speed = 0.0
    run(body, 2.0, IDLE, targets)
    assert abs(body.v_north) < 1e-3
    assert body.gear.count == 4


def test_tips_off_the_edge_of_a_platform():
    targets = BareTargets(platform_top=0.5)
    body = make_body()
    body.down -= 0.5
    body.north = 0.45  # centre of mass beyond the edge
    run(body, 3.0, IDLE, targets)
    assert tilt(body.quaternion) > math.radians(20.0) or body.down > -0.45


def test_drop_comes_to_rest_without_bouncing_away():
    body = make_body()
    body.down = -0.5
    run(body, 0.35, IDLE, BareTargets())
    highest_after = 0.0
    for _ in range(500):
        body.step(DT, IDLE, CALM, BareTargets().surface_under)
        highest_after = max(highest_after, -body.down - 0.2)
    assert highest_after < 0.08
    assert abs(body.v_down) < 1e-3


def test_a_foot_beside_a_platform_is_not_thrown_up():
    targets = BareTargets(platform_top=0.15, north=-1.0, speed=0.5)
    body = make_body()
    run(body, 3.0, IDLE, targets)
    assert body.down == pytest.approx(-0.2, abs=0.02)
    assert body.gear.surface == "ground"


def test_drag_pushes_downwind_and_grows_faster_than_linear():
    def force(speed: float) -> float:
        body = make_body()
        body.down = -50.0
        body.step(DT, IDLE, (speed, 0.0, 0.0), BareTargets().surface_under)
        return body.acceleration[0]

    assert 0.0 < 2.0 * force(3.0) < force(6.0)


def test_vehicle_file_errors_name_file_and_key(tmp_path):
    path = tmp_path / "bad.yaml"
    good = (VEHICLES / "x500.yaml").read_text()
    for old, new, word in (
        ("mass_kg: 2.0", "mass_kg: -2.0", "body.mass_kg"),
        ("mass_kg: 2.0", "mass_kg: .nan", "body.mass_kg"),
        ("mass_kg: 2.0", "mas_kg: 2.0", "mas_kg"),
        ("enabled: true", "enabled: 1", "estimator.enabled"),
        ("[0.0217, 0.0217, 0.040]", "[0.0217, 0.0217]", "inertia_kg_m2"),
    ):
        assert old in good
        path.write_text(good.replace(old, new))
        with pytest.raises(VehicleFileError, match=word):
            VehicleConfig.load(path)
    with pytest.raises(VehicleFileError, match="x500"):
        VehicleConfig.load("x999")
