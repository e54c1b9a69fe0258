"""Which recording shows what: the experiments and their rows."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from sitl_stub.fidelity import noise, profiles, rates, rover, steps
from sitl_stub.fidelity.flight import CHANNELS, Flight
from sitl_stub.fidelity.recording import Recording, read_recording
from sitl_stub.fidelity.replay import Errors, Replay
from sitl_stub.fidelity.row import Row
from sitl_stub.fidelity.sequence import compare
from sitl_stub.vehicle.config import VehicleConfig

VEHICLES = {"sihsim_quadx": "sih_quadrotor"}
"""The stub's vehicle for each model of PX4's simulator."""
SEED = 1
OWN_ERRORS = frozenset({"q11_arm_without_gps", "q13_gps_loss"})
"""Without GNSS the recorded errors are no property of the estimator any more: the stub makes its own."""
HOVER_SEEDS = range(1, 9)
"""Flights whose median is compared with the median of PX4's."""
POSITION_STEPS = (
    ("step +5 m N", 0, 5.0),
    ("step +5 m E", 1, 5.0),
    ("step +3 m up", 2, -3.0),
    ("step -3 m down", 2, 3.0),
    ("step +20 m N", 0, 20.0),
)
VELOCITY_STEPS = ((0, 1.0), (0, 0.0), (0, 2.0), (0, 0.0), (0, 5.0), (0, 0.0), (2, -1.0), (2, 0.0), (2, 1.0), (2, 0.0))
"""Axis and velocity setpoint [m/s] of q03's steps, in their order."""
ACCELERATIONS = (
    ("acceleration (0.5,0,0)", 0),
    ("acceleration (-0.5,0,0)", 0),
    ("acceleration (0,2,0)", 1),
    ("acceleration (0,0,-0.5)", 2),
    ("acceleration (0,0,0.5)", 2),
)

Motion = Callable[[Recording, Flight], Iterator[Row]]
"""Rows of the motion of a flight beside the recording."""


def position_steps(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Steps of q02."""
    for words, axis, size in POSITION_STEPS:
        yield from steps.position_step(recording, flight, words, axis, size)


def velocity_steps(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Steps of q03."""
    first = next(i for i, (_, words) in enumerate(recording.marks) if words.startswith("velocity"))
    before = 0.0
    for i, (axis, speed) in enumerate(VELOCITY_STEPS):
        yield from steps.velocity_step(recording, flight, first + i, axis, (before, speed))
        before = speed


def circles(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Circles of q04."""
    for speed in (1, 2, 3):
        yield from steps.circle(recording, flight, speed)


def accelerations(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Accelerations of q05."""
    for words, axis in ACCELERATIONS:
        yield from steps.acceleration(recording, flight, words, axis)


def yaw(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Yaw steps and yaw rates of q06."""
    for words, size in (("yaw setpoint 90", 90.0), ("yaw setpoint -90", -180.0), ("yaw setpoint 0", 90.0)):
        yield from steps.yaw_step(recording, flight, words, size)
    for words, rate in (("yaw rate +45", 45.0), ("yaw rate -45", -45.0)):
        yield from steps.yaw_rate_step(recording, flight, words, rate)


def wind(recording: Recording, flight: Flight) -> Iterator[Row]:
    """Gust, step and landing of q16."""
    if recording.name == "q16_wind":
        yield from steps.gust(recording, flight)
    yield from steps.position_step(recording, flight, "step +5 m N", 0, 5.0)
    yield from profiles.descent(recording, flight)


MOTIONS: Mapping[str, Motion] = {
    "q01_takeoff_hover": steps.takeoff,
    "q02_position_steps_clean": position_steps,
    "q03_velocity_steps_clean": velocity_steps,
    "q04_circle_clean": circles,
    "q05_acceleration": accelerations,
    "q06_yaw": yaw,
    "q08_auto_land": profiles.landing,
    "q08_auto_loiter": profiles.braking,
    "q08_rtl_near": profiles.way_home,
    "q08_rtl_far": profiles.way_home,
    "q16_wind": wind,
    "q16_wind_start": wind,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A folder of recordings."""

    folder: Path

    def names(self) -> list[str]:
        """Give the quadrotor's experiments, in the order of their names."""
        found = (path.name.removesuffix(".events.jsonl") for path in self.folder.glob("*.events.jsonl"))
        return sorted(name for name in found if name.startswith("q"))

    def rows(self, only: str = "") -> Iterator[Row]:
        """Compare every experiment whose name begins with `only`."""
        for name in self.names():
            if name.startswith(only):
                yield from experiment_rows(read_recording(self.folder, name))
        for name in rover.MEASURES:
            if name.startswith(only) and (self.folder / f"{name}.events.jsonl").exists():
                yield from rover.experiment_rows(self.folder, name)
        vehicle = VehicleConfig.load("sih_quadrotor")
        if (self.folder / rates.RATES_FILE).exists() and "q18".startswith(only):
            yield from rates.message_rates(self.folder, vehicle)
        if (self.folder / rates.PARAMETERS_FILE).exists() and "q18".startswith(only):
            yield from rates.parameters(self.folder, vehicle)


def experiment_rows(recording: Recording) -> Iterator[Row]:
    """Fly one experiment with the estimate errors that PX4 had, and compare."""
    vehicle = VehicleConfig.load(VEHICLES[recording.model])
    errors: Errors = "own" if recording.name in OWN_ERRORS else "none" if recording.clean else "recorded"
    flight = Replay(recording, vehicle, seed=SEED, errors=errors).fly()
    measure = MOTIONS.get(recording.name)
    if measure is not None:
        yield from measure(recording, flight)
    if recording.name == "q01_takeoff_hover":
        begin, end = recording.mark("altitude reached")
        flights = [Replay(recording, vehicle, seed=seed, errors="own").fly() for seed in HOVER_SEEDS]
        yield from noise.wander(flights, begin, end)
    for channel in CHANNELS:
        yield compare(recording, flight, channel)
    if recording.name in profiles.SPREADS:
        yield from profiles.touchdown(recording, flight)
