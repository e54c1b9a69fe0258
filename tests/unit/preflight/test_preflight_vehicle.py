"""Listening to an autopilot in virtual time, and judging what was heard."""

from __future__ import annotations

import math
import struct
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mavlink

sys.path.insert(0, str(Path(__file__).parents[1] / "link"))
from link_fake_autopilot import FakeAutopilot, raw_frame

from companion.link.autopilot_link import AutopilotLink
from companion.link.parameters import LinkParameters
from companion.preflight.autopilot_parameters import WantedParameters
from companion.preflight.finding import Finding, Verdict
from companion.preflight.listening import VehicleListener, VehicleReport
from companion.preflight.parameters import VehicleLimits
from companion.preflight.vehicle import judge_vehicle

TICK, DELAY = 0.02, 0.004
LIMITS = VehicleLimits()
HEALTHY, TRANSMITTER = 0x1321C83F, 1 << 16
VALUES = {"COM_RC_OVERRIDE": 3, "COM_OBL_RC_ACT": 0, "COM_RCL_EXCEPT": 0, "NAV_RCL_ACT": 2, "GF_ACTION": 2}


class Vehicle(FakeAutopilot):
    """Talks by itself, at the rates that were asked of it."""

    def __init__(self, **options) -> None:
        super().__init__(**options)
        self.present, self.enabled, self.health = 0x0301402F, 0x0301402F, HEALTHY
        self.flags, self.ratio, self.battery = 831, 0.1, 63
        self.values: dict[str, float | int] = dict(VALUES) | {"COM_OF_LOSS_T": 1.0}
        self.deaf_to_intervals = {0}
        self.timesync = True
        self.reset, self.lost_share = 11, 0.0
        self._due: dict[int, float] = {}

    def current_mode(self) -> bytes:
        payload = struct.pack("<IIB", self.mode, self.mode, 0)
        frame = raw_frame(436, payload, 193, sequence=self.mavlink.seq)
        self.mavlink.seq = (self.mavlink.seq + 1) % 256
        return frame

    def _answer(self, message, t):
        if message.get_type() == "TIMESYNC" and not self.timesync:
            return []
        if message.get_type() == "PARAM_REQUEST_READ" and message.param_id in self.values:
            value = self.values[message.param_id]
            coded = struct.unpack("<f", struct.pack("<i", value))[0] if isinstance(value, int) else value
            kind = 6 if isinstance(value, int) else 9
            return [self.pack(mavlink.MAVLink_param_value_message(message.param_id.encode(), coded, kind, 9, 0))]
        return super()._answer(message, t)

    def stream(self, t: float) -> list[bytes]:
        makers = {
            331: lambda: self.odometry(t, reset=self.reset),
            245: lambda: self.pack(mavlink.MAVLink_extended_sys_state_message(0, 1)),
            436: self.current_mode,
            230: self._estimator,
            1: lambda: self.pack(
                mavlink.MAVLink_sys_status_message(
                    self.present, self.enabled, self.health, 0, 12000, -1, self.battery, 0, 0, 0, 0, 0, 0
                )
            ),
            147: lambda: self.pack(
                mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [65535] * 10, -1, -1, -1, self.battery)
            ),
        }
        sent = []
        for number, interval in [*self.intervals.items(), (0, 1.0)]:
            if t >= self._due.get(number, -1.0) - 1e-6:
                self._due[number] = t + interval
                sent.append(makers.get(number, self.heartbeat)())
        return sent

    def _estimator(self) -> bytes:
        r = self.ratio
        return self.pack(mavlink.MAVLink_estimator_status_message(0, self.flags, r, r, r, r, 0, 0, 0, 0))


def listened(vehicle: Vehicle, during=lambda t: None, parameters: LinkParameters | None = None) -> VehicleReport:
    link = AutopilotLink(parameters or LinkParameters())
    listener = VehicleListener(link, listen_s=6.0, patience_s=4.0, parameters=WantedParameters().rules)
    t, received = 100.0, []
    while not listener.done(t):
        during(t - 100.0)
        sent = listener.tick(t, received)
        received = [(t + 2 * DELAY, answer) for answer in vehicle.hear(sent, t + DELAY)]
        received += [(t + 2 * DELAY, message) for message in vehicle.stream(t + DELAY)]
        t += TICK
        assert t < 120.0
    return listener.report(t)


def judged(report: VehicleReport, limits: VehicleLimits = LIMITS) -> dict[str, Finding]:
    return {finding.check: finding for finding in judge_vehicle(report, limits, WantedParameters().rules)}


def not_fine(report: VehicleReport, limits: VehicleLimits = LIMITS) -> set[str]:
    return {name for name, finding in judged(report, limits).items() if finding.verdict is not Verdict.FINE}


@pytest.fixture
def vehicle() -> Vehicle:
    vehicle = Vehicle(boot_offset=50.0)
    vehicle.present |= TRANSMITTER
    return vehicle


def test_all_is_fine_with_a_vehicle_that_is_ready(vehicle) -> None:
    report = listened(vehicle)
    assert not_fine(report) == set()
    rows = judged(report)
    assert rows["round trip"].figures["median_s"] == pytest.approx(0.008, abs=1e-3)
    assert rows["message rates"].figures["ODOMETRY_hz"] == pytest.approx(50.0, rel=0.05)
    assert rows["autopilot"].found.startswith("PX4 1.17.0 alpha")
    assert rows["COM_OF_LOSS_T"].figures["value"] == 1.0


def test_it_only_asks(vehicle) -> None:
    """It must never arm, change a mode or a parameter."""
    listened(vehicle)
    kinds = {message.get_type() for message in vehicle.received}
    assert kinds == {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG", "PARAM_REQUEST_READ"}
    commands = {message.command for message in vehicle.received if message.get_type() == "COMMAND_LONG"}
    assert commands == {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}
    assert {m.param_id for m in vehicle.received if m.get_type() == "PARAM_REQUEST_READ"} == set(
        WantedParameters().rules
    )


@pytest.mark.parametrize(
    ("change", "row", "word"),
    [
        ({"flags": 831 & ~2}, "estimator", "no horizontal velocity"),
        ({"flags": 831 & ~24}, "estimator", "no horizontal position"),
        ({"flags": 831 | 1024}, "estimator", "GPS glitch"),
        ({"ratio": 1.2}, "estimator", "velocity test ratio 1.20"),
        ({"ratio": math.nan}, "estimator", "test ratio nan"),
        ({"health": HEALTHY & ~0x20}, "sensors", "unhealthy: GPS"),
        ({"health": HEALTHY & ~TRANSMITTER}, "transmitter", "not heard"),
        ({"battery": 12}, "battery", "12 %"),
        ({"armed": True}, "state", "armed"),
        ({"timesync": False}, "round trip", "no answer to"),
        ({"deaf_to_intervals": {331}, "intervals": {331: 0.1}}, "message rates", "ODOMETRY 9.9"),
        ({"values": dict(VALUES)}, "COM_OF_LOSS_T", "not given"),
        ({"values": dict(VALUES) | {"COM_OF_LOSS_T": 1.0, "COM_RC_OVERRIDE": 1}}, "COM_RC_OVERRIDE", "1"),
    ],
)
def test_each_trouble_has_its_row(vehicle, change, row, word) -> None:
    for name, value in change.items():
        setattr(vehicle, name, value)
    report = listened(vehicle)
    allowed = {row, "autopilot's clock"} if row == "round trip" else {row}
    assert not_fine(report) - {row} <= allowed
    finding = judged(report)[row]
    assert finding.verdict is Verdict.NOT_FINE
    assert word in finding.found
    assert finding.wanted


def test_a_reset_while_listening_is_told(vehicle) -> None:
    def during(t: float) -> None:
        vehicle.reset = 11 if t < 3.0 else 12

    assert "1 resets" in judged(listened(vehicle, during))["estimator"].found


def test_a_clock_that_runs_apart_is_told(vehicle) -> None:
    def during(t: float) -> None:
        vehicle.boot_offset = 50.0 + 0.015 * t

    assert not_fine(listened(vehicle, during)) == {"autopilot's clock"}


def test_lost_messages_are_told(vehicle) -> None:
    def during(t: float) -> None:
        vehicle.mavlink.seq = (vehicle.mavlink.seq + (round(t / TICK) % 10 == 0)) % 256

    assert not_fine(listened(vehicle, during)) == {"link"}


def test_no_transmitter_is_needed_where_the_configuration_says_so(vehicle) -> None:
    vehicle.present &= ~TRANSMITTER
    report = listened(vehicle)
    assert not_fine(report) == {"transmitter"}
    assert not_fine(report, replace(LIMITS, transmitter=False)) == set()


def test_an_old_autopilot_is_told(vehicle) -> None:
    assert not_fine(listened(vehicle), replace(LIMITS, version_least=(1, 18))) == {"autopilot"}


def test_nothing_is_heard(vehicle) -> None:
    report = listened(vehicle, parameters=LinkParameters(system_id=9))
    assert not report.heard
    assert "system 1 component 1" in report.statistics.heard_instead


def test_another_kind_of_vehicle_ends_it_at_once() -> None:
    report = listened(Vehicle(boot_offset=50.0, vehicle_type=1))
    assert report.wrong is not None
    assert report.wrong.type_name == "fixed wing"
