"""What the doctor hears of a ranging input, over loopback."""

import asyncio
import socket
from dataclasses import replace
from pathlib import Path

from companion.cli.doctor_ranging import listen_to_ranging
from companion.clock import ElapsedClock
from companion.preflight.finding import Verdict
from companion.preflight.parameters import RangingLimits
from companion.preflight.ranging import RangingReport, judge_ranging
from companion.ranging.parameters import RangingParameters
from sitl_stub.world.ranging import encode

SURVEY = Path(__file__).parents[3] / "config" / "anchors" / "pad_four.yaml"
ANCHORS = (0x022E, 0x9280, 0xDCAE, 0x5431)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


async def listened(parameters: RangingParameters, port: int | None) -> RangingReport:
    listening = asyncio.create_task(listen_to_ranging(parameters, ElapsedClock(), needed=True, seconds=0.5))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        for number in range(20):
            await asyncio.sleep(0.02)
            if port is not None:
                radio.sendto(encode(sequence=number, anchor=ANCHORS[number % 4], distance=5.0), ("127.0.0.1", port))
    return await listening


def verdicts(report: RangingReport) -> dict[str, Verdict]:
    return {finding.check: finding.verdict for finding in judge_ranging(report, RangingLimits())}


def test_a_radio_that_sends_is_fine_and_one_that_is_silent_is_not() -> None:
    port = free_port()
    parameters = RangingParameters(input=f"udp://127.0.0.1:{port}", survey=SURVEY)
    heard = asyncio.run(listened(parameters, port))
    assert set(verdicts(heard).values()) == {Verdict.FINE}
    silent = asyncio.run(listened(replace(parameters, silence_s=0.1), None))
    assert verdicts(silent)["ranges"] is Verdict.NOT_FINE
    (found,) = (one.found for one in judge_ranging(silent, RangingLimits()) if one.check == "ranges")
    assert found.count("no ranges") == 1
    assert "nothing comes; check power" in found


def test_a_mission_by_ranges_needs_an_input_that_opens() -> None:
    none = asyncio.run(listened(RangingParameters(), None))
    assert verdicts(none) == {"ranges": Verdict.NOT_FINE}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        wrong = RangingParameters(input=f"udp://127.0.0.1:{taken.getsockname()[1]}", survey=SURVEY)
        report = asyncio.run(listened(wrong, None))
    assert report.failure is not None
    missing = asyncio.run(listened(replace(wrong, survey=Path("nowhere.yaml")), None))
    assert missing.failure is not None
