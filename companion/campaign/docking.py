"""A docking in the simulator, in virtual time: mission and truth in one process, scored."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Sequence

import numpy as np

from companion.campaign.result import DockingFigures, FlightResult, Outcome
from companion.config.docking import Docking, load_docking
from companion.errors import InputError
from companion.guidance.docking.policies import SwitchingPolicy
from companion.messages.docking import DockingMode, DockingSwitch
from companion.messages.proximity import FeatureReading, GyroReading, ProximityState, RangeReading
from companion.recording import Recorder
from companion.runtime.docking.pipeline import DockingStep, Reading
from companion.runtime.docking.wiring import build_docking, initial_state
from sitl_stub.cubesat import readings as simulated
from sitl_stub.cubesat.contact import Contact
from sitl_stub.cubesat.simulation import CubesatSimulation, CubesatTruth
from sitl_stub.cubesat.vehicle import CubesatVehicle
from sitl_stub.cubesat.world import DockingWorld
from sitl_stub.world.documents import WorldFileError

VEHICLE = "cubesat"
_AFTER_TIMEOUT_S = 120.0  # for the retreat
_SETTLES_S = 1.0  # after it holds, or is docked

OnStep = Callable[[DockingStep, CubesatTruth], None]


class SimulatedDocking:
    """One docking: the simulated spacecraft, and the pipeline that docks it.

    Args:
        docking: the checked mission with all that it names.
        seed: of the simulation.
        recorder: takes the recording, and is closed at the end; None: nothing is kept.
        policy: instead of the mission's own.

    Raises:
        InputError: the world cannot be loaded, or does not hold what survey and port say.
    """

    def __init__(
        self,
        docking: Docking,
        *,
        seed: int,
        recorder: Recorder | None = None,
        policy: SwitchingPolicy | None = None,
    ) -> None:
        self._docking = docking
        self._seed = seed
        self._recorder = recorder
        vehicle = CubesatVehicle.load(VEHICLE)
        world = _world(docking)
        self._allowed = world.docked
        self.simulation = CubesatSimulation(vehicle, world, seed)
        self.pipeline = build_docking(docking, told_start(self.simulation), recorder, policy)
        self._switches: list[DockingSwitch] = []
        self._first_align: float | None = None
        self._gated: dict[tuple[float, int], bool] = {}  # by time [s] and anchor: whether a range was fused
        if recorder is not None:
            recorder.record("scene", 0.0, _scene_record(docking, self.simulation, vehicle))

    def run(self, on_step: OnStep | None = None) -> FlightResult:
        """Fly until docked, given up or out of time; give the result, scored against the truth.

        Args:
            on_step: called after each control period with what the pipeline did and the truth then.
        """
        started = time.perf_counter()
        period = self._docking.config.spacecraft.control.period
        limit = self._docking.config.guidance.timeout + _AFTER_TIMEOUT_S
        simulation = self.simulation
        ended, tick = math.inf, 0
        while True:
            t = tick * period
            simulation.advance(t)
            truth = simulation.truth
            step = self.pipeline.step(t, self._arrived(), contact=truth.contact is not None and truth.contact.docked)
            simulation.command(t, step.pulses.on_times)
            self._watch(step, truth)
            if on_step is not None:
                on_step(step, truth)
            if simulation.ended or step.decision.mode in (DockingMode.DOCKED, DockingMode.HOLD):
                ended = min(ended, t)
            if t >= min(limit, ended + _SETTLES_S):
                break
            tick += 1
        result = self._score(step, min(ended, t), time.perf_counter() - started)
        if self._recorder is not None:
            self._recorder.record("result", t, result.as_json(with_wall=False))
            self._recorder.close()
        return result

    def inaccuracy(self, result: FlightResult) -> float:
        """Give the squares of the errors at contact, over what counts as docked: of position, and of attitude, summed.

        Raises:
            ValueError: there was no contact.
        """
        if result.position_error_m is None or result.angular_error_rad is None:
            raise ValueError("the chaser has not touched the target, so that there are no errors at contact")
        allowed = self._allowed
        position = result.position_error_m / allowed.position_error_max
        attitude = result.angular_error_rad / allowed.attitude_error_max
        return position * position + attitude * attitude

    def _arrived(self) -> list[Reading]:
        return [_reading(reading) for reading in self.simulation.readings()]

    def _watch(self, step: DockingStep, truth: CubesatTruth) -> None:
        decision = step.decision
        self._gated.update({(gated.t, gated.anchor): gated.accepted for gated in step.ranges})
        if decision.switched is not None:
            self._switches.append(decision.switched)
        if self._first_align is None:
            self._first_align = decision.align_range
        if self._recorder is not None:
            self._recorder.record("truth", truth.t, _truth_record(truth))

    def _score(self, last: DockingStep, t_end: float, wall_s: float) -> FlightResult:
        contact = self.simulation.truth.contact
        outcome, reason = _ending(contact, last)
        outliers = {(outlier.t, outlier.anchor) for outlier in self.simulation.outliers} & self._gated.keys()
        rejected = {key for key, accepted in self._gated.items() if not accepted}
        figures = DockingFigures(
            policy=self._docking.mission.step.policy.value,
            impulse_ns=self.simulation.truth.impulse_ns,
            lateral_speed_mps=None if contact is None else contact.lateral_speed,
            reorient_range_m=last.decision.reorient_range,
            align_range_m=self._first_align,
            attempts=last.decision.failed_attempts + (contact is not None),
            outliers=len(outliers),
            outliers_rejected=len(outliers & rejected),
            ranges=len(self._gated.keys() - outliers),
            ranges_rejected=len(rejected - outliers),
        )
        return FlightResult(
            outcome=outcome,
            success=outcome is Outcome.DOCKED,
            reason=reason,
            position_error_m=None if contact is None else math.hypot(*contact.position_error),
            angular_error_rad=None if contact is None else contact.attitude_error,
            station_keeping=None,
            duration_s=t_end if contact is None else contact.t,
            touchdown_speed_mps=None if contact is None else contact.closing_speed,
            mode_history=tuple(self._switches),
            limits_violated=(),
            tracking_gap_s=None,
            wall_s=wall_s,
            seed=self._seed,
            docking=figures,
        )


def run_docking(
    mission_path: str | os.PathLike[str],
    *,
    seed: int,
    config_path: str | os.PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    recorder: Recorder | None = None,
) -> FlightResult:
    """Load a docking mission and fly it once in the simulator.

    Raises:
        InputError: with every problem of every file.
    """
    docking = load_docking(mission_path, config_path=config_path, overrides=overrides)
    return SimulatedDocking(docking, seed=seed, recorder=recorder).run()


def wrong_with_docking_world(world: str) -> str | None:
    """Say what the simulator finds wrong with a docking world; None: nothing."""
    try:
        DockingWorld.load(world)
    except WorldFileError as error:
        return str(error)
    return None


def _world(docking: Docking) -> DockingWorld:
    """Load the mission's world; it must be the one that survey and port describe."""
    mission = docking.mission
    try:
        world = DockingWorld.load(mission.world)
        if mission.start_m is not None:
            world = world.starting_at(mission.start_m)
    except WorldFileError as error:
        raise _wrong_world(mission.source, str(error), "correct the world file, or simulation.start_m") from None
    for what, there, known in (
        ("anchors", len(world.anchors), len(docking.survey.anchors)),
        ("markers", len(world.target.markers), len(docking.port.markers)),
    ):
        if there != known:
            wrong = f"{mission.world} has {there} {what}, but {known} are known"
            raise _wrong_world(mission.source, wrong, "let the survey and the port's file describe that world")
    return world


def _wrong_world(source: str, wrong: str, right: str) -> InputError:
    return InputError.single(source=source, key="simulation.world", wrong=wrong, right=right)


def told_start(simulation: CubesatSimulation) -> ProximityState:
    """Give what the simulated chaser is told about its start, wrong as it is."""
    told = simulation.initial_estimate()
    return initial_state(
        position=np.array(told.position),
        velocity=np.array(told.velocity),
        quaternion=np.array(told.quaternion),
        position_std=told.position_std,
        velocity_std=told.velocity_std,
        attitude_std=told.attitude_std,
    )


def _reading(reading: simulated.Reading) -> Reading:
    if isinstance(reading, simulated.GyroReading):
        return GyroReading(t=reading.t, rate=np.array(reading.rate))
    if isinstance(reading, simulated.RangeReading):
        return RangeReading(t=reading.t, anchor=reading.anchor, range=reading.range)
    positions = np.array(reading.positions, dtype=np.float64).reshape(-1, 3)
    return FeatureReading(t=reading.t, markers=reading.markers, positions=positions)


def _ending(contact: Contact | None, last: DockingStep) -> tuple[Outcome, str]:
    """Say how it ended, from the truth."""
    if contact is None:
        switched = last.decision.mode
        if switched is DockingMode.HOLD:
            return Outcome.HELD, "given up: it holds, clear of the target"
        return Outcome.FAILED, f"no contact: still in {switched.value}"
    if contact.docked:
        return Outcome.DOCKED, ""
    where = "beside the docking face" if contact.kind != "docking_face" else "on the docking face"
    return Outcome.FAILED, (
        f"a miss {where} at {contact.t:.1f} s: {1000.0 * math.hypot(*contact.position_error):.1f} mm, "
        f"{contact.attitude_error:.3f} rad off, closing {1000.0 * contact.closing_speed:.1f} mm/s, "
        f"lateral {1000.0 * contact.lateral_speed:.1f} mm/s"
    )


def _scene_record(docking: Docking, simulation: CubesatSimulation, vehicle: CubesatVehicle) -> dict[str, object]:
    """Say what stands where: as known, in c; the last two as it really is."""
    port, camera = docking.port, docking.config.spacecraft.camera
    return {
        "anchors": docking.survey.positions.tolist(),
        "target_position": port.position.tolist(),
        "target_quaternion": port.quaternion.tolist(),
        "target_side": port.side,
        "normal": port.outward.tolist(),
        "docked_position": port.docked_position.tolist(),
        "camera_position": list(camera.position_m),
        "camera_quaternion": list(camera.quaternion),
        "camera_half_angle": vehicle.camera.half_angle,
        "true_docked_position": list(simulation.docked_place),
        "true_target_quaternion": list(simulation.target.quaternion),
    }


def _truth_record(truth: CubesatTruth) -> dict[str, object]:
    return {
        "t": truth.t,
        "position": list(truth.position),
        "velocity": list(truth.velocity),
        "quaternion": list(truth.quaternion),
        "rate": list(truth.rate),
        "impulse_ns": truth.impulse_ns,
    }
