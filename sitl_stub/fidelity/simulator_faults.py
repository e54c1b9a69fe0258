"""What was done to PX4's simulator in a recording, as faults of the stub."""

import math
from collections.abc import Iterator
from itertools import pairwise

from sitl_stub.fidelity.recording import Recording

VISION_JUMP = 0.5
"""External vision that moves by more than this [m] between two messages has jumped."""
VISION_GAP = 0.4
"""External vision that is silent for longer [s] is lost (twice PX4's EV_MAX_INTERVAL)."""
VISION_RESET, VISION_TIMEOUT = 0.155, 1.155
"""PX4's estimator follows a jump after so long [s]: told of it by reset_counter, and not told (q13_ekf_reset)."""


def simulator_faults(recording: Recording, begin: float) -> Iterator[str]:
    """What was done to PX4's sensors, as faults of the stub; their times are simulation time."""
    if recording.parameters.get("SIM_GPS_USED", 1.0) == 0.0:
        yield "gnss_lost"
    for entry in recording.inputs:
        if entry.kind == "parameter" and entry.values["name"] == "SIM_GPS_USED":
            yield f"{'gnss_back' if entry.values['value'] else 'gnss_lost'}@{entry.t - begin:.3f}"
    vision = [entry for entry in recording.inputs if entry.kind == "evin"]
    for last, entry in pairwise(vision):
        step = [float(entry.values[axis]) - float(last.values[axis]) for axis in "xyz"]
        if entry.t - last.t > VISION_GAP:
            yield f"vision_lost@{last.t - begin:.3f}"
            yield f"vision_back@{entry.t - begin:.3f}"
        elif math.hypot(*step) > VISION_JUMP:
            waits = VISION_RESET if entry.values["reset_counter"] != last.values["reset_counter"] else VISION_TIMEOUT
            yield f"position_jump={step[0]:.3f},{step[1]:.3f},{step[2]:.3f}@{entry.t + waits - begin:.3f}"
    if vision and vision[-1].t < recording.end - VISION_TIMEOUT:
        yield f"vision_lost@{vision[-1].t - begin:.3f}"
