"""A simulated free-flyer keeps station at a moving target: the companion's planner and controller in virtual time.

Companion and simulator meet as MAVLink bytes. The target is known from the truth (relative pose, 30 times a second,
40 ms old); all else the companion knows from the autopilot's odometry with all its errors. A plain tracker stands for
the estimation, and nothing for the guardian.

Run: python bench/free_flyer_station.py [--runs N] [--seconds S] [--offset M] [--crossing] [--odometry MPS]
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from attitude_target import AttitudeTarget
from pymavlink.dialects.v20 import common as mavlink

from companion.control.free_flyer.controller import FreeFlyerController, FreeFlyerStep
from companion.control.free_flyer.parameters import FreeFlyerControlParameters
from companion.geometry.angles import angle_difference
from companion.geometry.rotations import rotation_from_quaternion
from companion.messages.motion import MotionState
from companion.messages.ownship import OwnshipState
from companion.messages.thrust import AttitudeThrust
from companion.planning.minimum_snap import PlanParameters, PlanRequest
from companion.planning.planar import plan_in_plane
from companion.vehicles.free_flyer import FreeFlyer, FreeFlyerParameters
from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.kinds import load_vehicle
from sitl_stub.world.documents import Interval
from sitl_stub.world.motion import MotionConfig, Unicycle, make_driver
from sitl_stub.world.world import World

TICK = 0.02  # [s] of the controller
LOOK = 0.033  # [s] between two sights of the target
AGE = 0.040  # [s] of a sight when it arrives
REPLAN = 0.2  # [s]
NEAR = 0.05  # [m] of the station: the reference is the station itself
TYPE_MASK = 1 | 2 | 4 | 32  # no turn rates; body thrust


def attitude_target(setpoint: AttitudeThrust, time_boot_ms: int) -> AttitudeTarget:
    """Turn a setpoint into the message that carries it."""
    forward, right, down = setpoint.thrust_body.tolist()
    return AttitudeTarget(TYPE_MASK, setpoint.yaw, (forward, right, down), time_boot_ms=time_boot_ms)


@dataclass(frozen=True, kw_only=True)
class Profile:
    """A target's motion (Patel et al., table 5): speed and turn rate drawn anew every 0.1 s."""

    name: str
    speed: tuple[float, float]  # [m/s]
    turn_rate: tuple[float, float]  # [rad/s]
    speed_max: float  # [m/s] of the observer


TABLE_5 = (
    Profile(name="case 1", speed=(0.1, 0.1), turn_rate=(0.0, 0.0), speed_max=0.1),
    Profile(name="case 2", speed=(0.1, 0.1), turn_rate=(-1.0, 1.0), speed_max=0.1),
    Profile(name="case 3", speed=(0.0, 0.1), turn_rate=(0.0, 0.0), speed_max=0.2),
    Profile(name="case 4", speed=(0.0, 0.1), turn_rate=(-1.0, 1.0), speed_max=0.2),
)


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What one flight has shown; errors against the station, of the true vehicle."""

    arrived: float  # [s] after the start
    position_errors: np.ndarray  # [m] while keeping station
    heading_errors: np.ndarray  # [rad] likewise, absolute
    final_position_error: float  # [m] when the target has stood for 10 s
    final_heading_error: float  # [rad]
    openings: int  # of all valves together
    shares: np.ndarray  # of the wanted thrust that there was
    speeds: np.ndarray  # [m/s] of the true vehicle


class Target:
    """A platform in the plane: it waits ahead, or crosses the vehicle's way from the left."""

    def __init__(self, profile: Profile, rng: np.random.Generator, *, duration: float, crossing: bool) -> None:
        self.config = MotionConfig(
            kind="random",
            speed=Interval(*profile.speed),
            turn_rate=Interval(*profile.turn_rate),
            period=0.1,
            go=Interval(math.inf, math.inf),
            pause=Interval(0.0, 0.0),
            wavelength=Interval(math.inf, math.inf),
            peak_to_peak=Interval(0.0, 0.0),
            phase=Interval(0.0, 0.0),
            duration=Interval(duration, duration),
            lag=0.05,
            acceleration=10.0,
            turn_acceleration=40.0,
            stop_deceleration=1.0,
            stop_turn_deceleration=4.0,
        )
        start = (
            rng.uniform((1.2, -2.2, 1.4), (1.8, -1.4, 1.7))
            if crossing
            else rng.uniform((1.2, -0.6, -0.5), (1.8, 0.6, 0.5))
        )
        self.body = Unicycle(self.config, float(start[0]), float(start[1]), float(start[2]))
        self._driver = make_driver(self.config, rng)
        self._t = 0.0

    def advance(self, t: float, begin: float, end: float) -> None:
        """Move to `t` [s]; it drives from `begin` to `end`."""
        while self._t < t - 1e-9:
            self._t += 0.004
            if begin <= self._t < end:
                self.body.drive(0.004, *self._driver.command(self._t - begin))
            elif self._t >= end:
                self.body.stop(0.004)


class Tracker:
    """Place, speed, heading and turn rate of the target from its sighted pose: two poles at the bandwidth [rad/s]."""

    def __init__(self, bandwidth: float = 8.0) -> None:
        self._w = bandwidth
        self._t: float | None = None
        self._state = np.zeros(3)
        self._rate = np.zeros(3)

    def add(self, t: float, pose: np.ndarray) -> None:
        """Take north, east [m] and heading [rad] at `t` [s]."""
        if self._t is None:
            self._t, self._state = t, pose.copy()
            return
        dt = t - self._t
        self._t = t
        ahead = self._state + self._rate * dt
        error = pose - ahead
        error[2] = math.remainder(error[2], math.tau)
        z = math.exp(-self._w * dt)
        self._state = ahead + (1.0 - z * z) * error
        self._rate = self._rate + (1.0 - z) ** 2 / dt * error

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Give the pose at `t` [s] and its rate."""
        assert self._t is not None
        return self._state + self._rate * (t - self._t), self._rate


def station(pose: np.ndarray, rate: np.ndarray, offset: float) -> MotionState:
    """Give the place `offset` [m] behind the target, with its heading."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    turn = rate[2] * offset
    return MotionState(
        position_ned=np.array([pose[0] - offset * cosine, pose[1] - offset * sine, 0.0]),
        velocity_ned=np.array([rate[0] + turn * sine, rate[1] - turn * cosine, 0.0]),
        acceleration_ned=np.zeros(3),
        yaw=float(pose[2]),
        yaw_rate=float(rate[2]),
    )


class Companion:
    """Planner and controller of one flight; talks MAVLink with the simulator."""

    def __init__(self, simulation: Simulation, profile: Profile, offset: float) -> None:
        self._simulation = simulation
        self._offset = offset
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=191)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._limits = FreeFlyer(parameters=FreeFlyerParameters(speed=profile.speed_max)).limits
        self.controller = FreeFlyerController(FreeFlyerControlParameters(), speed_max=profile.speed_max)
        self.tracker = Tracker()
        self.ownship: OwnshipState | None = None
        self.history: list[OwnshipState] = []
        self._clock: float | None = None  # [s] autopilot's clock minus ours
        self._reference: Callable[[float], MotionState] | None = None
        self._planned = -math.inf
        self.arrived: float | None = None
        self.steps: list[FreeFlyerStep] = []

    def send(self, message: Any) -> None:
        self._simulation.receive("onboard", bytes(message.pack(self._mav)))
        self._mav.seq = (self._mav.seq + 1) % 256

    def command(self, number: int, *values: float) -> None:
        self.send(mavlink.MAVLink_command_long_message(1, 1, number, 0, *values, *(0.0,) * (7 - len(values))))

    def listen(self) -> None:
        """Take the newest odometry."""
        for datagram in self._simulation.transmit("onboard"):
            for message in self._parser.parse_buffer(bytearray(datagram)) or ():
                if message.get_type() == "ODOMETRY":
                    self._odometry(message)

    def _odometry(self, message: Any) -> None:
        if self._clock is None:
            self._clock = message.time_usec * 1e-6 - self._simulation.t
        self.ownship = OwnshipState(
            t=message.time_usec * 1e-6 - self._clock,
            position_ned=np.array([message.x, message.y, message.z]),
            velocity_ned=np.array([message.vx, message.vy, message.vz]),
            acceleration_ned=np.zeros(3),
            ned_from_frd=rotation_from_quaternion(np.array(message.q)),
            angular_velocity_frd=np.array([message.rollspeed, message.pitchspeed, message.yawspeed]),
            reset_counter=message.reset_counter,
        )
        self.history = [*self.history[-60:], self.ownship]

    def sight(self, t: float, relative: np.ndarray) -> None:
        """Take the target's pose at `t` [s]: forward and right [m] of the vehicle, heading against its own [rad]."""
        own = min(self.history, key=lambda state: abs(state.t - t))
        cosine, sine = math.cos(own.yaw), math.sin(own.yaw)
        place = own.position_ned + own.velocity_ned * (t - own.t)
        north = place[0] + cosine * relative[0] - sine * relative[1]
        east = place[1] + sine * relative[0] + cosine * relative[1]
        self.tracker.add(t, np.array([north, east, own.yaw + relative[2]]))

    def goal(self, t: float) -> MotionState:
        pose, rate = self.tracker.at(t)
        return station(pose, rate, self._offset)

    def fly(self, t: float) -> None:
        """One tick: reference, control, setpoint."""
        assert self.ownship is not None
        step = self.controller.update(t, self.reference(t), self.ownship)
        self.steps.append(step)
        self.send(attitude_target(step.setpoint, int(t * 1e3)))

    def reference(self, t: float) -> MotionState:
        """The plan, and near the station the station itself."""
        assert self.ownship is not None
        goal = self.goal(t)
        if self.arrived is None:
            gap = math.dist(goal.position_ned[:2], self.ownship.position_ned[:2])
            if gap < NEAR:
                self.arrived = t
        if self.arrived is not None:
            return goal
        if t - self._planned >= REPLAN - 1e-9:
            self._plan(t)
        assert self._reference is not None
        return self._reference(t)

    def _plan(self, t: float) -> None:
        assert self.ownship is not None
        own = self.ownship
        begin = (
            MotionState(
                position_ned=own.position_ned,
                velocity_ned=np.zeros(3),
                acceleration_ned=np.zeros(3),
                yaw=own.yaw,
                yaw_rate=0.0,
            )
            if self._reference is None
            else self._reference(t)
        )
        request = PlanRequest(
            start=begin,
            t_start=t,
            goal=self.goal,
            t_goal_hint=t + 0.4,
            limits=self._limits,
            t_expiry=t + 5.0,
            reset_counter=own.reset_counter,
            parameters=PlanParameters(),
        )
        self._reference, self._planned = plan_in_plane(request).trajectory.at, t


def fly(
    profile: Profile,
    seed: int,
    *,
    seconds: float = 60.0,
    offset: float = 0.0,
    crossing: bool = False,
    odometry: float | None = None,
) -> Trial:
    """Fly one trial of `seconds` of the target's motion, and until it has stood for 10 s.

    The target waits until the vehicle has come, or, crossing, moves from the beginning. `odometry`: standard deviation
    [m/s] of the estimated velocity instead of the vehicle file's.
    """
    dice = np.random.default_rng((seed, 77))
    vehicle = load_vehicle("free_flyer")
    if odometry is not None:
        errors_of = replace(
            vehicle.estimator, velocity_std_mps=(odometry, odometry, vehicle.estimator.velocity_std_mps[2])
        )
        vehicle = replace(vehicle, estimator=errors_of)
    simulation = Simulation(World.load("flat_ground"), vehicle, seed)
    begin = 2.0 if crossing else 30.0
    end = begin + seconds
    target = Target(profile, dice, duration=seconds, crossing=crossing)
    companion = Companion(simulation, profile, offset)
    look_at, pending = 0.0, []
    errors: list[tuple[float, float]] = []
    speeds: list[float] = []
    ticks = round((end + 10.0) / TICK)
    for tick in range(ticks):
        t = tick * TICK
        simulation.advance(t)
        target.advance(t, begin, end)
        companion.listen()
        if companion.ownship is None:
            companion.command(511, mavlink.MAVLINK_MSG_ID_ODOMETRY, 20_000.0)
            continue
        if t >= look_at:
            look_at += LOOK
            pending.append((t, relative_pose(simulation, target)))
        while pending and pending[0][0] <= t - AGE + 1e-9:
            companion.sight(*pending.pop(0))
        if tick % 50 == 0:
            companion.send(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
        if t < 1.0:
            companion.send(attitude_target(AttitudeThrust(t=t, yaw=companion.ownship.yaw, thrust_body=np.zeros(3)), 0))
            continue
        if tick in (round(1.0 / TICK), round(1.5 / TICK)):
            companion.command(*((176, 1.0, 6.0) if tick == round(1.0 / TICK) else (400, 1.0)))
        companion.fly(t)
        speeds.append(math.hypot(simulation.body.v_north, simulation.body.v_east))
        if (companion.arrived is not None and begin <= t < end) or t >= end + 10.0 - TICK - 1e-9:
            errors.append(station_error(simulation, target, offset))
    kept = np.array(errors[:-1]).reshape(-1, 2)
    return Trial(
        arrived=math.inf if companion.arrived is None else companion.arrived,
        position_errors=kept[:, 0],
        heading_errors=np.abs(kept[:, 1]),
        final_position_error=errors[-1][0],
        final_heading_error=abs(errors[-1][1]),
        openings=simulation.body.thrusters.openings,
        shares=np.array([step.share for step in companion.steps]),
        speeds=np.array(speeds),
    )


def relative_pose(simulation: Simulation, target: Target) -> np.ndarray:
    """True pose of the target against the vehicle: forward, right [m], heading [rad]."""
    body = simulation.body
    north, east = target.body.north - body.north, target.body.east - body.east
    cosine, sine = math.cos(body.heading), math.sin(body.heading)
    return np.array(
        [
            cosine * north + sine * east,
            cosine * east - sine * north,
            angle_difference(target.body.heading, body.heading),
        ]
    )


def station_error(simulation: Simulation, target: Target, offset: float) -> tuple[float, float]:
    """True distance [m] to the station and heading error [rad]."""
    body, other = simulation.body, target.body
    north = other.north - offset * math.cos(other.heading) - body.north
    east = other.east - offset * math.sin(other.heading) - body.east
    return math.hypot(north, east), angle_difference(body.heading, other.heading)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--offset", type=float, default=0.0, help="[m] of the station behind the target")
    parser.add_argument("--crossing", action="store_true", help="the target moves from the beginning")
    parser.add_argument("--odometry", type=float, help="[m/s] standard deviation of the estimated velocity")
    options = parser.parse_args()
    print(
        "profile   arrived  station-keeping error, mean ± std           "
        " final error        valves/s  least share  top speed"
    )
    for profile in TABLE_5:
        trials = [
            fly(
                profile,
                seed,
                seconds=options.seconds,
                offset=options.offset,
                crossing=options.crossing,
                odometry=options.odometry,
            )
            for seed in range(options.runs)
        ]
        position = np.concatenate([trial.position_errors for trial in trials])
        heading = np.concatenate([trial.heading_errors for trial in trials])
        print(
            f"{profile.name}  {np.mean([trial.arrived for trial in trials]):7.1f} s"
            f"  {position.mean():.4f} ± {position.std():.4f} m  {heading.mean():.3f} ± {heading.std():.3f} rad"
            f"  {np.mean([trial.final_position_error for trial in trials]):.4f} m"
            f"  {np.mean([trial.final_heading_error for trial in trials]):.3f} rad"
            f"  {np.mean([trial.openings for trial in trials]) / (40.0 + options.seconds):8.1f}"
            f"  {min(float(trial.shares.min()) for trial in trials):11.2f}"
            f"  {max(float(trial.speeds.max()) for trial in trials):.3f} m/s"
        )


if __name__ == "__main__":
    main()
