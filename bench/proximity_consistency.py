"""Is the proximity filter as good as it says? NEES and NIS over many runs, outliers, and what errors remain.

Run: `python bench/proximity_consistency.py [--runs 100 | 1000] [--seeds auto] [--structure tandem] [--nozzle-errors]`.
"""

from __future__ import annotations

import argparse
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from proximity_world import Arrival, World, build, feed
from rich.console import Console
from rich.table import Table

from companion.campaign.seeds import drawn_seeds, parse_seeds
from companion.estimation.consistency import average_bounds, fraction_inside, normalised_squared
from companion.estimation.proximity.fusion import Verdict
from companion.estimation.proximity.parameters import ProximityParameters
from companion.geometry.arrays import Array

EPOCH = 0.5  # [s]
SET = 100  # runs that are averaged; of more runs, one set after the other too
SETTLED = 3.0  # [s] after the start; before, the position is not known well enough to tell an outlier by


@dataclass(slots=True)
class Outcome:
    """Of many runs."""

    nees: Array  # (runs, epochs)
    errors: Array  # (runs, epochs, 9)
    deviations: Array  # (runs, epochs, 9) what the filter thinks of them
    ranges: Array  # (runs, epochs) NIS of ranges, mean of an epoch's, without outliers; nan where there are none
    range_counts: Array  # (runs, epochs) how many readings that mean is of
    features: Array  # (runs, epochs) of one marker in an epoch, for markers of one picture share its errors
    counts: dict[str, int] = field(default_factory=dict)


class Listener:
    """Collects the verdicts of one run by epoch."""

    def __init__(self, epochs: int, counts: dict[str, int]) -> None:
        self.ranges: list[list[float]] = [[] for _ in range(epochs)]
        self.features: list[list[float]] = [[] for _ in range(epochs)]
        self.counts = counts

    def __call__(self, arrival: Arrival, verdicts: object) -> None:
        if isinstance(verdicts, Verdict):
            verdicts = (verdicts,)
            kind, bins = "range", self.ranges
        elif isinstance(verdicts, tuple):
            kind, bins = "marker", self.features
        else:
            return
        epoch = min(int(arrival.reading.t / EPOCH), len(bins) - 1)
        late = "" if arrival.reading.t >= SETTLED else " at the start"
        for number, verdict in enumerate(verdicts):
            if verdict.degrees:
                what = "outlier" if arrival.outlier else kind
                name = f"{what} {'accepted' if verdict.accepted else 'rejected'}{late}"
                self.counts[name] = self.counts.get(name, 0) + 1
                if not arrival.outlier and (kind == "range" or (number == epoch % 6 and not bins[epoch])):
                    bins[epoch].append(verdict.squared_distance)


def examine(seeds: list[int], world: World, parameters: ProximityParameters) -> Outcome:
    counts: dict[str, int] = {}
    rows: list[tuple[list[float], list[Array], list[Array], list[float], list[int], list[float]]] = []
    for seed in seeds:
        listener = Listener(round(world.duration / EPOCH), counts)
        truths, states, _ = feed(build(seed, world, parameters), parameters, EPOCH, listener)
        errors = [truth.errors_of(state) for truth, state in zip(truths, states, strict=True)]
        rows.append(
            (
                [normalised_squared(e, state.covariance) for e, state in zip(errors, states, strict=True)],
                errors,
                [np.sqrt(np.diag(state.covariance)) for state in states],
                [float(np.mean(values)) if values else np.nan for values in listener.ranges],
                [len(values) for values in listener.ranges],
                [float(np.mean(values)) if values else np.nan for values in listener.features],
            )
        )
    nees, errors, deviations, ranges, range_counts, features = (np.array(column) for column in zip(*rows, strict=True))
    return Outcome(nees, errors, deviations, ranges, range_counts, features, counts)


def inside_nis(nis: Array, counts: Array, degrees: int) -> float:
    """Share of epochs at which the NIS averaged over runs and over an epoch's readings is inside the 95 % bounds."""
    inside = []
    for values, readings in zip(nis.T, counts.T, strict=True):
        if np.isfinite(values).all():
            low, high = average_bounds(degrees, int(readings.sum()))
            inside.append(low <= float(values @ readings) / readings.sum() <= high)
    return float(np.mean(inside)) if inside else np.nan


def by_sets(count: int, size: int, share: Callable[[slice], float]) -> str:
    """Give the share [%] of all runs and, of more than one set of `size` runs, the sets' mean, least and most."""
    text = f"{100 * share(slice(0, count)):.1f} %"
    sets = [100 * share(slice(first, first + size)) for first in range(0, count - size + 1, size)]
    if len(sets) < 2:
        return text
    return f"{text}; {len(sets)} sets of {size}: mean {np.mean(sets):.1f}, {min(sets):.1f} to {max(sets):.1f} %"


def rate(counts: dict[str, int], what: str, late: str) -> float:
    accepted, rejected = counts.get(f"{what} accepted{late}", 0), counts.get(f"{what} rejected{late}", 0)
    return 100.0 * rejected / (accepted + rejected) if accepted + rejected else np.nan


def tables(outcome: Outcome) -> tuple[Table, Table]:
    figures = Table("figure", "value", title="Consistency")
    count = len(outcome.nees)
    figures.add_row(
        "NEES (9), epochs inside 95 %", by_sets(count, SET, lambda runs: fraction_inside(outcome.nees[runs], 9))
    )
    low, high = average_bounds(9, count)
    mean = outcome.nees.mean(axis=0)
    figures.add_row(
        "NEES, mean; epochs below, above", f"{mean.mean():.2f}; {np.sum(mean < low)}, {np.sum(mean > high)}"
    )
    figures.add_row(
        "NIS of ranges, epochs inside",
        by_sets(count, SET, lambda runs: inside_nis(outcome.ranges[runs], outcome.range_counts[runs], 1)),
    )
    figures.add_row("NIS of ranges, mean", f"{np.nanmean(outcome.ranges):.3f}")
    once = np.ones_like(outcome.range_counts)
    figures.add_row(
        "NIS of markers, epochs inside",
        by_sets(count, SET, lambda runs: inside_nis(outcome.features[runs], once[runs], 3)),
    )
    figures.add_row("NIS of markers, mean", f"{np.nanmean(outcome.features):.3f}")
    for late, when in (("", f"after {SETTLED:.0f} s"), (" at the start", "before")):
        figures.add_row(f"outliers rejected, {when}", f"{rate(outcome.counts, 'outlier', late):.2f} %")
        figures.add_row(f"good ranges rejected, {when}", f"{rate(outcome.counts, 'range', late):.3f} %")
    figures.add_row("good markers rejected", f"{rate(outcome.counts, 'marker', ''):.4f} %")
    course = Table(
        "t [s]", "position [mm]", "it says", "velocity [mm/s]", "it says", "attitude [mrad]", "it says", "NEES"
    )
    course.title = "Root mean square errors of a component"
    for t in (1.0, 3.0, 10.0, 20.0, 34.5, 35.5, 37.0, 40.0, 50.0, 60.0):
        k = round(t / EPOCH) - 1
        if k < outcome.nees.shape[1]:
            cells = [f"{t:.1f}"]
            for part in (slice(0, 3), slice(3, 6), slice(6, 9)):
                for values in (outcome.errors, outcome.deviations):
                    cells.append(f"{1e3 * np.sqrt(np.mean(values[:, k, part] ** 2)):.2f}")
            course.add_row(*cells, f"{outcome.nees[:, k].mean():.2f}")
    return figures, course


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seeds", default="auto", help="auto: from the commit's hash; or 1..10")
    parser.add_argument("--structure", choices=("tandem", "compounded"), default="tandem")
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--nozzle-errors", action="store_true", help="the scenario's, the same during a run")
    arguments = parser.parse_args()
    choice = parse_seeds(arguments.seeds)
    if choice.given is None:
        commit = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()
        seeds = drawn_seeds(commit, "proximity_consistency", choice.count or arguments.runs)
    else:
        seeds = choice.given
    world = replace(World(), nozzle_errors=arguments.nozzle_errors, duration=arguments.duration)
    outcome = examine(list(seeds), world, ProximityParameters(structure=arguments.structure))
    console = Console()
    for table in tables(outcome):
        console.print(table)
    console.print(f"{arguments.structure}, {len(seeds)} runs, nozzle errors {arguments.nozzle_errors}")


if __name__ == "__main__":
    main()
