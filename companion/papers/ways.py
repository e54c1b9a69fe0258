"""A way cut at the changes of mode, to be drawn in their colours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from companion.geometry.arrays import Array
from companion.messages.decision import Switch
from companion.messages.docking import DockingSwitch


def stretches(t: Array, places: Array, switches: Sequence[Switch | DockingSwitch]) -> Iterator[tuple[str, Array]]:
    """Yield each stay in a mode with its way (n, k), its ends put in between the samples.

    Args:
        t: (m,) [s] of the samples, ascending, one at least.
        places: (m, k) of the samples.
        switches: the changes of mode, in their order.
    """
    times = [*(switch.t for switch in switches), float(t[-1])]
    for switch, end in zip(switches, times[1:], strict=True):
        inside = t[(t > switch.t) & (t < end)]
        yield str(switch.mode.value), place_at(np.array([switch.t, *inside, end]), t, places)


def place_at(when: Array, t: Array, places: Array) -> Array:
    """Give the places (n, k) at some times (n,), between the samples (m, k) of times (m,)."""
    columns: Array = np.column_stack([np.interp(when, t, column) for column in places.T])
    return columns
