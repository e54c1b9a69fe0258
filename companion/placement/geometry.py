"""What the directions from anchors to a place tell of it, before any filter."""

from __future__ import annotations

import math

import numpy as np

from companion.geometry.arrays import Array
from companion.ranging.survey import FLAT

_UPPER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # entries of a symmetric matrix (3, 3)


def directions(anchors: Array, places: Array) -> Array:
    """Give the unit vectors (N, P, 3) from each of the anchors (N, 3) [m] to each of the places (P, 3) [m]."""
    offsets = places[None, :, :] - anchors[:, None, :]
    lengths = np.linalg.norm(offsets, axis=2, keepdims=True)
    result: Array = offsets / np.maximum(lengths, 1e-9)
    return result


def information(anchors: Array, places: Array) -> Array:
    """Give `u u'` of each anchor at each place, u the direction: what a range of variance 1 tells of the place.

    Args:
        anchors: (N, 3) [m].
        places: (P, 3) [m].

    Returns:
        (N, 6, P): the entries xx, yy, zz, xy, xz, yz.
    """
    u = directions(anchors, places)
    return np.stack([u[:, :, i] * u[:, :, j] for i, j in _UPPER], axis=1)


def eigenvalues(entries: Array) -> Array:
    """Give the eigenvalues of symmetric matrices (3, 3) by the trigonometric formula (Smith 1961).

    Args:
        entries: (..., 6, P): xx, yy, zz, xy, xz, yz of each matrix.

    Returns:
        (..., 3, P), rising.
    """
    xx, yy, zz, xy, xz, yz = (entries[..., i, :] for i in range(6))
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    off = xy * xy + xz * xz + yz * yz
    scale = np.sqrt(np.maximum((a * a + b * b + c * c + 2.0 * off) / 6.0, 1e-30))
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    angle = np.arccos(np.clip(determinant / (2.0 * scale**3), -1.0, 1.0)) / 3.0
    largest = mean + 2.0 * scale * np.cos(angle)
    least = mean + 2.0 * scale * np.cos(angle + 2.0 * math.pi / 3.0)
    return np.stack([least, 3.0 * mean - least - largest, largest], axis=-2)


def position_dilution(anchors: Array, place: Array) -> float:
    """Give `sqrt(trace((H' H)^-1))`, rows of H the directions: GDOP of the position; inf where it is undetermined.

    Args:
        anchors: (N, 3) [m].
        place: (3,) [m] of the radio.
    """
    rows = directions(anchors, place[None, :])[:, 0, :]
    values = np.linalg.eigvalsh(rows.T @ rows)
    return math.sqrt(float(np.sum(1.0 / values))) if values[0] > 1e-9 else math.inf


def flatness(anchors: Array) -> Array:
    """Say by which share of their extent anchors leave a plane: third singular value of their offsets over the first.

    Args:
        anchors: (..., N, 3) [m].

    Returns:
        (...), 0: all in one plane.
    """
    values = np.linalg.svd(anchors - anchors.mean(axis=-2, keepdims=True), compute_uv=False)
    if values.shape[-1] < 3:
        return np.zeros(values.shape[:-1])
    result: Array = values[..., 2] / np.maximum(values[..., 0], 1e-9)
    return result


def on_one_line(anchors: Array) -> bool:
    """Say whether anchors (N, 3) lie on one line, to `FLAT` of their extent; fewer than three do."""
    if len(anchors) < 3:
        return True
    values = np.linalg.svd(anchors - anchors.mean(axis=0), compute_uv=False)
    return bool(values[1] < FLAT * values[0])


def mirror_distance(anchors: Array, place: Array) -> float:
    """Say how far [m] from a place (3,) its mirror image is, which has the same ranges; inf: it has none."""
    if float(flatness(anchors)) >= FLAT:
        return math.inf
    middle = anchors.mean(axis=0)
    normal = np.linalg.svd(anchors - middle)[2][2]
    return 2.0 * abs(float(normal @ (place - middle)))
