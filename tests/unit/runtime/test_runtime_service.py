from __future__ import annotations

import configparser
import os
import shutil
import socket
import subprocess
from pathlib import Path

import pytest

from companion.runtime.service import ServiceNotifier

UNIT = Path(__file__).parents[3] / "config" / "systemd" / "companion.service"


@pytest.fixture
def manager(tmp_path, monkeypatch):
    """A service manager's socket; relative, because a socket's path is limited to 107 bytes."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(f"\0companion-test-{os.getpid()}-{tmp_path.name}")
        listener.setblocking(False)
        yield listener


def notifier(manager, **environment) -> ServiceNotifier:
    name = manager.getsockname().decode().replace("\0", "@")
    return ServiceNotifier({"NOTIFY_SOCKET": name} | environment, process_id=7)


def heard(manager) -> list[str]:
    messages = []
    while True:
        try:
            messages.append(manager.recv(4096).decode())
        except BlockingIOError:
            return messages


def test_life_of_a_service(manager):
    service = notifier(manager)
    service.ready("waiting for\nthe vehicle")
    service.status("flying")
    service.stopping("landed")
    service.close()
    service.close()
    service.status("after the end")
    assert heard(manager) == [
        "READY=1\nSTATUS=waiting for the vehicle",
        "STATUS=flying",
        "STOPPING=1\nSTATUS=landed",
    ]
    assert service.failures == 0


def test_watchdog_is_kicked_four_times_in_its_timeout(manager):
    service = notifier(manager, WATCHDOG_USEC="1000000", WATCHDOG_PID="7")
    assert service.watchdog_timeout == 1.0
    for tick in range(100):  # 2 s at 50 Hz
        service.tick(10.0 + 0.02 * tick)
    kicks = heard(manager)
    assert set(kicks) == {"WATCHDOG=1"}
    assert 7 <= len(kicks) <= 9
    service.close()


def test_no_tick_no_kick(manager):
    service = notifier(manager, WATCHDOG_USEC="1000000")
    service.ready("up")
    service.status("hanging")
    assert not [message for message in heard(manager) if "WATCHDOG" in message]
    service.close()


@pytest.mark.parametrize(
    "environment",
    [{}, {"WATCHDOG_USEC": "0"}, {"WATCHDOG_USEC": "soon"}, {"WATCHDOG_USEC": "1000000", "WATCHDOG_PID": "8"}],
)
def test_a_watchdog_that_is_not_ours_is_left_alone(manager, environment):
    service = notifier(manager, **environment)
    service.tick(1.0)
    assert service.watchdog_timeout is None
    assert heard(manager) == []
    service.close()


@pytest.mark.parametrize("name", ["", "relative", "@nobody-listens-here", "/no/such/socket"])
def test_without_a_manager_nothing_happens(name):
    service = ServiceNotifier({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "1000000"}, process_id=7)
    service.ready("up")
    service.tick(1.0)
    service.stopping("down")
    service.close()


def words(key: str) -> set[str]:
    """Give all that the unit's lines of a key name: systemd adds them up, and lines in comments do not count."""
    lines = [line.partition("=") for line in UNIT.read_text(encoding="utf-8").splitlines()]
    return {word for name, _, values in lines if name == key for word in values.split()}


def unit() -> configparser.ConfigParser:
    parser = configparser.ConfigParser(strict=False, interpolation=None)  # a key may stand on several lines
    parser.optionxform = str
    parser.read_string(UNIT.read_text(encoding="utf-8"))
    return parser


def test_the_unit_says_what_the_rules_ask_for():
    service, start = unit()["Service"], unit()["Unit"]
    assert service["Type"] == "notify"
    assert float(service["WatchdogSec"]) <= 1.0
    assert service["Restart"] == "on-failure"
    assert (start["StartLimitIntervalSec"], start["StartLimitBurst"]) == ("30", "3")
    assert {"1", "2"} <= set(service["RestartPreventExitStatus"].split())
    assert service["NoNewPrivileges"] == "yes"
    assert service["ProtectSystem"] == "strict"
    assert (service["IPAddressDeny"], service["IPAddressAllow"]) == ("any", "localhost")
    assert service["User"] != "root"
    assert service["ExecStart"].split()[1] == "fly"


def test_the_unit_lets_the_hardware_of_the_documents_through():
    """Cameras, and the serial ports that link.url and ranging.input name in config.md, ranging.md and the README."""
    assert {"char-video4linux", "char-ttyUSB", "char-ttyACM", "char-ttyS", "char-ttyHS"} <= words("DeviceAllow")
    assert {"video", "dialout"} <= words("SupplementaryGroups")
    assert words("IPAddressAllow") == {"localhost"}  # more is the owner's choice


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed here")
def test_systemd_finds_nothing_wrong_but_the_missing_program(tmp_path):
    """The program is not installed where the unit expects it, so a stand-in that exists is named in a copy."""
    text = UNIT.read_text(encoding="utf-8")
    program = unit()["Service"]["ExecStart"].split()[0]
    start = f"\nExecStart={program} "
    assert text.count(start) == 1
    copy = tmp_path / UNIT.name
    copy.write_text(text.replace(start, "\nExecStart=/bin/true "), encoding="utf-8")
    done = subprocess.run(["systemd-analyze", "verify", str(copy)], capture_output=True, text=True, timeout=60)
    complaints = [line for line in done.stderr.splitlines() if UNIT.name in line]
    assert complaints == []
    assert done.returncode == 0, done.stderr
