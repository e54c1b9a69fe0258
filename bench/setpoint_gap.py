"""Gaps between setpoints on the wire during a landing in real time, camera, detection and recording running.

Run: python bench/setpoint_gap.py (about a minute). Required: p99.9 at most 40 ms, at most 100 ms.
"""

from __future__ import annotations

import json
from itertools import pairwise

from programs import programs


def main() -> None:
    with programs(auto=True) as running:
        output, said = running.fly.communicate(timeout=180.0)
        starved = running.stop_stub()
        setpoints = running.wire.setpoints()
    if not output.strip():
        raise SystemExit(said)
    result = json.loads(output.strip().splitlines()[-1])
    gaps = sorted(1e3 * (later.t - earlier.t) for earlier, later in pairwise(setpoints))
    if not gaps:
        raise SystemExit(f"no setpoints: {result['reason']}")
    print(f"flight: {result['outcome']}, {result['reason']}; frames searched: {result['ticks']['frames']}")
    print(f"simulator behind the clock by {starved:.1f} s in all (it shares the machine)")
    print(f"guardian's ticks: {result['ticks']}")
    begin = setpoints[0].t
    for earlier, later in pairwise(setpoints):
        if later.t - earlier.t > 0.04:
            print(f"  gap of {1e3 * (later.t - earlier.t):.1f} ms, {earlier.t - begin:.2f} s after the first setpoint")
    for share, name in ((0.5, "median"), (0.99, "p99"), (0.999, "p99.9")):
        print(f"setpoint gap, {name:6s} {gaps[min(int(share * len(gaps)), len(gaps) - 1)]:7.1f} ms")
    print(f"setpoint gap, max    {gaps[-1]:7.1f} ms   of {len(gaps)}   (required: p99.9 <= 40 ms, max <= 100 ms)")


if __name__ == "__main__":
    main()
