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


def test_a_vehicle_in_its_place_behind_a_target_is_not_off() -> None:
    yaw = np.array([0.0, 0.5 * np.pi, -2.0])
    target = np.array([[1.0, 2.0, 0.0], [-3.0, 0.5, 0.0], [0.0, 0.0, 0.0]])
    path = FlightPath(
        t=np.arange(3.0),
        vehicle_ned=target - 1.25 * np.column_stack((np.cos(yaw), np.sin(yaw), np.zeros(3))),
        vehicle_yaw=yaw,
        target_ned=target,
        target_yaw=yaw,
        moving=np.zeros(3),
    )
    assert path.distance_to_place(1.25) == pytest.approx(np.zeros(3), abs=1e-12)
    assert path.lateral == pytest.approx(np.full(3, 1.25))
