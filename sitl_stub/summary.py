"""The true state as plain data, for `--json`."""

from sitl_stub.truth import Truth


def summary(truth: Truth) -> dict[str, object]:
    """Give the true state as plain data, the vehicle's place also relative to each target."""
    vehicle = truth.vehicle
    north, east, down = vehicle.position_ned
    return {
        "t": truth.t,
        "position_ned": vehicle.position_ned,
        "velocity_ned": vehicle.velocity_ned,
        "quaternion": vehicle.quaternion,
        "feet_in_contact": vehicle.feet_in_contact,
        "surface": vehicle.surface,
        "armed": vehicle.armed,
        "targets": [
            {
                "name": target.name,
                "position_ned": target.position_ned,
                "yaw": target.yaw,
                "vehicle_minus_target_ned": [
                    north - target.position_ned[0],
                    east - target.position_ned[1],
                    down - target.position_ned[2],
                ],
            }
            for target in truth.targets
        ],
    }
