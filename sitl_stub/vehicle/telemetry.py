"""The autopilot's motion as MAVLink messages. One method for each message that can be streamed or requested."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.vehicle.autopilot import Autopilot
from sitl_stub.vehicle.status_telemetry import StatusTelemetry

ORIGIN_LATITUDE, ORIGIN_LONGITUDE, ORIGIN_ALTITUDE = 47.397742, 8.545594, 489.4
EARTH_RADIUS = 6_371_000.0
POSITION_VARIANCE, HEIGHT_VARIANCE, TILT_VARIANCE, YAW_VARIANCE = 0.045, 0.0014, 0.0005, 1.0e-5
VELOCITY_VARIANCE, CLIMB_VARIANCE = 0.011, 0.0015
NAN = math.nan


class Telemetry(ABC):
    """Makes messages; `makers` maps message ids to methods. Each kind of vehicle adds its actuators."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._estimate = autopilot.estimate
        self.status = status = StatusTelemetry(autopilot)
        self.makers: dict[int, Callable[[], Any]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: status.heartbeat,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: status.sys_status,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: status.system_time,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self.gps_raw_int,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self.attitude,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self.attitude_quaternion,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self.local_position_ned,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self.global_position_int,
            mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self.servo_output_raw,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: self.vfr_hud,
            mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: self.highres_imu,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self.timesync,
            mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: self.hil_state_quaternion,
            mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: self.distance_sensor,
            mavlink.MAVLINK_MSG_ID_ALTITUDE: self.altitude,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: status.battery_status,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: status.autopilot_version,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: status.estimator_status,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self.home_position,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self.gps_global_origin,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: status.extended_sys_state,
            mavlink.MAVLINK_MSG_ID_ODOMETRY: self.odometry,
            mavlink.MAVLINK_MSG_ID_CURRENT_MODE: status.current_mode,
        }

    def _milliseconds(self) -> int:
        return int(self._autopilot.boot_time * 1e3) & 0xFFFFFFFF

    def _microseconds(self) -> int:
        return int(self._autopilot.boot_time * 1e6)

    def _geodetic(self, north: float, east: float) -> tuple[int, int]:
        """Latitude and longitude [1e-7 deg] of a place in the local frame [m]."""
        origin = self._autopilot.origin
        latitude, longitude = _geodetic(north + origin[0], east + origin[1])
        return round(latitude), round(longitude)

    def _sea_level(self, down: float) -> float:
        """Altitude [m] above sea level of a height in the local frame."""
        return ORIGIN_ALTITUDE - down - self._autopilot.origin[2]

    def gps_raw_int(self) -> Any:
        """GPS_RAW_INT at the estimated place."""
        estimate = self._estimate
        latitude, longitude = self._geodetic(estimate.north, estimate.east)
        speed = math.hypot(estimate.v_north, estimate.v_east)
        course = math.degrees(math.atan2(estimate.v_east, estimate.v_north)) % 360.0
        received = self._autopilot.faults.gnss and self._autopilot.commander.checks.problem is None
        fix = 3 if received else 1
        altitude = round(self._sea_level(estimate.down) * 1e3)
        return mavlink.MAVLink_gps_raw_int_message(
            self._microseconds(), fix, latitude, longitude, altitude, 70, 110, int(speed * 100), int(course * 100), 10
        )

    def attitude(self) -> Any:
        """ATTITUDE."""
        e = self._estimate
        return mavlink.MAVLink_attitude_message(self._milliseconds(), e.roll, e.pitch, e.yaw, e.p, e.q, e.r)

    def attitude_quaternion(self) -> Any:
        """ATTITUDE_QUATERNION."""
        e = self._estimate
        return mavlink.MAVLink_attitude_quaternion_message(
            self._milliseconds(), e.qw, e.qx, e.qy, e.qz, e.p, e.q, e.r, (0.0, 0.0, 0.0, 0.0)
        )

    def local_position_ned(self) -> Any:
        """LOCAL_POSITION_NED."""
        e = self._estimate
        return mavlink.MAVLink_local_position_ned_message(
            self._milliseconds(), e.north, e.east, e.down, e.v_north, e.v_east, e.v_down
        )

    def odometry(self) -> Any:
        """ODOMETRY: pose and velocity both in LOCAL_NED (frame 1), as PX4 sends it."""
        e = self._estimate
        pose = [0.0] * 21
        pose[0] = pose[6] = POSITION_VARIANCE
        pose[11], pose[15], pose[18], pose[20] = HEIGHT_VARIANCE, TILT_VARIANCE, TILT_VARIANCE, YAW_VARIANCE
        velocity = [0.0] * 21
        velocity[0] = velocity[6] = VELOCITY_VARIANCE
        velocity[11] = CLIMB_VARIANCE
        return mavlink.MAVLink_odometry_message(
            self._microseconds(),
            1,
            1,
            e.north,
            e.east,
            e.down,
            (e.qw, e.qx, e.qy, e.qz),
            e.v_north,
            e.v_east,
            e.v_down,
            e.p,
            e.q,
            e.r,
            pose,
            velocity,
            self._autopilot.estimate_health.reset_counter,
            8,
            0,
        )

    def global_position_int(self) -> Any:
        """GLOBAL_POSITION_INT."""
        e = self._estimate
        latitude, longitude = self._geodetic(e.north, e.east)
        heading = int(math.degrees(e.yaw) % 360.0 * 100.0) % 36000
        return mavlink.MAVLink_global_position_int_message(
            self._milliseconds(),
            latitude,
            longitude,
            round(self._sea_level(e.down) * 1e3),
            round((self._autopilot.home[2] - e.down) * 1e3),
            _centimetres(e.v_north),
            _centimetres(e.v_east),
            _centimetres(e.v_down),
            heading,
        )

    @abstractmethod
    def servo_output_raw(self) -> Any:
        """SERVO_OUTPUT_RAW of the vehicle's actuators."""

    @abstractmethod
    def throttle(self) -> float:
        """Throttle setpoint for VFR_HUD, 0 to 1."""

    def vfr_hud(self) -> Any:
        """VFR_HUD."""
        e = self._estimate
        speed = math.hypot(e.v_north, e.v_east)
        throttle = int(100 * self.throttle()) if self._autopilot.commander.armed else 0
        heading = int(math.degrees(e.yaw) % 360.0)
        return mavlink.MAVLink_vfr_hud_message(NAN, speed, heading, throttle, self._sea_level(e.down), -e.v_down)

    def highres_imu(self) -> Any:
        """HIGHRES_IMU: specific force and turn rates."""
        e = self._estimate
        altitude = self._sea_level(e.down)
        pressure = 1013.25 * (1.0 - altitude / 44330.0) ** 5.255
        return mavlink.MAVLink_highres_imu_message(
            self._microseconds(), *e.specific_force, e.p, e.q, e.r, 0.22, 0.03, 0.47, pressure, 0.0, altitude, 15.0, 63
        )

    def timesync(self) -> Any:
        """TIMESYNC request of the autopilot."""
        return mavlink.MAVLink_timesync_message(0, int(self._autopilot.boot_time * 1e9))

    def hil_state_quaternion(self) -> Any:
        """HIL_STATE_QUATERNION: the truth, for world simulators and judges. Not for flying.

        With PX4's deviations from the definition: `time_usec` always 0, accelerations in whole m/s^2 of the NED frame,
        fractions cut off (mavlink/streams/HIL_STATE_QUATERNION.hpp).
        """
        body = self._autopilot.body
        latitude, longitude = _geodetic(body.north, body.east)
        return mavlink.MAVLink_hil_state_quaternion_message(
            0,
            body.quaternion,
            body.p,
            body.q,
            body.r,
            int(latitude),
            int(longitude),
            int((ORIGIN_ALTITUDE - body.down) * 1e3),
            int(body.v_north * 100.0),
            int(body.v_east * 100.0),
            int(body.v_down * 100.0),
            0,
            0,
            *(max(-32768, min(32767, int(a))) for a in body.acceleration),
        )

    def distance_sensor(self) -> Any:
        """DISTANCE_SENSOR: range finder looking down."""
        distance = max(0, min(10000, round(self._autopilot.range_reading() * 100.0)))
        return mavlink.MAVLink_distance_sensor_message(self._milliseconds(), 0, 10000, distance, 0, 0, 25, 0)

    def altitude(self) -> Any:
        """ALTITUDE."""
        e = self._estimate
        amsl = self._sea_level(e.down)
        relative = self._autopilot.home[2] - e.down
        clearance = e.range_down
        return mavlink.MAVLink_altitude_message(
            self._microseconds(), amsl, amsl, -e.down, relative, -e.down - clearance, clearance
        )

    def home_position(self) -> Any:
        """HOME_POSITION: where the vehicle was armed."""
        north, east, down = self._autopilot.home
        latitude, longitude = self._geodetic(north, east)
        altitude = round(self._sea_level(down) * 1e3)
        return mavlink.MAVLink_home_position_message(
            latitude, longitude, altitude, north, east, down, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, self._microseconds()
        )

    def gps_global_origin(self) -> Any:
        """GPS_GLOBAL_ORIGIN of the local frame."""
        latitude, longitude = self._geodetic(0.0, 0.0)
        altitude = round(ORIGIN_ALTITUDE * 1e3)
        return mavlink.MAVLink_gps_global_origin_message(latitude, longitude, altitude, self._microseconds())


def _geodetic(north: float, east: float) -> tuple[float, float]:
    """Latitude and longitude [1e-7 deg] of a place [m] from the world's origin, on a sphere."""
    latitude = ORIGIN_LATITUDE + math.degrees(north / EARTH_RADIUS)
    longitude = ORIGIN_LONGITUDE + math.degrees(east / (EARTH_RADIUS * math.cos(math.radians(ORIGIN_LATITUDE))))
    return latitude * 1e7, longitude * 1e7


def _centimetres(value: float) -> int:
    return max(-32768, min(32767, round(value * 100.0)))
