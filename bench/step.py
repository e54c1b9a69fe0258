"""Latency of the whole step after detection (estimate, predict, intercept, guide, plan, setpoint), beside the detector.

Time on the wall, and CPU time of the thread, which other programs on the machine do not lengthen. The steps of a
simulated flight are timed one by one, with the rendered camera so that the detector has real work.
Run: python bench/step.py [--seconds 60]
"""

# ruff: noqa: E402 - the libraries read the number of threads when they are imported

import argparse
import os
import statistics
import time
from pathlib import Path
from typing import NamedTuple

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import cv2

from companion.campaign.flight import SimulatedFlight
from companion.config import load_flight
from companion.perception.pad_detector import PadDetector
from companion.runtime.pipeline import Pipeline

ROOT = Path(__file__).resolve().parents[1]


class Call(NamedTuple):
    wall: float  # [ms]
    cpu: float  # [ms]
    fused: bool  # it had the observation of a picture


def timed(owner: type, name: str, calls: list[Call]) -> None:
    """Replace a method by one that notes how long each call took."""
    method = getattr(owner, name)

    def wrapper(self, *arguments, **options):
        wall, cpu = time.perf_counter_ns(), time.thread_time_ns()
        value = method(self, *arguments, **options)
        spent = ((time.perf_counter_ns() - wall) * 1e-6, (time.thread_time_ns() - cpu) * 1e-6)
        inbox = arguments[-1] if arguments else None
        calls.append(Call(*spent, bool(getattr(inbox, "observations", ()))))
        return value

    setattr(owner, name, wrapper)


def show(name: str, calls: list[Call], required: str = "") -> None:
    if not calls:
        print(f"{name}: never ran")
        return
    print(f"{name}, {len(calls)} calls {required}")
    for kind in ("wall", "cpu"):
        ordered = sorted(getattr(call, kind) for call in calls)
        median, late = statistics.median(ordered), ordered[int(0.99 * len(ordered))]
        print(f"    {kind:4s}  median {median:7.3f} ms   p99 {late:7.3f} ms   max {ordered[-1]:7.3f} ms")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--mission", type=Path, default=ROOT / "missions" / "land_moving.yaml")
    parser.add_argument("--seconds", type=float, default=600.0, help="of simulated time, at most")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    steps: list[Call] = []
    detections: list[Call] = []
    timed(Pipeline, "step", steps)
    timed(PadDetector, "observe", detections)
    flight = SimulatedFlight(load_flight(args.mission), seed=1, camera="rendered", time_limit_s=args.seconds)
    tracking: list[bool] = []

    def on_progress(progress) -> None:
        snapshot = progress.snapshot
        tracking.append(snapshot is not None and snapshot.picture.track is not None)

    flight.run(on_progress)
    flown = [call for call, tracked in zip(steps, tracking, strict=False) if tracked]
    show("step while tracking", flown, "(required: median <= 2 ms, p99 <= 5 ms)")
    show("step that takes in an observation", [call for call in flown if call.fused])
    show("detector, 640x480 rendered", detections)


if __name__ == "__main__":
    main()
