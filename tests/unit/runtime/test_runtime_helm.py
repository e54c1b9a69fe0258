"""The guardian's side trusts neither the planner nor its silence, and obeys the operator where the vehicle allows."""

from __future__ import annotations

from itertools import groupby, pairwise

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink
from runtime_helm_bench import OFFBOARD, TICK, Rig

from companion.guardian.handover import Order, Stage
from companion.link.pilot_desk import MODE_NUMBERS
from companion.messages.decision import Mode
from companion.messages.guardian import GuardianState
from companion.messages.news import MissionNews
from companion.messages.operator import OperatorOrder
from companion.messages.ownship import FlightMode
from companion.messages.pilot import LandingTarget, PilotText, Severity

S = GuardianState
LOITER, LAND, PRECLAND = 3, 6, 9  # sub modes of AUTO
ACCEPTED, REJECTED, DENIED = 0, 1, 2


def disarmed(**options) -> Rig:
    rig = Rig(armed=False, **options)
    rig.run(1.5)
    return rig


def modes_asked(rig: Rig) -> list[int]:
    """Give the main modes of DO_SET_MODE."""
    return [int(second) for _, command, second in rig.commands if command == 176]


# The planner


def test_without_the_operators_word_no_planner_engages_or_arms() -> None:
    rig = disarmed()
    rig.stage, rig.orders = Stage.RUNNING, frozenset(Order)
    rig.run(5.0)
    assert rig.helm.state is S.MUTED
    assert rig.setpoints == []
    assert rig.asked() == []


def test_by_itself_it_engages_once_where_that_is_allowed() -> None:
    rig = disarmed(auto=True)
    rig.stage, rig.orders = Stage.RUNNING, frozenset({Order.ENGAGE})
    rig.run(1.5)
    assert rig.helm.state is S.HOLDING
    rig.autopilot.mode = 3 << 16
    rig.run(1.0)
    assert rig.helm.state is S.MUTED
    rig.sent.clear()
    rig.run(3.0)
    assert rig.setpoints == []
    assert rig.asked() == []


def test_the_word_counts_for_a_moment_only() -> None:
    rig = disarmed()
    assert rig.helm.order(OperatorOrder.ENGAGE).accepted
    assert rig.helm.receive(rig.t + 0.001, []).orders == [OperatorOrder.ENGAGE]
    rig.run(3.5)  # the planner does not take it up
    rig.stage, rig.orders = Stage.RUNNING, frozenset({Order.ENGAGE})
    rig.run(2.0)
    assert rig.helm.state is S.MUTED


def test_arming_is_asked_for_three_times_however_often_the_planner_wants_it() -> None:
    rig = disarmed()
    rig.autopilot.arm_result = 1
    rig.engaged()
    rig.orders = frozenset({Order.ARM})
    rig.run(12.0)
    arm = [t for t, command, _ in rig.commands if command == 400]
    assert len(arm) == 3
    assert min(later - earlier for earlier, later in pairwise(arm)) > 1.9


@pytest.mark.parametrize(("landed", "arms"), [(0, True), (1, True), (2, False), (3, False), (4, False)])
def test_arming_is_for_the_ground(landed: int, arms: bool) -> None:
    rig = disarmed().engaged()
    rig.landed = landed
    rig.run(0.2)
    rig.orders = frozenset({Order.ARM})
    rig.run(0.2)
    assert (400 in rig.asked()) is arms


def test_a_planner_that_falls_silent_is_braked_held_and_handed_over_after_two_seconds() -> None:
    rig = Rig().engaged()
    assert rig.helm.state is S.FOLLOWING
    rig.planning = False
    t_silent, seen = rig.t, {}
    while rig.t < t_silent + 4.0:
        rig.tick()
        seen.setdefault(rig.helm.state, rig.t - t_silent)
    assert list(seen) == [S.FOLLOWING, S.HOLDING, S.HANDOVER, S.MUTED]
    assert seen[S.HOLDING] == pytest.approx(0.5, abs=2 * TICK)
    assert seen[S.HANDOVER] == pytest.approx(2.5, abs=3 * TICK)
    assert rig.autopilot.mode == LOITER << 24 | 4 << 16


def test_a_trajectory_that_would_never_expire_does_with_its_planner() -> None:
    rig = Rig().engaged()
    rig.planning = False
    rig.helm._handover.trajectory.t_expiry = 1e6
    rig.run(1.0)
    assert rig.helm.state is S.HOLDING


def test_a_planner_that_is_gone_on_the_ground_leaves_offboard() -> None:
    rig = disarmed().engaged()
    rig.planning = False
    rig.helm.planner_gone(rig.t)
    rig.run(1.0)
    assert rig.helm.state is S.MUTED
    assert rig.autopilot.mode != OFFBOARD


def test_a_planner_that_is_gone_in_the_air_is_a_silent_one() -> None:
    rig = Rig().engaged()
    rig.planning = False
    rig.helm.planner_gone(rig.t)
    rig.run(1.0)
    assert rig.helm.state is S.HOLDING


def test_the_end_of_the_mission_gives_a_flying_vehicle_back() -> None:
    rig = Rig().engaged()
    rig.stage, rig.orders = Stage.ENDED, frozenset({Order.FINISH})
    rig.run(1.0)
    assert rig.helm.state is S.MUTED
    assert rig.autopilot.mode == LOITER << 24 | 4 << 16


# The operator


@pytest.mark.parametrize(
    ("order", "sub_mode", "words"),
    [
        (OperatorOrder.HOLD, LOITER, "AUTO.LOITER; the mission waits"),
        (OperatorOrder.LAND, LAND, "AUTO.LAND; the mission waits"),
        (OperatorOrder.ABORT, LOITER, "AUTO.LOITER; the mission is over"),
    ],
)
def test_the_operator_has_the_vehicle_given_back(order, sub_mode, words) -> None:
    rig = Rig().engaged()
    answer = rig.helm.order(order)
    assert answer.accepted
    assert words in answer.text
    rig.tick()
    assert rig.helm.state is S.HANDOVER
    assert rig.telemetry.orders == [order]
    rig.run(1.0)
    assert rig.helm.state is S.MUTED
    assert rig.autopilot.mode == sub_mode << 24 | 4 << 16
    rig.sent.clear()
    rig.orders = frozenset({Order.ENGAGE, Order.ARM})
    rig.run(3.0)
    assert rig.asked() == []


@pytest.mark.parametrize("order", [OperatorOrder.HOLD, OperatorOrder.LAND])
def test_a_vehicle_that_is_not_ours_is_left_alone(order) -> None:
    rig = Rig()
    rig.run(1.5)
    answer = rig.helm.order(order)
    assert not answer.accepted
    assert "not flown by this program: its mode is AUTO.LOITER" in answer.text
    rig.run(1.0)
    assert rig.asked() == []


def test_aborting_is_always_possible() -> None:
    rig = Rig()
    rig.run(1.5)
    assert rig.helm.order(OperatorOrder.ABORT).accepted
    rig.tick()
    assert rig.telemetry.orders == [OperatorOrder.ABORT]
    assert rig.asked() == []


def test_engaging_is_refused_with_the_reason() -> None:
    rig = Rig()
    assert "planner is silent" in rig.helm.order(OperatorOrder.ENGAGE).text
    rig.planning = True
    for stage in (Stage.WAITING, Stage.RUNNING, Stage.ENDED):
        rig.stage = stage
        rig.run(0.1)
        assert f"the mission is {stage.value}" in rig.helm.order(OperatorOrder.ENGAGE).text
    rig.stage = Stage.STANDBY
    rig.run(1.2)
    rig.landed = 1
    rig.run(0.2)
    assert "landed state is ON_GROUND" in rig.helm.order(OperatorOrder.ENGAGE).text
    rig.landed = 2
    rig.run(0.2)
    rig.planning = False
    rig.run(0.6)
    assert "planner is silent" in rig.helm.order(OperatorOrder.ENGAGE).text
    rig.planning = True
    rig.run(0.1)
    rig.engaged()
    assert "engaged already" in rig.helm.order(OperatorOrder.ENGAGE).text
    rig.autopilot.obey = False
    rig.helm.order(OperatorOrder.HOLD)
    rig.tick()
    assert "being given back" in rig.helm.order(OperatorOrder.ENGAGE).text


def user_1(order: float, *, system=1, component=191, source=(255, 190), command=31010) -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
    message = mavlink.MAVLink_command_long_message(system, component, command, 0, order, 0, 0, 0, 0, 0, 0)
    return bytes(message.pack(sender))


def answers(rig: Rig, data: bytes) -> list[int]:
    rig.sent.clear()
    rig.extra.append((rig.t + 0.001, data))
    rig.run(0.1)
    found = []
    for _, sent in rig.sent:
        if sent[7] == 77:
            (ack,) = mavlink.MAVLink(None).parse_buffer(sent)
            assert (ack.command, ack.target_system, ack.target_component) == (31010, 255, 190)
            found.append(ack.result)
    return found


def test_the_ground_station_orders_by_mavlink_and_is_answered() -> None:
    rig = Rig()
    rig.run(1.5)
    assert answers(rig, user_1(2)) == [REJECTED]  # hold: not ours
    assert answers(rig, user_1(7)) == [DENIED]
    assert answers(rig, user_1(1)) == [ACCEPTED]
    rig.stage, rig.orders = Stage.RUNNING, frozenset({Order.ENGAGE})
    rig.run(1.5)
    assert rig.helm.state is S.FOLLOWING
    assert answers(rig, user_1(1)) == [REJECTED]
    assert answers(rig, user_1(4)) == [ACCEPTED]
    rig.run(1.0)
    assert rig.autopilot.mode == LAND << 24 | 4 << 16


@pytest.mark.parametrize(
    "data",
    [
        user_1(3, source=(254, 190)),
        user_1(3, source=(255, 1)),
        user_1(3, system=2),
        user_1(3, component=1),
        user_1(3, command=31011),
        user_1(3)[:-1] + b"\0",
    ],
    ids=["system", "component", "another vehicle", "the autopilot", "command", "checksum"],
)
def test_nobody_else_orders(data: bytes) -> None:
    rig = Rig().engaged()
    assert answers(rig, data) == []
    assert rig.helm.state is S.FOLLOWING


def test_a_flood_of_orders_is_bounded() -> None:
    rig = Rig().engaged()
    rig.extra += [(rig.t + 0.001, user_1(9))] * 500
    rig.sent.clear()
    rig.tick()
    assert len([data for _, data in rig.sent if data[7] == 77]) <= 16


# What people are told


def said(*words: str, count: int) -> MissionNews:
    texts = tuple(PilotText(severity=Severity.NOTICE, text=text) for text in words)
    return MissionNews(mode=Mode.LAND, said=count, texts=texts, values={"pad_dist": 1.5})


def test_the_planners_texts_are_passed_on_once_also_when_handovers_are_lost() -> None:
    rig = Rig()
    rig.run(1.5)
    rig.sent.clear()
    rig.more = {"news": said("one", count=1)}
    rig.run(0.1)
    rig.more = {"news": said("one", "two", "three", count=3)}  # the handover with "two" alone never came
    rig.run(0.3)
    assert [text for text in rig.texts if text in ("one", "two", "three")] == ["one", "two", "three"]


def test_the_numbers_and_the_mode_are_passed_on() -> None:
    rig = Rig()
    rig.run(1.5)
    rig.more = {"news": said(count=0)}
    rig.run(2.5)
    assert {(message.name, message.value) for message in rig.sent_messages("NAMED_VALUE_FLOAT")} == {("pad_dist", 1.5)}
    assert rig.sent_messages("HEARTBEAT")[-1].custom_mode & 0xFF == MODE_NUMBERS[Mode.LAND]


def test_people_learn_of_a_planner_that_has_died() -> None:
    rig = Rig().engaged()
    rig.sent.clear()
    rig.planning = False
    rig.run(4.0)
    assert any("giving the vehicle back" in text for text in rig.texts)


@pytest.mark.parametrize("allowed", [False, True])
def test_landing_targets_go_out_only_where_the_mission_lets_the_autopilot_land(allowed: bool) -> None:
    rig = Rig(landing_targets=allowed)
    rig.run(1.5)
    for _ in range(10):
        target = LandingTarget(
            t=rig.t - 0.05,
            position_ned=np.array([1.0, 2.0, 3.0]),
            yaw=0.0,
            position_std=0.02,
            distance=3.0,
            angle_right=0.0,
            angle_down=0.0,
            size_right=0.1,
            size_down=0.1,
        )
        rig.more = {"news": MissionNews(landing_target=target)}
        rig.run(0.1)
    sent = rig.sent_messages("LANDING_TARGET")
    assert bool(sent) is allowed
    assert all((message.x, message.y, message.z) == (1.0, 2.0, 3.0) for message in sent)


def test_a_precision_landing_that_is_refused_twice_becomes_hold() -> None:
    rig = Rig().engaged()
    rig.autopilot.mode_result = 2
    rig.more = {"receiver": FlightMode.AUTO_PRECLAND}
    rig.stage, rig.orders = Stage.ENDED, frozenset({Order.FINISH})
    rig.sent.clear()
    rig.run(12.0)
    modes = [message for message in rig.sent_messages("COMMAND_LONG") if message.command == 176]
    asked = [key for key, _ in groupby((int(message.param2), int(message.param3)) for message in modes)]
    assert asked[:2] == [(4, PRECLAND), (4, LOITER)]
    rig.autopilot.mode_result = 0
    rig.run(3.0)
    assert rig.helm.state is S.MUTED
