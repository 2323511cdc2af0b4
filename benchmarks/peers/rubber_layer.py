"""A ball pressed into a layer of rubber on a rigid plate, and what the layer then conducts, by scikit-fem alone.

Shares no code with eitsim. Mechanics: axisymmetric Taylor-Hood elements, u biquadratic and p bilinear, of W = mu/2
(J^(-2/3) I_1 - 3) + p (J - 1) - p^2/(2 kappa); a frictionless ball by a penalty on undeformed area. Electrics:
quadratic tetrahedra on the disc in three dimensions, complete electrode model, electrodes on the whole height of the
rim, conductivity J F^-1 s F^-T of the deformed layer on the untouched mesh. Lengths in mm, moduli in kPa, conductivity
in S/m: impedances times mm are Ohm times 1000.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import bmat, csc_matrix
from scipy.sparse.linalg import splu, spsolve
from scipy.spatial import Delaunay
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad1,
    ElementQuad2,
    ElementTetP2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshQuad,
    MeshTet,
)

Array = np.ndarray
Strained = Callable[[Array], Array]  # F (n, 3, 3) -> conductivity s (n, 3, 3) of the deformed layer
STEPS, TOLERANCE, MOST = 12, 1e-7, 25


@dataclass(frozen=True)
class Problem:
    """What is given."""

    mu: float
    kappa: float
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
                           *((given.depth, soft * by) for by in (4, 16))]:
        centre, x, done = given.ball - depth, x * (depth / done if done else 1), depth
        for _ in range(MOST):
            f = _gradient(u_basis.interpolate(x[:n]), radius)
            p = np.asarray(p_basis.interpolate(x[n:]))
            a = _stiffness.assemble(u_basis, f=f, p=p, mu=given.mu)
            b, c = _coupling.assemble(p_basis, u_basis, f=f), _bulk.assemble(p_basis, kappa=given.kappa)
            residual = np.append(_stress.assemble(u_basis, f=f, p=p, mu=given.mu),
                                 _volume.assemble(p_basis, f=f) - c @ x[n:])
            on_top = top.interpolate(x[:n])
            contact = {"u": on_top, "centre": centre, "ball": given.ball, "penalty": penalty}
            pushed = _push.assemble(top, **contact)
            a = a + _push_tangent.assemble(top, **contact)
            residual[:n] += pushed
            size = np.linalg.norm(residual[free])
            if size < TOLERANCE * given.mu * given.ball**2:
                break
            whole = bmat([[a, b], [b.T, -c]], format="csc")[free][:, free]
            x[free] -= spsolve(whole, residual[free])
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
    r, f = w.x[0], w["f"]
    j, h, i1 = _parts(np.asarray(f))
    stress = w["mu"] * j ** (-2 / 3) * (f - i1 / 3 * h) + w["p"] * j * h
    return 2 * np.pi * r * _dot(stress, _virtual(v, r))


@BilinearForm
def _stiffness(u, v, w):
    r, f, p = w.x[0], np.asarray(w["f"]), np.asarray(w["p"])
    j, h, i1 = _parts(f)
    d, t = _virtual(u, r), _virtual(v, r)
    hd, ht, fd, ft = _dot(h, d), _dot(h, t), _dot(f, d), _dot(f, t)
    turned = np.einsum("ij...,kj...,kl...,il...->...", h, d, h, t)
    iso = _dot(d, t) - 2 / 3 * (hd * ft + fd * ht) + 2 / 9 * i1 * hd * ht + i1 / 3 * turned
    return 2 * np.pi * r * (w["mu"] * j ** (-2 / 3) * iso + p * j * (hd * ht - turned))


@BilinearForm
def _coupling(p, v, w):
    r = w.x[0]
    j, h, _ = _parts(np.asarray(w["f"]))
    return 2 * np.pi * r * j * p * _dot(h, _virtual(v, r))


@BilinearForm
def _bulk(p, q, w):
    return 2 * np.pi * w.x[0] * p * q / w["kappa"]


@LinearForm
def _volume(q, w):
    return 2 * np.pi * w.x[0] * (_parts(np.asarray(w["f"]))[0] - 1) * q


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


def changed(pressed: Pressed, given: Problem, disc: float, at: float, electrodes: int, width: float, contact: float,
            sigma: float, laws: list[Strained], *, fine: float = 0.5, levels: int = 5) -> tuple[Array, list[Array]]:
    """Impedance matrices (N, N), Ohm, of the untouched disc, and what a touch at (at, 0) changes of it by each law.

    contact: contact impedance, S^-1 m mm, of electrodes on the whole height of the rim; sigma: conductivity at rest.
    """
    points, edge = _points(disc, at, electrodes, width, fine)
    triangles = Delaunay(points).simplices
    heights = -given.thickness * np.cos(np.linspace(0, np.pi / 2, levels))
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
