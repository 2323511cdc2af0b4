"""A touch by itself, axisymmetric about its punch."""

import math
from collections.abc import Sequence
from contextlib import suppress
from functools import partial

from eitsim.mechanics.axisymmetric.continuation import BOTTOM, or_raised
from eitsim.mechanics.axisymmetric.hold import solve_hold
from eitsim.mechanics.axisymmetric.solve_axisymmetric import Unresolved, solve_touch
from eitsim.mechanics.load_paths.table import touch_from
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import Touch, of_strain
from eitsim.scene.scene import Punch, Scene
from eitsim.simulation.kept_touches import kept_touch, with_nodes
from eitsim.simulation.routes.route import NOT_MEANT, Case, Route, Values, Words, from_edge
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.choice import Choice
from touchcal.errors import NotConverged

MECHANICS_SHARE = 0.8  # Part of the requested signal error that the mechanics may use up.
# Factorisations of half the element size that are tried where the default size is solved: those that succeed took up to
# 34 in 86 random scenes.
_HALVED = 60
_MOST_NODES = 6000  # Nodes of a mesh that may still be halved: four times as many took 430 MB for 5700.


class Axisymmetric(Route):
    """About the punch's axis: on the default mesh, and on one of half its element size where that misses the requested
    error or is not exact. Where the finer one finds no equilibrium, as where its elements let stretch concentrate in
    ever fewer of them, the default one's touch serves with its error."""

    kind = "axisymmetric"

    def serves(self, case: Case) -> float | Choice:
        return 0.3 if len(case.touches) == 1 else NOT_MEANT

    def leaves_out(self, case: Case) -> float:
        return case.by_edges if case.gap_m > 0 else math.inf

    def refinable(self, case: Case, touch: Touch) -> bool:
        # without friction one that is not fine enough was refined already, or cannot be
        return not (case.exact or case.finer) and (case.punch.friction != "none" or fine_enough([touch], case.scene))

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        body, punch, touch = case.scene.body, case.punch, None
        if not (case.exact or case.finer):
            with suppress(Unresolved):  # where the default mesh is too coarse to show the foam at the punch's edge
                touch, nodes = kept_touch("default mesh", solve_touch, law, body, punch) if keep else (
                    with_nodes(solve_touch(law, body, punch)))
                if fine_enough([touch], case.scene) or not _refinable(nodes, punch):
                    return touch
        finer = partial(solve_touch, element_m=default_element_m(body, punch) / 2,
                        factorisations=None if touch is None else _HALVED)
        try:
            return kept_touch("finer mesh", finer, law, body, punch)[0] if keep else finer(law, body, punch)
        except NotConverged as error:
            return or_raised(touch, error)

    def solve_held(self, case: Case, law: Law, series: Prony) -> list[tuple[float, Touch]]:
        hold, body, punch, found = case.scene.hold, case.scene.body, case.punch, None
        if not (case.exact or case.finer):
            with suppress(Unresolved):
                found = solve_hold(law, series, body, punch, hold)
                if punch.friction != "none" or fine_enough([touch for _, touch in found[1:]], case.scene):
                    return found
        try:
            return solve_hold(law, series, body, punch, hold, element_m=default_element_m(body, punch) / 2)
        except NotConverged as error:
            return or_raised(found, error)

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        return touch_from(table, law, case.scene.body, case.punch)

    def words(self, of: Values) -> Words:
        disc = ("; solved on the disc of the outline's area, and bounded by what rims of discs change that are as near "
                "as the edges in each quarter about it") if of["outline"] else ""
        return "mechanics axisymmetric about the punch", from_edge(of) + disc


AXISYMMETRIC = Axisymmetric()


def fine_enough(touches: Sequence[Touch], scene: Scene) -> bool:
    """Whether touches meet the mechanics' share of the requested error, or are bottomed out."""
    return all(of_strain(touch.signal_errors, scene.skin.strain) <= MECHANICS_SHARE * scene.accuracy.signal
               or touch.depth_m > BOTTOM * scene.body.thickness_m for touch in touches)


def _refinable(nodes: int, punch: Punch) -> bool:
    """Whether half the element size is tried before the readings are known: where it is in reach of the memory, and not
    at the end of a load path with friction, which may have to be loaded again from rest on the finer mesh."""
    return nodes <= _MOST_NODES and punch.friction == "none"
