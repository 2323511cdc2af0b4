"""Derivatives of readings over a whole prior: solved at some places, diameters and pressures, and cubics between.

The ring's turns make all places those of one sector from an electrode to the next. (Its mirror does not: readings are
taken against an electrode on one side of the driven pair, and with white noise the mirrored ones say some 6 % more or
less.) Places are Gauss-Legendre points in the square of the distance from the centre, where the punch fits.
"""

import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from eitsim.scene.scene import Punch, Scene, scene_tables
from eitsim.simulation.material import material_of
from matcal.card import MaterialCard
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.law import Law
from surrogate.bounds.fisher_information import Prior
from surrogate.bounds.reading_derivatives import MESH_HALVINGS, Derivatives, derivatives_of
from touchcal import cache
from touchcal.arrays import Array

_CODE = ("eitsim.simulation.derivatives.readings",)  # what the numbers of a table follow from, for the cache
# Strains of the compression that tells where pressures are to lie close.
_STRAINS = np.linspace(0.0, 0.95, 400)
_GOLDEN = (5**0.5 - 1) / 2


@dataclass(frozen=True)
class Nodes:
    """How many are solved."""

    places: int = 4
    diameters: int = 3
    pressures: int = 9


@dataclass(frozen=True, eq=False)
class SlopeTable:
    """Derivatives at places, diameters and pressures."""

    weight: Array  # (P,) weight of each place, their sum 1
    d_mm: Array  # (D,) diameters, mm, increasing
    pressure: Array  # (K,) pressures F / d^2, N/mm^2, increasing
    # (K,) positions of the pressures on the scale that they are evenly spaced on, and that scale
    scale: Callable[[Array], Array]
    # (P, D, K, readings, parameters) derivatives: by x, y, by d at constant pressure, by log F, by the card's
    parameters: tuple[str, ...]
    values: Array
    baseline_V: Array  # (readings,) untouched, V


def table_for(scene: Scene, card: MaterialCard, prior: Prior, nodes: Nodes | None = None,
              each: Callable[[Iterable[int]], Iterable[int]] = iter) -> SlopeTable:
    """The table of a scene's sensor, skin and kind of punch over a prior, from the cache or solved and put there; some
    1.5 CPU seconds a node. Touches do without what the rim changes of the mechanics. NotConverged as a touch."""
    nodes = nodes or Nodes()
    material = material_of(scene, card)
    law = material.law
    d_mm, pressure, scale = _axes(law, prior, nodes)
    places = list(_places(scene, nodes))
    key = {"limit": asdict(nodes), "halvings": MESH_HALVINGS, "places": places, "prior": asdict(prior),
           "scene": scene_tables(scene), "law": _as_json(law), "skin": _as_json(material.skin)}
    touches = [_punch(scene, prior, place, d, d**2 * p) for place in places for d in d_mm for p in pressure]

    def make() -> dict[str, Array]:
        found = [derivatives_of(replace(scene, punches=(touches[k],)), card) for k in each(range(len(touches)))]
        return {"by": np.stack([one.by for one in found]), "baseline_V": found[0].baseline_V,
                "parameters": np.array(found[0].parameters)}

    kept, note = cache.kept(cache.key_of(key, _CODE), make)
    if note:
        warnings.warn(f"the table of derivatives is {note}", stacklevel=2)
    by = kept["by"].reshape(len(places), len(d_mm), len(pressure), *kept["by"].shape[1:])
    weight = np.polynomial.legendre.leggauss(nodes.places)[1] / 2
    return SlopeTable(weight, d_mm, pressure, scale, tuple(kept["parameters"].tolist()),
                      at_pressure(by, d_mm, pressure), kept["baseline_V"])


def _as_json(part: object) -> dict[str, list[float] | float | str]:
    """Numbers and words of a law, as JSON."""
    return {key: np.asarray(value).tolist() for key, value in vars(part).items() if not isinstance(value, dict)}


def _places(scene: Scene, nodes: Nodes) -> Iterator[tuple[float, float]]:
    """Distance from the centre over the largest, and angle, rad, spread evenly over the sector."""
    sector = 2 * np.pi / scene.electrodes.count
    for k, x in enumerate(np.polynomial.legendre.leggauss(nodes.places)[0]):
        yield float(np.sqrt((1 + x) / 2)), float(sector * ((k + 1) * _GOLDEN % 1))


def _punch(scene: Scene, prior: Prior, place: tuple[float, float], d_mm: float, force_N: float) -> Punch:
    radius, angle = place[0] * float(prior.reach_mm(d_mm)), place[1]
    return replace(scene.punches[0], x_m=radius * np.cos(angle) / 1e3, y_m=radius * np.sin(angle) / 1e3,
                   diameter_m=d_mm / 1e3, force_N=float(force_N), depth_m=None)


def _axes(law: Law, prior: Prior, nodes: Nodes) -> tuple[Array, Array, Callable[[Array], Array]]:
    """Diameters, pressures and their scale: even in log p where the foam answers in proportion, and in the strain of
    its own compression where that runs ahead."""
    (small, large), (light, heavy) = prior.d_mm, prior.force_N
    d_mm = np.geomspace(small, large, nodes.diameters) if large > small else np.full(1, small)
    low, high = light / large**2, heavy / small**2
    stress = np.maximum.accumulate(-nominal_stress(law, "uniaxial", -_STRAINS)) / 1e6

    def scale(pressure: Array) -> Array:
        strain = np.interp(pressure, stress * np.pi / 4, _STRAINS) / np.interp(high, stress * np.pi / 4, _STRAINS)
        return strain + np.log(pressure / low) / np.log(high / low)

    fine = np.geomspace(low, high, 4000)
    even = np.linspace(scale(fine[:1])[0], scale(fine[-1:])[0], nodes.pressures)
    return d_mm, np.interp(even, scale(fine), fine), scale


def at_pressure(by: Array, d_mm: Array, pressure: Array) -> Array:
    """Derivatives (..., D, K, readings, parameters) by d at constant F / d^2, and by log F, in the places of those by d
    and F."""
    d = d_mm[:, None, None]
    force = d**2 * pressure[:, None]
    out = by.copy()
    out[..., 2] = by[..., 2] + 2 * force / d * by[..., 3]
    out[..., 3] = force * by[..., 3]
    return out


def derivatives_at(table: SlopeTable, place: int, d_mm: Array, force_N: Array) -> Derivatives:
    """Derivatives at one of the places for d and F (n,): cubic along the pressures' scale, Lagrange's in log d."""
    pressure = force_N / d_mm**2
    along = CubicSpline(table.scale(table.pressure), table.values[place], axis=1)(table.scale(pressure))
    found = np.einsum("dn,dnrp->nrp", _across(table.d_mm, d_mm), along)
    by_force = found[..., 3] / force_N[:, None]
    found[..., 2] -= (2 * force_N / d_mm)[:, None] * by_force
    found[..., 3] = by_force
    return Derivatives(table.parameters, found, table.baseline_V)


def _across(solved: Array, requested: Array) -> Array:
    """Lagrange's weights (D, n) in the logarithm of the diameter."""
    x, at = np.log(solved), np.log(requested)
    return np.stack([np.prod([(at - x[k]) / (x[j] - x[k]) for k in range(len(x)) if k != j] or [np.ones_like(at)],
                             axis=0) for j in range(len(x))])
