"""Any touches that physics allows, one or several together, in three dimensions: what no other route serves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import ClassVar

import numpy as np

from eitsim.mechanics.contact.punch_shape import shapes_of
from eitsim.mechanics.general.mesh_errors import CorrectedField
from eitsim.mechanics.general.meshing.bodies import bodies_of
from eitsim.mechanics.general.meshing.levels import COARSE, FINE, LEAST_GAP, ROUGH
from eitsim.mechanics.general.solve_general import MOST_S, SIGNAL_FLOOR, solve_general, solved_finer
from eitsim.mechanics.rim.interaction import edge_gap_m, expected
from eitsim.scene.choices import Why
from eitsim.scene.curved.curved_scene import AnyScene
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS
from eitsim.simulation.edge_effects import far_edges_effect
from eitsim.simulation.near_edges import read_by
from eitsim.simulation.routes.nearest_alone import OF_CHANGE
from eitsim.simulation.routes.route import Case, Route, Values, Words, from_edge, off_skin
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.choice import Choice

_MESH_SHARE = 0.9  # Part of the requested signal error that the mechanics may use up.
# Part of it that edges outside the mesh may use up, unless the mesh goes as far as so many thicknesses.
_OUTSIDE_SHARE, _FARTHEST = 0.2, 5.0
_MARGIN = 0.5  # Distance from the mesh's end, thicknesses, within which an edge counts as outside.
_CLEAR = 0.1  # Gap to an edge, thicknesses, below which it states as much as the changes of axisymmetric touches.
# CPU time of a usual touch (benchmarks/results/general_touches.csv), and of one that is solved on the FINE level too.
_ONE_S, _FINE_S = 15.0, 50.0


class General(Route):
    """On a mesh of the neighbourhood of the touches, with electrodes as bodies."""

    kind = "general"
    spatial = True
    leaning = True
    problems: ClassVar[Mapping[str, str]] = {
        Why.TOUCHING: "touches are solved together from a gap of {least_mm:.2g} mm on"}

    def serves(self, case: Case) -> float | Choice:
        least_m = LEAST_GAP * case.scene.body.thickness_m
        if why := off_skin(case, least_m):
            return why
        if any(edge_gap_m(one, other) < least_m for one, other in combinations(case.punches, 2)):
            return Choice(Why.TOUCHING, {"least_m": least_m})
        return cost_s(case.scene, case.exact) * len(case.punches)

    def expected(self, case: Case) -> float:
        return OF_CHANGE * case.by_edges if case.gap_m < _CLEAR * case.scene.body.thickness_m else 0.0

    def outside(self, case: Case) -> float:
        return self._outside(case, self._reach(case))

    def refinable(self, case: Case, touch: Touch) -> bool:
        return not (case.exact or case.finer) and _FINE_S * len(case.scene.punches) <= MOST_S and isinstance(
            touch.surface, CorrectedField) and touch.surface.level.element > FINE.element

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        return self.solve_together(case, law, keep, ())[0]

    def solve_together(self, case: Case, law: Law, keep: bool, known: Sequence[Touch | None]) -> Sequence[Touch]:
        fine, coarse, rough = (replace(each, reach=self._reach(case)) for each in (FINE, COARSE, ROUGH))
        body, places = case.scene.body, np.array([(punch.x_m, punch.y_m) for punch in case.punches])
        least = np.array([punch.diameter_m / 2 for punch in case.punches]) + LEAST_GAP * body.thickness_m
        solve = partial(solve_general, law, body, case.punches, shapes=shapes_of(case.punches, body.thickness_m),
                        bodies=bodies_of(body, case.scene.electrodes, places, least))
        if case.exact or case.finer:
            touches = read_by(case.scene, case.punches, solve(level=fine, coarser=coarse, near=_known(case)))
        else:
            found = solve(level=coarse, coarser=rough, near=_known(case))
            touches = read_by(case.scene, case.punches, found)
            if better := solved_finer(found, touches[0].signal_errors, self._requested(case)):
                touches = read_by(case.scene, case.punches, better)
        return [replace(touch, signal_errors=touch.signal_errors + self.outside(case)) for touch in touches]

    def _reach(self, case: Case) -> float:
        """How far, thicknesses, the mesh goes: until its end and edges outside cost little of the requested error."""
        least = (FINE if case.exact else COARSE).reach
        tried = np.arange(least, _FARTHEST + 0.25, 0.5).tolist()
        allowed = _OUTSIDE_SHARE * case.scene.accuracy.signal
        return next((reach for reach in tried if _ended(reach) + self._outside(case, reach) <= allowed), tried[-1])

    def _outside(self, case: Case, reach: float) -> float:
        return max(far_edges_effect(case.scene, punch, reach - _MARGIN) for punch in case.punches)

    def _requested(self, case: Case) -> Array:
        others = expected(case.scene.body, case.scene.punches, (case.touches,))
        return requested_of_mesh(case.scene, self.outside(case) + others)

    def words(self, of: Values) -> Words:
        cost = f"; about {of['cost_s']:.0f} CPU s" if of.get("cost_s", np.inf) < np.inf else ""
        how = "a coarser mesh tells the error, which counts in the result's own" + cost
        if "between" not in of:
            return "mechanics in three dimensions about the touch", f"{from_edge(of)}; {how}"
        *first, last = (str(i + 1) for i in of["between"])
        return (f"touches {', '.join(first)} and {last} solved together in three dimensions",
                f"{of['gap_mm']:.1f} mm lie between the nearest edges of two; {how}")


def _ended(reach: float) -> float:
    """About the part of a signal that a mesh leaves out which ends so many thicknesses from the punch: the slowest mode
    of a layer, shear that is free at the surface, fades so. 2.5 left out 2.7 % of one signal near a rim, 3.5 some 0.8.
    """
    return float(np.exp(-np.pi / 2 * reach))


def requested_of_mesh(scene: AnyScene, others: float = 0.0) -> Array:
    """(3,) What the mesh may leave of the signals, by scene.STRAINS: most of the requested error, without what others,
    as edges and touches outside it, take of that, of the driving strain alone."""
    return np.where(np.array(STRAINS) == scene.skin.strain, _MESH_SHARE * scene.accuracy.signal - others, np.inf)


def cost_s(scene: AnyScene, exact: bool = False) -> float:
    """CPU time of a usual touch, s: on the FINE level too where the requested error is below the floor of COARSE."""
    return _FINE_S if exact or _MESH_SHARE * scene.accuracy.signal < SIGNAL_FLOOR else _ONE_S


def _known(case: Case) -> CorrectedField | None:
    """The field of these touches, and no others, under about these loads."""
    field = case.start[case.touches[0]].surface if case.start else None
    return field if isinstance(field, CorrectedField) and len(field.solved.depths) == len(case.touches) else None
