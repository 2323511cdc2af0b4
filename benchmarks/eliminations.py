"""The elimination of a skin's network against factors by SuperLU, CHOLMOD and PARDISO: CPU time and digits.

All get the impedance matrix of 16 electrodes from the same weights. The order of a mesh is found once in each (SuperLU
cannot keep it), then the weights are eliminated anew, as for each touch. digits_lost: of the resistances, at contrasts
of 1 and of 1e9 (a disc that conducts less), against the elimination refined in extended precision. CHOLMOD needs
scikit-sparse, PARDISO pypardiso; those that lack are left out. Run by `make bench`; writes results/eliminations.csv.
"""

import importlib
import importlib.util
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from conditions import quick, written
from electrics_stiff import CENTRE, COUNT, ELECTRODES, extended, rings, system
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

from eitsim.electrics.cem.assembly import dissection, quadrature_points, weights
from eitsim.numerics.conductor_elimination import eliminate, impedance_alone

LEVELS = quick((2, 4, 8), (2,))
REPEATS = quick(7, 2)
CURRENTS = CENTRE[:-1]
Again = Callable[[csc_matrix], np.ndarray]


def loads(size: int) -> np.ndarray:
    """Currents (size, count) into the electrodes but the last, which is earthed."""
    out = np.zeros((size, COUNT))
    out[-(COUNT - 1):] = CURRENTS
    return out


def electrodes(potential: np.ndarray) -> np.ndarray:
    """The impedance matrix from the electrodes' potentials (count - 1, count), the last at zero."""
    found = np.vstack([potential[-(COUNT - 1):], np.zeros(COUNT)])
    return found - found.mean(axis=0)


def superlu(matrix: csc_matrix) -> Again:
    """A factor in symmetric mode, its order found each time."""
    return lambda A: electrodes(splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                                     options={"SymmetricMode": True}).solve(loads(len(A.indptr) - 1)))


def cholmod(matrix: csc_matrix) -> Again:
    """A Cholesky factor whose order is kept."""
    factor = importlib.import_module("sksparse.cholmod").analyze(matrix)
    return lambda A: electrodes(factor.cholesky(A)(loads(len(A.indptr) - 1)))


def pardiso(matrix: csc_matrix) -> Again:
    """A symmetric positive definite factor whose analysis is kept."""
    from pypardiso import PyPardisoSolver  # pyright: ignore[reportMissingImports]
    from scipy.sparse import triu
    solver = PyPardisoSolver(mtype=2)
    upper = csr_matrix(triu(matrix, format="csr"))
    right = np.asfortranarray(loads(len(matrix.indptr) - 1))
    solver.set_phase(11)
    solver._call_pardiso(upper, right)

    def again(A: csc_matrix) -> np.ndarray:
        upper = csr_matrix(triu(A, format="csr"))
        solver.set_phase(22)
        solver._call_pardiso(upper, right)
        solver.set_phase(33)
        return electrodes(solver._call_pardiso(upper, right))
    return again


# peer -> how it is made, the package it is of
PEERS = {"superlu": (superlu, "scipy"), "cholmod": (cholmod, "sksparse"), "pardiso": (pardiso, "pypardiso")}


def between(z: np.ndarray) -> np.ndarray:
    """Resistances between electrodes."""
    own = np.diagonal(z)
    return (own[:, None] + own - 2 * z)[np.triu_indices(COUNT, 1)]


def timed(solve: Callable[[], np.ndarray]) -> tuple[np.ndarray, float]:
    """What a solver finds, and the least CPU time of several runs."""
    spent = []
    for _ in range(REPEATS):
        began = time.process_time()
        found = solve()
        spent.append(time.process_time() - began)
    return found, min(spent)


def main() -> None:
    rows = []
    for level in LEVELS:
        mesh = rings(level)
        began = time.process_time()
        order = dissection(mesh)
        order_s = time.process_time() - began
        for contrast in (1.0, 1e9):
            x, y = np.moveaxis(quadrature_points(mesh), -1, 0)
            sheet = np.where(np.hypot(x - 0.02, y) < 0.03, 1 / contrast, 1.0) * 1e-3
            w = weights(mesh, sheet, 1.0)
            done = eliminate(order, w)
            matrix = system(done)
            currents = np.zeros((len(matrix.indptr), COUNT))
            currents[-COUNT:] = CENTRE
            exact = extended(done, currents)[0][-COUNT:]
            exact -= exact.mean(axis=0)
            solvers = {"eitsim": (partial(impedance_alone, order, w, COUNT), order_s)}
            for name, (make, package) in PEERS.items():
                if importlib.util.find_spec(package):
                    began = time.process_time()
                    again = make(matrix)
                    solvers[name] = (partial(again, matrix), time.process_time() - began)
            for name, (solve, once_s) in solvers.items():
                z, spent = timed(solve)
                off = float(np.max(np.abs(between(z) / between(exact) - 1)))
                rows.append({"electrodes": ELECTRODES.count, "unknowns": len(matrix.indptr) - 1, "contrast": contrast,
                             "by": name, "order_cpu_s": once_s, "cpu_s": spent, "resistance_error": off,
                             "digits_lost": max(0.0, np.log10(max(off, 1e-17) / np.finfo(float).eps))})
    print(written(rows, "eliminations").drop(columns=["machine", "versions", "date", "code"]).to_string(index=False))


if __name__ == "__main__":
    main()
