"""A punch on foam with one straight free edge, by finite elements in three dimensions: `python foam_at_edge.py FOLDER`.

Shares no code with eitsim. The half of the foam on one side of the plane of symmetry, the edge at x = reach + gap, all
of it in hexahedra with 27 nodes, their lines radii about the punch's axis. Total Lagrangian; hyperfoam with nu = 0,
whose energy is a sum over principal stretches; a rigid frictionless cylinder with a rounded edge, penalty per
undeformed area; the force is given. Lengths in mm, stresses in kPa, forces in mN. FOLDER/problem.npz holds the numbers;
FOLDER/found.npz receives, of every mesh by its place in the list, depth, F at the requested points of the surface and
what it took. The equations are solved by Cholesky's method on blocks of lines about the axis, on a GPU where PyTorch
finds one; elements are made in as many threads as OMP_NUM_THREADS says.
"""

import itertools
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq
from scipy.sparse import csr_matrix

from touchcal.arrays import Array

Indices = NDArray[np.int64]

# Elements are smallest between these distances outside the punch's edge, mm, where the foam leaves its wall; from there
# they widen by these multiples of their size a mm, inwards slowly as far as the foam may come to stand at the fillet.
BAND, SLOW, INWARDS, OUTWARDS = (0.25, 0.85), 1.0, 4.0, 4.0
STANDS = 0.7  # How far that is inside the fillet, mm.
ROUND = 1.0  # Lines up to so far outside the punch's edge are circles, mm.
DOWNWARDS = 1.4  # The same downwards, times the root of the element's size in mm.
TOGETHER = 64  # Elements whose matrices are made together.
FAR = 6.0  # Points of the top further outside the punch's edge than this cannot touch it, mm.
# Newton's method: steps at most, part of force times thickness below which the energy ends, part of the slope by which
# it must fall, shortest part of a step, and that below which the next step is damped.
MOST_STEPS, LEAST, ABOVE, SHORTEST, SHORT = 60, 1e-9, 1e-4, 1e-5, 0.1
# Parts of the force on the way up, and penalties, kPa/mm: a stiff one from the start takes many short steps.
SHARES, PENALTIES = (0.1, 0.3, 0.6, 1.0), (500.0, 2500.0, 10000.0)
START = 0.02  # Depth to start from, mm.


@dataclass(frozen=True)
class Problem:
    """What is given."""

    radius: float
    fillet: float
    gap: float
    thickness: float
    far: float
    mu: Array
    alpha: Array
    force: float
    element: float  # size at the punch's edge, mm
    sectors: int  # on half a circle
    penalty: float = 0.0  # kPa/mm


@dataclass(frozen=True)
class Mesh:
    """A tensor of hexahedra: lines of radii, angles and heights, nodes of order two."""

    problem: Problem
    radial: tuple[Array, int]  # radii of the lines that are circles; how many elements follow up to the outline
    angles: Array  # (2 sectors + 1,)
    heights: Array  # (2 layers + 1,)
    nodes: Array  # (n, 3)
    cells: Indices  # (radial, angular, layers, 27)
    free: NDArray[np.bool_]  # (n, 3)
    line: Indices  # (n,) which of the lines about the axis a node lies on


def graded(length: float, first: float, count: int) -> Array:
    """Ends (count + 1,) of intervals in geometric progression, the first as given; even where they would shrink."""
    if count * first >= length:
        return np.linspace(0, length, count + 1)

    def whole(q: float) -> float:
        return first * (q**count - 1) / (q - 1) - length
    q = float(brentq(whole, 1 + 1e-9, 20))  # type: ignore[arg-type]
    out = np.asarray(first * (q ** np.arange(count + 1) - 1) / (q - 1), dtype=float)
    out[-1] = length
    return out


def doubled(ends: Array) -> Array:
    """With the middles of the intervals, (2 n + 1, ...)."""
    out = np.empty((2 * len(ends) - 1, *ends.shape[1:]))
    out[::2], out[1::2] = ends, (ends[1:] + ends[:-1]) / 2
    return out


def spread(start: float, stop: float, width: Callable[[Array], Array]) -> Array:
    """Ends of intervals from one place to another, at most as wide as given of a place."""
    x = np.linspace(start, stop, 20001)
    count = np.concatenate([[0.0], np.cumsum(np.diff(x) / width((x[1:] + x[:-1]) / 2))])
    return np.interp(np.linspace(0, count[-1], max(1, int(np.ceil(count[-1] - 1e-6))) + 1), count, x)


def circles(p: Problem) -> Array:
    """Radii of the lines that are circles; two of them end the fillet."""
    low, high = p.radius + np.array(BAND)
    inside = p.radius - p.fillet - STANDS

    def width(r: Array) -> Array:
        return p.element * (1 + SLOW * np.maximum(low - np.maximum(r, inside), 0) + INWARDS * np.maximum(inside - r, 0)
                            + OUTWARDS * np.maximum(r - high, 0))
    stops = [0.0, p.radius - p.fillet, p.radius, p.radius + ROUND]
    return np.concatenate([[0.0], *(spread(*ends, width)[1:] for ends in itertools.pairwise(stops))])


def radii(mesh_lines: tuple[Array, int], p: Problem, angle: Array) -> Array:
    """Radii (lines, angles) of all lines at angles."""
    inner, outer = mesh_lines
    edge, rows = p.radius + p.gap, []
    for t in np.atleast_1d(angle):
        end = min(edge / np.cos(t), p.far) if np.cos(t) > edge / p.far else p.far
        first = inner[-1] - inner[-2]
        rows.append(doubled(np.concatenate([inner, inner[-1] + graded(end - inner[-1], first, outer)[1:]])))
    return np.array(rows).T


def mesh_of(p: Problem) -> Mesh:
    corner = np.arccos((p.radius + p.gap) / p.far)
    near = max(2, round(p.sectors * corner / np.pi))
    angles = doubled(np.concatenate([np.linspace(0, corner, near + 1),
                                     np.linspace(corner, np.pi, p.sectors - near + 1)[1:]]))
    grown = OUTWARDS * p.element
    lines = circles(p), int(np.ceil(np.log(1 + OUTWARDS * (p.far - p.radius)) / np.log(1 + grown)))
    heights = -doubled(spread(0.0, p.thickness, lambda z: p.element + DOWNWARDS * np.sqrt(p.element) * z))[::-1]
    r = radii(lines, p, angles)
    counts = (len(r), len(angles), len(heights))
    x = np.stack(np.broadcast_arrays((r * np.cos(angles))[..., None], (r * np.sin(angles))[..., None], heights), -1)
    number = np.arange(np.prod(counts)).reshape(counts)
    number[0] = number[0, 0]  # the axis
    used, number = np.unique(number, return_inverse=True)
    number = number.reshape(counts)
    nodes = x.reshape(-1, 3)[used]
    i, j, k = (np.arange(0, n - 1, 2) for n in counts)
    step = np.arange(3)
    at = np.ix_(i, j, k)
    cells = np.stack([number[at[0] + a, at[1] + b, at[2] + c] for a in step for b in step for c in step], axis=-1)
    free = np.ones(nodes.shape, dtype=bool)
    free[number[:, :, 0]] = False  # the bottom is bonded
    outside = (r[-1] * np.cos(angles)) < p.radius + p.gap - 1e-6
    free[number[-1][outside]] = False  # far away
    free[number[:, [0, -1]], 1] = False  # symmetry
    free[number[0], :2] = False
    return Mesh(p, lines, angles, heights, nodes, cells, free, used // (counts[1] * counts[2]))


def quadratic(t: Array) -> tuple[Array, Array]:
    """Values and slopes (q, 3) of the quadratics at -1, 0, 1."""
    t = np.asarray(t)
    return (np.stack([t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2], -1), np.stack([t - 0.5, -2 * t, t + 0.5], -1))


def slopes(*t: Array) -> Array:
    """(q, 27, 3) slopes at points (q,) of each of the three coordinates."""
    (a, da), (b, db), (c, dc) = (quadratic(one) for one in t)
    return np.stack([np.einsum("qi,qj,qk->qijk", *parts).reshape(len(a), -1)
                     for parts in ((da, b, c), (a, db, c), (a, b, dc))], -1)


def gauss(dimensions: int, points: int) -> tuple[list[Array], Array]:
    t, w = np.polynomial.legendre.leggauss(points)
    grid = [g.ravel() for g in np.meshgrid(*[t] * dimensions, indexing="ij")]
    return grid, np.prod([g.ravel() for g in np.meshgrid(*[w] * dimensions, indexing="ij")], axis=0)


class Foam:
    """Energy, its gradient and its second derivatives on a mesh."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh, self.problem = mesh, mesh.problem
        p = self.problem
        self.cells = mesh.cells.reshape(-1, 27)
        t, w = gauss(3, 3)
        slope = slopes(*t)
        jacobian = np.einsum("eax,qac->eqxc", mesh.nodes[self.cells], slope)
        det = np.linalg.det(jacobian)
        assert det.min() > 0, "an element is folded over"
        self.weight = w * det
        self.gradient = np.einsum("qac,eqcx->eqax", slope, np.linalg.inv(jacobian))
        top = mesh.cells[:, :, -1].reshape(-1, 27)[:, 2::3]
        top = top[np.hypot(*mesh.nodes[top][..., :2].mean(axis=1).T) < p.radius + FAR]
        (s, q), w = gauss(2, 4)
        (a, da), (b, db) = quadratic(s), quadratic(q)
        self.shape = np.einsum("qi,qj->qij", a, b).reshape(len(w), -1)
        local = np.stack([np.einsum("qi,qj->qij", *f).reshape(len(w), -1) for f in ((da, b), (a, db))], -1)
        plane = np.einsum("eax,qac->eqxc", mesh.nodes[top][..., :2], local)
        self.top, self.area = top, w * np.linalg.det(plane)
        self.number = np.full(mesh.nodes.shape, -1)
        self.number[mesh.free] = np.arange(mesh.free.sum())
        self.size = int(mesh.free.sum())
        # lines couple up to the end of an element
        self.starts = np.flatnonzero(np.diff(mesh.line[np.nonzero(mesh.free)[0]] // 2, prepend=-1))
        self._pattern()
        self.parts = [slice(first, first + TOGETHER) for first in range(0, len(self.cells), TOGETHER)]
        self.pool = ThreadPoolExecutor(int(os.environ.get("OMP_NUM_THREADS", "1")))

    def _pattern(self) -> None:
        blocks = []
        for nodes in (self.cells, self.top):
            own = self.number[nodes].reshape(len(nodes), -1)
            i, j = np.triu_indices(own.shape[1])
            one, other = own[:, i], own[:, j]
            low, high = np.minimum(one, other), np.maximum(one, other)
            twice = 1.0 + ((low == high) & (i != j))  # both halves of what falls on the diagonal at the axis
            blocks.append((low.astype(np.int64) * self.size + high, low >= 0, twice))
        key = np.concatenate([b[0][b[1]] for b in blocks])
        self.kept, self.twice = [b[1] for b in blocks], np.concatenate([b[2][b[1]] for b in blocks])
        pair, self.into = np.unique(key, return_inverse=True)
        self.into = self.into.astype(np.int32)
        row, self.column = np.divmod(pair, self.size)
        self.start = np.searchsorted(row, np.arange(self.size + 1))

    def matrix(self, foam: Array, contact: Array) -> csr_matrix:
        """Upper half from upper halves of element matrices (e, 3321) and (top, 378)."""
        data = np.concatenate([one[kept] for one, kept in zip((foam, contact), self.kept, strict=True)])
        data = np.bincount(self.into, self.twice * data, len(self.column))
        return csr_matrix((data, self.column.astype(np.int32), self.start.astype(np.int32)), shape=(self.size,) * 2)

    def spread(self, u: Array) -> Array:
        out = np.zeros(self.mesh.nodes.shape)
        out[self.mesh.free] = u
        return out

    def deformation(self, u: Array, part: slice) -> Array:
        inner = np.swapaxes(self.gradient[part], -1, -2) @ u[self.cells[part]][:, None]
        return np.eye(3) + inner.swapaxes(-1, -2)

    def energy(self, u: Array, depth: float) -> float:
        """Of foam, contact and force, mN mm; infinite where an element is turned over."""
        moved, p = self.spread(u), self.problem
        inside, *_ = self.penetration(moved, depth)
        return (sum(self.pool.map(lambda part: self._energy(moved, part), self.parts))
                + float(p.penalty / 2 * np.sum(self.area * inside**2) - p.force / 2 * depth))

    def _energy(self, moved: Array, part: slice) -> float:
        f, p = self.deformation(moved, part), self.problem
        if not np.all(np.linalg.det(f) > 0):
            return np.inf
        c = np.linalg.eigvalsh(np.swapaxes(f, -1, -2) @ f)
        density = np.zeros(c.shape)
        for m, a in zip(p.mu, p.alpha, strict=True):
            density += 2 * m / a**2 * (c ** (a / 2) - 1 - a / 2 * np.log(c))
        return float(np.sum(self.weight[part] * density.sum(axis=-1)))

    def penetration(self, u: Array, depth: float) -> tuple[Array, Array, Array]:
        """How far points of the top lie inside the punch, with its gradient and second derivatives; 0 outside."""
        p = self.problem
        x = np.einsum("qa,eax->eqx", self.shape, (self.mesh.nodes + u)[self.top])
        r, up = np.hypot(x[..., 0], x[..., 1]), x[..., 2] + depth
        out = np.maximum(r, 1e-9)
        radial = np.stack([x[..., 0] / out, x[..., 1] / out, 0 * r], -1)
        around = np.stack([-radial[..., 1], radial[..., 0], 0 * r], -1)
        dx, dy = np.maximum(r - p.radius + p.fillet, 0), np.maximum(p.fillet - up, 0)
        far = np.maximum(np.hypot(dx, dy), 1e-12)
        corner, wall = (dx > 0) & (dy > 0), (dx > 0) & (dy == 0)
        value = np.where(corner, p.fillet - far, np.where(wall, p.radius - r, up))
        n_r = np.where(corner, -dx / far, np.where(wall, -1.0, 0.0))
        n_z = np.where(corner, dy / far, np.where(wall, 0.0, 1.0))
        vertical = np.array([0.0, 0, 1])
        normal = n_r[..., None] * radial + n_z[..., None] * vertical
        tangent = n_z[..., None] * radial - n_r[..., None] * vertical
        bent = np.where(corner, -1 / far, 0.0)[..., None, None] * tangent[..., None] * tangent[..., None, :]
        bent = bent + (n_r / out)[..., None, None] * around[..., None] * around[..., None, :]
        inside = value > 0
        return np.where(inside, value, 0.0), normal * inside[..., None], bent * inside[..., None, None]

    def derivatives(self, u: Array, depth: float, scale: float = 1.0) -> tuple[Array, float, csr_matrix, Array, float]:
        """By u and by the depth, second ones by u, by both, and by the depth; scale: of what makes them negative."""
        p, moved = self.problem, self.spread(u)
        forces, k = zip(*self.pool.map(lambda part: self._elements(moved, scale, part), self.parts), strict=True)
        residual = np.zeros(self.mesh.nodes.shape)
        np.add.at(residual, self.cells, np.concatenate(forces))
        inside, normal, bent = self.penetration(moved, depth)
        push = p.penalty * self.area * inside
        np.add.at(residual, self.top, np.einsum("eq,qa,eqx->eax", push, self.shape, normal, optimize=True))
        second = p.penalty * self.area[..., None, None] * normal[..., None] * normal[..., None, :]
        second = second + scale * push[..., None, None] * bent
        local = np.einsum("qa,eqxy,qb->eaxby", self.shape, second, self.shape, optimize=True)
        border = np.zeros(self.mesh.nodes.shape)
        np.add.at(border, self.top, np.einsum("qa,eqx->eax", self.shape, second[..., 2], optimize=True))
        free = self.mesh.free
        matrix = self.matrix(np.concatenate(k), local.reshape(len(self.top), 27, 27)[:, *np.triu_indices(27)])
        return (residual[free], float(np.sum(push * normal[..., 2])) - p.force / 2, matrix, border[free],
                float(second[..., 2, 2].sum()))

    def _elements(self, moved: Array, scale: float, part: slice) -> tuple[Array, Array]:
        """Forces (e, 27, 3) and upper halves (e, 3321) of the matrices of some elements."""
        p, f = self.problem, self.deformation(moved, part)
        c, v = np.linalg.eigh(np.swapaxes(f, -1, -2) @ f)
        s, ds = np.zeros(c.shape), np.zeros(c.shape)
        for m, a in zip(p.mu, p.alpha, strict=True):
            s += 2 * m / a * (c ** (a / 2) - 1) / c
            ds += 2 * m / a * ((a / 2 - 1) * c ** (a / 2) + 1) / c**2
        one, other = c[..., :, None], c[..., None, :]
        close = np.abs(one - other) < 1e-5 * (one + other)
        d = np.where(close, (ds[..., :, None] + ds[..., None, :]) / 2,
                     (s[..., :, None] - s[..., None, :]) / np.where(close, 1.0, one - other))
        g, weight = f @ v, self.weight[part]
        along = self.gradient[part] @ v
        force = np.einsum("eq,eqal,eqil->eai", weight, along, g * s[..., None, :], optimize=True)
        tangent = self._tangent(g, s, d)
        if scale < 1:
            self._damp(tangent, g, c, s, scale)
        whole = self._matrices(along, weight[..., None, None, None, None] * tangent)
        return force, whole[:, *np.triu_indices(81)]

    @staticmethod
    def _tangent(g: Array, s: Array, d: Array) -> Array:
        """dP/dF (e, q, i, l, j, m) in the axes of C."""
        out = np.einsum("eqim,eqml,eqjl->eqiljm", g, d, g, optimize=True)
        inner = np.einsum("eqik,eqkl,eqjk->eqijl", g, d, g, optimize=True)
        for k in range(3):
            out[:, :, :, k, :, k] += inner[..., k]
            for i in range(3):
                out[:, :, i, k, i, k] += s[..., k]
        return out

    @staticmethod
    def _damp(tangent: Array, g: Array, c: Array, s: Array, scale: float) -> None:
        """Scale the modes that turn pairs of axes against each other where they are negative."""
        stretch = np.sqrt(c)
        u = g / stretch[..., None, :]
        for k, m in ((0, 1), (0, 2), (1, 2)):
            value = (s[..., k] * stretch[..., k] + s[..., m] * stretch[..., m]) / (stretch[..., k] + stretch[..., m])
            mode = np.zeros(g.shape)
            mode[..., m], mode[..., k] = u[..., k], -u[..., m]
            tangent += np.einsum("eq,eqil,eqjm->eqiljm", (scale - 1) / 2 * np.minimum(value, 0), mode, mode,
                                 optimize=True)

    @staticmethod
    def _matrices(along: Array, tangent: Array) -> Array:
        count = len(along)
        out = np.empty((count, 27, 3, 27, 3))
        flat = np.ascontiguousarray(along.transpose(0, 2, 1, 3)).reshape(count, 27, -1)
        for i in range(3):
            for j in range(i, 3):
                block = flat @ (tangent[:, :, i, :, j] @ np.swapaxes(along, -1, -2)).reshape(count, -1, 27)
                out[:, :, i, :, j] = block
                if i != j:
                    out[:, :, j, :, i] = np.swapaxes(block, 1, 2)
        return out.reshape(count, 81, 81)


def solved(matrix: csr_matrix, starts: Indices, right: tuple[Array, ...]) -> tuple[list[Array], bool]:
    """Solutions with a symmetric matrix given by its upper half, and whether it is positive definite, else nothing.

    Cholesky's method on dense blocks: the unknowns from one start to the next couple with the next ones alone.
    """
    device = "cuda" if torch.cuda.is_available() else "cpu"
    columns, values = (torch.as_tensor(one, device=device) for one in (matrix.indices, matrix.data))
    left = torch.as_tensor(np.stack(right, axis=1), device=device)
    factors, reach = [], 0
    carried, carried_right = (torch.zeros(shape, dtype=torch.float64, device=device) for shape in ((0, 0), (0, 2)))
    for start, end in itertools.pairwise([*starts.tolist(), matrix.shape[0]]):
        size, part = end - start, slice(int(matrix.indptr[start]), int(matrix.indptr[end]))
        row = torch.repeat_interleave(torch.as_tensor(np.diff(matrix.indptr[start:end + 1]), device=device)).long()
        column = columns[part].long() - start
        block = torch.zeros((max(int(column.max()) + 1, size), size), dtype=torch.float64, device=device)
        block[column, row] = values[part]
        block[:reach, :reach] -= carried
        left[start:start + reach] -= carried_right
        lower, fault = torch.linalg.cholesky_ex(block[:size])
        if fault:
            return [], False
        below = torch.linalg.solve_triangular(lower.mT, block[size:], upper=True, left=False)
        left[start:end] = torch.linalg.solve_triangular(lower, left[start:end], upper=False)
        carried, carried_right, reach = below @ below.mT, below @ left[start:end], len(below)
        factors.append((slice(start, end), lower, below))
    for part, lower, below in reversed(factors):
        rest = left[part] - below.mT @ left[part.stop:part.stop + len(below)]
        left[part] = torch.linalg.solve_triangular(lower.mT, rest, upper=True)
    return list(left.cpu().numpy().T), True


def equilibrium(foam: Foam, u: Array, depth: float) -> tuple[Array, float, int]:
    """Newton's method with the force given, downhill in the energy; displacement, depth and steps. What may be negative
    in the second derivatives is left out of a step where they are not positive definite, or the last one led nowhere.
    """
    scale, energy = 1.0, foam.energy(u, depth)
    for step in range(MOST_STEPS):
        residual, pushed, matrix, border, stiff = foam.derivatives(u, depth, scale)
        found, definite = solved(matrix, foam.starts, (residual, border))
        if not definite:
            if scale == 0:
                raise SystemExit("not positive definite")
            scale = 0.0
            continue
        first, second = found
        schur = stiff - float(border @ second)
        by_depth = -(pushed - float(border @ first)) / schur
        by_u = -first - second * by_depth
        slope = float(residual @ by_u + pushed * by_depth)
        if scale == 1 and not (schur > 0 and slope < 0):
            scale = 0.0
            continue
        if abs(slope) < LEAST * foam.problem.force * foam.problem.thickness:
            return u + by_u, depth + by_depth, step + 1
        part, found = 1.0, np.inf
        while part > SHORTEST and not found < energy + ABOVE * part * slope:
            part /= 2
            found = foam.energy(u + 2 * part * by_u, depth + 2 * part * by_depth)
        part *= 2
        u, depth, energy = u + part * by_u, depth + part * by_depth, found
        print(f"    {step}: slope {slope:.1e}, part {part:g}, scale {scale:g}, depth {depth:.4f} mm", flush=True)
        scale = 1.0 if part > SHORT else 0.0
    raise SystemExit(f"not converged after {MOST_STEPS} steps")


def located(mesh: Mesh, x: Array) -> tuple[Indices, Array]:
    """Nodes (n, 27) of the elements that points (n, 3) of the undeformed foam lie in, y >= 0, and where in them."""
    angle, r = np.arctan2(x[:, 1], x[:, 0]), np.hypot(*x[:, :2].T)
    sector = np.clip(np.searchsorted(mesh.angles[::2], angle, side="right") - 1, 0, mesh.cells.shape[1] - 1)
    layer = np.clip(np.searchsorted(mesh.heights[::2], x[:, 2], side="right") - 1, 0, mesh.cells.shape[2] - 1)
    lines = radii(mesh.radial, mesh.problem, angle)[::2]
    ring = np.clip(np.sum(lines <= r, axis=0) - 1, 0, len(lines) - 2)
    cell, low, high = mesh.cells[ring, sector, layer], mesh.heights[2 * layer], mesh.heights[2 * layer + 2]
    place = mesh.nodes[cell[:, 2::3]][..., :2]
    at = np.zeros((len(x), 2))
    for _ in range(20):
        value, slope = quadratic(at)[0], quadratic(at)[1]
        (a, b), (da, db) = np.moveaxis(value, 1, 0), np.moveaxis(slope, 1, 0)
        on, by_s, by_t = (np.einsum("ni,nj->nij", *f).reshape(len(x), -1) for f in ((a, b), (da, b), (a, db)))
        jacobian = np.stack([np.einsum("na,nax->nx", one, place) for one in (by_s, by_t)], -1)
        jacobian[r < 1e-9] = np.eye(2)  # the axis, where any angle is right
        left = x[:, :2] - np.einsum("na,nax->nx", on, place)
        at = np.clip(at + np.linalg.solve(jacobian, left[..., None])[..., 0], -1.2, 1.2)
    return cell, np.column_stack([at, (2 * x[:, 2] - low - high) / (high - low)])


def displacement(mesh: Mesh, moved: Array, x: Array) -> Array:
    """Of nodal displacements (nodes, 3), that at points (n, 3)."""
    cell, at = located(mesh, x)
    a, b, c = np.moveaxis(quadratic(at)[0], 1, 0)
    return np.einsum("ni,nj,nk,nijkx->nx", a, b, c, moved[cell].reshape(len(x), 3, 3, 3, 3), optimize=True)


def surface_deformation(mesh: Mesh, moved: Array, x: Array) -> Array:
    """Of nodal displacements (nodes, 3), the deformation gradients (n, 3, 3) at points (n, 2) of the undeformed top.

    Slopes of quadratics are a power of the element more exact at two Gauss points along each coordinate than elsewhere:
    between those stand cubics, monotone along the radii.
    """
    t = np.array([-1.0, 1.0]) / np.sqrt(3)
    top = mesh.cells[:, :, -1]
    found = np.empty((len(top), 2, top.shape[1], 2, 3, 3))
    for i, one in enumerate(t):
        for j, other in enumerate(t):
            slope = slopes(*np.array([[one], [other], [1.0]]))[0]
            inverse = np.linalg.inv(np.einsum("rsax,ac->rsxc", mesh.nodes[top], slope))
            found[:, i, :, j] = np.eye(3) + np.einsum("rsai,ac,rscx->rsix", moved[top], slope, inverse)
    found = found.reshape(2 * len(top), 2 * top.shape[1], 9)

    def points(ends: Array) -> Array:
        return (((ends[1:] + ends[:-1]) / 2)[:, None] + np.diff(ends)[:, None] / 2 * t).ravel()

    angle, r = np.arctan2(x[:, 1], x[:, 0]), np.hypot(*x.T)
    # radii are seen along the line on which the outline is furthest, and angles on both sides of the plane of symmetry
    straight = radii(mesh.radial, mesh.problem, np.array([np.pi]))[:, 0]
    lines = radii(mesh.radial, mesh.problem, angle)
    seen = np.array([np.interp(one, own, straight) for one, own in zip(r, lines.T, strict=True)])
    at = points(mesh.angles[::2])
    mirror = np.outer([1, -1, 1], [1, -1, 1]).ravel()
    around = CubicSpline(np.concatenate([-at[1::-1], at, 2 * np.pi - at[:-3:-1]]), np.concatenate(
        [found[:, 1::-1] * mirror, found, found[:, :-3:-1] * mirror], axis=1), axis=1)(angle)
    outwards = PchipInterpolator(points(straight[::2]), around, axis=0, extrapolate=True)
    place = np.clip(np.searchsorted(outwards.x, seen, side="right") - 1, 0, len(outwards.x) - 2)
    way = seen - outwards.x[place]
    powers = way[:, None] ** np.arange(3, -1, -1)
    return np.einsum("kpf,pk->pf", outwards.c[:, place, np.arange(len(x))], powers).reshape(-1, 3, 3)


def main(folder: Path) -> None:
    given = dict(np.load(folder / "problem.npz"))
    points = given.pop("points")
    meshes, force = zip(given.pop("elements"), given.pop("sectors"), strict=True), float(given.pop("force"))
    numbers = {name: value if value.ndim else value.item() for name, value in given.items()}
    before, depth, entered, found = None, START, 0.0, {}
    for number, (element, sectors) in enumerate(meshes):
        begun, begun_s = time.process_time(), time.perf_counter()
        problem = Problem(**numbers, force=force, element=float(element), sectors=int(sectors))
        mesh = mesh_of(problem)
        foam, steps, depths = Foam(mesh), 0, []
        u = np.zeros(foam.size) if before is None else displacement(*before, mesh.nodes)[mesh.free]
        path = [(1.0, PENALTIES[-1])]
        if before is None:
            path = [*((share, PENALTIES[0]) for share in SHARES), *((1.0, k) for k in PENALTIES[1:])]
        print(f"{mesh.cells.size // 27} elements, {foam.size} unknowns", flush=True)
        for share, penalty in path:
            foam.problem = replace(problem, force=share * force, penalty=penalty)
            u, depth, more = equilibrium(foam, u, depth)
            steps, depths = steps + more, [*depths, depth]
            print(f"  {share * force:.0f} mN, {penalty:g} kPa/mm: {depth:.4f} mm, {time.process_time() - begun:.0f} "
                  f"CPU s, {time.perf_counter() - begun_s:.0f} s", flush=True)
        before = mesh, foam.spread(u)
        if len(depths) > 1:  # what the foam enters the punch goes as one over the penalty
            entered = (depths[-2] - depth) / (PENALTIES[-1] / PENALTIES[-2] - 1)
        row = {"depth": depth - entered, "entered": entered, "steps": steps, "element": element, "sectors": sectors,
               "gradient": surface_deformation(*before, points), "unknowns": foam.size,
               "cpu_s": time.process_time() - begun, "wall_s": time.perf_counter() - begun_s,
               "machine": f"{os.cpu_count()} cores, " + (torch.cuda.get_device_name() if torch.cuda.is_available()
                                                         else "no GPU")}
        found |= {f"{name}_{number}": value for name, value in row.items()}
        np.savez(folder / "found.npz", **found)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
