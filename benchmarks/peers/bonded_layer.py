"""A bonded layer under a rigid punch with Coulomb friction by scikit-fem, with nothing of eitsim's mechanics.

Axisymmetric quadratic triangles, displacements and, for rubbers, a linear continuous pressure p with the energy
W(F) + p (J - 1) - p^2/(2 kappa); stresses from derivatives by principal stretches, tangents by central differences;
contact by a penalty at Gauss points of the top, friction by an elastic slip that returns to Coulomb's cone each
increment, its tangent not symmetric; the depth is prescribed. A flat punch is a plane with a rounded edge, a sphere a
sphere. Lengths in thicknesses, stresses in mu_0.

Measured once under a flat punch on a foam and a rubber, elements of 0.025 against 0.0125: at most 0.1 % in force
without friction, 0.35 % with it; against eitsim's finest mesh 0.1 and 0.6 %, but 0.9 % at a depth of 0.03 with
friction, where this program's increments count for 0.3 %.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import bmat, coo_matrix
from scipy.sparse.linalg import splu
from skfem import Basis, ElementTriP1, ElementTriP2, ElementVector, FacetBasis, MeshTri

WIDTH = 3.0  # of the layer outside the punch's edge
PENALTY, TANGENTIAL = 4000.0, 1500.0  # pressure over penetration and shear over elastic slip, mu_0 over H
FAR = 0.75  # part of the deepest that a path has to reach
# (3, ...) principal stretches -> (3, ...) derivatives of the energy by them
Slope = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class RigidPunch:
    """Radius, and the radius that rounds the edge of a flat face; as large as the radius it is a sphere."""

    radius: float
    edge: float

    def gap(self, r: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Distance of points (r, y over the lowest point of the punch), negative inside; normal (r, y) out of the
        punch; curvature of the outline."""
        inner = self.radius - self.edge
        dx, dy = np.maximum(r - inner, 0.0), self.edge - y
        away = np.maximum(np.hypot(dx, dy), 1e-12)
        rounded = r > inner
        gap = np.where(rounded, away - self.edge, -y)
        return (gap, np.where(rounded, dx / away, 0.0), np.where(rounded, -dy / away, -1.0),
                np.where(rounded, 1 / away, 0.0))


def lines(punch: RigidPunch, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Radii and heights of the mesh: elements of `size` about the edge and at the top, growing away from there."""
    inner = punch.radius - punch.edge
    fine = punch.edge < 0.5 * punch.radius

    def growing(length: float, first: float, ratio: float) -> np.ndarray:
        count = max(int(np.ceil(np.log1p(length * (ratio - 1) / first) / np.log(ratio))), 1)
        steps = ratio ** np.arange(count)
        return np.cumsum(steps) * length / steps.sum()

    near = size if fine else 2 * size
    inside = inner - np.r_[0.0, growing(inner, size, 1.35)][::-1] if fine else np.array([0.0])
    edge = np.linspace(inside[-1] if fine else 0.0, punch.radius, int(np.ceil((punch.edge if fine else punch.radius)
                                                                                  / near)) + 1)
    outside = punch.radius + growing(WIDTH, near, 1.35)
    x = np.unique(np.round(np.r_[inside, edge, outside], 9))
    return x, np.unique(np.round(1 - np.r_[0.0, growing(1.0, near, 1.35)], 9))


def stress_of(slope: Slope, c: np.ndarray) -> np.ndarray:
    """Second Piola stress (4, ...), twice the energy's derivatives by C = (rr, zz, rz, hoop), rz counted once. Equal
    stretches are kept slightly different."""
    apart = (c[0] - c[1]) / 2
    mean, half = (c[0] + c[1]) / 2, np.sqrt(apart**2 + c[2] ** 2 + 1e-12)
    with np.errstate(invalid="ignore"):
        stretch = np.sqrt(np.array([mean + half, mean - half, c[3]]))
    more, less, hoop = slope(stretch) / stretch
    both, turn = (more + less) / 2, (more - less) / (2 * half)
    return np.array([both + turn * apart, both - turn * apart, 2 * turn * c[2], hoop])


def derivatives(slope: Slope, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The stress (4, ...) and its derivative (4, 4, ...) by C, by central differences."""
    step, tangent = 1e-5, []
    for k in range(4):
        one = np.zeros((4, *np.ones(c.ndim - 1, dtype=int)))
        one[k] = step
        tangent.append((stress_of(slope, c + one) - stress_of(slope, c - one)) / (2 * step))
    return stress_of(slope, c), np.moveaxis(np.array(tangent), 0, 1)


class Layer:
    """A layer under one punch, and its state as it is pressed."""

    def __init__(self, slope: Slope, kappa: float, punch: RigidPunch, friction: float, size: float) -> None:
        self.slope, self.kappa, self.punch, self.friction = slope, kappa, punch, friction
        mesh = MeshTri.init_tensor(*lines(punch, size))
        self.u = Basis(mesh, ElementVector(ElementTriP2()), intorder=4)
        self.p = self.u.with_element(ElementTriP1()) if np.isfinite(kappa) else None
        top = mesh.facets_satisfying(lambda x: x[1] > 1 - 1e-9, boundaries_only=True)
        top = top[mesh.p[0, mesh.facets[:, top]].max(axis=0) < punch.radius + 1.0]
        self.top = FacetBasis(mesh, ElementVector(ElementTriP2()), facets=top, intorder=6)
        still = np.unique(np.r_[self.u.get_dofs(lambda x: x[1] < 1e-9).flatten(),
                                self.u.get_dofs(lambda x: x[0] > x[0].max() - 1e-9).flatten(),
                                self.u.get_dofs(lambda x: x[0] < 1e-9).all("u^1")])
        count = self.u.N + (self.p.N if self.p else 0)
        self.free = np.setdiff1d(np.arange(count), still)
        self.x = np.zeros(count)
        self.weight = self.u.dx * self.u.global_coordinates().value[0]
        self.slip = np.zeros(self.top.dx.shape)
        self.arc, self.touched = np.zeros(self.top.dx.shape), np.zeros(self.top.dx.shape, dtype=bool)
        self._operators()

    def _operators(self) -> None:
        radius = self.u.global_coordinates().value[0]
        rows = []
        for i in range(self.u.Nbfun):
            shape = self.u.basis[i][0]
            value, grad = shape.value, shape.grad
            rows.append(np.array([grad[0, 0], grad[0, 1], grad[1, 0], grad[1, 1], value[0] / radius]))
        self.b = np.array(np.broadcast_arrays(*rows))  # (Nb, 5, elements, points): F_rr, F_rz, F_zr, F_zz, F_hoop
        self.t = np.array(np.broadcast_arrays(*[self.top.basis[i][0].value for i in range(self.top.Nbfun)]))
        self.q = None if self.p is None else np.array(np.broadcast_arrays(
            *[self.p.basis[i][0].value for i in range(self.p.Nbfun)]))

    def system(self, x: np.ndarray, depth: float) -> tuple[np.ndarray, object, float, tuple[np.ndarray, ...]]:
        """Residual, tangent, force, and what the contact would remember. The residual is infinite where an element is
        turned inside out, which C and so the stress does not show."""
        u = x[:self.u.N]
        f = np.einsum("ikeq,ie->keq", self.b, u[self.u.element_dofs])
        f[[0, 3, 4]] += 1
        rr, rz, zr, zz, hoop = f
        c = np.array([rr**2 + zr**2, rz**2 + zz**2, rr * rz + zr * zz, hoop**2])
        s, d = derivatives(self.slope, c)
        by = np.zeros((4, 5, *rr.shape))  # dC/dF
        by[0, 0], by[0, 2] = 2 * rr, 2 * zr
        by[1, 1], by[1, 3] = 2 * rz, 2 * zz
        by[2, 0], by[2, 1], by[2, 2], by[2, 3] = rz, rr, zz, zr
        by[3, 4] = 2 * hoop
        stress = 0.5 * np.einsum("aeq,aieq->ieq", s, by)
        tangent = 0.5 * np.einsum("aieq,abeq,bjeq->ijeq", by, d, by, optimize=True)
        half = 0.5 * s
        for i, j, k, factor in ((0, 0, 0, 2), (2, 2, 0, 2), (1, 1, 1, 2), (3, 3, 1, 2), (0, 1, 2, 1), (2, 3, 2, 1),
                                (4, 4, 3, 2)):
            tangent[i, j] += factor * half[k]
            if i != j:
                tangent[j, i] += factor * half[k]
        area = rr * zz - rz * zr
        cof = np.array([zz * hoop, -zr * hoop, -rz * hoop, rr * hoop, area])
        pressure = None
        if self.p is not None:
            pressure = np.einsum("ieq,ie->eq", self.q, x[self.u.N:][self.p.element_dofs])
            stress = stress + pressure * cof
            for i, j, value in ((0, 3, hoop), (1, 2, -hoop), (0, 4, zz), (3, 4, rr), (1, 4, -zr), (2, 4, -rz)):
                tangent[i, j] += pressure * value
                tangent[j, i] += pressure * value
        w = self.weight
        force = np.einsum("ikeq,keq,eq->ie", self.b, stress, w, optimize=True)
        bw = self.b * w
        ke = np.einsum("ikeq,kleq,jleq->ije", bw, tangent, self.b, optimize=True)
        residual = np.zeros(len(x))
        np.add.at(residual, self.u.element_dofs, force)
        if np.min(area * hoop) <= 0:
            residual[:] = np.inf
        blocks = [_sparse(ke, self.u.element_dofs, self.u.element_dofs, (self.u.N, self.u.N))]
        push, kc, reaction, memory = self._contact(u, depth)
        np.add.at(residual, self.top.element_dofs, push)
        blocks[0] = blocks[0] + _sparse(kc, self.top.element_dofs, self.top.element_dofs, (self.u.N, self.u.N))
        matrix = blocks[0]
        if self.p is not None:
            rest = area * hoop - 1 - pressure / self.kappa
            np.add.at(residual, self.u.N + self.p.element_dofs, np.einsum("ieq,eq,eq->ie", self.q, rest, w))
            kup = np.einsum("ikeq,keq,jeq->ije", bw, cof, self.q, optimize=True)
            kpp = -np.einsum("ieq,jeq,eq->ije", self.q, self.q, w, optimize=True) / self.kappa
            up = _sparse(kup, self.u.element_dofs, self.p.element_dofs, (self.u.N, self.p.N))
            pp = _sparse(kpp, self.p.element_dofs, self.p.element_dofs, (self.p.N, self.p.N))
            matrix = bmat([[matrix, up], [up.T, pp]])
        return residual, matrix.tocsc(), reaction, memory

    def _contact(self, u: np.ndarray, depth: float) -> tuple[np.ndarray, np.ndarray, float, tuple[np.ndarray, ...]]:
        moved = np.einsum("ikeq,ie->keq", self.t, u[self.top.element_dofs])
        at = self.top.global_coordinates().value
        r, y = at[0] + moved[0], at[1] + moved[1] - (1 - depth)
        gap, n_r, n_y, curvature = self.punch.gap(r, y)
        on = gap < 0
        w = self.top.dx * at[0]
        normal = PENALTY * np.where(on, -gap, 0.0)  # pressure
        along = np.array([-n_y, n_r])
        arc = self._arc(r, y)
        begun = np.where(self.touched, self.arc, arc)
        trial = TANGENTIAL * (self.slip + arc - begun)
        limit = self.friction * normal
        slides = np.abs(trial) > limit
        shear = np.where(on, np.where(slides, limit * np.sign(trial), trial), 0.0)
        n = np.array([n_r, n_y])
        load = (-normal * n + shear * along) * w
        push = np.einsum("ikeq,keq->ie", self.t, load)
        kn = np.where(on, PENALTY, 0.0)
        kt = np.where(on & ~slides & self.touched, TANGENTIAL, 0.0)  # a point holds where it first touches
        kc = np.where(on & slides, -self.friction * PENALTY * np.sign(trial), 0.0)
        two = np.einsum("keq,leq->kleq", n, n) * kn - np.einsum("keq,leq->kleq", along, along) * (
            normal * curvature - kt)
        two = two + np.einsum("keq,leq->kleq", along, n) * kc
        ke = np.einsum("ikeq,kleq,jleq,eq->ije", self.t, two, self.t, w, optimize=True)
        penetration = float(np.sum(normal**2 * w) / (PENALTY * max(np.sum(normal * w), 1e-300)))
        memory = penetration, np.where(on, shear / TANGENTIAL, 0.0), arc, on
        return push, ke, 2 * np.pi * float(np.sum(load[1])), memory

    def _arc(self, r: np.ndarray, y: np.ndarray) -> np.ndarray:
        inner = self.punch.radius - self.punch.edge
        turned = np.arctan2(np.maximum(r - inner, 0.0), np.maximum(self.punch.edge - y, 1e-12))
        return np.where(r > inner, inner + self.punch.edge * turned, r)

    def press(self, depth: float, limit: int = 30) -> tuple[float, float]:
        """The depth less the penetration, averaged by pressure, and the force, one increment from the state before;
        RuntimeError where Newton's method fails, or ends with points deep in the punch's edge. A step after which the
        residual is larger is halved."""
        x = self.x.copy()
        residual, matrix, force, memory = self.system(x, depth)
        for _ in range(limit):
            size = np.linalg.norm(residual[self.free])
            if size < 1e-6 * abs(force):
                if memory[0] > 0.1 * self.punch.edge:
                    break
                self.x = x
                penetration, self.slip, self.arc, self.touched = memory
                return depth - penetration, force
            try:
                step = splu(matrix[self.free][:, self.free]).solve(-residual[self.free])
            except RuntimeError:
                break
            share = min(1.0, 0.08 / max(np.abs(step[self.free < self.u.N]).max(), 1e-12))
            for _ in range(6):
                trial = x.copy()
                trial[self.free] += share * step
                residual, matrix, force, memory = self.system(trial, depth)
                if np.linalg.norm(residual[self.free]) < size:
                    break
                share /= 2
            x = trial
            if not np.isfinite(residual).all():
                break
        raise RuntimeError(f"no equilibrium at {depth:.4f}")


def _sparse(values: np.ndarray, rows: np.ndarray, columns: np.ndarray, shape: tuple[int, int]) -> coo_matrix:
    i = np.broadcast_to(rows[:, None], values.shape)
    j = np.broadcast_to(columns[None], values.shape)
    return coo_matrix((values.ravel(), (i.ravel(), j.ravel())), shape=shape).tocsr()


def pressed(slope: Slope, kappa: float, punch: RigidPunch, friction: float, depths: np.ndarray, size: float = 0.03
            ) -> np.ndarray:
    """(n, 2) depths near the increasing ones given, and forces, mu_0 H^2; an increment that fails is made in halves.
    RuntimeError where no equilibrium is found before FAR of the deepest; after it the path ends there."""
    layer, out, before = Layer(slope, kappa, punch, friction, size), [], 0.0
    for depth in depths:
        try:
            out.append(_reached(layer, before, float(depth), 5))
        except RuntimeError:
            if before < FAR * depths[-1]:
                raise
            break
        before = float(depth)
    return np.array(out)


def _reached(layer: Layer, before: float, depth: float, halvings: int) -> tuple[float, float]:
    try:
        return layer.press(depth)
    except RuntimeError:
        if halvings == 0:
            raise
    middle = (before + depth) / 2
    _reached(layer, before, middle, halvings - 1)
    return _reached(layer, middle, depth, halvings - 1)
