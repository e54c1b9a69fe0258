"""Where the pad is before it is seen: by survey, odometry and ranges, against a flight that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.estimation.coarse_pad import CoarsePad, CoarsePadParameters, RangingSetup, SurveyedPad
from companion.estimation.ownship import OwnshipHistory
from companion.estimation.proximity.filter import ProximityFilter
from companion.estimation.proximity.parameters import ProximityParameters, ProximitySetup
from companion.geometry.angles import wrap_angle
from companion.geometry.rotations import rotation_about_z, rotation_from_euler
from companion.geometry.transform import RigidTransform
from companion.messages.coarse import CoarseTarget
from companion.messages.ownship import OwnshipState
from companion.messages.proximity import NozzlePulses, ProximityState, RangeReading
from companion.messages.target import TargetMeasurement

ANCHORS = np.array([(3.0, -3.0, -0.1), (3.0, 3.0, -1.2), (-3.0, 3.0, -0.1), (-3.0, -3.0, -1.2)])
LEVER = np.array([-0.05, 0.08, -0.07])
SURVEY = SurveyedPad(position_ned=np.array([18.0, -5.0, 0.05]), yaw=0.7, position_std=0.5, heading_std=0.17)
PAD, YAW = np.array([18.5, -4.4, 0.1]), 0.9  # where it stands
DT, STANDS, ENDS = 0.02, 2.0, 14.0


def truth(t: float) -> OwnshipState:
    """Stand, then fly towards the pad and up, smoothly, turning a little."""
    way = np.array([15.0, -4.0, -4.0])
    s = min(1.0, max(0.0, (t - STANDS - 1.0) / 10.0))
    share, rate = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / 10.0 if 0.0 < s < 1.0 else 0.0
    return OwnshipState(
        t=t,
        position_ned=share * way,
        velocity_ned=rate * way,
        acceleration_ned=np.zeros(3),
        ned_from_frd=rotation_from_euler(0.0, 0.0, 0.3 + 0.4 * share),
        angular_velocity_frd=np.array([0.0, 0.0, 0.4 * rate]),
        reset_counter=0,
    )


def distances(state: OwnshipState) -> np.ndarray:
    antenna = state.position_ned + state.ned_from_frd @ LEVER
    return np.linalg.norm(PAD + ANCHORS @ rotation_about_z(YAW).T - antenna, axis=1)


class Flight:
    """Feeds an estimator; ranges have the noise and outliers of the simulator's radios."""

    def __init__(self, *, ranging: bool = True, seed: int = 1, late: float = 0.0, jump: float = math.inf) -> None:
        setup = RangingSetup(anchors=ANCHORS, lever_arm=LEVER, std=0.05) if ranging else None
        self.coarse = CoarsePad(SURVEY, setup, CoarsePadParameters())
        self.history, self.ranging, self.jump, self.late = OwnshipHistory(), ranging, jump, late
        self.dice = np.random.default_rng(seed)
        self.waiting: list[tuple[float, RangeReading]] = []
        self.t = 0.0

    def told(self, t: float) -> OwnshipState:
        """What the autopilot says: from `jump` on in a frame that is moved and turned."""
        state = truth(t)
        if t < self.jump:
            return state
        turn = rotation_about_z(0.5)
        return OwnshipState(
            t=t,
            position_ned=turn @ state.position_ned + (3.0, 1.0, -2.0),
            velocity_ned=turn @ state.velocity_ned,
            acceleration_ned=np.zeros(3),
            ned_from_frd=turn @ state.ned_from_frd,
            angular_velocity_frd=state.angular_velocity_frd,
            reset_counter=1,
        )

    def fly(self, until: float = ENDS) -> CoarseTarget:
        while self.t < until - 1e-9:
            self.t = round(self.t + DT, 6)
            state = self.told(self.t)
            reset = self.history.add(state)
            self.coarse.add_ownship(state, reset, standing=self.t <= STANDS)
            if self.ranging:
                self.coarse.add_ranges(self._ranges())
        now = self.coarse.at(self.told(self.t))
        assert now is not None
        return now

    def _ranges(self) -> list[RangeReading]:
        anchor = round(self.t / DT) % 4
        noise, struck, excess = 0.05 * self.dice.standard_normal(), self.dice.random(), self.dice.uniform(0.15, 1.0)
        measured = distances(truth(self.t))[anchor] + noise + (excess if struck < 0.05 else 0.0)
        self.waiting.append((self.t + self.late * (anchor == 2), RangeReading(t=self.t, anchor=anchor, range=measured)))
        due = [reading for t, reading in self.waiting if t <= self.t + 1e-9]
        self.waiting = [(t, reading) for t, reading in self.waiting if t > self.t + 1e-9]
        return due


@pytest.fixture(scope="module")
def by_ranges() -> CoarseTarget:
    return Flight().fly()


def test_ranges_and_the_way_flown_tell_place_and_heading(by_ranges) -> None:
    assert np.abs(by_ranges.position_ned - PAD).max() < 0.12
    assert abs(wrap_angle(by_ranges.yaw - YAW)) < 0.06
    assert by_ranges.position_std < 0.15
    assert by_ranges.mahalanobis == pytest.approx(1.0, abs=0.35)
    assert by_ranges.t_range > ENDS - 0.2


def test_the_errors_are_as_large_as_is_said() -> None:
    squared = []
    for seed in range(2, 6):
        now = Flight(seed=seed).fly(8.0)
        error = np.append(now.position_ned - PAD, wrap_angle(now.yaw - YAW))
        squared.append(error @ np.linalg.solve(now.covariance, error))
    assert 0.3 < np.mean(squared) / 4.0 < 2.5


def test_by_odometry_alone_the_pad_stays_where_it_was_surveyed() -> None:
    """An error of the heading turns the picture about the pad: where the pad is does not become less certain by it."""
    now = Flight(ranging=False).fly()
    assert np.abs(now.position_ned - SURVEY.position_ned).max() < 0.1
    assert now.yaw == pytest.approx(SURVEY.yaw, abs=0.01)
    assert 0.5 <= now.position_std < 0.9
    assert math.sqrt(now.covariance[3, 3]) == pytest.approx(SURVEY.heading_std, rel=0.05)
    assert now.t_range == -math.inf


def test_late_ranges_end_in_the_same_estimate(by_ranges) -> None:
    """Those of one anchor come 0.3 s late; they count at their time, so only the newest of them are missing."""
    flight = Flight(late=0.3)
    flight.fly()
    flight.coarse.add_ranges([reading for _, reading in flight.waiting])
    late = flight.coarse.at(truth(ENDS))
    assert late is not None
    assert late.position_ned == pytest.approx(by_ranges.position_ned, abs=1e-9)
    assert late.covariance == pytest.approx(by_ranges.covariance, abs=1e-9)


@pytest.mark.parametrize("jump", [1.0, 8.0])
def test_a_reset_of_the_autopilot_moves_the_pad_with_the_vehicle(by_ranges, jump: float) -> None:
    """On the ground and in flight; what is relative to the vehicle stays."""
    flight = Flight(jump=jump)
    now = flight.fly()
    turn = rotation_about_z(0.5)
    if jump < STANDS:  # the survey counts from where it stands, in the frame that holds at take-off
        assert np.isfinite(now.position_ned).all()
    else:
        assert now.position_ned == pytest.approx(turn @ by_ranges.position_ned + (3.0, 1.0, -2.0), abs=0.1)
        assert now.yaw == pytest.approx(by_ranges.yaw + 0.5, abs=0.02)


def test_a_sighting_settles_it() -> None:
    flight = Flight(ranging=False)
    flight.fly()
    for _ in range(5):
        flight.fly(flight.t + DT)
        state = truth(flight.t)
        level = rotation_about_z(-state.yaw) @ (PAD - state.position_ned)
        seen = TargetMeasurement(
            t=flight.t, position_level=level, heading=YAW - state.yaw, covariance=np.diag([1e-4] * 4)
        )
        flight.coarse.add_sighting(seen, state)
    now = flight.coarse.at(truth(flight.t))
    assert now is not None
    assert now.position_ned == pytest.approx(PAD, abs=0.05)
    assert wrap_angle(now.yaw - YAW) == pytest.approx(0.0, abs=0.02)
    assert now.position_std < 0.1


def test_landed_elsewhere_the_pad_is_kept_where_it_was(by_ranges) -> None:
    flight = Flight()
    before = flight.fly()
    for k in range(50):
        flight.coarse.add_ownship(truth(flight.t + DT * (k + 1)), None, standing=True)
    after = flight.coarse.at(truth(flight.t + 1.0))
    assert after is not None
    assert after.position_ned == pytest.approx(before.position_ned, abs=0.05)
    assert after.position_std == pytest.approx(before.position_std, rel=0.2)


def test_engaged_in_flight_nothing_is_known() -> None:
    coarse = CoarsePad(SURVEY, None, CoarsePadParameters())
    coarse.add_ownship(truth(5.0), None, standing=False)
    assert coarse.at(truth(5.0)) is None


def test_the_same_readings_give_the_same_numbers_bit_for_bit(by_ranges) -> None:
    again = Flight().fly()
    assert np.array_equal(again.position_ned, by_ranges.position_ned)
    assert np.array_equal(again.covariance, by_ranges.covariance)


def test_a_known_acceleration_acts_as_the_command_of_its_force_does() -> None:
    """`ProximityFilter.accelerate` against `command`: force over mass, for one control period."""
    mass, force = 2.0, np.array([0.4, -0.2, 0.1])
    setup = ProximitySetup(
        anchors=ANCHORS,
        lever_arm=LEVER,
        markers=np.zeros((0, 3)),
        c_from_t=RigidTransform(rotation=np.eye(3), translation=np.zeros(3)),
        d_from_cam=RigidTransform(rotation=np.eye(3), translation=np.zeros(3)),
        mass=mass,
        control_period=0.1,
    )
    start = ProximityState(
        t=0.0,
        position=np.zeros(3),
        velocity=np.zeros(3),
        quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
        rate=np.zeros(3),
        covariance=np.eye(9) * 0.01,
        mahalanobis=0.0,
        t_vision=-math.inf,
        t_range=-math.inf,
    )
    pushed, commanded = (ProximityFilter(setup, ProximityParameters(), start) for _ in range(2))
    assert pushed.accelerate(0.0, force / mass, 0.1)
    assert commanded.command(NozzlePulses(t=0.0, on_times=(), force=force, torque=np.zeros(3)))
    a, b = pushed.state(0.5), commanded.state(0.5)
    assert np.array_equal(a.position, b.position)
    assert np.array_equal(a.covariance, b.covariance)
    assert a.velocity == pytest.approx(0.1 * force / mass)
