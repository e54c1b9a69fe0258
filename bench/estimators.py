"""Compare the estimators and predictors on a synthetic world: errors, consistency and time per call.

Run: `python bench/estimators.py [--runs N]`.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "unit" / "estimation"))

from estimation_world import Run, Settings, build

from companion.estimation.consistency import fraction_inside, normalised_squared
from companion.estimation.ownship import OwnshipHistory
from companion.estimation.target_ekf import TargetEstimator
from companion.estimation.target_model import TargetEstimatorParameters
from companion.geometry.angles import wrap_angle
from companion.messages.target import TargetTrack

MOTIONS = ("static", "straight", "random", "stop_and_go")


def fly(run: Run, estimator: TargetEstimator, spent: dict[str, list[float]]) -> list[TargetTrack]:
    """Feed a run in order of arrival and ask for the track at 50 Hz."""
    history = OwnshipHistory()
    tracks = []
    k = 0
    for state in run.ownships:
        history.add(state)
        now = state.t + 0.005
        while k < len(run.measurements) and run.measurements[k][0] <= now:
            begin = time.perf_counter()
            estimator.update(run.measurements[k][1], history)
            spent["update"].append(time.perf_counter() - begin)
            k += 1
        begin = time.perf_counter()
        track = estimator.track(now, history)
        spent["track"].append(time.perf_counter() - begin)
        if track is not None:
            tracks.append(track)
    return tracks


def errors(run: Run, track: TargetTrack) -> np.ndarray:
    difference = track.state[:4] - run.truth(track.t)
    difference[3] = wrap_angle(difference[3])
    return difference


def estimator_row(name: str, motion: str, runs: list[Run], parameters: TargetEstimatorParameters) -> str:
    spent: dict[str, list[float]] = {"update": [], "track": []}
    nees, position, heading, velocity = [], [], [], []
    for run in runs:
        row = []
        for track in fly(run, TargetEstimator(parameters), spent):
            if track.t < 2.0:
                continue
            e = errors(run, track)
            row.append(normalised_squared(e, track.covariance[:4, :4]))
            position.append(e[:3])
            heading.append(e[3])
            apparent = (run.apparent(track.t + 0.05) - run.apparent(track.t - 0.05))[:3] / 0.1
            velocity.append(track.velocity_ned - apparent)
        nees.append(row)
    epochs = min(len(row) for row in nees)
    table = np.array([row[:epochs] for row in nees])
    p = np.array(position)
    return (
        f"{motion:12s} {name:16s} pos {rms(p[:, :2]):.4f} m  height {rms(p[:, 2:]):.4f} m  "
        f"heading {math.sqrt(np.mean(np.square(heading))):.4f} rad  velocity {rms(np.array(velocity)):.3f} m/s  "
        f"NEES {table.mean():.2f} inside {100 * fraction_inside(table, 4):.0f} %  "
        f"update {1e6 * np.median(spent['update']):.0f} us  track {1e6 * np.median(spent['track']):.0f} us"
    )


def rms(rows: np.ndarray) -> float:
    return math.sqrt(float(np.mean(np.sum(np.square(rows), axis=1))))


def worlds(motion: str, runs: int, **changes: Any) -> list[Run]:
    return [build(1000 + seed, Settings(motion=motion, **changes)) for seed in range(runs)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--motions", nargs="+", default=MOTIONS, choices=MOTIONS)
    arguments = parser.parse_args()
    print("Estimators (relative pose against the truth, 50 Hz, after the first 2 s)")
    for motion in arguments.motions:
        runs = worlds(motion, arguments.runs)
        for name, parameters in (
            ("augmented", TargetEstimatorParameters()),
            ("  no adaptation", TargetEstimatorParameters(adaptation_gain=0.0)),
            ("  tilt considered", TargetEstimatorParameters(tilt_estimated=False)),
            ("sliding_window", TargetEstimatorParameters(velocity_model="sliding_window")),
        ):
            print(estimator_row(name, motion, runs, parameters), flush=True)


if __name__ == "__main__":
    main()
