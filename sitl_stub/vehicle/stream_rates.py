"""Which messages each link sends by itself, and how often."""

from typing import Literal

Port = Literal["onboard", "ground"]
PORTS: tuple[Port, ...] = ("onboard", "ground")

RATES: dict[Port, dict[str, float]] = {
    "onboard": {
        "ATTITUDE": 100.0,
        "ATTITUDE_QUATERNION": 50.0,
        "HIGHRES_IMU": 50.0,
        "GLOBAL_POSITION_INT": 50.0,
        "LOCAL_POSITION_NED": 30.0,
        "ODOMETRY": 30.0,
        "TIMESYNC": 10.0,
        "ALTITUDE": 10.0,
        "DISTANCE_SENSOR": 10.0,
        "ATTITUDE_TARGET": 10.0,
        "POSITION_TARGET_LOCAL_NED": 10.0,
        "SERVO_OUTPUT_RAW": 10.0,
        "VFR_HUD": 10.0,
        "GPS_RAW_INT": 8.0,
        "EXTENDED_SYS_STATE": 5.0,
        "SYS_STATUS": 5.0,
        "HEARTBEAT": 1.0,
        "ESTIMATOR_STATUS": 1.0,
        "SYSTEM_TIME": 1.0,
        "BATTERY_STATUS": 0.5,
        "CURRENT_MODE": 0.5,
        "HOME_POSITION": 0.5,
    },
    "ground": {
        "ATTITUDE": 50.0,
        "ATTITUDE_QUATERNION": 50.0,
        "ATTITUDE_TARGET": 50.0,
        "LOCAL_POSITION_NED": 50.0,
        "POSITION_TARGET_LOCAL_NED": 50.0,
        "GLOBAL_POSITION_INT": 50.0,
        "SERVO_OUTPUT_RAW": 50.0,
        "GPS_RAW_INT": 5.0,
        "VFR_HUD": 4.0,
        "HEARTBEAT": 1.0,
        "ALTITUDE": 1.0,
        "EXTENDED_SYS_STATE": 1.0,
        "SYS_STATUS": 1.0,
        "SYSTEM_TIME": 1.0,
        "BATTERY_STATUS": 0.5,
        "CURRENT_MODE": 0.5,
        "DISTANCE_SENSOR": 0.5,
        "ESTIMATOR_STATUS": 0.5,
        "HOME_POSITION": 0.5,
    },
}
"""Messages a second on each link, as measured on PX4 v1.17."""
