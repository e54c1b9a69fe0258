"""What the simulated PX4 says to whom and when: texts, refusals, calibration, checks after the boot."""

import pytest
from rulebook_bench import GCS, commander, companion, flying, ground_station, mode, texts, wait_for
from stub_vehicle_support import Client

from sitl_stub.vehicle.ground_link import QUEUE_LENGTH, GroundLink
from sitl_stub.vehicle.modes import Mode
from sitl_stub.vehicle.notices import INFO, Notice, number
from sitl_stub.vehicle.system_state import SystemStatus


def said(what: int) -> Notice:
    return Notice(severity=INFO, text=str(what))


def taken(link: GroundLink, begin: float, end: float) -> list[tuple[float, str]]:
    found = []
    for i in range(round((end - begin) / 0.004)):
        t = begin + 0.004 * i
        notice = link.take(t)
        if notice is not None:
            found.append((t, notice.text))
    return found


def test_texts_leave_at_twenty_a_second_in_their_order():
    link = GroundLink()
    link.heard(9.9)
    for k in range(4):
        link.put(10.0, said(k))
    found = taken(link, 10.0, 11.0)
    assert [text for _, text in found] == ["0", "1", "2", "3"]
    assert found[0][0] == 10.0
    assert found[3][0] - found[0][0] == pytest.approx(0.15, abs=0.02)


def test_of_more_texts_than_wait_the_oldest_are_lost():
    link = GroundLink()
    link.heard(9.9)
    for k in range(QUEUE_LENGTH + 3):
        link.put(10.0, said(k))
    assert [text for _, text in taken(link, 10.0, 11.0)] == [str(n) for n in range(3, QUEUE_LENGTH + 3)]


def test_texts_wait_for_a_ground_station_but_not_for_ever():
    link = GroundLink()
    link.put(10.0, said(1))
    link.put(14.0, said(2))
    assert not taken(link, 14.0, 16.0)
    link.heard(16.0)
    assert [text for _, text in taken(link, 16.0, 16.5)] == ["2"]


def test_no_ground_station_counts_in_the_first_seconds_of_a_boot_nor_after_its_silence():
    link = GroundLink()  # all recordings: found 2.51 to 2.53 s after the boot
    link.heard(1.0)
    assert not link.connected(2.5)
    link.heard(2.0)
    assert link.connected(2.52)
    assert not link.connected(4.52)


def test_only_a_ground_station_is_told_in_words_that_a_mode_was_refused():
    client = flying()
    ground = ground_station(client)
    assert client.mode(3) == [0, 1]
    client.run(0.5)
    ground.read()
    assert not any("Switching" in text for _, text in texts(ground))
    assert ground.mode(3) == [0, 1]
    client.run(0.2)
    ground.read()
    assert texts(ground)[-1] == (2, "Switching to Position is currently not available")


def test_refusals_are_told_once_a_second():
    client = flying()
    ground = ground_station(client)
    for _ in range(3):
        ground.mode(3)
        client.run(0.2)
    ground.read()
    assert sum("Switching" in text for _, text in texts(ground)) == 1


def test_land_is_taken_without_a_position_and_becomes_a_descent():
    client = flying()
    client.simulation.inject("gnss_lost")
    client.run(6.0)
    assert commander(client).flags.position_invalid
    assert client.mode(4, 6) == [0, 0]
    wait_for(client, Mode.DESCEND, 0.5)


def test_return_asked_for_on_the_ground_says_nothing():
    client = companion()
    ground = ground_station(client)
    assert client.mode(4, 5) == [0, 0]
    client.run(2.0)
    ground.read()
    assert mode(client) is Mode.AUTO_RTL
    assert not any("RTL" in text for _, text in texts(ground))


def test_commands_of_their_own_are_confirmed_in_words():
    client = flying()
    ground = ground_station(client)
    assert client.command(20) == [0]
    assert client.command(21) == [0]
    client.run(0.3)
    ground.read()
    found = [text for _, text in texts(ground)]
    assert found.index("Returning to launch") < found.index("Landing at current position")


def test_a_report_that_only_a_failsafe_brings_forward_has_no_texts():
    client = flying()
    ground = ground_station(client)
    client.simulation.inject("battery=0")
    wait_for(client, Mode.AUTO_LOITER, 5.0)  # less than 2 s after the last report
    client.run(0.1)
    ground.read()
    assert number("check_battery_critical") in {event.id for event in client.of("EVENT")}
    found = [text for _, text in texts(ground)]
    assert found[-1].startswith("Failsafe activated")
    assert "Critical battery" not in found


def test_gyro_calibration_shows_its_progress_and_prevents_arming():
    client = companion()
    ground = ground_station(client)
    assert client.command(241, 1) == [0]
    assert client.command(241, 1) == [1]
    assert client.arm() == [1]
    assert commander(client).system_status is SystemStatus.CALIBRATING
    client.run(3.0)
    ground.read()
    found = [text for _, text in texts(ground)]
    assert found[0] == "[cal] calibration started: 2 gyro"
    assert "Arming denied: calibrating" in found
    assert [text for text in found if "progress" in text] == [f"[cal] progress <{10 * k}>" for k in range(11)]
    assert found[-1] == "[cal] calibration done: gyro"
    assert client.arm() == [0]


def test_checks_are_not_told_in_the_first_two_seconds_of_a_boot():
    client = companion(faults=["reboot"])
    client.run(1.9)
    ground = Client(client.simulation, "ground", kind=GCS)
    client.partners.append(ground)
    ground.read()
    boot = client.simulation.t
    client.run(1.7)
    client.arm()
    assert {event.id for event in client.of("EVENT")} == {number("commander_arm_denied_resolve_failures")}
    client.run(0.4)
    assert number("check_estimator_heading_not_stable") in {event.id for event in client.of("EVENT")}
    client.run(1.0)
    ground.read()
    found = [text for _, text in texts(ground)]
    assert found[0].startswith("Arming denied")  # it waited for the ground station
    assert found[1] == "Preflight Fail: heading estimate not stable"
    assert client.simulation.t - boot < 3.3
