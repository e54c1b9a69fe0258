"""Judge what was heard of the autopilot."""

from __future__ import annotations

import math

from companion.link import incoming
from companion.link.arming import TRANSMITTER, transmitter_heard, unhealthy_sensors
from companion.link.rates import NEEDED
from companion.preflight.autopilot_parameters import Rules, judge_parameters
from companion.preflight.finding import Finding, judged, not_checked
from companion.preflight.listening import VehicleReport
from companion.preflight.parameters import VehicleLimits

_NOT_NEEDED = "not needed, by preflight.vehicle.transmitter"
_EXCHANGES_LEAST = 10  # of TIMESYNC
# ESTIMATOR_STATUS_FLAGS that a flight needs, and those that must not be set. "Constant position" (128) is no trouble:
# PX4 sets it whenever the vehicle stands still (ekf_helper.cpp, get_ekf_soln_status).
_NEEDED_FLAGS = ((1, "attitude"), (2, "horizontal velocity"), (4, "vertical velocity"))
_POSITION_FLAGS = 8 | 16
_BAD_FLAGS = ((1024, "GPS glitch"), (2048, "accelerometer error"))


def judge_vehicle(report: VehicleReport, limits: VehicleLimits, rules: Rules) -> list[Finding]:
    """Judge everything that was heard of a vehicle that is there and is the right one."""
    return [
        _link(report, limits),
        *_signing(report),
        _round_trip(report, limits),
        _clock(report, limits),
        _rates(report),
        _version(report, limits),
        _state(report),
        _estimator(report),
        *_sensors(report, limits),
        _battery(report, limits),
        *judge_parameters(rules, report.parameters),
    ]


def _link(report: VehicleReport, limits: VehicleLimits) -> Finding:
    s = report.statistics
    share = s.lost / max(1, s.lost + s.frames)
    found = f"{s.frames} messages, {100 * share:.1f} % lost, {s.bad_bytes} bytes of noise"
    if s.foreign:
        names = ", ".join(f"{system}/{component}" for system, component in sorted(s.foreign_sources))
        found += f", {s.foreign} of others ({names})"
    if report.lost:
        found += f", heartbeat stopped {report.lost} times"
    fine = share <= limits.lost_most and not report.lost
    figures = {"messages": s.frames, "lost_share": share, "noise_bytes": s.bad_bytes, "foreign": s.foreign}
    return judged("link", fine, found, f"at most {100 * limits.lost_most:g} % lost, an unbroken heartbeat", figures)


def _signing(report: VehicleReport) -> list[Finding]:
    s = report.statistics.signing
    if s is None:
        return []
    found = f"{s.accepted} right, {s.unsigned} unsigned, {s.forged} by another key, {s.old} old"
    fine = s.accepted > 0 and s.forged == 0 and s.unsigned == 0
    figures = {"accepted": s.accepted, "unsigned": s.unsigned, "forged": s.forged, "old": s.old}
    return [judged("signatures", fine, found, "every message signed with the key of link.signing", figures)]


def _round_trip(report: VehicleReport, limits: VehicleLimits) -> Finding:
    s = report.statistics.timesync
    wanted = f"at most {1e3 * limits.round_trip_most_s:g} ms in the median of {_EXCHANGES_LEAST} exchanges or more"
    if s.round_trip_median is None or s.round_trip_most is None or s.round_trip_least is None:
        return judged("round trip", False, f"no answer to {s.requests} requests", wanted, {"requests": s.requests})
    found = (
        f"median {1e3 * s.round_trip_median:.1f} ms, least {1e3 * s.round_trip_least:.1f} ms, "
        f"most {1e3 * s.round_trip_most:.1f} ms, {s.samples} of {s.requests} answered"
    )
    fine = s.round_trip_median <= limits.round_trip_most_s and s.samples >= _EXCHANGES_LEAST
    figures = {
        "median_s": s.round_trip_median,
        "least_s": s.round_trip_least,
        "most_s": s.round_trip_most,
        "requests": s.requests,
        "answers": s.samples,
    }
    return judged("round trip", fine, found, wanted, figures)


def _clock(report: VehicleReport, limits: VehicleLimits) -> Finding:
    s = report.statistics.timesync
    wanted = f"rates within {100 * limits.clock_rate_most:g} %, no jump"
    if s.offset is None:
        return not_checked("autopilot's clock", "no exchange of time", wanted)
    found = f"runs {100 * s.slope:+.2f} % off, {s.restarts} jumps"
    fine = abs(s.slope) <= limits.clock_rate_most and s.restarts == 0
    return judged("autopilot's clock", fine, found, wanted, {"rate_difference": s.slope, "jumps": s.restarts})


def _rates(report: VehicleReport) -> Finding:
    measured = report.statistics.rates
    wanted = ", ".join(f"{incoming.NAMES[need.message_id]} {need.least:g}" for need in NEEDED) + " Hz or more"
    if not measured:
        return judged("message rates", False, "heard too short a time to tell", wanted)
    names = {incoming.NAMES[need.message_id]: need.least for need in NEEDED}
    short = [name for name, least in names.items() if measured.get(name, 0.0) < least]
    shown = short or list(names)
    found = ", ".join(f"{name} {measured.get(name, 0.0):.1f}" for name in shown) + " Hz"
    return judged("message rates", not short, found, wanted, {f"{n}_hz": r for n, r in measured.items()})


def _version(report: VehicleReport, limits: VehicleLimits) -> Finding:
    wanted = f"PX4 {limits.version_least[0]}.{limits.version_least[1]} or newer"
    if report.identified is None:
        return judged("autopilot", False, "does not say its version", wanted)
    fine = report.identified.numbers[:2] >= limits.version_least
    figures = {"version": report.identified.version}
    return judged("autopilot", fine, f"PX4 {report.identified.version}", wanted, figures)


def _state(report: VehicleReport) -> Finding:
    status = report.status
    found = f"{'armed' if status.armed else 'disarmed'}, {status.mode.value}, {status.system_status.name.lower()}"
    figures = {"armed": status.armed, "mode": status.mode.value, "system_status": status.system_status.name}
    return judged("state", not status.armed, found, "disarmed: a mission begins on the ground", figures)


def _estimator(report: VehicleReport) -> Finding:
    wanted = "attitude, velocity and position valid, every test ratio below 1, no reset"
    estimator = report.health.estimator
    if estimator is None:
        return judged("estimator", False, "the autopilot says nothing of it", wanted)
    troubles = [f"no {word}" for bit, word in _NEEDED_FLAGS if not estimator.flags & bit]
    if not estimator.flags & _POSITION_FLAGS:
        troubles.append("no horizontal position")
    troubles += [word for bit, word in _BAD_FLAGS if estimator.flags & bit]
    ratios = {
        "velocity": estimator.velocity_ratio,
        "horizontal position": estimator.horizontal_ratio,
        "height": estimator.vertical_ratio,
        "heading": estimator.heading_ratio,
    }
    troubles += [f"{word} test ratio {ratio:.2f}" for word, ratio in ratios.items() if not ratio < 1.0]
    if report.resets:
        troubles.append(f"{report.resets} resets")
    if not report.status.estimate_valid and not troubles:
        troubles.append("no usable odometry")
    worst = max((ratio for ratio in ratios.values() if math.isfinite(ratio)), default=0.0)
    found = ", ".join(troubles) or f"valid, worst test ratio {worst:.2f}"
    figures: dict[str, float | str | bool | None] = {
        f"{word.replace(' ', '_')}_test_ratio": ratio if math.isfinite(ratio) else None
        for word, ratio in ratios.items()
    }
    figures |= {"flags": estimator.flags, "resets": report.resets}
    return judged("estimator", not troubles, found, wanted, figures)


def _sensors(report: VehicleReport, limits: VehicleLimits) -> list[Finding]:
    wanted = "everything that is enabled healthy, the pre-arm checks passed"
    if report.health.sensors is None:
        return [judged("sensors", False, "the autopilot says nothing of them", wanted)]
    names = [name for name in unhealthy_sensors(report.health.sensors) if name != TRANSMITTER]
    found = f"unhealthy: {', '.join(names)}" if names else "healthy"
    heard = transmitter_heard(report.health.sensors)
    transmitter = judged(
        "transmitter",
        heard or not limits.transmitter,
        "heard" if heard else "not heard",
        "a pilot's transmitter, switched on" if limits.transmitter else _NOT_NEEDED,
    )
    return [judged("sensors", not names, found, wanted), transmitter]


def _battery(report: VehicleReport, limits: VehicleLimits) -> Finding:
    wanted = f"at least {100 * limits.battery_least:g} %"
    remaining = report.status.battery_remaining
    if remaining is None:
        return not_checked("battery", "the autopilot does not say", wanted)
    found = f"{100 * remaining:.0f} %"
    return judged("battery", remaining >= limits.battery_least, found, wanted, {"remaining": remaining})
