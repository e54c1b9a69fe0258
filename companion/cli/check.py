"""`companion check`: is everything in order with a mission and the files that it names?"""

from __future__ import annotations

import argparse
import json

from companion.cli import check_docking
from companion.cli.check_world import describe_world
from companion.cli.overrides import add_overrides
from companion.config import Config, Flight, dump, fingerprint, load_flight
from companion.config.docking_tree import DockingConfig
from companion.config.sections import VehicleSection, VehicleType
from companion.guidance.plan import FollowPlan
from companion.mission import Follow, FollowUntil, Hold, Intercept, Land, Mission, Search, Step, Takeoff, Transit
from companion.mission.docking import names_docking
from companion.ranging.survey import geometry_remarks

Checked = tuple[Config | DockingConfig, dict[str, object], str]  # effective configuration, plain values, summary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion check`."""
    parser.add_argument("mission", metavar="MISSION.yaml", help="the mission file")
    parser.add_argument("--config", metavar="FILE", help="a configuration instead of the one that the mission names")
    add_overrides(parser)
    parser.add_argument("--dump", action="store_true", help="print the effective configuration, all defaults included")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead")


def run(args: argparse.Namespace) -> int:
    """Check and report; 0 where all is in order, else 2."""
    config, whole, summary = _check_docking(args) if names_docking(args.mission) else _check_flight(args)
    if args.json:
        print(json.dumps(whole))
    elif args.dump:
        print(dump(config), end="")
    else:
        print(summary)
    return 0


def _check_flight(args: argparse.Namespace) -> Checked:
    flight = load_flight(
        args.mission, config_path=args.config, overrides=args.overrides, wrong_with_world=wrong_with_world
    )
    return flight.config, _as_json(flight), _summary(flight)


def _check_docking(args: argparse.Namespace) -> Checked:
    docking = check_docking.load(args.mission, config=args.config, overrides=args.overrides)
    return docking.config, check_docking.as_json(docking), check_docking.summary(docking)


def wrong_with_world(world: str) -> str | None:
    """Say what the simulator finds wrong with a world; None where nothing, or where no simulator is installed."""
    try:
        from sitl_stub.world.documents import WorldFileError
        from sitl_stub.world.world import World
    except ImportError:
        return None
    try:
        World.load(world)
    except WorldFileError as error:
        return str(error)
    return None


def _as_json(flight: Flight) -> dict[str, object]:
    mission = flight.mission
    return {
        "ok": True,
        "problems": [],
        "mission": mission.name,
        "steps": describe_steps(mission),
        "config": str(flight.config_source),
        "config_sha256": fingerprint(flight.config),
        "pad": str(mission.pad),
        "calibration": str(flight.config.camera.calibration),
        "world": mission.world,
    }


def _summary(flight: Flight) -> str:
    mission, config = flight.mission, flight.config
    lost, fence = mission.on_target_lost, config.guardian.fence
    rows = [
        ("mission", f"{mission.source}: {mission.name}"),
        ("steps", ", then ".join(describe_steps(mission))),
        ("target", str(mission.pad)),
        ("vehicle", f"{flight.config_source}: {config.name} ({config.vehicle.type.value})"),
        ("limits", f"{_limits(config.vehicle)}; fence {fence.radius:g} m around, up to {fence.height_max:g} m"),
        (
            "unseen",
            f"{_coasting(config.vehicle)} for {lost.coast_s:g} s, hold for {lost.hold_s:g} s,"
            f" search for {lost.search_s:g} s, then {lost.then.value}",
        ),
        ("link", config.link.url),
        ("camera", f"{config.camera.source}, calibration {config.camera.calibration}"),
        *_ranges(flight),
        ("world", describe_world(flight)),
    ]
    lines = [f"{name:<9}{text}" for name, text in rows]
    return "\n".join([*lines, "all in order"])


def _ranges(flight: Flight) -> list[tuple[str, str]]:
    """Say where ranges come from, and what their anchors leave in doubt; nothing where there are none."""
    if flight.anchors is None:
        return []
    remarks = geometry_remarks(flight.anchors)
    return [("ranges", "; ".join([f"{flight.config.ranging.input}, {flight.anchors.name}", *remarks]))]


def describe_steps(mission: Mission) -> list[str]:
    """Say in a few words what each step does."""
    return [describe_step(step, on_ground=mission.on_ground) for step in mission.steps]


def describe_step(step: Step, *, on_ground: bool = False) -> str:
    """Say in a few words what a step does."""
    match step:
        case Search() if on_ground:
            return f"look for it for {step.timeout_s:g} s at most"
        case Takeoff():
            return f"take off to {step.height_m:g} m"
        case Transit():
            return f"fly to where the pad was surveyed, by {step.by.value}, at {step.height_m:g} m or higher"
        case Search():
            return f"search within {step.radius_m:g} m at {step.height_m:g} m for {step.timeout_s:g} s at most"
        case Intercept():
            return f"go to {step.standoff_m:g} m behind the target and stop there with it"
        case Follow():
            return _describe_follow(step)
        case Land():
            return f"land, {step.max_attempts} attempt{'' if step.max_attempts == 1 else 's'} at most"
        case Hold():
            return f"hold for {step.for_s:g} s"


def _describe_follow(step: Follow) -> str:
    if step.standoff_m is not None:
        where = f"{step.standoff_m:g} m behind it"
    else:
        where = f"at {FollowPlan().height_m if step.height_m is None else step.height_m:g} m"
    if step.ends is FollowUntil.TIME:
        return f"follow {where} for {step.for_s:g} s"
    least = f", for {step.for_s:g} s at least" if step.for_s > 0.0 else ""
    return f"follow {where} until it stops{least}"


def _coasting(vehicle: VehicleSection) -> str:
    """Say what it does at first when the target is out of sight."""
    if vehicle.type is VehicleType.ROVER:
        return "drive on, or back out from a near target,"
    return "fly on"


def _limits(vehicle: VehicleSection) -> str:
    """Say how fast the vehicle may be."""
    if vehicle.type is VehicleType.ROVER:
        r = vehicle.rover
        return (
            f"{r.speed_forward:g} m/s, backwards {r.speed_reverse:g}, towards the target {r.closing_speed:g} within"
            f" {r.closing_within:g} m of it, more farther away; {r.acceleration:g} m/s^2"
        )
    if vehicle.type is VehicleType.FREE_FLYER:
        f = vehicle.free_flyer
        return f"{f.speed:g} m/s, towards the target {f.closing_speed:g}; {f.acceleration:g} m/s^2"
    m = vehicle.multicopter
    return (
        f"{m.speed_horizontal:g} m/s, up {m.speed_up:g}, down {m.speed_down:g}, towards the target"
        f" {m.closing_speed:g}; {m.acceleration_horizontal:g} m/s^2"
    )
