"""Do real errors follow the map of `companion study anchors`, and are the proposed anchors really better?

The chaser of the docking simulator floats at places of the map, blind but for radio and gyro: 5 % outliers, residual
acceleration, a wrong start. What the filter is off after it has settled is held against the steady-state covariance.

    companion study anchors docking --out runs/anchors
    python bench/anchor_study.py runs/anchors [--places 10] [--seeds auto:8] [--seconds 40] [--compare-searches]
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import json
import math
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.optimize import differential_evolution

from companion.campaign.docking import told_start
from companion.campaign.seeds import drawn_seeds, parse_seeds
from companion.campaign.versions import current_commit, project_root
from companion.cli.anchor_scene import read_given
from companion.estimation.proximity.filter import ProximityFilter
from companion.geometry.arrays import Array
from companion.messages.proximity import GyroReading, RangeReading
from companion.placement.geometry import eigenvalues, information
from companion.placement.mounting import Mounting, box_round
from companion.placement.scene import Scene, whole_std
from companion.placement.search import propose, quality
from sitl_stub.cubesat import readings as simulated
from sitl_stub.cubesat.simulation import CubesatSimulation
from sitl_stub.cubesat.vehicle import CubesatVehicle
from sitl_stub.cubesat.world import DockingWorld

SETTLED = 0.5  # share of the run after which errors count: the filter takes about 10 s
PERIOD = 0.1  # [s] between two looks


def errors_at(scene: Scene, world: DockingWorld, place: Array, seed: int, seconds: float) -> list[float]:
    """Float at a place; squared errors [m^2] of the position once settled."""
    x, y, z = (float(value) for value in place)
    anchors = tuple((float(a), float(b), float(c)) for a, b, c in scene.setup.anchors)
    vehicle = CubesatVehicle.load("cubesat")
    vehicle = dataclasses.replace(vehicle, camera=dataclasses.replace(vehicle.camera, enabled=False))
    chaser = dataclasses.replace(world.chaser, position=(x, y, z))
    simulation = CubesatSimulation(vehicle, dataclasses.replace(world, anchors=anchors, chaser=chaser), seed)
    estimator = ProximityFilter(scene.setup, scene.noise, told_start(simulation))
    squares = []
    for tick in range(1, round(seconds / PERIOD) + 1):
        t = tick * PERIOD
        simulation.advance(t)
        for reading in simulation.readings():
            if isinstance(reading, simulated.GyroReading):
                estimator.gyro(GyroReading(t=reading.t, rate=np.array(reading.rate)))
            elif isinstance(reading, simulated.RangeReading):
                estimator.range(RangeReading(t=reading.t, anchor=reading.anchor, range=reading.range))
        if t > SETTLED * seconds:
            error = np.array(simulation.truth.position) - estimator.state(t).position
            squares.append(float(error @ error))
    return squares


def places_of(table: Path, count: int) -> Array:
    """Places of a map, evenly spread over their rank from the best known to the worst."""
    rows = [row for row in csv.DictReader(table.read_text(encoding="utf-8").splitlines()) if row["std_m"]]
    rows.sort(key=lambda row: float(row["std_m"]))
    chosen = [rows[round(index)] for index in np.linspace(0, len(rows) - 1, count)]
    return np.array([[float(row[f"{axis}_m"]) for axis in "xyz"] for row in chosen])


def compare_searches(scene: Scene, places: Array, console: Console) -> None:
    """Hold the search against differential evolution on the same cost, both with the smallest box as given."""
    mounting = Mounting(box=box_round(scene.setup.anchors))
    begun = time.process_time()
    proposal = propose(scene, mounting, places, np.random.default_rng(1))
    console.print(
        f"exchange and polish: rms {1000.0 * proposal.proposed.rms:.3f} mm, {time.process_time() - begun:.1f} s CPU"
    )
    radios = scene.radio(places)

    def cost(numbers: Array) -> float:
        anchors = mounting.nearest(numbers.reshape(-1, 3))
        if not mounting.admits(anchors[None])[0]:
            return 1e3
        told = eigenvalues(information(anchors, radios).sum(axis=0) / len(anchors))
        return float(np.sqrt((np.maximum(told, 1e-9) ** -0.75).sum(axis=0).mean()))

    limits = list(zip(mounting.box.low, mounting.box.high, strict=True)) * len(scene.setup.anchors)
    for generations in (30, 120):
        begun = time.process_time()
        found = differential_evolution(cost, limits, maxiter=generations, rng=1, tol=0.0, polish=False)
        reached = quality(scene.with_anchors(mounting.nearest(found.x.reshape(-1, 3))), places)
        console.print(
            f"differential evolution, {generations} generations: rms {1000.0 * reached.rms:.3f} mm, "
            f"{time.process_time() - begun:.1f} s CPU"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, help="folder that `companion study anchors --out` has written")
    parser.add_argument("--world", default="docking", help="whose radio, start and outliers are simulated")
    parser.add_argument("--places", type=int, default=10)
    parser.add_argument("--seeds", default="auto:8", help="auto:N: from the commit's hash; or 1..8")
    parser.add_argument("--seconds", type=float, default=40.0, help="of each run; errors count in its second half")
    parser.add_argument("--compare-searches", action="store_true", help="instead: against differential evolution")
    asked = parser.parse_args()
    choice = parse_seeds(asked.seeds)
    seeds = choice.given or drawn_seeds(current_commit(project_root()).hash, "anchor_study", choice.count or 8)
    study = json.loads((asked.study / "study.json").read_text(encoding="utf-8"))
    if study["proposal"] is None or study["proposal"]["kept"]:
        parser.error(f"{asked.study}: this study proposes no other anchors")
    given, world = read_given(study["source"]), DockingWorld.load(asked.world)
    scenes = (given.scene, given.scene.with_anchors(np.array(study["proposal"]["anchors"])))
    places = places_of(asked.study / "map.csv", asked.places)
    if asked.compare_searches:
        compare_searches(given.scene, places_of(asked.study / "map.csv", 200), Console())
        return
    table = Table(
        "place [m]", "given: map", "measured", "proposed: map", "measured", title="position error, rms of 3D [mm]"
    )
    foreseen, measured = np.zeros((len(places), 2)), np.zeros((len(places), 2))
    for row, place in enumerate(track(places, console=Console(stderr=True))):
        for column, scene in enumerate(scenes):
            squares = [error for seed in seeds for error in errors_at(scene, world, place, seed, asked.seconds)]
            foreseen[row, column], measured[row, column] = (
                whole_std(scene.by_ranges(place)),
                math.sqrt(float(np.mean(squares))),
            )
        cells = [1000.0 * figures[row, column] for column in (0, 1) for figures in (foreseen, measured)]
        table.add_row(", ".join(f"{value:.2f}" for value in place), *(f"{cell:.1f}" for cell in cells))
    console = Console()
    console.print(table)
    logs = np.log(foreseen.ravel()), np.log(measured.ravel())
    console.print(
        f"{len(seeds)} runs of {asked.seconds:g} s at each place; correlation of map and measured (logarithms) "
        f"{np.corrcoef(*logs)[0, 1]:.3f}, measured / map {np.median(measured / foreseen):.2f} (median)"
    )
    rms, worst = np.sqrt((measured**2).mean(axis=0)), measured.max(axis=0)
    for name, (before, after) in (
        ("rms over the places", rms),
        ("median", np.median(measured, axis=0)),
        ("worst", worst),
    ):
        console.print(
            f"{name}: {1000.0 * before:.1f} mm -> {1000.0 * after:.1f} mm, {100.0 * (1.0 - after / before):.0f} % less"
        )


if __name__ == "__main__":
    main()
