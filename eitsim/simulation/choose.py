"""How the touches of a scene are solved: decided here alone, once, as data, before anything is solved."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

from eitsim.electrics.cem.boundary_integral import unsolvable
from eitsim.electrics.sheet.sheet_conductance import untouched_conductance
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.interaction import clusters, edge_gap_m, expected, gap_for
from eitsim.scene.choices import Kind, Why
from eitsim.scene.electrodes import lengths, present
from eitsim.scene.results import Touch
from eitsim.scene.scene import Scene
from eitsim.simulation.edge_effects import least_gap_m
from eitsim.simulation.material import Material
from eitsim.simulation.routes import (
    AXISYMMETRIC,
    RIM_SHARE,
    ROUTES,
    WHOLE_DISC,
    Case,
    Pair,
    Route,
    fine_enough,
    held,
    pair_problem,
)
from eitsim.simulation.validity import unresolvable
from matcal.laws.law import Law
from touchcal.choice import Choice
from touchcal.jit import cpu_s

TABLE_SHARE = 0.25  # Part of the requested signal error that a table's own may use up.
_NEIGHBOUR_SHARE = 0.5  # Part of the requested signal error that solving touches separately may use up.
# Prescribed depth over the thickness up to which equilibria are found in seconds.
_DEEPEST = 0.97


@dataclass(frozen=True, eq=False)
class Way:
    """How one touch is solved."""

    case: Case
    route: Route
    why: Choice | None = None  # why no route serves; None where one does
    touch: Touch | None = None  # from a table; None where it is solved

    def solved(self, law: Law, keep: bool) -> Touch:
        """The touch."""
        return self.touch or self.route.solve(self.case, law, keep)


@dataclass(frozen=True, eq=False)
class Chosen:
    """How a scene is solved, or why not."""

    scene: Scene
    material: Material
    exact: bool
    ways: tuple[Way, ...]  # one a touch
    pairs: tuple[Pair, ...]
    table: Table | None = None  # that touches are taken from
    why: Choice | None = None  # why the scene cannot be solved; None where it can

    @property
    def groups(self) -> tuple[tuple[int, int], ...]:
        """Numbers of the touches that are solved together."""
        return tuple(pair.touches for pair in self.pairs)

    def touches(self) -> tuple[Touch, ...]:
        """All touches, solved as chosen, each alone and then in its pair."""
        law = self.material.law
        found = [way.solved(law, keep=self.table is not None) for way in self.ways]
        for pair in self.pairs:
            found[pair.touches[0]], found[pair.touches[1]] = pair.solve(found, law, self.scene, self.exact)
        return tuple(found)

    def held(self) -> list[tuple[float, Touch]]:
        """The held touch at its times, s."""
        (way,) = self.ways
        return held(way.route, way.case, self.material.law, self.material.series)


def choose(scene: Scene, material: Material, *, exact: bool = False, table: Table | None = None) -> Chosen:
    """How each touch of a scene is solved; what cannot be is said in `why`, never raised.

    exact: leave nothing out that a route can solve; table: load paths, of which those touches are taken that they hold
    to the requested error, not with exact.
    """
    ways, pairs = choose_ways(scene, exact=exact)
    why = _why(scene, material, ways)
    if table is not None and not exact:
        ways = _from_table(table, material.law, scene, ways, pairs)
    return Chosen(scene, material, exact, ways, pairs, None if exact else table, why)


def choose_ways(scene: Scene, *, exact: bool = False) -> tuple[tuple[Way, ...], tuple[Pair, ...]]:
    """The way of each touch, whatever the material, and the pairs that are solved together."""
    ways = [_alone(Case(scene, punch, exact)) for punch in scene.punches]
    pairs = _pairs(scene, ways)
    for i in itertools.chain(*(pair.touches for pair in pairs)):  # the pair adds what neighbour and edges change
        ways[i] = replace(ways[i], route=AXISYMMETRIC)
    return tuple(ways), pairs


def tabled_near_edge(scene: Scene, reach: float) -> int:
    """How many touches of a scene lie near an edge where a table of what edges change as far as a reach, thicknesses,
    may hold them."""
    ways = [_alone(Case(scene, punch)) for punch in scene.punches]
    return sum(way.case.near and way.case.straight and way.why is None and (
        way.route.kind is not Kind.ALL_EDGES or way.case.added_up(reach) <= RIM_SHARE * scene.accuracy.signal)
               for way in ways)


def served(table: Table | None, law: Law, scene: Scene) -> tuple[Touch | None, ...]:
    """The touches of a scene that a table holds to the requested error; None for each that is to be solved."""
    if table is None or scene.hold.time_s or (
            table.error.signal(scene.skin.strain) > TABLE_SHARE * scene.accuracy.signal):
        return (None,) * len(scene.punches)
    ways = [_alone(Case(scene, punch)) for punch in scene.punches]
    return tuple(way.route.stored(way.case, law, table) for way in ways)


def _alone(case: Case) -> Way:
    """The cheapest route that meets the requested error and serves; where none does, the first that meets it. To be
    exact, the whole disc where it serves."""
    if case.exact and not isinstance(WHOLE_DISC.serves(case), Choice):
        return Way(case, WHOLE_DISC)
    refused = None
    for route in ROUTES:
        if route is ROUTES[-1] or route.leaves_out(case) <= case.allowed:
            why = route.serves(case)
            if not isinstance(why, Choice):
                return Way(case, route)
            refused = refused or Way(case, route, why)
    assert refused is not None
    return refused


def _from_table(table: Table, law: Law, scene: Scene, ways: Sequence[Way],
                pairs: Sequence[Pair]) -> tuple[Way, ...]:
    """The ways with the touches that a table serves finely enough, with what each cost; one of a pair is taken where no
    edge counts."""
    begun, paired = cpu_s(), {i for pair in pairs for i in pair.touches}
    found = [None if i in paired and way.case.near else touch if touch is not None and (
        touch.rim is not None or fine_enough([touch], scene)) else None
        for i, (way, touch) in enumerate(zip(ways, served(table, law, scene), strict=True))]
    each = (cpu_s() - begun) / max(sum(touch is not None for touch in found), 1)
    return tuple(replace(way, touch=touch and replace(touch, cpu_s=each))
                 for way, touch in zip(ways, found, strict=True))


def _pairs(scene: Scene, ways: Sequence[Way]) -> tuple[Pair, ...]:
    """The touches, two each, that are solved together: those that must be, with exact any two that can, far from edges.
    """
    if len(ways) < 2 or scene.hold.time_s:
        return ()
    two = ways[0].case.exact and len(ways) == 2 and not any(way.case.near for way in ways)
    return tuple(Pair((group[0], group[1]), any(ways[i].case.near for i in group))
                 for group in (((0, 1),) if two else _clusters(scene))
                 if pair_problem(scene.body, [scene.punches[i] for i in group]) is None)


def _clusters(scene: Scene) -> tuple[tuple[int, ...], ...]:
    return clusters(scene.body, scene.punches, _NEIGHBOUR_SHARE * scene.accuracy.signal)


def _why(scene: Scene, material: Material, ways: Sequence[Way]) -> Choice | None:
    """Why a scene cannot be solved, with the nearest that can."""
    if why := unresolvable(scene, material):
        return why
    if (scene.electrodes.kind == "line" and not scene.body.has_outline and material.card.conductivity is not None and (
            problem := unsolvable(scene.body, present(scene.electrodes),
                                  untouched_conductance(material.skin, scene.skin)))):
        return Choice(Why.ELECTRODES, {"problem": problem})
    for i, way in enumerate(ways):
        if (why := _why_alone(way)) is not None:
            return why if len(ways) == 1 else replace(why, values={**why.values, "touch": i})
    return _why_neighbours(scene) if len(ways) > 1 else None


def _why_alone(way: Way) -> Choice | None:
    case, scene, punch = way.case, way.case.scene, way.case.punch
    deepest_m = _DEEPEST * scene.body.thickness_m
    if punch.depth_m is not None and punch.depth_m > deepest_m:
        return Choice(Why.TOO_DEEP, {"depth_m": punch.depth_m, "share": _DEEPEST, "deepest_m": deepest_m})
    length_m = float(lengths(scene.electrodes)[0])
    if scene.electrodes.kind == "patch" and (onto_m := length_m - case.gap_m) >= 0:
        return Choice(Why.ON_ELECTRODES, {"onto_m": onto_m, "length_m": length_m})
    if punch.friction != "none" and case.creeps:
        return Choice(Why.FRICTION_CREEPS, {"friction": punch.friction})
    if way.why is None or way.why.kind is Why.OFF_SKIN:
        return way.why
    return replace(way.why, values={
        "gap_m": case.gap_m, "outline": scene.body.has_outline, "cost": case.by_edges, "allowed": case.allowed,
        "clear_m": least_gap_m(scene), "radius_m": scene.body.edge.size_m})


def _why_neighbours(scene: Scene) -> Choice | None:
    body, punches = scene.body, scene.punches
    gap_m, i, j = _closest(scene, range(len(punches)))
    if gap_m <= 0:
        return Choice(Why.OVERLAP, {"gap_m": gap_m, "between": (i, j)})
    if scene.hold.time_s:
        return Choice(Why.HELD_TOGETHER, {"count": len(punches)})
    allowed = _NEIGHBOUR_SHARE * scene.accuracy.signal
    for group in _clusters(scene):
        if (why := pair_problem(body, [punches[k] for k in group])) is not None:
            gap_m, i, j = _closest(scene, group)
            return replace(why, values={**why.values, "gap_m": gap_m, "between": (i, j),
                                        "cost": expected(body, punches), "allowed": allowed,
                                        "clear_m": gap_for(allowed / (len(punches) - 1), body.thickness_m)})
    return None


def _closest(scene: Scene, group: Sequence[int]) -> tuple[float, int, int]:
    return min((edge_gap_m(scene.punches[i], scene.punches[j]), i, j) for i, j in itertools.combinations(group, 2))
