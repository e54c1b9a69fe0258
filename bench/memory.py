"""Memory of a long flight: resident set after each simulated minute. Run: python bench/memory.py [--minutes 10]"""

# ruff: noqa: E402 - the libraries read the number of threads when they are imported

import argparse
import os
import tempfile
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import cv2
import psutil

from companion.campaign.flight import SimulatedFlight
from companion.config import load_flight
from companion.recording import McapRecorder

ROOT = Path(__file__).resolve().parents[1]
MISSION = """\
version: 1
name: ten minutes above a pad
config: {root}/config/x500_sim.yaml
target: {{pad: {root}/config/pads/landing_pad_0p8.yaml}}
simulation: {{world: static_pad}}
steps:
  - takeoff: {{height_m: 4.0}}
  - search: {{height_m: 4.0, radius_m: 10.0}}
  - follow: {{height_m: 3.0, until: time, for_s: {seconds}, at_most_s: {seconds}}}
  - land
"""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--camera", choices=("rendered", "corners"), default="corners")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    process = psutil.Process()
    seconds = 60.0 * args.minutes
    resident: list[float] = []
    with tempfile.TemporaryDirectory() as name:
        mission = Path(name) / "mission.yaml"
        mission.write_text(MISSION.format(root=ROOT, seconds=seconds))
        recorder = McapRecorder(Path(name) / "flight.mcap")
        flight = SimulatedFlight(
            load_flight(mission), seed=1, camera=args.camera, recorder=recorder, time_limit_s=seconds
        )

        def on_progress(progress) -> None:
            if progress.t >= 60.0 * (len(resident) + 1) - 1e-6:
                resident.append(process.memory_info().rss / 2**20)
                mode = progress.mission.mode.value
                print(f"minute {len(resident):3d}: {resident[-1]:7.1f} MB  {mode}", flush=True)

        flight.run(on_progress)
    if len(resident) > 1:
        print(f"largest {max(resident):.1f} MB (required <= 400)")
        print(f"growth after the first minute {resident[-1] - resident[0]:.1f} MB (required < 5)")


if __name__ == "__main__":
    main()
