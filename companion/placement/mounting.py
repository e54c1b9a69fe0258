"""Where anchors may be mounted: on faces of a box."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from companion.geometry.arrays import Array, frozen
from companion.placement.geometry import flatness

Flags = NDArray[np.bool_]
FACES = ("x-", "x+", "y-", "y+", "z-", "z+")
FEWEST, MOST = 3, 8
_TOUCHES = 1e-6  # [m]
_ALONG = 8  # places along the box's longest side, less one
# Twice what a survey counts as flat: anchors that are mounted a few centimetres off must not end up in a plane.
_LEAST_FLATNESS = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Box:
    """A box along the axes of c."""

    low: Array  # (3,) [m]
    high: Array  # (3,) [m]

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", frozen(self.low, (3,)))
        object.__setattr__(self, "high", frozen(self.high, (3,)))

    def holds(self, place: Array) -> bool:
        """Say whether a place (3,) lies inside or on the surface."""
        return bool(np.all(place >= self.low - _TOUCHES) and np.all(place <= self.high + _TOUCHES))

    def lies_between(self, begin: Array, end: Array) -> bool:
        """Say whether the straight line between two places (3,) [m] meets the box."""
        enters, leaves = 0.0, 1.0
        for start, stop, low, high in zip(begin, end, self.low - _TOUCHES, self.high + _TOUCHES, strict=True):
            if abs(stop - start) < _TOUCHES:
                if not low <= start <= high:
                    return False
                continue
            crossings = sorted(((low - start) / (stop - start), (high - start) / (stop - start)))
            enters, leaves = max(enters, crossings[0]), min(leaves, crossings[1])
        return enters <= leaves


def box_round(places: Array) -> Box:
    """Give the smallest box round places (N, 3)."""
    return Box(low=places.min(axis=0), high=places.max(axis=0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mounting:
    """How many anchors may stand where.

    Raises:
        ValueError: a count, a face, a spacing or a box is impossible.
    """

    box: Box
    faces: tuple[str, ...] = FACES  # on which anchors may stand
    count: int = 4
    spacing: float = 0.2  # [m] least distance of two anchors: nearer ones tell nearly the same

    def __post_init__(self) -> None:
        if not FEWEST <= self.count <= MOST:
            raise ValueError(
                f"{self.count} anchors; a position takes {FEWEST}, the pose estimator fuses {MOST} at most"
            )
        if not self.faces or any(face not in FACES for face in self.faces):
            raise ValueError(f"faces {','.join(self.faces)}; some of {','.join(FACES)} are wanted")
        if not self.spacing > 0.0:
            raise ValueError(f"a spacing of {self.spacing:g} m; it must be positive")
        extents = self.box.high - self.box.low
        if np.any(extents < 0.0) or np.sum(extents > 0.0) < 2:
            sizes = " x ".join(f"{extent:g}" for extent in extents)
            raise ValueError(f"a box of {sizes} m; two of its sides at least must have a length, low before high")

    @property
    def least_flatness(self) -> float:
        """By which share of their extent the anchors must leave a plane; 0 where three, or a flat box, cannot."""
        extents = self.box.high - self.box.low
        flat = self.count == FEWEST or extents.min() < _LEAST_FLATNESS * extents.max()
        return 0.0 if flat else _LEAST_FLATNESS

    def on_face(self, places: Array) -> Flags:
        """Say of places (K, 3) inside the box whether each lies on a face that is allowed, (K,) of bool."""
        found = np.zeros(len(places), dtype=bool)
        for face in self.faces:
            axis, level = self._face(face)
            found |= np.abs(places[:, axis] - level) < _TOUCHES
        return found

    def candidates(self) -> Array:
        """Give evenly spread places (K, 3) [m] on the faces, edges and corners among them."""
        extents = self.box.high - self.box.low
        step = extents.max() / _ALONG
        axes = [
            np.linspace(low, high, max(2, 1 + round(extent / step)) if extent > 0.0 else 1)
            for low, high, extent in zip(self.box.low, self.box.high, extents, strict=True)
        ]
        grid = np.array(list(product(*axes)))
        places: Array = grid[self.on_face(grid)]
        return places

    def nearest(self, places: Array) -> Array:
        """Move places (N, 3) each to the nearest one on a face that is allowed."""
        moved = []
        for place in np.clip(places, self.box.low, self.box.high):
            options = []
            for face in self.faces:
                axis, level = self._face(face)
                option = place.copy()
                option[axis] = level
                options.append(option)
            moved.append(min(options, key=lambda option: float(np.linalg.norm(option - place))))
        return np.array(moved)

    def admits(self, sets: Array) -> Flags:
        """Say of sets of anchors (K, N, 3) whether each keeps the spacing and leaves a plane, (K,) of bool."""
        n = sets.shape[1]
        first, second = np.triu_indices(n, 1)
        apart = np.linalg.norm(sets[:, first] - sets[:, second], axis=2).min(axis=1) >= self.spacing - _TOUCHES
        admitted: Flags = apart & (flatness(sets) >= self.least_flatness)
        return admitted

    def _face(self, face: str) -> tuple[int, float]:
        axis = "xyz".index(face[0])
        return axis, float((self.box.high if face[1] == "+" else self.box.low)[axis])
