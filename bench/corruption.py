"""Half of the measurements random: how much worse is the track, and how much worse must it be?

For each motion, rate and share of random measurements (range, bearing and heading drawn anew): the error of the track,
its ratio to the error without random ones, and its ratio to that of the same filter told which ones are random and so
spared them, which no filter can beat that has to find out for itself.

Run: `python bench/corruption.py [--runs N] [--rates 30 5 2 1] [--motions ...] [--speed V] [--wander W]`.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "unit" / "estimation"))

from estimation_world import Run, Settings, build, corrupted

from companion.estimation.ownship import OwnshipHistory
from companion.estimation.target_ekf import TargetEstimator
from companion.geometry.angles import wrap_angle
from companion.prediction.coasting import coasted
from companion.prediction.parameters import PredictorParameters
from companion.prediction.predictor import make_predictor

MOTIONS = ("static", "straight", "circle", "random", "stop_and_go")
SHARES = (0.0, 0.25, 0.5)
SETTLED = 5.0, 8  # [s] and measurements after which it counts
FRESH_S = PredictorParameters().fresh  # [s] without a measurement after which the forecast stands for the track
WRONG_M = 1.0  # [m] a track farther off than this is a wrong one


class Errors:
    """What a filter was wrong by, and how long its updates took."""

    def __init__(self) -> None:
        self.position: list[float] = []
        self.heading: list[float] = []
        self.normalised: list[float] = []
        self.spent: list[float] = []

    def fly(self, run: Run, rate: float) -> None:
        """Feed a run in order of arrival and ask for the track at 25 Hz; `rate` [Hz] of the measurements."""
        estimator, history, k = TargetEstimator(), OwnshipHistory(), 0
        predictor = make_predictor(PredictorParameters())
        for number, state in enumerate(run.ownships):
            history.add(state)
            now = state.t + 0.005
            while k < len(run.measurements) and run.measurements[k][0] <= now:
                begin = time.thread_time()
                estimator.update(run.measurements[k][1], history)
                self.spent.append(time.thread_time() - begin)
                k += 1
            track = estimator.track(now, history)
            if track is None:
                continue
            predictor.add(track)
            if track.age > FRESH_S:
                track = coasted(track, predictor.predict(), state)
            if number % 2 == 0 and now > SETTLED[0] and now > 0.5 + SETTLED[1] / rate:
                wrong = track.state[:4] - run.truth(track.t)
                wrong[3] = wrap_angle(wrong[3])
                self.position.append(float(np.linalg.norm(wrong[:3])))
                self.heading.append(float(wrong[3]))
                self.normalised.append(float(wrong @ np.linalg.solve(track.covariance[:4, :4], wrong)))

    @property
    def rms(self) -> float:
        """Of the position [m]."""
        return math.sqrt(float(np.mean(np.square(self.position))))


def row(runs: list[Run], rate: float, share: float, clean: Errors | None) -> tuple[str, Errors]:
    """Fly the runs with a share of random measurements; `clean`: without any."""
    blind, told = Errors(), Errors()
    for seed, run in enumerate(runs):
        blind.fly(corrupted(run, share, seed), rate)
        if clean is not None:
            told.fly(corrupted(run, share, seed, told=True), rate)
    text = (
        f"p {share:4.2f}  rms {blind.rms:.3f} m, {math.sqrt(float(np.mean(np.square(blind.heading)))):.3f} rad  "
        f"NEES {np.mean(blind.normalised):6.1f}  wrong {100 * np.mean(np.array(blind.position) > WRONG_M):4.1f} %  "
        f"update {1e6 * np.median(blind.spent):.0f} us, p99 {1e6 * np.quantile(blind.spent, 0.99):.0f} us"
    )
    if clean is not None:
        text += f"  to p = 0: {blind.rms / clean.rms:5.2f}  to one told: {blind.rms / told.rms:5.2f}"
    return text, blind


def main() -> None:
    """Print a row for each cell of the grid."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--speed", type=float, default=0.5, help="of the target [m/s]")
    parser.add_argument(
        "--wander", type=float, default=1.0, help="of the odometry, against that of a hovering multirotor"
    )
    parser.add_argument("--rates", nargs="+", type=float, default=(30.0, 5.0, 2.0, 1.0))
    parser.add_argument("--motions", nargs="+", default=MOTIONS, choices=MOTIONS)
    arguments = parser.parse_args()
    for motion in arguments.motions:
        for rate in arguments.rates:
            settings = Settings(
                motion=motion,
                duration=arguments.seconds,
                rate=rate,
                dropout=0.0,
                speed=arguments.speed,
                wander=arguments.wander,
            )
            runs = [build(2000 + seed, settings) for seed in range(arguments.runs)]
            clean = None
            for share in SHARES:
                text, errors = row(runs, rate, share, clean)
                clean = clean or errors
                print(f"{motion:12s} {rate:4.0f} Hz  {text}", flush=True)


if __name__ == "__main__":
    main()
