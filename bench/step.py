"""Latency of the whole step after detection (estimate, predict, intercept, guide, plan, setpoint), beside the detector.

The steps of a simulated flight are timed one by one, with the rendered camera so that the detector has real work.
Run: python bench/step.py [--seconds 60]
"""

# ruff: noqa: E402 - the libraries read the number of threads when they are imported

import argparse
import os
import statistics
import time
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import cv2

from companion.campaign.flight import SimulatedFlight
from companion.config import load_flight
from companion.perception.pad_detector import PadDetector
from companion.runtime.pipeline import Pipeline

ROOT = Path(__file__).resolve().parents[1]


def timed(owner: type, name: str, times: list[tuple[float, bool]]) -> None:
    """Replace a method by one that notes how long each call took, and whether it had a picture's observation."""
    method = getattr(owner, name)

    def wrapper(self, *arguments, **options):
        begin = time.perf_counter_ns()
        value = method(self, *arguments, **options)
        spent = (time.perf_counter_ns() - begin) * 1e-6
        inbox = arguments[-1] if arguments else None
        times.append((spent, bool(getattr(inbox, "observations", ()))))
        return value

    setattr(owner, name, wrapper)


def line(name: str, times: list[float], required: str = "") -> None:
    if not times:
        print(f"{name:44s} never ran")
        return
    ordered = sorted(times)
    print(
        f"{name:44s} median {statistics.median(ordered):7.3f} ms   p99 {ordered[int(0.99 * len(ordered))]:7.3f} ms   "
        f"max {ordered[-1]:7.3f} ms   n {len(ordered)}  {required}"
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--mission", type=Path, default=ROOT / "missions" / "land_moving.yaml")
    parser.add_argument("--seconds", type=float, default=600.0, help="of simulated time, at most")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    steps: list[tuple[float, bool]] = []
    detections: list[tuple[float, bool]] = []
    timed(Pipeline, "step", steps)
    timed(PadDetector, "observe", detections)
    flight = SimulatedFlight(load_flight(args.mission), seed=1, camera="rendered", time_limit_s=args.seconds)
    tracking: list[bool] = []

    def on_progress(progress) -> None:
        snapshot = progress.snapshot
        tracking.append(snapshot is not None and snapshot.picture.track is not None)

    flight.run(on_progress)
    flown = [spent for (spent, _), tracked in zip(steps, tracking, strict=False) if tracked]
    fused = [spent for (spent, seen), tracked in zip(steps, tracking, strict=False) if tracked and seen]
    line("step, while tracking", flown, "(required: median <= 2, p99 <= 5)")
    line("step that takes in an observation", fused)
    line("detector, 640x480 rendered", [spent for spent, _ in detections])


if __name__ == "__main__":
    main()
