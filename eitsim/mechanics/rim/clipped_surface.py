"""The surface of a skin pressed near an edge, on circles about the punch's axis, and what is added to it there."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.axisymmetric.indentation import IndentationProblem
from eitsim.mechanics.contact.punch_contact import pressure
from eitsim.mechanics.harmonics.arcs import AngularQuadrature, OffsetDisc, OffsetOutline, harmonics_at
from eitsim.mechanics.harmonics.clipped_disc import ClippedDisc
from eitsim.mechanics.harmonics.equilibrium import contact_state
from eitsim.mechanics.harmonics.fourier_fields import Points, gradients
from eitsim.mechanics.solid.grid import lagrange
from eitsim.scene.polygons import inside, squared_distance
from eitsim.scene.results import RimField
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Points a facet and angles, on half a turn and on a whole one, at which the surface is sampled.
_SAMPLES, _ANGLES, _WHOLE_TURN = 3, 25, 97
# How far off the skin what is added goes on in samples, thicknesses, for interpolation up to the edge.
_OFF = 0.3
# Where the parts xx, xy, yy of a metric stand.
_METRIC = ([0, 0, 1], [0, 1, 1])


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane between a punch and its neighbour, thicknesses."""

    towards: Array  # (2,) direction to the neighbour, which places on circles count from
    distance: float  # of the plane from the punch's axis
    rim: OffsetDisc  # the disc whose rim stands for it
    past: float  # how far past it samples go on


@dataclass(frozen=True, eq=False)
class Samples:
    """Where the surface is sampled."""

    points: Points
    # (n,) reference radii, thicknesses; (k,) places on a circle as in RimField; (n, k) angles
    radius: Array
    share: Array
    angle: Array
    outline: OffsetDisc | OffsetOutline  # what ends the circles: the rim, or a plane that stands for one, or edges
    plane: Plane | None = None  # before a neighbour where edges end the circles


def samples(disc: ClippedDisc, model: IndentationProblem, outline: OffsetDisc | OffsetOutline,
            plane: Plane | None = None) -> Samples:
    """Circles on the top, as far as they lie inside the outline, and within edges before a plane."""
    points, radius = _top_points(disc, model)
    if isinstance(outline, OffsetOutline):
        return _around(disc, points, radius, outline, plane)
    share = np.linspace(0, 1, _ANGLES)
    start = outline.start(radius)[:, None]
    angle = start + (np.pi - start) * share
    waves = AngularQuadrature(np.ones_like(angle), *harmonics_at(angle, len(disc.fixed)))
    return Samples(replace(points, circles=waves), radius, share, angle, outline)


def _around(disc: ClippedDisc, points: Points, radius: Array, outline: OffsetOutline, plane: Plane | None) -> Samples:
    """Whole circles, the samples off the skin at the nearest angle next to it; without those that nowhere meet it."""
    share = np.linspace(0, 1, _WHOLE_TURN)
    turn = 2 * np.pi * share[:-1] + (0.0 if plane is None else np.arctan2(plane.towards[1], plane.towards[0]))
    place = radius[:, None, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    away = np.sqrt([squared_distance(circle[:, None], outline.start, outline.end).min(axis=1) for circle in place])
    near = inside(place, outline.start, outline.end) | (away < _OFF)
    if plane is not None:
        near &= place @ plane.towards < plane.distance + plane.past
    met = int(np.argmin(near.any(axis=1))) or len(radius)  # circles of larger radii meet none
    step = np.arange(len(turn)) - np.arange(len(turn))[:, None]
    between = np.minimum(step % len(turn), -step % len(turn))
    nearest = np.where(near[:met, None], between, len(turn)).argmin(axis=-1)
    angle = turn[nearest]
    angle = np.column_stack([angle, angle[:, :1]])
    waves = AngularQuadrature(np.ones_like(angle), *harmonics_at(angle, len(disc.fixed), True), True)
    kept = Points(points.shape[:met], points.nodes[:met], points.circle[:met], waves)
    return Samples(kept, radius[:met], share, angle, outline, plane)


def field(at: Samples, alone: Array, whole: Array, moved: Array, unit: float, neighbour: Array | None = None,
          towards: Array | None = None) -> RimField:
    """What is added to a touch alone, and to its neighbour's alone where there is one: deformation gradients
    (n, k, 3, 3) of the touch alone, of the whole and of the neighbour, and the added displacement (n, k, 3), in the
    local frame and thicknesses of `unit`, m. NotConverged where the surface is turned inside out."""
    metric, normal = _added(alone, np.eye(3) if neighbour is None else neighbour, whole)
    angle = at.angle if at.plane is None else at.angle - np.arctan2(at.plane.towards[1], at.plane.towards[0])
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.moveaxis(np.array([[cosine, -sine], [sine, cosine]]), (0, 1), (-2, -1))
    metric = turn @ metric @ np.swapaxes(turn, -1, -2)
    moved = np.concatenate([(turn @ moved[..., :2, None])[..., 0], moved[..., 2:]], axis=-1)
    out = RimField(at.radius * unit, at.share, moved * unit, metric[..., *_METRIC], normal, np.inf, 0.0, towards,
                   neighbour is not None)
    ends = at.outline
    if isinstance(ends, OffsetOutline):
        if at.plane is None:
            return replace(out, towards=np.array([1.0, 0.0]), whole_turn=True)
        ends, out = at.plane.rim, replace(out, whole_turn=True)
    return replace(out, disc_m=ends.disc * unit, offset_m=ends.offset * unit)


def _added(alone: Array, neighbour: Array, whole: Array) -> tuple[Array, Array]:
    """In-plane metric (..., 2, 2) of the whole less the neighbour's strain, seen from the stretches alone, and the
    normal stretch of the whole over both."""
    metrics = [np.swapaxes(f[..., :2], -1, -2) @ f[..., :2] for f in (alone, neighbour, whole)]
    value, vector = np.linalg.eigh(metrics[0])
    inverse = (vector / np.sqrt(value)[..., None, :]) @ np.swapaxes(vector, -1, -2)
    metric = inverse @ (metrics[2] - metrics[1] + np.eye(2)) @ inverse
    one, other, all_of_it = (np.linalg.det(f) / np.sqrt(np.linalg.det(m))
                             for f, m in zip((alone, neighbour, whole), metrics, strict=True))
    normal = all_of_it / one / other
    if not (np.all(normal > 0) and np.all(np.linalg.eigvalsh(metric) > 0)):
        raise NotConverged("what is added to the touch turns the surface inside out between the points of its mesh. "
                           "Try a smaller force or a larger gap.")
    return metric, normal


def _top_points(disc: ClippedDisc, model: IndentationProblem) -> tuple[Points, Array]:
    """Points of the surface, Gauss points of the top facets, each with a circle of its own (yet to be sampled)."""
    grid, p = model.grid, disc.order
    top = grid.top[grid.top.max(axis=1) < len(disc.base)]
    t = np.polynomial.legendre.leggauss(_SAMPLES)[0]
    shape, slope = lagrange(p, t)
    rows, ends = grid.lines[1], grid.nodes[top][:, [0, -1], 0]
    up = lagrange(p, np.ones(1))[1][0] * 2 / (rows[-1] - rows[-1 - p])
    radius = ends.mean(axis=1)[:, None] + np.diff(ends) / 2 * t
    nodes = (top[:, :, None] + np.arange(-p, 1)).reshape(len(top), 1, -1)
    out = np.zeros((*radius.shape, p + 1, p + 1, 3))
    out[..., -1, 0] = slope * 2 / np.diff(ends)[:, :, None]
    out[..., 1] = shape[:, :, None] * up
    out[..., -1, 2] = shape / radius[..., None]
    count = radius.size
    nodes = np.ascontiguousarray(np.broadcast_to(nodes, (*radius.shape, nodes.shape[-1])).reshape(count, -1))
    return Points(out.reshape(count, -1, 3), nodes, np.arange(count), disc.foam.circles), radius.ravel()


def deformation(points: Points, amplitude: Array) -> Array:
    """Deformation gradients (circles, angles, 3, 3)."""
    strain = np.moveaxis(gradients(points, amplitude), 1, 2)
    return np.eye(3) + strain.reshape(*strain.shape[:2], 3, 3)


def displacement(points: Points, amplitude: Array) -> Array:
    """Displacements (circles, angles, 3) in the local frame."""
    radius = 1 / points.shape[..., 2].sum(axis=1)
    at = np.einsum("ra,racm->rcm", points.shape[..., 2] * radius[:, None], amplitude[points.nodes])
    even, odd = np.einsum("rcm,rmj->rjc", at, points.circles.cosine), at[:, 1, None] @ points.circles.sine
    even[..., 1] = odd[:, 0]
    return even


def contact_ratios(disc: ClippedDisc, x: Array) -> tuple[float, float, float]:
    """Ratios of the largest pressure, a facet's average, and of the areas of face and wall to the axisymmetric ones."""
    at, before = contact_state(disc, x), contact_state(replace(disc, outside=None), np.zeros_like(x))
    facets, weight = len(disc.facing.nodes), disc.facing.weight
    share = disc.facing.radius.reshape(facets, -1, 1)

    def largest(gap: Array) -> float:
        held = pressure(disc.punch, gap).reshape(facets, -1, gap.shape[1])
        return float(((share * held).sum(axis=1) / share.sum(axis=1)).max())

    def areas(gap: Array, wall: NDArray[np.bool_]) -> tuple[float, float]:
        return float(weight[(gap > 0) & ~wall].sum()), float(weight[(gap > 0) & wall].sum())

    (face, wall), (old_face, old_wall) = areas(at.penetration, at.wall), areas(before.penetration, before.wall)
    pressed = largest(at.penetration) / largest(before.penetration)
    return pressed, face / old_face, wall / old_wall if old_wall > 0 else 1.0
