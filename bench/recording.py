"""What recording costs in one step of the pipeline, in CPU time. Run: python bench/recording.py"""

import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from companion.messages.decision import Decision, Mode, TransitionProbabilities
from companion.messages.motion import Setpoint
from companion.messages.ownship import OwnshipState
from companion.messages.target import Intercept, TargetPose, TargetTrack
from companion.recording import McapRecorder, to_record

STEPS = 3000
DATAGRAMS = 10  # in and out, in one step


def messages(rng: np.random.Generator, t: float) -> dict[str, object]:
    """Make what one step records while tracking."""
    vector = rng.normal(size=3)
    pose = TargetPose(
        t=t,
        position_ned=vector,
        velocity_ned=vector,
        acceleration_ned=vector,
        yaw=0.1 * t,
        yaw_rate=0.1,
        covariance=rng.normal(size=(4, 4)),
    )
    return {
        "ownship": OwnshipState(
            t=t,
            position_ned=vector,
            velocity_ned=vector,
            acceleration_ned=vector,
            ned_from_frd=rng.normal(size=(3, 3)),
            angular_velocity_frd=vector,
            reset_counter=0,
        ),
        "track": TargetTrack(
            t=t,
            t_measured=t,
            state=rng.normal(size=8),
            covariance=rng.normal(size=(8, 8)),
            position_ned=vector,
            velocity_ned=vector,
            yaw_ned=0.1,
            reset_counter=0,
            nis=1.0,
            nis_mean=1.0,
            fused=5,
            t_began=0.0,
        ),
        "intercept": Intercept(t=t, pose=pose, feasible=True, margin=1.0, probability=0.9),
        "target": pose,
        "decision": Decision(
            t=t,
            mode=Mode.LAND,
            switched=None,
            probabilities=TransitionProbabilities(a11=0.123, a22=0.234, a32=0.345, steady_align=0.456),
        ),
        "setpoint": Setpoint(
            t=t, position_ned=vector, velocity_ned=vector, acceleration_ned=vector, yaw=0.1, yaw_rate=0.1
        ),
    }


def main() -> None:
    rng = np.random.default_rng(0)
    steps = [(k / 50, messages(rng, k / 50)) for k in range(STEPS)]
    datagram = bytes(range(60))
    times: list[float] = []
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "flight.mcap"
        recorder = McapRecorder(path)
        for t, step in steps:
            begin = time.thread_time_ns()
            for channel, message in step.items():
                recorder.record(channel, t, to_record(message))
            for _ in range(DATAGRAMS):
                recorder.record_bytes("mavlink_in", t, datagram)
            times.append((time.thread_time_ns() - begin) * 1e-3)
        recorder.close()
        size = path.stat().st_size
    times.sort()
    print(
        f"one step ({len(steps[0][1])} messages, {DATAGRAMS} datagrams): mean {statistics.fmean(times):.0f} us, "
        f"median {statistics.median(times):.0f} us, p99 {times[int(0.99 * len(times))]:.0f} us (with a chunk); "
        f"{size / (STEPS / 50) / 1e3:.0f} kB/s of random numbers"
    )


if __name__ == "__main__":
    main()
