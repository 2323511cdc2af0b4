"""The coated surface as a conducting sheet: from the stretches of a touch to its conductance on the reference disc."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator

from eitsim.scene.results import Array, RimField, Touch
from eitsim.scene.scene import STRAINS, Body, Punch, Skin
from matcal.laws.conductivity import Conductivity, coating_thickness, conductivity
from touchcal.jit import compiled

# Strains closer than this to the fitted range count as inside it: far from a touch they are rounding around zero.
NEAR_RANGE = 1e-4
# Angle, rad, by which a point may lie beyond the plane between two touches.
_ON_PLANE = 1e-9
_TINY = float(np.finfo(float).tiny)


class FoldedSkin(ValueError):
    """A surface whose area vanishes or turns over somewhere, as what the rim changes is interpolated."""


def driving_strain(strain: str, stretch_1: ArrayLike, stretch_2: ArrayLike, stretch_normal: ArrayLike) -> Array:
    """Strain e that drives c(e): normal l_n - 1, principal max(l_1, l_2) - 1 or areal l_1 l_2 - 1; ValueError else."""
    first, second = np.asarray(stretch_1, dtype=float), np.asarray(stretch_2, dtype=float)
    if strain == "normal":
        return np.asarray(stretch_normal, dtype=float) - 1
    if strain == "principal":
        return np.maximum(first, second) - 1
    if strain == "areal":
        return first * second - 1
    raise ValueError(f"strain in [skin]: '{strain}' is unknown; known: {', '.join(STRAINS)}.")


def driving_strains(stretch_1: ArrayLike, stretch_2: ArrayLike, stretch_normal: ArrayLike) -> Array:
    """(3, ...) the strains that drive c(e), by STRAINS."""
    return np.stack([driving_strain(strain, stretch_1, stretch_2, stretch_normal) for strain in STRAINS])


def principal_conductances(law: Conductivity, skin: Skin, stretch_1: ArrayLike, stretch_2: ArrayLike,
                           stretch_normal: ArrayLike) -> tuple[Array, Array]:
    """Sheet conductances, S, along both in-plane principal stretches: c t J_s C_s^-1 = c t (l_2/l_1, l_1/l_2).

    ValueError where c(e) is not positive.
    """
    first, second = np.asarray(stretch_1, dtype=float), np.asarray(stretch_2, dtype=float)
    sheet = _current_sheet(law, skin, first, second, stretch_normal)
    return sheet * second / first, sheet * first / second


def _current_sheet(law: Conductivity, skin: Skin, stretch_1: Array, stretch_2: Array,
                   stretch_normal: ArrayLike) -> Array:
    """Conductance c t of the stretched sheet, S a square of its own."""
    sheet = conductivity(law, driving_strain(skin.strain, stretch_1, stretch_2, stretch_normal))
    return sheet * coating_thickness(skin.thickness_m, stretch_1 * stretch_2)


def untouched_conductance(law: Conductivity, skin: Skin) -> float:
    """Sheet conductance, S, of the skin at rest."""
    return law.c0_S_per_m * skin.thickness_m


def sheet_conductance(points_m: Array, punch: Punch, touch: Touch, skin: Skin, law: Conductivity) -> Array:
    """Conductance tensor (..., 2, 2), S, at points (..., 2) of the reference disc, axisymmetric about the punch but for
    what the rim changes."""
    if not touch.axisymmetric:
        return conductance_of(*surface_metric(points_m, punch, touch), skin, law)
    offset = points_m - np.array([punch.x_m, punch.y_m])
    radius = np.hypot(offset[..., 0], offset[..., 1])
    normal = np.where(radius[..., None] > 0, offset / np.maximum(radius, 1e-300)[..., None], np.array([1.0, 0.0]))
    meridian, hoop = principal_conductances(law, skin, *stretches(touch, radius))
    return hoop[..., None, None] * np.eye(2) + (meridian - hoop)[..., None, None] * _outer(normal, normal)


def touched_conductance(points_m: Array, touches: Sequence[tuple[Punch, Touch]], skin: Skin,
                        law: Conductivity) -> Array:
    """Conductance tensor (..., 2, 2), S, at points (..., 2) under one touch or several.

    Where several meet, their Green-Lagrange strains add up and their stretches normal to the surface multiply.
    """
    if len(touches) == 1:
        return sheet_conductance(points_m, *touches[0], skin, law)
    return conductance_of(*added_metric(points_m, touches), skin, law)


def added_metric(points_m: Array, touches: Sequence[tuple[Punch, Touch]]) -> tuple[Array, Array]:
    """In-plane metric C_s (..., 2, 2) and stretch normal to the surface (...) at points (..., 2) under one touch or
    several, added up as in `touched_conductance`; those that share a field count once."""
    metrics, normals = zip(*(surface_metric(points_m, *touch) for touch in solutions(touches)), strict=True)
    return np.eye(2) + np.sum([metric - np.eye(2) for metric in metrics], axis=0), np.prod(normals, axis=0)


def solutions(touches: Sequence[tuple[Punch, Touch]]) -> list[tuple[Punch, Touch]]:
    """The touches whose fields of the skin add up: of those that share one, the first."""
    shared = [touch.surface for _, touch in touches]
    return [touch for i, touch in enumerate(touches)
            if shared[i] is None or not any(field is shared[i] for field in shared[:i])]


def surface_metric(points_m: Array, punch: Punch, touch: Touch) -> tuple[Array, Array]:
    """In-plane metric C_s (..., 2, 2) and stretch normal to the surface (...) at points (..., 2) of the skin."""
    if touch.surface is not None:
        return touch.surface.metric(points_m)
    axes = local_axes(punch, touch)
    local = (points_m - np.array([punch.x_m, punch.y_m])) @ axes.T
    radius = np.hypot(local[..., 0], local[..., 1])
    meridian, hoop, normal = stretches(touch, radius)
    if touch.rim is None:
        radial = np.where(radius[..., None] > 0, local / np.maximum(radius, 1e-300)[..., None], [1.0, 0.0]) @ axes
        return (hoop**2)[..., None, None] * np.eye(2) + (meridian**2 - hoop**2)[..., None, None] * _outer(
            radial, radial), normal
    change = _changed(touch.rim, local)
    metric = np.empty((*radius.shape, 2, 2))
    _seen_whole(local.reshape(-1, 2), axes, meridian.ravel(), hoop.ravel(), change.reshape(-1, 4),
                metric.reshape(-1, 2, 2))
    return metric, normal * change[..., 3]


@compiled
def _seen_whole(local, axes, meridian, hoop, change, metric):
    """Metrics U^T M U of the stretches U at places about the punch and of changes M of U, its xx, xy and yy."""
    for p in range(len(local)):
        x, y = local[p, 0], local[p, 1]
        radius = math.sqrt(x * x + y * y)
        x, y = (x / radius, y / radius) if radius > 0 else (1.0, 0.0)
        more, xx, xy, yy = meridian[p] - hoop[p], change[p, 0], change[p, 1], change[p, 2]
        along, across = x * axes[0, 0] + y * axes[1, 0], x * axes[0, 1] + y * axes[1, 1]
        a, b = hoop[p] * axes[0, 0] + more * x * along, hoop[p] * axes[0, 1] + more * x * across
        c, d = hoop[p] * axes[1, 0] + more * y * along, hoop[p] * axes[1, 1] + more * y * across
        metric[p, 0, 0] = xx * a * a + 2 * xy * a * c + yy * c * c
        metric[p, 0, 1] = metric[p, 1, 0] = xx * a * b + xy * (a * d + b * c) + yy * c * d
        metric[p, 1, 1] = xx * b * b + 2 * xy * b * d + yy * d * d


def _outer(one: Array, other: Array) -> Array:
    """Products (..., 2, 2) of vectors (..., 2)."""
    return one[..., :, None] * other[..., None, :]


def local_axes(punch: Punch, touch: Touch) -> Array:
    """Rows: the directions towards the nearest point of the rim or edge, or to the neighbour, and across (2, 2)."""
    place = np.array([punch.x_m, punch.y_m])
    outwards = place / np.linalg.norm(place) if place.any() else np.array([1.0, 0.0])
    if touch.rim is not None and touch.rim.towards is not None:
        outwards = touch.rim.towards
    return np.array([outwards, [-outwards[1], outwards[0]]])


def areal_stretch(metric: Array) -> Array:
    """(...) square root of det C_s of in-plane metrics (..., 2, 2); FoldedSkin where that is not positive."""
    squared = metric[..., 0, 0] * metric[..., 1, 1] - metric[..., 0, 1] ** 2
    if not np.all(squared > 0):
        raise FoldedSkin(f"the skin folds at {np.sum(~(squared > 0))} of {squared.size} points, where a deep punch "
                         "squeezes it out over the rim. Move the punch inwards, or press less.")
    return np.sqrt(squared)


def conductance_of(metric: Array, normal: Array, skin: Skin, law: Conductivity) -> Array:
    """Conductance (..., 2, 2), S, c t J_s C_s^-1 of a metric C_s (..., 2, 2) and the stretch (...) normal to the
    surface."""
    xx, xy, yy = metric[..., 0, 0], metric[..., 0, 1], metric[..., 1, 1]
    first = np.sqrt((xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))
    areal = areal_stretch(metric)
    sheet = _current_sheet(law, skin, first, areal / first, normal) / areal
    return np.stack([sheet * yy, -sheet * xy, -sheet * xy, sheet * xx], axis=-1).reshape(metric.shape)


def changes(rim: RimField, local_m: Array) -> tuple[Array, Array]:
    """Metric (..., 2, 2) and normal factor (...) at places (..., 2) about the punch, axes as in RimField; interpolated
    as `_sampled`."""
    found = _changed(rim, local_m)
    return found[..., [[0, 1], [1, 2]]], found[..., 3]


def _changed(rim: RimField, local_m: Array) -> Array:
    """xx, xy and yy of the metric and the normal factor (..., 4)."""
    return _mirrored(rim, local_m, _sampled(rim, local_m, _changes_around(rim), (1.0, 0.0, 1.0, 1.0)))


@lru_cache(maxsize=4)
def _changes_around(rim: RimField) -> Array:
    """Cubics of the metric and the normal factor, which a touch's meshes share."""
    return _around(rim, np.concatenate([rim.metric, rim.normal[..., None]], axis=-1))


def moved(rim: RimField, local_m: Array) -> Array:
    """Displacement (..., 3), m, that the rim or a neighbour adds at places (..., 2) about the punch, axes as in
    RimField; interpolated as `_sampled`."""
    return _mirrored(rim, local_m, _sampled(rim, local_m, _around(rim, rim.displacement_m), (0.0, 0.0, 0.0)))


def _mirrored(rim: RimField, local_m: Array, found: Array) -> Array:
    """Parts (..., n) of a field that is symmetric about the line to the rim, of which the second is odd."""
    if not rim.whole_turn:
        found[..., 1] = np.where(local_m[..., 1] < 0, -found[..., 1], found[..., 1])
    return found


def _around(rim: RimField, parts: Array) -> Array:
    """Cubics (n, sectors, 4, parts) of samples (n, k, parts) in the angle, highest power first."""
    ends = "periodic" if rim.whole_turn else "not-a-knot"
    return np.ascontiguousarray(CubicSpline(rim.share, parts, axis=1, bc_type=ends).c.transpose(2, 1, 0, 3))


def _sampled(rim: RimField, local_m: Array, cubics: Array, unchanged: Sequence[float]) -> Array:
    """Values (..., parts) at places by cubics of `_around`: linear in the radius between them, `unchanged` outside the
    last circle and nearer to the neighbour."""
    out = np.empty((*local_m.shape[:-1], len(unchanged)))
    _interpolate(np.ascontiguousarray(local_m).reshape(-1, 2), rim.disc_m, rim.offset_m, rim.neighbour,
                 rim.whole_turn, rim.radius_m, rim.share, cubics, np.array(unchanged), out.reshape(-1, len(unchanged)))
    return out


@compiled
def _interpolate(local, disc, offset, by_neighbour, whole_turn, radii, shares, cubics, unchanged, out):
    """Values (points, parts) at places (points, 2) by cubics (radii, sectors, 4, parts) in the share, highest power
    first, and linearly between radii."""
    for p in range(len(local)):
        radius, angle = math.hypot(local[p, 0], local[p, 1]), math.atan2(abs(local[p, 1]), local[p, 0])
        start = _start(disc, offset, radius)
        if radius > radii[-1] or (by_neighbour and angle < start - _ON_PLANE):
            for part in range(out.shape[1]):
                out[p, part] = unchanged[part]
            continue
        share = min(max(angle - start, 0.0) / max(np.pi - start, _TINY), 1.0)
        if whole_turn:
            share = math.atan2(local[p, 1], local[p, 0]) / (2 * np.pi) % 1.0
        radius = max(radius, radii[0])
        ring = min(np.searchsorted(radii, radius, side="right"), len(radii) - 1) - 1
        sector = min(np.searchsorted(shares, share, side="right"), len(shares) - 1) - 1
        way, outwards = share - shares[sector], (radius - radii[ring]) / (radii[ring + 1] - radii[ring])
        one, other = cubics[ring, sector], cubics[ring + 1, sector]
        for part in range(out.shape[1]):
            inner = ((one[0, part] * way + one[1, part]) * way + one[2, part]) * way + one[3, part]
            outer = ((other[0, part] * way + other[1, part]) * way + other[2, part]) * way + other[3, part]
            out[p, part] = inner + (outer - inner) * outwards


@compiled
def _start(disc, offset, radius):
    """As `Outline.start`, of one radius."""
    reach, above = 2 * radius * offset, disc**2 - radius**2 - offset**2
    return math.acos(min(max(above / reach, -1.0), 1.0)) if reach > 0 else math.acos(np.sign(above))


def stretches(touch: Touch, radius_m: Array) -> tuple[Array, Array, Array]:
    """Stretches (meridian, hoop, normal) at any radii: monotone cubics between the samples, so that an edge neither
    overshoots nor turns negative; the first sample's towards the axis, 1 beyond the last."""
    values = _stretch_cubics(touch)(np.clip(radius_m, *touch.radius_m[[0, -1]]))
    values = np.where(np.asarray(radius_m)[..., None] > touch.radius_m[-1], 1.0, values)
    return values[..., 0], values[..., 1], values[..., 2]


@lru_cache(maxsize=4)
def _stretch_cubics(touch: Touch) -> PchipInterpolator:
    """Cubics of the three stretches, which a touch's readings, errors and fields share."""
    return PchipInterpolator(touch.radius_m, np.column_stack([
        touch.stretch_meridian, touch.stretch_hoop, touch.stretch_normal]))


def extrapolated_fraction(body: Body, punch: Punch, touch: Touch, skin: Skin, law: Conductivity) -> float:
    """Fraction of the skin whose driving strain lies outside the fitted range by more than NEAR_RANGE; with an outline,
    as if no edge were near."""
    edges = np.union1d(np.linspace(0, touch.radius_m[-1], 4001), touch.radius_m)
    radius, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    strain = driving_strain(skin.strain, *stretches(touch, radius))
    far = np.abs(strain - np.clip(strain, *law.strain_range)) > NEAR_RANGE
    area = body.edge.covered_rad((punch.x_m, punch.y_m), radius) * radius * width
    return float(np.sum(area[far]) / (np.pi * body.edge.size_m**2))


def extrapolated_share(touches: Sequence[Touch], skin: Skin, law: Conductivity) -> float:
    """Share of the signal that comes from skin strained outside the fitted range by more than NEAR_RANGE.

    The signal of a small touch goes as its dipole moment in a uniform field. With f(r) cos(theta) the potential there,
    and s_m, s_h the sheet conductances over that at rest, a ring adds (s_m - 1) r f' + (s_h - 1) f to the moment; the
    share is taken of the rings' absolute values. Each touch counts by itself, without what the rim changes.
    """
    rest, far_part, whole = untouched_conductance(law, skin), 0.0, 0.0
    for touch in touches:
        edges = np.union1d(np.linspace(0, touch.radius_m[-1], 1001), touch.radius_m)[1:]
        radius = (edges[1:] + edges[:-1]) / 2
        along = stretches(touch, radius)
        meridian, hoop = (sheet / rest for sheet in principal_conductances(law, skin, *along))
        strain = driving_strain(skin.strain, *along)
        far = np.abs(strain - np.clip(strain, *law.strain_range)) > NEAR_RANGE
        k, step = np.sqrt(meridian * hoop), np.log(edges[1:] / edges[:-1])
        h = np.tanh(k / meridian * step)
        y = _outwards(k[:1], k[:, None], h[:, None])[:, 0]
        slope = (y[1:] + y[:-1]) / 2 / meridian  # d ln f / d ln r
        f = np.exp(np.cumsum(slope * step) - slope * step / 2)
        part = np.abs((meridian - 1) * slope + hoop - 1) * f * np.diff(edges) * edges[-1] / np.exp(slope @ step)
        far_part, whole = far_part + float(part[far].sum()), whole + float(part.sum())
    return far_part / whole if whole > 0 else 0.0


@compiled
def _outwards(core, k, h):
    """Admittances (n + 1, orders) of harmonics from the core (orders,) out through rings, k and h (n, orders), as in
    `admittance`."""
    out = np.empty((len(k) + 1, len(core)))
    for m in range(len(core)):
        out[0, m] = core[m]
        for j in range(len(k)):
            out[j + 1, m] = k[j, m] * (out[j, m] + k[j, m] * h[j, m]) / (k[j, m] + out[j, m] * h[j, m])
    return out


def admittance(core: Array, stationary: Array, meridian: Array, radii_m: Array) -> Array:
    """Admittance Y = rho s u'/u (orders,) of harmonics u at the outermost of radii (n + 1,) > 0, m, from that at the
    first, `core` (orders,).

    Ring j between radii j and j + 1 has the meridional conductance s_j (n,) and the stationary admittances k
    (orders, n): there Y' = k (Y + k h)/(k + Y h) with h = tanh(k ln(rho'/rho)/s).
    """
    h = np.tanh(stationary / meridian * np.log(radii_m[1:] / radii_m[:-1]))
    return _outwards(np.ascontiguousarray(core), *(np.ascontiguousarray(part.T) for part in (stationary, h)))[-1]


def dipole(radius: Array, radial: Array, hoop: Array) -> float:
    """Polarisability alpha, length^2: outside, the potential of a uniform field is (r + alpha/r) cos(theta).

    Sheet conductances radial and hoop (n,) over that of the sheet outside, at increasing radii (n,) > 0, taken
    constant between neighbours; the first holds from the axis on.
    """
    a, b = (radial[1:] + radial[:-1]) / 2, (hoop[1:] + hoop[:-1]) / 2
    core = np.sqrt(radial[:1] * hoop[:1])
    y = float(admittance(core, np.sqrt(a * b)[None], a, radius)[0])
    return float(radius[-1]**2 * (1 - y) / (1 + y))
