from __future__ import annotations

import numpy as np
import pytest

from companion.camera.source import CameraFrozen, CameraRecovered, CameraSource, CameraStalled, RecordedCamera
from companion.camera.watch import CameraWatch, WatchParameters
from companion.clock import ManualClock
from companion.messages.perception import CameraFrame


def picture(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (48, 64), dtype=np.uint8)


def frame(k: int) -> CameraFrame:
    return CameraFrame(t=k * 0.1, t_arrival=k * 0.1 + 0.04, sequence=k, image=picture(k))


class TestRecordedCamera:
    def test_the_newest_that_has_arrived(self):
        clock = ManualClock(0.0)
        camera: CameraSource = RecordedCamera([frame(k) for k in range(10)], clock)
        assert camera.newest() is None
        clock.set(0.35)
        assert camera.newest().sequence == 3
        assert camera.newest().sequence == 3
        clock.set(0.45)
        camera.stop()
        assert camera.newest().sequence == 3
        assert camera.events() == []

    def test_order_is_demanded(self):
        with pytest.raises(ValueError, match="order"):
            RecordedCamera([frame(2), frame(1)], ManualClock())


class TestWatch:
    def run(self, pictures, *, dt=0.1) -> list:
        watch, events = CameraWatch(WatchParameters(), 0.0), []
        for k, image in enumerate(pictures):
            t = (k + 1) * dt
            if image is not None:
                events += watch.arrived(image, t)
            events += watch.look(t, "gone")
        return events

    def test_a_living_camera_gives_no_event(self):
        assert self.run(picture(k) for k in range(30)) == []

    def test_a_stall_is_told_once_and_ends(self):
        events = self.run([picture(0)] + [None] * 10 + [picture(1), picture(2)])
        assert [type(event) for event in events] == [CameraStalled, CameraRecovered]
        assert events[0].silence == pytest.approx(0.5)
        assert events[0].reason == "gone"

    def test_a_frozen_camera_is_told_once_and_ends(self):
        events = self.run([picture(0)] + [picture(1)] * 12 + [picture(2), picture(3)])
        assert [type(event) for event in events] == [CameraFrozen, CameraRecovered]
        assert events[0].since == pytest.approx(0.2)
        assert events[0].t == pytest.approx(0.7)

    def test_one_picture_twice_is_no_trouble(self):
        doubled = [picture(k // 2) for k in range(20)]
        assert self.run(doubled) == []

    def test_a_camera_that_never_begins_stalls(self):
        assert [type(event) for event in self.run([None] * 8)] == [CameraStalled]

    def test_frozen_then_stalled(self):
        events = self.run([picture(1)] * 9 + [None] * 9 + [picture(2)])
        assert [type(event) for event in events] == [CameraFrozen, CameraStalled, CameraRecovered]
