"""A ball pressed into a layer of rubber on a rigid plate, or bonded to a base of another material, by scikit-fem alone.

Shares no code with eitsim: axisymmetric Taylor-Hood elements, u biquadratic and p bilinear, of W = mu/2 (J^(-2/3) I_1
- 3) + p (J - 1) - p^2/(2 kappa), p with a jump where layer and base meet; a frictionless ball by a penalty on
undeformed area, raised until it does not matter.
Lengths in mm, moduli in kPa, forces in mN.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import block_diag, bmat, hstack
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
    base: tuple[float, float, float] | None = None  # mu, kappa and thickness of what is under the layer; None: a plate
    free: bool = False  # whether the layer is free at `far`


@dataclass(frozen=True)
class Pressed:
    """The layer's displacements by radius and height, the top at 0, and the force, mN."""

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
    parts, bottom = [(given.mu, given.kappa)], given.thickness
    if given.base is not None:
        parts, bottom = [*parts, given.base[:2]], given.thickness + given.base[2]
        step = given.thickness / given.layers
        z = np.append(-given.thickness - _widening(0.0, step, given.base[2])[:0:-1], z)
    mesh = MeshQuad.init_tensor(r, z)
    u_basis = Basis(mesh, ElementVector(ElementQuad2()), intorder=5)
    layer = mesh.p[1, mesh.t].mean(axis=0) > -given.thickness
    regions = []
    for (mu, kappa), cells in zip(parts, (layer, ~layer), strict=False):
        own = Basis(mesh, ElementVector(ElementQuad2()), intorder=5, elements=np.flatnonzero(cells))
        regions.append((mu, kappa, own, own.with_element(ElementQuad1()),
                        np.asarray(own.global_coordinates())[0]))
    top = FacetBasis(mesh, ElementVector(ElementQuad2()), facets=mesh.facets_satisfying(lambda x: np.isclose(x[1], 0)),
                     intorder=8)
    n, pressures = u_basis.N, regions[0][3].N
    place = u_basis.doflocs
    is_r = np.zeros(n, bool)
    for part in (u_basis.nodal_dofs, u_basis.facet_dofs, u_basis.interior_dofs):
        is_r[part[0]] = True
    held = np.isclose(place[1], -bottom) | (is_r & np.isclose(place[0], 0))
    if not given.free:
        held |= np.isclose(place[0], given.far)
    free = np.concatenate([~held, *(np.isin(np.arange(pressures), p_basis.element_dofs) for _, _, _, p_basis, _ in
                                    regions)])
    x = np.zeros(n + pressures * len(regions))
    soft, done = 40 * given.mu / given.element, 0.0
    for depth, penalty in [*((given.depth * k / STEPS, soft) for k in range(1, STEPS + 1)),
                           *((given.depth, soft * by) for by in (4, 16, 64))]:
        centre, x, done = given.ball - depth, x * (depth / done if done else 1), depth
        for _ in range(MOST):
            on_top = top.interpolate(x[:n])
            contact = {"u": on_top, "centre": centre, "ball": given.ball, "penalty": penalty}
            pushed, a = _push.assemble(top, **contact), _push_tangent.assemble(top, **contact)
            residual, coupled, bulk = [pushed.copy()], [], []
            for (mu, kappa, own, p_basis, radius), p in zip(regions, np.split(x[n:], len(regions)), strict=True):
                f = _gradient(own.interpolate(x[:n]), radius)
                j, h, i1 = _parts(f)
                at = {"f": f, "j": j, "h": h, "i1": i1, "p": np.asarray(p_basis.interpolate(p)), "mu": mu}
                a = a + _stiffness.assemble(own, **at)
                coupled.append(_coupling.assemble(p_basis, own, **at))
                bulk.append(_bulk.assemble(p_basis, kappa=kappa))
                residual[0] += _stress.assemble(own, **at)
                residual.append(_volume.assemble(p_basis, **at) - bulk[-1] @ p)
            left = np.concatenate(residual)[free]
            size = np.linalg.norm(left)
            if size < TOLERANCE * given.mu * given.ball**2:
                break
            b = hstack(coupled)
            whole = bmat([[a, b], [b.T, -block_diag(bulk)]], format="csc")[free][:, free]
            x[free] -= splu(whole).solve(left)
        else:
            raise RuntimeError(f"no equilibrium at {depth:g} mm: {size:g}")
    return _splines(u_basis, x[:n], given, float(np.sum(pushed[~is_r])))


def _widening(fine: float, size: float, end: float) -> Array:
    """Even steps up to `fine`, then steps that grow by a sixth."""
    out = list(np.linspace(0, fine, round(fine / size) + 1))
    step = size
    while out[-1] + 1.5 * step < end:
        step = min(step * 7 / 6, end / 12)
        out.append(out[-1] + step)
    return np.append(out[:-1], end) if end - out[-1] < step / 2 else np.append(out, end)


def _splines(basis: Basis, u: Array, given: Problem, force: float) -> Pressed:
    """Cubic splines through the displacements of the layer's nodes, which lie on a grid."""
    dofs = np.concatenate([basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs], axis=1)
    dofs = dofs[:, basis.doflocs[1, dofs[0]] > -given.thickness - 1e-9]
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
