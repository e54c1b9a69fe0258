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
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.campaign.flight import Progress, SimulatedFlight
from companion.config import load_flight
from companion.messages.decision import Mode
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
_EVERY = 5  # steps between samples of the path


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One flight."""

    landed: bool
    error: float  # [m]
    deviation: float  # [m] horizontally, true
    height: float  # [m] of the body above the pad there, true
    seen: bool  # then
    duration: float  # [s] from the end of the climb to the touchdown
    energy: float  # [J]
    coarse_error: float  # [m] of the coarse estimate when the way was left, horizontally


class Watch:
    """Notes the path, and where it is left."""

    def __init__(self, flight: SimulatedFlight) -> None:
        self._flight = flight
        self._steps = 0
        self.path: list[tuple[float, ...]] = []
        self.left: tuple[float, float, bool, float] | None = None

    def __call__(self, progress: Progress) -> None:
        """Look at a step."""
        snapshot = progress.snapshot
        if snapshot is None or snapshot.decision is None or snapshot.ownship is None or snapshot.coarse is None:
            return
        mode, switched = snapshot.decision.mode, snapshot.decision.switched
        truth = self._flight.simulation.truth()
        to_pad = np.array(truth.targets[0].position_ned) - truth.vehicle.position_ned
        if switched is not None and self.left is None and mode in (Mode.REORIENT, Mode.SEARCH) and self.path:
            error = snapshot.coarse.position_ned - snapshot.ownship.position_ned - to_pad
            self.left = (math.hypot(*to_pad[:2]), float(to_pad[2]), mode is Mode.REORIENT, math.hypot(*error[:2]))
        self._steps += 1
        flown = mode not in (Mode.PREFLIGHT, Mode.TAKEOFF, Mode.TOUCHDOWN, Mode.DONE)
        if flown and self._steps % _EVERY == 0:
            self.path.append((snapshot.t, *truth.vehicle.velocity_ned))


def fly(mission: str, policy: str, seed: int) -> Row:
    """Fly one mission."""
    flight = SimulatedFlight(
        load_flight(MISSIONS / f"{mission}.yaml", overrides=POLICIES[policy]), seed=seed, camera="corners"
    )
    watch = Watch(flight)
    result = flight.run(watch)
    path = np.array(watch.path)
    times = np.diff(path[:, 0])
    speed = np.hypot(path[:, 1], path[:, 2])
    along = np.gradient(speed, path[:, 0])
    power = electric_power(speed, -path[:, 3], along, AirframeEnergy())
    deviation, height, seen, coarse_error = watch.left or (math.nan, math.nan, False, math.nan)
    return Row(
        landed=result.success,
        error=math.nan if result.position_error_m is None else result.position_error_m,
        deviation=deviation,
        height=height,
        seen=seen,
        duration=float(path[-1, 0] - path[0, 0]),
        energy=float(power[1:] @ times),
        coarse_error=coarse_error,
    )


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
            rows = [fly(mission, policy, seed) for seed in seeds]

            def mean(name: str, rows: list[Row] = rows) -> float:
                return statistics.fmean(getattr(row, name) for row in rows)

            landed, seen = sum(row.landed for row in rows), sum(row.seen for row in rows)

            print(
                f"| {mission} | {policy} | {landed}/{len(rows)} | {mean('deviation'):.1f} m "
                f"| {mean('height'):.1f} m | {seen}/{len(rows)} | {mean('coarse_error'):.2f} m "
                f"| {mean('duration'):.1f} s | {1e-3 * mean('energy'):.2f} kJ | {1e3 * mean('error'):.0f} mm |",
                flush=True,
            )


if __name__ == "__main__":
    main()
