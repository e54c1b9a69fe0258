"""Where the way to a pad out of sight is left, and what that costs, by policy (Parikh et al., figures 9 and 10).

    python bench/approach_policies.py --seeds 101 102 103
    python bench/approach_policies.py --ways        the ways of least energy alone, without flights

Corners camera, virtual time. Energy is that of `companion/planning/energy_path.py` along the true path, from the end of
the climb to the touchdown.
"""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from companion.campaign.flight import run_flight
from companion.campaign.result import ApproachFigures
from companion.planning.energy_path import (
    AirframeEnergy,
    PathLimits,
    electric_power,
    minimum_energy_path,
    path_energy,
)

MISSIONS = Path(__file__).parents[1] / "missions"
POLICIES = {
    "fixed, 3 m": ("steps.3.land.policy=fixed", "steps.3.land.deviate_at_m=3.0"),
    "fixed, 1.5 m": ("steps.3.land.policy=fixed", "steps.3.land.deviate_at_m=1.5"),
    "markov": ("steps.3.land.policy=markov",),
}


def show_ways(length: float = 18.7, height: float = 6.0) -> None:
    """Print power, and ways of least energy beside the one across and then straight down."""
    airframe = AirframeEnergy()
    speeds = np.array([0.0, 3.0, 5.0, 8.0, 12.0])
    powers = electric_power(speeds, 0.0 * speeds, 0.0 * speeds, airframe)
    print(", ".join(f"{speed:g} m/s {power:.0f} W" for speed, power in zip(speeds, powers, strict=True)))
    print("| way | height at its end | energy | time |")
    print("|---|---|---|---|")
    for lowest in (1.2, 4.0):
        limits = PathLimits(speed=2.5, acceleration=0.6, sink_rate=0.8, final_sink_rate=0.5, height_end=lowest)
        path = minimum_energy_path(length, height, limits, airframe)
        print(f"| least energy | {path.height_end:.1f} m | {1e-3 * path.energy:.2f} kJ | {path.duration:.1f} s |")
    energy, duration = path_energy(length, (path.speed, length, height), height, limits, airframe)
    print(f"| across, then straight down | {height:.1f} m | {1e-3 * energy:.2f} kJ | {duration:.1f} s |")


def show_row(mission: str, policy: str, seeds: Sequence[int]) -> None:
    """Fly one policy, and print its means."""
    path = MISSIONS / f"{mission}.yaml"
    results = [run_flight(path, seed=seed, camera="corners", overrides=POLICIES[policy]) for seed in seeds]
    approaches = [result.approach for result in results if result.approach is not None]

    def mean(pick: Callable[[ApproachFigures], float | None]) -> float:
        return _mean(map(pick, approaches))

    print(
        f"| {mission} | {policy} | {sum(result.success for result in results)}/{len(results)} "
        f"| {mean(lambda a: a.way_left_m):.1f} m | {mean(lambda a: a.height_m):.1f} m "
        f"| {sum(a.seen is True for a in approaches)}/{len(approaches)} | {mean(lambda a: a.coarse_error_m):.2f} m "
        f"| {mean(lambda a: a.duration_s):.1f} s | {1e-3 * mean(lambda a: a.energy_j):.2f} kJ "
        f"| {1e3 * _mean(result.position_error_m for result in results):.0f} mm |",
        flush=True,
    )


def _mean(values: Iterable[float | None]) -> float:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else math.nan


def main() -> None:
    """Fly all and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[101, 102, 103])
    parser.add_argument("--ways", action="store_true", help="print the ways of least energy and fly nothing")
    arguments = parser.parse_args()
    if arguments.ways:
        show_ways()
        return
    seeds = arguments.seeds
    print(
        "| mission | policy | landed | way left at | height there | seen then | coarse error | time | energy | error |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for mission in ("land_uwb_then_vision", "land_odometry_then_vision"):
        for policy in POLICIES:
            show_row(mission, policy, seeds)


if __name__ == "__main__":
    main()
