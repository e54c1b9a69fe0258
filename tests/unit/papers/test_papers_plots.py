"""What the plots of the papers decide by themselves."""

import numpy as np
import pytest

from companion.campaign.path import FlightPath
from companion.papers.plots import _is_flat


@pytest.mark.parametrize(("rise", "flat"), [(0.0, True), (0.3, True), (3.0, False)])
def test_a_drive_is_drawn_from_above_and_a_flight_in_space(rise: float, flat: bool) -> None:
    n = 5
    vehicle = np.column_stack((np.arange(n), np.zeros(n), -0.12 - np.linspace(0.0, rise, n)))
    path = FlightPath(
        t=np.arange(float(n)),
        vehicle_ned=vehicle,
        vehicle_yaw=np.zeros(n),
        target_ned=np.zeros((n, 3)),
        target_yaw=np.zeros(n),
        moving=np.zeros(n),
    )
    assert _is_flat(path) is flat
