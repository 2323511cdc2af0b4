"""How finely a layer is meshed, and its mesh: by where each punch's contact ends, and how near edges and others are."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.general.meshing.bodies import NO_BODIES, Bodies
from eitsim.mechanics.general.meshing.layer_layout import FLAT, Cap, Layout
from eitsim.mechanics.general.meshing.section import Grading, Zone, heights, section
from eitsim.mechanics.general.meshing.skin_plan import circles_about, plan
from eitsim.mechanics.general.meshing.wedge_mesh import WedgeMesh, wedge_mesh
from eitsim.scene.polygons import circle, distance_to
from eitsim.scene.scene import Body
from touchcal.arrays import Array

# Default element of the axisymmetric touch over the feature that it resolves (`solid.grid.default_element_m`).
_DEFAULT = 0.12
# Triangles outside the sections: growth per distance, largest size; shortest sector; all in thicknesses.
_GROWTH, _LARGEST, _SHORTEST = 0.6, 1.0, 0.05
# Largest distance from a punch's edge to where its section ends, and the part of the way to an edge or another punch.
_SECTION, _SHARE = 1.0, 0.4
# Distance of the rim of a disc that stands for an endless layer from where a mesh may end, thicknesses; its chords.
_FAR, _CHORDS = 4.0, 72
# Least distance of a punch's edge from an edge of the skin or from another punch, thicknesses.
LEAST_GAP = 0.03


@dataclass(frozen=True)
class Level:
    """How finely a layer is meshed."""

    element: float  # at the end of the contact, over the default one of the axisymmetric touch
    growth: float  # of elements per distance from there
    widest: float  # thicknesses
    tallest: float  # thicknesses
    sectors: int  # about a punch, at least
    reach: float = 2.5  # distance from a punch's edge, thicknesses, at which the mesh ends

    def grading(self, feature: float) -> Grading:
        return Grading(self.element * _DEFAULT * feature, self.growth, self.widest, self.tallest, self.sectors)


ROUGH = Level(8.0, 0.9, 0.7, 0.5, 8)
COARSE = Level(4.0, 0.6, 0.5, 0.3, 12)
FINE = Level(2.0, 0.45, 0.4, 0.25, 16, reach=3.0)


def gaps(body: Body, centres: Array, radii: Array) -> Array:
    """Distance (n,) of each punch's edge, thicknesses, to the nearest edge of the skin or other punch."""
    room = np.asarray(body.edge.gap_m(centres * body.thickness_m)) / body.thickness_m - radii
    between = np.linalg.norm(centres[:, None] - centres, axis=2) - radii[:, None] - radii
    np.fill_diagonal(between, np.inf)
    return np.minimum(room, between.min(axis=1))


def checked_gaps(body: Body, centres: Array, radii: Array, numbers: Sequence[int] | None = None) -> Array:
    """As `gaps`; ValueError, by the punches' numbers, where one overhangs an edge or another or is nearer than
    LEAST_GAP."""
    room = gaps(body, centres, radii)
    if room.min() < LEAST_GAP:
        least, unit_mm = int(room.argmin()), body.thickness_m * 1e3
        number = least if numbers is None else numbers[least]
        raise ValueError(f"the edge of punch {number} (from 0) is {room[least] * unit_mm:.3g} mm from an edge of the "
                         f"skin or from another punch; leave {LEAST_GAP * unit_mm:.3g} mm or more.")
    return room


def layer_mesh(body: Body, centres: Array, zones: tuple[Zone, ...], features: tuple[float, ...], level: Level, *,
               bodies: Bodies = NO_BODIES, layout: Layout = FLAT) -> WedgeMesh:
    """The mesh of a body about punches at centres (n, 2), thicknesses, laid into space, with what is bonded to it;
    sides elsewhere free. ValueError where a punch overhangs an edge or another punch or is nearer than LEAST_GAP."""
    radii = np.array([zone.radius for zone in zones])
    room = checked_gaps(body, centres, radii)
    loops = tuple(loop / body.thickness_m for loop in body.edge.loops)
    pads = [[distance_to(pad.outline, centre) for pad in bodies.pads] for centre in centres]
    room = np.minimum(room, np.min(pads, axis=1, initial=np.inf) - radii)
    outer = radii + np.minimum(_SECTION, _SHARE * room)
    zones = tuple(replace(zone, end=min(zone.end, (zone.radius + 3 * float(r)) / 4))
                  for zone, r in zip(zones, outer, strict=True))
    circles = circles_about(centres, outer, level.sectors, loops, _SHORTEST)
    gradings = [level.grading(feature) for feature in features]
    layers = min((heights(g, zone, float(r)) for g, zone, r in zip(gradings, zones, outer, strict=True)),
                 key=lambda h: h[-1] - h[-2])
    seen = plan(circles, loops, max(level.growth, _GROWTH), _LARGEST, radii + level.reach, bodies)
    sections = tuple(section(g, zone, float(r), layers) for g, zone, r in zip(gradings, zones, outer, strict=True))
    return wedge_mesh(seen, sections, layers, layout=layout)


def mesh_alone(mesh: WedgeMesh, k: int, radius: float, level: Level, curvature: float) -> WedgeMesh:
    """The mesh about punch k alone, with its very section and layers, on an endless layer, flat or of a curvature;
    radius: the punch's."""
    one = mesh.about[k]
    rim = circle(one.circle.centre, radius + 2 * level.reach + _FAR, _CHORDS)
    seen = plan((one.circle,), (rim,), max(level.growth, _GROWTH), _LARGEST, np.array([radius + level.reach]),
                NO_BODIES)
    return wedge_mesh(seen, (one.section,), mesh.heights, layout=Cap(curvature, tuple(one.circle.centre.tolist())))
