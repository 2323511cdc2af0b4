"""What a disc with electrodes on the whole height of its rim reads, untouched and deformed, in three dimensions.

By scikit-fem alone, with nothing of eitsim: quadratic tetrahedra on the untouched disc, complete electrode model,
conductivity J F^-1 s F^-T of the deformed layer. Lengths in mm, conductivity in S/m: impedances times mm are Ohm times
1000.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay
from skfem import Basis, BilinearForm, ElementTetP2, FacetBasis, LinearForm, MeshTet

Array = np.ndarray
Strained = Callable[[Array], Array]  # F (n, 3, 3) -> conductivity s (n, 3, 3) of the deformed layer


class Deformed(Protocol):
    """A deformation about an axis."""

    def gradient(self, radius: Array, height: Array) -> Array:
        """F (n, 3, 3) along r, z and around at radii and heights (n,), mm, the top at 0."""
        ...


def changed(pressed: Deformed, thickness: float, disc: float, at: float, electrodes: int, width: float, contact: float,
            sigma: float, laws: list[Strained], *, fine: float = 0.5, levels: int = 5) -> tuple[Array, list[Array]]:
    """Impedance matrices (N, N), Ohm, of the untouched disc, and what a touch at (at, 0) changes of it by each law.

    contact: contact impedance, S^-1 m mm, of electrodes on the whole height of the rim; sigma: conductivity at rest.
    """
    points, edge = _points(disc, at, electrodes, width, fine)
    triangles = Delaunay(points).simplices
    heights = -thickness * np.cos(np.linspace(0, np.pi / 2, levels))
    mesh = _tetrahedra(points, triangles, heights)
    basis = Basis(mesh, ElementTetP2(), intorder=3)
    where = np.asarray(basis.global_coordinates())
    x, y, z = where[0] - at, where[1], where[2]
    radius = np.hypot(x, y)
    f = pressed.gradient(radius.ravel(), z.ravel())
    turn = np.zeros_like(f)
    safe = np.maximum(radius, 1e-12).ravel()
    cos, sin = x.ravel() / safe, y.ravel() / safe
    turn[:, 0, 0], turn[:, 1, 0], turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 2] = cos, sin, 1, -sin, cos
    out = []
    for law in [lambda f: sigma * np.broadcast_to(np.eye(3), f.shape), *laws]:
        back = np.linalg.inv(f) if out else np.broadcast_to(np.eye(3), f.shape)
        jacobian = np.linalg.det(f)[:, None, None] if out else 1.0
        s = turn @ (jacobian * back @ law(f) @ np.swapaxes(back, 1, 2)) @ np.swapaxes(turn, 1, 2)
        out.append(_impedance(basis, np.moveaxis(s, 0, -1).reshape(3, 3, *radius.shape), edge, contact) * 1e3)
    return out[0], [one - out[0] for one in out[1:]]


def _points(disc: float, at: float, electrodes: int, width: float, fine: float
            ) -> tuple[Array, Callable[[Array], Array]]:
    """Points (n, 2) of the disc, fine about the touch and at the ends of electrodes; and of angles, the electrode
    there, or -1."""
    half, spacing = width / disc / 2, 2 * np.pi / electrodes
    graded = half * np.sin(np.linspace(-np.pi / 2, np.pi / 2, 9))
    between = half + (spacing - 2 * half) * (1 - np.cos(np.linspace(0, np.pi, 9))) / 2
    rim = (spacing * np.arange(electrodes)[:, None] + np.append(graded, between[1:-1])).ravel()
    rings = [disc * np.stack([np.cos(rim), np.sin(rim)], 1)]
    step, radius = disc * spacing / 16, disc
    turned = 0.0
    while radius > step:
        radius -= step
        count = max(6, round(2 * np.pi * radius / step))
        turned += 0.37
        angle = turned + 2 * np.pi * np.arange(count) / count
        rings.append(radius * np.stack([np.cos(angle), np.sin(angle)], 1))
        step = min(step * 1.25, disc / 12)
    around, size, radius = [np.array([[at, 0.0]])], fine, 0.0
    while radius + size < min(3.2 * fine * 8, disc - at - 2 * fine):
        radius += size
        count = max(6, round(2 * np.pi * radius / size))
        angle = 0.3 * radius + 2 * np.pi * np.arange(count) / count
        around.append(np.array([at, 0.0]) + radius * np.stack([np.cos(angle), np.sin(angle)], 1))
        size = fine * max(1.0, radius / (8 * fine))
    outer = np.concatenate(rings)
    outer = outer[(np.hypot(outer[:, 0] - at, outer[:, 1]) > radius + size / 2) | (np.arange(len(outer)) < len(rim))]

    def electrode(angle: Array) -> Array:
        k = np.round(angle / spacing).astype(int)
        return np.where(np.abs(angle - k * spacing) < half, k % electrodes, -1)

    return np.concatenate([outer, *around]), electrode


def _tetrahedra(points: Array, triangles: Array, heights: Array) -> MeshTet:
    """Three tetrahedra a prism, cut by the order of its corners so that neighbours fit."""
    count, n = len(points), len(heights)
    p = np.concatenate([np.column_stack([points, np.full(count, z)]) for z in heights])
    a, b, c = np.sort(triangles, axis=1).T
    cells = []
    for k in range(n - 1):
        low, high = k * count, (k + 1) * count
        cells += [np.stack(one) for one in (
            (a + low, b + low, c + low, c + high), (a + low, b + low, b + high, c + high),
            (a + low, a + high, b + high, c + high))]
    return MeshTet(p.T.copy(), np.concatenate(cells, axis=1))


@BilinearForm
def _flow(u, v, w):
    return np.einsum("ij...,j...,i...->...", w["s"], u.grad, v.grad)


@BilinearForm
def _through(u, v, w):
    return u * v


@LinearForm
def _onto(v, w):
    return 1.0 * v


def _impedance(basis: Basis, s: Array, electrode: Callable[[Array], Array], contact: float) -> Array:
    """Complete electrode model: nodes eliminated, then the pseudo-inverse of what joins the electrodes."""
    mesh = basis.mesh
    facets = mesh.boundary_facets()
    middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    flat = np.ptp(mesh.p[2, mesh.facets[:, facets]], axis=0) < 1e-9
    under = np.where(flat, -1, electrode(np.arctan2(middle[1], middle[0])))
    a = _flow.assemble(basis, s=s)
    loads, areas = [], []
    for k in range(under.max() + 1):
        face = FacetBasis(mesh, ElementTetP2(), facets=facets[under == k], intorder=4)
        a = a + _through.assemble(face) / contact
        loads.append(_onto.assemble(face) / contact)
        areas.append(loads[-1].sum())
    b = np.stack(loads, axis=1)
    joined = np.diag(areas) - b.T @ splu(csc_matrix(a)).solve(b)
    return np.linalg.pinv((joined + joined.T) / 2, rcond=1e-10)
