"""How fast the simulation runs on one core, and where the time goes. Run: python bench/simulation_speed.py [--quick]"""

# ruff: noqa: E402 - the libraries read the number of threads when they are imported

import argparse
import cProfile
import os
import pstats
import time
from collections import Counter
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

import cv2

from companion.campaign.flight import SimulatedFlight
from companion.config import load_flight
from companion.recording import McapRecorder, NullRecorder, Recorder

ROOT = Path(__file__).resolve().parents[1]
REQUIRED = {"rendered": 1.5, "corners": 10.0}
SHOWN = 14


def fly(mission: Path, camera: str, recorder: Recorder, limit: float, profile: cProfile.Profile | None) -> list[float]:
    """Fly once; give simulated time, time on the wall and CPU time [s]."""
    flight = SimulatedFlight(load_flight(mission), seed=1, camera=camera, recorder=recorder, time_limit_s=limit)
    end = 0.0

    def on_progress(progress) -> None:
        nonlocal end
        end = progress.t

    if profile is not None:
        profile.enable()
    wall, cpu = time.perf_counter(), time.process_time()
    flight.run(on_progress)
    spent = [time.perf_counter() - wall, time.process_time() - cpu]
    if profile is not None:
        profile.disable()
    return [end, *spent]


def place_of(file: str) -> str:
    """Name the package a file belongs to."""
    path = Path(file)
    if path.is_relative_to(ROOT) and ".venv" not in path.parts:
        parts = path.relative_to(ROOT).parts
        return "/".join(parts[:2])
    for name in ("numpy", "cv2", "pymavlink", "scipy", "mcap", "json"):
        if name in path.parts:
            return name
    return "built in" if file == "~" else "standard library"


def print_profile(profile: cProfile.Profile) -> None:
    """Print the share of each package's own time; built-in functions count for the package that called them."""
    spent: Counter[str] = Counter()
    for (file, _, _), (_, _, own, _, callers) in pstats.Stats(profile).stats.items():
        if file == "~" and callers:
            for (caller, _, _), (_, _, share, _) in callers.items():
                spent[place_of(caller)] += share
        else:
            spent[place_of(file)] += own
    total = sum(spent.values())
    for name, seconds in spent.most_common(SHOWN):
        print(f"    {name:28s} {seconds / total:6.1%}")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--mission", type=Path, default=ROOT / "missions" / "land_moving.yaml")
    parser.add_argument("--quick", action="store_true", help="only the first 20 s")
    parser.add_argument("--camera", choices=sorted(REQUIRED), action="append")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    limit = 20.0 if args.quick else 600.0
    for camera in args.camera or ("corners", "rendered"):
        end, wall, cpu = fly(args.mission, camera, NullRecorder(), limit, None)
        print(
            f"{camera}: {end:.0f} s simulated in {wall:.1f} s ({cpu:.1f} s CPU): {end / wall:.1f} x real time, "
            f"{end / cpu:.1f} x by CPU time (required {REQUIRED[camera]:g})"
        )
        recorder = McapRecorder(Path("runs") / "bench" / "flight.mcap")
        end, wall, cpu = fly(args.mission, camera, recorder, limit, None)
        print(f"  with a recording: {end / wall:.1f} x, {end / cpu:.1f} x by CPU time")
        profile = cProfile.Profile()
        fly(args.mission, camera, NullRecorder(), min(limit, 40.0), profile)
        print("  where the time goes (cProfile, first 40 s; calls inflate small functions):")
        print_profile(profile)


if __name__ == "__main__":
    main()
