"""Names of PX4's events, and plain words for those that stop an arming.

An event's id is made from its name: component 1 in the top byte, below it 24 bits of the name's 32-bit FNV-1a hash
(PX4, platforms/common/include/px4_platform_common/events.h). So names alone are a table of ids.
"""

from __future__ import annotations

_AUTOPILOT = 1 << 24

_TEXTS = {
    "check_accel_missing": "accelerometer missing",
    "check_accel_no_data": "no data from the accelerometer",
    "check_accel_not_calibrated": "accelerometer not calibrated",
    "check_armable_configuration": "the configuration does not allow arming",
    "check_avionics_power_high": "avionics voltage high",
    "check_avionics_power_low": "avionics voltage low",
    "check_avionics_power_missing": "avionics power missing",
    "check_baro_missing": "barometer missing",
    "check_baro_no_data": "no data from the barometer",
    "check_battery_critical": "battery critical",
    "check_battery_disconnected": "battery disconnected",
    "check_battery_emergency": "battery at emergency level",
    "check_battery_fault": "battery fault",
    "check_battery_low": "battery low",
    "check_battery_missing": "battery missing",
    "check_battery_rem_flight_time_low": "remaining flight time low",
    "check_battery_unhealthy": "battery unhealthy",
    "check_cpuload_too_high": "autopilot CPU load too high",
    "check_distance_sensor_invalid": "distance sensor invalid",
    "check_distance_sensor_missing": "distance sensor missing",
    "check_escs_not_all_armed": "not all motor controllers are armed",
    "check_escs_offline": "motor controllers offline",
    "check_escs_telem_missing": "no telemetry from the motor controllers",
    "check_estimator_gps_fix_too_low": "GPS fix too low",
    "check_estimator_gps_generic": "GPS not good enough",
    "check_estimator_gps_hor_pos_err_too_high": "GPS horizontal error too high",
    "check_estimator_gps_not_fusing": "GPS not used by the estimator",
    "check_estimator_gps_num_sats_too_low": "too few GPS satellites",
    "check_estimator_gps_pdop_too_high": "GPS PDOP too high",
    "check_estimator_gps_vert_pos_err_too_high": "GPS vertical error too high",
    "check_estimator_heading_not_stable": "heading estimate not stable",
    "check_estimator_hgt_not_stable": "height estimate not stable",
    "check_estimator_high_accel_bias": "accelerometer bias too high",
    "check_estimator_high_gyro_bias": "gyroscope bias too high",
    "check_estimator_hor_pos_not_stable": "horizontal position estimate not stable",
    "check_estimator_hor_vel_not_stable": "horizontal velocity estimate not stable",
    "check_estimator_low_position_accuracy": "position accuracy low",
    "check_estimator_mag_interference": "strong magnetic interference",
    "check_estimator_missing_data": "no data from the estimator",
    "check_estimator_vert_vel_not_stable": "vertical velocity estimate not stable",
    "check_failure_detector_alt": "failure detector: altitude loss",
    "check_failure_detector_arm_esc": "failure detector: motor controllers did not arm",
    "check_failure_detector_ext": "failure detector: external system",
    "check_failure_detector_imbalanced_prop": "failure detector: propeller out of balance",
    "check_failure_detector_pitch": "failure detector: pitch",
    "check_failure_detector_roll": "failure detector: roll",
    "check_flight_time_limit": "flight time limit reached",
    "check_gf_no_home": "the geofence needs a home position",
    "check_gf_violation_custom_gf": "outside the geofence",
    "check_gf_violation_max_alt": "outside the geofence: too high",
    "check_gf_violation_max_hor_dist": "outside the geofence: too far from home",
    "check_gyro_missing": "gyroscope missing",
    "check_gyro_no_data": "no data from the gyroscope",
    "check_gyro_not_calibrated": "gyroscope not calibrated",
    "check_hardfault_present": "the autopilot has crashed before: a crash log is present",
    "check_high_wind_warning": "strong wind",
    "check_imu_accel_inconsistent": "accelerometers disagree",
    "check_imu_gyro_inconsistent": "gyroscopes disagree",
    "check_mag_consistency": "magnetometers disagree",
    "check_mag_missing": "magnetometer missing",
    "check_mag_no_data": "no data from the magnetometer",
    "check_mag_not_calibrated": "magnetometer not calibrated",
    "check_mag_sys_has_mag_missing": "a magnetometer that is configured is missing",
    "check_man_control_kill_engaged": "the kill switch is engaged",
    "check_man_control_landing_gear_up": "the landing gear switch is up",
    "check_man_control_rtl_engaged": "the return switch is engaged",
    "check_missing_cpuload": "no CPU load information",
    "check_missing_fmu_sdcard": "SD card missing",
    "check_missing_system_power": "no data on system power",
    "check_modes_angular_velocity": "no valid angular velocity",
    "check_modes_attitude": "no valid attitude estimate",
    "check_modes_cannot_takeoff": "the mode cannot take off",
    "check_modes_global_pos": "no valid global position estimate",
    "check_modes_home_position": "no home position",
    "check_modes_local_alt": "no valid altitude estimate",
    "check_modes_local_pos": "no valid position estimate",
    "check_modes_manual_control": "no manual control",
    "check_modes_mission": "no mission loaded in the autopilot",
    "check_modes_offboard_signal": "no stream of setpoints",
    "check_open_drone_id_missing": "remote identification missing",
    "check_open_drone_id_unhealthy": "remote identification unhealthy",
    "check_parachute_missing": "parachute missing",
    "check_parachute_unhealthy": "parachute unhealthy",
    "check_ram_usage_too_high": "autopilot memory too full",
    "check_rc_dl_no_dllink": "no ground station",
    "check_system_arm_auth_failed": "arming was not authorised",
    "check_system_flight_term_active": "flight termination is active",
    "check_system_no_global_pos": "no global position",
    "check_system_no_home_pos": "no home position",
    "check_system_safety_button": "press the safety button first",
    "check_system_usb_connected": "USB is connected",
    "check_traffic_avoidance_missing": "traffic avoidance missing",
    "check_wind_too_high": "wind too strong",
    "commander_arm_denied_calibrating": "arming denied: a calibration is running",
    "commander_arm_denied_not_manual": "arming denied: switch to a manual mode first",
    "commander_arm_denied_resolve_failures": "arming denied: resolve the failures first",
    "commander_arm_denied_throttle_center": "arming denied: throttle not centred",
    "commander_arm_denied_throttle_high": "arming denied: throttle not low",
    "commander_disarm_denied_not_landed": "disarming denied: not landed",
}

# Known by name only.
_NAMES = (
    "check_above_wind_limits_warning",
    "check_airspeed_invalid",
    "check_airspeed_no_data",
    "check_airspeed_too_high",
    "check_avionics_power_redundancy",
    "check_estimator_gnss_fault",
    "check_estimator_gnss_fusion_started",
    "check_estimator_gnss_fusion_stopped",
    "check_estimator_gnss_warning_jamming",
    "check_estimator_gnss_warning_spoofing",
    "check_estimator_gps_hor_pos_drift_too_high",
    "check_estimator_gps_hor_speed_drift_too_high",
    "check_estimator_gps_jammed",
    "check_estimator_gps_jamming_critical",
    "check_estimator_gps_speed_acc_too_low",
    "check_estimator_gps_spoofed",
    "check_estimator_gps_vert_pos_drift_too_high",
    "check_estimator_gps_vert_speed_drift_too_high",
    "check_estimator_mag_fault",
    "check_estimator_position_failure_imminent",
    "check_external_modes_unavailable",
    "check_external_modes_unresponsive",
    "check_mag_fault",
    "check_mission_failure",
    "check_motor_overcurrent",
    "check_motor_undercurrent",
    "check_navigator_failure_hagl",
    "check_optical_flow_sensor_invalid",
    "check_optical_sensor_missing",
    "check_power_oc_hipower",
    "check_power_oc_periph",
    "check_power_oc_report",
    "check_rc_max_too_high",
    "check_rc_min_too_small",
    "check_rc_trim_too_high",
    "check_rc_trim_too_small",
    "check_system_vtol_in_fw_mode",
    "check_system_vtol_in_transition",
    "check_task_watchdog_present",
    "check_vtol_fixed_wing_system_failure",
    "commander_armed_by",
    "commander_arming_check_summary",
    "commander_disarmed_by",
    "commander_failsafe_enter",
    "commander_failsafe_enter_autopilot_disengaged",
    "commander_failsafe_enter_crit_bat_warn",
    "commander_failsafe_enter_crit_low_bat_warn",
    "commander_failsafe_enter_generic",
    "commander_failsafe_enter_generic_hold",
    "commander_failsafe_enter_generic_warn",
    "commander_failsafe_enter_hold",
    "commander_failsafe_enter_low_bat",
    "commander_failsafe_enter_low_flight_time_warn",
    "commander_failsafe_enter_warn",
    "commander_health_summary",
    "commander_kill_sw_disengaged",
    "commander_kill_sw_engaged",
    "commander_landing_current_pos",
    "commander_landing_detected",
    "commander_landing_prec_land",
    "commander_mode_fallback_internal",
    "commander_modeswitch_not_avail",
    "commander_rc_lost",
    "commander_rc_override",
    "commander_rc_regained",
    "commander_takeoff_detected",
    "commander_unsupported_arm_disarm_param",
    "commander_unsupported_auto_mode",
    "commander_unsupported_base_mode",
    "commander_unsupported_main_mode",
)


# By these the autopilot says at once what the heartbeat shows up to 1 s later: somebody else takes the vehicle.
# Failsafes whose name ends in "warn" or "low_bat" only warn.
TAKEOVER_EVENTS = frozenset(
    {
        "commander_failsafe_enter",
        "commander_failsafe_enter_autopilot_disengaged",
        "commander_failsafe_enter_generic",
        "commander_failsafe_enter_generic_hold",
        "commander_failsafe_enter_hold",
        "commander_kill_sw_engaged",
        "commander_rc_override",
    }
)


def event_id(name: str) -> int:
    """Give the id that PX4's autopilot component gives to the event of this name."""
    value = 0x811C9DC5
    for byte in name.encode("ascii"):
        value = (value ^ byte) * 0x01000193 & 0xFFFFFFFF
    return _AUTOPILOT | value & 0xFFFFFF


_NAME_OF = {event_id(name): name for name in (*_TEXTS, *_NAMES)}


def event_name(identifier: int) -> str | None:
    """Give PX4's name of an event, or None where it is not known here."""
    return _NAME_OF.get(identifier)


def event_text(name: str | None) -> str | None:
    """Give plain words for an event, or None where there are none here."""
    return None if name is None else _TEXTS.get(name)
