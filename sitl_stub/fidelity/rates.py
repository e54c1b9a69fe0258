"""Rows of what the autopilot sends by itself: messages and their rates, parameters."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.fidelity.open_air import OpenAir
from sitl_stub.fidelity.row import Row
from sitl_stub.simulation import Simulation
from sitl_stub.vehicle.config import VehicleConfig
from sitl_stub.vehicle.mavlink_io import Port

RATES_FILE, PARAMETERS_FILE = "q18_message_rates.json", "q18_parameters.json"
LINKS: tuple[tuple[Port, str], ...] = (
    ("onboard", "onboard link, UDP 14540"),
    ("ground", "ground station link, UDP 14550"),
)
SETTLE, DURATION = 0.5, 20.0
SHARE = 0.10


def message_rates(folder: Path, vehicle: VehicleConfig) -> Iterator[Row]:
    """Disarmed on the ground for 20 s, both partners with heartbeats: each message that PX4 sends, and nothing else."""
    recorded = json.loads((folder / RATES_FILE).read_text(encoding="utf-8"))
    simulation = Simulation(OpenAir(), vehicle, seed=1)
    for port, _ in LINKS:
        simulation.transmit(port)  # opens the telemetry
    simulation.advance(SETTLE)
    for port, _ in LINKS:
        simulation.transmit(port)
    beat = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    counts: dict[Port, Counter[int]] = {port: Counter() for port, _ in LINKS}
    for second in range(int(DURATION)):
        simulation.receive("ground", bytes(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(beat)))
        simulation.advance(SETTLE + second + 1.0)
        for port, _ in LINKS:
            counts[port].update(frame[7] | frame[8] << 8 | frame[9] << 16 for frame in simulation.transmit(port))
    for port, title in LINKS:
        yield from _link(port, next(v for k, v in recorded.items() if k.startswith(title[:12])), counts[port])


def _link(port: Port, recorded: Mapping[str, Any], counts: Counter[int]) -> Iterator[Row]:
    rates = {name: (int(entry["id"]), float(entry["rate_hz"])) for name, entry in recorded.items()}
    sent = {name: counts[number] / DURATION for name, (number, _) in rates.items() if counts[number]}
    wrong = {
        name: rate
        for name, rate in sent.items()
        if abs(rate - rates[name][1]) > max(SHARE * rates[name][1], 0.5 / DURATION)
    }
    worst = ", ".join(f"{name} {rate:.3g} Hz, not {rates[name][1]:.3g}" for name, rate in wrong.items())
    yield Row(
        name=f"q18: rates of the messages sent, {port} link",
        stub=worst or f"{len(sent)} messages as PX4",
        px4=f"{len(rates)} messages",
        tolerance="10 %",
        passed=not wrong,
    )
    missing = sorted(set(rates) - set(sent))
    yield Row(
        name=f"q18: messages sent, {port} link",
        stub=f"without {', '.join(missing)}" if missing else "all",
        px4=f"{len(rates)} messages",
        tolerance="all",
        passed=not missing,
    )


def parameters(folder: Path, vehicle: VehicleConfig) -> Iterator[Row]:
    """Names and default values of all parameters."""
    listed: Mapping[str, Any] = json.loads((folder / PARAMETERS_FILE).read_text(encoding="utf-8"))["parameters"]
    mine = Simulation(OpenAir(), vehicle, seed=1).autopilot.parameters
    values = {name: entry["value"] if isinstance(entry, Mapping) else entry for name, entry in listed.items()}
    missing = [name for name in values if name not in mine and not name.startswith("_")]
    other = [
        name
        for name, value in values.items()
        if name in mine and abs(float(mine[name]) - float(value)) > 1e-5 * max(1.0, abs(float(value)))
    ]
    words = [f"{len(missing)} missing ({', '.join(missing[:3])} ...)"] if missing else []
    words += [f"{len(other)} with another value ({', '.join(other[:4])})"] if other else []
    yield Row(
        name="q18: parameters",
        stub="; ".join(words) or "all",
        px4=f"{len(values)}",
        tolerance="same names, same values",
        passed=not words,
    )
