"""The places at which a chaser may start, as a grid, and what all of them offer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from companion.geometry.arrays import Array, frozen
from companion.placement.assessment import Place, assess
from companion.placement.mounting import Box
from companion.placement.scene import Scene

_CLEAR_SIDES = 2.0  # of the target, between both centres: nearer than that nobody starts
_CLEAR_OF_ANCHOR = 0.1  # [m] one side of a CubeSat


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Area:
    """A grid of places in planes of constant z."""

    x: Array  # (X,) [m], rising
    y: Array  # (Y,) [m], rising
    z: Array  # (Z,) [m], rising
    kept_out: Box | None = None  # the mother-ship's body: nobody starts inside or behind it

    def __post_init__(self) -> None:
        for name in ("x", "y", "z"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def positions(self, scene: Scene, *, step: int = 1) -> Array:
        """Give the places (P, 3) [m] at which a chaser may start; every `step`-th along x and y."""
        grid = np.array([(x, y, z) for z in self.z for y in self.y[::step] for x in self.x[::step]])
        return grid[[self.open_to(scene, place) for place in grid]]

    def open_to(self, scene: Scene, position: Array) -> bool:
        """Say whether a chaser may start there.

        Neither at an anchor, nor inside the mother-ship, nor inside or beside the target, and not where the mother-ship
        is in the way: the approach is along the line of sight to the port.
        """
        body, port = self.kept_out, scene.port
        if float(np.linalg.norm(scene.setup.anchors - position, axis=1).min()) < _CLEAR_OF_ANCHOR:
            return False
        if body is not None:
            if body.holds(position):
                return False
            if port is not None and body.lies_between(position, port.docked_position):
                return False
        return clear_of_target(scene, position)


def clear_of_target(scene: Scene, position: Array) -> bool:
    """Say whether two sides of the target lie between its centre and the chaser's."""
    port = scene.port
    return port is None or float(np.linalg.norm(position - port.position)) >= _CLEAR_SIDES * port.side


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AreaMap:
    """What each place of an area offers."""

    area: Area
    places: tuple[Place | None, ...]  # along x first, then y, then z; None: nobody starts there

    @property
    def starts(self) -> tuple[Place, ...]:
        """The places at which a chaser may start."""
        return tuple(place for place in self.places if place is not None)

    @property
    def best(self) -> Place:
        """Where the position is known best by ranges."""
        return min(self.starts, key=lambda place: place.worst_std)

    @property
    def worst(self) -> Place:
        """Where it is known worst; of places where it is undetermined the one with the largest GDOP, or the first."""
        return max(self.starts, key=lambda place: (place.worst_std, place.dilution))

    def values(self, figure: Callable[[Place], float]) -> Array:
        """Give a figure of all places, (Z, Y, X); nan where nobody starts."""
        flat = [np.nan if place is None else figure(place) for place in self.places]
        return np.array(flat).reshape(len(self.area.z), len(self.area.y), len(self.area.x))


def assess_area(scene: Scene, area: Area) -> AreaMap:
    """Assess each place of an area.

    Raises:
        ValueError: nobody may start anywhere in it.
    """
    grid = [np.array([x, y, z]) for z in area.z for y in area.y for x in area.x]
    places = tuple(assess(scene, position) if area.open_to(scene, position) else None for position in grid)
    if not any(places):
        raise ValueError(
            "no place of the region is a start: all lie inside or behind the mother-ship, or beside the target; "
            "give another region"
        )
    return AreaMap(area=area, places=places)
