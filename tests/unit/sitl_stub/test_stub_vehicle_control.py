"""Controllers: PX4's semantics of setpoints, and the mixer."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import sitl_stub.vehicle
from sitl_stub.vehicle.attitude_control import AttitudeController, RateController
from sitl_stub.vehicle.estimator import Estimate
from sitl_stub.vehicle.land_detector import LandDetector, LandInputs
from sitl_stub.vehicle.position_control import (
    NAN,
    NOTHING,
    PositionController,
    TrajectorySetpoint,
    VelocityLimits,
    attitude_of_thrust,
    limit_horizontal,
)

PARAMETERS = json.loads((Path(sitl_stub.vehicle.__file__).parent / "px4_parameters.json").read_text())
STILL = (0.0, 0.0, 0.0)
LIMITS = VelocityLimits(horizontal=12.0, up=3.0, down=1.5)


def update(controller: PositionController, setpoint: TrajectorySetpoint, velocity=STILL) -> bool:
    return controller.update(
        setpoint,
        STILL,
        velocity,
        STILL,
        0.4,
        limits=LIMITS,
        tilt_max=math.radians(45.0),
        thrust_min=0.12,
        thrust_max=1.0,
        dt=0.01,
    )


def test_parameters_are_px4s():
    assert PARAMETERS["MPC_XY_P"] == 0.95
    assert PARAMETERS["MC_ROLL_P"] == 4.0
    assert isinstance(PARAMETERS["COM_RC_OVERRIDE"], int)
    assert isinstance(PARAMETERS["COM_OF_LOSS_T"], float)


@pytest.mark.parametrize(
    "setpoint",
    [
        TrajectorySetpoint(),
        TrajectorySetpoint(velocity=(1.0, 0.0, NAN)),
        TrajectorySetpoint(position=(1.0, NAN, 0.0), velocity=(NAN, NAN, 0.0)),
        TrajectorySetpoint(position=(1.0, 2.0, math.inf)),
    ],
)
def test_unflyable_setpoints_are_refused(setpoint):
    controller = PositionController(PARAMETERS)
    before = controller.attitude
    assert not update(controller, setpoint)
    assert controller.attitude == before


def test_position_gives_velocity_and_feed_forward_adds():
    controller = PositionController(PARAMETERS)
    assert update(controller, TrajectorySetpoint(position=(2.0, 0.0, -1.0), velocity=(0.5, 0.0, 0.0)))
    assert controller.velocity == pytest.approx((2.0 * 0.95 + 0.5, 0.0, -1.0))
    assert controller.acceleration[0] == pytest.approx(1.8 * controller.velocity[0])
    update(controller, TrajectorySetpoint(position=(100.0, 0.0, -100.0)))
    assert controller.velocity == pytest.approx((12.0, 0.0, -3.0))


def test_acceleration_alone_is_open_loop():
    controller = PositionController(PARAMETERS)
    assert update(controller, TrajectorySetpoint(acceleration=(1.0, 0.0, 0.0)), velocity=(3.0, 0.0, 0.0))
    assert controller.acceleration == pytest.approx((1.0, 0.0, 0.0))
    assert controller.thrust == pytest.approx(0.5 / math.cos(math.atan(1.0 / 9.80665)), rel=1e-3)


def test_free_yaw_keeps_the_heading():
    controller = PositionController(PARAMETERS)
    update(controller, TrajectorySetpoint(position=STILL))
    assert controller.yaw == 0.4


def test_tilt_limit_holds():
    controller = PositionController(PARAMETERS)
    update(controller, TrajectorySetpoint(position=(50.0, 0.0, 0.0)))
    _, x, y, _ = controller.attitude
    assert 1.0 - 2.0 * (x * x + y * y) >= math.cos(math.radians(45.0)) - 1e-9


@given(st.tuples(*[st.floats(-9.0, 9.0)] * 4), st.floats(0.5, 5.0))
def test_limit_horizontal_never_exceeds_and_keeps_what_fits(parts, limit):
    x, y = limit_horizontal(*parts, limit)
    assert math.hypot(x, y) <= limit + 1e-9
    total = (parts[0] + parts[2], parts[1] + parts[3])
    if math.hypot(*total) < limit:
        assert (x, y) == pytest.approx(total)


@given(st.tuples(*[st.floats(-0.6, 0.6)] * 2), st.floats(-3.1, 3.1))
def test_attitude_points_thrust_and_heading(lean, yaw):
    thrust = (lean[0], lean[1], -0.7)
    w, x, y, z = attitude_of_thrust(thrust, yaw)
    size = math.sqrt(sum(t * t for t in thrust))
    body_z = (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))
    assert body_z == pytest.approx(tuple(-t / size for t in thrust), abs=1e-9)
    body_x = (1 - 2 * (y * y + z * z), 2 * (x * y + w * z))
    assert math.atan2(body_x[1], body_x[0]) == pytest.approx(yaw, abs=1e-6)


def test_attitude_error_gives_rates_towards_the_goal():
    controller = AttitudeController(PARAMETERS)
    half = 0.05
    level, rolled = (1.0, 0.0, 0.0, 0.0), (math.cos(half), math.sin(half), 0.0, 0.0)
    p, q, r = controller.update(level, rolled, 0.0)
    assert p == pytest.approx(2.0 * math.sin(half) * 4.0, rel=1e-6)
    assert (q, r) == pytest.approx((0.0, 0.0), abs=1e-12)
    _, _, r = controller.update(level, (math.cos(half), 0.0, 0.0, math.sin(half)), 0.3)
    assert r == pytest.approx(0.3 + 2.8 * 2.0 * half, rel=1e-2)


@given(st.tuples(*[st.floats(-20.0, 20.0)] * 6), st.floats(0.0, 1.0))
def test_rotor_commands_stay_in_range(rates, thrust):
    controller = RateController(PARAMETERS)
    commands = controller.update(rates[:3], rates[3:], thrust, dt=0.004, landed=False)
    assert all(0.0 <= command <= 1.0 for command in commands)


def landing(down_rate: float, thrust: float, v_down: float = 0.0) -> LandDetector:
    detector = LandDetector(PARAMETERS)
    estimate = Estimate()
    estimate.v_down = estimate.down_rate = -1.0
    flying = LandInputs(armed=True, climb_rate_controlled=True, wanted_down_rate=-1.0, thrust=0.7, hover_thrust=0.5)
    for _ in range(100):
        detector.update(estimate, flying, 0.01)
    assert not detector.landed
    estimate.v_down = estimate.down_rate = v_down
    flying.wanted_down_rate, flying.thrust = down_rate, thrust
    for _ in range(200):
        detector.update(estimate, flying, 0.01)
    return detector


def test_land_detector_needs_a_commanded_finite_descent():
    assert landing(0.5, 0.12).landed
    assert not landing(0.2, 0.12).landed  # slower than 1.1 * 0.25 m/s
    assert not landing(NAN, 0.12).landed  # position setpoints only
    assert not landing(0.5, 0.12, v_down=0.4).landed  # a heaving deck
    held = landing(0.5, 0.3)  # low thrust, but not the minimum
    assert held.ground_contact
    assert not held.landed
    assert not landing(0.5, 0.4).ground_contact
    assert NOTHING[0] != NOTHING[0]
