"""Touches of one upright punch on a cylinder, far from its ends: solved once a load, and taken to any place.

A cap of the cylinder's mean curvature has nearly such a touch, which is axisymmetric and solved for every load. What
the cylinder changes of it is smooth in load and diameter: a table holds it, by the angle about the punch in harmonics
and along radii that are scaled so that contact ends at 1.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator, CubicSpline

from eitsim.mechanics.curved.solve_on_cap import CapField, solve_on_cap
from eitsim.mechanics.curved.solve_on_surface import solve_on_surface
from eitsim.mechanics.general.layer.layer_field import metric_of
from eitsim.mechanics.general.layer.layer_surface import nominal_moments
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Punch
from eitsim.scene.surfaces.cylinder import Cylinder
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.jit import cpu_s

Complex = NDArray[np.complexfloating[Any, Any]]
Run = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]

# Radii: shares of the contact's, closer towards its end, then thicknesses outside it, up to the reach.
_REACH, _INSIDE, _OUTSIDE = 4.0, 32, 48
_SCALED = np.append(1 - (np.arange(_INSIDE, 0, -1) / _INSIDE) ** 2, 1 + _REACH * (np.arange(_OUTSIDE) / (
    _OUTSIDE - 1)) ** 2)
_ANGLES = 24  # directions, and so harmonics up to half as many
# Nodes a factor e of the loads, and the fewest; and those a factor e of the diameters.
_LOADS, _FEWEST, _DIAMETERS = 2.0, 5, 3.0
# What leaving a node out of a spline changes there over what the spline is off between all nodes: cubic, half as wide.
_BY_LEAVING_OUT = 0.125
_LONG = 60.0  # thicknesses of a cylinder whose ends do not count
# what a table holds of a touch, over that on the cap
_RATIOS = ("depth_m", "force_N", "sigma_max_Pa", "contact_area_m2", "contact_radius_m")


@dataclass(frozen=True)
class MovedShape:
    """What a table is made for."""

    law: Law
    radius_m: float
    thickness_m: float
    punch: Punch  # upright and at no place; its diameter and load are those of the nodes
    by: Literal["force_N", "depth_m"]
    loads: tuple[float, float]  # least and largest, N or m
    diameters_m: tuple[float, ...]  # increasing: the ends of a range, or all there are
    spans: bool  # whether all diameters between the ends are served

    @property
    def load_nodes(self) -> Array:
        """Loads that are solved, evenly spaced in the logarithm; one where there is one alone."""
        low, high = self.loads
        if low == high:
            return np.array([low])
        return np.geomspace(low, high, max(_FEWEST, 1 + int(np.ceil(_LOADS * np.log(high / low)))))

    @property
    def diameter_nodes(self) -> Array:
        """Diameters that are solved: of a range Chebyshev points of the logarithm with the ends."""
        if not self.spans:
            return np.array(self.diameters_m)
        low, high = np.log(self.diameters_m[0]), np.log(self.diameters_m[-1])
        count = 2 + int(np.ceil(_DIAMETERS * (high - low)))
        return np.exp((low + high) / 2 - (high - low) / 2 * np.cos(np.pi * np.arange(count) / (count - 1)))

    def pressed(self, diameter_m: float, load: float) -> Punch:
        """The punch of a diameter under a load."""
        given = {"force_N": None, "depth_m": None} | {self.by: load}
        return replace(self.punch, diameter_m=diameter_m, **given)


@dataclass(frozen=True, eq=False)
class MovedTable:
    """What a cylinder changes of touches on a cap."""

    shape: MovedShape
    # (diameters, loads, radii, orders, 12) complex amplitudes of the change of F, row by row along the outward way, the
    # way around and the normal, then of the displacement over the thickness
    waves: Complex
    ratios: Array  # (diameters, loads, _RATIOS)
    wall: Array  # (diameters, loads) added wall contact over the thickness squared
    # (diameters, loads, 4) errors of depth and of signals, by STRAINS, that the solutions state
    stated: Array
    error: Array  # (4,) of depth and signals, by STRAINS, that lie between nodes
    cpu_s: float

    @property
    def paths(self) -> int:
        """How many diameters it holds."""
        return len(self.waves)

    def serves(self, punch: Punch) -> bool:
        """Whether the table holds the touch of a punch, far from ends."""
        load, d = getattr(punch, self.shape.by), punch.diameter_m
        if load is None or replace(self.shape.pressed(d, load), x_m=punch.x_m, y_m=punch.y_m) != punch:
            return False
        low, high = self.shape.loads
        between = self.shape.diameters_m[0] <= d <= self.shape.diameters_m[-1]
        known = between if self.shape.spans else d in self.shape.diameters_m
        return known and low <= load <= high

    def touch(self, punch: Punch) -> "tuple[Touch, MovedField]":
        """The touch of a punch that it serves, and its field."""
        started, shape, unit = cpu_s(), self.shape, self.shape.thickness_m
        cap, field = _on_cap(shape, punch)
        at = partial(_at, shape, punch)
        ratio = dict(zip(_RATIOS, np.exp(at(np.log(self.ratios))).tolist(), strict=True))
        moved = MovedField(field, at(self.waves), cap.contact_radius_m, unit)
        errors = self.error + self.stated.max(axis=(0, 1))
        values = {name: getattr(cap, name) * by for name, by in ratio.items()}
        area = min(values["contact_area_m2"], np.pi * punch.diameter_m**2 / 4)
        force = punch.force_N if punch.force_N is not None else values["force_N"]
        depth = punch.depth_m if punch.depth_m is not None else values["depth_m"]
        return replace(cap, **values | {
            "force_N": force, "depth_m": depth, "contact_area_m2": area, "sigma_ave_Pa": force / area,
            "wall_contact_m2": max(cap.wall_contact_m2 + float(at(self.wall)) * unit**2, 0.0),
            "depth_error": cap.depth_error + errors[0], "signal_errors": cap.signal_errors + errors[1:],
            "sigma_max_error": None, "contact_area_error": None, "contact_end_error": None, "strain_errors": None,
            "surface": moved, "cpu_s": cpu_s() - started, "iterations": 0}), moved


@dataclass(frozen=True, eq=False)
class MovedField:
    """A touch's surface by coordinates about its place: along the cylinder, and around it."""

    cap: CapField
    waves: Complex  # (radii, orders, 12)
    contact_m: float  # the cap's radius of contact, by which radii are scaled
    unit_m: float

    @property
    def reach_m(self) -> float:
        """Distance from the origin outside which nothing is deformed."""
        return max(self.contact_m + _REACH * self.unit_m, float(self.cap.surface.radius[-1]) * self.unit_m)

    def metric(self, points_m: Array) -> tuple[Array, Array]:
        """As of `SurfaceField`."""
        return metric_of(self.deformation_gradient(points_m))

    def deformation_gradient(self, points_m: Array) -> Array:
        """F (..., 3, 3) at places (..., 2), m."""
        points = np.reshape(points_m, (-1, 2))
        added, turn = self._changed(points)
        f = self.cap.deformation_gradient(points) + turn @ added[:, :9].reshape(-1, 3, 3) @ np.swapaxes(turn, 1, 2)
        return f.reshape(*np.shape(points_m)[:-1], 3, 3)

    def displacement(self, points_m: Array) -> Array:
        """Displacements (..., 3), m, at places (..., 2), m."""
        points = np.reshape(points_m, (-1, 2))
        added, turn = self._changed(points)
        moved = self.cap.displacement(points) + self.unit_m * (turn @ added[:, 9:, None])[..., 0]
        return moved.reshape(*np.shape(points_m)[:-1], 3)

    def _changed(self, points_m: Array) -> tuple[Array, Array]:
        """The change (n, 12) at places (n, 2), and the ways (n, 3, 3) it is along, in columns."""
        radius, angle = np.hypot(*points_m.T), np.arctan2(*points_m.T[::-1])
        scaled = np.where(radius < self.contact_m, radius / self.contact_m, 1 + (radius - self.contact_m) / self.unit_m)
        inside, order = scaled <= _SCALED[-1], np.arange(self.waves.shape[1])
        out, turns = np.zeros((len(points_m), 12)), np.exp(1j * angle[inside, None] * order)
        along = CubicSpline(_SCALED, self.waves, bc_type="natural")(scaled[inside])
        out[inside] = np.einsum("nk,nkc->nc", turns, along).real
        return out, _ways(angle)


def solved_table(shape: MovedShape, run: Run = map) -> MovedTable:
    """The table of a shape; `run` maps a function over loads and diameters, possibly in other processes. NotConverged
    where one has no equilibrium."""
    nodes = [(d, load) for d in shape.diameter_nodes.tolist() for load in shape.load_nodes.tolist()]
    found = list(run(partial(_solved, shape), nodes))
    size = (len(shape.diameter_nodes), len(shape.load_nodes))
    waves, ratios, wall, stated = (np.stack([one[k] for one in found]).reshape(*size, *np.shape(found[0][k]))
                                   for k in range(4))
    table = MovedTable(shape, waves.astype(np.complex64), ratios, wall, stated, np.zeros(1 + len(STRAINS)),
                       sum(one[4] for one in found))
    return replace(table, error=_between(table))


def _solved(shape: MovedShape, node: tuple[float, float]) -> tuple[Complex, Array, float, Array, float]:
    """Waves, ratios, added wall contact, and stated errors at a node, and the CPU time."""
    started, unit, punch = cpu_s(), shape.thickness_m, shape.pressed(*node)
    surface = Cylinder(shape.radius_m, 2 * _LONG * unit)
    solution = solve_on_surface(shape.law, surface, unit, [punch], np.array([[0.0, 0.0, shape.radius_m]]))
    (touch,), (part,) = solution.touches, solution.field.parts
    cap, field = _on_cap(shape, punch)
    contact = cap.contact_radius_m
    radius = np.where(_SCALED < 1, _SCALED * contact, contact + (_SCALED - 1) * unit)
    angle = np.broadcast_to(2 * np.pi * np.arange(_ANGLES) / _ANGLES, (len(radius), _ANGLES))
    points = (radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).reshape(-1, 2)
    turn = _ways(angle.ravel())
    back = np.swapaxes(turn, 1, 2)
    gradient = back @ (part.field.deformation_gradient(points) - field.deformation_gradient(points)) @ turn
    moved = (back @ (part.field.displacement(points) - field.displacement(points))[..., None])[..., 0] / unit
    values = np.concatenate([gradient.reshape(-1, 9), moved], axis=1).reshape(len(radius), _ANGLES, 12)
    waves = np.fft.rfft(values, axis=1) / _ANGLES
    waves[:, 1:-1] *= 2
    ratios = np.array([getattr(touch, name) / getattr(cap, name) for name in _RATIOS])
    return (waves, ratios, (touch.wall_contact_m2 - cap.wall_contact_m2) / unit**2,
            np.append(touch.depth_error, touch.signal_errors), cpu_s() - started)


def _on_cap(shape: MovedShape, punch: Punch) -> tuple[Touch, CapField]:
    return solve_on_cap(shape.law, shape.thickness_m, punch, 1 / (2 * shape.radius_m))


def _ways(angle: Array) -> Array:
    """Outward way, way around and normal (n, 3, 3), in columns, at angles (n,)."""
    cosine, sine, none = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    return np.stack([np.stack([cosine, -sine, none], -1), np.stack([sine, cosine, none], -1),
                     np.stack([none, none, none + 1], -1)], axis=-2)


def _at(shape: MovedShape, punch: Punch, values: NDArray[Any]) -> NDArray[Any]:
    """Values (diameters, loads, ...) of nodes at a punch's diameter and load: cubics of the logarithm of the load, and
    of a range of diameters the polynomial of theirs."""
    diameters = shape.diameter_nodes
    if not shape.spans:
        values = values[[int(np.argmin(np.abs(diameters - punch.diameter_m)))]]
    by_load = _by_load(shape.load_nodes, values, getattr(punch, shape.by))
    if len(by_load) == 1:
        return by_load[0]
    return BarycentricInterpolator(np.log(diameters), by_load)(np.log(punch.diameter_m))


def _by_load(nodes: Array, values: NDArray[Any], load: float) -> NDArray[Any]:
    return values[:, 0] if len(nodes) == 1 else CubicSpline(np.log(nodes), values, axis=1)(np.log(load))


def _between(table: MovedTable) -> Array:
    """(4,) deviation of depth and of nominal signals between nodes, by leaving each inner node of the loads out, and of
    the diameters where these are a range."""
    shape, out = table.shape, np.zeros(1 + len(STRAINS))
    loads, diameters = shape.load_nodes, shape.diameter_nodes
    for i in range(len(diameters)):
        for j in range(len(loads)):
            punch = shape.pressed(float(diameters[i]), float(loads[j]))
            rest = [*range(j), *range(j + 1, len(loads))]
            if 0 < j < len(loads) - 1:
                other = replace(table, **{name: _without(getattr(table, name), i, rest, loads, j)
                                          for name in ("waves", "ratios")})
                out = np.maximum(out, _BY_LEAVING_OUT * _deviation(other, table, punch))
            if shape.spans and 0 < i < len(diameters) - 1:
                kept = [*range(i), *range(i + 1, len(diameters))]
                other = replace(table, **{name: _without_diameter(getattr(table, name), i, j, kept, diameters)
                                          for name in ("waves", "ratios")})
                out = np.maximum(out, _BY_LEAVING_OUT * _deviation(other, table, punch))
    return out


def _without(values: NDArray[Any], i: int, rest: list[int], loads: Array, j: int) -> NDArray[Any]:
    """The values with those of diameter i at load j as the other loads foresee them."""
    out = values.copy()
    out[i, j] = _by_load(loads[rest], values[[i]][:, rest], float(loads[j]))[0]
    return out


def _without_diameter(values: NDArray[Any], i: int, j: int, kept: list[int], diameters: Array) -> NDArray[Any]:
    """The values with those of diameter i at load j as the other diameters foresee them."""
    out = values.copy()
    out[i, j] = BarycentricInterpolator(np.log(diameters[kept]), values[kept, j])(np.log(diameters[i]))
    return out


def _deviation(one: MovedTable, other: MovedTable, punch: Punch) -> Array:
    """(4,) how far depths and nominal signals of a punch by two tables are from each other, relative."""
    (touch, field), (reference, exact) = one.touch(punch), other.touch(punch)
    radius = np.where(_SCALED < 1, _SCALED * exact.contact_m, exact.contact_m + (_SCALED - 1) * exact.unit_m)
    middle, step = (radius[1:] + radius[:-1]) / 2, np.diff(radius)
    angle = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
    points = (middle[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).reshape(-1, 2)
    areas = np.repeat(middle * step * 2 * np.pi / _ANGLES, _ANGLES)
    moments = [nominal_moments(each, points, areas) for each in (field, exact)]
    missed = [float(np.linalg.norm(a - b) / np.linalg.norm(b)) for a, b in zip(*moments, strict=True)]
    return np.array([abs(touch.depth_m / reference.depth_m - 1), *missed])
