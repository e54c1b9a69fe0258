"""Where the way to a pad out of sight is left, and what that costs, by policy (Parikh et al., figures 9 and 10).

    python bench/approach_policies.py --seeds 101 102 103

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
from companion.planning.energy_path import AirframeEnergy, electric_power

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


def main() -> None:
    """Fly all and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[101, 102, 103])
    seeds = parser.parse_args().seeds
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
