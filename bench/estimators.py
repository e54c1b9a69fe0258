"""Compare the estimators and predictors on a synthetic world: errors, consistency and time per call.

Run: `python bench/estimators.py [--runs N]`.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "unit" / "estimation"))

from estimation_world import Run, Settings, build

from companion.estimation.consistency import chi_square_quantile, fraction_inside, normalised_squared
from companion.estimation.ownship import OwnshipHistory
from companion.estimation.target_ekf import TargetEstimator
from companion.estimation.target_model import TargetEstimatorParameters
from companion.geometry.angles import wrap_angle
from companion.messages.target import Prediction, TargetTrack
from companion.prediction.intercept import earliest_intercept
from companion.prediction.parameters import PredictorParameters
from companion.prediction.predictor import make_predictor
from companion.prediction.reach import AcceleratingReach

MOTIONS = ("static", "straight", "circle", "sine", "random", "stop_and_go")


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


LEADS = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0)
DROPOUTS = (1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0)
METHODS: dict[str, PredictorParameters] = {
    "evidence": PredictorParameters(),
    "regularised": PredictorParameters(method="regularised"),
    "paper, L=30 at 0.1": PredictorParameters(method="paper", samples=30, spacing=0.1),
    "none": PredictorParameters(method="none"),
}
INSIDE = chi_square_quantile(0.95, 4)


class Misses:
    """Where the target really came to, against the forecast."""

    def __init__(self) -> None:
        self.misses: list[np.ndarray] = []
        self.squares: list[float] = []

    def add(self, run: Run, prediction: Prediction, t: float) -> None:
        pose = prediction.at(t)
        miss = np.append(pose.position_ned, pose.yaw) - run.apparent(t)
        miss[3] = wrap_angle(miss[3])
        self.misses.append(miss)
        self.squares.append(normalised_squared(miss, pose.covariance))

    def __str__(self) -> str:
        places = np.array(self.misses)
        inside = 100.0 * np.mean(np.array(self.squares) < INSIDE)
        return f"{rms(places[:, :2]):6.2f} m {rms(places[:, 3:]):5.2f} rad {inside:3.0f} %"


def predictor_rows(motion: str, runs: list[Run]) -> list[str]:
    """Forecasts of a target in sight, by how far they look ahead."""
    tracks = [fly(run, TargetEstimator(), {"update": [], "track": []}) for run in runs]
    rows = []
    for name, parameters in METHODS.items():
        ahead = {lead: Misses() for lead in LEADS}
        spent: list[float] = []
        for run, sequence in zip(runs, tracks, strict=True):
            predictor = make_predictor(parameters)
            for number, track in enumerate(sequence):
                begin = time.thread_time()
                predictor.add(track)
                prediction = predictor.predict()
                spent.append(time.thread_time() - begin)
                if prediction is None or number % 10 or track.t < 4.0 or track.t + LEADS[-1] > run.times[-1] - 0.1:
                    continue
                for lead, misses in ahead.items():
                    misses.add(run, prediction, track.t + lead)
        text = "  ".join(f"{lead:4.1f} s: {misses}" for lead, misses in ahead.items())
        often, late = 1e6 * np.median(spent), 1e6 * np.quantile(spent, 0.99)
        rows.append(f"{motion:12s} {name:18s} {text}  {often:.0f} us, p99 {late:.0f} us")
    return rows


def dropout_rows(motion: str, count: int) -> list[str]:
    """Forecasts at the end of dropouts, with 5 s of sight between them."""
    ends: dict[str, list[str]] = {name: [] for name in METHODS}
    for length in DROPOUTS:
        runs = worlds(motion, count, blind=length, duration=5.0 + 3.0 * (5.0 + length))
        tracks = [fly(run, TargetEstimator(), {"update": [], "track": []}) for run in runs]
        for name, parameters in METHODS.items():
            misses = Misses()
            for run, sequence in zip(runs, tracks, strict=True):
                predictor = make_predictor(parameters)
                for track, following in itertools.pairwise(sequence):
                    predictor.add(track)
                    prediction = predictor.predict()
                    if prediction is not None and track.age > 0.8 * length and following.age < track.age:
                        misses.add(run, prediction, track.t)
            ends[name].append(f"{length:2.0f} s: {misses}")
    return [f"{motion:12s} {name:18s} " + "  ".join(texts) for name, texts in ends.items()]


def rms(rows: np.ndarray) -> float:
    return math.sqrt(float(np.mean(np.sum(np.square(rows), axis=1))))


def worlds(motion: str, runs: int, **changes: Any) -> list[Run]:
    return [build(1000 + seed, Settings(motion=motion, **changes)) for seed in range(runs)]


def compare_estimators(motions: list[str], runs_each: int) -> None:
    print("Estimators (relative pose against the truth, 50 Hz, after the first 2 s)")
    for motion in motions:
        runs = worlds(motion, runs_each)
        for name, parameters in (
            ("augmented", TargetEstimatorParameters()),
            ("  no adaptation", TargetEstimatorParameters(adaptation_gain=0.0)),
            ("  tilt estimated", TargetEstimatorParameters(tilt_estimated=True)),
            ("sliding_window", TargetEstimatorParameters(velocity_model="sliding_window")),
        ):
            print(estimator_row(name, motion, runs, parameters), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--predictors", action="store_true", help="leave the estimators out")
    parser.add_argument("--times", action="store_true", help="only the time that forecast and intercept take")
    parser.add_argument("--motions", nargs="+", default=MOTIONS, choices=MOTIONS)
    arguments = parser.parse_args()
    if arguments.times:
        print(call_times())
        return
    if not arguments.predictors:
        compare_estimators(arguments.motions, arguments.runs)
    print(
        "Predictors: horizontal miss, heading miss, share inside the bounds of 95 % (4 degrees of freedom), by the lead"
    )
    for motion in arguments.motions:
        for row in predictor_rows(motion, worlds(motion, max(2, arguments.runs // 2), duration=40.0)):
            print(row, flush=True)
    print("The same at the end of dropouts, with 5 s of sight between them")
    for motion in arguments.motions:
        for row in dropout_rows(motion, max(2, arguments.runs // 5)):
            print(row, flush=True)
    print(call_times())


def call_times() -> str:
    """CPU time of adding, predicting and the intercept in each call at 50 Hz; the least of five equal passes."""
    tracks = fly(build(1, Settings(motion="straight", duration=40.0)), TargetEstimator(), {"update": [], "track": []})
    passes = []
    for _ in range(5):
        predictor, spent = make_predictor(PredictorParameters()), []
        for track in tracks:
            begin = time.thread_time()
            predictor.add(track)
            prediction = predictor.predict()
            assert prediction is not None
            forecast = time.thread_time()
            earliest_intercept(
                prediction=prediction,
                position_ned=track.position_ned + np.array([2.0, 1.0, -3.0]),
                velocity_ned=np.array([1.0, 0.0, 0.0]),
                reach=AcceleratingReach(speed=2.0, acceleration=2.0),
                t=track.t,
                horizon=6.0,
            )
            end = time.thread_time()
            spent.append((end - begin, end - forecast))
        passes.append(spent)
    together, search = 1e6 * np.min(passes, axis=0).T
    median, often, late = np.quantile(together, [0.5, 0.9, 0.99])
    return (
        f"forecast and intercept together {median:.0f} us (median), p90 {often:.0f} us, p99 {late:.0f} us; "
        f"intercept alone {np.median(search):.0f} us (median)"
    )


if __name__ == "__main__":
    main()
