"""Which nozzles to open for how long: the least total on-time that gives a wanted impulse and angular impulse.

    minimise 1' u    subject to    B u = w,  0 <= u <= T

A vertex of the dual has six columns j of B with b_j' y = 1, so there are at most as many as choices of six nozzles.
With the nozzles whose b_j' y > 1 open all the time, the dual's value there is

    g(y) = y' w - T * sum_j max(0, b_j' y - 1)

and the largest of them is the optimum (duality of linear programs: Bertsimas & Tsitsiklis, Introduction to Linear
Optimization, chapter 4; columns with b_j' y = 1 may be anywhere between). All vertices are listed once, each with
the solutions that belong to it. A step is then two products of a matrix and a vector, and exact.

Wrenches that can be given are a zonotope. Each of its facets has five columns in it and the normal n:

    n' w <= T * sum_j max(0, n' b_j)

A wrench outside is brought inside with the torque first: the torque is shortened only if the nozzles cannot give it
alone, then the force is shortened to what is left; both keep their direction. A spacecraft that points wrong pushes
wrong, and its camera loses the target; one that is late only is late.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from companion.geometry.arrays import Array

_SAME = 1e-9  # relative: two vertices, two solutions are one
_SINGULAR = 1e-9  # relative to the largest: columns that depend on each other
_INSIDE = 1.0 - 1e-12  # keep a shortened wrench off the boundary by rounding errors


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Allocation:
    """On-times and what they give."""

    on_times: Array  # (N,) [s]
    wrench: Array  # (6,) [N s, N m s] that they give
    share: float  # of the wanted force, 0..1
    torque_share: float  # of the wanted torque, 0..1


@dataclass(frozen=True, slots=True, eq=False)
class _Vertex:
    """Solutions u = matrices @ w + offsets that are optimal where this vertex of the dual is."""

    matrices: Array  # (S * N, 6)
    offsets: Array  # (S, N)


class NozzleAllocator:
    """The table for one set of nozzles."""

    def __init__(self, effect: Array, period: float) -> None:
        """List vertices and facets.

        Args:
            effect: (6, N), on-times [s] to impulse and angular impulse.
            period: longest on-time [s].

        Raises:
            ValueError: the nozzles do not make every force and torque.
        """
        if effect.ndim != 2 or effect.shape[0] != 6 or np.linalg.matrix_rank(effect / _row_sizes(effect)) < 6:
            raise ValueError(
                f"the nozzles of this matrix {effect.shape} cannot push and turn in all six degrees of freedom; "
                "at least six with independent forces and torques are needed"
            )
        self._period = period
        scale = _row_sizes(effect)  # forces and torques of like size, so that one tolerance serves
        columns = effect / scale
        self._effect = effect
        self._normals, self._reach = _facets(columns, period)
        if bool(np.any(self._reach <= _SAME * float(self._reach.max()))):
            raise ValueError(
                "the nozzles push or turn one way only in some direction; they must be able to do both ways"
            )
        self._normals = self._normals / scale.T
        self._duals, self._values, self._vertices = _dual_table(columns, scale, period)

    def allocate(self, wrench: Array) -> Allocation:
        """Give the on-times of least sum.

        Args:
            wrench: (6,) wanted impulse [N s] and angular impulse [N m s] of the period, in d.
        """
        loads = self._normals * wrench
        force, torque = loads[:, :3].sum(axis=1), loads[:, 3:].sum(axis=1)
        share = torque_share = 1.0
        if bool(np.any(force + torque > self._reach)):
            torque_share = _largest_share(torque, self._reach)
            share = _largest_share(force, self._reach - torque_share * torque)
            wrench = np.concatenate([share * wrench[:3], torque_share * wrench[3:]])
        vertex = self._vertices[int(np.argmax(self._duals @ wrench + self._values))]
        candidates = (vertex.matrices @ wrench).reshape(vertex.offsets.shape) + vertex.offsets
        slack = np.minimum(candidates, self._period - candidates).min(axis=1)
        on_times: Array = np.minimum(np.maximum(candidates[int(np.argmax(slack))], 0.0), self._period)
        return Allocation(on_times=on_times, wrench=wrench, share=share, torque_share=torque_share)


def _row_sizes(effect: Array) -> Array:
    """Give (6, 1): the size of forces thrice, that of torques thrice."""
    sizes = [float(np.abs(part).max(initial=0.0)) or 1.0 for part in (effect[:3], effect[3:])]
    return np.repeat(sizes, 3)[:, None]


def _largest_share(load: Array, room: Array) -> float:
    """Give the largest factor, at most 1, with `factor * load <= room`."""
    tight = load > room
    if not bool(np.any(tight)):
        return 1.0
    return max(0.0, float((room[tight] / load[tight]).min()) * _INSIDE)


def _facets(columns: Array, period: float) -> tuple[Array, Array]:
    """Give normals (F, 6) of the zonotope of reachable wrenches and how far it reaches along them (F,)."""
    normals = []
    for five in combinations(range(columns.shape[1]), 5):
        _, sizes, rows = np.linalg.svd(columns[:, five].T)
        if sizes[4] > _SINGULAR * sizes[0]:
            normals += [rows[5], -rows[5]]
    stacked = np.unique(np.round(np.array(normals), 12), axis=0)
    reach = period * np.maximum(stacked @ columns, 0.0).sum(axis=1)
    return stacked, reach


def _dual_table(columns: Array, scale: Array, period: float) -> tuple[Array, Array, list[_Vertex]]:
    """Give the vertices (V, 6) of the dual, the constant part (V,) of its value there, and their solutions."""
    n = columns.shape[1]
    solutions: dict[tuple[float, ...], tuple[Array, list[tuple[Array, Array]]]] = {}
    for basis in combinations(range(n), 6):
        chosen = columns[:, basis]
        if np.linalg.cond(chosen) > 1.0 / _SINGULAR:
            continue
        inverse: Array = np.linalg.inv(chosen).astype(np.float64)
        dual: Array = inverse.sum(axis=0)
        key = tuple((np.round(dual / (_SAME * 10.0)) + 0.0).tolist())
        prices: Array = dual @ columns - 1.0
        others = [j for j in range(n) if j not in basis]
        _, found = solutions.setdefault(key, (dual, []))
        found += _basic_solutions(columns, basis, inverse, others, prices, period)
    duals, values, vertices = [], [], []
    for dual, found in solutions.values():
        duals.append(dual / scale[:, 0])
        values.append(-period * float(np.maximum(dual @ columns - 1.0, 0.0).sum()))
        matrices = np.vstack([matrix / scale.T for matrix, _ in found])
        vertices.append(_Vertex(matrices, np.array([offset for _, offset in found])))
    return np.array(duals), np.array(values), vertices


def _basic_solutions(
    columns: Array, basis: tuple[int, ...], inverse: Array, others: list[int], prices: Array, period: float
) -> list[tuple[Array, Array]]:
    """Give u = matrix @ w + offset of a basis; the other nozzles are open or shut, where it makes no odds either."""
    choices = [(0.0, period) if abs(prices[j]) < _SAME else ((period,) if prices[j] > 0.0 else (0.0,)) for j in others]
    matrix = np.zeros((columns.shape[1], 6))
    matrix[list(basis)] = inverse
    found = []
    for values in product(*choices):
        offset = np.zeros(columns.shape[1])
        offset[others] = values
        offset[list(basis)] = -inverse @ (columns[:, others] @ np.array(values))
        found.append((matrix, offset))
    return found
