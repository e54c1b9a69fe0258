"""The landing missions with the world beside an external autopilot, in real time: three programs on loopback.

`sitl-stub vehicle` plays the autopilot; `sitl-stub world` knows it by its telemetry only; `companion fly` sees the
world's camera. Errors are against the world's truth. What was flown is kept in runs/world_apart, for the same code,
and not flown again. A flight in which a simulator fell behind the clock says nothing and is flown again.

Run: python bench/world_apart.py [--flights 5] [--mission land_static] (half a minute to one and a half per flight).
Required, as in simulation: all land; mean error 0.040 m static, 0.042 m moving, 0.080 m random.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import tempfile
from pathlib import Path
from typing import Any

from processes import ROOT, fly, halves, landing_errors
from rich.progress import track

from companion.campaign.seeds import drawn_seeds
from companion.campaign.versions import current_commit, fingerprint

MISSIONS = {
    "land_static": ("static_pad", 0.040, 0.006),
    "land_moving": ("moving_pad", 0.042, 0.008),
    "follow_then_land": ("random_pad", 0.080, math.inf),
}
TRIES, STARVED_S, FLIGHT_S = 3, 0.25, 300.0


def flown(mission: str, world: str, seed: int) -> dict[str, Any]:
    """Fly once; give the row of the table."""
    row: dict[str, Any] = {}
    for _ in range(TRIES):
        with tempfile.TemporaryDirectory() as folder, halves(world, seed=seed) as simulator:
            code, result, said = fly(simulator.url, simulator.camera, Path(folder), mission=mission, seconds=FLIGHT_S)
            truth = simulator.stop().world
        position, heading = landing_errors(truth)
        row = {
            "mission": mission,
            "seed": seed,
            "landed": code == 0 and (truth["armed"], truth["surface"], truth["feet_in_contact"]) == (False, "pad", 4),
            "position_error_m": position,
            "angular_error_rad": abs(heading),
            "reason": result.get("reason", said.strip().splitlines()[-1:]),
            "starved_s": simulator.starved,
        }
        if simulator.starved < STARVED_S:
            break
    return row


def show(rows: list[dict[str, Any]]) -> None:
    """Print the table."""
    for row in rows:
        if not row["landed"]:
            print(f"{row['mission']}, seed {row['seed']}: {row['reason']} (behind the clock {row['starved_s']:.1f} s)")
    for mission, (_, position, angle) in MISSIONS.items():
        mine = [row for row in rows if row["mission"] == mission]
        if mine:
            errors = [statistics.fmean(row[key] for row in mine) for key in ("position_error_m", "angular_error_rad")]
            print(
                f"{mission:17s} landed {sum(row['landed'] for row in mine)}/{len(mine)}, mean error {errors[0]:.4f} m "
                f"(required {position:g}), {errors[1]:.4f} rad (required {angle:g})"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=5, help="of each mission; seeds are drawn from the commit")
    parser.add_argument("--mission", choices=tuple(MISSIONS), action="append", help="only these")
    arguments = parser.parse_args()
    if arguments.flights < 1:
        parser.error(f"--flights {arguments.flights}: at least 1")
    store = ROOT / "runs" / "world_apart" / fingerprint(ROOT)
    store.mkdir(parents=True, exist_ok=True)
    commit = current_commit(ROOT).hash
    todo = [
        (mission, seed)
        for mission in arguments.mission or MISSIONS
        for seed in drawn_seeds(commit, mission, arguments.flights)
    ]
    rows = []
    for mission, seed in track(todo, description="flying"):
        path = store / f"{mission}-{seed}.json"
        if not path.exists():
            path.write_text(json.dumps(flown(mission, MISSIONS[mission][0], seed)), encoding="utf-8")
        rows.append(json.loads(path.read_text(encoding="utf-8")))
    show(rows)


if __name__ == "__main__":
    main()
