"""A ball pressed into a layer of rubber on a rigid plate, by scikit-fem alone.

Shares no code with eitsim: axisymmetric Taylor-Hood elements, u biquadratic and p bilinear, of W = mu/2 (J^(-2/3) I_1
- 3) + p (J - 1) - p^2/(2 kappa); a frictionless ball by a penalty on undeformed area, raised until it does not matter.
Lengths in mm, moduli in kPa, forces in mN.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import bmat
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementQuad1, ElementQuad2, ElementVector, FacetBasis, LinearForm, MeshQuad

Array = np.ndarray
STEPS, TOLERANCE, MOST = 12, 1e-7, 25


@dataclass(frozen=True)
class Problem:
    """What is given."""

    mu: float
    kappa: float  # infinite where the volume is kept
    thickness: float
    ball: float  # radius
    depth: float
    far: float = 28.0  # radius where the layer is held
    element: float = 0.12  # about the contact
    layers: int = 12


@dataclass(frozen=True)
class Pressed:
    """Displacements by radius and height, the top at 0, and the force, mN."""

    u_r: RectBivariateSpline
    u_z: RectBivariateSpline
    far: float
    force: float

    def gradient(self, radius: Array, height: Array) -> Array:
        """F (n, 3, 3) along r, z and around; the identity from `far` on."""
        r = np.clip(radius, 1e-6, self.far)
        found = np.zeros((len(r), 3, 3))
        for i, one in enumerate((self.u_r, self.u_z)):
            found[:, i, 0], found[:, i, 1] = one.ev(r, height, dx=1), one.ev(r, height, dy=1)
        found[:, 2, 2] = self.u_r.ev(r, height) / r
        found[radius >= self.far] = 0
        return found + np.eye(3)


def pressed(given: Problem) -> Pressed:
    """Equilibrium at the depth, in even steps from rest."""
    r = _widening(1.6 * np.sqrt(2 * given.ball * given.depth), given.element, given.far)
    z = -given.thickness * (1 + np.cos(np.linspace(0, np.pi, given.layers + 1))) / 2
    mesh = MeshQuad.init_tensor(r, z)
    u_basis = Basis(mesh, ElementVector(ElementQuad2()), intorder=5)
    p_basis = u_basis.with_element(ElementQuad1())
    top = FacetBasis(mesh, ElementVector(ElementQuad2()), facets=mesh.facets_satisfying(lambda x: np.isclose(x[1], 0)),
                     intorder=8)
    n = u_basis.N
    place = u_basis.doflocs
    is_r = np.zeros(n, bool)
    for part in (u_basis.nodal_dofs, u_basis.facet_dofs, u_basis.interior_dofs):
        is_r[part[0]] = True
    held = np.isclose(place[1], -given.thickness) | np.isclose(place[0], given.far) | (is_r & np.isclose(place[0], 0))
    free = np.append(~held, np.ones(p_basis.N, bool))
    x = np.zeros(n + p_basis.N)
    radius = np.asarray(u_basis.global_coordinates())[0]
    soft, done = 40 * given.mu / given.element, 0.0
    for depth, penalty in [*((given.depth * k / STEPS, soft) for k in range(1, STEPS + 1)),
                           *((given.depth, soft * by) for by in (4, 16, 64))]:
        centre, x, done = given.ball - depth, x * (depth / done if done else 1), depth
        for _ in range(MOST):
            f = _gradient(u_basis.interpolate(x[:n]), radius)
            j, h, i1 = _parts(f)
            at = {"f": f, "j": j, "h": h, "i1": i1, "p": np.asarray(p_basis.interpolate(x[n:])), "mu": given.mu}
            a = _stiffness.assemble(u_basis, **at)
            b, c = _coupling.assemble(p_basis, u_basis, **at), _bulk.assemble(p_basis, kappa=given.kappa)
            residual = np.append(_stress.assemble(u_basis, **at), _volume.assemble(p_basis, **at) - c @ x[n:])
            on_top = top.interpolate(x[:n])
            contact = {"u": on_top, "centre": centre, "ball": given.ball, "penalty": penalty}
            pushed = _push.assemble(top, **contact)
            a = a + _push_tangent.assemble(top, **contact)
            residual[:n] += pushed
            size = np.linalg.norm(residual[free])
            if size < TOLERANCE * given.mu * given.ball**2:
                break
            whole = bmat([[a, b], [b.T, -c]], format="csc")[free][:, free]
            x[free] -= splu(whole).solve(residual[free])
        else:
            raise RuntimeError(f"no equilibrium at {depth:g} mm: {size:g}")
    return _splines(u_basis, mesh, x[:n], given, float(np.sum(pushed[~is_r])))


def _widening(fine: float, size: float, end: float) -> Array:
    """Even steps up to `fine`, then steps that grow by a sixth."""
    out = list(np.linspace(0, fine, round(fine / size) + 1))
    step = size
    while out[-1] + 1.5 * step < end:
        step = min(step * 7 / 6, end / 12)
        out.append(out[-1] + step)
    return np.append(out[:-1], end) if end - out[-1] < step / 2 else np.append(out, end)


def _splines(basis: Basis, mesh: MeshQuad, u: Array, given: Problem, force: float) -> Pressed:
    """Cubic splines through the displacements of all nodes, which lie on a grid."""
    dofs = np.concatenate([basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs], axis=1)
    r, z = basis.doflocs[:, dofs[0]]
    lines = [np.unique(one.round(9)) for one in (r, z)]
    cell = tuple(np.searchsorted(line, one.round(9)) for line, one in zip(lines, (r, z), strict=True))
    made = []
    for part in dofs:
        grid = np.zeros((len(lines[0]), len(lines[1])))
        grid[cell] = u[part]
        made.append(RectBivariateSpline(*lines, grid))
    return Pressed(*made, given.far, force)


def _gradient(u, r: Array) -> Array:
    """F (3, 3, ...) of displacements."""
    return _virtual(u, r) + np.eye(3)[(...,) + (None,) * r.ndim]


def _virtual(v, r: Array) -> Array:
    """Gradients (3, 3, ...) along r, z and around."""
    d = np.zeros((3, 3, *r.shape))
    d[:2, :2], d[2, 2] = v.grad, np.asarray(v)[0] / r
    return d


def _parts(f: Array) -> tuple[Array, Array, Array]:
    """J, F^-T and I_1."""
    last = np.moveaxis(f, (0, 1), (-2, -1))
    return np.linalg.det(last), np.moveaxis(np.linalg.inv(last), (-2, -1), (1, 0)), np.sum(f**2, axis=(0, 1))


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij...,ij...->...", a, b)


@LinearForm
def _stress(v, w):
    r, j, h = w.x[0], w["j"], w["h"]
    stress = w["mu"] * j ** (-2 / 3) * (w["f"] - w["i1"] / 3 * h) + w["p"] * j * h
    return 2 * np.pi * r * _dot(stress, _virtual(v, r))


@BilinearForm
def _stiffness(u, v, w):
    r, f, j, h, i1, p = w.x[0], *(np.asarray(w[name]) for name in ("f", "j", "h", "i1", "p"))
    d, t = _virtual(u, r), _virtual(v, r)
    hd, ht, fd, ft = _dot(h, d), _dot(h, t), _dot(f, d), _dot(f, t)
    turned = np.einsum("ij...,kj...,kl...,il...->...", h, d, h, t)
    iso = _dot(d, t) - 2 / 3 * (hd * ft + fd * ht) + 2 / 9 * i1 * hd * ht + i1 / 3 * turned
    return 2 * np.pi * r * (w["mu"] * j ** (-2 / 3) * iso + p * j * (hd * ht - turned))


@BilinearForm
def _coupling(p, v, w):
    r = w.x[0]
    return 2 * np.pi * r * w["j"] * p * _dot(np.asarray(w["h"]), _virtual(v, r))


@BilinearForm
def _bulk(p, q, w):
    return 2 * np.pi * w.x[0] * p * q / w["kappa"]


@LinearForm
def _volume(q, w):
    return 2 * np.pi * w.x[0] * (w["j"] - 1) * q


def _gap(w) -> tuple[Array, Array, Array]:
    """How deep points are inside the ball, the normal (2, ...), and their distance from its centre."""
    x = np.stack([w.x[0] + w["u"][0], w.x[1] + w["u"][1] - w["centre"]])
    away = np.sqrt(x[0] ** 2 + x[1] ** 2)
    return np.maximum(w["ball"] - away, 0), x / away, away


@LinearForm
def _push(v, w):
    gap, normal, _ = _gap(w)
    return -2 * np.pi * w.x[0] * w["penalty"] * gap * (normal[0] * v[0] + normal[1] * v[1])


@BilinearForm
def _push_tangent(u, v, w):
    gap, n, away = _gap(w)
    un, vn, uv = n[0] * u[0] + n[1] * u[1], n[0] * v[0] + n[1] * v[1], u[0] * v[0] + u[1] * v[1]
    return 2 * np.pi * w.x[0] * w["penalty"] * np.where(gap > 0, un * vn - gap / away * (uv - un * vn), 0.0)
