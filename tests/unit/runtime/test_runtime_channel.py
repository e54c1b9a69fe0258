"""The socket between the processes: never blocks, never believes, tells when the other side is gone."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest
from runtime_helm_bench import Rig

from companion.guardian.handover import Handover, Order, Stage
from companion.guardian.handover_frame import encode
from companion.messages.operator import OperatorOrder
from companion.runtime.channel import GuardianPort, PlannerPort, pair


@pytest.fixture
def ports():
    ours, theirs = pair()
    guardian, planner = PlannerPort(ours), GuardianPort(theirs)
    yield guardian, planner
    guardian.close()
    planner.close()


def word(t: float = 1.0, *orders: Order) -> Handover:
    return Handover(t=t, stage=Stage.RUNNING, reason="", orders=frozenset(orders))


def test_of_many_the_newest_counts_and_no_order_is_lost(ports) -> None:
    guardian, planner = ports
    assert guardian.receive() is None
    for k, orders in enumerate([(Order.ARM,), (), (Order.ENGAGE,), ()]):
        planner.send(word(float(k), *orders))
    found = guardian.receive()
    assert found.t == 3.0
    assert found.orders == {Order.ARM, Order.ENGAGE}
    assert guardian.receive() is None


def test_garbage_and_repetitions_are_dropped_and_counted(ports) -> None:
    guardian, planner = ports
    end = planner._socket
    frame = encode(word(5.0, Order.ARM), 5)
    end.send(frame)
    assert guardian.receive().t == 5.0
    dice = np.random.default_rng(1)
    for junk in (frame, encode(word(9.0), 4), b"x", frame[:-1], dice.bytes(5000), dice.bytes(40000)):
        end.send(junk)
    assert guardian.receive() is None
    assert guardian.unsound == 6
    end.send(encode(word(6.0), 6))
    assert guardian.receive().t == 6.0


def test_a_flood_neither_blocks_nor_holds_up(ports) -> None:
    guardian, planner = ports
    for _ in range(100_000):
        planner.send(word())
        if planner.unsent > 10:
            break
    assert planner.unsent > 10  # the sender met a full queue and went on
    began = time.thread_time()
    assert guardian.receive() is not None
    assert time.thread_time() - began < 0.1  # of CPU: 512 messages at most


def test_telemetry_that_waits_is_joined(ports) -> None:
    guardian, planner = ports
    rig = Rig()
    rig.run(0.2)
    told = []
    for _ in range(3):
        rig.tick()
        told.append(rig.telemetry)
        told[-1].orders = [OperatorOrder.HOLD]
        guardian.send(told[-1])
    found = planner.receive()
    assert found.t == told[-1].t
    assert [s.t for s in found.states] == [s.t for telemetry in told for s in telemetry.states]
    assert len(found.datagrams) == sum(len(telemetry.datagrams) for telemetry in told)
    assert found.orders == (OperatorOrder.HOLD,) * 3
    assert found.vehicle == told[-1].vehicle
    assert planner.receive() is None


def test_telemetry_for_a_planner_that_is_stopped_is_dropped(ports) -> None:
    guardian, planner = ports
    rig = Rig()
    for _ in range(2000):
        rig.tick()
        guardian.send(rig.telemetry)
        if guardian.unsent > 3:
            break
    assert guardian.unsent > 3
    assert planner.receive() is not None
    assert not guardian.closed


def test_too_much_telemetry_goes_without_the_raw_datagrams(ports) -> None:
    guardian, planner = ports
    rig = Rig()
    rig.tick()
    rig.telemetry.datagrams = [(0.0, os.urandom(1000))] * 1 + [(0.0, os.urandom(1000)) for _ in range(600)]
    guardian.send(rig.telemetry)
    found = planner.receive()
    assert found.vehicle == rig.telemetry.vehicle
    assert found.datagrams == ()


def test_telemetry_that_cannot_be_read_is_counted(ports) -> None:
    guardian, planner = ports
    guardian._socket.send(b"\x80\x05 nonsense")
    assert planner.receive() is None
    assert planner.unsound == 1


def test_the_end_of_the_other_side_is_seen(ports) -> None:
    guardian, planner = ports
    planner.send(word())
    planner.close()
    assert guardian.receive() is not None
    assert guardian.receive() is None
    assert guardian.closed
    rig = Rig()
    rig.tick()
    guardian.send(rig.telemetry)  # nothing happens


@pytest.mark.parametrize("first", ["planner", "guardian"])
def test_sending_to_a_side_that_is_gone_is_no_error(ports, first) -> None:
    guardian, planner = ports
    rig = Rig()
    rig.tick()
    if first == "planner":
        planner.close()
        guardian.send(rig.telemetry)
        assert guardian.closed
    else:
        guardian.close()
        planner.send(word())
        assert planner.closed
