from __future__ import annotations

import numpy as np
import pytest

from companion.link.timesync import TimesyncClient, TimesyncParameters


def exchange(client: TimesyncClient, t: float, boot, *, out=0.001, back=0.001) -> None:
    """One exchange that starts at `t`; `boot` gives boot time of companion time."""
    stamp = client.request(t)
    assert stamp is not None
    client.answer(tc1=round(boot(t + out) * 1e9), ts1=stamp, t=t + out + back)


def test_arrival_before_the_first_exchange():
    assert TimesyncClient(TimesyncParameters()).map(5.0, 77.0) == 77.0


def test_exact_after_one_symmetric_exchange():
    client = TimesyncClient(TimesyncParameters())
    exchange(client, 100.0, lambda t: t - 40.0)
    assert client.map(70.0, 111.0) == pytest.approx(110.0, abs=1e-9)
    assert client.boot_time(110.0) == pytest.approx(70.0, abs=1e-9)


def test_never_later_than_the_arrival():
    client = TimesyncClient(TimesyncParameters())
    exchange(client, 100.0, lambda t: t - 40.0)
    assert client.map(70.0, 109.0) == 109.0


def test_requests_at_the_rate():
    client = TimesyncClient(TimesyncParameters(rate=10.0))
    count = sum(client.request(0.02 * k) is not None for k in range(500))
    assert count == pytest.approx(100, abs=2)


def test_slow_exchanges_hardly_count():
    rng = np.random.default_rng(1)
    client = TimesyncClient(TimesyncParameters())
    errors = []
    for k in range(200):
        slow = float(rng.random() < 0.5) * float(rng.exponential(0.02))  # a queue on the way back
        exchange(client, 0.1 * k + 1.0, lambda t: t - 0.7, out=0.001, back=0.001 + slow)
        errors.append(client.boot_time(0.1 * k) - (0.1 * k - 0.7))
    assert np.abs(errors[5:]).max() < 1e-3
    assert client.statistics().round_trip_least == pytest.approx(0.002, abs=1e-4)


@pytest.mark.parametrize("rate", [0.994, 1.0, 1.005])
def test_a_clock_that_runs_at_another_rate_leaves_no_bias(rate):
    rng = np.random.default_rng(2)
    client = TimesyncClient(TimesyncParameters())
    for k in range(100):
        jitter = float(rng.exponential(0.001))
        exchange(client, 0.1 * k + 1.0, lambda t: rate * t + 3.0, back=0.001 + jitter)
    for t in (0.1 * 99 + 1.05, 0.1 * 99 + 2.0):  # between two exchanges, and when they fail to come for a while
        assert client.map(rate * t + 3.0, t + 1.0) == pytest.approx(t, abs=1e-3)
        assert client.boot_time(t) == pytest.approx(rate * t + 3.0, abs=1e-3)


def test_a_restart_of_the_autopilot_is_followed_within_half_a_second():
    client = TimesyncClient(TimesyncParameters())
    for k in range(20):
        exchange(client, 0.1 * k + 1.0, lambda t: t - 0.5)
    for k in range(20, 25):
        exchange(client, 0.1 * k + 1.0, lambda t: t - 2.9)
    assert client.boot_time(10.0) == pytest.approx(7.1, abs=1e-3)
    assert client.statistics().restarts == 1


def test_a_single_wrong_answer_changes_nothing():
    client = TimesyncClient(TimesyncParameters())
    for k in range(20):
        exchange(client, 0.1 * k + 1.0, lambda t: t - 0.5)
    before = client.boot_time(3.0)
    exchange(client, 3.0, lambda t: t + 50.0)
    assert client.boot_time(3.0) == before


@pytest.mark.parametrize(("tc1", "ts1"), [(1, 12345), (0, 0), (-5, 1), (2**62, -(2**62))])
def test_answers_to_nothing_are_rejected(tc1, ts1):
    client = TimesyncClient(TimesyncParameters())
    client.request(1.0)
    client.answer(tc1=tc1, ts1=ts1, t=1.01)
    assert client.map(5.0, 9.0) == 9.0
    assert client.statistics().rejected == 1


def test_an_answer_counts_once():
    client = TimesyncClient(TimesyncParameters())
    stamp = client.request(1.0)
    client.answer(tc1=500_000_000, ts1=stamp, t=1.002)
    client.answer(tc1=900_000_000, ts1=stamp, t=1.002)
    assert client.statistics().samples == 1


def test_an_unequal_way_is_found_from_messages_that_would_arrive_before_they_were_sent():
    """In lockstep a request is heard at once and its answer a tick later: the exchange alone is off by half a tick."""
    client = TimesyncClient(TimesyncParameters())
    for k in range(30):
        exchange(client, 0.1 * k + 1.0, lambda t: t - 0.5, out=0.0, back=0.02)
        client.map(0.1 * k + 0.5, 0.1 * k + 1.0)  # this one arrives at the very instant of its stamp
    assert client.map(3.49, 4.0) == pytest.approx(3.99, abs=1e-6)
    assert client.boot_time(4.0) == pytest.approx(3.5, abs=1e-6)


def test_a_stamp_from_the_future_moves_the_mapping_by_half_a_round_trip_at_most():
    client = TimesyncClient(TimesyncParameters())
    exchange(client, 1.0, lambda t: t - 0.5)
    assert client.map(900.0, 1.1) == 1.1
    assert client.map(0.6, 1.2) == pytest.approx(1.1 - 0.001, abs=1e-6)
