"""The ways in which a touch is solved: which touches each serves, what it leaves out, and its solution with its error.

A new way is a class here and its place in ROUTES.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from eitsim.mechanics.axisymmetric.continuation import BOTTOM
from eitsim.mechanics.axisymmetric.hold import kept, solve_hold
from eitsim.mechanics.axisymmetric.solve_axisymmetric import Unresolved, solve_touch
from eitsim.mechanics.contact import friction
from eitsim.mechanics.load_paths.rim_table import near_rim_from, within
from eitsim.mechanics.load_paths.several_edges import near_edges_from
from eitsim.mechanics.load_paths.table import touch_from
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.interaction import edge_gap_m
from eitsim.mechanics.rim.solve_near_rim import COARSE, FINE, LEAST_GAP, solve_near_rim
from eitsim.mechanics.rim.two_punches import FINEST, solved_together
from eitsim.mechanics.rim.two_punches import LEAST_GAP as LEAST_PAIR_GAP
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.choices import Kind, Why
from eitsim.scene.nearest_edge import STRAIGHT_M, NearestEdge
from eitsim.scene.results import Touch, of_strain
from eitsim.scene.scene import Body, Punch, Scene, rim_gap_m
from eitsim.simulation.edge_effects import (
    EDGE_SHARE,
    added_edges_cost,
    effect_of_edges,
    other_edges_effect,
    outer_edge_effect,
)
from eitsim.simulation.kept_touches import kept_touch
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.choice import Choice

MECHANICS_SHARE = 0.8  # Part of the requested signal error that the mechanics may use up.
RIM_SHARE = 1.0  # Part of the requested signal error that a table of changes may use up in addition to the paths.
_MOST_NODES = 6000  # Nodes of a mesh that may still be halved: four times as many took 430 MB for 5700.
_NEAR = 1e-9  # Gaps closer than this are one, thicknesses.


@dataclass(frozen=True, eq=False)
class Case:
    """One touch of a scene, and what its routes ask of it more than once."""

    scene: Scene
    punch: Punch
    exact: bool = False

    @cached_property
    def gap_m(self) -> float:
        """Distance of the punch's edge to the nearest edge of the skin, m."""
        return rim_gap_m(self.scene.body, self.punch)

    @cached_property
    def by_edges(self) -> float:
        """What all edges may change of the signal."""
        return effect_of_edges(self.scene, self.punch)

    @property
    def near(self) -> bool:
        """Whether neglecting edges may cost more of the signal than its share of the requested error."""
        return self.gap_m <= 0 or self.by_edges > self.allowed

    @property
    def bare_holes(self) -> bool:
        """Whether the skin has holes, and electrodes lie along its outer edge alone."""
        return self.scene.electrodes.kind == "line" and len(self.scene.body.edge.loops) > 1

    @property
    def stiffening(self) -> float:
        """What electrodes that do not give way may change: as much as the edges that carry them."""
        return outer_edge_effect(self.scene, self.punch) if self.bare_holes else self.by_edges

    @cached_property
    def by_other_edges(self) -> float:
        """What the edges but the nearest may change of the signal."""
        return other_edges_effect(self.scene, self.punch) if self.scene.body.has_outline else 0.0

    @cached_property
    def nearest(self) -> NearestEdge | None:
        """The nearest edge of an outline; None on a disc."""
        body = self.scene.body
        return body.edge.nearest((self.punch.x_m, self.punch.y_m)) if body.has_outline else None

    @property
    def straight(self) -> bool:
        """Whether a table may serve it near its edge: that of a disc, or a straight one."""
        return self.nearest is None or self.nearest.disc_m == STRAIGHT_M

    @property
    def allowed(self) -> float:
        """What neglecting edges may cost of the signal."""
        return EDGE_SHARE * self.scene.accuracy.signal

    def added_up(self, reach: float) -> float:
        """What adding up the changes by several edges, as far as a reach, thicknesses, may cost of the signal."""
        return added_edges_cost(self.scene, self.punch, reach)

    @property
    def creeps(self) -> bool:
        """Whether the touch is held while its deformation goes on."""
        return bool(self.scene.hold.time_s) and not self.scene.hold.keeps_deformation


class Route(Protocol):
    """A way to solve one touch."""

    @property
    def kind(self) -> Kind:
        """What the plan calls it."""
        ...

    def leaves_out(self, case: Case) -> float:
        """Relative error of the signal dV that it leaves out, at most."""
        ...

    def serves(self, case: Case) -> float | Choice:
        """CPU time of a usual touch, s; or why it cannot solve this one."""
        ...

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        """The touch from a table of load paths; None where it does not hold it to the requested error."""
        ...

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        """The touch; `keep` keeps it by its content, and takes one that was. NotConverged where none is found."""
        ...


class Axisymmetric:
    """About the punch's axis: on the default mesh, and on one of half its element size where that misses the requested
    error or is not exact."""

    kind = Kind.AXISYMMETRIC

    def leaves_out(self, case: Case) -> float:
        return case.by_edges if case.gap_m > 0 else math.inf

    def serves(self, case: Case) -> float | Choice:
        return 0.3

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        return touch_from(table, law, case.scene.body, case.punch)

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        body, punch = case.scene.body, case.punch
        if not case.exact:
            with suppress(Unresolved):  # where the default mesh is too coarse to show the foam at the punch's edge
                touch, nodes = kept_touch("default mesh", solve_touch, law, body, punch, keep)
                if fine_enough([touch], case.scene) or not _refinable(nodes, punch):
                    return touch
        finer = partial(solve_touch, element_m=default_element_m(body, punch) / 2)
        return kept_touch("finer mesh", finer, law, body, punch, keep)[0]


class NearestAlone:
    """With what the rim, or the nearest edge alone, changes."""

    kind = Kind.NEAREST_EDGE

    def leaves_out(self, case: Case) -> float:
        return case.by_other_edges

    def serves(self, case: Case) -> float | Choice:
        return _edge_problem(case) or (6.0 if case.scene.body.has_outline else 1.9)

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        touch = touch_from(table, law, case.scene.body, case.punch)
        return touch and near_rim_from(_within(table, case.scene), touch, case.scene.body, case.punch)

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        solve = partial(solve_near_rim, whole=case.exact)
        return kept_touch("near the rim", solve, law, case.scene.body, case.punch, keep)[0]


class AllEdges:
    """With what all edges of an outline change."""

    kind = Kind.ALL_EDGES

    def leaves_out(self, case: Case) -> float:
        return other_edges_effect(case.scene, case.punch, FINE.out_to) if case.scene.body.has_outline else 0.0

    def serves(self, case: Case) -> float | Choice:
        return _edge_problem(case) or (12.0 if case.scene.body.has_outline else Choice(Why.NOT_THIS_BODY))

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        if table.rim is None or (touch := touch_from(table, law, case.scene.body, case.punch)) is None:
            return None
        cost = case.added_up(float(table.rim.gaps[-1]))
        return near_edges_from(_within(table, case.scene), touch, case.scene.body, case.punch, cost) if (
            cost <= RIM_SHARE * case.scene.accuracy.signal) else None

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        solve = partial(solve_near_rim, whole=case.exact, all_edges=True)
        return kept_touch("near several edges", solve, law, case.scene.body, case.punch, keep)[0]


class WholeDisc(NearestAlone):
    """With what the rim changes on the whole of a disc, on the finest meshes; for exact runs."""

    kind = Kind.WHOLE_DISC

    def serves(self, case: Case) -> float | Choice:
        return Choice(Why.NOT_THIS_BODY) if case.scene.body.has_outline else _edge_problem(case) or 17.0


AXISYMMETRIC, WHOLE_DISC = Axisymmetric(), WholeDisc()
# from the cheapest on; CPU times as in benchmarks/results, sweeps_ways.csv and edge_touches.csv
ROUTES: tuple[Route, ...] = (AXISYMMETRIC, NearestAlone(), AllEdges())


@dataclass(frozen=True)
class Pair:
    """Two touches solved together, whose own ones are there."""

    touches: tuple[int, int]
    edges: bool  # whether edges count

    def solve(self, found: Sequence[Touch], law: Law, scene: Scene, exact: bool) -> tuple[Touch, Touch]:
        """Both with what each changes of the other."""
        i, j = self.touches
        return solved_together((found[i], found[j]), law, scene.body, (scene.punches[i], scene.punches[j]),
                               coarse=FINE if exact else COARSE, fine=FINEST if exact else FINE, edges=self.edges)


def pair_problem(body: Body, punches: Sequence[Punch]) -> Choice | None:
    """Why touches cannot be solved together; None where they can."""
    if len(punches) != 2:
        return Choice(Why.MORE_THAN_TWO)
    if any(punch.friction != "none" for punch in punches):
        return Choice(Why.PAIR_FRICTION)
    least_m = LEAST_PAIR_GAP * body.thickness_m
    return Choice(Why.PAIR_GAP, {"least_m": least_m}) if (
        edge_gap_m(*punches) < (LEAST_PAIR_GAP - _NEAR) * body.thickness_m) else None


def held(route: Route, case: Case, law: Law, series: Prony) -> list[tuple[float, Touch]]:
    """A held touch by a route at the end of loading, fine enough at the times that the scene asks for."""
    hold, body, punch = case.scene.hold, case.scene.body, case.punch
    if hold.keeps_deformation:
        return kept(series, hold, route.solve(case, law, keep=False))
    if not case.exact:
        found = solve_hold(law, series, body, punch, hold)
        if fine_enough([touch for _, touch in found[1:]], case.scene):
            return found
    return solve_hold(law, series, body, punch, hold, element_m=default_element_m(body, punch) / 2)


def fine_enough(touches: Sequence[Touch], scene: Scene) -> bool:
    """Whether touches meet the mechanics' share of the requested error, or are bottomed out."""
    return all(of_strain(touch.signal_errors, scene.skin.strain) <= MECHANICS_SHARE * scene.accuracy.signal
               or touch.depth_m > BOTTOM * scene.body.thickness_m for touch in touches)


def _edge_problem(case: Case) -> Choice | None:
    """Why a touch cannot be solved near an edge."""
    least_m = LEAST_GAP * case.scene.body.edge.size_m
    if case.gap_m < least_m:
        return Choice(Why.OFF_SKIN, {"gap_m": case.gap_m, "least_m": least_m, "outline": case.scene.body.has_outline})
    if 0 < friction.coefficient(case.punch) < np.inf:
        return Choice(Why.SLIPS)
    return Choice(Why.CREEPS) if case.creeps else None


def _refinable(nodes: int, punch: Punch) -> bool:
    """Whether half the element size is in reach: of the memory, and not at the end of a load path with friction, which
    may have to be loaded again from rest on the finer mesh at fifty times the cost."""
    return nodes <= _MOST_NODES and punch.friction == "none"


def _within(table: Table, scene: Scene) -> Table:
    """The table with the changes alone that meet the requested error."""
    return table if table.rim is None else replace(
        table, rim=within(table.rim, RIM_SHARE * scene.accuracy.signal, scene.skin.strain))
