"""A touch with what the rim, or the nearest edge alone, changes of the axisymmetric one."""

from dataclasses import replace
from functools import partial
from typing import Any

from eitsim.mechanics.load_paths.rim_table import near_rim_from, within
from eitsim.mechanics.load_paths.table import touch_from
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.solve_near_rim import LEAST_GAP
from eitsim.scene.results import Touch
from eitsim.scene.scene import Scene
from eitsim.simulation.kept_touches import kept_touch
from eitsim.simulation.near_edges import solve_near_rim
from eitsim.simulation.routes.route import NOT_MEANT, Case, Route, Values, Words, from_edge, off_skin
from matcal.laws.law import Law
from touchcal.choice import Choice

# Error of a touch near an edge over what all edges change (benchmarks/general_errors.py).
OF_CHANGE = 0.3
RIM_SHARE = 1.0  # Part of the requested signal error that a table of changes may use up in addition to the paths.
# Parts of lines of a plan.
CHANGE = ", as a change of the axisymmetric touch"
TABLED = "nothing is solved in three dimensions, and what the table may be off counts with its load path"
ERROR = "a coarser mesh with fewer harmonics tells the error, which counts in the result's own"


class NearestAlone(Route):
    """With what the rim, or the nearest edge alone, changes."""

    kind = "nearest_edge"
    locking = True

    def serves(self, case: Case) -> float | Choice:
        return edge_problem(case) or (6.0 if case.scene.body.has_outline else 3.1)

    def leaves_out(self, case: Case) -> float:
        return case.by_other_edges

    def expected(self, case: Case) -> float:
        return OF_CHANGE * case.by_edges

    def refinable(self, case: Case, touch: Touch) -> bool:
        return not (case.exact or case.finer)

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        solve = partial(solve_near_rim, finer=case.finer, whole=case.exact)
        at, how = (law, case.scene.body, case.punch), "near the rim" + ", finer" * case.finer
        return kept_touch(how, solve, *at)[0] if keep else solve(*at)

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        touch = touch_from(table, law, case.scene.body, case.punch)
        return touch and near_rim_from(within_error(table, case.scene), touch, case.scene.body, case.punch)

    def storable(self, case: Case, reach: float) -> bool:
        return case.straight

    def values(self, case: Case, touch: Touch | None) -> dict[str, Any]:
        return {**super().values(case, touch), "disc_m": None if case.straight else case.nearest.disc_m}

    def words(self, of: Values) -> Words:
        if of["tabled"]:
            edge, bound = ("one edge", "; the bound is of the other edges") if of["outline"] else ("the rim", "")
            return f"what {edge} changes of the axisymmetric touch, from a table", f"{from_edge(of)}; {TABLED}{bound}"
        if not of["outline"]:
            return f"mechanics in three dimensions near the rim{CHANGE}", f"{from_edge(of)}; {ERROR}"
        shape = "a straight one" if of["disc_m"] is None else f"part of a circle of {of['disc_mm']:.0f} mm"
        return (f"mechanics in three dimensions near one edge{CHANGE}",
                f"{from_edge(of)}, taken as {shape}; {ERROR}; the bound is of the other edges")


def edge_problem(case: Case) -> Choice | None:
    """Why a touch cannot be solved near an edge, as a change of the axisymmetric one."""
    if len(case.touches) > 1:
        return NOT_MEANT
    return NOT_MEANT if case.creeps else off_skin(case, LEAST_GAP * case.scene.body.edge.size_m)


def within_error(table: Table, scene: Scene) -> Table:
    """The table with the changes alone that meet the requested error."""
    return table if table.rim is None else replace(
        table, rim=within(table.rim, RIM_SHARE * scene.accuracy.signal, scene.skin.strain))
