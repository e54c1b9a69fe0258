"""How well a two-minute flight finds four anchors, and how long decoding and calibrating take.

    python bench/anchor_calibration.py [--flights N]

Flights as in bench/anchor_flights.py: a square of 6 m at 1 m/s and two heights, 50 ranges a second with 2 cm noise and
5 % outliers, odometry that drifts by 1 % of the way, delays up to 15 cm. Seeds 201, 202, ...
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from anchor_flights import ANCHORS, anchor_flight

from companion.estimation.anchor_calibration import calibrate_anchors
from companion.estimation.anchor_problem import AnchorCalibrationParameters
from companion.ranging.decoder import RangingDecoder
from companion.ranging.lines import decode_line
from companion.ranging.packet import decode_packet, encode_packet
from companion.ranging.parameters import RangingParameters
from companion.ranging.survey import Anchor, AnchorSurvey, SurveyFrame
from companion.ranging.wire import WireMessage, WireRange

LEC = (
    b"DIST,4,AN0,0001,7.94,8.03,0.00,3.44,AN1,0002,7.95,0.00,0.00,5.68,AN2,0003,0.00,8.03,0.00,7.76,"
    b"AN3,0004,0.00,0.00,0.00,8.73,POS,6.95,5.37,-1.97,52"
)


def calibration(flights: int) -> None:
    errors, delays, stds, seconds = [], [], [], []
    for seed in range(201, 201 + flights):
        flight = anchor_flight(seed)
        begun = time.process_time()
        result = calibrate_anchors(flight.path, flight.ranges, AnchorCalibrationParameters())
        seconds.append(time.process_time() - begun)
        if result.refusal is not None:
            print(f"seed {seed}: refused: {result.refusal}")
            continue
        for found in result.anchors:
            errors.append(100 * float(np.linalg.norm(found.position - ANCHORS[found.anchor])))
            delays.append(100 * abs(found.delay - float(flight.delays[found.anchor])))
            stds.append(100 * float(np.sqrt(np.trace(found.covariance[:3, :3]))))
    print(f"{flights} flights, {len(errors)} anchors: error of position [cm] mean {np.mean(errors):.1f}, ", end="")
    print(f"95 % {np.percentile(errors, 95):.1f}, worst {max(errors):.1f}; told {np.mean(stds):.1f}; ", end="")
    print(f"of delay mean {np.mean(delays):.1f}, worst {max(delays):.1f}")
    print(f"one calibration: {np.mean(seconds):.2f} s of processor time, worst {max(seconds):.2f}")


def decoding() -> None:
    anchors = tuple(Anchor(id=k, position=(float(k), 0.0, 0.0)) for k in range(1, 5))
    survey = AnchorSurvey(name="bench", frame=SurveyFrame.PAD, anchors=anchors)
    ranges = tuple(WireRange(anchor=k, range=3.0) for k in range(1, 5))
    packets = [encode_packet(WireMessage(ranges=ranges, tag=1, sequence=k)) for k in range(5000)]
    for name, decode, messages in (("packet", decode_packet, packets), ("lec line", decode_line, [LEC] * 5000)):
        decoder = RangingDecoder(decode, survey, RangingParameters())
        begun = time.process_time()
        for message in messages:
            decoder.decode(message, 1.0)
        each = (time.process_time() - begun) / len(messages)
        print(f"one {name} of four ranges: {1e6 * each:.0f} us, {decoder.statistics().readings} readings")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="How well and how fast anchors are calibrated and ranges decoded.")
    parser.add_argument("--flights", type=int, default=20)
    calibration(parser.parse_args().flights)
    decoding()
