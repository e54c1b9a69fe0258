"""Rigid transforms between frames."""

from __future__ import annotations

from dataclasses import dataclass

from companion.geometry.arrays import Array, frozen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigidTransform:
    """`a_from_b`: takes a point in frame b to frame a; chains so that neighbours cancel.

    Example: `ned_from_cam = ned_from_frd @ frd_from_cam`.
    """

    rotation: Array  # (3, 3)
    translation: Array  # (3,) [m] origin of b, in a

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen(self.rotation, (3, 3)))
        object.__setattr__(self, "translation", frozen(self.translation, (3,)))

    def __matmul__(self, other: RigidTransform) -> RigidTransform:
        return RigidTransform(
            rotation=self.rotation @ other.rotation,
            translation=self.rotation @ other.translation + self.translation,
        )

    def apply(self, points: Array) -> Array:
        """Take points (3,) or (N, 3) [m] from frame b to frame a."""
        result: Array = points @ self.rotation.T + self.translation
        return result

    def inverse(self) -> RigidTransform:
        """Give `b_from_a`."""
        return RigidTransform(rotation=self.rotation.T, translation=-self.rotation.T @ self.translation)
