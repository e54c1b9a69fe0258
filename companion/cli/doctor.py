"""`companion doctor`: is everything ready to fly? It looks and reads; it never arms and never changes anything."""

from __future__ import annotations

import argparse
import asyncio
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
from rich.console import Console
from rich.table import Table

from companion.camera.opencv import OpenCvCamera, OpenCvCameraParameters
from companion.cli.doctor_ranging import listen_to_ranging
from companion.cli.main import NO_VEHICLE, NOT_ACHIEVED, SUCCESS
from companion.cli.no_hardware import refuse_docking
from companion.cli.outcome import print_json
from companion.cli.overrides import add_overrides
from companion.clock import Clock, ElapsedClock, unix_time
from companion.config import load_flight, load_vehicle
from companion.config.sections import CameraSection, EngagementSection, LinkSection, RecordingSection
from companion.config.vehicle import autopilot_rules, link_parameters
from companion.errors import CameraError, InputError
from companion.estimation.ownship import OwnshipHistory
from companion.link.autopilot_link import AutopilotLink
from companion.link.connect import open_transport
from companion.link.endpoints import parse_endpoint
from companion.link.transport import Transport
from companion.messages.perception import CameraFrame, PadObservation
from companion.perception.camera_model import CameraModel
from companion.perception.pad import Pad
from companion.perception.pad_detector import PadDetector, PerceptionParameters
from companion.preflight.autopilot_parameters import Rules
from companion.preflight.camera import CameraReport, judge_camera
from companion.preflight.computer import disk_free_gb, judge_computer, read_computer
from companion.preflight.finding import Finding, Verdict, judged, not_checked
from companion.preflight.listening import VehicleListener, VehicleReport
from companion.preflight.mount import TiltSample, judge_mount, measure_tilt
from companion.preflight.parameters import PreflightParameters
from companion.preflight.picture import PictureQuality, picture_quality
from companion.preflight.ranging import judge_ranging
from companion.preflight.vehicle import judge_vehicle
from companion.ranging.parameters import RangingParameters
from companion.runtime.pipeline import TICK_S
from companion.runtime.wiring import build_signing

_SECONDS_HELP = (
    "look at link, camera and ranges for so long, at the same time (default: preflight.vehicle.listen_s, which is 6; "
    "at least 5.5, since message rates are counted over two periods of 2.5 s)"
)
_LOOK_S = 0.004  # between looks for a new picture
_EXAMINE_S = 0.4  # between pictures that are examined
_COLOURS = {Verdict.FINE: "green", Verdict.NOT_FINE: "red", Verdict.NOT_CHECKED: "yellow"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What is looked at."""

    preflight: PreflightParameters
    rules: Rules  # what the autopilot's parameters must be
    link: LinkSection
    engagement: EngagementSection
    recording: RecordingSection
    camera: CameraSection | None  # None: no configuration says which
    model: CameraModel | None
    perception: PerceptionParameters
    pad: Pad | None
    ranging: RangingParameters = field(default_factory=RangingParameters)
    ranges_needed: bool = False  # the mission flies by them


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `companion doctor`."""
    parser.add_argument("--config", metavar="FILE", help="the vehicle's configuration; without it the link only")
    parser.add_argument("--mission", metavar="FILE", help="a mission: its configuration and its pad are used")
    parser.add_argument(
        "--connect", metavar="URL", help="link to the autopilot, instead of link.url: udp://…, tcp://…, serial://…"
    )
    parser.add_argument("--camera-source", metavar="SOURCE", help="instead of camera.source")
    parser.add_argument("--seconds", metavar="S", type=float, help=_SECONDS_HELP)
    add_overrides(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def run(args: argparse.Namespace) -> int:
    """Look and report; 0 all fine, 1 something is not, 3 no vehicle or the wrong one."""
    cv2.setNumThreads(1)
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    if args.mission is not None:
        refuse_docking(args.mission)
    subject = _subject(args)
    console = Console(stderr=args.json)
    seconds = subject.preflight.vehicle.listen_s
    console.print(f"looking for {seconds:g} s at {subject.link.url}; nothing is armed or changed", highlight=False)
    report, findings = asyncio.run(_examine(subject))
    _show(console, findings)
    found = report.heard and report.wrong is None
    fine = all(finding.verdict is not Verdict.NOT_FINE for finding in findings)
    code = NO_VEHICLE if not found else SUCCESS if fine else NOT_ACHIEVED
    if args.json:
        print_json(_as_json(findings, code))
    return code


def _subject(args: argparse.Namespace) -> Subject:
    """Read what is to be looked at.

    Raises:
        InputError: a file or an option is wrong.
    """
    overrides: list[str] = list(args.overrides)
    if args.mission is not None:
        flight = load_flight(args.mission, config_path=args.config, overrides=overrides)
        config, model, pad = flight.config, flight.camera, flight.pad
        needed = flight.plan.transit is not None and flight.plan.transit.by_ranges
    elif args.config is not None:
        (config, model), pad, needed = load_vehicle(args.config, overrides), None, False
    elif overrides:
        right = "name the configuration too: --config FILE"
        raise InputError.single(source="--set", wrong="there is nothing to be replaced", right=right)
    else:
        return _with_options(_bare_subject(), args)
    subject = Subject(
        preflight=config.preflight,
        rules=autopilot_rules(config),
        link=replace(config.link, mavlink=link_parameters(config)),
        engagement=config.engagement,
        recording=config.recording,
        camera=config.camera,
        model=model,
        perception=config.perception,
        pad=pad,
        ranging=config.ranging,
        ranges_needed=needed,
    )
    return _with_options(subject, args)


def _bare_subject() -> Subject:
    return Subject(
        preflight=PreflightParameters(),
        rules=PreflightParameters().autopilot.rules,
        link=LinkSection(),
        engagement=EngagementSection(),
        recording=RecordingSection(),
        camera=None,
        model=None,
        perception=PerceptionParameters(),
        pad=None,
    )


def _with_options(subject: Subject, args: argparse.Namespace) -> Subject:
    if args.connect is not None:
        subject = replace(subject, link=replace(subject.link, url=str(parse_endpoint(args.connect))))
    if args.camera_source is not None:
        if subject.camera is None:
            right = "name the configuration with its calibration too: --config FILE"
            raise InputError.single(source="--camera-source", wrong="a camera needs a calibration", right=right)
        subject = replace(subject, camera=replace(subject.camera, source=args.camera_source))
    if args.seconds is not None:
        if not 5.5 <= args.seconds <= 600.0:
            right = "message rates need at least 5.5, and more than 600 is not useful"
            raise InputError.single(source="--seconds", wrong=f"is {args.seconds:g}", right=right)
        vehicle = replace(subject.preflight.vehicle, listen_s=args.seconds)
        subject = replace(subject, preflight=replace(subject.preflight, vehicle=vehicle))
    return subject


# ---- looking


async def _examine(subject: Subject) -> tuple[VehicleReport, list[Finding]]:
    clock = ElapsedClock()
    link = AutopilotLink(subject.link.mavlink, build_signing(subject.link, clock.now(), unix_time()))
    limits = subject.preflight
    listener = VehicleListener(
        link,
        listen_s=limits.vehicle.listen_s,
        patience_s=subject.engagement.vehicle_timeout_s,
        parameters=subject.rules,
    )
    transport = await open_transport(subject.link.url, clock=clock, recognises=link.recognises, source="link.url")
    try:
        before = read_computer(clock)
        async with asyncio.TaskGroup() as tasks:
            listening = tasks.create_task(_listen(transport, listener, clock))
            looking = tasks.create_task(_look(subject, clock))
            ranging = tasks.create_task(
                listen_to_ranging(subject.ranging, clock, needed=subject.ranges_needed, seconds=limits.vehicle.listen_s)
            )
        report, seen = listening.result(), looking.result()
    finally:
        await transport.close()
    after = read_computer(clock)
    findings = _vehicle_findings(report, subject)
    findings += _camera_findings(seen, subject, listener.history)
    findings += judge_ranging(ranging.result(), limits.ranging)
    folder = subject.recording.directory
    findings += judge_computer(before, after, disk_free_gb(folder), folder, limits.computer)
    return report, findings


async def _listen(transport: Transport, listener: VehicleListener, clock: Clock) -> VehicleReport:
    while not listener.done(clock.now()):
        for datagram in listener.tick(clock.now(), transport.receive()):
            transport.send(datagram)
        await asyncio.sleep(TICK_S)
    return listener.report(clock.now())


async def _look(subject: Subject, clock: Clock) -> CameraReport | None:
    """Look through the camera; None where no configuration says which."""
    section, model = subject.camera, subject.model
    if section is None or model is None:
        return None
    parameters = OpenCvCameraParameters(
        source=section.source, latency_s=section.latency_s, width=model.width, height=model.height
    )
    camera = OpenCvCamera(parameters, clock)
    pad = None if subject.pad is None else subject.pad.name
    try:
        await asyncio.to_thread(camera.start)
    except CameraError as error:
        return CameraReport(
            source=section.source, failure=str(error), arrivals=(), qualities=(), observations=(), pad=pad, troubles=()
        )
    detector = None if subject.pad is None else PadDetector(subject.pad, model, subject.perception)
    arrivals: list[float] = []
    examined: list[tuple[PictureQuality, PadObservation | None]] = []
    last, due, t_end = -1, clock.now(), clock.now() + subject.preflight.vehicle.listen_s
    try:
        while clock.now() < t_end:
            frame = camera.newest()
            if frame is not None and frame.sequence != last:
                last = frame.sequence
                arrivals.append(frame.t_arrival)
                if clock.now() >= due:
                    due = clock.now() + _EXAMINE_S
                    examined.append(await asyncio.to_thread(_examine_picture, frame, detector))
            await asyncio.sleep(_LOOK_S)
        troubles = camera.events()
    finally:
        await asyncio.to_thread(camera.stop)
    return CameraReport(
        source=section.source,
        failure=None,
        arrivals=arrivals,
        qualities=[quality for quality, _ in examined],
        observations=[observation for _, observation in examined if observation is not None],
        pad=pad,
        troubles=troubles,
    )


def _examine_picture(frame: CameraFrame, detector: PadDetector | None) -> tuple[PictureQuality, PadObservation | None]:
    return picture_quality(frame.image), None if detector is None else detector.observe(frame, None)


# ---- judging


def _vehicle_findings(report: VehicleReport, subject: Subject) -> list[Finding]:
    if report.wrong is not None:
        wrong = report.wrong
        return [judged("vehicle", False, f"a {wrong.type_name} flown by {wrong.autopilot}", wrong.wanted)]
    if not report.heard:
        patience = f"no heartbeat within {subject.engagement.vehicle_timeout_s:g} s"
        instead = report.statistics.heard_instead or "nothing at all was heard"
        wanted = "a heartbeat of the configured system and component; check its power and where its MAVLink goes"
        return [judged("vehicle", False, f"{patience}; {instead}", wanted)]
    return judge_vehicle(report, subject.preflight.vehicle, subject.rules)


def _camera_findings(report: CameraReport | None, subject: Subject, history: OwnshipHistory) -> list[Finding]:
    if report is None or subject.camera is None or subject.model is None:
        return [not_checked("camera", "no configuration says which", "name it: --config FILE")]
    limits = subject.preflight.camera
    findings = judge_camera(report, limits, (subject.model.width, subject.model.height))
    if report.failure is None:
        mount = subject.camera.mount.frd_from_cam
        samples = [
            TiltSample(frd_from_pad=mount.rotation @ seen.hypotheses[0].rotation, ned_from_frd=ownship.ned_from_frd)
            for seen in report.observations
            if seen.seen and (ownship := history.at(seen.t)) is not None
        ]
        findings.append(judge_mount(measure_tilt(samples), report.pad, limits))
    return findings


# ---- telling


def _show(console: Console, findings: Sequence[Finding]) -> None:
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for finding in findings:
        verdict = f"[{_COLOURS[finding.verdict]}]{finding.verdict.value}[/]"
        wanted = "" if finding.verdict is Verdict.FINE else f"\n-> {finding.wanted}"
        table.add_row(finding.check, verdict, (finding.found + wanted).replace("[", r"\["))
    console.print(table)
    counts = {verdict: sum(finding.verdict is verdict for finding in findings) for verdict in Verdict}
    console.print(", ".join(f"{count} {verdict.value}" for verdict, count in counts.items() if count), highlight=False)


def _as_json(findings: Sequence[Finding], code: int) -> dict[str, Any]:
    return {
        "ok": code == SUCCESS,
        "exit_code": code,
        "checks": [
            {
                "check": finding.check,
                "verdict": finding.verdict.value,
                "found": finding.found,
                "wanted": finding.wanted,
                "figures": dict(finding.figures),
            }
            for finding in findings
        ],
    }
