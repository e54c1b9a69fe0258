"""A pilot who takes the vehicle in the middle of a mission, for the scenarios."""

from companion.campaign.flight import SimulatedFlight
from companion.messages.guardian import GuardianState
from companion.runtime.ports import MissionState
from sitl_stub.vehicle.modes import Mode


def assert_left_alone_after_takeover(simulated: SimulatedFlight, mode: Mode, *, at: float) -> None:
    """Fly; at the first step after `at` [s] the pilot takes the vehicle: nothing is sent from 0.6 s later on."""
    taken, sent_after = False, 0

    def watch(progress) -> None:
        nonlocal taken, sent_after
        if progress.t > at and not taken:
            taken = True
            assert simulated.pipeline.helm.state is GuardianState.FOLLOWING
            simulated.simulation.autopilot.commander.request_mode(mode)
        if progress.t > at + 0.6:
            sent_after += progress.snapshot.guardian.setpoint is not None

    simulated.run(watch)
    assert taken
    assert simulated.pipeline.helm.state is GuardianState.MUTED
    assert simulated.pipeline.mission.state is MissionState.ABORTED
    assert sent_after == 0
