"""A touch with what all edges of an outline change of the axisymmetric one."""

from functools import partial

from eitsim.mechanics.load_paths.several_edges import near_edges_from
from eitsim.mechanics.load_paths.table import touch_from
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.solve_near_rim import FINE
from eitsim.scene.results import Touch
from eitsim.simulation.edge_effects import other_edges_effect
from eitsim.simulation.kept_touches import kept_touch
from eitsim.simulation.near_edges import solve_near_rim
from eitsim.simulation.routes.nearest_alone import (
    CHANGE,
    ERROR,
    OF_CHANGE,
    RIM_SHARE,
    TABLED,
    edge_problem,
    within_error,
)
from eitsim.simulation.routes.route import NOT_MEANT, Case, Route, Values, Words, from_edge
from matcal.laws.law import Law
from touchcal.choice import Choice


class AllEdges(Route):
    """With what all edges of an outline change."""

    kind = "all_edges"
    locking = True

    def serves(self, case: Case) -> float | Choice:
        return edge_problem(case) or 6.0 if case.scene.body.has_outline else NOT_MEANT

    def leaves_out(self, case: Case) -> float:
        return other_edges_effect(case.scene, case.punch, FINE.out_to)

    def expected(self, case: Case) -> float:
        return OF_CHANGE * case.by_edges

    def refinable(self, case: Case, touch: Touch) -> bool:
        return not (case.exact or case.finer)

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        solve = partial(solve_near_rim, finer=case.finer, whole=case.exact, all_edges=True)
        at, how = (law, case.scene.body, case.punch), "near several edges" + ", finer" * case.finer
        return kept_touch(how, solve, *at)[0] if keep else solve(*at)

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        if table.rim is None or (touch := touch_from(table, law, case.scene.body, case.punch)) is None:
            return None
        reach = float(table.rim.gaps[-1])
        return near_edges_from(within_error(table, case.scene), touch, case.scene.body, case.punch,
                               case.added_up(reach)) if _adds_up(case, reach) else None

    def storable(self, case: Case, reach: float) -> bool:
        return case.straight and _adds_up(case, reach)

    def words(self, of: Values) -> Words:
        if of["tabled"]:
            return "what several edges change of the axisymmetric touch, each from a table, added up", (
                f"{from_edge(of)}; {TABLED}; the bound is of edges further away than {FINE.out_to:g} thicknesses")
        edges, cut = ("several edges", "outline") if of["outline"] else ("the rim", "rim")
        return (f"mechanics in three dimensions near {edges}{CHANGE}",
                f"{from_edge(of)}; circles about the punch are cut where the {cut} cuts them; {ERROR}; the bound is of "
                f"edges further away than {FINE.out_to:g} thicknesses")


ALL_EDGES = AllEdges()


def _adds_up(case: Case, reach: float) -> bool:
    return case.added_up(reach) <= RIM_SHARE * case.scene.accuracy.signal
