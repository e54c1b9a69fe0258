"""The program over real sockets, in wall time."""

import json
import re
import signal
import socket
import subprocess
import sys
import time

import cv2
import pytest
from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.__main__ import main

pytestmark = pytest.mark.sitl


def listener() -> socket.socket:
    taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    taken.bind(("127.0.0.1", 0))
    taken.settimeout(5.0)
    return taken


def hear(sock: socket.socket, kind: str, limit: float = 5.0):
    """Wait for a message; return it and the sender's address."""
    parser = mavlink.MAVLink(None)
    end = time.monotonic() + limit
    while time.monotonic() < end:
        data, address = sock.recvfrom(2048)
        if data[7] | data[8] << 8 == 410:
            continue
        message = parser.decode(bytearray(data))
        if message.get_type() == kind:
            return message, address
    raise AssertionError(f"no {kind} within {limit} s")


def test_program_speaks_mavlink_serves_pictures_and_ends_cleanly():
    onboard, ground = listener(), listener()
    words = ["--world", "static_pad", "--seed", "3", "--mjpeg-port", "0", "--json"]
    words += ["--onboard-port", str(onboard.getsockname()[1]), "--ground-port", str(ground.getsockname()[1])]
    program = subprocess.Popen([sys.executable, "-m", "sitl_stub", *words], stdout=subprocess.PIPE, text=True)
    try:
        _, autopilot = hear(onboard, "HEARTBEAT", 20.0)
        hear(ground, "HEARTBEAT")
        mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=191)
        for message in (
            mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3),
            mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 3, 0, 0, 0, 0),
            mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
        ):
            onboard.sendto(bytes(message.pack(mav)), autopilot)
        results = [hear(onboard, "COMMAND_ACK")[0].result for _ in range(3)]
        assert results == [0, 0, 0]
        onboard.sendto(bytes(mavlink.MAVLink_timesync_message(0, 99).pack(mav)), autopilot)
        while hear(onboard, "TIMESYNC")[0].ts1 != 99:
            pass
        first, second = program.stdout.readline(), program.stdout.readline()
        assert "MAVLink to udp" in first
        capture = cv2.VideoCapture(re.search(r"http://\S+mjpeg", second).group())
        assert capture.isOpened()
        shapes = [capture.read()[1].shape[:2] for _ in range(5)]
        capture.release()
        assert shapes == [(480, 640)] * 5
        begin, at = hear(onboard, "ATTITUDE")[0].time_boot_ms, time.monotonic()
        time.sleep(0.5)
        while (message := hear(onboard, "ATTITUDE")[0]).time_boot_ms < begin + 1000:
            pass
        # never faster than the clock
        assert (message.time_boot_ms - begin) * 1e-3 < time.monotonic() - at + 0.3
        program.send_signal(signal.SIGTERM)
        out, _ = program.communicate(timeout=15.0)
        assert program.returncode == 0
        truth = json.loads(out.splitlines()[-1])
        assert (truth["armed"], truth["surface"], truth["feet_in_contact"]) == (True, "ground", 4)
        assert len(truth["targets"]) == 1
    finally:
        program.kill()
        program.wait()
        program.stdout.close()
        onboard.close()
        ground.close()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--world", "nowhere"], "nowhere"),
        (["--world", "static_pad", "--vehicle", "x999"], "x999"),
        (["--world", "static_pad", "--fault", "explode"], "explode"),
    ],
)
def test_bad_input_is_told_and_ends_with_2(words, complaint, capsys):
    assert main([*words, "--camera", "corners"]) == 2
    assert complaint in capsys.readouterr().err


def test_port_out_of_range_is_told(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--world", "static_pad", "--onboard-port", "70000"])
    assert end.value.code == 2
    assert "70000" in capsys.readouterr().err
