"""Digits lost by rounding where the skin is stiff: contrast 1e-9 to 1e9, contact impedance 1e-9 to 1e6 Ohm m, a cut,
anisotropy of 1e4 to 1e8.

The impedance matrix by elimination of weights (eitsim) and by LU of the system's matrix (SuperLU in symmetric mode),
each without and with refinements whose residuals are summed from differences of potentials, against potentials refined
in extended precision until they settle. The contrast is that of a disc, or of a row of elements that cuts the sheet in
two; the anisotropy that of tensors everywhere, the ratio of their eigenvalues, whose axes turn from place to place.
reference_change is what the last refinement in extended precision changed; digits_lost is of the matrix next to its
largest entry, resistance_error the largest relative error of the resistance between two electrodes; condition that of
the earthed matrix in the 1-norm, estimated. Run by `make bench`; writes results/electrics_stiff.csv next to this file.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from conditions import quick, written
from scipy.sparse import csc_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, onenormest, splu

from eitsim.electrics.cem.assembly import SkinMesh, dissection, eliminated, impedance, quadrature_points
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.numerics.conductor_elimination import Elimination, residual, solve
from eitsim.scene.scene import Body, Electrodes

BODY, ELECTRODES = Body(), Electrodes()
COUNT = ELECTRODES.count
CENTRE = np.eye(COUNT) - 1 / COUNT
CONTRASTS = quick((1e-9, 1e-6, 1.0, 1e6, 1e9), (1e-9, 1.0, 1e9))
CONTACTS_OHM_M = quick((1e-9, 1e-6, 1.0, 1e6), (1e-9, 1e6))
CUTS = quick((1e-3, 1e-6, 1e-9, 1e-12, 1e-18, 1e-100), (1e-9,))
ANISOTROPIES = quick((1e4, 1e6, 1e8), (1e8,))
SHEET_S = 1e-3
REFINEMENTS = (0, 1, 2)
# Refinements in extended precision until the last changes less than 5e-16, and what the last of them may change where
# rounding of its sums keeps it from settling: what is told of smaller errors is then that of the reference.
MOST_STEPS, MOST_CHANGE = 10, 1e-12


def rings(level: int) -> SkinMesh:
    """Concentric rings of quadratic elements."""
    angles, electrode = rim_angles(BODY, ELECTRODES, level)
    radii = np.linspace(0, BODY.radius_m, 5 * level + 1)
    return ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, ELECTRODES.count)


def triangles(level: int) -> SkinMesh:
    """The nodes of `rings` as linear triangles."""
    mesh = rings(level)
    quarters = [(0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)]
    thirds = [mesh.cells[:, [q[i] for i in corner]] for q in quarters for corner in ((0, 1, 2), (0, 2, 3))]
    cells = np.concatenate([t[(t[:, 0] != t[:, 1]) & (t[:, 1] != t[:, 2]) & (t[:, 0] != t[:, 2])] for t in thirds])
    edges = np.concatenate([mesh.under[:, [0, 2]], mesh.under[:, [2, 1]]])
    return replace(mesh, cells=cells, under=edges, electrode=np.tile(mesh.electrode, 2), element="P1")


def system(done: Elimination) -> csc_matrix:
    """The matrix of a network, its last unknown earthed."""
    pairs, place = done.dissection.pairs, np.arange(len(done.weights))
    difference = csc_matrix((np.repeat([1.0, -1.0], len(pairs)), (np.tile(place, 2), pairs.T.ravel())))
    return csc_matrix((difference.T @ diags_array(done.weights) @ difference)[:-1, :-1])


def extended(done: Elimination, currents: np.ndarray) -> tuple[np.ndarray, float]:
    """Impedance matrix with iterates and residuals in long doubles, and what the last refinement changed, relative."""
    (one, other), weight = done.dissection.pairs.T, done.weights.astype(np.longdouble)[:, None]
    x, change = np.zeros(currents.shape, dtype=np.longdouble), np.inf
    for _ in range(MOST_STEPS):
        left = currents.astype(np.longdouble)
        flow = weight * (x[one] - x[other])
        np.subtract.at(left, one, flow)
        np.add.at(left, other, flow)
        step = solve(done, left.astype(float))
        x += step
        change = float(np.abs(step[-COUNT:]).max() / np.abs(x[-COUNT:]).max())
        if change < 5e-16:
            break
    if change < MOST_CHANGE:
        return CENTRE.astype(np.longdouble) @ x[-COUNT:], change
    raise ArithmeticError(f"{MOST_STEPS} refinements in extended precision do not settle")


def by_lu(done: Elimination, currents: np.ndarray) -> Callable[[int], np.ndarray]:
    """Impedance matrix by LU, given the number of refinements."""
    factors = splu(system(done), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def found(refinements: int) -> np.ndarray:
        x = np.zeros_like(currents)
        for _ in range(1 + refinements):
            x[:-1] += factors.solve(residual(done, currents, x)[:-1])
        return CENTRE @ x[-COUNT:]

    return found


def condition(done: Elimination) -> float:
    """Estimate in the 1-norm; the inverse is applied by elimination."""
    matrix = system(done)

    def inverse(b: np.ndarray) -> np.ndarray:
        return solve(done, np.vstack([b.reshape(len(b), -1), np.zeros((1, b.size // len(b)))]))[:-1].reshape(b.shape)

    by = {"matvec": inverse, "rmatvec": inverse, "matmat": inverse}
    applied = LinearOperator(matrix.shape, **by, dtype=float)  # pyright: ignore[reportCallIssue]
    return float(onenormest(matrix)) * float(onenormest(applied))


def turned(mesh: SkinMesh, ratio: float) -> np.ndarray:
    """Tensors with eigenvalues SHEET_S and ratio times that, at the quadrature points; the larger one's axis turns by
    the square of the distance from the middle."""
    x, y = np.moveaxis(quadrature_points(mesh) / BODY.radius_m, -1, 0)
    angle = 0.4 + 2 * (x**2 + y**2)
    axis = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return SHEET_S * (np.eye(2) + (ratio - 1) * axis[..., :, None] * axis[..., None, :])


def rows(mesh: SkinMesh, case: str, conductance: np.ndarray, contrast: float,
         contact: float) -> Iterator[dict[str, object]]:
    order = dissection(mesh)
    done = eliminated(mesh, conductance, contact, order=order)
    given = {"elements": f"{mesh.element}, {len(mesh.cells)}", "of": case, "contrast": contrast, "z_Ohm_m": contact,
             "condition": condition(done)}
    try:
        impedance(mesh, conductance, contact, order=order)
    except ValueError as refused:
        yield {**given, "method": "eitsim", "outcome": f"refused: {refused}"}
        return
    currents = np.zeros((len(mesh.nodes_m) + COUNT, COUNT))
    currents[-COUNT:] = CENTRE
    exact, change = extended(done, currents)
    methods = {"eitsim": lambda n: impedance(mesh, conductance, contact, order=order, refinements=n),
               "LU": by_lu(done, currents)}
    for (method, found), refinements in itertools.product(methods.items(), REFINEMENTS):
        z = found(refinements)
        error = float(np.abs(z - exact).max() / np.abs(exact).max())
        yield {**given, "method": method, "refinements": refinements, "error": error, "reference_change": change,
               "digits_lost": float(np.clip(np.log10(error / np.finfo(float).eps), 0.0, 16.0)),
               "resistance_error": float(np.abs(resistances(z) / resistances(exact) - 1).max()), "outcome": "solved"}


def resistances(z: np.ndarray) -> np.ndarray:
    """Between every two electrodes."""
    between = np.add.outer(np.diagonal(z), np.diagonal(z)) - 2 * z
    return between[~np.eye(COUNT, dtype=bool)]


def main() -> None:
    table: list[dict[str, object]] = []
    for mesh in (triangles(2), rings(2)):
        middle = mesh.nodes_m[mesh.cells].mean(axis=1)
        disc = np.hypot(middle[:, 0] - 0.025, middle[:, 1] - 0.01) < 0.015
        cut = np.ptp(np.sign(mesh.nodes_m[mesh.cells][..., 0] - 0.0213), axis=1) > 0
        for contrast, contact in itertools.product(CONTRASTS, CONTACTS_OHM_M):
            table += rows(mesh, "disc of 15 mm", np.where(disc, SHEET_S * contrast, SHEET_S), contrast, contact)
        for contrast in CUTS:
            table += rows(mesh, "cut", np.where(cut, SHEET_S * contrast, SHEET_S), contrast, 1.0)
        for ratio in ANISOTROPIES:
            table += rows(mesh, "turned tensors", turned(mesh, ratio), ratio, 1.0)
    frame = written(table, "electrics_stiff", 3)
    print(frame[frame["outcome"] != "solved"].to_string(index=False))
    wide = frame.pivot_table(index=["elements", "of", "contrast", "z_Ohm_m", "condition"],
                             columns=["method", "refinements"], values="digits_lost")
    print(wide.to_string(float_format=lambda v: f"{v:.3g}"))


if __name__ == "__main__":
    main()
