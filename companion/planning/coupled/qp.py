"""Quadratic programs of a fixed sparsity, on PIQP or OSQP: built once, updated in place.

    minimise 1/2 z' P z + q' z    subject to    A z = b,    G z <= h,    low <= z <= high

with rows of G also bounded from below where `g_low` is finite.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
import osqp
import piqp
from scipy.sparse import coo_matrix, csc_matrix

from companion.geometry.arrays import Array

_INFINITE = 1e29  # both solvers take a larger bound for none


# A rough solution still shows the way: whether it gains anything is judged by the nonlinear model.
_OSQP_USABLE = (
    osqp.SolverStatus.OSQP_SOLVED,
    osqp.SolverStatus.OSQP_SOLVED_INACCURATE,
    osqp.SolverStatus.OSQP_MAX_ITER_REACHED,
)


class QpBackend(Enum):
    """Which solver solves the convex programs."""

    PIQP = "piqp"  # proximal interior point; the faster and the more exact one, see bench/scp.py
    OSQP = "osqp"  # operator splitting; the one of the paper


@dataclass(frozen=True, slots=True, eq=False)
class SparsePattern:
    """A sparse matrix of fixed pattern whose entries are written by their order of declaration."""

    matrix: csc_matrix
    entries: Array  # (nnz,) values in the order of declaration: written by whoever updates the matrix
    _order: np.ndarray[tuple[int], np.dtype[np.intp]]

    @classmethod
    def of(cls, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> SparsePattern:
        """Build from the place of each entry; no place may come twice."""
        count = len(rows)
        numbered = coo_matrix((np.arange(1.0, count + 1.0), (rows, columns)), shape=shape).tocsc()
        numbered.sort_indices()
        if numbered.nnz != count:
            raise ValueError("an entry of a sparse matrix is declared twice")
        return cls(csc_matrix(numbered), np.zeros(count), numbered.data.astype(np.intp) - 1)

    def apply(self) -> csc_matrix:
        """Bring the entries into the matrix, in place."""
        np.take(self.entries, self._order, out=self.matrix.data)
        return self.matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuadraticProgram:
    """The program's numbers; the arrays are written in place between solutions."""

    p: SparsePattern  # upper triangle of P
    q: Array  # (n,)
    a: SparsePattern
    b: Array  # (rows of A,)
    g: SparsePattern
    g_low: Array  # (rows of G,)
    g_high: Array
    low: Array  # (n,)
    high: Array
    boxed: np.ndarray[tuple[int], np.dtype[np.intp]]  # which of z have bounds; the others stay infinite


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QpSolution:
    """What a solver found."""

    z: Array  # (n,)
    usable: bool  # False: z means nothing
    status: str  # in the solver's words
    iterations: int
    residual_primal: float
    residual_dual: float


class QpSolver(Protocol):
    """One program, solved again and again with other numbers."""

    def solve(self, guess: Array | None) -> QpSolution:
        """Solve the program with its present numbers. `guess`: (n,) where to start; None: where the last one ended."""


class PiqpSolver:
    """PIQP: an interior point method, which has no use for a guess.

    Args:
        program: whose numbers are read at each solution.
        tolerance: absolute and relative, of residuals and duality gap.
    """

    def __init__(self, program: QuadraticProgram, tolerance: float) -> None:
        self._program = program
        self._solver = piqp.SparseSolver()
        settings = self._solver.settings
        settings.eps_abs = tolerance
        settings.eps_rel = tolerance
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs = tolerance
        settings.eps_duality_gap_rel = tolerance
        settings.max_iter = 60
        settings.preconditioner_reuse_on_update = True
        self._started = False

    def solve(self, guess: Array | None) -> QpSolution:  # noqa: ARG002
        """See `QpSolver.solve`."""
        p = self._program
        numbers = {
            "P": p.p.apply(),
            "c": p.q,
            "A": p.a.apply(),
            "b": p.b,
            "G": p.g.apply(),
            "h_l": p.g_low,
            "h_u": p.g_high,
            "x_l": p.low,
            "x_u": p.high,
        }
        if self._started:
            self._solver.update(**numbers)
        else:
            self._solver.setup(**numbers)
            self._started = True
        status = self._solver.solve()
        result = self._solver.result
        return QpSolution(
            z=np.array(result.x),
            usable=status == piqp.PIQP_SOLVED,
            status=status.name,
            iterations=int(result.info.iter),
            residual_primal=float(result.info.primal_res),
            residual_dual=float(result.info.dual_res),
        )


class OsqpSolver:
    """OSQP: operator splitting, warm-started from the guess and from its own last multipliers.

    Args:
        program: whose numbers are read at each solution.
        tolerance: absolute and relative, of the residuals.
    """

    def __init__(self, program: QuadraticProgram, tolerance: float) -> None:
        self._program = program
        self._tolerance = tolerance
        self._solver: osqp.OSQP | None = None
        equal, unequal, n = len(program.b), len(program.g_high), len(program.q)
        box = len(program.boxed)
        a, g = program.a.matrix.tocoo(), program.g.matrix.tocoo()
        self._stack = SparsePattern.of(
            np.concatenate((a.row, g.row + equal, np.arange(box) + equal + unequal)),
            np.concatenate((a.col, g.col, program.boxed)),
            (equal + unequal + box, n),
        )
        self._stack.entries[a.nnz + g.nnz :] = 1.0

    def solve(self, guess: Array | None) -> QpSolution:
        """See `QpSolver.solve`."""
        p = self._program
        p.p.apply()
        a, g = p.a.apply().data, p.g.apply().data
        self._stack.entries[: len(a)] = a
        self._stack.entries[len(a) : len(a) + len(g)] = g
        matrix = self._stack.apply()
        low = np.concatenate((p.b, p.g_low, p.low[p.boxed]))
        high = np.concatenate((p.b, p.g_high, p.high[p.boxed]))
        if self._solver is None:
            self._solver = osqp.OSQP()
            self._solver.setup(
                p.p.matrix,
                p.q,
                matrix,
                low,
                high,
                verbose=False,
                eps_abs=self._tolerance,
                eps_rel=self._tolerance,
                max_iter=1000,
                check_termination=10,
                adaptive_rho=True,
                adaptive_rho_interval=50,  # counted, not timed: the same numbers give the same bytes
                polishing=False,
            )
        else:
            self._solver.update(q=p.q, l=low, u=high, Px=p.p.matrix.data, Ax=matrix.data)
        if guess is not None:
            self._solver.warm_start(x=guess)
        result = self._solver.solve(raise_error=False)
        return QpSolution(
            z=np.array(result.x, dtype=np.float64),
            usable=result.info.status_val in _OSQP_USABLE and bool(np.isfinite(result.x).all()),
            status=str(result.info.status),
            iterations=int(result.info.iter),
            residual_primal=float(result.info.prim_res),
            residual_dual=float(result.info.dual_res),
        )


SolverFactory = Callable[[QuadraticProgram, float], QpSolver]

SOLVERS: dict[QpBackend, SolverFactory] = {QpBackend.PIQP: PiqpSolver, QpBackend.OSQP: OsqpSolver}

# What each reaches without a long tail: an interior point method gains an order with each iteration or two.
TOLERANCES = {QpBackend.PIQP: 1e-6, QpBackend.OSQP: 1e-4}
