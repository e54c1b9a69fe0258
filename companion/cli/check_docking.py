"""What `companion check` says of a docking mission."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from companion.config.docking import Docking, load_docking
from companion.config.load import fingerprint
from companion.mission.docking import Dock, PolicyName
from companion.ranging.survey import geometry_remarks
from companion.runtime.docking.wiring import build_docking, known_start


def load(mission: str, *, config: str | None, overrides: Iterable[str]) -> Docking:
    """Read a docking mission and every file that it names, and put it together once.

    Raises:
        InputError: with every problem of every file.
    """
    docking = load_docking(mission, config_path=config, overrides=overrides, wrong_with_world=wrong_with_docking_world)
    build_docking(docking, known_start(docking), None)
    return docking


def wrong_with_docking_world(world: str) -> str | None:
    """Say what the simulator finds wrong with a docking world; None where nothing, or where none is installed."""
    try:
        from companion.campaign import docking
    except ImportError:
        return None
    return docking.wrong_with_docking_world(world)


def as_json(docking: Docking) -> dict[str, object]:
    """Give the summary as plain values."""
    mission = docking.mission
    return {
        "ok": True,
        "problems": [],
        "mission": mission.name,
        "steps": [describe_step(mission.step)],
        "config": docking.config_source,
        "config_sha256": fingerprint(docking.config),
        "port": str(mission.port),
        "anchors": str(docking.config.anchors),
        "remarks": remarks(docking),
        "policy": mission.step.policy.value,
        "world": mission.world,
    }


def summary(docking: Docking) -> str:
    """Say in a few lines what will be flown, and with what."""
    mission, config, port = docking.mission, docking.config, docking.port
    start, motion = config.start, config.guidance.motion
    known = known_start(docking)
    away = float(np.linalg.norm(known.position - port.docked_position))
    turn = math.degrees(2.0 * math.acos(min(1.0, abs(float(known.quaternion @ port.quaternion)))))
    lines = [
        ("mission", f"{mission.source}: {mission.name}"),
        ("steps", describe_step(mission.step)),
        (
            "port",
            f"{mission.port}: {port.name}, docked at {_place(port.docked_position)} m, {len(port.markers)} markers",
        ),
        (
            "anchors",
            f"{config.anchors}: {len(docking.survey.anchors)} in the frame {docking.survey.frame.value}",
        ),
        *(("", remark) for remark in remarks(docking)),
        ("craft", f"{docking.config_source}: {config.name}"),
        (
            "start",
            f"{_place(known.position)} m, known to {start.position_std_m:g} m; {away:.2f} m and {turn:.0f} deg to go",
        ),
        (
            "limits",
            f"approach {motion.approach_speed:g} m/s, closing {motion.dock_speed:g} m/s; {motion.acceleration:g} m/s^2,"
            f" {motion.turn_rate:g} rad/s",
        ),
        ("world", f"{mission.world} (only for companion sim)"),
    ]
    return "\n".join([*(f"{name:<9}{text}" for name, text in lines), "all in order"])


def remarks(docking: Docking) -> list[str]:
    """Say what the anchors' places do not tell."""
    return list(geometry_remarks(docking.survey))


def describe_step(step: Dock) -> str:
    """Say in a few words what the step does."""
    decided = {
        PolicyName.FIXED: f"at {step.reorient_range_m:g} and {step.align_range_m:g} m",
        PolicyName.MARKOV: "by the Markov model",
        PolicyName.OPTIMAL: f"by the decision table, careful {step.careful:g}",
    }[step.policy]
    attempts = f"{step.max_attempts} attempt{'' if step.max_attempts == 1 else 's'}"
    return f"dock, switching {decided}; {attempts} and {step.timeout_s:g} s at most"


def _place(place: Iterable[float]) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in place) + ")"
