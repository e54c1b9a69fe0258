"""What planning and the guardian cost, in CPU time of their thread. Run: python bench/planning.py"""

import statistics
import time
from collections.abc import Callable

import numpy as np

from companion.guardian.guardian import Guardian
from companion.guardian.holonomic import HolonomicShaper
from companion.guardian.parameters import GuardianParameters
from companion.messages.motion import MotionState
from companion.messages.ownship import FlightMode, LandedState, OwnshipState, SystemStatus, VehicleStatus
from companion.planning.minimum_snap import PlanParameters, PlanRequest, plan_to_moving_goal
from companion.planning.polynomial import PolynomialTrajectory
from companion.vehicles.multicopter import Multicopter

LIMITS = Multicopter().limits


def measure(name: str, call: Callable[[int], object], count: int) -> None:
    """Print the median and the 99th percentile of a call's time."""
    times = []
    for k in range(count + 50):
        begin = time.thread_time()
        call(k)
        times.append(1e6 * (time.thread_time() - begin))
    times = sorted(times[50:])
    print(f"{name:44s} median {statistics.median(times):8.1f} us   p99 {times[int(0.99 * len(times))]:8.1f} us")


def state(position: np.ndarray, velocity: np.ndarray, yaw: float) -> MotionState:
    return MotionState(
        position_ned=position, velocity_ned=velocity, acceleration_ned=np.zeros(3), yaw=yaw, yaw_rate=0.0
    )


def random_plan(rng: np.random.Generator) -> PolynomialTrajectory:
    place, drift = rng.uniform(-10, 10, 3), np.array([*rng.uniform(-0.5, 0.5, 2), 0.0])
    yaw = rng.uniform(-3, 3)
    request = PlanRequest(
        start=state(np.zeros(3), rng.uniform(-0.8, 0.8, 3), 0.0),
        t_start=0.0,
        goal=lambda t: state(place + drift * t, drift, yaw),
        t_goal_hint=rng.uniform(0.5, 8.0),
        limits=LIMITS,
        t_expiry=1e9,
        reset_counter=0,
        parameters=PlanParameters(),
    )
    return plan_to_moving_goal(request).trajectory


def measure_guardian(plan: PolynomialTrajectory) -> None:
    """Tick a guardian that follows a plan; the vehicle is where it was told to be."""
    guardian = Guardian(GuardianParameters(), HolonomicShaper(LIMITS))
    guardian.engage(0.0)
    status = VehicleStatus(
        t=0.0,
        connected=True,
        armed=True,
        mode=FlightMode.OFFBOARD,
        landed=LandedState.IN_AIR,
        system_status=SystemStatus.ACTIVE,
        estimate_valid=True,
        battery_remaining=None,
    )
    period = 0.02
    ownships = [
        OwnshipState(
            t=k * period,
            position_ned=plan.at(k * period).position_ned,
            velocity_ned=plan.at(k * period).velocity_ned,
            acceleration_ned=np.zeros(3),
            ned_from_frd=np.eye(3),
            angular_velocity_frd=np.zeros(3),
            reset_counter=0,
        )
        for k in range(3050)
    ]
    measure("guardian tick", lambda k: guardian.tick(k * period, ownships[k], status, plan, None), 3000)


def main() -> None:
    rng = np.random.default_rng(1)
    plan = random_plan(rng)
    measure("trajectory at(t)", lambda k: plan.at(1e-4 * k), 5000)
    measure("minimum snap to a moving goal, any hint", lambda _: random_plan(rng), 1500)
    measure_guardian(random_plan(rng))


if __name__ == "__main__":
    main()
