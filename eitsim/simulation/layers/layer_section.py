"""A touched layer on its section: its resultant through the thickness, and what its volume scatters.

With the potential u(r, z) cos(m theta) a touch that is axisymmetric scatters each harmonic m by itself. On the
untouched shape the energy is int (s_rr u_r^2 + 2 s_rz u_r u_z + s_zz u_z^2 + m^2 s_hh u^2 / r^2) r dr dz, s the
conductivity J F^-1 s F^-T. What depends on the height dies out as exp(-pi r / thickness), so that at a radius outside
the touch u is even through the thickness, and the energy there is the admittance that a sheet has.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from eitsim.electrics.cem.ring_scattering import ring_share, scattering
from eitsim.mechanics.solid.section_gradient import displacement_gradient, order_of, resisted_deformation, shapes
from eitsim.scene.pressing import Skin
from eitsim.scene.results import Section, Touch
from eitsim.scene.scene import Punch
from eitsim.sheet.layer_conductivity import (
    as_sheet_touch,
    referred_conductivity,
    sheet_law,
    sheet_skin,
    strained_outside,
    without_cross_current,
)
from eitsim.sheet.sheet_conductance import admittance
from matcal.laws.conductivity import Conductivity
from touchcal.arrays import Array

Indices = NDArray[np.integer]

_HARMONICS = 2  # By which a sheet is compared with the volume.
# Thicknesses outside the contact as far as the volume is solved: exp(-pi _CORE) is what is left of what depends on the
# height. Parts that rings between samples are cut into.
_CORE, _PARTS = 3.0, 2
# Harmonic m of a touch dies out to its reach as (contact and one thickness over reach)^2m: those of less than this
# part of the first one's are taken as the sheet's.
_LEAST_HARMONIC = 1e-5


@dataclass(frozen=True, eq=False)
class LayerSection:
    """A touched layer at the Gauss points of its section's elements."""

    section: Section
    sigma: Array  # (elements, q, 3, 3) conductivity over that at rest, on the untouched shape: along r, z and around
    outside: NDArray[np.bool_]  # (elements, q) where it is strained outside the fit of its conductivity
    contact_m: float  # radius at which the contact ends, m

    @cached_property
    def at(self) -> tuple[Array, Array]:
        """Gauss points (q, 2) in [-1, 1] and their weights (q,)."""
        return _gauss(order_of(self.section))

    @cached_property
    def half_m(self) -> Array:
        """(elements, 2) half the sizes of the elements, m."""
        place = self.section.nodes_m[self.section.elements]
        return (place[:, 2] - place[:, 0]) / 2

    @cached_property
    def radius_m(self) -> Array:
        """(elements, q) radii of the points, m."""
        first = self.section.nodes_m[self.section.elements[:, 0], 0]
        return first[:, None] + self.half_m[:, :1] * (1 + self.at[0][:, 0])

    @property
    def thickness_m(self) -> float:
        return float(np.ptp(self.section.nodes_m[:, 1]))

    @property
    def volumes_m3(self) -> Array:
        """(elements, q) volumes that the points stand for, m^3."""
        return 2 * np.pi * self.at[1] * np.prod(self.half_m, axis=1)[:, None] * self.radius_m

    @property
    def changes(self) -> Array:
        """(elements, q) sizes of the changes of the in-plane conductivity, times the volumes."""
        return self.volumes_m3 * np.abs(self.sigma[..., [0, 2], [0, 2]] - 1).sum(axis=-1)

    @cached_property
    def columns(self) -> tuple[Indices, Array, Array]:
        """(elements, q) the number of each point's radius, its share of the thickness, and the in-plane conductivities
        (elements, q, 2) without current across the layer."""
        (at, weights), first = self.at, self.section.nodes_m[self.section.elements[:, 0], 0]
        steps = np.unique(at[:, 0], return_inverse=True)[1]
        slot = np.unique(first, return_inverse=True)[1][:, None] * (steps.max() + 1) + steps
        across = weights / np.bincount(steps, weights)[steps]
        plane = without_cross_current(self.sigma, 1)
        return (slot, self.half_m[:, 1:] * 2 * across / self.thickness_m,
                np.stack([plane[..., 0, 0], plane[..., 1, 1]], axis=-1))

    def resultants(self) -> tuple[Array, Array, Array]:
        """Radii (n,), m, increasing from 0, and conductances (n,) there along the meridian and around, over those at
        rest: int of the conductivity without current across the layer."""
        slot, share, plane = self.columns
        radius = np.empty(slot.max() + 1)
        radius[slot.ravel()] = self.radius_m.ravel()
        meridian, hoop = (np.bincount(slot.ravel(), (share * plane[..., i]).ravel()) for i in (0, 1))
        middle = np.sqrt(meridian[0] * hoop[0])
        return np.append(0.0, radius), np.append(middle, meridian), np.append(middle, hoop)

    def scattering(self, reach_m: float, orders: int) -> Array:
        """(orders,) as of `ring_scattering.scattering`: rings of the resultant; as far as _CORE thicknesses outside the
        contact times what the volume makes of it, on one mesh."""
        m, last = np.arange(1.0, orders + 1), self._core_m(reach_m)
        radius, meridian, hoop = self.resultants()
        share = ring_share(radius, reach_m)
        sheet = radius, 1 + share * (meridian - 1), 1 + share * (hoop - 1)
        y = _through_rings(m * np.sqrt(sheet[1][0] * sheet[2][0]), sheet, float(radius[1]), last)
        volume, there = np.ones(orders), self._orders(reach_m, orders)
        volume[:there] = self._by_volume(last, reach_m, sheet, m[:there])
        y = _through_rings(y * volume, sheet, last, max(reach_m, last))
        return (m - y) / (m + y)

    def _orders(self, reach_m: float, orders: int) -> int:
        """How many harmonics are solved in the volume."""
        part = (self.contact_m + self.thickness_m) / reach_m
        return orders if part >= 1 else min(orders, 1 + math.ceil(math.log(_LEAST_HARMONIC) / (2 * math.log(part))))

    def first_potential(self) -> tuple[NDArray[np.bool_], Array]:
        """The elements (elements,) in which the volume is solved, and the potential (nodes,) of the first harmonic, 1
        where they end and 0 outside them."""
        nodes, elements = self.section.nodes_m, self.section.elements
        last = self._core_m(np.inf)
        inner = nodes[elements[:, 1], 0] <= last * (1 + 1e-12)
        _, found = _solved(nodes, elements[inner], last, *self._matrices(self.sigma[inner], inner), np.ones(1))
        return inner, np.append(found, np.zeros(len(nodes) - len(found)))

    def _core_m(self, reach_m: float) -> float:
        """Radius of nodes as far as which the volume is solved, m."""
        ends = np.unique(self.section.nodes_m[self.section.elements[:, 1], 0])
        core_m = min(self.contact_m + _CORE * self.thickness_m, reach_m)
        return float(ends[max(np.searchsorted(ends, core_m * (1 + 1e-12), side="right") - 1, 0)])

    def _by_volume(self, last_m: float, reach_m: float, sheet: tuple[Array, Array, Array], m: Array) -> Array:
        """(orders,) admittances of the volume at a radius last_m of nodes, over those of its sheet on the same mesh."""
        nodes, elements = self.section.nodes_m, self.section.elements
        inner = nodes[elements[:, 1], 0] <= last_m * (1 + 1e-12)
        share = ring_share(self.radius_m[inner], reach_m)[..., None, None]
        volume = np.eye(3) + share * (self.sigma[inner] - np.eye(3))
        even, slot = np.zeros_like(volume), self.columns[0][inner] + 1
        even[..., 0, 0], even[..., 1, 1], even[..., 2, 2] = sheet[1][slot], 1.0, sheet[2][slot]
        found, flat = (_solved(nodes, elements[inner], last_m, *self._matrices(each, inner), m)[0]
                       for each in (volume, even))
        return found / flat

    def _matrices(self, sigma: Array, inner: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Matrices (elements, k, k) of the energy: what slopes along the section give, and of m^2."""
        (at, weights), half, radius = self.at, self.half_m[inner], self.radius_m[inner]
        value, by_r, by_z = shapes(order_of(self.section), at)
        slope = np.stack([by_r[None] / half[:, :1, None], by_z[None] / half[:, 1:, None]], axis=-1)
        area = weights * half[:, :1] * half[:, 1:]
        flow = slope @ sigma[..., :2, :2] * (area * radius)[..., None, None]
        along = np.einsum("eqki,eqli->ekl", flow, slope, optimize=True)
        return along, np.einsum("qk,eq,ql->ekl", value, area / radius * sigma[..., 2, 2], value, optimize=True)


def layer_section(touch: Touch, skin: Skin, law: Conductivity) -> LayerSection:
    """The layer on a touch's section; NotPositive where its conductivity is not positive."""
    assert touch.section is not None
    section = touch.section
    at, _ = _gauss(order_of(section))
    gradient = resisted_deformation(section, displacement_gradient(section, at), at)
    return LayerSection(section, referred_conductivity(law, skin, gradient) / law.c0_S_per_m,
                        strained_outside(law, skin, gradient), touch.contact_radius_m)


def sheet_of(layer: LayerSection, touch: Touch) -> Touch:
    """The touch on a sheet whose conductance is the layer's resultant."""
    return as_sheet_touch(touch, *layer.resultants())


def sheet_error(layer: LayerSection, sheet: Touch, punch: Punch, skin: Skin, law: Conductivity,
                reach_m: float) -> float:
    """How far the sheet's moments are off those of the volume, relative: the largest of the first harmonics', each over
    its own, in a circle of reach_m."""
    by_sheet = scattering(punch, sheet, sheet_skin(skin), sheet_law(law), reach_m, _HARMONICS, 2)
    exact = layer.scattering(reach_m, _HARMONICS)
    return float(np.max(np.abs(by_sheet / exact - 1)))


def in_volume(layer: LayerSection, sheet: Touch) -> Touch:
    """The touch on the sheet that scatters what the layer's volume does."""
    return replace(sheet, scatterer=layer)


def _gauss(order: int) -> tuple[Array, Array]:
    """Gauss points (q, 2) in [-1, 1] of an element, order + 1 in each direction, and their weights (q,)."""
    point, weight = np.polynomial.legendre.leggauss(order + 1)
    return np.stack(np.meshgrid(point, point, indexing="ij"), axis=-1).reshape(-1, 2), np.outer(weight, weight).ravel()


def _through_rings(y: Array, sheet: tuple[Array, Array, Array], first_m: float, last_m: float) -> Array:
    """Admittances (orders,) of a sheet's rings, conductances as of `resultants`, from those at one radius to another's.
    """
    stops = np.unique([first_m, *sheet[0][(sheet[0] > first_m) & (sheet[0] < last_m)], last_m])
    if len(stops) < 2:
        return y
    radii = np.interp(np.arange(_PARTS * (len(stops) - 1) + 1) / _PARTS, np.arange(len(stops)), stops)
    along, around = (np.interp((radii[1:] + radii[:-1]) / 2, sheet[0], part) for part in sheet[1:])
    return admittance(y, np.arange(1.0, len(y) + 1)[:, None] * np.sqrt(along * around), along, radii)


def _solved(nodes_m: Array, elements: Indices, last_m: float, along: Array, around: Array,
            order: Array) -> tuple[Array, Array]:
    """(orders,) energies of potentials u cos(m theta) that are 0 at the axis and 1 at radius last_m, of the elements'
    matrices (elements, k, k); and the last order's potential at their nodes."""
    count, k = int(elements.max()) + 1, elements.shape[1]
    rows, columns = np.repeat(elements, k, axis=1).ravel(), np.tile(elements, k).ravel()
    known = nodes_m[:count, 0] >= last_m * (1 - 1e-12)
    free = np.flatnonzero(~known & (nodes_m[:count, 0] > 0))
    low, high, width = int(free[0]), int(free[-1]) + 1, int(np.max(np.ptp(elements, axis=1)))
    bands, loads = zip(*((_banded(rows, columns, part, low, high, width), _on_known(rows, columns, part, known, count))
                         for part in (along, around)), strict=True)
    found, u = np.empty(len(order)), np.empty(0)
    for i, m in enumerate(order):
        load, own = (loads[0][j] + m**2 * loads[1][j] for j in (0, 1))
        u = solveh_banded(bands[0] + m**2 * bands[1], -load[low:high], lower=True, overwrite_ab=True)
        found[i] = own + load[low:high] @ u
    return found, np.concatenate([np.zeros(low), u, known[high:].astype(np.float64)])


def _banded(rows: Indices, columns: Indices, local: Array, low: int, high: int, width: int) -> Array:
    """Lower band (width + 1, high - low) of a matrix's rows and columns from low to high."""
    kept = (rows >= columns) & (columns >= low) & (rows < high)
    band = np.zeros((width + 1, high - low))
    np.add.at(band, ((rows - columns)[kept], (columns - low)[kept]), local.ravel()[kept])
    return band


def _on_known(rows: Indices, columns: Indices, local: Array, known: NDArray[np.bool_], count: int
              ) -> tuple[Array, float]:
    """What unknowns (count,) get from those that are known to be 1, and the energy of these alone."""
    kept = known[columns]
    load = np.bincount(rows[kept], local.ravel()[kept], count)
    return np.where(known, 0.0, load), float(load[known].sum())
