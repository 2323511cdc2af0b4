"""A mesh that follows the touch: rings of curved quadratic quadrilaterals about the punch that widen into the rim."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh
from eitsim.electrics.cem.floating_electrodes import shunt_ends
from eitsim.scene.electrodes import TOUCHING, arcs, lengths, round_the_rim, widths
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch

# Edges along the rim under an electrode and between two of them, on level 1, at least, and about how many on the whole
# rim where electrodes or gaps are wide.
_UNDER, _BETWEEN, _AROUND = 1, 3, 64
_CENTRED = 0.5  # Part of the way from the contact to the nearest rim on which the rings stay centred on the punch.
FARTHEST = 0.9  # Part of the way from the punch's edge to the nearest rim at which the contact ends, at most.
# Width of the rings at the lines of the contact and at the rim, in fillet radii and in electrode widths, on level 1,
# and how much wider they get per unit of distance from there.
_AT_CONTACT, _AT_RIM, _GROWTH = 0.5, 0.2, 0.7
_WINDOW = 0.2  # Window that the steepness of the stretches is averaged over, in fillet radii.
_ALONG = 2  # Rings of patches from their inner edge to the rim, on level 1.
_SAME_LINE = 0.2  # Lines of the contact closer than this share of the fillet radius are one line.


def template(body: Body, electrodes: Electrodes, punch: Punch, touch: Touch, level: int = 1) -> SkinMesh:
    """Mesh of the disc with lines at the edge of the punch, the start of its fillet and the end of contact, the last
    inside the rim where the contact reaches it.

    Ring (c, r) has its centre between the punch and the disc's centre and its nodes at c + r (cos, sin) of one set of
    angles, so that the rim's nodes fall on the ends of the electrodes; the rings of patches have the disc's centre.
    Level n divides all widths and angles by n. ValueError where the punch overhangs the rim, or its contact reaches the
    ring of patches.
    """
    patches = patch_radii(body, electrodes, level)
    touch, gap = inside_rim(punch, touch, patches)
    angles, electrode = rim_angles(body, electrodes, level)
    inner = centred_radii(punch, touch, gap, level)
    narrowest = min(float(widths(electrodes).min()), 2 * np.pi * body.radius_m / _AROUND)
    blend = _blend(patches[0] - inner[-1], inner[-1] - inner[-2], _AT_RIM * narrowest / level)
    radii = np.concatenate([inner, inner[-1] + blend * (patches[0] - inner[-1]), patches[1:]])
    shift = np.concatenate([np.ones(len(inner)), 1 - blend, np.zeros(len(patches) - 1)])
    return ring_mesh(radii, shift[:, None] * np.array([punch.x_m, punch.y_m]), angles, electrode, electrodes.count,
                     covered=len(patches) - 1)


def inside_rim(punch: Punch, touch: Touch, patches: Array) -> tuple[Touch, float]:
    """The touch with its end of contact inside the rim, and its distance to the rim or the ring of patches, m.

    ValueError where the punch overhangs the rim, or its contact reaches the ring of patches.
    """
    edge = punch.diameter_m / 2
    room = float(patches[0]) - math.hypot(punch.x_m, punch.y_m) - edge
    if len(patches) == 1 and room <= 0:
        raise ValueError(f"the punch's edge lies {-room * 1e3:.1f} mm outside the rim of the disc; move the punch "
                         "inwards.")
    reach = max(touch.contact_radius_m - edge, 0.0)
    if len(patches) > 1 and reach >= room:
        raise ValueError(f"the contact reaches {(reach - room) * 1e3:.1f} mm into the ring that the patch electrodes "
                         "lie on; move the punch inwards, or make the patches shorter.")
    touch = replace(touch, contact_radius_m=min(touch.contact_radius_m, edge + FARTHEST * room))
    return touch, room - max(touch.contact_radius_m - edge, 0.0)


def patch_radii(body: Body, electrodes: Electrodes, level: int = 1) -> Array:
    """Radii, m, of the circles from the inner edge of patches to the rim; the rim alone for lines."""
    if electrodes.along_edge:
        return np.array([body.radius_m])
    steps = np.append(_graded(_ALONG * level), 1.0)
    return body.radius_m - lengths(electrodes)[0] * (1 - steps)


def rim_angles(body: Body, electrodes: Electrodes, level: int = 1, *, under: int = _UNDER, between: int = _BETWEEN,
               around: int = _AROUND) -> tuple[Array, Indices]:
    """Angles (m,), rad, of the nodes on the rim and the electrode (m,) that follows each; -1 in a gap.

    On level 1 at least `under` edges lie under an electrode and `between` between two, or as many as give the whole rim
    `around`. Spacing halves towards the ends of the electrodes, where the current density is singular.
    """
    ends = arcs(body.radius_m, electrodes)
    order, turned, _ = round_the_rim(ends)
    following = np.append(turned[1:, 0], turned[0, 0] + 2 * np.pi)
    angles, electrode = [], []
    for k, (start, stop), after in zip(order, turned, following, strict=True):
        for first, last, least, owner in ((start, stop, under, k), (stop, after, between, -1)):
            edges = max(least, round((last - first) * around / (2 * np.pi))) * level
            if last - first > TOUCHING:
                angles.append(first + (last - first) * _graded(edges, wide=owner >= 0 and edges > least * level))
                electrode += [owner] * edges
    return np.concatenate(angles), np.array(electrode)


def ring_mesh(radii_m: Array, centres_m: Array, angles_rad: Array, electrode: Indices, count: int, *,
              covered: int = 0) -> SkinMesh:
    """Q2 mesh of rings: vertices at centre + radius (cos, sin) of each angle; the first radius is 0, a point.

    Middle nodes take the mean radius, centre and angle. Sizes: radii (r,), centres (r, 2), angles and electrode (m,).
    Electrodes lie on the rim, or cover that many of the outermost rings.
    """
    sectors, rings = len(angles_rad), len(radii_m) - 1
    following = np.append(angles_rad[1:], angles_rad[0] + 2 * np.pi)
    angle = np.column_stack([angles_rad, (angles_rad + following) / 2]).ravel()
    radius, centre = _with_middles(radii_m)[1:], _with_middles(centres_m)[1:]
    spoke = np.column_stack([np.cos(angle), np.sin(angle)])
    nodes = centre[:, None] + radius[:, None, None] * spoke
    cells, edges = _topology(rings, sectors)
    under = np.flatnonzero(electrode >= 0)
    nodes = np.vstack([centres_m[:1], nodes.reshape(-1, 2)])
    if covered:
        outer = cells.reshape(rings, sectors, 9)[-covered:, under].reshape(-1, 9)
        return SkinMesh(nodes, cells, outer, np.tile(electrode[under], covered), count, "Q2")
    return SkinMesh(nodes, cells, edges[under], electrode[under], count, "Q2")


def _topology(rings: int, sectors: int) -> tuple[Indices, Indices]:
    """Cells (rings sectors, 9) and rim edges (sectors, 3) of the ring mesh."""
    number = np.arange(2 * rings * 2 * sectors).reshape(2 * rings, 2 * sectors) + 1
    number = np.vstack([np.zeros((1, 2 * sectors), dtype=int), number])
    number = np.hstack([number, number[:, :1]])
    corners = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
    cells = [number[i: i + 2 * rings - 1: 2, j: j + 2 * sectors - 1: 2].ravel() for i, j in corners]
    rim = number[-1]
    return np.column_stack(cells), np.column_stack([rim[:-1:2], rim[2::2], rim[1::2]])


def centred_radii(punch: Punch, touch: Touch, gap: float, level: int, thinner: int = 1,
                  steepest: float = np.inf) -> Array:
    """Radii, m, from 0 over the lines of the contact to the last ring that is centred on the punch, part of the way
    `gap`, m, from the contact; on level 1 the stretches change by the part `steepest` of all their change in a ring.
    """
    marks = contact_lines(punch, touch)
    stops = [0.0, *sorted(marks), max(marks) + _CENTRED * gap]

    def width(radius: Array) -> Array:
        nearest = np.min(np.abs(radius[:, None] - np.array(marks)), axis=1)
        widest = _AT_CONTACT * punch.fillet_m / thinner + _GROWTH * nearest
        return np.minimum(widest, steepest / _steepness(touch, radius, _WINDOW * punch.fillet_m)) / level

    pieces = [_spread(a, b, width) for a, b in itertools.pairwise(stops)]
    return np.concatenate([[0.0], *pieces])


def contact_lines(punch: Punch, touch: Touch) -> list[float]:
    """Radii, m, of the lines of the contact: the ends of what shunts, the start of the fillet, the edge, the end of
    contact; those that all but coincide once."""
    edge, same = punch.diameter_m / 2, _SAME_LINE * punch.fillet_m
    marks = [*shunt_ends(punch, touch), edge - punch.fillet_m, edge, touch.contact_radius_m]
    return [m for i, m in enumerate(marks) if m > same and all(abs(m - other) > same for other in marks[:i])]


def _steepness(touch: Touch, radius: Array, window: float) -> Array:
    """Change of the logarithms of the stretches per length over all their change, added up, averages over a window
    about each radius."""
    logarithms = np.log(np.column_stack([touch.stretch_meridian, touch.stretch_hoop, touch.stretch_normal]))
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(logarithms, axis=0)).sum(axis=1))])
    ends = [np.interp(radius + side * window / 2, touch.radius_m, path) for side in (-1, 1)]
    tiny = np.finfo(float).tiny
    return np.maximum((ends[1] - ends[0]) / max(window * path[-1], tiny), tiny)


def _blend(distance: float, first: float, last: float) -> Array:
    """Fractions of the way to the rim, from ring width `first` to `last`, both ends growing inwards."""
    def width(way: Array) -> Array:
        return np.minimum(first + _GROWTH / 4 * way, last + _GROWTH / 4 * (distance - way))

    return _spread(0.0, distance, width) / distance


def _spread(start: float, stop: float, width: Callable[[Array], Array]) -> Array:
    """Points after start, up to stop, spaced in proportion to a width and at most as wide."""
    x = np.linspace(start, stop, 513)
    steps = np.concatenate([[0.0], np.cumsum(np.diff(x) / width((x[1:] + x[:-1]) / 2))])
    count = math.ceil(steps[-1] - 1e-9)
    return np.interp(np.linspace(0, steps[-1], count + 1)[1:], steps, x)


def _with_middles(values: Array) -> Array:
    out = np.repeat(values, 2, axis=0)[:-1]
    out[1::2] = (values[1:] + values[:-1]) / 2
    return out


def _graded(count: int, *, wide: bool = False) -> Array:
    """Points in [0, 1), finer at both ends, the more so where the whole is wide."""
    t = np.linspace(0, 1, count + 1)[:-1]
    finer = (1 - np.cos(np.pi * t)) / 2
    return finer if wide else (t + finer) / 2
