"""A world that follows an autopilot it knows only by its telemetry; virtual time, no sockets."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink
from stub_vehicle_support import BareWorld, Client, vehicle

from companion.ranging.packet import decode_packet
from companion.ranging.wire import WireMessage
from sitl_stub.external.external_world import ExternalWorld
from sitl_stub.external.pairing import Pairing
from sitl_stub.external.pose import LATITUDE_STEP, PoseTracker, from_origin, is_attitude
from sitl_stub.simulation import STEP, Simulation
from sitl_stub.truth import VehicleTruth
from sitl_stub.world.world import World

FEET = vehicle().gear.foot_down_m


class Watched(Simulation):
    """The stub's vehicle as the external autopilot: its ground link is heard by a world, with times of arrival."""

    def __init__(self, seed: int = 1, speed: float = 1.0, scatter: float = 1e-4) -> None:
        super().__init__(BareWorld(), vehicle(), seed)
        self.outside = ExternalWorld(World.load("moving_pad"), vehicle(), seed, "corners")
        self.speed, self.scatter = speed, scatter
        self.dice = np.random.default_rng(seed)
        self.seen: list[tuple[float, VehicleTruth, VehicleTruth]] = []
        self.pictures: list[Any] = []
        self.stalled = 0.0
        self.asks = True

    def advance(self, until: float) -> None:
        while self.t < until - 1e-9:
            super().advance(self.t + STEP)
            if self.asks and self.outside.system is not None:
                self.asks = False
                for datagram in self.outside.requests():
                    self.receive("ground", datagram)
            self.stalled += float(self.dice.exponential(self.scatter))  # the sender may be late, never early
            arrival = 5e8 + self.t / self.speed + self.stalled
            for index, datagram in enumerate(self.transmit("ground")):
                before = self.outside.truth
                self.outside.receive(arrival + 2e-5 * index, datagram)
                now = self.outside.truth
                if now is not None and now is not before:
                    self.seen.append((self.t, self.truth().vehicle, now.vehicle))
            self.pictures += self.outside.frames()


def flown(**words: Any) -> Watched:
    """A take-off and a flight to and fro."""
    simulation = Watched(**words)
    client = Client(simulation)
    client.take_off(4.0)
    goal = client.setpoint(position=(6.0, 4.0, -4.0), yaw=1.5)
    client.stream = lambda t: goal
    client.run(4.0)
    return simulation


@pytest.mark.parametrize("speed", [1.0, 10.0, 0.2])
def test_pose_and_time_follow_the_truth_at_any_speed_of_the_clock(speed: float) -> None:
    simulation = flown(speed=speed)
    late = np.array([real - seen.t for real, _, seen in simulation.seen])
    assert len(late) > 2000
    # one clock: the world's time advances as the autopilot's, to what the messages of one step lie apart on the wire,
    # the client's forwarded heartbeat among them
    assert np.ptp(late[10:]) < 0.001 + 3.2e-4 * speed
    # its rate is off by what the autopilot's clock drifts; each truth is held against the vehicle's at that very step
    for _, truth, seen in simulation.seen[10:]:
        speed_there = math.dist(truth.velocity_ned, (0.0, 0.0, 0.0))
        assert math.dist(truth.position_ned[:2], seen.position_ned[:2]) < 0.012 + 0.005 * speed_there
        assert abs(truth.position_ned[2] - seen.position_ned[2]) < 0.004 + 0.005 * speed_there
        turned = abs(sum(a * b for a, b in zip(truth.quaternion, seen.quaternion, strict=True)))
        assert turned > math.cos(0.5 * math.radians(0.8))
    assert simulation.seen[-1][2].armed


def test_the_picture_is_not_shaken_by_the_steps_of_the_message() -> None:
    seen = [(s.t, s.position_ned[0]) for _, t, s in flown().seen if t.position_ned[2] < -1.0]
    times, north = np.array(seen).T
    speeds = np.diff(north) / np.diff(times)
    # one step of latitude in 4 ms would be 2.8 m/s
    assert np.abs(np.diff(speeds)).max() < 0.25


def test_the_pad_sets_off_and_pictures_show_it_by_the_autopilots_clock() -> None:
    simulation = flown(speed=5.0)
    assert len(simulation.pictures) == pytest.approx(30.0 * simulation.t, rel=0.05)
    for picture in simulation.pictures:
        assert 0.040 <= picture.t_delivery - picture.t_capture < 0.060
    client = Client(simulation)
    hover = client.setpoint(position=(6.0, 4.0, -4.0), yaw=1.5)
    client.stream = lambda t: hover
    client.run(12.0)
    truth = simulation.outside.truth
    assert truth is not None
    pad = truth.targets[0]
    assert pad.moving
    assert math.hypot(*pad.velocity_ned[:2]) == pytest.approx(0.5, abs=0.01)


def test_platforms_lie_on_the_ground_and_the_standing_vehicle_on_them() -> None:
    simulation = Watched()
    Client(simulation).run(1.0)
    truth = simulation.outside.truth
    assert truth is not None
    assert truth.targets[0].position_ned[2] == 0.0
    assert truth.vehicle.position_ned == pytest.approx((0.0, 0.0, -FEET), abs=1e-3)
    assert (truth.vehicle.feet_in_contact, truth.vehicle.surface, truth.vehicle.armed) == (4, "ground", False)
    flat = World.load("static_pad").flat().start(np.random.SeedSequence(1), "corners", vehicle().camera)
    north, east, _ = flat.targets.truths()[0].position_ned
    assert flat.targets.surface_under(north, east)[:2] == (0.0, "pad")


def outside() -> ExternalWorld:
    return ExternalWorld(World.load("static_pad"), vehicle(), 1, "corners")


class Autopilot:
    """Says what a test wants it to say."""

    def __init__(self, world: ExternalWorld, system: int = 1) -> None:
        self.world, self.mav, self.t = world, mavlink.MAVLink(None, srcSystem=system, srcComponent=1), 100.0

    def say(self, message: Any, *, late: bool = False) -> bool:
        return self.world.receive(self.t, bytes(message.pack(self.mav)), late=late)

    def heartbeat(self, *, armed: bool = False, autopilot: int = 12) -> bool:
        return self.say(mavlink.MAVLink_heartbeat_message(2, autopilot, 128 if armed else 0, 0, 3, 3))

    def truth(
        self, *, count: int = 1, late: bool = False, attitude: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0), usec: int = 0
    ) -> None:
        for _ in range(count):
            self.t += STEP
            self.say(mavlink.MAVLink_hil_state_quaternion_message(usec, attitude, *[0.0] * 3, *[0] * 11), late=late)
            imu = (0.0,) * 9
            stamp = int(self.t * 1e6)
            self.say(mavlink.MAVLink_highres_imu_message(stamp, *imu, 0.0, 0.0, 0.0, 0.0, 63), late=late)


def test_the_first_autopilot_is_followed_and_nobody_else() -> None:
    world = outside()
    ours, other, station = Autopilot(world, 4), Autopilot(world, 7), Autopilot(world, 255)
    ours.truth(count=3)
    assert world.truth is None  # nothing counts before a heartbeat
    assert not station.heartbeat(autopilot=mavlink.MAV_AUTOPILOT_INVALID)
    assert ours.heartbeat()
    assert not other.heartbeat(armed=True)
    other.truth(count=3)
    assert (world.system, world.others, world.truths, world.armed) == (4, {7}, 0, False)
    chosen = ExternalWorld(World.load("static_pad"), vehicle(), 1, "corners", system=7)
    assert not Autopilot(chosen, 4).heartbeat()
    assert Autopilot(chosen, 7).heartbeat()
    assert chosen.system == 7


def test_it_asks_the_autopilot_for_truth_and_time() -> None:
    world = outside()
    Autopilot(world, 4).heartbeat()
    sent = [mavlink.MAVLink(None).decode(bytearray(datagram)) for datagram in world.requests()]
    assert [(m.command, m.target_system, m.param1, m.param2) for m in sent] == [
        (511, 4, 115.0, 4000.0),
        (511, 4, 105.0, 4000.0),
    ]
    autopilot = Autopilot(world, 4)
    autopilot.say(mavlink.MAVLink_command_ack_message(511, 4, 0, 0, 0, 0))
    assert world.answer == 4


def test_late_truth_and_gaps_move_the_world_but_make_no_pictures() -> None:
    world = outside()
    autopilot = Autopilot(world)
    autopilot.heartbeat()
    autopilot.truth(count=250)
    first = len(world.frames())
    autopilot.truth(count=250, late=True)
    assert world.truth is not None
    assert world.truth.t == pytest.approx(2.0, abs=0.02)
    assert world.left_out == 250
    assert len(world.frames()) <= 3  # those that were on their way
    autopilot.t += 10.0
    autopilot.truth(count=250)
    assert world.truth.t == pytest.approx(13.0, abs=0.02)
    assert len(world.frames()) == pytest.approx(first, abs=3)
    assert first > 25


def test_an_autopilot_that_starts_anew_gets_a_new_world() -> None:
    world = outside()
    autopilot = Autopilot(world)
    autopilot.heartbeat()
    autopilot.truth(count=500)
    autopilot.t = 3.0
    autopilot.truth(count=50)
    assert world.truth is not None
    assert world.truth.t == pytest.approx(0.2, abs=0.02)


def test_garbage_and_what_is_no_attitude_are_passed_over() -> None:
    world = outside()
    autopilot = Autopilot(world)
    autopilot.heartbeat()
    autopilot.truth(count=5, attitude=(0.0, 0.0, 0.0, 0.0))
    autopilot.truth(count=5, attitude=(math.nan, 0.0, 0.0, 0.0))
    assert world.truths == 0
    dice = np.random.default_rng(1)
    for size in range(60):
        world.receive(0.0, bytes([0xFD]) + dice.bytes(size))
    assert not is_attitude((math.inf, 0.0, 0.0, 0.0))
    autopilot.truth(count=5)
    assert world.truths == 5


def reading(north: float, *, vx: float = 0.0, q: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)) -> Any:
    """What PX4 sends at a place: positions and velocities cut off, not rounded."""
    latitude = 47.4 + math.degrees(north / 6_371_000.0)
    return SimpleNamespace(
        lat=int(latitude * 1e7),
        lon=85455940,
        alt=489400,
        vx=int(vx * 1e2),
        vy=0,
        vz=0,
        attitude_quaternion=q,
        rollspeed=0.0,
        pitchspeed=0.0,
        yawspeed=0.0,
        time_usec=0,
    )


@pytest.mark.parametrize("speed", [0.004, 0.1, 0.517, 3.0])
def test_the_pose_stays_within_a_step_and_moves_smoothly(speed: float) -> None:
    tracker, errors, places = PoseTracker(0.2), [], []
    for index in range(5000):
        t = index * STEP
        pose = tracker.follow(t, reading(speed * t, vx=speed))
        errors.append(pose.position_ned[0] - speed * t)
        places.append(pose.position_ned[0])
    assert np.abs(errors).max() < 1.6 * LATITUDE_STEP
    assert np.abs(np.diff(places) / STEP - speed).max() < 0.061  # PULL and what the velocity cuts off
    assert pose.position_ned[2] == -0.2


def test_a_vehicle_that_was_moved_is_where_it_was_put() -> None:
    tracker = PoseTracker(0.2)
    tracker.follow(0.0, reading(0.0))
    assert tracker.follow(STEP, reading(50.0)).position_ned[0] == pytest.approx(50.0, abs=LATITUDE_STEP)


def test_the_sign_of_the_attitude_is_kept() -> None:
    tracker = PoseTracker(0.2)
    tracker.follow(0.0, reading(0.0, q=(0.8, 0.0, 0.0, 0.6)))
    turned = tracker.follow(STEP, reading(0.0, q=(-0.8, 0.0, 0.0, -0.6))).quaternion
    assert turned == pytest.approx((0.8, 0.0, 0.0, 0.6))


def test_places_are_those_of_px4s_projection() -> None:
    origin = (47.397742, 8.545594, 489.4)
    # PX4's MapProjection.project of 47.3988 8.5469: azimuthal equidistant on a sphere of 6371000 m
    phi0, phi, turn = math.radians(origin[0]), math.radians(47.3988), math.radians(8.5469 - origin[1])
    c = math.acos(math.sin(phi0) * math.sin(phi) + math.cos(phi0) * math.cos(phi) * math.cos(turn))
    k = c / math.sin(c) * 6_371_000.0
    north = k * (math.cos(phi0) * math.sin(phi) - math.sin(phi0) * math.cos(phi) * math.cos(turn))
    east = k * math.cos(phi) * math.sin(turn)
    found = from_origin(origin, (47.3988, 8.5469, 486.4))
    assert found == pytest.approx((north, east, 3.0), abs=1e-3)
    assert north > 100.0
    assert from_origin(origin, origin) == (0.0, 0.0, 0.0)


def test_truth_is_dated_by_the_stamps_around_it_however_the_sender_stalls() -> None:
    pairing, dice = Pairing(), np.random.default_rng(3)
    arrival, errors = 0.0, []
    for index in range(1, 2000):
        t = index * STEP
        arrival += 0.5 * STEP + float(dice.exponential(0.5 * STEP))
        assert pairing.truth(arrival, SimpleNamespace(time_usec=0, t=t)) == []
        errors += [got - message.t for got, message in pairing.stamp(arrival + 5e-5, t)]
    assert len(errors) == 1998
    assert np.abs(errors).max() < 1e-3


def test_a_truth_message_with_a_time_needs_no_stamp() -> None:
    pairing = Pairing()
    message = SimpleNamespace(time_usec=12_500_000)
    assert pairing.truth(0.0, message) == [(12.5, message)]
    assert not pairing.restarted
    pairing.truth(0.0, SimpleNamespace(time_usec=500_000))
    assert pairing.restarted


def test_ranges_come_by_the_autopilots_clock_and_count_from_where_it_says_the_vehicle_is() -> None:
    simulation = Watched()
    simulation.outside = ExternalWorld(World.load("far_pad"), vehicle(), 1, "corners")
    Client(simulation).run(2.0)
    assert simulation.outside.truth is not None
    readings = [decode_packet(packet) for packet in simulation.outside.ranges()]
    assert len(readings) == pytest.approx(50.0 * 0.98 * simulation.outside.truth.t, rel=0.1)
    distances = [reading.ranges[0].range for reading in readings if isinstance(reading, WireMessage)]
    north, east, _ = simulation.outside.truth.targets[0].position_ned
    assert np.median(distances) == pytest.approx(math.hypot(north, east), abs=3.5)
