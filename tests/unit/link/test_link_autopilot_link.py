from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from link_fake_autopilot import LAND, LOITER, OFFBOARD, POSCTL, FakeAutopilot, event_frame, raw_frame, signed
from pymavlink.dialects.v20 import common as mavlink

from companion.link.autopilot_link import AutopilotLink
from companion.link.event_names import event_id
from companion.link.events import (
    ArmingRefused,
    AutopilotIdentified,
    AutopilotRestarted,
    CommandFinished,
    Connected,
    EstimatorReset,
    Lost,
    ModeChanged,
    ParameterRead,
    RateShort,
    StatusText,
    WrongVehicle,
)
from companion.link.parameters import LinkParameters
from companion.link.remarks import remark
from companion.messages.motion import Setpoint
from companion.messages.ownship import FlightMode, LandedState

TICK = 0.02
DELAY = 0.004  # [s] one way


class Rig:
    """The link and the fake autopilot on one virtual clock, 50 Hz."""

    def __init__(self, *, talk=True, **options):
        self.link = AutopilotLink(LinkParameters())
        self.autopilot = FakeAutopilot(**options)
        self.t = 1000.0
        self.talk = talk
        self.odometry = {}
        self.events = []
        self.tick = 0

    def run(self, duration: float) -> list:
        seen = []
        for _ in range(round(duration / TICK)):
            self.t = 1000.0 + self.tick * TICK
            answers = self.autopilot.hear(self.link.poll(self.t), self.t + DELAY)
            for answer in answers:
                self.link.receive(answer, self.t + 2 * DELAY)
            if self.talk:
                self._stream()
            self.tick += 1
            seen += self.link.events()
        self.events += seen
        return seen

    def _stream(self) -> None:
        t, autopilot = self.t, self.autopilot
        if self.tick % 50 == 0:
            self.link.receive(autopilot.heartbeat(), t + DELAY)
        if self.tick % 10 == 0:
            self.link.receive(autopilot.estimator(), t + DELAY)
            self.link.receive(autopilot.sys_status(), t + DELAY)
            self.link.receive(autopilot.current_mode(), t + DELAY)
        if self.tick % 2 == 0:
            self.link.receive(autopilot.pack(mavlink.MAVLink_extended_sys_state_message(0, 1)), t + DELAY)
        if self.tick % 50 == 5:
            battery = mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [65535] * 10, -1, -1, -1, 63)
            self.link.receive(autopilot.pack(battery), t + DELAY)
        if 331 in autopilot.intervals:
            self.link.receive(autopilot.odometry(t, **self.odometry), t + DELAY)


@pytest.fixture
def rig() -> Rig:
    rig = Rig()
    rig.run(3.0)
    return rig


def of(kind, events):
    return [event for event in events if isinstance(event, kind)]


def setpoint(**changes) -> Setpoint:
    fields = {
        "t": 0.0,
        "position_ned": np.array([1.0, 2.0, -3.0]),
        "velocity_ned": np.array([0.1, 0.2, 0.3]),
        "acceleration_ned": np.array([0.4, 0.5, 0.6]),
        "yaw": 0.7,
        "yaw_rate": 0.8,
    }
    return Setpoint(**(fields | changes))


def decode(datagram: bytes):
    (message,) = mavlink.MAVLink(None).parse_buffer(datagram)
    return message


class TestConnection:
    def test_connects_on_a_heartbeat_and_identifies_the_autopilot(self, rig):
        assert of(Connected, rig.events)[0].vehicle_type == "quadrotor"
        assert of(AutopilotIdentified, rig.events)[0].version.startswith("1.17.0 alpha (59ded6af")
        assert rig.link.identified is not None
        assert rig.link.identified.numbers == (1, 17, 0)
        assert rig.link.status(rig.t).connected

    def test_loss_is_reported_once_and_ends(self, rig):
        rig.talk = False
        events = rig.run(4.0)
        assert len(of(Lost, events)) == 1
        assert not rig.link.status(rig.t).connected
        rig.talk = True
        assert len(of(Connected, rig.run(2.0))) == 1

    def test_heartbeat_is_that_of_an_onboard_controller_once_a_second(self, rig):
        beats = [m for m in rig.autopilot.received if m.get_type() == "HEARTBEAT"]
        assert len(beats) == 3
        assert {m.type for m in beats} == {mavlink.MAV_TYPE_ONBOARD_CONTROLLER}
        assert {(m.get_srcSystem(), m.get_srcComponent()) for m in beats} == {(1, 191)}

    def test_before_a_vehicle_is_heard_only_heartbeats_go_out(self):
        rig = Rig(talk=False)
        rig.run(5.0)
        assert {m.get_type() for m in rig.autopilot.received} == {"HEARTBEAT"}

    def test_other_systems_are_counted_and_not_heard(self, rig):
        stranger = FakeAutopilot(system=7)
        stranger.mode = LAND
        before = rig.link.statistics().foreign
        rig.link.receive(stranger.heartbeat(), rig.t)
        rig.link.receive(stranger.odometry(rig.t), rig.t)
        rig.link.take_ownship()
        assert rig.link.statistics().foreign == before + 2
        assert rig.link.statistics().foreign_sources == {(7, 1): 2}
        assert rig.link.status(rig.t).mode is FlightMode.AUTO_LOITER
        assert not rig.link.recognises(stranger.heartbeat())
        assert rig.link.recognises(rig.autopilot.heartbeat())

    @pytest.mark.parametrize(
        ("options", "name"),
        [
            ({"vehicle_type": 1}, "fixed wing"),
            ({"vehicle_type": 10}, "ground rover"),
            ({"autopilot": 3}, "quadrotor"),
        ],
    )
    def test_a_wrong_vehicle_is_reported_once_and_gets_no_commands(self, options, name):
        rig = Rig(**options)
        rig.run(3.0)
        (wrong,) = of(WrongVehicle, rig.events)
        assert wrong.type_name == name
        rig.link.arm(rig.t)
        rig.link.request_mode(FlightMode.OFFBOARD, rig.t)
        ends = of(CommandFinished, rig.run(0.1))
        assert [end.accepted for end in ends] == [False, False]
        assert name in ends[0].text
        assert not rig.autopilot.commands(400)
        assert not rig.autopilot.commands(176)


class TestStatus:
    def test_everything_in_it(self, rig):
        status = rig.link.status(rig.t)
        assert status.mode is FlightMode.AUTO_LOITER
        assert not status.armed
        assert status.landed is LandedState.ON_GROUND
        assert status.estimate_valid
        assert status.battery_remaining == pytest.approx(0.63)

    @pytest.mark.parametrize("missing", [1, 2, 4, 8 | 16])
    def test_an_estimate_without_a_needed_part_is_not_valid(self, rig, missing):
        rig.link.receive(rig.autopilot.estimator(1023 & ~missing), rig.t)
        assert not rig.link.status(rig.t).estimate_valid

    def test_an_estimate_without_odometry_is_not_valid(self, rig):
        rig.autopilot.intervals.clear()
        rig.run(0.6)
        assert not rig.link.status(rig.t).estimate_valid

    def test_signed_frames_are_read(self, rig):
        rig.autopilot.armed = True
        rig.link.receive(signed(rig.autopilot.heartbeat(), 50), rig.t)
        assert rig.link.status(rig.t).armed

    def test_several_frames_in_one_datagram_with_garbage_between(self, rig):
        rig.autopilot.mode = POSCTL
        datagram = b"\x00\x11" + rig.autopilot.estimator(0) + b"\xfd\xff\x00" + rig.autopilot.heartbeat()
        rig.link.receive(datagram, rig.t)
        assert rig.link.status(rig.t).mode is FlightMode.POSCTL
        assert not rig.link.status(rig.t).estimate_valid
        assert rig.link.statistics().bad_bytes == 5

    def test_a_damaged_frame_is_not_believed(self, rig):
        beat = bytearray(rig.autopilot.heartbeat())
        beat[16] ^= 128  # the armed bit
        rig.link.receive(bytes(beat), rig.t)
        assert not rig.link.status(rig.t).armed
        assert rig.link.statistics().bad_bytes > 0

    def test_chunked_text(self, rig):
        text = "Preflight Fail: heading estimate not stable and a long tail that needs two chunks\t"
        rig.link.receive(rig.autopilot.status_text(text[:50], identifier=3), rig.t)
        rig.link.receive(rig.autopilot.status_text(text[50:], identifier=3, chunk=1), rig.t)
        assert [event.text for event in of(StatusText, rig.link.events())] == [text.strip()]

    def test_a_text_whose_end_is_lost_is_still_given(self, rig):
        rig.link.receive(rig.autopilot.status_text("x" * 50, identifier=3), rig.t)
        assert of(StatusText, rig.run(1.0))[0].text == "x" * 50


class TestOwnship:
    def test_stamps_are_mapped_within_a_millisecond(self, rig):
        rig.link.take_ownship()
        rig.run(0.5)
        states = rig.link.take_ownship()
        assert len(states) == 25
        expected = 1000.0 + np.arange(rig.tick - 25, rig.tick) * TICK
        assert np.abs(np.array([state.t for state in states]) - expected).max() < 1e-3

    def test_before_the_first_exchange_the_arrival_counts(self):
        link, autopilot = AutopilotLink(LinkParameters()), FakeAutopilot()
        link.receive(autopilot.odometry(1000.0), 1000.5)
        assert link.take_ownship()[0].t == 1000.5

    @pytest.mark.parametrize("child", [8, 12])
    def test_body_velocity_is_turned_by_the_attitude(self, rig, child):
        half = math.sqrt(0.5)  # yaw 90 degrees: forward is east
        rig.link.take_ownship()
        rig.odometry = {"child": child, "velocity": (2.0, 0.0, 0.5), "q": (half, 0.0, 0.0, half)}
        rig.run(0.1)
        state = rig.link.take_ownship()[-1]
        assert state.velocity_ned == pytest.approx([0.0, 2.0, 0.5], abs=1e-6)
        assert state.yaw == pytest.approx(math.pi / 2, abs=1e-6)

    def test_acceleration_follows_the_velocity(self, rig):
        for k in range(50):
            rig.odometry = {"velocity": (0.04 * k, 0.0, -0.02 * k)}
            rig.run(TICK)
        state = rig.link.take_ownship()[-1]
        assert state.acceleration_ned == pytest.approx([2.0, 0.0, -1.0], abs=1e-2)

    def test_a_reset_is_reported_and_makes_no_acceleration(self, rig):
        rig.odometry = {"reset": 13, "velocity": (5.0, 0.0, 0.0)}
        (event,) = of(EstimatorReset, rig.run(TICK))
        assert (event.before, event.after) == (11, 13)
        assert np.abs(rig.link.take_ownship()[-1].acceleration_ned).max() < 0.1

    @pytest.mark.parametrize(
        "bad",
        [
            {"position": (math.nan, 0.0, 0.0)},
            {"velocity": (0.0, math.inf, 0.0)},
            {"q": (0.0, 0.0, 0.0, 0.0)},
            {"q": (math.nan, 0.0, 0.0, 0.0)},
            {"frame": 20},
            {"child": 20},
        ],
    )
    def test_unusable_odometry_is_dropped(self, rig, bad):
        rig.link.take_ownship()
        rig.odometry = bad
        rig.run(0.1)
        assert rig.link.take_ownship() == []
        assert rig.link.statistics().odometry_invalid == 5

    def test_repeated_and_late_messages_are_dropped(self, rig):
        rig.link.take_ownship()
        data = [rig.autopilot.odometry(rig.t + 0.01 * k) for k in (1, 2, 2, 1, 3)]
        for datagram in data:
            rig.link.receive(datagram, rig.t + 0.04)
        states = rig.link.take_ownship()
        assert len(states) == 3
        assert [s.t for s in states] == sorted(s.t for s in states)

    def test_a_restart_of_the_autopilot_starts_anew(self, rig):
        rig.autopilot.boot_offset = rig.t - 0.5
        events = rig.run(2.0)
        assert len(of(AutopilotRestarted, events)) == 1
        state = rig.link.take_ownship()[-1]
        assert state.t == pytest.approx(rig.t, abs=1e-3)


class TestRates:
    def test_needed_messages_are_asked_for(self, rig):
        assert rig.autopilot.intervals[331] == pytest.approx(0.02)
        assert {331, 245, 436, 230, 147, 1} <= rig.autopilot.intervals.keys()

    def test_asking_stops_when_the_rates_are_right(self, rig):
        rig.run(5.0)
        before = len(rig.autopilot.commands(511))
        rig.run(10.0)
        assert len(rig.autopilot.commands(511)) == before

    def test_a_message_that_stays_short_is_asked_again_and_reported_once(self):
        rig = Rig()
        rig.autopilot.deaf_to_intervals.add(331)
        events = rig.run(30.0)
        (short,) = of(RateShort, events)
        assert (short.message, short.asked, short.measured) == ("ODOMETRY", 50.0, 0.0)
        asked = [m for m in rig.autopilot.commands(511) if m.param1 == 331]
        assert 4 <= len(asked) <= 8


class TestCommands:
    def test_mode_change(self, rig):
        rig.link.request_mode(FlightMode.OFFBOARD, rig.t)
        events = rig.run(0.2)
        (end,) = of(CommandFinished, events)
        assert (end.command, end.accepted, end.result) == ("mode OFFBOARD", True, 0)
        assert of(ModeChanged, events) == [
            ModeChanged(
                t=of(ModeChanged, events)[0].t,
                mode=FlightMode.OFFBOARD,
                previous=FlightMode.AUTO_LOITER,
                commanded=True,
            )
        ]
        assert len(rig.autopilot.commands(176)) == 1

    def test_the_second_answer_to_a_mode_request_counts(self, rig):
        rig.autopilot.mode_result = 1
        rig.link.request_mode(FlightMode.POSCTL, rig.t)
        (end,) = of(CommandFinished, rig.run(0.2))
        assert (end.accepted, end.result) == (False, 1)

    def test_a_mode_that_someone_else_chose_is_not_ours(self, rig):
        rig.autopilot.mode = LAND
        (change,) = of(ModeChanged, rig.run(0.3))
        assert not change.commanded

    def test_a_request_is_dropped_when_someone_else_changes_the_mode(self, rig):
        rig.autopilot.obey = False
        rig.link.request_mode(FlightMode.OFFBOARD, rig.t)
        rig.run(0.2)
        rig.autopilot.mode = LAND
        events = rig.run(10.0)
        (end,) = of(CommandFinished, events)
        assert not end.accepted
        assert "someone else" in end.text
        assert len(rig.autopilot.commands(176)) == 1

    def test_a_silent_autopilot_is_asked_three_times(self, rig):
        rig.autopilot.silent_commands.add(176)
        rig.link.request_mode(FlightMode.OFFBOARD, rig.t)
        (end,) = of(CommandFinished, rig.run(5.0))
        assert (end.accepted, end.result) == (False, None)
        assert len(rig.autopilot.commands(176)) == 3

    def test_an_acknowledgement_without_the_deed_is_not_success(self, rig):
        rig.autopilot.obey = False
        rig.link.arm(rig.t)
        (end,) = of(CommandFinished, rig.run(8.0))
        assert (end.accepted, end.result) == (False, 0)
        assert len(rig.autopilot.commands(400)) == 3

    def test_acknowledgements_for_others_are_not_ours(self, rig):
        rig.autopilot.silent_commands.add(400)
        rig.link.arm(rig.t)
        rig.run(TICK)
        rig.link.receive(rig.autopilot.ack(400, 2, system=255, component=190), rig.t)
        assert of(CommandFinished, rig.run(0.1)) == []

    def test_arm_and_disarm_without_force(self, rig):
        rig.link.arm(rig.t)
        assert of(CommandFinished, rig.run(0.2))[0].accepted
        assert rig.link.status(rig.t).armed
        rig.link.disarm(rig.t)
        assert of(CommandFinished, rig.run(0.2))[0].accepted
        assert not rig.link.status(rig.t).armed
        assert {(m.param1, m.param2) for m in rig.autopilot.commands(400)} == {(1.0, 0.0), (0.0, 0.0)}

    def test_a_newer_request_replaces_the_older(self, rig):
        rig.autopilot.silent_commands.add(176)
        rig.link.request_mode(FlightMode.OFFBOARD, rig.t)
        rig.run(0.1)
        rig.link.request_mode(FlightMode.AUTO_LOITER, rig.t)
        assert "replaced" in of(CommandFinished, rig.run(0.1))[0].text

    def test_nothing_is_commanded_without_a_vehicle(self):
        rig = Rig(talk=False)
        rig.link.arm(rig.t)
        (end,) = of(CommandFinished, rig.run(0.1))
        assert end.text == "not sent: no vehicle is connected"

    def test_modes_that_are_never_asked_for(self, rig):
        for mode in (FlightMode.MANUAL, FlightMode.TERMINATION, FlightMode.STABILIZED, FlightMode.OTHER):
            with pytest.raises(ValueError, match="may ask for"):
                rig.link.request_mode(mode, rig.t)

    def test_a_lost_vehicle_ends_the_command(self, rig):
        rig.autopilot.silent_commands.add(400)
        rig.link.arm(rig.t)
        rig.run(TICK)
        rig.talk = False
        (end,) = of(CommandFinished, rig.run(4.0))
        assert not end.accepted


class TestArmingRefused:
    def refuse(self, rig) -> ArmingRefused:
        rig.autopilot.arm_result = 1
        rig.autopilot.mode = OFFBOARD
        rig.run(0.3)
        rig.link.arm(rig.t)
        rig.run(0.1)
        offboard, others = (1 << 14).to_bytes(4, "little"), (1 << 3).to_bytes(4, "little")
        frames = [
            event_frame(event_id("commander_arming_check_summary"), log_level=8),
            event_frame(event_id("check_modes_local_pos"), log_level=3, arguments=offboard),
            event_frame(event_id("check_modes_mission"), log_level=6, arguments=others),
            event_frame(event_id("check_modes_manual_control"), log_level=4, arguments=b"\xff" * 4),
            event_frame(event_id("commander_health_summary"), log_level=8),
            event_frame(event_id("commander_arm_denied_resolve_failures"), log_level=2),
            event_frame(0x1ABCDEF, log_level=3),
            rig.autopilot.sys_status(health=0x0320883F),
            rig.autopilot.status_text("Arming denied: Resolve system health failures first\t"[:50]),
        ]
        for frame in frames:
            rig.link.receive(frame, rig.t)
        (refused,) = of(ArmingRefused, rig.run(1.0))
        return refused

    def test_everything_that_the_autopilot_gives_is_shown(self, rig):
        refused = self.refuse(rig)
        names = [event.name for event in refused.autopilot_events]
        assert names == [
            "check_modes_local_pos",
            None,
            "check_modes_manual_control",
            "commander_arm_denied_resolve_failures",
        ]
        assert "pre-arm checks" in refused.unhealthy
        assert refused.status_texts
        text = "\n".join(refused.reasons)
        for part in ("no valid position estimate", "30612409", "event 28036591", "temporarily rejected", "unhealthy:"):
            assert part in text

    def test_a_fresh_report_is_asked_for(self, rig):
        self.refuse(rig)
        assert len(rig.autopilot.commands(401)) == 1

    def test_an_acceptance_reports_nothing(self, rig):
        rig.link.arm(rig.t)
        assert of(ArmingRefused, rig.run(2.0)) == []


class TestEventIds:
    @pytest.mark.parametrize(
        ("name", "identifier"),
        [  # as the running autopilot sent them
            ("check_modes_local_pos", 30612409),
            ("check_estimator_heading_not_stable", 33420013),
            ("check_rc_dl_no_dllink", 23579003),
            ("commander_arm_denied_resolve_failures", 16910493),
            ("commander_health_summary", 18691879),
        ],
    )
    def test_ids_are_made_from_names(self, name, identifier):
        assert event_id(name) == identifier


class TestSetpoint:
    def test_every_field_arrives(self, rig):
        message = decode(rig.link.setpoint(setpoint(), rig.t))
        assert message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
        assert (message.coordinate_frame, message.type_mask) == (1, 0)
        assert (message.target_system, message.target_component) == (1, 1)
        fields = [message.x, message.y, message.z, message.vx, message.vy, message.vz]
        fields += [message.afx, message.afy, message.afz, message.yaw, message.yaw_rate]
        assert fields == pytest.approx([1, 2, -3, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8])

    def test_stamped_in_boot_time(self, rig):
        message = decode(rig.link.setpoint(setpoint(), rig.t))
        assert message.time_boot_ms == pytest.approx((rig.t - rig.autopilot.boot_offset) * 1e3, abs=2)

    def test_without_position_its_bits_are_masked(self, rig):
        assert decode(rig.link.setpoint(setpoint(position_ned=None), rig.t)).type_mask == 7

    @pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
    @pytest.mark.parametrize("field", ["position_ned", "velocity_ned", "acceleration_ned", "yaw", "yaw_rate"])
    def test_what_is_not_finite_is_refused(self, rig, field, bad):
        value = bad if field.startswith("yaw") else np.array([0.0, bad, 0.0])
        with pytest.raises(ValueError, match="finite"):
            rig.link.setpoint(setpoint(**{field: value}), rig.t)


class TestParameters:
    def test_read_and_remembered(self, rig):
        rig.link.request_parameter("COM_RC_OVERRIDE")
        assert of(ParameterRead, rig.run(0.2))[0].value == 3.0
        assert rig.link.parameter("COM_RC_OVERRIDE") == 3.0
        rig.link.request_parameter("COM_RC_OVERRIDE")
        assert of(ParameterRead, rig.run(0.2))[0].value == 3.0
        assert len([m for m in rig.autopilot.received if m.get_type() == "PARAM_REQUEST_READ"]) == 1

    def test_no_answer(self, rig):
        rig.link.request_parameter("NOT_THERE")
        (read,) = of(ParameterRead, rig.run(5.0))
        assert read.value is None

    def test_an_autopilot_that_says_there_is_none_is_not_waited_for(self, rig):
        rig.link.request_parameter("NOT_THERE")
        rig.run(0.1)
        payload = struct.pack("<hBB16sB", -1, 1, 191, b"NOT_THERE", 1)
        rig.link.receive(raw_frame(345, payload, 209), rig.t)
        rig.link.receive(raw_frame(345, payload, 209), rig.t)
        (read,) = of(ParameterRead, rig.run(3.0))
        assert (read.name, read.value) == ("NOT_THERE", None)

    def test_values_are_read_anew_after_a_loss(self, rig):
        rig.link.request_parameter("COM_RC_OVERRIDE")
        rig.run(0.2)
        rig.talk = False
        rig.run(4.0)
        assert rig.link.parameter("COM_RC_OVERRIDE") is None

    def test_a_nonsense_name_is_refused(self, rig):
        with pytest.raises(ValueError, match="not the name"):
            rig.link.request_parameter("lower case")


def test_nothing_but_what_is_allowed_is_ever_sent():
    rig = Rig()
    rig.run(3.0)
    rig.autopilot.arm_result = 1
    rig.link.arm(rig.t)
    rig.link.request_mode(FlightMode.OFFBOARD, rig.t)
    rig.link.request_parameter("COM_OF_LOSS_T")
    rig.run(5.0)
    sent = {m.get_type() for m in rig.autopilot.received}
    assert sent == {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG", "PARAM_REQUEST_READ"}
    commands = {m.command for m in rig.autopilot.received if m.get_type() == "COMMAND_LONG"}
    assert commands == {176, 400, 401, 511, 512}


def test_same_input_same_bytes():
    def flight() -> list[bytes]:
        rig, out = Rig(), []
        hear = rig.autopilot.hear
        rig.autopilot.hear = lambda datagrams, t: (out.extend(datagrams), hear(datagrams, t))[1]
        rig.run(3.0)
        rig.link.request_mode(FlightMode.OFFBOARD, rig.t)
        rig.run(1.0)
        return out

    assert flight() == flight()


def test_loiter_number_is_the_one_px4_uses():
    assert LOITER == 50593792


def test_what_an_operator_wants_to_know_has_words(rig):
    rig.autopilot.intervals[331] = 0.02
    rig.talk = False
    rig.run(4.0)
    rig.talk = True
    rig.odometry = {"reset": 12}
    rig.run(2.0)
    said = [text for event in rig.events if (text := remark(event)) is not None]
    assert said[0] == "connected: quadrotor, system 1"
    assert any(text.startswith("the autopilot is PX4 1.17.0 alpha") for text in said)
    assert "the autopilot's estimator was reset (11 to 12)" in said
    assert any(text.startswith("no heartbeat for 2.5") for text in said)
    short = RateShort(t=0.0, message="ODOMETRY", asked=50.0, measured=30.0)
    assert remark(short) == "ODOMETRY comes 30.0 times a second only, although 50 Hz were asked for"
