"""PX4's precision landing state machine (navigator/precland.cpp), without a vehicle."""

import itertools
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.vehicle.forwarding import Forwarder
from sitl_stub.vehicle.precision_landing import LandingTargetPose, PrecisionLanding, State

PARAMETERS = {
    "PLD_BTOUT": 5.0,
    "PLD_FAPPR_ALT": 0.1,
    "PLD_HACC_RAD": 0.2,
    "PLD_MAX_SRCH": 3,
    "PLD_SRCH_ALT": 10.0,
    "PLD_SRCH_TOUT": 10.0,
    "NAV_ACC_RAD": 2.0,
    "MPC_ACC_HOR": 3.0,
    "MPC_XY_CRUISE": 5.0,
}


class Bench:
    """A vehicle that is put where the test wants it; the target is seen at 20 Hz while `seen`."""

    def __init__(self, **parameters: float) -> None:
        self.landing = PrecisionLanding(PARAMETERS | parameters)
        self.at: Any = SimpleNamespace(north=0.0, east=0.0, down=-3.0, v_north=0.0, v_east=0.0)
        self.t = 100.0
        self.seen = True
        self.stamp = 0.0  # [s] added to the target's stamps
        self.target = (0.5, 0.0, 0.0)
        self.landing.begin(self.t, self.at)

    def run(self, seconds: float, *, landed: bool = False) -> State:
        for _ in range(round(seconds / 0.05)):
            self.t += 0.05
            if self.seen:
                north, east, down = self.target
                pose = LandingTargetPose(t=self.t + self.stamp, north=north, east=east, down=down)
                self.landing.target_seen(pose)
            self.waypoint = self.landing.waypoint(self.t, self.at, landed=landed)
        return self.landing.state


def test_it_descends_only_after_two_seconds_above_the_target() -> None:
    bench = Bench()
    assert bench.run(5.0) is State.HORIZONTAL_APPROACH  # 0.5 m aside
    assert (bench.waypoint.down, bench.waypoint.land) == (-3.0, False)
    assert bench.waypoint.north == pytest.approx(0.5, abs=0.05)
    bench.at.north = 0.35
    assert bench.run(1.9) is State.HORIZONTAL_APPROACH
    assert bench.run(0.3) is State.DESCEND_ABOVE_TARGET
    bench.run(0.1)
    assert (bench.waypoint.north, bench.waypoint.land) == (0.5, True)


def test_the_setpoint_towards_the_target_keeps_its_limits() -> None:
    bench = Bench()
    bench.target = (20.0, 0.0, 0.0)
    places = []
    for _ in range(60):
        bench.run(0.05)
        places.append(bench.waypoint.north)
    speeds = [(b - a) / 0.05 for a, b in itertools.pairwise(places)]
    assert max(speeds) <= 5.0 + 1e-6
    assert max((b - a) / 0.05 for a, b in itertools.pairwise(speeds)) <= 3.0 + 1e-6


def test_a_target_lost_on_the_way_is_flown_to_and_lost_above_it_is_searched() -> None:
    bench = Bench()
    bench.run(0.5)
    bench.seen = False
    assert bench.run(8.0) is State.HORIZONTAL_APPROACH
    bench.at.north = 0.5
    assert bench.run(0.1) is State.START
    assert bench.run(2.2) is State.SEARCH
    assert bench.waypoint.down == -10.0


def test_a_search_that_sees_the_target_stops_climbing_and_approaches() -> None:
    bench = Bench()
    bench.seen = False
    assert bench.run(2.3) is State.SEARCH
    bench.at.down = -6.0
    bench.seen = True
    bench.run(0.1)
    assert bench.waypoint.down == -7.0
    assert bench.run(1.2) is State.HORIZONTAL_APPROACH


def test_a_search_in_vain_lands_where_it_is() -> None:
    bench = Bench()
    bench.seen = False
    assert bench.run(13.0) is State.FALLBACK
    assert bench.waypoint.land


def test_searches_are_counted() -> None:
    bench = Bench(PLD_MAX_SRCH=0)
    bench.at.north = 0.5
    bench.run(3.0)
    bench.seen = False
    assert bench.run(5.5) is State.FALLBACK


@pytest.mark.parametrize(("near_ground", "state"), [(0.5, State.FINAL_APPROACH), (0.1, State.DESCEND_ABOVE_TARGET)])
def test_near_the_ground_a_lost_target_does_not_break_the_landing_off(near_ground: float, state: State) -> None:
    """With the default of 0.1 m a body that stands 0.2 m above the pad is never near: it climbs again later."""
    bench = Bench(PLD_FAPPR_ALT=near_ground)
    bench.at.north = 0.5
    bench.run(3.0)
    bench.at.down = -0.2
    bench.run(0.2)
    bench.seen = False
    assert bench.run(0.8) is state
    assert bench.run(5.0) is (State.FINAL_APPROACH if near_ground > 0.2 else State.START)


def test_a_stamp_from_the_future_counts_as_lost() -> None:
    bench = Bench()
    bench.stamp = 1.0
    assert bench.run(2.3) is State.SEARCH


def test_landed_is_the_end() -> None:
    bench = Bench()
    bench.run(1.0)
    assert bench.run(0.1, landed=True) is State.DONE


class Board:
    """Two links joined by a forwarder."""

    def __init__(self, **parameters: float) -> None:
        self.forwarder = Forwarder({"MAV_HB_FORW_EN": 1.0} | parameters)
        self.out: dict[str, list[bytes]] = {"onboard": [], "ground": []}
        for port, frames in self.out.items():
            self.forwarder.add(port, frames.append)

    def hear(self, port: str, message: Any, system: int, component: int) -> None:
        frame = bytes(message.pack(mavlink.MAVLink(None, srcSystem=system, srcComponent=component)))
        self.forwarder.heard(port, mavlink.MAVLink(None).decode(bytearray(frame)), frame)


GCS = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
TEXT = mavlink.MAVLink_statustext_message(6, b"hello")


def test_a_text_is_forwarded_once_somebody_listens_there() -> None:
    board = Board()
    board.hear("onboard", TEXT, 1, 191)
    assert board.out["ground"] == []
    board.hear("ground", GCS, 255, 190)
    board.hear("onboard", TEXT, 1, 191)
    assert len(board.out["ground"]) == 1
    assert len(board.out["onboard"]) == 1  # the ground station's heartbeat


def test_what_is_for_the_autopilot_stays() -> None:
    board = Board()
    board.hear("ground", GCS, 255, 190)
    board.hear("onboard", mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 6, 0, 0, 0, 0, 0), 1, 191)
    board.hear("onboard", mavlink.MAVLink_command_long_message(255, 190, 176, 0, 1, 6, 0, 0, 0, 0, 0), 1, 191)
    assert len(board.out["ground"]) == 1


def test_heartbeats_may_be_kept_back() -> None:
    board = Board(MAV_HB_FORW_EN=0.0)
    board.hear("onboard", TEXT, 1, 191)
    board.hear("ground", GCS, 255, 190)
    assert board.out["onboard"] == []


def test_after_a_restart_nobody_is_known() -> None:
    board = Board()
    board.hear("ground", GCS, 255, 190)
    board.forwarder.forget("ground")
    board.hear("onboard", TEXT, 1, 191)
    assert board.out["ground"] == []
