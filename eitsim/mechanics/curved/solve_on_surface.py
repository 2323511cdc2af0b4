"""Touches of rigid punches on a curved body whose skin lies on a rigid core: each group of near ones by itself.

A group is solved by coordinates of the surface about its middle, as a flat layer is, on a mesh that is laid into space.
Alone, a punch stands on a spherical cap of the surface's mean curvature, where its touch is axisymmetric: on a sphere
that is all.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from eitsim.mechanics.axisymmetric.continuation import or_raised
from eitsim.mechanics.axisymmetric.solve_axisymmetric import Unresolved
from eitsim.mechanics.contact.punch_shape import PunchShape
from eitsim.mechanics.curved.solve_on_cap import CapField, solve_on_cap
from eitsim.mechanics.curved.space_field import Neighbourhood, SpaceField
from eitsim.mechanics.general.meshing.layer_layout import ChartLayout, curvatures
from eitsim.mechanics.general.meshing.levels import COARSE, FINE, ROUGH, Level, checked_gaps
from eitsim.mechanics.general.solve_general import GeneralSolution, solve_general, solved_finer
from eitsim.mechanics.general.solved_layer import upright_where_they_rub
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch
from eitsim.scene.surfaces.curved_surface import CurvedSurface
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Least distance from a punch's edge, thicknesses, to which a mesh must reach, and how far it goes on after its last
# corner; and the largest curvature, over the thickness, whose layer is meshed.
_LEAST_REACH, _MARGIN, _MOST_CURVED = 1.5, 1.0, 0.9


@dataclass(frozen=True, eq=False)
class CurvedSolution:
    """Touches on a curved body."""

    # one a punch; lengths and directions are those of the surface, its normals in place of the z axis
    touches: tuple[Touch, ...]
    field: SpaceField
    groups: tuple[GeneralSolution, ...]  # those that are solved in three dimensions

    @property
    def cpu_s(self) -> float:
        """CPU time spent, s."""
        return sum(touch.cpu_s for touch in self.touches)


def solve_on_surface(law: Law, surface: CurvedSurface, thickness_m: float, punches: Sequence[Punch], places_m: Array, *,
                     level: Level = COARSE, coarser: Level = ROUGH, shapes: Sequence[PunchShape | None] = (),
                     requested: Array | None = None) -> CurvedSolution:
    """Equilibrium of a layer of a thickness, m, under a surface, fixed to a rigid core, under rigid punches. Each
    stands over the place of the surface that is nearest to its own of places (punches, 3), m, along the
    normal there but for its tilt, whose direction counts from the first tangent (`tangent_frame`); its x and y are not
    read. Ends of the surface are free; shapes as of `solve_general`, requested errors of `solved_finer`, by which a
    touch on a cap is solved on elements of half the size as well.

    ValueError where a punch that leans rubs, or one overhangs an edge or another punch, or the body is too small or too
    curved for the layer; NotConverged where no equilibrium is found.
    """
    places = surface.nearest(np.atleast_2d(np.asarray(places_m, dtype=float)))[0]
    found, parts, solutions = {}, [], []
    for group, layout, there in _laid_out(surface, thickness_m, punches, places, level):
        own = [shapes[k] for k in group] if shapes else []
        fine, rough, finest = (_within(layout, each, there) for each in (level, coarser, FINE))
        if layout.chart.ball_m is not None and _alone_on_ball(layout, there) and not any(own):
            found[group[0]], cap = _on_cap(law, thickness_m, there[0], 1 / layout.chart.ball_m, level, requested)
            parts.append(Neighbourhood(layout, cap, layout.chart.limit_m))
            continue
        body = Body(layout.chart.edge, thickness_m)
        solution = solve_general(law, body, there, level=fine, coarser=rough, layout=layout, shapes=own)
        if requested is not None:
            solution = solved_finer(solution, solution.touches[0].signal_errors, requested, finest) or solution
        parts.append(Neighbourhood(layout, solution.field, min(layout.chart.limit_m, solution.field.exact.reach_m)))
        found |= dict(zip(group, solution.touches, strict=True))
        solutions.append(solution)
    return CurvedSolution(tuple(found[k] for k in range(len(punches))), SpaceField(tuple(parts)), tuple(solutions))


def _groups(punches: Sequence[Punch], places: Array, reach_m: float) -> list[list[int]]:
    """Numbers of punches whose edges are nearer to each other than a distance, one way or another."""
    radius = np.array([punch.diameter_m / 2 for punch in punches])
    near = cdist(places, places) - radius[:, None] - radius < reach_m
    count, label = connected_components(near, directed=False)
    return [np.flatnonzero(label == k).tolist() for k in range(count)]


def _laid_out(surface: CurvedSurface, thickness_m: float, punches: Sequence[Punch], places_m: Array, level: Level
              ) -> Iterator[tuple[list[int], ChartLayout, list[Punch]]]:
    """Numbers of the punches of each group, coordinates about it, and the punches where these have their places
    (punches, 3), m."""
    for group in _groups(punches, places_m, thickness_m * (2 * level.reach + _MARGIN)):
        layout = ChartLayout(surface.chart_about(places_m[group].mean(axis=0)), thickness_m)
        yield group, layout, [replace(punches[k], x_m=float(u), y_m=float(v))
                              for k, (u, v) in zip(group, layout.chart.find(places_m[group]), strict=True)]


def _alone_on_ball(layout: ChartLayout, punches: Sequence[Punch]) -> bool:
    return layout.chart.ball_m is not None and len(punches) == 1 and punches[0].axisymmetric


def _on_cap(law: Law, thickness_m: float, punch: Punch, curvature_per_m: float, level: Level, requested: Array | None
            ) -> tuple[Touch, CapField]:
    """On elements of half the size on a finer level, or where the default ones do not resolve the foam at the punch's
    edge or the signals' errors exceed those requested."""
    solved, found = partial(solve_on_cap, law, thickness_m, punch, curvature_per_m), None
    if level.element >= COARSE.element:
        with suppress(Unresolved):
            found = solved()
            if requested is None or np.all(found[0].signal_errors <= requested):
                return found
    try:
        return solved(finer=True)
    except NotConverged as error:
        return or_raised(found, error)


def _within(layout: ChartLayout, level: Level, punches: Sequence[Punch]) -> Level:
    """The level with a mesh that stays within the coordinates. ValueError where that or the layer does not fit."""
    unit = layout.unit_m
    for punch in punches:
        _, most = curvatures(layout, np.array([punch.x_m, punch.y_m]) / unit)
        if not most < _MOST_CURVED:
            raise ValueError(f"thickness_mm: {unit * 1e3:.3g} mm is too thick for a surface whose radius is "
                             f"{unit * 1e3 / most:.3g} mm; give less than {_MOST_CURVED * unit * 1e3 / most:.3g} mm.")
    outermost = max(np.hypot(punch.x_m, punch.y_m) + punch.diameter_m / 2 for punch in punches) / unit
    room = layout.chart.limit_m / unit - outermost - _MARGIN
    if not room > _LEAST_REACH:
        needed, limit = (_LEAST_REACH + _MARGIN) * unit * 1e3, layout.chart.limit_m * 1e3
        if (opened := layout.chart.open_m) is None:
            why = (f"body, of which {limit:.3g} mm to each side can be laid out flat; take smaller punches, or fewer "
                   "together.")
        else:
            x, y, z = 1e3 * opened
            why = (f"body, whose triangles end {limit:.3g} mm away at ({x:.4g}, {y:.4g}, {z:.4g}) mm; fill the hole "
                   "there, or press farther from it.")
        raise ValueError(f"the punches and {needed:.3g} mm about them do not fit on the {why}")
    return replace(level, reach=min(level.reach, room))


def alone_on_balls(surface: CurvedSurface, thickness_m: float, punches: Sequence[Punch], places_m: Array) -> int:
    """How many punches `solve_on_surface` takes as axisymmetric on a cap."""
    places = surface.nearest(np.atleast_2d(np.asarray(places_m, dtype=float)))[0]
    return sum(_alone_on_ball(layout, there)
               for _, layout, there in _laid_out(surface, thickness_m, punches, places, COARSE))


def unfit(surface: CurvedSurface, thickness_m: float, punches: Sequence[Punch], places_m: Array) -> str:
    """Why the layer or the neighbourhood of a punch does not fit on the surface, as `solve_on_surface` raises it; empty
    where they do."""
    places = surface.nearest(np.atleast_2d(np.asarray(places_m, dtype=float)))[0]
    for group, layout, there in _laid_out(surface, thickness_m, punches, places, COARSE):
        try:
            _within(layout, COARSE, there)
            upright_where_they_rub(there)
            if layout.chart.ball_m is None or len(group) > 1:
                checked_gaps(Body(layout.chart.edge, thickness_m),
                             np.array([(punch.x_m, punch.y_m) for punch in there]) / thickness_m,
                             np.array([punch.diameter_m / 2 for punch in there]) / thickness_m, group)
        except ValueError as error:
            return str(error)
    return ""
