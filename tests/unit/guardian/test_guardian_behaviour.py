"""What the guardian does, fault by fault, with a perfect vehicle behind it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from guardian_bench import DT, HOLD, LIMITS, OFFBOARD, Bench, Path, line, motion, status, violations

from companion.guardian.fence import Fence
from companion.messages.guardian import GuardianState
from companion.messages.ownship import FlightMode, LandedState, SystemStatus
from companion.messages.target import TargetPose

S = GuardianState


def silent(outputs):
    return all(out.setpoint is None for out in outputs)


# Engaging


def test_it_starts_muted_and_stays_so():
    outputs = Bench().run(3.0)
    assert silent(outputs)
    assert {out.state for out in outputs} == {S.MUTED}


def test_it_streams_hold_here_for_a_second_before_asking_for_offboard():
    bench = Bench()
    bench.guardian.engage(0.0)
    outputs = bench.run(1.5)
    (asked, request), *more = bench.requests
    assert request is OFFBOARD
    assert not more
    first = next(out.t for out in outputs if out.setpoint is not None)
    assert asked - first >= 1.0
    for out in outputs:
        assert out.setpoint.position_ned == pytest.approx([0, 0, -3])
        assert out.setpoint.velocity_ned == pytest.approx(np.zeros(3))
    assert outputs[-1].state is S.HOLDING
    assert bench.guardian.commanding


def test_hold_here_goes_with_a_vehicle_that_still_flies_elsewhere():
    bench = Bench()
    bench.obeys = False
    bench.guardian.engage(0.0)
    bench.tick()
    bench.position = np.array([4.0, 1.0, -3.0])
    assert bench.tick().setpoint.position_ned == pytest.approx([4, 1, -3])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"status": None}, "heartbeat"),
        ({"status": status(connected=False)}, "heartbeat"),
        ({"status": status(system_status=SystemStatus.CRITICAL)}, "CRITICAL"),
        ({"status": status(mode=FlightMode.TERMINATION)}, "TERMINATION"),
        ({"status": status(estimate_valid=False)}, "estimate"),
        ({"odometry": False}, "own position"),
        ({"position": np.array([99.0, 0, 0])}, "fence"),
    ],
)
def test_it_says_why_it_cannot_engage(change, words):
    bench = Bench()
    for name, value in change.items():
        setattr(bench, name, value)
    bench.guardian.engage(0.0)
    outputs = bench.run(0.5)
    assert silent(outputs)
    assert outputs[-1].state is S.MUTED
    assert "cannot engage" in outputs[0].reason
    assert words in outputs[0].reason


def test_a_refused_mode_is_asked_for_three_times_and_no_more():
    bench = Bench()
    bench.obeys = False
    bench.guardian.engage(0.0)
    bench.run(10.0)
    assert [request for _, request in bench.requests] == [OFFBOARD] * 3
    assert bench.out.state is S.MUTED
    assert bench.guardian.taken_over


def test_a_pilot_who_changes_the_mode_during_the_prestream_is_left_alone():
    bench = Bench()
    bench.guardian.engage(0.0)
    bench.run(0.5)
    bench.status = replace(bench.status, mode=FlightMode.ALTCTL)
    assert bench.tick().setpoint is None
    assert bench.out.state is S.MUTED
    bench.run(3.0)
    assert bench.requests == []


def test_the_end_of_a_takeoff_is_not_a_takeover():
    bench = Bench()
    bench.status = status(mode=FlightMode.AUTO_TAKEOFF)
    bench.guardian.engage(0.0)
    bench.run(0.5)
    bench.status = status(mode=FlightMode.AUTO_LOITER)
    bench.run(1.0)
    assert bench.out.state is S.HOLDING


def test_offboard_by_the_operators_own_hand_is_taken():
    bench = Bench()
    bench.guardian.engage(0.0)
    bench.run(0.2)
    bench.status = status(mode=FlightMode.OFFBOARD)
    assert bench.tick().state is S.HOLDING


@pytest.mark.parametrize("seconds", [0.5, 1.02])
def test_lost_position_before_offboard_ends_the_attempt(seconds):
    bench = Bench()
    bench.obeys = False
    bench.guardian.engage(0.0)
    bench.run(seconds)
    bench.odometry = False
    outputs = bench.run(1.0)
    assert outputs[-1].state is S.MUTED
    stale = [out.setpoint for out in outputs if out.setpoint is not None and out.setpoint.position_ned is None]
    assert stale
    assert all(not np.any(s.velocity_ned) for s in stale)


# Following


def test_a_good_trajectory_is_sent_as_it_is():
    bench = Bench().following()
    s = bench.out.setpoint
    reference = bench.trajectory.at(bench.t)
    bench.run(3.0)
    assert bench.out.setpoint.position_ned == pytest.approx(bench.trajectory.at(bench.t).position_ned, abs=0.02)
    assert bench.out.setpoint.velocity_ned == pytest.approx(reference.velocity_ned, abs=0.02)
    assert s.position_ned is not None


def test_an_expired_trajectory_brakes_then_hands_over_then_falls_silent():
    bench = Bench().following((2.0, 0, 0), seconds=3.0)
    bench.trajectory.t_expiry = bench.t
    outputs = bench.run(6.0)
    states = list(dict.fromkeys(out.state for out in outputs))
    assert states == [S.HOLDING, S.HANDOVER, S.MUTED]
    assert "expired" in outputs[0].reason
    handed = next(out for out in outputs if out.state is S.HANDOVER)
    assert handed.t - outputs[0].t == pytest.approx(2.0, abs=0.05)
    assert handed.request is HOLD
    assert handed.setpoint.velocity_ned == pytest.approx(np.zeros(3), abs=1e-9)
    assert violations(outputs) == []
    assert bench.guardian.taken_over
    assert not bench.guardian.commanding


def test_hold_is_asked_for_three_times_while_streaming_then_silence():
    bench = Bench().following()
    bench.obeys = False
    bench.requests.clear()
    bench.guardian.disengage(bench.t)
    outputs = bench.run(8.0)
    assert [request for _, request in bench.requests] == [HOLD] * 3
    assert outputs[-1].state is S.MUTED
    assert outputs[100].setpoint is not None


def test_disengaging_brakes_and_ends_silent_when_hold_is_there():
    bench = Bench().following()
    bench.guardian.disengage(bench.t)
    assert bench.tick().request is HOLD
    assert bench.out.setpoint is not None
    bench.run(0.1)
    assert bench.out.state is S.MUTED
    assert "left our mode" in bench.out.reason


def test_disengaging_during_the_prestream_just_stops():
    bench = Bench()
    bench.guardian.engage(0.0)
    bench.run(0.5)
    bench.guardian.disengage(bench.t)
    bench.run(3.0)
    assert bench.requests == []
    assert bench.out.state is S.MUTED


def test_disengaging_while_offboard_is_being_asked_for_still_asks_for_hold():
    bench = Bench()
    bench.obeys = False
    bench.guardian.engage(0.0)
    bench.run(1.1)
    bench.guardian.disengage(bench.t)
    assert bench.tick().request is HOLD


NAN = math.nan


@pytest.mark.parametrize(
    ("trajectory", "words"),
    [
        (None, "no trajectory"),
        (Path(lambda t: motion((NAN, 0, 0))), "not finite"),
        (Path(lambda t: motion((0, 0, -3), (math.inf, 0, 0))), "not finite"),
        (Path(lambda t: motion((0, 0, -3), yaw=NAN)), "not finite"),
        (Path(lambda t: motion((1e9, 0, -3))), "absurd"),
        (Path(lambda t: replace(motion((0, 0, -3)), feedback_velocity_ned=np.array([NAN, 0, 0]))), "not finite"),
        (Path(lambda t: replace(motion((0, 0, -3)), feedback_acceleration_ned=np.array([0, NAN, 0]))), "not finite"),
        (Path(lambda t: 1 / 0), "cannot be evaluated"),
        (Path(lambda t: motion((0, 0))), "cannot be evaluated"),
        (Path(lambda t: motion((0, 0, -3)), t_expiry=NAN), "expired"),
        (Path(lambda t: motion((0, 0, -3)), t_start=1e6), "begins only"),
        (Path(lambda t: motion((0, 0, -3)), reset_counter=3), "estimate 3"),
    ],
)
def test_what_cannot_be_followed_is_refused_with_its_reason(trajectory, words):
    bench = Bench().following()
    bench.trajectory = trajectory
    outputs = bench.run(0.5)
    assert {out.state for out in outputs} == {S.HOLDING}
    assert words in outputs[0].reason
    assert violations(outputs) == []


def test_touchdown_goes_on_pressing_down_below_the_ground():
    """Land detection wants a commanded descent of at least 0.275 m/s although the vehicle no longer moves."""
    bench = Bench()
    bench.position = np.array([0.0, 0.0, -0.5])
    bench.engaged()
    bench.trajectory = line(bench.position, (0, 0, 0.35), bench.t)
    bench.run(1.4)
    bench.stuck = True
    bench.velocity = np.zeros(3)
    outputs = bench.run(6.0)
    assert all(0.3 <= out.setpoint.velocity_ned[2] <= LIMITS.speed_down for out in outputs[50:])
    assert outputs[-1].setpoint.velocity_ned[2] == pytest.approx(0.35, abs=0.05)
    assert outputs[-1].setpoint.position_ned[2] - bench.position[2] <= 1.0 + 1e-9
    assert outputs[-1].setpoint.position_ned[2] > 0.0
    assert violations(outputs) == []


def test_the_setpoint_stays_near_a_vehicle_that_does_not_move():
    bench = Bench().following((2.0, 0, 0))
    bench.stuck = True
    outputs = bench.run(4.0)
    assert max(np.linalg.norm((o.setpoint.position_ned - bench.position)[:2]) for o in outputs) <= 1.1
    assert "leash" in outputs[-1].clips


def test_closing_speed_is_capped_against_a_target_that_stops_dead():
    bench = Bench().following((1.4, 0, 0), seconds=5.0)
    target = TargetPose(
        t=bench.t,
        position_ned=bench.position + np.array([30.0, 0, 0]),
        velocity_ned=np.array([-1.0, 0, 0]),
        acceleration_ned=np.zeros(3),
        yaw=0.0,
        yaw_rate=0.0,
        covariance=np.eye(4),
    )
    bench.target = target
    outputs = bench.run(0.9)
    assert outputs[-1].setpoint.velocity_ned[0] <= 0.55
    assert "closing_speed" in outputs[-1].clips
    assert violations(outputs) == []
    bench.run(0.5)  # the target's pose is too old now
    assert "closing_speed" not in bench.out.clips
    bench.target = replace(target, t=bench.t, velocity_ned=np.array([NAN, 0, 0]))
    bench.run(0.5)
    assert "closing_speed" not in bench.out.clips


def test_the_fence_stands_about_the_place_of_the_take_off():
    bench = Bench(fence=Fence(radius=6.0))
    bench.position = np.array([40.0, -30.0, 2.0])  # the autopilot's origin is far away, and higher
    bench.status = status(armed=False, landed=LandedState.ON_GROUND)
    for _ in range(5):
        bench.tick()
    bench.status = status()
    bench.following((2.5, 0, 0), seconds=8.0)
    assert 4.0 < bench.position[0] - 40.0 <= 6.0
    assert "fence" in bench.out.clips or "leash" in bench.out.clips


def test_a_reset_of_the_estimate_takes_the_fence_along():
    bench = Bench(fence=Fence(radius=6.0)).following((0.5, 0, 0), seconds=2.0)
    bench.trajectory = None
    bench.position = bench.position + np.array([100.0, 0.0, -20.0])
    bench.reset_counter = 1
    bench.tick()
    assert "fence" not in bench.out.clips
    start = bench.position.copy()
    bench.trajectory = line(bench.position, (2.5, 0, 0), bench.t, reset_counter=1)
    for _ in range(400):
        bench.tick()
    assert 3.0 < bench.position[0] - start[0] <= 6.0


def test_the_fence_is_never_left():
    bench = Bench(fence=Fence(radius=6.0)).following((2.5, 0, 0), seconds=8.0)
    assert "fence" in bench.out.clips or "leash" in bench.out.clips
    assert bench.position[0] <= 5.0 + 1e-6


# Others take the vehicle


@pytest.mark.parametrize(
    "change",
    [
        {"mode": FlightMode.POSCTL},
        {"mode": FlightMode.AUTO_RTL},
        {"mode": FlightMode.TERMINATION},
        {"system_status": SystemStatus.CRITICAL},
        {"system_status": SystemStatus.FLIGHT_TERMINATION},
        {"system_status": SystemStatus.BOOT},
        {"connected": False},
        {"estimate_valid": False},
    ],
)
def test_it_is_mute_in_the_same_tick_and_stays_so(change):
    bench = Bench().following()
    bench.requests.clear()
    before = bench.status
    bench.status = replace(before, **change)
    out = bench.tick()
    assert out.setpoint is None
    assert out.state is S.MUTED
    assert out.reason
    bench.status = before  # back in OFFBOARD, as PX4 does by itself when a failsafe clears
    assert silent(bench.run(5.0))
    assert bench.requests == []
    assert bench.guardian.taken_over
    bench.guardian.engage(bench.t)
    assert bench.tick().state is S.PRESTREAM
    assert not bench.guardian.taken_over


def test_no_status_at_all_mutes():
    bench = Bench().following()
    bench.status = None
    bench.obeys = False
    out = bench.guardian.tick(bench.t + DT, bench.ownship, None, bench.trajectory, None)
    assert out.state is S.MUTED


# The own position ages, the program stalls


def test_an_old_position_brakes_by_velocity_alone_then_falls_silent():
    bench = Bench().following((1.0, 0, 0), seconds=2.0)
    bench.odometry = False
    outputs = bench.run(0.5)
    for out in outputs:
        age = out.t - bench.ownship.t
        if age <= 0.1:
            assert out.state is S.FOLLOWING
            assert out.setpoint.position_ned is not None
        elif age <= 0.25 - 1e-9:
            assert out.state is S.BLIND
            assert out.setpoint.position_ned is None
        elif age > 0.25 + 1e-9:
            assert out.state is S.GAP
            assert out.setpoint is None
    blind = [out for out in outputs if out.state is S.BLIND]
    assert blind[-1].setpoint.velocity_ned[0] < blind[0].setpoint.velocity_ned[0] <= 1.0
    assert violations(outputs) == []


def test_a_short_blindness_is_not_noticed_outside():
    bench = Bench().following((1.0, 0, 0), seconds=2.0)
    bench.odometry = False
    outputs = bench.run(0.16)
    bench.odometry = True
    outputs += bench.run(1.0)
    assert outputs[-1].state is S.FOLLOWING
    assert violations(outputs) == []


def test_after_a_gap_it_holds_here_first():
    bench = Bench().following((1.0, 0, 0), seconds=2.0)
    bench.odometry = False
    bench.run(0.5)
    assert bench.out.state is S.GAP
    bench.odometry = True
    bench.position = np.array([7.0, 0.5, -3.0])
    out = bench.tick()
    assert out.state is S.HOLDING
    assert out.setpoint.position_ned == pytest.approx([7, 0.5, -3], abs=1e-9)
    assert out.setpoint.velocity_ned == pytest.approx(np.zeros(3))
    assert violations([out, *bench.run(2.0)]) == []
    assert bench.out.state is S.FOLLOWING


def test_after_a_long_gap_only_the_operator_resumes():
    bench = Bench().following()
    bench.odometry = False
    bench.run(1.5)
    assert bench.out.state is S.MUTED
    bench.odometry = True
    assert silent(bench.run(2.0))


@pytest.mark.parametrize(("pause", "after"), [(0.15, S.FOLLOWING), (0.4, S.GAP), (1.0, S.MUTED)])
def test_a_stalled_program(pause, after):
    bench = Bench().following()
    out = bench.tick(pause)
    assert out.state is after
    assert (out.setpoint is None) == (after is not S.FOLLOWING)


def test_a_clock_that_does_not_advance_sends_nothing():
    bench = Bench().following()
    for t in (bench.t, bench.t - 1.0, NAN, math.inf):
        out = bench.guardian.tick(t, bench.ownship, bench.status, bench.trajectory, None)
        assert out.setpoint is None
        assert "clock" in out.reason
    assert bench.tick().state is S.FOLLOWING


@pytest.mark.parametrize("bad", ["nan", "future", "old", "absurd"])
def test_a_bad_own_state_is_passed_over_and_ages_out(bad):
    bench = Bench().following()
    good = bench.ownship
    bench.odometry = False
    change = {
        "nan": {"position_ned": np.array([NAN, 0, 0]), "t": good.t + 0.02},
        "future": {"t": good.t + 10.0},
        "old": {"t": good.t - 1.0},
        "absurd": {"velocity_ned": np.array([1e7, 0, 0]), "t": good.t + 0.02},
    }[bad]
    bench.ownship = replace(good, **change)
    outputs = bench.run(0.2)
    assert violations(outputs) == []
    assert outputs[-1].state is S.BLIND


# The autopilot's estimate is reset


def test_a_position_reset_moves_the_setpoint_with_it_and_waits_for_a_new_plan():
    bench = Bench().following((1.0, 0, 0), seconds=2.0)
    jump = np.array([5.0, -3.0, 1.0])
    before = bench.out.setpoint
    bench.position = bench.position + jump
    bench.reset_counter = 1
    outputs = bench.run(0.5)
    first = outputs[0].setpoint
    assert outputs[0].state is S.HOLDING
    assert "estimate" in outputs[0].reason
    assert first.position_ned - before.position_ned == pytest.approx(jump, abs=0.05)
    assert first.velocity_ned == pytest.approx(before.velocity_ned, abs=0.06)
    bench.trajectory = line(bench.position, (1.0, 0, 0), bench.t, reset_counter=1)
    outputs += bench.run(1.0)
    assert outputs[-1].state is S.FOLLOWING
    assert violations(outputs) == []


def test_a_heading_reset_does_not_snap_the_yaw():
    bench = Bench().engaged()
    bench.yaw = 0.6
    bench.reset_counter = 255
    out = bench.tick()
    assert out.setpoint.yaw == pytest.approx(0.6)
    assert out.setpoint.yaw_rate == 0.0


# The end


def test_after_disarming_it_leaves_offboard_and_is_silent():
    bench = Bench().following()
    bench.status = replace(bench.status, armed=False, system_status=SystemStatus.STANDBY)
    out = bench.tick()
    assert out.state is S.LEAVING
    assert out.setpoint is None
    assert out.request is HOLD
    assert silent(bench.run(2.0))
    assert bench.out.state is S.MUTED
    assert not bench.guardian.taken_over


def test_leaving_offboard_is_tried_three_times():
    bench = Bench().following()
    bench.requests.clear()
    bench.obeys = False
    bench.status = replace(bench.status, armed=False)
    bench.run(8.0)
    assert [request for _, request in bench.requests] == [HOLD] * 3
    assert bench.out.state is S.MUTED


def test_on_the_ground_it_waits_for_arming_as_long_as_it_takes():
    bench = Bench()
    bench.position = np.zeros(3)
    bench.status = status(armed=False, system_status=SystemStatus.STANDBY)
    bench.engaged()
    bench.trajectory = line(bench.position, (0, 0, -1.0), bench.t)
    outputs = bench.run(10.0)
    assert {out.state for out in outputs} == {S.HOLDING}
    assert outputs[-1].setpoint.velocity_ned == pytest.approx(np.zeros(3))
    bench.position = np.array([0.2, 0.0, 0.1])  # the estimate wanders
    assert bench.tick().setpoint.position_ned == pytest.approx(bench.position)


def test_finishing_before_arming_leaves_offboard():
    bench = Bench()
    bench.status = status(armed=False, system_status=SystemStatus.STANDBY)
    bench.engaged()
    bench.guardian.finish(bench.t)
    assert bench.tick().state is S.LEAVING
    assert bench.out.request is HOLD


def test_finishing_in_the_air_waits_for_the_disarming():
    bench = Bench().following()
    bench.guardian.finish(bench.t)
    bench.run(1.0)
    assert bench.out.state is S.FOLLOWING


def test_events_while_muted_are_forgotten():
    bench = Bench()
    bench.guardian.disengage(0.0)
    bench.guardian.finish(0.0)
    bench.run(0.1)
    bench.engaged()
    assert bench.out.state is S.HOLDING


def test_finishing_during_the_prestream_asks_for_nothing():
    bench = Bench()
    bench.status = status(armed=False, system_status=SystemStatus.STANDBY)
    bench.guardian.engage(0.0)
    bench.run(0.2)
    bench.guardian.finish(bench.t)
    assert bench.tick().state is S.LEAVING
    bench.run(3.0)
    assert bench.requests == []
    assert bench.guardian.state is S.MUTED
