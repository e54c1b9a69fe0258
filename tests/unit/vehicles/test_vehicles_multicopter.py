"""The multicopter's limits."""

from pymavlink.dialects.v20 import common

from companion.vehicles.multicopter import Multicopter, MulticopterParameters


def test_it_accepts_multirotors_only():
    vehicle = Multicopter()
    for name in ("QUADROTOR", "HEXAROTOR", "OCTOROTOR", "TRICOPTER", "COAXIAL", "DODECAROTOR", "DECAROTOR"):
        assert vehicle.accepts(getattr(common, f"MAV_TYPE_{name}")), name
    for name in ("FIXED_WING", "GROUND_ROVER", "VTOL_TILTROTOR", "GCS", "SUBMARINE", "HELICOPTER", "GENERIC"):
        assert not vehicle.accepts(getattr(common, f"MAV_TYPE_{name}")), name


def test_parameters_reach_the_limits():
    vehicle = Multicopter(parameters=MulticopterParameters(speed_up=0.7, jerk=5.0, closing_speed=1.1, gear_height=0.3))
    assert vehicle.limits.speed_up == 0.7
    assert vehicle.limits.jerk == 5.0
    assert vehicle.closing_speed == 1.1
    assert vehicle.gear_height == 0.3
