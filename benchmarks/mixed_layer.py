"""Force of a frictionless sphere on a bonded neo-Hookean layer that keeps its volume, by an element that is not ours.

Displacement and pressure are Taylor-Hood (quadrilaterals, 9 and 4 nodes) in scikit-fem, axisymmetric, at finite strain:
the stationary point of mu/2 (tr F'F - 3) - p (det F - 1), the sphere held off by a penalty on the penetration along its
normal. Its force at penalties of k and 3 k is carried to none of 1/k. eitsim takes the same touch at nu = 0.4995, as of
a card with nu = 1/2, and at 0.49999. Columns: force of the mixed element, what half its element size and what 1/k
changed in it, and how far eitsim's forces are off. Run by `make bench`, which pins threads; writes
results/mixed_layer.csv.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from conditions import quick, shown, written
from scipy.sparse import bmat
from scipy.sparse.linalg import splu
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad1,
    ElementQuad2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshQuad,
)

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.pressing import Punch
from eitsim.scene.scene import Body
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.volumetric import nearly_incompressible

THICKNESS_M, MU_PA = 0.01, 1e4
REACH = 8.0  # radius of the meshed layer, in thicknesses
STIFFNESS, GROWTH = 1e3, 1.15  # of the softer penalty, over mu and the radius of contact; of elements far away
TOUCHES = ((10.0, 0.5), (20.0, 1.0), (5.0, 1.0), (10.0, 2.0))  # radius of the sphere, depth, mm
STEPS, NEWTON, SMALL = 4, 12, 1e-9  # first steps to the depth, iterations of each, change that ends them


@dataclass(frozen=True)
class Mixed:
    """The layer, lengths over its thickness and stresses over mu, and the sphere."""

    displacement: Basis
    pressure: Basis
    face: FacetBasis  # the free face
    free: np.ndarray  # unknowns of displacement and pressure that are not held
    sphere: float  # radius

    def equations(self, u: np.ndarray, p: np.ndarray, depth: float, stiffness: float) -> tuple[np.ndarray, Any]:
        """Residual and tangent."""
        at = {"u": self.displacement.interpolate(u), "p": self.pressure.interpolate(p)}
        face = {"u": self.face.interpolate(u), "depth": depth, "sphere": self.sphere, "k": stiffness}
        residual = np.r_[balance.assemble(self.displacement, **at) + held_off.assemble(self.face, **face),
                         volume.assemble(self.pressure, **at)]
        coupling = pressure_work.assemble(self.displacement, self.pressure, **at)
        stiff = stiffness_form.assemble(self.displacement, **at) + contact.assemble(self.face, **face)
        return residual, bmat([[stiff, coupling.T], [coupling, None]], format="csr")

    def force(self, u: np.ndarray, depth: float, stiffness: float) -> float:
        """What presses the sphere up, over mu and the thickness squared."""
        face = {"u": self.face.interpolate(u), "depth": depth, "sphere": self.sphere, "k": stiffness}
        nodal = held_off.assemble(self.face, **face)
        return float(nodal[self.displacement.get_dofs().all(["u^2"])].sum())


def gradient(field, r):
    """F - 1 of a displacement field: in the plane (2, 2), and around."""
    return field.grad, field[0] / r


def state(w):
    (a, around), r = gradient(w["u"], w.x[0]), w.x[0]
    f = np.array([[1 + a[0, 0], a[0, 1]], [a[1, 0], 1 + a[1, 1]]])
    return f, 1 + around, f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0], 2 * np.pi * r


def cofactor(f):
    return np.array([[f[1, 1], -f[1, 0]], [-f[0, 1], f[0, 0]]])


def dot(a, b):
    return np.einsum("ij...,ij...->...", a, b)


def of_volume(f, around, plane, h, h_around):
    """Change of det F with a change (h, h_around) of F."""
    return around * dot(cofactor(f), h) + plane * h_around


@LinearForm
def balance(v, w):
    f, around, plane, ring = state(w)
    h, h_around = gradient(v, w.x[0])
    return ring * (dot(f, h) + around * h_around - w["p"] * of_volume(f, around, plane, h, h_around))


@LinearForm
def volume(q, w):
    _, around, plane, ring = state(w)
    return -ring * q * (around * plane - 1)


@BilinearForm
def pressure_work(v, q, w):
    f, around, plane, ring = state(w)
    return -ring * q * of_volume(f, around, plane, *gradient(v, w.x[0]))


@BilinearForm
def stiffness_form(u, v, w):
    f, around, _, ring = state(w)
    (g, g_around), (h, h_around) = gradient(u, w.x[0]), gradient(v, w.x[0])
    second = h_around * dot(cofactor(f), g) + g_around * dot(cofactor(f), h) + around * dot(cofactor(g), h)
    return ring * (dot(g, h) + g_around * h_around - w["p"] * second)


def penetration(w):
    """Of the sphere, its normal, and the distance from its centre."""
    r, z = w.x[0] + w["u"][0], w.x[1] + w["u"][1] - (w["sphere"] - w["depth"])
    far = np.hypot(r, z)
    return np.maximum(w["sphere"] - far, 0.0), np.array([r, z]) / far, far


@LinearForm
def held_off(v, w):
    inside, normal, _ = penetration(w)
    return -2 * np.pi * w.x[0] * w["k"] * inside * (normal[0] * v[0] + normal[1] * v[1])


@BilinearForm
def contact(u, v, w):
    inside, normal, far = penetration(w)
    along = (normal[0] * u[0] + normal[1] * u[1]) * (normal[0] * v[0] + normal[1] * v[1])
    touching = inside > 0
    return 2 * np.pi * w.x[0] * w["k"] * (touching * along - inside / far * (u[0] * v[0] + u[1] * v[1] - along))


def mixed(sphere: float, contact_radius: float, element: float) -> Mixed:
    """Elements of one size to 1.3 contact radii and half of one deep, growing from there on."""
    r = graded(element, 1.3 * contact_radius, REACH)
    z = -graded(element, contact_radius / 2, 1.0)[::-1]
    mesh = MeshQuad.init_tensor(r, z).with_boundaries({
        "axis": lambda x: x[0] == 0, "base": lambda x: x[1] == -1, "face": lambda x: x[1] == 0})
    displacement = Basis(mesh, ElementVector(ElementQuad2()), intorder=5)
    pressure = displacement.with_element(ElementQuad1())
    face = FacetBasis(mesh, displacement.elem, facets=mesh.boundaries["face"], intorder=3)
    held = np.r_[displacement.get_dofs("base").all(), displacement.get_dofs("axis").all(["u^1"])]
    return Mixed(displacement, pressure, face, np.setdiff1d(np.arange(displacement.N + pressure.N), held), sphere)


def graded(element: float, fine: float, end: float) -> np.ndarray:
    """Coordinates from 0 to `end`, equal steps up to `fine`."""
    steps = [element] * int(np.ceil(fine / element))
    while sum(steps) < end:
        steps.append(steps[-1] * GROWTH)
    out = np.r_[0.0, np.cumsum(steps)]
    out[-1] = end
    return out if out[-1] - out[-2] > 0.5 * steps[-1] else np.delete(out, -2)


def solved(layer: Mixed, depth: float, stiffness: float) -> tuple[float, float]:
    """Force at a depth with this penalty and three times it, in steps that are halved where Newton's method fails."""
    u, p = np.zeros(layer.displacement.N), np.ones(layer.pressure.N)  # p = 1 balances mu at rest
    reached, step = 0.0, depth / STEPS
    while reached < depth:
        step = min(step, depth - reached)
        found = newton(layer, u, p, reached + step, stiffness)
        if found is None:
            step /= 2
            if step < 1e-3 * depth:
                raise RuntimeError(f"no convergence at a depth of {reached + step:g} thicknesses")
            continue
        u, p = found
        reached, step = depth if reached + step > depth * (1 - 1e-12) else reached + step, 1.5 * step
    found = newton(layer, u, p, depth, 3 * stiffness)
    if found is None:
        raise RuntimeError("no convergence with the stiffer penalty")
    return layer.force(u, depth, stiffness), layer.force(found[0], depth, 3 * stiffness)


def newton(layer: Mixed, u: np.ndarray, p: np.ndarray, depth: float, stiffness: float):
    """Displacement and pressure at a depth from those nearby; None where they do not come."""
    for _ in range(NEWTON):
        residual, tangent = layer.equations(u, p, depth, stiffness)
        step = np.zeros(residual.size)
        step[layer.free] = splu(tangent[layer.free][:, layer.free].tocsc()).solve(-residual[layer.free])
        u, p = u + step[:u.size], p + step[u.size:]
        if (most := np.abs(step[:u.size]).max()) < SMALL:
            return u, p
        if most > 1.0:
            return None
    return None


def by_eitsim(radius: float, depth: float, law: NeoHooke) -> float:
    punch = Punch(diameter_m=2 * radius, profile="sphere", depth_m=depth)
    return solve_touch(law, Body(thickness_m=THICKNESS_M), punch).force_N


def row(radius_mm: float, depth_mm: float, element: float = 0.06) -> dict[str, float]:
    """One touch; `element`: of the mixed mesh, over the contact radius of Hertz."""
    sphere, depth = radius_mm * 1e-3 / THICKNESS_M, depth_mm * 1e-3 / THICKNESS_M
    reach, begun, found = float(np.sqrt(sphere * depth)), time.process_time(), []
    for size in (2 * element, element):
        layer = mixed(sphere, reach, size * reach)
        soft, stiff = solved(layer, depth, STIFFNESS / reach)
        found.append(stiff + (stiff - soft) / 2)  # penetration falls as the penalty grows
    force, spent = found[1] * MU_PA * THICKNESS_M**2, time.process_time() - begun
    laws = {"off_percent": nearly_incompressible(NeoHooke(MU_PA, 0.5)), "nearer_off_percent": NeoHooke(MU_PA, 0.49999)}
    return {"radius_mm": radius_mm, "depth_mm": depth_mm, "force_N": force,
            "half_the_element_percent": 100 * (found[1] / found[0] - 1),
            "penalty_percent": 100 * (found[1] / stiff - 1), "unknowns": layer.free.size, "mixed_cpu_s": spent,
            **{name: 100 * (by_eitsim(radius_mm * 1e-3, depth_mm * 1e-3, law) / force - 1)
               for name, law in laws.items()}}


def main() -> None:
    shown(written([row(*touch) for touch in quick(TOUCHES, TOUCHES[:1])], "mixed_layer"))


if __name__ == "__main__":
    main()
