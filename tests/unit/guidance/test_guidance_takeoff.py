"""The climb: steady, and patient with a vehicle that is still on the ground."""

import numpy as np
from guidance_views import view

from companion.guidance.flying import goal_of
from companion.guidance.memory import Context, Memory
from companion.guidance.parameters import GuidanceParameters, TakeoffParameters
from companion.guidance.plan import FlightPlan
from companion.messages.decision import Mode
from companion.messages.motion import MotionState
from companion.messages.ownship import LandedState

DT = 0.02
P = TakeoffParameters()
PLAN = FlightPlan(takeoff_height_m=4.0)
ORIGIN = np.array([1.0, 2.0, -0.5])
POSITION_GAIN = 1.0  # [1/s] MPC_Z_P of the autopilot


class Climb:
    """A take-off, step by step."""

    def __init__(self) -> None:
        self.t = 0.0
        self.context = Context(
            plan=PLAN,
            parameters=GuidanceParameters(),
            memory=Memory(mode=Mode.TAKEOFF, t_entered=0.0, origin_ned=ORIGIN, origin_yaw=0.3),
        )

    def step(self, height: float) -> MotionState:
        """Give the reference now that the vehicle is at this height above the take-off point."""
        place = ORIGIN - np.array([0.0, 0.0, height])
        seen = view(self.t, position=place, landed=LandedState.ON_GROUND)
        goal = goal_of(self.context, seen, DT)
        assert goal is not None
        wanted = goal.at(self.t)
        self.t += DT
        return wanted


def above_origin(wanted: MotionState) -> float:
    return float(ORIGIN[2] - wanted.position_ned[2])


def rate(wanted: MotionState) -> float:
    return -float(wanted.velocity_ned[2])


def test_the_reference_waits_for_a_vehicle_that_is_held_on_the_ground() -> None:
    climb = Climb()
    wanted = [climb.step(0.0) for _ in range(500)]  # 10 s: spool-up and the autopilot's thrust ramp take about 3
    assert max(map(above_origin, wanted)) <= P.lead_m
    assert above_origin(wanted[-1]) > 0.8 * P.lead_m  # it asks for a climb all the same, or nothing would lift off
    assert rate(wanted[-1]) < 0.1 * P.speed_mps


def test_what_the_autopilot_is_asked_for_never_exceeds_the_climb_speed() -> None:
    """Its loop flies the rate of the reference plus its gain times what the reference is ahead."""
    climb, height, speed, demands = Climb(), 0.0, 0.0, []
    for step in range(700):
        wanted = climb.step(height)
        demands.append(rate(wanted) + POSITION_GAIN * (above_origin(wanted) - height))
        held = step * DT < 3.0  # on the ground; then after the demand, with a lag
        speed = 0.0 if held else speed + DT / 0.3 * (demands[-1] - speed)
        height += DT * speed
    assert max(demands) <= 1.02 * P.speed_mps
    assert height > PLAN.takeoff_height_m - 0.1


def test_the_climb_ends_at_the_wanted_height_without_a_step_of_its_rate() -> None:
    climb = Climb()
    heights = np.minimum(np.arange(0.0, 12.0, DT) * P.speed_mps, PLAN.takeoff_height_m)
    wanted = [climb.step(float(height)) for height in heights]
    changes = np.abs(np.diff([rate(w) for w in wanted]))
    assert changes.max() < 0.1 * P.speed_mps
    assert above_origin(wanted[-1]) > PLAN.takeoff_height_m - 0.02
    assert wanted[-1].position_ned[:2].tolist() == ORIGIN[:2].tolist()
    assert rate(wanted[-1]) < 0.15
