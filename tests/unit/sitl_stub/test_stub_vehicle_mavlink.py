"""The MAVLink surface: rates, signing, acknowledgements, refusals, events, parameters, masks."""

import itertools
import math
import struct

import pytest
from pymavlink.dialects.v20 import all as mavlink
from stub_vehicle_support import BareWorld, Client, vehicle

from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.faults import FaultError, Faults
from sitl_stub.vehicle.mavlink_io import QUEUE_MAX, RATES, split_frames

GCS = 6


def connect(port: str = "onboard", *, faults=(), kind: int = 18, seed: int = 1, wander: bool = False) -> Client:
    client = Client(Simulation(BareWorld(), vehicle(wander=wander), seed, faults=faults), port, kind=kind)
    client.run(0.1)
    return client


@pytest.mark.parametrize("port", ["onboard", "ground"])
def test_message_rates_are_those_measured(port):
    client = connect(port)
    client.log.clear()
    client.run(10.0)
    for name, rate in RATES[port].items():
        expected = rate * 10.0
        assert abs(len(client.of(name)) - expected) <= max(1.0, 0.05 * expected), name


def test_every_frame_is_alone_signed_with_zeros_and_numbered():
    client = connect()
    client.run(1.0)
    sequence = [datagram[4] for datagram in client.raw]
    assert all(len(split_frames(datagram)) == 1 for datagram in client.raw)
    assert all(datagram[0] == 0xFD and datagram[2] & 1 and datagram[-13] == 255 for datagram in client.raw)
    assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(sequence))
    keyed = mavlink.MAVLink(None)
    keyed.signing.secret_key = bytes(32)
    assert [keyed.decode(bytearray(datagram)) for datagram in client.raw[:50]]


def test_nothing_is_encoded_for_a_link_nobody_uses_and_queues_are_bounded():
    simulation = Simulation(BareWorld(), vehicle(), 1)
    simulation.advance(5.0)
    assert simulation.transmit("onboard") == []
    simulation.advance(5.1)
    assert simulation.transmit("onboard")
    simulation.advance(70.0)
    assert len(simulation.transmit("onboard")) <= QUEUE_MAX


def test_set_mode_is_acknowledged_twice_and_disarmed_everything_is_taken():
    client = connect()
    assert client.mode(6) == [0, 0]
    assert client.mode(99) == [0, 1]
    assert client.mode(4, 77) == [0, 1]
    assert client.command(176, 0, 6) == [0, 1]
    assert client.command(176, math.nan, 6) == [0, 1]
    assert client.mode(3) == [0, 0]


def test_arming_without_stream_is_refused_and_events_say_why():
    client = connect("ground", kind=GCS)
    client.mode(6)
    client.run(0.1)
    assert {event.id for event in client.of("EVENT")} >= {27825120, 19865031, 18691879}  # no offboard signal
    assert client.arm() == [1]
    assert client.command(400, 1, 21196) == [1]
    assert 16910493 in {event.id for event in client.of("EVENT")}
    client.run(1.1)
    assert client.heard["HEARTBEAT"].system_status == 0
    assert not client.heard["SYS_STATUS"].onboard_control_sensors_health & 0x10000000
    texts = [(m.id, m.chunk_seq, m.text) for m in client.of("STATUSTEXT")]
    number = texts[0][0]
    whole = "".join(text for i, _, text in texts if i == number)
    assert whole == "Arming denied: Resolve system health failures first\t"


def test_texts_reach_only_links_that_heard_a_ground_station():
    client = connect()
    client.mode(99)
    client.run(0.2)
    assert client.of("STATUSTEXT") == []
    assert 19545959 in {event.id for event in client.of("EVENT")}


def test_other_commands_are_answered_as_px4_does():
    client = connect()
    assert client.command(31999) == [3]
    assert client.command(400, 2) == []
    assert client.command(400, math.nan) == [0]
    assert client.command(400, 0) == [0]
    assert client.command(512, 148) == [0]
    assert client.heard["AUTOPILOT_VERSION"].flight_sw_version >> 16 == 0x0111
    assert client.command(512, 99999) == [2]
    assert client.command(512, math.inf) == [2]
    assert client.command(511, 99999, 50000) == [4]
    assert client.command(511, 0, 100000) == [4]
    assert client.command(510, 30) == [0]
    assert client.heard["MESSAGE_INTERVAL"].interval_us == 10000


def test_commands_to_others_are_not_answered():
    client = connect()
    before = len(client.of("COMMAND_ACK"))
    for system, component in ((77, 1), (1, 50)):
        client.send(mavlink.MAVLink_command_long_message(system, component, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    client.run(0.1)
    assert len(client.of("COMMAND_ACK")) == before


def test_truth_is_sent_on_request_only():
    client = connect(wander=True)
    client.run(0.5)
    assert "HIL_STATE_QUATERNION" not in client.heard
    assert client.command(511, 115, 20000) == [0]
    client.log.clear()
    client.run(2.0)
    assert len(client.of("HIL_STATE_QUATERNION")) == pytest.approx(100, abs=3)
    truth = client.heard["HIL_STATE_QUATERNION"]
    assert truth.alt == pytest.approx((489.4 - client.truth.position_ned[2]) * 1e3, abs=2)
    assert client.command(511, 115, -1) == [0]
    client.log.clear()
    client.run(0.5)
    assert client.of("HIL_STATE_QUATERNION") == []


def test_odometry_is_in_the_local_frame_with_px4s_reset_counter():
    client = connect()
    client.run(0.2)
    message = client.heard["ODOMETRY"]
    assert (message.frame_id, message.child_frame_id, message.reset_counter) == (1, 1, 11)
    assert sum(q * q for q in message.q) == pytest.approx(1.0, abs=1e-5)


def test_clock_has_an_offset_and_timesync_answers_on_it():
    offsets = set()
    for seed in (1, 2):
        client = connect(seed=seed)
        client.send(mavlink.MAVLink_timesync_message(0, 12345))
        client.run(0.02)
        reply = next(m for m in client.of("TIMESYNC") if m.ts1 == 12345)
        offset = reply.tc1 * 1e-9 - client.simulation.t
        assert 19.0 < offset < 201.0
        assert client.heard["ATTITUDE"].time_boot_ms * 1e-3 == pytest.approx(client.simulation.t + offset, abs=0.05)
        offsets.add(round(offset, 3))
    assert len(offsets) == 2


def test_parameters_are_read_listed_and_set():
    client = connect()

    def read(name: str) -> None:
        client.heard.pop("PARAM_VALUE", None)
        client.send(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
        client.run(0.02)

    read("COM_OF_LOSS_T")
    assert client.heard["PARAM_VALUE"].param_value == 1.0
    read("COM_RC_OVERRIDE")
    value = client.heard["PARAM_VALUE"]
    assert (value.param_type, struct.unpack("<i", struct.pack("<f", value.param_value))[0]) == (6, 1)
    read("NO_SUCH")
    assert client.heard["PARAM_ERROR"].error == 1
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"COM_OF_LOSS_T", 0.5, 6))
    client.run(0.02)
    assert client.heard["PARAM_ERROR"].error == 7
    client.send(mavlink.MAVLink_param_set_message(1, 1, b"COM_OF_LOSS_T", 0.5, 9))
    client.run(0.02)
    assert client.simulation.autopilot.parameters["COM_OF_LOSS_T"] == 0.5
    client.log.clear()
    client.send(mavlink.MAVLink_param_request_list_message(1, 1))
    client.run(1.0)
    listed = client.of("PARAM_VALUE")
    assert len({m.param_index for m in listed} - {65535}) == listed[0].param_count == 889


@pytest.mark.parametrize(
    ("change", "counts", "flown"),
    [
        ({}, True, True),
        ({"frame": 7}, False, False),
        ({"mask": 0xFFF}, False, False),
        ({"mask": 0xDFF}, False, False),  # yaw only
        ({"p": (math.nan, 0.0, -3.0)}, True, False),
        ({"mask": 2552 | 1}, True, False),  # half-masked xy
        ({"frame": 8, "mask": 0xDF8}, False, False),  # BODY_NED position is ignored
        ({"frame": 8, "mask": 0xDC7, "v": (0.5, 0.0, 0.0)}, True, True),
        ({"frame": 8, "mask": 0xDE7, "v": (0.5, 0.0, 0.0)}, False, False),  # one ignored axis drops the vector
    ],
)
def test_frames_and_masks_count_as_signal_as_px4s_do(change, counts, flown):
    client = connect()
    client.take_off(3.0)
    good = client.stream(0.0)
    client.stream = lambda t: {**good, "p": (3.0, 0.0, -3.0), **change}
    client.run(1.5)
    assert client.simulation.autopilot.commander.failsafe != counts
    assert (math.hypot(*client.truth.position_ned[:2]) > 0.3) == flown


def test_sticks_take_over_when_allowed():
    client = connect()
    client.take_off(3.0)
    simulation = client.simulation

    def sticks(x: int) -> None:
        client.send(mavlink.MAVLink_manual_control_message(1, x, 0, 500, 0, 0))

    def jump() -> bool:
        for _ in range(10):
            sticks(0)
            client.run(0.04)
        sticks(300)
        client.run(0.04)
        return simulation.autopilot.commander.mode.value == (3, 0)

    assert not jump()
    client.send(
        mavlink.MAVLink_param_set_message(1, 1, b"COM_RC_OVERRIDE", struct.unpack("<f", struct.pack("<i", 3))[0], 6)
    )
    assert jump()
    for _ in range(50):
        sticks(300)
        client.run(0.04)
    assert client.truth.velocity_ned[0] > 1.0


def test_ground_station_changes_the_mode_and_each_link_gets_its_own_acks():
    simulation = Simulation(BareWorld(), vehicle(wander=False), 1)
    companion, ground = Client(simulation), Client(simulation, "ground", kind=GCS)
    companion.take_off(3.0)
    before = len(companion.of("COMMAND_ACK"))
    assert ground.mode(4, 3) == [0, 0]
    companion.run(0.1)
    assert len(companion.of("COMMAND_ACK")) == before
    assert companion.heard["CURRENT_MODE"].custom_mode == 4 << 16 | 3 << 24
    assert ground.mode(3) == [0, 1]  # no sticks
    assert companion.mode(6) == [0, 0]


@pytest.mark.parametrize("reason", ["gps", "heading", "position", "battery"])
def test_fault_refuse_arming(reason):
    client = connect(faults=[f"refuse_arming={reason}"])
    assert client.mode(4, 3) == [0, 0]
    assert client.arm() == [1]
    assert client.command(401) == [0]
    client.run(1.1)
    problem = Faults.parse([f"refuse_arming={reason}"]).refuse_arming
    assert problem is not None
    assert problem.event.number in {event.id for event in client.of("EVENT")}
    assert not client.heard["SYS_STATUS"].onboard_control_sensors_health & problem.sensor_bit


def test_faults_of_the_heartbeat():
    client = connect(faults=["no_heartbeat"])
    client.run(2.5)
    assert "HEARTBEAT" not in client.heard
    assert "ATTITUDE" in client.heard
    client = connect(faults=["vehicle_type=fixed_wing"])
    client.run(1.1)
    assert client.heard["HEARTBEAT"].type == mavlink.MAV_TYPE_FIXED_WING
    for word in ("no_heartbeat=1", "refuse_arming=rain", "vehicle_type=boat", "explode"):
        with pytest.raises(FaultError, match="known"):
            Faults.parse([word])


def test_garbage_is_skipped_and_what_follows_is_taken():
    client = connect()
    heartbeat = bytes(mavlink.MAVLink_command_long_message(1, 1, 31999, 0, 0, 0, 0, 0, 0, 0, 0).pack(client.mav))
    broken = bytearray(heartbeat)
    broken[20] ^= 0xFF
    for datagram in (b"", b"\xfd", b"\xfd\xff\x00", bytes(range(256)), bytes(broken), b"abc" + heartbeat):
        client.simulation.receive("onboard", datagram)
    client.run(0.02)
    assert [m.result for m in client.of("COMMAND_ACK")] == [3]
    with pytest.raises(ValueError, match="port"):
        client.simulation.receive("usb", b"")  # type: ignore[arg-type]
