"""A table of flat punches' touches over force and diameter, without units: load paths at a few diameters and
polynomials between.

At equal depth the surface about the punch's edge is nearly the same for every diameter, so that radii are carried over
from one punch to another with the edge and the start of the fillet in place, and few diameters suffice.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit
from eitsim.mechanics.harmonics.arcs import OffsetDisc
from eitsim.mechanics.load_paths.load_path import ERRORS, FIELDS, NUMBERS, depth_at, hermite
from eitsim.mechanics.load_paths.types import DimensionlessProblem, Table
from eitsim.scene.edges.disc import Disc
from eitsim.scene.nearest_edge import STRAIGHT_M
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Punch, profile_of
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law, over, values_of
from touchcal.arrays import Array
from touchcal.jit import cpu_s

# Distances from the fillet's start inwards and from the edge outwards over which radii are spaced evenly, then in
# proportion to the distance; over the thickness.
_INWARDS, _OUTWARDS = 0.06, 0.03
# Digits to which moduli and lengths count, and what equal ones may differ by, relative: dividing moduli of so many
# digits by their sum again changes the last one.
_DIGITS, _EQUAL = 12, 1e-10
# From the widest punch to the rim of the disc that serves skins with an outline, and the radius of the disc whose rim
# stands for a straight edge, thicknesses.
_FREE, _STRAIGHT = 10.0, 1e4


def shape_of(law: Law, body: Body, punch: Punch, diameters_m: Iterable[float] = (), *,
             spans: bool = False) -> DimensionlessProblem:
    """The shape of a flat punch's touch, for its own diameter or for others; all moduli times a factor have the same
    shape, and all outlines but the disc."""
    unit = body.thickness_m
    diameters = _rounded([d / unit for d in sorted(diameters_m) or [punch.diameter_m]])
    disc, fillet = _rounded([body.edge.size_m / unit, punch.fillet_m / unit])
    shape = DimensionlessProblem(law.name, _parameters(law), disc, fillet, diameters, spans,
                                 body.edge.table_rim_m == STRAIGHT_M)
    return with_diameters(shape, diameters, spans=spans)


def with_diameters(shape: DimensionlessProblem, diameters: tuple[float, ...], *, spans: bool) -> DimensionlessProblem:
    """A shape with other diameters, over the thickness; the disc of one with straight edges is as wide as they need."""
    disc = _rounded([diameters[-1] / 2 + _FREE])[0] if shape.straight else shape.disc
    return replace(shape, disc=disc, diameters=diameters, spans=spans)


def _parameters(law: Law) -> tuple[tuple[float, ...], ...]:
    return tuple(_rounded(values) for values in values_of(over(law, law.mu_0_Pa)))


def _rounded(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(f"{value:.{_DIGITS}g}") for value in values)


def parts_of(shape: DimensionlessProblem, diameter: float) -> tuple[Law, Body, Punch]:
    """Law, body and punch of a shape, without units; the force is yet to be set."""
    law = law_of(shape.law, shape.parameters)
    return law, Body(Disc(shape.disc), 1.0), Punch(diameter_m=diameter, fillet_m=shape.fillet)


def edge_of(shape: DimensionlessProblem, diameter: float, gap: float) -> OffsetDisc:
    """The edge at a gap from a punch of a shape, seen from the punch, over the thickness."""
    radius = _STRAIGHT if shape.straight else shape.disc
    return OffsetDisc(radius, radius - diameter / 2 - gap)


def carried_over(shape: DimensionlessProblem, radius: Array, old: float, new: float) -> Array:
    """Reference radii about one diameter at the corresponding places about another."""
    if old == new:
        return radius
    outer = old / 2, new / 2
    inner = [r - shape.fillet for r in outer]
    inside = inner[1] - _stretched(inner[0] - np.minimum(radius, inner[0]), inner[0], inner[1], _INWARDS)
    share = (np.clip(radius, inner[0], outer[0]) - inner[0]) / (outer[0] - inner[0])
    under = inner[1] + share * (outer[1] - inner[1])
    outside = outer[1] + _stretched(np.maximum(radius - outer[0], 0), shape.disc - outer[0], shape.disc - outer[1],
                                    _OUTWARDS)
    return np.where(radius < inner[0], np.maximum(inside, 0.0), np.where(radius <= outer[0], under, outside))


def _stretched(distance: Array, old: float, new: float, scale: float) -> Array:
    """Distances on (0, old) at the same parts of (0, new), linear up to `scale`, then logarithmic."""
    if old == 0:
        return distance
    return scale * np.expm1(np.log1p(distance / scale) * np.log1p(new / scale) / np.log1p(old / scale))


@dataclass(frozen=True, eq=False)
class State:
    """A touch without units, from a table."""

    depth: float  # depth, corrected for penetration
    fields: Array  # (6, r) FIELDS at the table's radii, carried over to the diameter
    number: Mapping[str, float]  # NUMBERS and ERRORS by name


def state(table: Table, diameter: float, *, mean_pressure: float | None = None,
          depth: float | None = None) -> State | None:
    """The touch under a mean pressure, or at a corrected depth; None where the table does not reach."""
    weight = _weights(table.shape, diameter)
    if weight is None:
        return None
    size = len(FIELDS) * len(table.radius)
    level, target = np.tensordot(weight, table.values[:, :, size], 1), mean_pressure
    if target is None:
        level, target = table.depths * np.tensordot(weight, table.values[:, :, size + 1], 1), depth
    if target is None or not level[0] <= target <= level[-1]:
        return None
    i = int(np.clip(np.searchsorted(level, target) - 1, 0, len(level) - 2))
    ends = table.depths[i:i + 2]
    values, slopes = (np.tensordot(weight, part[:, i:i + 2], 1) for part in (table.values, table.slopes))
    cubic = values[:, size], slopes[:, size]
    if mean_pressure is None:
        share = values[:, size + 1]
        cubic = ends * share, share + ends * slopes[:, size + 1]
    at = depth_at(ends, *cubic, target)
    found = hermite(ends, values, slopes, at)
    part = (at - ends[0]) / (ends[1] - ends[0])
    error_estimate = _neighbours(table.shape, diameter) @ table.error_estimate[:, i:i + 2].transpose(1, 0, 2)
    numbers = [*found[size:].tolist(), *((1 - part) * error_estimate[0] + part * error_estimate[1]).tolist()]
    return State(at * float(found[size + 1]), found[:size].reshape(len(FIELDS), -1),
                 dict(zip((*NUMBERS, *ERRORS), numbers, strict=True)))


def _weights(shape: DimensionlessProblem, diameter: float) -> Array | None:
    """Lagrange's weights of the solved diameters in its logarithm; None where it is not served."""
    solved = np.array(shape.solved)
    near: Array = np.where(np.abs(solved / diameter - 1) < 1e-9, 1.0, 0.0)
    if near.any():
        return near
    if not shape.spans or not solved[0] < diameter < solved[-1]:
        return None
    return lagrange_weights(np.log(solved), np.log(diameter))


def lagrange_weights(nodes: Array, at: float) -> Array:
    """Weights of nodes (n,) in the polynomial through them, at one place."""
    separation = nodes[:, None] - nodes + np.eye(len(nodes))
    return np.array([float(np.prod(np.delete((at - nodes) / separation[j], j))) for j in range(len(nodes))])


def _neighbours(shape: DimensionlessProblem, diameter: float) -> Array:
    """Linear weights of the two solved diameters about one, in its logarithm."""
    return np.array([np.interp(np.log(diameter), np.log(shape.solved), one) for one in np.eye(len(shape.solved))])


def _same_but_diameters(own: DimensionlessProblem, shape: DimensionlessProblem) -> bool:
    """Whether two shapes are one but for their diameters, the disc that these give to outlines, and rounding."""
    numbers = [[*chain(*s.parameters), 0.0 if own.straight else s.disc, s.fillet] for s in (own, shape)]
    return (own.law == shape.law and len(numbers[0]) == len(numbers[1]) and own.straight <= shape.straight
            and np.allclose(*numbers, rtol=_EQUAL, atol=_EQUAL))


def touch_from(table: Table, law: Law, body: Body, punch: Punch) -> Touch | None:
    """The touch under the punch's force or at its depth; None where the table does not hold it."""
    shape, unit = table.shape, body.thickness_m
    own = shape_of(law, body, punch)
    if not profile_of(punch).is_flat or punch.friction != "none" or not _same_but_diameters(own, shape):
        return None
    started = cpu_s()
    diameter = own.diameters[0]
    face = np.pi * diameter**2 / 4
    if punch.force_N is None:
        assert punch.depth_m is not None
        found = state(table, diameter, depth=punch.depth_m / unit)
    else:
        found = state(table, diameter, mean_pressure=punch.force_N / force_unit(law, body) / face)
    if found is None:
        return None
    value, field = found.number, dict(zip(FIELDS, found.fields, strict=True))
    radius = carried_over(shape, table.radius, shape.base, diameter)
    end = diameter / 2 + value["contact_end"]
    force_N = punch.force_N if punch.force_N is not None else value["mean_pressure"] * face * force_unit(law, body)
    area_m2 = value["contact_area"] * face * unit**2
    return Touch(
        radius_m=radius * unit, u_r_m=field["u_r"] * unit, u_z_m=field["u_z"] * unit,
        stretch_meridian=field["stretch_meridian"], stretch_hoop=field["stretch_hoop"],
        stretch_normal=field["stretch_normal"],
        pressure_Pa=np.where(radius <= end, np.maximum(field["pressure"], 0.0), 0.0) * law.mu_0_Pa,
        contact_radius_m=end * unit, force_N=force_N, depth_m=found.depth * unit,
        sigma_max_Pa=value["sigma_max"] * law.mu_0_Pa, sigma_ave_Pa=force_N / area_m2, contact_area_m2=area_m2,
        wall_contact_m2=max(value["wall_contact"], 0.0) * np.pi * diameter * unit**2,
        depth_error=math.exp(value["log_depth_error"]), signal_errors=_errors_of(value, "signal"),
        sigma_max_error=math.exp(value["log_sigma_max_error"]),
        contact_area_error=math.exp(value["log_contact_area_error"]),
        contact_end_error=math.exp(value["log_contact_end_error"]), strain_errors=_errors_of(value, "strain"),
        fraction_non_elliptic=value["fraction_non_elliptic"], iterations=0, residuals=(),
        cpu_s=cpu_s() - started)


def _errors_of(value: Mapping[str, float], what: str) -> Array:
    return np.exp([value[f"log_{what}_error_{name}"] for name in STRAINS])
