"""A pad out of sight: there by ranges, then by the camera (corners), virtual time; landings are the campaign's."""

from pathlib import Path

import numpy as np

from companion.campaign.flight import SimulatedFlight
from companion.config import load_flight
from companion.messages.decision import Mode
from companion.recording import MemoryRecorder

MISSION = Path(__file__).parents[2] / "missions" / "land_uwb_then_vision.yaml"


def test_it_flies_there_by_ranges_until_the_camera_sees_the_pad_and_records_both() -> None:
    recorder, modes, lowest_unseen, errors = MemoryRecorder(), [], [], []
    flight = SimulatedFlight(load_flight(MISSION), seed=3, camera="corners", recorder=recorder, time_limit_s=25.0)

    def watch(progress) -> None:
        snapshot = progress.snapshot
        if snapshot is None or snapshot.decision is None or snapshot.coarse is None:
            return
        if not modes or modes[-1] is not snapshot.decision.mode:
            modes.append(snapshot.decision.mode)
        if snapshot.decision.mode is Mode.TRANSIT and snapshot.picture.track is None:
            truth = flight.simulation.truth()
            offset = np.array(truth.targets[0].position_ned) - truth.vehicle.position_ned
            error = snapshot.coarse.position_ned - snapshot.ownship.position_ned - offset
            errors.append(np.hypot(error[0], error[1]) / snapshot.coarse.position_std)
            lowest_unseen.append(-snapshot.ownship.position_ned[2])

    flight.run(watch)
    assert modes[:4] == [Mode.PREFLIGHT, Mode.TAKEOFF, Mode.TRANSIT, Mode.REORIENT]
    assert min(lowest_unseen) > 3.6  # 4 m are asked for; the autopilot's height wanders
    assert max(errors) < 3.5

    ranges = recorder.recording().of("range")
    assert {record.data["anchor"] for record in ranges} == {0, 1, 2, 3}
    assert len(ranges) > 0.9 * 50.0 * 25.0
