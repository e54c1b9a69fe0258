from __future__ import annotations

import pytest

from companion.config.sections import EngagementSection
from companion.guardian.handover import Order
from companion.link.events import ArmingRefused, AutopilotRestarted, LinkEvent, ParameterRead, WrongVehicle
from companion.messages.decision import Decision, Mode, Switch
from companion.messages.operator import OperatorOrder
from companion.messages.ownship import FlightMode, LandedState, SystemStatus, VehicleStatus
from companion.preflight.autopilot_parameters import WantedParameters
from companion.runtime.conductor import Conductor
from companion.runtime.ports import MissionState

TICK = 0.02
SAFE = {
    "COM_RC_OVERRIDE": 3.0,
    "COM_OBL_RC_ACT": 0.0,
    "COM_OF_LOSS_T": 1.0,
    "COM_RCL_EXCEPT": 0.0,
    "NAV_RCL_ACT": 2.0,
    "GF_ACTION": 2.0,
}


class Ground:
    """A conductor with a vehicle as it stands on the ground; fields are changed by the tests."""

    def __init__(self, *, auto: bool = True, **parameters: float) -> None:
        section = EngagementSection(**parameters)  # type: ignore[arg-type]
        self.conductor = Conductor(section, WantedParameters().rules, auto_engage=auto)
        self.autopilot: dict[str, float | None] = dict(SAFE)
        self.answers: list[LinkEvent] = []
        self.readings = 0
        self.t = 100.0
        self.vehicle = {"connected": True, "armed": False, "mode": FlightMode.AUTO_LOITER, "estimate_valid": True}
        self.fresh = True
        self.heard = ""
        self.missing = ""
        self.muted = self.taken_over = False
        self.operator: tuple[OperatorOrder, ...] = ()
        self.mode = Mode.PREFLIGHT

    def step(
        self, *events: LinkEvent, switched: tuple[Mode, str] | None = None, decision: Decision | None = None
    ) -> list[Order]:
        self.t += TICK
        if switched is not None:
            self.mode = switched[0]
        switch = None if switched is None else Switch(t=self.t, mode=switched[0], reason=switched[1])
        answers, self.answers = self.answers, []
        orders = self.conductor.update(
            t=self.t,
            vehicle=VehicleStatus(
                t=self.t,
                landed=LandedState.ON_GROUND,
                system_status=SystemStatus.STANDBY,
                battery_remaining=None,
                **self.vehicle,  # type: ignore[arg-type]
            ),
            telemetry_fresh=self.fresh,
            events=[*answers, *events],
            decision=decision or Decision(t=self.t, mode=self.mode, switched=switch, probabilities=None),
            muted=self.muted,
            taken_over=self.taken_over,
            missing=self.missing,
            operator=self.operator,
            guardian="asked for it as often as allowed",
            heard=self.heard,
        )
        if Order.READ_PARAMETERS in orders:
            orders.remove(Order.READ_PARAMETERS)
            self.readings += 1
            self.answers += [ParameterRead(t=self.t, name=n, value=v) for n, v in self.autopilot.items()]
        return orders

    def run(self, seconds: float) -> list[tuple[float, Order]]:
        begin = self.t
        return [(self.t - begin, order) for _ in range(round(seconds / TICK)) for order in self.step()]

    @property
    def state(self) -> MissionState:
        return self.conductor.status.state

    @property
    def reason(self) -> str:
        return self.conductor.status.reason


def refusal(t: float, text: str) -> ArmingRefused:
    return ArmingRefused(t=t, result="denied", unhealthy=("GPS",), autopilot_events=(), status_texts=(text,))


def engaged(**parameters: float) -> Ground:
    ground = Ground(**parameters)
    assert [order for _, order in ground.run(1.2)] == [Order.ENGAGE]
    ground.vehicle["mode"] = FlightMode.OFFBOARD
    return ground


def test_engages_once_telemetry_has_been_good_for_a_while() -> None:
    ground = Ground(ready_s=1.0)
    ground.run(0.6)
    ground.fresh = False  # a gap begins the wait anew
    ground.run(0.2)
    ground.fresh = True
    orders = ground.run(2.0)
    assert [order for _, order in orders] == [Order.ENGAGE]
    assert orders[0][0] == pytest.approx(1.0 + TICK, abs=1.5 * TICK)
    assert ground.state is MissionState.RUNNING


def test_arms_in_offboard_only_and_not_again_once_armed() -> None:
    ground = engaged()
    ground.vehicle["mode"] = FlightMode.AUTO_LOITER
    assert ground.run(1.0) == []
    ground.vehicle["mode"] = FlightMode.OFFBOARD
    assert [order for _, order in ground.run(1.0)] == [Order.ARM]
    ground.vehicle["armed"] = True
    assert ground.run(5.0) == []


def test_a_refusal_after_the_last_try_ends_the_mission_with_all_reasons() -> None:
    ground = engaged(arm_tries=2, arm_interval_s=1.0)
    assert Order.ARM in ground.step()
    assert ground.step(refusal(ground.t, "no GPS")) == []
    assert [order for _, order in ground.run(1.0)] == [Order.ARM]
    assert ground.step(refusal(ground.t, "no compass")) == [Order.FINISH]
    assert ground.state is MissionState.REFUSED
    for text in ("2 times", "no GPS", "no compass", "unhealthy: GPS", "denied"):
        assert text in ground.reason
    assert ground.reason.count("unhealthy: GPS") == 1
    assert ground.run(1.0) == []


def test_an_autopilot_that_says_nothing_to_arm() -> None:
    ground = engaged(arm_tries=2, arm_interval_s=1.0)
    assert [order for _, order in ground.run(4.0)] == [Order.ARM, Order.ARM, Order.FINISH]
    assert ground.state is MissionState.REFUSED
    assert "it gave no reason" in ground.reason


def test_an_autopilot_that_does_not_enter_offboard() -> None:
    ground = engaged(offboard_timeout_s=3.0)
    ground.vehicle["mode"] = FlightMode.AUTO_LOITER
    assert [order for _, order in ground.run(5.0)] == [Order.FINISH]
    assert ground.state is MissionState.REFUSED
    assert "OFFBOARD" in ground.reason
    assert "guardian: asked for it" in ground.reason


@pytest.mark.parametrize("heard", ["", "heard only system 7 component 1"])
def test_no_heartbeat_ends_the_mission_in_time(heard: str) -> None:
    ground = Ground(vehicle_timeout_s=4.0)
    ground.vehicle["connected"] = False
    ground.heard = heard
    ground.run(3.9)
    assert ground.state is MissionState.WAITING
    assert ground.run(0.3) == []
    assert ground.state is MissionState.NO_VEHICLE
    assert ground.conductor.status.vehicle_missing
    assert (heard or "nothing at all was heard") in ground.reason


def test_an_estimate_that_never_becomes_valid() -> None:
    ground = Ground(ready_timeout_s=5.0)
    ground.vehicle["estimate_valid"] = False
    ground.run(5.2)
    assert ground.state is MissionState.REFUSED
    assert "position estimate" in ground.reason


def test_a_mission_begins_disarmed() -> None:
    ground = Ground()
    ground.vehicle["armed"] = True
    assert ground.step() == []
    assert ground.state is MissionState.REFUSED


def test_another_kind_of_vehicle() -> None:
    ground = Ground()
    wrong = WrongVehicle(t=0.0, type_name="fixed wing", autopilot="PX4", wanted="a multicopter is needed")
    assert ground.step(wrong) == []
    assert ground.state is MissionState.WRONG_VEHICLE
    assert ground.conductor.status.vehicle_missing
    assert "fixed wing" in ground.reason


def test_a_heartbeat_that_stops_in_flight() -> None:
    ground = engaged()
    ground.vehicle["armed"] = True
    ground.step(switched=(Mode.TAKEOFF, "armed"))
    ground.vehicle["connected"] = False
    assert ground.step(switched=(Mode.ABORT, "taken over")) == [Order.FINISH]
    assert ground.state is MissionState.LOST
    assert ground.conductor.status.mode is Mode.TAKEOFF


@pytest.mark.parametrize(
    ("before", "end", "state"),
    [
        (Mode.TOUCHDOWN, Mode.DONE, MissionState.LANDED),
        (Mode.HOLD, Mode.DONE, MissionState.HELD),
        (Mode.LAND, Mode.ABORT, MissionState.ABORTED),
    ],
)
def test_guidance_ends_the_mission(before: Mode, end: Mode, state: MissionState) -> None:
    ground = engaged()
    ground.vehicle["armed"] = True
    assert ground.step(switched=(before, "so far")) == []
    assert ground.state is MissionState.RUNNING
    assert ground.step(switched=(end, "the end")) == [Order.FINISH]
    assert ground.state is state
    assert ground.reason == "the end"


def test_engages_again_while_the_guardian_finds_an_obstacle() -> None:
    ground = engaged()
    ground.vehicle["mode"] = FlightMode.AUTO_LOITER
    ground.muted = True
    assert {order for _, order in ground.run(2.0)} == {Order.ENGAGE}
    ground.muted = False
    assert ground.run(1.0) == []


def test_a_decision_that_is_not_renewed_counts_once() -> None:
    ground = engaged()
    stale = Decision(
        t=ground.t,
        mode=Mode.TAKEOFF,
        switched=Switch(t=ground.t, mode=Mode.TAKEOFF, reason="armed"),
        probabilities=None,
    )
    for _ in range(3):
        ground.step(decision=stale)
        ground.vehicle["armed"] = True
    assert ground.reason == "armed"
    assert ground.conductor.status.t == pytest.approx(ground.t - 2 * TICK)


def test_the_operator_stops_it_once() -> None:
    ground = engaged()
    ground.conductor.stop(ground.t)
    assert ground.state is MissionState.ABORTED
    ground.step(switched=(Mode.DONE, "too late"))
    ground.conductor.stop(ground.t + 1.0)
    assert ground.reason == "stopped by the operator"
    assert ground.conductor.status.t == ground.t - TICK


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("COM_RC_OVERRIDE", 1.0, "COM_RC_OVERRIDE is 1, wanted: bit 1 set"),
        ("COM_OBL_RC_ACT", 6.0, "COM_OBL_RC_ACT is 6 (Terminate), wanted: 0 or 3 or 4 or 5 (Position, Return, Land"),
        ("COM_OF_LOSS_T", 10.0, "COM_OF_LOSS_T is 10, wanted: 0.3 to 2"),
        ("COM_RCL_EXCEPT", 4.0, "COM_RCL_EXCEPT is 4, wanted: bit 2 not set"),
        ("NAV_RCL_ACT", 6.0, "NAV_RCL_ACT is 6 (Disarm), wanted: 1 or 2 or 3 (Hold, Return, Land)"),
        ("GF_ACTION", 0.0, "GF_ACTION is 0 (none), wanted: 2 or 3 or 5"),
        ("GF_ACTION", None, "GF_ACTION is not given by the autopilot, wanted: 2 or 3 or 5"),
    ],
)
def test_an_unsafe_parameter_refuses_before_anything_is_engaged(name: str, value: float | None, words: str) -> None:
    ground = Ground()
    ground.autopilot[name] = value
    assert ground.run(3.0) == []
    assert ground.state is MissionState.REFUSED
    assert words in ground.reason
    assert not any(other in ground.reason for other in SAFE if other != name)


def test_nothing_is_engaged_before_every_parameter_is_known() -> None:
    ground = Ground()
    late = ground.autopilot.pop("GF_ACTION")
    assert ground.run(5.0) == []
    assert ground.state is MissionState.WAITING
    assert ground.step(ParameterRead(t=ground.t, name="GF_ACTION", value=late)) == [Order.ENGAGE]
    assert ground.readings == 1


def test_a_restarted_autopilot_is_asked_again() -> None:
    ground = Ground()
    ground.run(0.5)
    ground.autopilot["COM_RC_OVERRIDE"] = 0.0
    ground.step(AutopilotRestarted(t=ground.t))
    assert ground.run(2.0) == []
    assert ground.readings == 2
    assert "COM_RC_OVERRIDE is 0" in ground.reason


# With an operator


def operated(**parameters: float) -> Ground:
    ground = Ground(auto=False, **parameters)
    ground.muted = True
    assert ground.run(0.2) == []
    assert ground.state is MissionState.STANDBY
    return ground


def order(ground: Ground, *orders: OperatorOrder) -> list[Order]:
    ground.operator = orders
    try:
        return ground.step()
    finally:
        ground.operator = ()


def begun(**parameters: float) -> Ground:
    ground = operated(**parameters)
    assert order(ground, OperatorOrder.ENGAGE) == [Order.ENGAGE]
    ground.muted = False
    ground.vehicle["mode"] = FlightMode.OFFBOARD
    assert ground.step() == [Order.ARM]
    ground.vehicle["armed"] = True
    return ground


@pytest.mark.parametrize("armed", [False, True])
def test_it_waits_for_the_operator_however_long(armed: bool) -> None:
    ground = Ground(auto=False)
    ground.muted = True
    ground.vehicle["armed"] = armed  # a program that was restarted in flight observes
    assert ground.run(120.0) == []
    assert ground.state is MissionState.STANDBY
    assert "waiting for the operator" in ground.reason
    assert order(ground, OperatorOrder.ENGAGE) == [Order.ENGAGE]
    assert ground.state is MissionState.RUNNING


def test_no_vehicle_ends_it_all_the_same() -> None:
    ground = Ground(auto=False, vehicle_timeout_s=2.0)
    ground.vehicle["connected"] = False
    ground.run(2.2)
    assert ground.state is MissionState.NO_VEHICLE


def test_a_vehicle_that_goes_away_while_it_waits_is_waited_for() -> None:
    ground = operated(vehicle_timeout_s=4.0)
    ground.vehicle["connected"] = False
    ground.run(3.0)
    assert ground.state is MissionState.WAITING
    ground.vehicle["connected"] = True
    ground.run(0.1)
    assert ground.state is MissionState.STANDBY
    ground.vehicle["connected"] = False
    ground.run(4.2)
    assert ground.state is MissionState.NO_VEHICLE


def test_after_a_takeover_it_waits_and_the_operator_engages_again() -> None:
    ground = begun()
    ground.step(switched=(Mode.TAKEOFF, "armed"))
    ground.muted = ground.taken_over = True
    ground.vehicle["mode"] = FlightMode.POSCTL
    assert ground.step() == [Order.FINISH]
    assert ground.state is MissionState.STANDBY
    assert "not ours any more" in ground.reason
    ground.mode = Mode.ABORT  # what the guidance made of it
    assert ground.run(60.0) == []
    assert order(ground, OperatorOrder.ENGAGE) == [Order.ENGAGE]
    ground.mode = Mode.PREFLIGHT  # which begins anew
    ground.taken_over = ground.muted = False
    ground.vehicle["mode"] = FlightMode.OFFBOARD
    assert ground.run(1.0) == []
    assert ground.state is MissionState.RUNNING


def test_an_engagement_that_does_not_come_about_is_given_up_with_its_reason() -> None:
    ground = operated()
    assert order(ground, OperatorOrder.ENGAGE) == [Order.ENGAGE]
    orders = [each for _, each in ground.run(4.0)]
    assert orders[-1] is Order.FINISH
    assert 3 <= orders.count(Order.ENGAGE) <= 6
    assert ground.state is MissionState.STANDBY
    assert ground.reason == "asked for it as often as allowed"


@pytest.mark.parametrize(
    ("wish", "words"), [(OperatorOrder.HOLD, "asked for Hold"), (OperatorOrder.LAND, "autopilot's Land")]
)
def test_hold_and_land_make_it_wait(wish: OperatorOrder, words: str) -> None:
    ground = begun()
    assert order(ground, wish) == [Order.FINISH]
    assert ground.state is MissionState.STANDBY
    assert words in ground.reason
    assert order(ground, wish) == []
    assert order(ground, OperatorOrder.ENGAGE) == [Order.ENGAGE]


@pytest.mark.parametrize("waiting", [False, True])
def test_abort_ends_it(waiting: bool) -> None:
    ground = operated() if waiting else begun()
    assert order(ground, OperatorOrder.ABORT) == ([] if waiting else [Order.FINISH])
    assert ground.state is MissionState.ABORTED


def test_a_refusal_to_arm_makes_it_wait_and_is_forgotten_when_the_operator_engages_again() -> None:
    ground = operated(arm_tries=1)
    order(ground, OperatorOrder.ENGAGE)
    ground.muted = False
    ground.vehicle["mode"] = FlightMode.OFFBOARD
    assert ground.step() == [Order.ARM]
    assert ground.step(refusal(ground.t, "no GPS")) == [Order.FINISH]
    assert ground.state is MissionState.STANDBY
    assert "no GPS" in ground.reason
    ground.muted = True
    ground.vehicle["mode"] = FlightMode.AUTO_LOITER
    ground.run(1.0)
    order(ground, OperatorOrder.ENGAGE)
    ground.muted = False
    ground.vehicle["mode"] = FlightMode.OFFBOARD
    assert ground.step() == [Order.ARM]
    ground.step(refusal(ground.t, "no compass"))
    assert "no GPS" not in ground.reason


def test_a_vehicle_lost_in_flight_ends_it() -> None:
    ground = begun()
    ground.vehicle["connected"] = False
    assert ground.step() == [Order.FINISH]
    assert ground.state is MissionState.LOST


def test_with_an_operator_unsafe_parameters_are_named_and_read_again_until_they_will_do() -> None:
    ground = Ground(auto=False)
    ground.muted = True
    ground.autopilot["COM_RC_OVERRIDE"] = 1.0
    assert ground.run(12.0) == []
    assert ground.state is MissionState.WAITING
    assert "COM_RC_OVERRIDE is 1" in ground.reason
    assert order(ground, OperatorOrder.ENGAGE) == []
    assert ground.readings >= 3
    ground.autopilot["COM_RC_OVERRIDE"] = SAFE["COM_RC_OVERRIDE"]
    ground.run(6.0)
    assert ground.state is MissionState.STANDBY


def test_with_an_operator_nothing_is_engaged_before_every_parameter_is_known() -> None:
    ground = Ground(auto=False)
    ground.muted = True
    late = ground.autopilot.pop("GF_ACTION")
    ground.run(5.0)
    assert ground.state is MissionState.WAITING
    assert "reading" in ground.reason
    ground.step(ParameterRead(t=ground.t, name="GF_ACTION", value=late))
    assert ground.state is MissionState.STANDBY


@pytest.mark.parametrize("auto", [True, False])
def test_what_the_mission_needs_keeps_it_on_the_ground_until_it_is_there(auto: bool) -> None:
    ground = Ground(auto=auto)
    ground.missing = "no ranges come"
    ground.operator = (OperatorOrder.ENGAGE,)
    for _ in range(200):
        assert Order.ENGAGE not in ground.step()
    if not auto:
        assert ground.conductor.status.reason == "no ranges come"
    ground.missing = ""
    assert any(Order.ENGAGE in ground.step() for _ in range(200))


def test_the_end_of_patience_names_what_is_missing() -> None:
    ground = Ground(ready_timeout_s=2.0)
    ground.missing = "no ranges come"
    for _ in range(150):
        ground.step()
    assert ground.conductor.status.state is MissionState.REFUSED
    assert "no ranges come" in ground.conductor.status.reason
