"""One simulated flight: mission and simulator in one process, virtual time. The same seed gives the same bytes."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from companion.campaign.approach_score import ApproachScorer
from companion.campaign.float_limits import FloatLimits
from companion.campaign.ground_score import GroundScorer, GroundScoring
from companion.campaign.limits import DriveLimits, FlightLimits
from companion.campaign.result import FlightResult, Outcome
from companion.campaign.score import FlightScorer, ScoringParameters
from companion.campaign.truth import sample_truth, truth_record
from companion.config import Flight, load_flight
from companion.config.sections import VehicleType
from companion.config.vehicle import floats
from companion.errors import InputError
from companion.messages.decision import Mode
from companion.recording.recorder import NullRecorder, Recorder
from companion.runtime.lockstep import Lockstep, LockstepParameters
from companion.runtime.pipeline import Snapshot
from companion.runtime.ports import MissionStatus
from companion.runtime.wiring import build_detector, build_pipeline
from companion.vehicles.multicopter import Multicopter
from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.config import VehicleFileError
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.world.documents import WorldFileError
from sitl_stub.world.world import World

Camera = Literal["rendered", "corners"]
SIMULATED = {  # of the simulator
    VehicleType.MULTICOPTER: "x500",
    VehicleType.ROVER: "rover",
    VehicleType.FREE_FLYER: "free_flyer",
}
_TRUTH_EVERY_S = 0.02
_AFTER_END_S = 12.0  # simulated on after the mission's own end, to see the vehicle at rest
_TIME_LIMIT_S = 600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """What a progress display shows."""

    t: float  # [s] simulated
    mission: MissionStatus
    snapshot: Snapshot | None


class SimulatedFlight:
    """A mission in the simulator, ready to be flown once.

    Args:
        flight: the checked mission with its configuration.
        seed: of the simulator.
        camera: "rendered" pictures, or tag "corners" directly.
        recorder: takes the recording.
        faults: for the simulated autopilot, see `sitl_stub`.
        time_limit_s: simulated time [s] after which the flight is broken off.
        auto_engage: engage by itself; otherwise `pipeline.helm.order` does.

    Raises:
        InputError: the world or the simulated vehicle cannot be loaded, or the pad or calibration is wrong.
    """

    def __init__(
        self,
        flight: Flight,
        *,
        seed: int,
        camera: Camera,
        recorder: Recorder | None = None,
        faults: Sequence[str] = (),
        time_limit_s: float = _TIME_LIMIT_S,
        auto_engage: bool = True,
    ) -> None:
        self.flight = flight
        self._seed = seed
        self._recorder = recorder or NullRecorder()
        self._time_limit = time_limit_s
        try:
            world = World.load(flight.mission.world)
            if flight.mission.dropout_s is not None:
                world = world.with_dropouts(flight.mission.dropout_s)
            mission = flight.mission
            world = world.with_measurements(interval=mission.interval_s, corrupted=mission.corrupted_fraction)
            vehicle = load_vehicle(SIMULATED[flight.config.vehicle.type])
        except (WorldFileError, VehicleFileError) as error:
            raise InputError.single(
                source=flight.mission.source, key="simulation.world", wrong=str(error), right="correct the world file"
            ) from None
        if flight.mission.wind_mps is not None:
            world = world.in_wind(flight.mission.wind_mps)
        self.simulation = Simulation(world, vehicle, seed, camera, faults=faults)
        self.pipeline = build_pipeline(flight, self._recorder, auto_engage=auto_engage)
        self._lockstep = Lockstep(
            pipeline=self.pipeline,
            simulation=self.simulation,
            detector=build_detector(flight),
            parameters=LockstepParameters(),
        )
        self._scorer = _scorer(flight)
        self._approach = None if flight.plan.transit is None else ApproachScorer(flight.config.guidance.airframe)
        self._t_ended: float | None = None
        self._t_fused = -1.0

    def run(self, on_progress: Callable[[Progress], None] | None = None) -> FlightResult:
        """Fly to the end and give the result, scored against the truth."""
        started = time.perf_counter()

        def on_step(t: float) -> bool:
            self._watch(t)
            if on_progress is not None:
                on_progress(Progress(t=t, mission=self.pipeline.mission, snapshot=self.pipeline.snapshot))
            return not self._over(t)

        self._lockstep.run(self._time_limit, on_step)
        mission = self.pipeline.mission
        scored = self._scorer.finish(
            state=mission.state,
            reason=mission.reason,
            seed=self._seed,
            wall_s=time.perf_counter() - started,
            t_end=self._t_ended,
        )
        result = replace(
            scored,
            wind_mps=self.simulation.mean_wind,
            approach=None if self._approach is None else self._approach.figures,
        )
        self._recorder.record("result", self._lockstep.t, result.as_json(with_wall=False))
        self._recorder.close()
        return result

    def _watch(self, t: float) -> None:
        truth = self.simulation.truth()
        self._recorder.record("truth", t, truth_record(truth))
        sample = sample_truth(truth)
        self._scorer.truth(sample)
        snapshot = self.pipeline.snapshot
        if snapshot is None:
            return
        if self._approach is not None:
            self._approach.watch(sample, snapshot)
        if snapshot.decision is not None and snapshot.decision.switched is not None and snapshot.decision.t == t:
            self._scorer.switched(snapshot.decision.switched)
        if snapshot.guardian.setpoint is not None:
            self._scorer.setpoint(snapshot.guardian.setpoint)
        track, prediction, ownship = snapshot.picture.track, snapshot.picture.prediction, snapshot.ownship
        if isinstance(self._scorer, GroundScorer):
            self._scorer.predicted(track, prediction, ownship)
        if track is not None and track.t_measured > self._t_fused:
            self._t_fused = track.t_measured
            self._scorer.measured(track.t_measured, began=track.t_began)

    def _over(self, t: float) -> bool:
        if not self.pipeline.mission.ended:
            return False
        if self._t_ended is None:
            self._t_ended = t
        if self.pipeline.mission.mode is Mode.PREFLIGHT:
            return t - self._t_ended > 1.0
        return self._scorer.settled or t - self._t_ended > _AFTER_END_S


def _scorer(flight: Flight) -> FlightScorer | GroundScorer:
    coast = flight.mission.on_target_lost.coast_s
    ground, vehicle = flight.plan.ground, flight.config.vehicle
    if ground is None:
        return FlightScorer(
            ScoringParameters(goal=_goal(flight), coast_s=coast),
            FlightLimits(motion=Multicopter(parameters=vehicle.multicopter).limits),
        )
    return GroundScorer(
        GroundScoring(
            goal=Outcome.FOLLOWED if ground.keeps_station else Outcome.INTERCEPTED,
            standoff_m=ground.standoff_m,
            coast_s=coast,
        ),
        _ground_limits(flight),
    )


def _ground_limits(flight: Flight) -> DriveLimits | FloatLimits:
    if floats(flight.config):
        flyer = flight.config.vehicle.free_flyer
        return FloatLimits(speed=flyer.speed, footprint_radius=flyer.footprint_radius, clearance=flight.pad.clearance)
    rover = flight.config.vehicle.rover
    return DriveLimits(
        speed_forward=rover.speed_forward,
        speed_reverse=rover.speed_reverse,
        acceleration=rover.acceleration,
        yaw_rate=rover.yaw_rate,
        turning_radius=rover.turning_radius,
        nearest=0.5 * (rover.length + max(flight.pad.size)),
    )


def _goal(flight: Flight) -> Outcome:
    if flight.plan.land is not None:
        return Outcome.LANDED
    return Outcome.FOLLOWED if flight.plan.follow is not None else Outcome.HELD


def run_flight(
    mission_path: str | os.PathLike[str],
    *,
    seed: int,
    camera: Camera = "rendered",
    config_path: str | os.PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    recorder: Recorder | None = None,
) -> FlightResult:
    """Load a mission and fly it once in the simulator.

    Raises:
        InputError: with every problem of every file.
    """
    flight = load_flight(mission_path, config_path=config_path, overrides=overrides)
    return SimulatedFlight(flight, seed=seed, camera=camera, recorder=recorder).run()
