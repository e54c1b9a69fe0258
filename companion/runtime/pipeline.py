"""The heart: one synchronous step from bytes and observations to bytes.

It reads no clock, opens no socket and rolls no dice. Both sides in one process, one after the other, as `lockstep`
drives them in virtual time; in flight each side has a process of its own.
"""

from __future__ import annotations

from companion.messages.guardian import GuardianState
from companion.messages.perception import CameraFrame
from companion.messages.proximity import RangeReading
from companion.ranging.decoder import RangingDecoder
from companion.runtime.helm import Helm
from companion.runtime.planner import TICK_S, Planner, Snapshot
from companion.runtime.ports import DetectionRequest, Inbox, MissionStatus, Outbox

__all__ = ["TICK_S", "Pipeline", "Snapshot"]


class Pipeline:
    """Runs the guardian's side and the planner's side in turn.

    Args:
        helm: the guardian's side.
        planner: the other one.
        decoder: of what comes from the ranging radio; None: there is none.
    """

    def __init__(self, *, helm: Helm, planner: Planner, decoder: RangingDecoder | None = None) -> None:
        self.helm = helm
        self._planner = planner
        self._decoder = decoder

    @property
    def mission(self) -> MissionStatus:
        """How the mission stands."""
        return self._planner.mission

    @property
    def snapshot(self) -> Snapshot | None:
        """What the last step knew and decided; None before the first."""
        return self._planner.snapshot

    @property
    def quiet(self) -> bool:
        """Whether the mission has ended and nothing more will be sent but heartbeats."""
        return self.mission.ended and self.helm.state is GuardianState.MUTED

    def stop(self, t: float) -> None:
        """End the mission at the operator's wish: the vehicle is handed to the autopilot's Hold."""
        self._planner.stop(t)
        self.helm.give_back(t)

    def detection_request(self, frame: CameraFrame) -> DetectionRequest:
        """Give the search to be made in a frame that has just arrived."""
        return self._planner.detection_request(frame)

    def step(self, t: float, inbox: Inbox) -> Outbox:
        """Run one step.

        Args:
            t: now [s], companion clock; it increases from step to step.
            inbox: what arrived since the last step.
        """
        telemetry = self.helm.receive(t, inbox.datagrams)
        handover = self._planner.step(telemetry, inbox.observations, self._decoded(inbox))
        done = self.helm.tick(t, handover)
        self._planner.conclude(telemetry, done.guardian, done.datagrams)
        return Outbox(datagrams=done.datagrams, ground=done.ground)

    def _decoded(self, inbox: Inbox) -> list[RangeReading]:
        if self._decoder is None:
            return []
        messages = [self._decoder.decode(data, t_arrival) for t_arrival, data in inbox.ranges]
        return [reading for message in messages for reading in message.readings]
