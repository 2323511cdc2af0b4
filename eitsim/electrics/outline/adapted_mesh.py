"""The untouched skin with an outline: a mesh that its own solution refines until the readings are as exact as asked."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from skfem import ElementTriP2

from eitsim.electrics.cem.adjoint import impedance_by_contact
from eitsim.electrics.cem.assembly import Array, SkinMesh, dissection, impedance, potentials
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.outline.triangles import Triangles, cut, refined, skin_mesh, triangulated
from eitsim.numerics.nested_dissection import Dissection
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.polygons import area_m2
from eitsim.scene.scene import Electrodes
from touchcal.errors import NotConverged

READINGS = 1e-4  # Relative error of the readings between neighbouring electrodes that is asked for.
_CONTACTS = 1e-5  # The same where contact impedances vary.
_FIRST = 300  # Triangles of the first mesh, about, of even size.
_LEFT = 0.5  # What halving once more leaves of the change by halving, at most.
_STEPS = 30  # Refinements, at most.
_SHARE = 0.25  # Part of the mean indicator that no triangle is to exceed.


@dataclass(frozen=True, eq=False)
class Untouched:
    """A uniform skin with an outline, solved."""

    impedance_Ohm: Array  # (N, N) impedance, Ohm, on the halved mesh
    error: float  # estimated relative error of the readings between neighbouring electrodes
    nodes: int  # nodes of that mesh
    triangles: Triangles  # the mesh before it was halved
    history: tuple[tuple[Triangles, float], ...]  # meshes from the first one, and the estimated error on each


@lru_cache(maxsize=16)
def solve_untouched(outline: Outline, electrodes: Electrodes, conductance_S: float, error: float) -> Untouched:
    """Solve the complete electrode model of a uniform skin of sheet conductance S, S, with P2 triangles.

    Every triangle is cut to the size at which its part of the energy's error, the squared difference of the gradient
    from its average at the corners, summed over electrodes, would be even. The error is that of all readings of four
    electrodes, neighbours by their numbers, 2-norm: _LEFT times the change by halving the mesh, which is solved as
    well. NotConverged where it stays above `error`.
    """
    z = contact_impedances(electrodes)
    even = area_m2(outline) / _FIRST
    triangles = refined(triangulated(outline, electrodes), lambda places_m: np.full(len(places_m), even))
    history = []
    for _ in range(_STEPS):
        mesh = skin_mesh(triangles, electrodes)
        potential = potentials(mesh, np.full(len(mesh.cells), conductance_S), z)
        coarse = potential[-mesh.count:] - potential[-mesh.count:].mean(axis=0)
        halved = uniform_refinement(mesh)
        order = order_of_halved(triangles, electrodes)
        fine = impedance(halved, np.full(len(halved.cells), conductance_S), z, order=order)
        found = _LEFT * readings_difference(coarse, fine)
        history.append((triangles, found))
        if found <= error:
            fine.flags.writeable = False
            return Untouched(fine, found, len(halved.nodes_m), triangles, tuple(history))
        triangles = cut(triangles, _limit(triangles, indicators(mesh, potential)))
    raise NotConverged(f"the readings of the untouched skin are known to {found:.1e} only, {error:g} was asked for; "
                       "give wider electrodes or larger contact impedances.")


@lru_cache(maxsize=1)
def order_of_halved(triangles: Triangles, electrodes: Electrodes) -> Dissection:
    """Order of elimination of a halved mesh of triangles, wherever its middle nodes are; the last one is kept, since
    the untouched readings and what electrodes send take the same."""
    return dissection(uniform_refinement(skin_mesh(triangles, electrodes)))


def impedance_by_log_contact(outline: Outline, electrodes: Electrodes, conductance_S: float) -> Array:
    """dZ/dlog z_e (N, N, N), Ohm, e first, of the untouched skin, on a mesh finer than its readings need: currents that
    crowd at the ends of electrodes count twice. On a disc given as a polygon within 0.3 %, 2-norm."""
    z = contact_impedances(electrodes)
    found = solve_untouched(outline, electrodes, conductance_S, _CONTACTS)
    mesh = uniform_refinement(skin_mesh(found.triangles, electrodes))
    potential = potentials(mesh, np.full(len(mesh.cells), conductance_S), z)
    return impedance_by_contact(mesh, potential, z) * z[:, None, None]


def readings_difference(one: Array, other: Array) -> float:
    """Relative difference, 2-norm, of the readings of two impedance matrices between neighbours by number, those of an
    electrode that carries current left out."""
    count = len(other)
    step = np.eye(count) - np.roll(np.eye(count), -1, axis=0)
    shared = np.abs(step) @ np.abs(step).T > 0
    change, whole = (np.where(shared, 0.0, step @ z @ step.T) for z in (one - other, other))
    return float(np.linalg.norm(change) / np.linalg.norm(whole))


def indicators(mesh: SkinMesh, potential: Array) -> Array:
    """(t,) squared difference, over each P2 triangle with straight edges, of the gradient and its mean at the corners,
    summed over the potentials."""
    gradient, area = _corner_gradients(mesh, potential[:len(mesh.nodes_m)])
    corner = mesh.cells[:, :3].ravel()
    count = int(mesh.cells[:, :3].max()) + 1
    weight = np.repeat(area, 3)
    flat = gradient.reshape(len(corner), -1)
    total = np.zeros((count, flat.shape[1]))
    np.add.at(total, corner, weight[:, None] * flat)
    mean = total / np.bincount(corner, weight, count)[:, None]
    away = (flat - mean[corner]).reshape(len(area), 3, -1)
    # int |sum_i d_i l_i|^2 over a triangle is its area / 12 times sum_i |d_i|^2 + |sum_i d_i|^2
    return area / 12 * (np.sum(away**2, axis=(1, 2)) + np.sum(away.sum(axis=1) ** 2, axis=1))


def _corner_gradients(mesh: SkinMesh, potential: Array) -> tuple[Array, Array]:
    """Gradients (t, 3, 2, k) of nodal potentials (n, k) at the corners of P2 triangles with straight edges, and the
    triangles' areas (t,)."""
    at = ElementTriP2().doflocs[:3].T
    slope = np.stack([np.broadcast_to(ElementTriP2().lbasis(at, i)[1], at.shape).T for i in range(6)], axis=1)
    a, b, c = np.moveaxis(mesh.nodes_m[mesh.cells[:, :3]], 1, 0)
    jacobian = np.stack([b - a, c - a], axis=-1)
    local = np.einsum("nkb,ekp->enbp", slope, potential[mesh.cells], optimize=True)
    return np.linalg.inv(jacobian).swapaxes(-1, -2)[:, None] @ local, np.abs(np.linalg.det(jacobian)) / 2


def _limit(mesh: Triangles, indicator: Array) -> Array:
    """Area (t,), m^2, of each triangle after the next refinement: its indicator goes as the cube of the area where the
    potential is smooth."""
    goal = _SHARE * indicator.mean()
    return mesh.area_m2 * np.minimum(np.cbrt(goal / np.maximum(indicator, np.finfo(float).tiny)), 1.0)
