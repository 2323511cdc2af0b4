"""A touch with what the rim changes on the whole of a disc, on the finest meshes; for exact runs."""

from eitsim.simulation.routes.nearest_alone import CHANGE, ERROR, NearestAlone, edge_problem
from eitsim.simulation.routes.route import NOT_MEANT, Case, Values, Words, from_edge
from touchcal.choice import Choice


class WholeDisc(NearestAlone):
    """With what the rim changes on the whole of a disc, on the finest meshes."""

    kind = "whole_disc"
    for_exact = True

    def serves(self, case: Case) -> float | Choice:
        return NOT_MEANT if case.scene.body.has_outline else edge_problem(case) or 17.0

    def words(self, of: Values) -> Words:
        return f"exact: mechanics in three dimensions on the whole disc{CHANGE}", f"{from_edge(of)}; {ERROR}"
