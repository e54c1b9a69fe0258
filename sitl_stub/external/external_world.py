"""A world that follows an autopilot by what it sends; no clock, no sockets."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import all as mavlink

from sitl_stub.external.pairing import Pairing
from sitl_stub.external.pose import Pose, PoseTracker, is_attitude
from sitl_stub.truth import Truth, VehicleTruth
from sitl_stub.vehicle.config import VehicleFile
from sitl_stub.vehicle.receiver import frame_source, split_frames
from sitl_stub.world.camera import Frame
from sitl_stub.world.world import CameraKind, World

INTERVAL_US = 4000
"""Asked for: every step of PX4's SIH."""
SOURCE_SYSTEM, SOURCE_COMPONENT = 245, mavlink.MAV_COMP_ID_PERIPHERAL
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
TRUTH = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
STAMP = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
ACK = mavlink.MAVLINK_MSG_ID_COMMAND_ACK
HEARD = frozenset((HEARTBEAT, TRUTH, STAMP, ACK))
GAP = 0.5
"""A longer silence of the truth [s] is left out: no pictures are made of it."""
CONTACT = 0.02
"""The vehicle stands when its feet are this near to the ground [m]."""
STEP = 0.02
"""Platforms move in steps of at most this [s]."""


class ExternalWorld:
    """Targets and camera around an autopilot that simulates its own vehicle.

    Time is the autopilot's, from its first truth message on. The autopilot's ground is a plane and knows no
    platforms, so all platforms lie on it as mats; its wind is its own. The world's origin is the ground below the
    vehicle at the start.

    Args:
        world: what there is; heights of platforms and the wind are not used.
        vehicle: camera, and height of the body above its feet.
        seed: all dice of the world.
        camera: pictures, or corners only.
        system: the autopilot's system id; None takes the first that is heard.
    """

    def __init__(
        self, world: World, vehicle: VehicleFile, seed: int, camera: CameraKind, *, system: int | None = None
    ) -> None:
        self._world = world.flat()
        self._vehicle = vehicle
        self._seed = seed
        self._camera = camera
        self._wanted = system
        self._parser = mavlink.MAVLink(None)
        self._mav = mavlink.MAVLink(None, srcSystem=SOURCE_SYSTEM, srcComponent=SOURCE_COMPONENT)
        self.system: int | None = None
        """System id of the autopilot that is followed; None: none was heard."""
        self.others: set[int] = set()
        """System ids of other autopilots on the same port."""
        self.armed = False
        self.answer: int | None = None
        """The autopilot's last answer (MAV_RESULT) to the request for messages; None: no answer."""
        self.truths = 0
        """Truth messages heard."""
        self.left_out = 0
        """Pictures' steps left out because they came too late."""
        self._begin()

    def _begin(self) -> None:
        self._pairing = Pairing()
        self._tracker = PoseTracker(self._vehicle.origin_height_m)
        self._running = self._world.start(np.random.SeedSequence(self._seed), self._camera, self._vehicle.camera)
        self._first: float | None = None
        self._truth: Truth | None = None

    @property
    def truth(self) -> Truth | None:
        """The true state at the newest message; None before the first."""
        return self._truth

    @property
    def stamps(self) -> int:
        """How many messages that carry the autopilot's time were heard."""
        return self._pairing.stamps

    def requests(self) -> list[bytes]:
        """Give the datagrams that ask the autopilot for truth and time."""
        datagrams = []
        for number in (TRUTH, STAMP):
            message = mavlink.MAVLink_command_long_message(
                self.system or 0, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, number, INTERVAL_US, 0, 0, 0, 0, 0
            )
            datagrams.append(bytes(message.pack(self._mav)))
            self._mav.seq = (self._mav.seq + 1) & 0xFF
        return datagrams

    def receive(self, arrival: float, datagram: bytes, *, late: bool = False) -> bool:
        """Act on a datagram that arrived at `arrival` [s, any clock]; `late`: make no pictures of its time.

        Returns whether it came from the autopilot that is followed.
        """
        ours = False
        for frame in split_frames(datagram):
            number, system, component = frame_source(frame)
            if number not in HEARD or component != 1:
                continue
            try:
                message = self._parser.decode(bytearray(frame))
            except mavlink.MAVError:
                continue
            if number == HEARTBEAT and not self._is_followed(system, message):
                continue
            if system == self.system:
                ours = True
                self._act(number, arrival, message, late=late)
        return ours

    def _is_followed(self, system: int, heartbeat: Any) -> bool:
        if heartbeat.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        if self.system is None and self._wanted in (None, system):
            self.system = system
        if system == self.system:
            return True
        self.others.add(system)
        return False

    def _act(self, number: int, arrival: float, message: Any, *, late: bool) -> None:
        paired: list[tuple[float, Any]] = []
        if number == HEARTBEAT:
            self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        elif number == ACK and message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.answer = int(message.result)
        elif number == STAMP:
            paired = self._pairing.stamp(arrival, message.time_usec * 1e-6)
        elif number == TRUTH and is_attitude(message.attitude_quaternion):
            self.truths += 1
            paired = self._pairing.truth(arrival, message)
        if self._pairing.restarted:
            self._begin()
        for t, truth in paired:
            self._step(t, truth, late=late)

    def _step(self, t: float, message: Any, *, late: bool) -> None:
        if self._first is None:
            self._first = t
        t -= self._first
        before = self._truth.t if self._truth is not None else 0.0
        if t <= before and self._truth is not None:
            return
        pose = self._tracker.follow(t, message)
        targets, camera = self._running.targets, self._running.camera
        if late or t - before > GAP:
            self.left_out += 1
            camera.skip(t)
        vehicle = self._vehicle_truth(t, pose)
        steps = max(1, int((t - before) / STEP))
        for index in range(1, steps + 1):
            targets.step(before + (t - before) * index / steps, vehicle)
        self._truth = truth = Truth(t=t, vehicle=vehicle, targets=targets.truths())
        camera.step(t, truth)
        if self._running.ranging is not None:
            self._running.ranging.step(truth, self._vehicle.antenna_frd_m)

    def _vehicle_truth(self, t: float, pose: Pose) -> VehicleTruth:
        feet_down = self._vehicle.origin_height_m
        north, east, down = pose.position_ned
        # SIH's ground lets the vehicle sink in by some centimetres: the camera stays above it
        down = min(down, -feet_down)
        stands = down > -feet_down - CONTACT
        return VehicleTruth(
            t=t,
            position_ned=(north, east, down),
            velocity_ned=pose.velocity_ned,
            quaternion=pose.quaternion,
            angular_velocity_frd=pose.angular_velocity_frd,
            acceleration_ned=pose.acceleration_ned,
            feet_in_contact=4 if stands else 0,
            surface=self._running.targets.surface_under(north, east)[1] if stands else "",
            armed=self.armed,
        )

    def frames(self) -> Sequence[Frame]:
        """Take the camera frames that have been delivered by now, by the autopilot's clock."""
        return self._running.camera.frames(self._truth.t) if self._truth is not None else ()

    def ranges(self) -> list[bytes]:
        """Take the packets of the ranging radio that have arrived by now, by the autopilot's clock."""
        ranging = self._running.ranging
        return [] if ranging is None or self._truth is None else ranging.take(self._truth.t)
