"""What the guidance sees, for the tests: an armed vehicle in OFFBOARD, nothing else known unless it is said."""

import numpy as np

from companion.geometry.rotations import rotation_from_euler
from companion.guidance.view import View
from companion.messages.ownship import FlightMode, LandedState, OwnshipState, SystemStatus, VehicleStatus
from companion.messages.target import TargetTrack

GEAR = 0.2


def view(
    t: float = 1.0,
    *,
    position=(0.0, 0.0, 0.0),
    velocity=(0.0, 0.0, 0.0),
    attitude: tuple[float, float, float] = (0.0, 0.0, 0.0),
    landed: LandedState = LandedState.IN_AIR,
    **more,
) -> View:
    """Give a view; `attitude`: roll, pitch, yaw; `more`: further fields."""
    turned = rotation_from_euler(*attitude)
    values = {
        "t": t,
        "ownship": OwnshipState(
            t=t,
            position_ned=np.array(position),
            velocity_ned=np.array(velocity),
            acceleration_ned=np.zeros(3),
            ned_from_frd=turned,
            angular_velocity_frd=np.zeros(3),
            reset_counter=0,
        ),
        "status": VehicleStatus(
            t=t,
            connected=True,
            armed=True,
            mode=FlightMode.OFFBOARD,
            landed=landed,
            system_status=SystemStatus.ACTIVE,
            estimate_valid=True,
            battery_remaining=None,
        ),
        "commanding": True,
        "taken_over": False,
        "guardian_reason": "",
        "at_fence": False,
        "track": None,
        "prediction": None,
        "intercept": None,
        "t_frame": t,
        "gear_height": GEAR,
        "velocity_bias_ned": np.zeros(3),
        "relative_velocity_ned": None,
        "lean_ned": turned[:2, 2],
    }
    return View(**(values | more))


def track(
    t: float = 1.0, *, x: float = 0.0, y: float = 0.0, z: float = 0.3, heading: float = 0.0, age: float = 0.0, **more
) -> TargetTrack:
    """Give the track of a pad at rest; x, y, z [m] and heading [rad] from the vehicle, `age` [s]; `more`: fields."""
    values = {
        "t": t,
        "t_measured": t - age,
        "state": np.array([x, y, z, heading, 0.0, 0.0, 0.0, 0.0]),
        "covariance": np.eye(8) * 1e-4,
        "position_ned": np.zeros(3),
        "velocity_ned": np.zeros(3),
        "yaw_ned": 0.0,
        "reset_counter": 0,
        "nis": 1.0,
        "nis_mean": 1.0,
        "fused": 50,
        "t_began": 0.0,
    }
    return TargetTrack(**(values | more))
