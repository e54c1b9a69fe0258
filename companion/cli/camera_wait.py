"""Wait, at the start of `companion fly`, for a camera that is not up yet: its server may be started after us."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from companion.camera.source import CameraSource
from companion.clock import Clock
from companion.errors import CameraNotReadyError

# Below TimeoutStartSec of config/systemd/companion.service (60 s) less the last attempt (12 s) and the detector's
# start; above its StartLimitIntervalSec / StartLimitBurst (30 s / 3), so that it starts us anew as long as it takes.
PATIENCE_S = 40.0
_RETRY_S = 3.0  # between attempts: a line each
_LOOK_S = 0.1  # how soon an end of the program is noticed


class StartableCamera(CameraSource, Protocol):
    """A camera that is to be started once."""

    def start(self) -> None:
        """Open it and wait for its first picture; see the errors of `wait_for_camera`."""


def wait_for_camera(
    make: Callable[[], StartableCamera],
    *,
    clock: Clock,
    ended: Callable[[], bool],
    say: Callable[[str], None],
    pause: Callable[[float], None] = time.sleep,
) -> CameraSource | None:
    """Give a camera that has started, or None where the program ends before there is one.

    Args:
        make: builds a camera, anew for each attempt.
        clock: measures the patience.
        ended: whether the program is to end.
        say: tells people what is waited for.
        pause: lets a time [s] pass.

    Raises:
        CameraNotReadyError: it gives no picture after `PATIENCE_S` either.
        CameraError: waiting would not help.
    """
    t_end = clock.now() + PATIENCE_S
    while not ended():
        camera = make()
        try:
            camera.start()
        except CameraNotReadyError as error:
            if clock.now() >= t_end:
                raise
            say(f"waiting for the camera, {t_end - clock.now():.0f} s more at most: {error}")
        else:
            return camera
        t_next = clock.now() + _RETRY_S
        while clock.now() < t_next and not ended():
            pause(_LOOK_S)
    return None
