"""The free-flyer's limits."""

from pymavlink.dialects.v20 import common

from companion.vehicles.free_flyer import FreeFlyer, FreeFlyerParameters
from companion.vehicles.multicopter import Multicopter, SetpointForm


def test_it_accepts_spacecraft_only():
    vehicle = FreeFlyer()
    assert vehicle.accepts(common.MAV_TYPE_SPACECRAFT_ORBITER)
    for name in ("QUADROTOR", "GROUND_ROVER", "FIXED_WING", "GENERIC", "ROCKET", "GCS"):
        assert not vehicle.accepts(getattr(common, f"MAV_TYPE_{name}")), name
    assert not Multicopter().accepts(common.MAV_TYPE_SPACECRAFT_ORBITER)


def test_it_flies_on_attitude_and_body_thrust():
    assert FreeFlyer().setpoint_form is SetpointForm.ATTITUDE_BODY_THRUST
    assert Multicopter().setpoint_form is not FreeFlyer().setpoint_form


def test_parameters_reach_the_limits():
    parameters = FreeFlyerParameters(speed=0.1, acceleration=0.2, closing_speed=0.05, footprint_radius=0.3)
    vehicle = FreeFlyer(parameters=parameters)
    assert vehicle.limits.speed_horizontal == 0.1
    assert vehicle.limits.acceleration_horizontal == 0.2
    assert vehicle.closing_speed == 0.05
    assert vehicle.footprint_radius == 0.3


def test_it_stops_within_its_own_footprint():
    limits = FreeFlyer().limits
    assert limits.speed_horizontal**2 / (2.0 * limits.acceleration_horizontal) < FreeFlyer().footprint_radius
