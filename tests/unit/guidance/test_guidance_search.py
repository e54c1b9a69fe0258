"""The search spiral is flyable and covers its disc."""

import numpy as np
import pytest

from companion.guidance.search import spiral_offset

SPEED, PITCH, RADIUS = 1.0, 2.0, 6.0


def _offset(elapsed: float) -> tuple[np.ndarray, np.ndarray]:
    return spiral_offset(elapsed=elapsed, speed=SPEED, pitch=PITCH, radius=RADIUS)


def test_the_rate_is_the_derivative_of_the_offset_away_from_the_centre() -> None:
    for elapsed in (20.0, 40.0, 70.0, 200.0):
        difference = (_offset(elapsed + 1e-4)[0] - _offset(elapsed - 1e-4)[0]) / 2e-4
        assert np.linalg.norm(difference - _offset(elapsed)[1]) < 0.1 * SPEED


def test_the_speed_stays_at_the_wanted_one() -> None:
    for elapsed in np.linspace(0.0, 300.0, 200):
        assert np.linalg.norm(_offset(float(elapsed))[1]) <= SPEED * 1.001


def test_no_point_of_the_disc_is_farther_from_the_path_than_the_pitch() -> None:
    path = np.array([_offset(t)[0] for t in np.arange(0.0, 150.0, 0.1)])
    rng = np.random.default_rng(3)
    for _ in range(200):
        radius, angle = (RADIUS - 0.5) * np.sqrt(rng.random()), 2 * np.pi * rng.random()
        point = radius * np.array([np.cos(angle), np.sin(angle)])
        assert np.min(np.linalg.norm(path - point, axis=1)) < PITCH


def test_it_never_leaves_the_radius() -> None:
    distances = [np.linalg.norm(_offset(float(t))[0]) for t in np.linspace(0, 500, 500)]
    assert max(distances) == pytest.approx(RADIUS, abs=1e-6)
