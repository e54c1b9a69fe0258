"""A run-up: whatever the rover rolls on by, it ends at its place, and never when it is no matter for one."""

import math

import pytest

from companion.planning.coupled.model import RoverMotion
from companion.planning.run_up import RunUp, RunUpParameters

STEP = 0.02
P = RunUpParameters()


class Sluggish:
    """A rover that stands for a while before it sets off, then has its speed at once, and rolls on after the stop."""

    def __init__(self, along, across, heading, *, sticks_s=0.4, rolls_m=0.05):
        self.x, self.y, self.yaw = -along, -across, -heading  # the place is the origin
        self._sticks, self._rolls = sticks_s, rolls_m
        self._asked, self._speed, self._way = 0.0, 0.0, 0.0

    def drive(self, speed, yaw_rate):
        if speed == 0.0:
            self._asked = 0.0
            step = math.copysign(min(abs(self._speed) * STEP, self._way), self._speed)
            self._way -= abs(step)
            if self._way < 1e-9:
                self._speed = 0.0
            turn = 0.0
        else:
            self._asked += STEP
            self._speed = speed if self._asked > self._sticks else 0.0
            self._way = self._rolls if self._speed else 0.0
            step, turn = self._speed * STEP, yaw_rate * STEP if self._speed else 0.0
        self.yaw += turn
        self.x += step * math.cos(self.yaw)
        self.y += step * math.sin(self.yaw)

    def seen(self):
        return {"along": -self.x, "across": -self.y, "heading": -self.yaw}


def driven(rover, seconds, run_up=None, start=0.0):
    """Let it go on; give the last motion and the number of stops near the place."""
    run_up = run_up or RunUp(P, RoverMotion())
    stops, before, motion = 0, 0.0, None
    for k in range(round(seconds / STEP)):
        motion = run_up.update(start + k * STEP, **rover.seen())
        if motion is None:
            return None, stops
        stops += before > 0.0 and motion.speed == 0.0
        before = motion.speed
        rover.drive(*motion)
    return motion, stops


@pytest.mark.parametrize("rolls", [0.01, 0.05, 0.11])
@pytest.mark.parametrize("start", [(0.05, 0.0, 0.0), (-0.2, 0.12, -0.2), (0.3, -0.1, 0.2), (0.5, 0.03, 0.02)])
def test_it_ends_at_its_place_and_stays_there(start, rolls) -> None:
    rover = Sluggish(*start, rolls_m=rolls)
    motion, _ = driven(rover, 60.0)
    assert motion == (0.0, 0.0)
    assert abs(rover.x) < P.along_m
    assert abs(rover.y) < P.across_m
    assert abs(rover.yaw) < P.angle_rad


def test_what_one_stop_missed_by_the_next_allows_for() -> None:
    run_up, first, second = RunUp(P, RoverMotion()), Sluggish(0.05, 0.0, 0.0, rolls_m=0.0), None
    _, stops = driven(first, 60.0, run_up)
    run_up.forget()
    second = Sluggish(0.05, 0.0, 0.0, rolls_m=0.0)
    _, again = driven(second, 60.0, run_up, start=100.0)
    assert stops > again == 1


def test_one_that_stands_well_is_left_alone() -> None:
    rover = Sluggish(0.004, 0.003, 0.002)
    run_up = RunUp(P, RoverMotion())
    assert all(run_up.update(k * STEP, **rover.seen()) == (0.0, 0.0) for k in range(500))


@pytest.mark.parametrize("start", [(1.5, 0.0, 0.0), (0.1, 0.3, 0.0), (0.0, 0.0, 0.6)])
def test_far_from_its_place_it_is_no_matter_for_a_run_up(start) -> None:
    assert driven(Sluggish(*start), 1.0)[0] is None


def test_it_gives_up_when_it_is_pushed_aside_meanwhile() -> None:
    run_up = RunUp(P, RoverMotion())
    driven(Sluggish(0.1, 0.0, 0.0), 2.0, run_up)
    assert run_up.update(2.0, along=0.3, across=0.4, heading=0.0) is None


def test_a_rover_that_cannot_back_out_makes_none() -> None:
    run_up = RunUp(P, RoverMotion(speed_reverse=0.0))
    assert run_up.update(0.0, along=0.1, across=0.0, heading=0.0) is None


def test_it_never_turns_more_sharply_than_it_can() -> None:
    radius = 1.5
    run_up, rover = RunUp(P, RoverMotion(turning_radius=radius)), Sluggish(-0.1, 0.14, 0.2)
    for k in range(1000):
        motion = run_up.update(k * STEP, **rover.seen())
        if motion is None:
            return
        assert abs(motion.yaw_rate) * radius <= abs(motion.speed) + 1e-9
        rover.drive(*motion)
