from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from companion.campaign.limits import FlightLimits, LimitMonitor, LimitTolerances
from companion.campaign.result import FlightResult, Outcome
from companion.campaign.score import FlightScorer, ScoringParameters
from companion.campaign.truth import TargetSample, TruthSample, sample_from_record, sample_truth, truth_record
from companion.messages.decision import Mode, Switch
from companion.messages.motion import MotionLimits, Setpoint
from companion.runtime.ports import MissionState

MOTION = MotionLimits(
    speed_horizontal=4.0,
    speed_up=1.5,
    speed_down=1.0,
    acceleration_horizontal=3.0,
    acceleration_vertical=2.0,
    jerk=8.0,
    yaw_rate=1.0,
    yaw_acceleration=2.0,
)
LIMITS = FlightLimits(motion=MOTION, height=10.0, radius=30.0)
PAD_TOP = -0.15
CAMERA_PERIOD = 1.0 / 30.0


class Flight:
    """A made-up flight: up, a minute of following a pad that drives north, straight down onto it, disarmed."""

    def __init__(self) -> None:
        self.dt = 0.02
        self.height = 3.0
        self.offset = (0.03, 0.04)  # of the vehicle from the landing point, at rest and while following
        self.turned = 0.005
        self.pad_speed = 0.5
        self.pad_moves = (10.0, 30.0)
        self.descends_at = 35.0
        self.descent = 0.4
        self.rest = 6.0
        self.surface = "pad"
        self.feet = 4
        self.disarms = True
        self.blind: tuple[float, float] | None = None
        self.stray: float | None = None  # a random measurement, with which a track began that was given up
        self.anew = math.inf  # another track from then on
        self.samples = list(self._fly())

    def _fly(self):
        t = 0.0
        ground = PAD_TOP - 0.2
        landed_at = None
        while landed_at is None or t < landed_at + self.rest:
            begin, end = self.pad_moves
            north = 5.0 + self.pad_speed * min(max(0.0, t - begin), end - begin)
            moving = begin <= t < end and self.pad_speed > 0.0
            velocity = self.pad_speed if moving else 0.0
            if t < 3.0:
                down, speed_down = -0.2 - t, -min(1.0, 2.0 * min(t, 3.0 - t))
            elif t < self.descends_at:
                down, speed_down = -3.2, 0.0
            else:
                down, speed_down = (
                    min(ground, -3.2 + self.descent * (t - self.descends_at)),
                    min(self.descent, 2.0 * (t - self.descends_at)),
                )
            touching = t > self.descends_at and down >= ground - 1e-9
            if touching and landed_at is None:
                landed_at = t
            yield TruthSample(
                t=t,
                position_ned=(north + self.offset[0], 2.0 + self.offset[1], down),
                velocity_ned=(velocity, 0.0, 0.0 if touching else speed_down),
                yaw=0.7 + self.turned,
                armed=not (touching and self.disarms and t > landed_at + 0.5),
                feet_in_contact=(self.feet if touching else 4 if t < 0.02 else 0),
                surface=self.surface if touching else "ground" if t < 0.02 else "",
                targets=(
                    TargetSample(
                        name="pad",
                        position_ned=(north, 2.0, PAD_TOP),
                        yaw=0.7,
                        velocity_ned=(velocity, 0.0, 0.0),
                        yaw_rate=0.0,
                        moving=moving,
                    ),
                ),
            )
            t = round(t + self.dt, 6)

    def score(self, state: MissionState = MissionState.LANDED, **parameters) -> FlightResult:
        scorer = FlightScorer(ScoringParameters(**parameters), LIMITS)
        switches = [
            Switch(t=0.0, mode=Mode.TAKEOFF, reason="go"),
            Switch(t=5.0, mode=Mode.FOLLOW, reason="near"),
            Switch(t=self.descends_at, mode=Mode.LAND, reason="settled"),
        ]
        captured = 4.0
        if self.stray is not None:
            scorer.measured(self.stray, began=self.stray)
        for sample in self.samples:
            while switches and switches[0].t <= sample.t:
                scorer.switched(switches.pop(0))
            while captured < sample.t:
                if self.blind is None or not self.blind[0] < captured < self.blind[1]:
                    scorer.measured(captured, began=self.anew if captured >= self.anew else 4.0)
                captured += CAMERA_PERIOD
            scorer.truth(sample)
        return scorer.finish(state=state, reason="its own word", seed=3, wall_s=1.0, t_end=None)


def flight(**changes) -> Flight:
    made = Flight()
    for name, value in changes.items():
        assert hasattr(made, name)
        setattr(made, name, value)
    made.samples = list(made._fly())
    return made


def test_a_landing_counts_and_is_measured() -> None:
    result = flight().score()
    assert result.outcome is Outcome.LANDED
    assert result.success
    assert result.position_error_m == pytest.approx(0.05)
    assert result.angular_error_rad == pytest.approx(0.005)
    assert result.touchdown_speed_mps == pytest.approx(0.4)
    assert result.limits_violated == ()
    touch = 35.0 + 2.85 / 0.4
    assert result.duration_s == pytest.approx(touch + 0.5, abs=0.06)
    assert "0.050 m" in result.reason


def test_station_keeping_runs_from_the_first_motion_to_the_descent() -> None:
    made = flight()
    inside = [s for s in made.samples if 10.0 <= s.t < 35.0]
    outside = [s for s in made.samples if not 10.0 <= s.t < 35.0]
    moved = {id(s): replace(s, position_ned=(s.position_ned[0] + 3.0, *s.position_ned[1:])) for s in outside[:-320]}
    made.samples = [moved.get(id(s), s) for s in made.samples]
    spread = np.random.default_rng(0).normal(size=len(inside)) * 0.1
    for sample, extra in zip(inside, spread, strict=True):
        k = made.samples.index(sample)
        made.samples[k] = replace(sample, position_ned=(sample.position_ned[0] + extra, *sample.position_ned[1:]))
    distances = np.hypot(0.03 + spread, 0.04)
    keeping = made.score().station_keeping
    assert keeping is not None
    assert keeping.position_mean_m == pytest.approx(distances.mean())
    assert keeping.position_std_m == pytest.approx(distances.std())
    assert keeping.angle_mean_rad == pytest.approx(0.005)
    assert keeping.angle_std_rad == pytest.approx(0.0, abs=1e-9)


def test_there_is_no_station_keeping_over_a_pad_at_rest() -> None:
    result = flight(pad_speed=0.0).score()
    assert result.success
    assert result.station_keeping is None


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"rest": 4.0}, "5 s are needed"),
        ({"surface": "ground"}, 'stands on "ground"'),
        ({"feet": 3}, "3 of 4 feet"),
        ({"disarms": False}, "still armed"),
        ({"blind": (20.0, 22.5)}, "unseen for 2.5 s"),
        ({"blind": (39.0, 60.0)}, "unseen for"),
        ({"descent": 1.3, "descends_at": 35.0}, "touchdown speed 1.30"),
    ],
)
def test_a_landing_that_does_not_count(changes: dict, why: str) -> None:
    result = flight(**changes).score()
    assert result.outcome is Outcome.FAILED
    assert not result.success
    assert why in result.reason


def test_a_gap_within_the_coast_is_allowed() -> None:
    assert flight(blind=(20.0, 21.9)).score().success
    assert not flight(blind=(20.0, 21.9)).score(coast_s=1.0).success


def test_a_target_that_was_never_seen_was_not_tracked() -> None:
    result = flight(blind=(0.0, 100.0)).score()
    assert not result.success
    assert "never tracked" in result.reason


@pytest.mark.parametrize(("blind", "success"), [(None, True), ((22.0, 25.0), False), ((19.0, 22.5), False)])
def test_a_target_seen_while_feet_touch_it_and_lift_off_again_was_tracked(blind, success: bool) -> None:
    made = flight(blind=blind)
    made.samples = [
        replace(s, feet_in_contact=2, surface="pad") if 20.0 <= s.t < 26.0 else s for s in made.samples
    ]  # stands on it for longer than the coast
    result = made.score(coast_s=2.0)
    assert result.success is success
    longest = CAMERA_PERIOD if blind is None else blind[1] - blind[0]
    assert result.tracking_gap_s == pytest.approx(longest, abs=2.0 * CAMERA_PERIOD)


def test_a_target_unseen_after_the_last_contact_was_tracked() -> None:
    landed = next(s.t for s in flight().samples if s.t > 30.0 and s.feet_in_contact)
    assert flight(blind=(landed + 0.1, 100.0)).score(coast_s=0.5).success


def test_touchdown_is_measured_after_the_last_time_in_the_air() -> None:
    made = flight()
    bumped = [replace(s, feet_in_contact=1, surface="pad") if 20.0 <= s.t < 20.1 else s for s in made.samples]
    made.samples = bumped  # touches something at 20 s with the pad's speed, flies on
    assert made.score().touchdown_speed_mps == pytest.approx(0.4)


def test_touchdown_speed_is_relative_to_a_pad_that_moves_and_turns() -> None:
    made = flight(pad_moves=(10.0, 100.0))
    turned = [replace(s, targets=(replace(s.targets[0], yaw_rate=2.0),)) for s in made.samples]
    made.samples = turned
    # 0.05 m from the centre of a pad turning at 2 rad/s: 0.1 m/s across, besides the descent.
    assert made.score().touchdown_speed_mps == pytest.approx(math.hypot(0.4, 0.1), rel=1e-3)


@pytest.mark.parametrize(
    ("state", "goal", "outcome", "success"),
    [
        (MissionState.ABORTED, Outcome.LANDED, Outcome.ABORTED, False),
        (MissionState.REFUSED, Outcome.LANDED, Outcome.REFUSED, False),
        (MissionState.HELD, Outcome.LANDED, Outcome.HELD, False),
        (MissionState.HELD, Outcome.HELD, Outcome.HELD, True),
        (MissionState.HELD, Outcome.FOLLOWED, Outcome.FOLLOWED, True),
        (MissionState.RUNNING, Outcome.LANDED, Outcome.FAILED, False),
        (MissionState.LANDED, Outcome.HELD, Outcome.FAILED, False),
    ],
)
def test_how_missions_end(state: MissionState, goal: Outcome, outcome: Outcome, success: bool) -> None:
    made = flight()
    made.samples = [s for s in made.samples if s.t < 30.0]
    result = made.score(state=state, goal=goal)
    assert (result.outcome, result.success) == (outcome, success)
    assert result.position_error_m is None


def test_the_json_object_has_the_fields_that_users_were_promised() -> None:
    result = flight().score()
    plain = json.loads(json.dumps(result.as_json()))
    assert {
        "outcome",
        "success",
        "reason",
        "position_error_m",
        "angular_error_rad",
        "station_keeping",
        "duration_s",
        "touchdown_speed_mps",
        "mode_history",
        "limits_violated",
        "wall_s",
        "seed",
    } <= set(plain)
    assert plain["mode_history"][0] == {"t": 0.0, "mode": "takeoff", "reason": "go"}
    assert set(plain["station_keeping"]) == {"position_mean_m", "position_std_m", "angle_mean_rad", "angle_std_rad"}
    assert FlightResult.from_json(plain) == result
    assert "wall_s" not in result.as_json(with_wall=False)


def setpoint(t: float, **changes) -> Setpoint:
    values = {"position_ned": np.zeros(3), "velocity_ned": np.zeros(3), "acceleration_ned": np.zeros(3)}
    return Setpoint(**{"t": t, "yaw": 0.0, "yaw_rate": 0.0, **values, **changes})


@pytest.mark.parametrize(
    ("changes", "limit"),
    [
        ({"velocity_ned": [3.0, 3.0, 0.0]}, "setpoint speed, horizontal"),
        ({"velocity_ned": [0.0, 0.0, -1.6]}, "setpoint speed, up"),
        ({"velocity_ned": [0.0, 0.0, 1.1]}, "setpoint speed, down"),
        ({"acceleration_ned": [0.0, 3.1, 0.0]}, "setpoint acceleration, horizontal"),
        ({"acceleration_ned": [0.0, 0.0, 2.1]}, "setpoint acceleration, vertical"),
        ({"yaw_rate": -1.1}, "setpoint yaw rate"),
        ({"yaw": math.nan}, "setpoint finite"),
        ({"feedback_velocity_ned": [0.0, math.nan, 0.0]}, "setpoint finite"),
        ({"velocity_ned": [4.0, 0.0, 0.0], "feedback_velocity_ned": [1.2, 0.0, 0.0]}, "sent speed, horizontal"),
        ({"feedback_velocity_ned": [0.0, 0.0, 1.7]}, "sent speed, down"),
    ],
)
def test_setpoints_beyond_a_limit_are_found(changes: dict, limit: str) -> None:
    monitor = LimitMonitor(LIMITS)
    monitor.setpoint(setpoint(1.0, velocity_ned=[4.0, 0.0, 1.0], acceleration_ned=[3.0, 0.0, -2.0], yaw_rate=1.0))
    assert monitor.violations == ()
    monitor.setpoint(setpoint(9.0, **changes))
    assert [v.limit for v in monitor.violations] == [limit]
    assert monitor.violations[0].t == 9.0


def test_jumps_of_the_acceleration_are_found_as_jerk() -> None:
    monitor = LimitMonitor(LIMITS)
    monitor.setpoint(setpoint(0.0))
    monitor.setpoint(setpoint(0.02, acceleration_ned=[0.16, 0.0, 0.0], yaw_rate=0.04))  # 8 m/s^3, 2 rad/s^2: allowed
    assert monitor.violations == ()
    monitor.setpoint(setpoint(0.04, acceleration_ned=[0.4, 0.0, 0.0], yaw_rate=0.2))
    assert {v.limit for v in monitor.violations} == {"setpoint jerk", "setpoint yaw acceleration"}
    assert monitor.violations[0].worst == pytest.approx(12.0)


def test_the_worst_value_is_kept() -> None:
    monitor = LimitMonitor(LIMITS)
    for t, speed in ((0.0, 5.0), (5.0, 7.0), (10.0, 6.0)):
        monitor.setpoint(setpoint(t, velocity_ned=[speed, 0.0, 0.0]))
    assert [(v.worst, v.t) for v in monitor.violations] == [(7.0, 5.0)]


def airborne(t: float, velocity=(0.0, 0.0, 0.0), position=(0.0, 0.0, -3.0), yaw: float = 0.0) -> TruthSample:
    return TruthSample(
        t=t,
        position_ned=position,
        velocity_ned=velocity,
        yaw=yaw,
        armed=True,
        feet_in_contact=0,
        surface="",
        targets=(),
    )


def test_true_motion_beyond_its_tolerance_is_found() -> None:
    allow = LimitTolerances()
    edge = 4.0 * allow.speed_factor + allow.speed_offset
    monitor = LimitMonitor(LIMITS)
    monitor.truth(airborne(0.0, velocity=(edge - 0.01, 0.0, 0.0)))
    assert monitor.violations == ()
    monitor.truth(airborne(1.0, velocity=(edge + 0.01, 0.0, 0.0)))
    monitor.truth(airborne(2.0, position=(0.0, 0.0, -14.1)))
    monitor.truth(airborne(3.0, position=(31.5, 0.0, -3.0)))
    assert [v.limit for v in monitor.violations] == ["speed, horizontal", "height", "radius"]
    assert [v.configured for v in monitor.violations] == [4.0, LIMITS.height, LIMITS.radius]


def test_a_broken_limit_is_told_with_the_limit_and_with_what_the_tolerance_makes_of_it() -> None:
    monitor = LimitMonitor(FlightLimits(motion=replace(LIMITS.motion, speed_horizontal=0.4)))
    monitor.truth(airborne(27.1, velocity=(0.0, 1.11, 0.0)))
    monitor.touchdown(30.0, 1.2)
    told = [violation.sentence for violation in monitor.violations]
    assert told == [
        "broke a limit at 27.1 s: speed, horizontal 1.11, limit 0.40, with tolerance 0.96",
        "broke a limit at 30.0 s: touchdown speed 1.20, allowed 1.00",
    ]


def test_true_accelerations_and_turns_are_averaged_over_a_window() -> None:
    smooth, rough = LimitMonitor(LIMITS), LimitMonitor(LIMITS)
    for k in range(50):
        t = k * 0.02
        smooth.truth(airborne(t, velocity=(2.9 * t, 0.0, 0.0), yaw=3.0 + t))  # through the jump of the angle
        rough.truth(airborne(t, velocity=(6.1 * min(t, 0.5), 0.0, 0.0), yaw=3.0 + 1.6 * t))
    assert smooth.violations == ()
    assert {v.limit for v in rough.violations} == {"acceleration, horizontal", "yaw rate"}


def test_a_vehicle_on_the_ground_breaks_no_limit_of_motion() -> None:
    monitor = LimitMonitor(LIMITS)
    monitor.truth(replace(airborne(0.0, velocity=(9.0, 0.0, 0.0)), feet_in_contact=4))
    monitor.truth(replace(airborne(1.0, velocity=(9.0, 0.0, 0.0)), armed=False))
    assert monitor.violations == ()


def test_the_truth_survives_its_recording() -> None:
    half = math.sqrt(0.5)
    target = SimpleNamespace(
        name="pad",
        position_ned=(1.0, 2.0, -0.15),
        yaw=0.3,
        velocity_ned=(0.5, 0.0, 0.0),
        yaw_rate=0.1,
        half_size=(0.4, 0.4),
        moving=True,
    )
    vehicle = SimpleNamespace(
        position_ned=(1.0, 2.0, -3.0),
        velocity_ned=(0.1, 0.2, 0.3),
        quaternion=(half, 0.0, 0.0, half),
        feet_in_contact=0,
        surface="",
        armed=True,
    )
    truth = SimpleNamespace(t=1.0, vehicle=vehicle, targets=(target,))
    direct = sample_truth(truth)
    assert direct.yaw == pytest.approx(math.pi / 2)
    assert sample_from_record(json.loads(json.dumps(truth_record(truth)))) == direct
    with pytest.raises(KeyError, match="no target 'boat'"):
        direct.target("boat")


def test_a_track_given_up_before_the_target_was_acquired_is_no_gap_but_later_one_is() -> None:
    assert flight(stray=0.5).score().success
    assert not flight(blind=(10.0, 15.0), anew=12.0).score().success
    assert not flight(blind=(4.5, 9.0), anew=9.0).score().success
