"""Two touches solved together, each with what the other changes of it, and near edges with what these change."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.interaction import edge_gap_m
from eitsim.mechanics.rim.solve_near_rim import COARSE, FINE
from eitsim.mechanics.rim.two_punches import FINEST, LEAST_GAP
from eitsim.scene.choices import Why
from eitsim.scene.results import Touch
from eitsim.simulation.near_edges import solved_together
from eitsim.simulation.routes.all_edges import ALL_EDGES
from eitsim.simulation.routes.axisymmetric import AXISYMMETRIC
from eitsim.simulation.routes.route import NOT_MEANT, Case, Route, Values, Words
from matcal.laws.law import Law
from touchcal.choice import Choice

_NEAR = 1e-9  # Gaps closer than this are one, thicknesses.


class Pair(Route):
    """Two touches without friction, begun by the axisymmetric ones."""

    kind = "pair"
    locking = True
    problems: ClassVar[Mapping[str, str]] = {
        Why.MORE_THAN_TWO: "two touches, not more, are solved together",
        Why.PAIR_FRICTION: "only frictionless punches are solved together",
        Why.PAIR_GAP: "two touches are solved together from a gap of {least_mm:.1f} mm on"}

    def serves(self, case: Case) -> float | Choice:
        if len(case.touches) != 2:
            return NOT_MEANT if len(case.touches) == 1 else Choice(Why.MORE_THAN_TWO)
        if any(punch.friction != "none" for punch in case.punches):
            return Choice(Why.PAIR_FRICTION)
        least, thickness_m = LEAST_GAP, case.scene.body.thickness_m
        return Choice(Why.PAIR_GAP, {"least_m": least * thickness_m}) if (
            edge_gap_m(*case.punches) < (least - _NEAR) * thickness_m) else 15.0

    def leaves_out(self, case: Case) -> float:
        return max(self.of_touch(case).leaves_out(one) for one in case.each)

    def solve_together(self, case: Case, law: Law, keep: bool, known: Sequence[Touch | None]) -> Sequence[Touch]:
        alone = [touch or AXISYMMETRIC.solve(one, law, keep) for one, touch in zip(case.each, known, strict=True)]
        return solved_together(alone, law, case.scene.body, case.punches, coarse=FINE if case.exact else COARSE,
                               fine=FINEST if case.exact else FINE, edges=case.near)

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        return None if case.near else AXISYMMETRIC.stored(case, law, table)

    def of_touch(self, case: Case) -> Route:
        return ALL_EDGES if case.near else AXISYMMETRIC

    def words(self, of: Values) -> Words:
        named = " and ".join(str(i + 1) for i in of["between"])
        return (f"touches {named} solved together in three dimensions",
                f"{of['gap_mm']:.1f} mm lie between their edges, {of['gap_m'] / of['thickness_m']:.1f} thicknesses; a "
                "coarser mesh with fewer harmonics and the last pass over both tell the error, which counts in the "
                "result's own")
