"""The score of a rover's drive: what counts as met, followed, off, unseen or too near."""

import math

import pytest

from companion.campaign.ground_score import GroundScorer, GroundScoring
from companion.campaign.limits import DriveLimits, DriveMonitor
from companion.campaign.result import FlightResult, Outcome
from companion.campaign.truth import TargetSample, TruthSample
from companion.messages.decision import Mode, Switch
from companion.messages.motion import SticksSetpoint
from companion.runtime.ports import MissionState

LIMITS = DriveLimits(
    speed_forward=1.5, speed_reverse=0.6, acceleration=1.0, yaw_rate=1.2, turning_radius=0.85, nearest=0.75
)


class Drive:
    """A target that drives east at 0.5 m/s from 10 s to 30 s; a rover that stays `offset` from its place behind it."""

    def __init__(self, *, goal=Outcome.FOLLOWED):
        self.scorer = GroundScorer(GroundScoring(goal=goal, standoff_m=1.25, coast_s=2.0), LIMITS)
        self.along, self.across, self.turned = 0.03, -0.04, 0.02
        self.blind = (math.inf, math.inf)
        self.state = MissionState.HELD
        self.near = 0.0

    def result(self) -> FlightResult:
        scorer = self.scorer
        for mode, t in ((Mode.SEARCH, 1.0), (Mode.APPROACH, 3.0), (Mode.FOLLOW, 9.0), (Mode.DONE, 35.0)):
            scorer.switched(Switch(t=t, mode=mode, reason="")) if mode is not Mode.DONE else None
        for k in range(2000):
            t = 0.02 * k
            if t == 35.0:
                scorer.switched(Switch(t=t, mode=Mode.DONE, reason=""))
            moving = 10.0 <= t < 30.0
            east = 0.5 * (min(max(t, 10.0), 30.0) - 10.0)
            target = TargetSample(
                name="rover",
                position_ned=(0.0, east, 0.0),
                yaw=0.5 * math.pi,
                velocity_ned=(0.0, 0.5 if moving else 0.0, 0.0),
                yaw_rate=0.0,
                moving=moving,
            )
            scorer.truth(
                TruthSample(
                    t=t,
                    position_ned=(-self.across * -1.0, east - 1.25 - self.along + self.near * (20.0 < t < 21.0), -0.12),
                    velocity_ned=(0.0, 0.5 if moving else 0.0, 0.0),
                    yaw=0.5 * math.pi - self.turned,
                    armed=True,
                    feet_in_contact=4,
                    surface="ground",
                    targets=(target,),
                )
            )
            if not self.blind[0] < t < self.blind[1]:
                scorer.measured(t, began=0.0)
        return scorer.finish(state=self.state, reason="settled", seed=1, wall_s=0.0, t_end=35.0)


def test_a_good_drive_counts_with_its_errors_along_and_across() -> None:
    result = Drive().result()
    assert result.success
    assert result.outcome is Outcome.FOLLOWED
    assert result.along_error_m == pytest.approx(0.03)
    assert result.cross_error_m == pytest.approx(0.04)
    assert result.position_error_m == pytest.approx(0.05)
    assert result.angular_error_rad == pytest.approx(0.02)
    assert result.station_keeping.position_mean_m == pytest.approx(0.05)
    assert FlightResult.from_json(result.as_json()) == result


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"along": 0.26}, "0.26 m"),
        ({"across": 0.27}, "0.27 m"),
        ({"turned": 0.25}, "0.25 rad"),
        ({"blind": (15.0, 18.0)}, "unseen for 3.0 s"),
        ({"blind": (32.0, 40.0)}, "unseen for 3.0 s"),
        ({"near": 0.6}, "nearness"),
    ],
)
def test_what_spoils_it(change, expected) -> None:
    drive = Drive()
    for name, value in change.items():
        setattr(drive, name, value)
    result = drive.result()
    assert result.outcome is Outcome.FAILED
    assert not result.success
    assert expected in result.reason


def test_an_intercept_is_called_so_and_an_abort_too() -> None:
    assert Drive(goal=Outcome.INTERCEPTED).result().outcome is Outcome.INTERCEPTED
    drive = Drive()
    drive.state = MissionState.ABORTED
    assert drive.result().outcome is Outcome.ABORTED


@pytest.mark.parametrize(
    ("change", "limit"),
    [
        ({"speed": 1.6}, "setpoint speed, forward"),
        ({"speed": -0.7}, "setpoint speed, back"),
        ({"yaw_rate": 1.3}, "setpoint yaw rate"),
        ({"speed": 0.1, "yaw_rate": 0.3}, "setpoint turning"),
    ],
)
def test_setpoints_beyond_the_limits_are_told(change, limit) -> None:
    drive = Drive()
    values = {"t": 1.0, "speed": 1.4, "yaw_rate": 0.0, "throttle": 0.3, "steering": 0.0}
    drive.scorer.setpoint(SticksSetpoint(**(values | change)))
    assert limit in {violation.limit for violation in drive.result().limits_violated}


def test_sticks_that_are_no_numbers_break_limits() -> None:
    monitor = DriveMonitor(LIMITS)
    monitor.setpoint(SticksSetpoint(t=1.0, speed=math.nan, yaw_rate=0.0, throttle=0.0, steering=0.0))
    assert "setpoint speed, forward" in [violation.limit for violation in monitor.violations]
