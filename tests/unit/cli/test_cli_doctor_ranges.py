from __future__ import annotations

import asyncio
import socket
from dataclasses import replace
from pathlib import Path

from companion.cli.doctor_ranges import listen_to_ranges
from companion.clock import MonotonicClock
from companion.preflight.finding import Verdict
from companion.preflight.parameters import RangingLimits
from companion.preflight.ranging import RangingReport, judge_ranging
from companion.ranging.packet import encode_packet
from companion.ranging.parameters import RangingParameters
from companion.ranging.survey_file import load_survey
from companion.ranging.wire import WireMessage, WireRange

SURVEY = Path(__file__).resolve().parents[3] / "config" / "anchors" / "pad_four.yaml"


def listened(parameters: RangingParameters, seconds: float, send=lambda: None) -> RangingReport:
    async def scenario() -> RangingReport:
        listening = asyncio.create_task(listen_to_ranges(parameters, MonotonicClock(), seconds, needed=True))
        while not listening.done():
            send()
            await asyncio.sleep(0.01)
        return listening.result()

    return asyncio.run(scenario())


def test_an_input_that_gives_ranges_is_reported_with_its_anchors() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
        device.bind(("127.0.0.1", 0))
        port = device.getsockname()[1]
    items = tuple(WireRange(anchor=anchor.id, range=3.0) for anchor in load_survey(SURVEY).anchors)
    sequence = iter(range(10_000))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:

        def send() -> None:
            message = WireMessage(ranges=items, tag=1, sequence=next(sequence))
            device.sendto(encode_packet(message), ("127.0.0.1", port))

        parameters = RangingParameters(input=f"udp://127.0.0.1:{port}", survey=SURVEY)
        report = listened(parameters, 0.5, send)
    assert report.statistics is not None
    assert min(report.statistics.by_anchor) > 0
    assert not report.statistics.faults


def test_a_device_that_is_missing_is_a_finding_and_no_input_is_none() -> None:
    parameters = RangingParameters(input="serial:///dev/there_is_none?baud=115200", survey=SURVEY)
    (finding,) = judge_ranging(listened(parameters, 0.1), RangingLimits())
    assert finding.verdict is Verdict.NOT_FINE
    assert "check that the device is there" in finding.found
    none = listened(RangingParameters(), 0.1)
    assert none.statistics is None
    assert judge_ranging(replace(none, needed=False), RangingLimits()) == []
