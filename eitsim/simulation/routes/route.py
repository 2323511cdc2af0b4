"""What a way to solve touches is: which it serves, what it leaves out, their solution, and its lines of a plan.

A new way is one file with a class that inherits `Route`, and its line in `known_routes.py`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from eitsim.mechanics.general.meshing.levels import LEAST_GAP as PAD_GAP
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.interaction import expected
from eitsim.scene.choices import Why
from eitsim.scene.nearest_edge import NearestEdge
from eitsim.scene.results import Touch
from eitsim.scene.scene import Punch, Scene, rim_gap_m
from eitsim.simulation.edge_effects import (
    EDGE_SHARE,
    added_edges_cost,
    effect_of_edges,
    effect_of_electrodes,
    electrode_gap_m,
    other_edges_effect,
)
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.choice import Choice

NOT_MEANT = Choice(Why.NOT_MEANT)  # a route is for other touches, or other bodies

# Part of the effect of the rim, or of another punch, that the end of a conducting punch's contact, kept as it is alone,
# may cost of dV: next to the rim above all that were measured, 14 mm under 0.1 and 1 N.
_CONTACT_SHARE = 0.6
# Part of the requested signal error that neglecting edges may use up under a conducting punch.
_CONDUCTING_SHARE = 0.15

Values = Mapping[str, Any]
Words = tuple[str, str]  # what was decided, and why


@dataclass(frozen=True, eq=False)
class Case:
    """One touch of a scene, or several that are to be solved together, and what routes ask of them more than once."""

    scene: Scene
    touches: tuple[int, ...] = (0,)  # numbers of the touches
    exact: bool = False
    # whether electrodes are solved as bodies where leaving that out costs more than allowed, and touches near edges in
    # the finest way where a rougher one is expected to miss the requested error
    bodies: bool = True
    keeps_volume: bool = False  # whether elements that know displacements alone would lock, as in a rubber
    # whether what is axisymmetric is solved on elements of half the size from the start, and layers on the FINE level
    finer: bool = False
    start: tuple[Touch, ...] = ()  # the scene's touches under about these loads, to start from, where they are known

    @cached_property
    def punches(self) -> tuple[Punch, ...]:
        """The punch of each touch."""
        return tuple(self.scene.punches[i] for i in self.touches)

    @property
    def punch(self) -> Punch:
        """The punch of one touch."""
        (punch,) = self.punches
        return punch

    @cached_property
    def each(self) -> tuple["Case", ...]:
        """Every touch by itself."""
        return (self,) if len(self.touches) == 1 else tuple(replace(self, touches=(i,)) for i in self.touches)

    @cached_property
    def gap_m(self) -> float:
        """Distance of the nearest punch's edge to the nearest edge of the skin, m."""
        return min(rim_gap_m(self.scene.body, punch) for punch in self.punches)

    @cached_property
    def by_edges(self) -> float:
        """What all edges may change of the signal, at most."""
        return max(effect_of_edges(self.scene, punch) for punch in self.punches)

    def by_edges_of(self, stiffer: float) -> float:
        """As `by_edges`, of a layer so many times as stiff as its base."""
        return max(effect_of_edges(self.scene, punch, stiffer) for punch in self.punches)

    @property
    def near(self) -> bool:
        """Whether neglecting edges may cost more of the signal than its share of the requested error."""
        return self.gap_m <= 0 or self.by_edges > self.allowed

    @cached_property
    def by_electrodes(self) -> float:
        """What electrodes that do not give way may change of the signal, at most."""
        return max(effect_of_electrodes(self.scene, punch) for punch in self.punches)

    @property
    def on_pad(self) -> bool:
        """Whether a punch stands on a patch that does not give way, or next to it: no route takes that as a body."""
        least_m, electrodes = PAD_GAP * self.scene.body.thickness_m, self.scene.electrodes
        return not (electrodes.soft or electrodes.along_edge) and any(
            electrode_gap_m(self.scene, punch) <= least_m for punch in self.punches)

    @cached_property
    def by_contact_end(self) -> float:
        """What the end of a conducting punch's contact, kept as it is alone, may cost of the signal."""
        if not any(punch.conductor for punch in self.punches):
            return 0.0
        others = expected(self.scene.body, self.punches) if len(self.punches) > 1 else 0.0
        return _CONTACT_SHARE * max(self.by_edges if self.near else 0.0, others)

    @cached_property
    def by_other_edges(self) -> float:
        """What the edges but the nearest may change of the signal."""
        return other_edges_effect(self.scene, self.punch)

    @cached_property
    def nearest(self) -> NearestEdge:
        """The nearest part of the edge."""
        return self.scene.body.edge.nearest((self.punch.x_m, self.punch.y_m))

    @property
    def straight(self) -> bool:
        """Whether a table may serve it near its edge: that of a disc, or a straight one."""
        return self.nearest.disc_m == self.scene.body.edge.table_rim_m

    @property
    def allowed(self) -> float:
        """What neglecting edges may cost of the signal; less where a punch conducts, since what it shunts and what the
        skin loses cancel in part."""
        share = _CONDUCTING_SHARE if any(punch.conductor for punch in self.punches) else EDGE_SHARE
        return share * self.scene.accuracy.signal

    def added_up(self, reach: float) -> float:
        """What adding up the changes by several edges, as far as a reach, thicknesses, may cost of the signal."""
        return added_edges_cost(self.scene, self.punch, reach)

    @property
    def creeps(self) -> bool:
        """Whether the touch is held while its deformation goes on."""
        return bool(self.scene.hold.time_s) and not self.scene.hold.keeps_deformation


class Route:
    """A way to solve touches, one or several together; what is not said here a route says itself."""

    kind: str  # what results call it, unlike those of all other decisions of a plan
    for_exact = False  # whether it is for exact runs alone, and comes first there
    spatial = False  # whether electrodes are bodies in it, and it shows where contacts end
    leaning = False  # whether it takes punches that lean
    locking = False  # whether its elements lock where the material nearly keeps its volume
    # kind of a refusal of its own -> the clause that tells what is served, filled with the refusal's values
    problems: ClassVar[Mapping[str, str]] = {}

    def serves(self, case: Case) -> float | Choice:
        """CPU time of a usual touch, s; NOT_MEANT, or why it cannot solve these touches."""
        raise NotImplementedError

    def leaves_out(self, case: Case) -> float:
        """Relative error of the signal dV that it leaves out, at most."""
        return 0.0

    def expected(self, case: Case) -> float:
        """Relative error of the signal that its mesh is expected to leave; 0 where it refines itself as requested."""
        return 0.0

    def outside(self, case: Case) -> float:
        """What edges outside its mesh may change of the signal; its touches' own errors hold it."""
        return 0.0

    def refinable(self, case: Case, touch: Touch) -> bool:
        """Whether `Case.finer` would make the touch that was solved better."""
        return False

    def solve(self, case: Case, law: Law, keep: bool) -> Touch:
        """One touch; `keep` keeps it by its content, and takes one that was. NotConverged where none is found."""
        raise NotImplementedError

    def solve_together(self, case: Case, law: Law, keep: bool, known: Sequence[Touch | None]) -> Sequence[Touch]:
        """Several touches; known: those, without what others change, that a table of load paths holds."""
        raise NotImplementedError

    def solve_held(self, case: Case, law: Law, series: Prony) -> list[tuple[float, Touch]]:
        """One held touch whose deformation goes on, at the times, s, that the scene asks for."""
        raise NotImplementedError

    def stored(self, case: Case, law: Law, table: Table) -> Touch | None:
        """One touch from a table of load paths; None where it does not hold it to the requested error."""
        return None

    def storable(self, case: Case, reach: float) -> bool:
        """Whether a table of what edges change as far as a reach, thicknesses, may hold one touch."""
        return False

    def of_touch(self, case: Case) -> "Route":
        """The route that a plan names for every single one of these touches."""
        return self

    def values(self, case: Case, touch: Touch | None) -> dict[str, Any]:
        """What a plan states of one touch; touch: as a table holds it."""
        body = case.scene.body
        return {"gap_m": case.gap_m, "thickness_m": body.thickness_m, "outline": body.has_outline,
                "tabled": touch is not None and touch.rim is not None}

    def words(self, of: Values) -> Words:
        """Its line of a plan for one touch, from `values`; or for several that it solves together, from
        their numbers `between` and the least `gap_m` between two of them. Lengths are given in mm, too."""
        raise NotImplementedError


def off_skin(case: Case, least_m: float) -> Choice | None:
    """Why a touch lies too near to an edge for a route that needs a gap of so much, m; None where it does not."""
    if case.gap_m >= least_m:
        return None
    across_m = float(np.ptp(case.scene.body.edge.loops[0], axis=0).min())
    return Choice(Why.OFF_SKIN, {
        "gap_m": case.gap_m, "least_m": least_m, "outline": case.scene.body.has_outline, "across_m": across_m,
        "diameter_m": max(punch.diameter_m for punch in case.punches)})


def from_edge(of: Values) -> str:
    """Where a touch lies, in words."""
    edge = "nearest edge or hole of the skin" if of["outline"] else "rim"
    return (f"the punch's edge is {of['gap_mm']:.1f} mm from the {edge}, {of['gap_m'] / of['thickness_m']:.1f} "
            "thicknesses")
