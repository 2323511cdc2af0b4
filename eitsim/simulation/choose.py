"""How the touches of a scene are solved: decided here alone, once, as data, before anything is solved."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from eitsim.electrics.forward.skins import skin_of
from eitsim.mechanics.axisymmetric.elastic_holds import stand_ins
from eitsim.mechanics.axisymmetric.hold import kept, stepped_with_friction
from eitsim.mechanics.curved.solve_on_surface import unfit
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.interaction import clusters, edge_gap_m, expected, gap_for
from eitsim.mechanics.solid.volume_projection import projects
from eitsim.scene.choices import Why
from eitsim.scene.curved.curved_scene import CurvedScene
from eitsim.scene.electrodes import present
from eitsim.scene.results import Touch
from eitsim.scene.scene import Hold, Punch, Scene
from eitsim.sheet.sheet_conductance import untouched_conductance
from eitsim.simulation.edge_effects import least_gap_m
from eitsim.simulation.material import Material
from eitsim.simulation.routes import known_routes
from eitsim.simulation.routes.axisymmetric import AXISYMMETRIC, fine_enough
from eitsim.simulation.routes.general import General
from eitsim.simulation.routes.route import NOT_MEANT, Case, Route
from eitsim.simulation.validity import unresolvable
from matcal.laws.law import Law
from touchcal.choice import Choice
from touchcal.jit import cpu_s

TABLE_SHARE = 0.25  # Part of the requested signal error that a table's own may use up.
_NEIGHBOUR_SHARE = 0.5  # Part of the requested signal error that solving touches separately may use up.
_DEARER = 5.0  # CPU time over that of the cheapest way that is spent on the requested error.
# Prescribed depth over the thickness up to which equilibria are found in seconds.
_DEEPEST = 0.97


@dataclass(frozen=True, eq=False)
class Way:
    """How one touch is solved, or several together."""

    case: Case
    route: Route
    why: Choice | None = None  # why no route serves; None where one does
    touch: Touch | None = None  # from a table; None where it is solved
    cost_s: float = math.inf  # CPU time of a usual touch; infinite where no route serves


@dataclass(frozen=True, eq=False)
class Chosen:
    """How a scene is solved, or why not."""

    scene: Scene
    material: Material
    exact: bool
    ways: tuple[Way, ...]  # one a touch, as if it were alone
    clusters: tuple[Way, ...]  # of touches that are solved together
    elastic: bool = False  # whether held touches are taken as elastic ones at each time
    bodies: bool = True  # whether electrodes are solved as bodies where leaving that out costs more than allowed
    table: Table | None = None  # that touches are taken from
    why: Choice | None = None  # why the scene cannot be solved; None where it can

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the touches that are solved together."""
        return tuple(way.case.touches for way in self.clusters)

    def way_of(self, i: int) -> Way:
        """How a touch is solved, alone or with others."""
        return next((way for way in self.clusters if i in way.case.touches), self.ways[i])

    def touches(self) -> tuple[Touch, ...]:
        """All touches, solved as chosen."""
        law, keep = self.material.solid, self.table is not None
        found = [way.touch or way.route.solve(way.case, law, keep) if way is self.way_of(i) else way.touch
                 for i, way in enumerate(self.ways)]
        for way in self.clusters:
            known = [found[i] for i in way.case.touches]
            for i, touch in zip(way.case.touches, way.route.solve_together(way.case, law, keep, known), strict=True):
                found[i] = touch
        return tuple(touch for touch in found if touch is not None)

    def finer(self, touches: Sequence[Touch]) -> "Chosen | None":
        """The same with touches, as solved, on finer elements where that makes them better; None where it does not."""
        found = self._refined(lambda way: way.touch is None and any(
            way.route.refinable(way.case, touches[i]) for i in way.case.touches))
        return None if self.elastic else found

    def finer_layers(self) -> "Chosen | None":
        """The same with what is solved in three dimensions on its finest mesh from the start; None where nothing is."""
        return None if self.exact else self._refined(lambda way: isinstance(way.route, General))

    def _refined(self, helps: Callable[[Way], bool]) -> "Chosen | None":
        """The same with the ways that are taken on finer elements where these help; None where none is."""
        def refined(ways: tuple[Way, ...]) -> tuple[Way, ...]:
            return tuple(replace(way, case=replace(way.case, finer=True)) if helps(way) else way for way in ways)

        found = replace(self, ways=refined(self.ways), clusters=refined(self.clusters))
        return None if all(self.way_of(i) == found.way_of(i) for i in range(len(self.ways))) else found

    def held(self) -> list[tuple[float, tuple[Touch, ...]]]:
        """The held touches at their times, s."""
        law, series, hold = self.material.law, self.material.series, self.scene.hold
        if self.elastic:
            return self._held_as_elastic()
        each = [kept(series, hold, touch) for touch in self.touches()] if hold.keeps_deformation else [
            way.route.solve_held(way.case, law, series) for way in self.ways]
        return [(moments[0][0], tuple(touch for _, touch in moments)) for moments in zip(*each, strict=True)]

    def _held_as_elastic(self) -> list[tuple[float, tuple[Touch, ...]]]:
        """Elastic touches under the forces that stand for the hold; a kept depth keeps them."""
        first, *later = stand_ins(
            self.material.law, self.material.series, self.scene.body, self.scene.punches, self.scene.hold)
        loaded = self._elastic([punch.force_N and force for punch, force in zip(
            self.scene.punches, first.force_N.tolist(), strict=True)])
        found, touches = [(first, loaded)], loaded
        for moment in later:
            if self.scene.hold.control == "force":
                touches = self._elastic([touch.force_N * by for touch, by in zip(
                    loaded, (moment.force_N / first.force_N).tolist(), strict=True)], touches)
            found.append((moment, touches))
        return [(moment.time_s, moment.held(touches)) for moment, touches in found]

    def _elastic(self, forces_N: Sequence[float | None], near: tuple[Touch, ...] = ()) -> tuple[Touch, ...]:
        """Touches of the instantaneous law under forces, started from near ones; at the scene's depth where none is
        given."""
        punches = tuple(punch if force is None else replace(punch, force_N=force, depth_m=None)
                        for punch, force in zip(self.scene.punches, forces_N, strict=True))
        found = choose(replace(_loaded(self.scene), punches=punches), self.material, exact=self.exact,
                       bodies=self.bodies)
        if any(way.case.finer for way in (*self.ways, *self.clusters)):
            found = found.finer_layers() or found
        ways, clusters = (tuple(replace(way, case=replace(way.case, start=near)) for way in some)
                          for some in (found.ways, found.clusters))
        return replace(found, ways=ways, clusters=clusters).touches()


def choose(scene: Scene, material: Material, *, exact: bool = False, bodies: bool = True,
           table: Table | None = None) -> Chosen:
    """How each touch of a scene is solved; what cannot be is said in `why`, never raised.

    exact: leave nothing out that a route can solve; bodies: as of `Case`; table: load paths, of which those touches are
    taken that they hold to the requested error, not with exact.
    """
    ways_of = partial(choose_ways, exact=exact, bodies=bodies, keeps_volume=projects(material.solid))
    ways, clusters = ways_of(scene)
    if elastic := _creeps_otherwise(ways, clusters):
        ways, clusters = ways_of(_loaded(scene))
    made = Chosen(scene, material, exact, ways, tuple(way for way in clusters if way.why is None), elastic, bodies,
                  None if exact else table, _why(scene, material, ways, clusters))
    return made if made.table is None else replace(made, ways=_from_table(made, made.table))


def _creeps_otherwise(ways: Sequence[Way], clusters: Sequence[Way]) -> bool:
    """Whether touches creep that no route steps in time: but axisymmetric ones alone, with friction under a force."""
    case = ways[0].case
    return case.creeps and (bool(clusters) or case.scene.skin.fills or any(
        way.route is not AXISYMMETRIC or (way.case.punch.friction != "none" and not stepped_with_friction(
            way.case.punch, case.scene.hold)) for way in ways))


def _loaded(scene: Scene) -> Scene:
    """The scene without what happens in time."""
    return replace(scene, hold=Hold())


def choose_ways(scene: Scene, *, exact: bool = False, bodies: bool = True, keeps_volume: bool = False
                ) -> tuple[tuple[Way, ...], tuple[Way, ...]]:
    """The way of each touch by itself, and those of touches that are to be solved together; keeps_volume: as of `Case`,
    all that is asked of the material."""
    ways = tuple(_way(Case(scene, (i,), exact, bodies, keeps_volume)) for i in range(len(scene.punches)))
    return ways, _together(scene, ways)


def tabled_near_edge(scene: Scene, law: Law, reach: float) -> int:
    """How many touches of a scene lie near an edge where a table of what edges change as far as a reach, thicknesses,
    may hold them."""
    ways = [_way(Case(scene, (i,), bodies=False, keeps_volume=projects(law))) for i in range(len(scene.punches))]
    return sum(way.case.near and way.why is None and way.route.storable(way.case, reach) for way in ways)


def served(table: Table | None, law: Law, scene: Scene) -> tuple[Touch | None, ...]:
    """The touches of a scene that a table holds to the requested error; None for each that is to be solved."""
    ways = [_way(Case(scene, (i,), bodies=False, keeps_volume=projects(law))) for i in range(len(scene.punches))]
    return _stored(table, law, scene, [(way.route, way.case) for way in ways])


def _stored(table: Table | None, law: Law, scene: Scene,
            ways: Sequence[tuple[Route, Case]]) -> tuple[Touch | None, ...]:
    """One a touch, by the route that solves it where the table does not hold it."""
    if table is None or scene.hold.time_s or scene.skin.fills or (
            table.error.signal(scene.skin.strain) > TABLE_SHARE * scene.accuracy.signal):
        return (None,) * len(ways)
    return tuple(route.stored(case, law, table) for route, case in ways)


def _way(case: Case) -> Way:
    """The cheapest route that serves and leaves out no more than it may, in an exact run the one for these; one that is
    expected to meet the requested error where that one is not, and pays. Where none does with what electrodes and ends
    of contacts may cost, the one of those that do without that omits least; else the first that meets it and is
    refused, of several touches the last, or that of those that leave out least."""
    if case.scene.skin.fills:
        return Way(case, AXISYMMETRIC, layer_problem(case), cost_s=0.3)
    ways = [Way(case, route, answer) if isinstance(answer, Choice) else Way(case, route, cost_s=answer)
            for route in known_routes.ROUTES if (case.exact or not route.for_exact) and (
                route.leaning or all(punch.axisymmetric for punch in case.punches)) and not (
                route.locking and case.keeps_volume)
            if (answer := route.serves(case)) is not NOT_MEANT]
    fine = [way for way in ways if way.route.leaves_out(case) <= case.allowed]
    serving = [way for way in fine if way.why is None]
    if whole := [way for way in serving if _omitted(way) <= case.allowed]:
        cheapest = min(whole, key=lambda way: (not way.route.for_exact, way.cost_s))
        return min((way for way in whole if _better(way, cheapest)), key=lambda way: way.cost_s, default=cheapest)
    if serving:
        return min(serving, key=lambda way: (_omitted(way), way.cost_s))
    if fine:
        return fine[0 if len(case.touches) == 1 else -1]
    return min(reversed(ways), key=lambda way: way.route.leaves_out(case))


def _better(way: Way, cheapest: Way) -> bool:
    """Whether a way is expected to meet the requested error where the cheapest one is not, at a cost that pays."""
    case, asked = way.case, way.case.scene.accuracy.signal
    return case.bodies and not case.exact and way.cost_s <= _DEARER * cheapest.cost_s and (
        way.route.expected(case) <= asked < cheapest.route.expected(case))


def layer_problem(case: Case) -> Choice | None:
    """Why touches of a layer that conducts in its volume cannot be solved: its inside is known where they are
    axisymmetric alone. None where they can."""
    thickness_m = case.scene.body.thickness_m
    if len(case.touches) > 1:
        return Choice(Why.LAYER_TOGETHER)
    if not case.punch.axisymmetric:
        return Choice(Why.LAYER_TILT)
    return Choice(Why.LAYER_EDGE, {"gap_m": case.gap_m, "thickness_m": thickness_m}) if (
        case.gap_m < thickness_m) else None


def without_edges(scene: Scene, material: Material) -> bool:
    """Whether a scene's one touch of a layer can be solved, and edges may change no more of its signal than their share
    of the requested error."""
    case = Case(scene, (0,), bodies=False)
    return layer_problem(case) is None and case.by_edges_of(material.stiffer) <= case.allowed


def _omitted(way: Way) -> float:
    """What it leaves out, with what electrodes that do not give way and the end of a conducting punch's contact may
    cost where it should count them."""
    case, route = way.case, way.route
    out = route.leaves_out(case) + route.outside(case)
    if not case.bodies or (route.spatial and not case.on_pad):
        return out
    return out + case.by_electrodes + (0.0 if route.spatial else case.by_contact_end)


def _from_table(chosen: Chosen, table: Table) -> tuple[Way, ...]:
    """The ways with the touches that a table serves finely enough, with what each cost."""
    begun, scene = cpu_s(), chosen.scene
    stored = _stored(table, chosen.material.law, scene, [
        (chosen.way_of(i).route, way.case) for i, way in enumerate(chosen.ways)])
    found = [touch if touch is not None and (touch.rim is not None or fine_enough([touch], scene)) else None
             for touch in stored]
    each = (cpu_s() - begun) / max(sum(touch is not None for touch in found), 1)
    return tuple(replace(way, touch=touch and replace(touch, cpu_s=each))
                 for way, touch in zip(chosen.ways, found, strict=True))


def _together(scene: Scene, ways: Sequence[Way]) -> tuple[Way, ...]:
    """The touches that must be solved together, or cannot; with exact any two that can, far from edges."""
    if len(ways) < 2:
        return ()
    first = ways[0].case
    if first.exact and len(ways) == 2 and not any(way.case.near for way in ways) and (
            both := _way(replace(first, touches=(0, 1)))).why is None:
        return (both,)
    return tuple(_way(replace(first, touches=group)) for group in clusters(
        scene.body, scene.punches, _NEIGHBOUR_SHARE * scene.accuracy.signal))


def _why(scene: Scene, material: Material, ways: Sequence[Way], together: Sequence[Way]) -> Choice | None:
    """Why a scene cannot be solved, with the nearest that can."""
    if why := unresolvable(scene, material):
        return why
    if material.card.conductivity is not None and (problem := skin_of(
            scene.body, present(scene.electrodes), untouched_conductance(material.skin, scene.skin)).problem()):
        return Choice(Why.ELECTRODES, {"problem": problem})
    for i, way in enumerate(ways):
        if (why := _why_alone(way)) is not None:
            return why if len(ways) == 1 else replace(why, values={**why.values, "touch": i})
    return _why_neighbours(scene, together) if len(ways) > 1 else None


def curved_problem(scene: CurvedScene, material: Material) -> Choice | None:
    """Why a scene on a curved body cannot be solved; None where nothing says so before it is."""
    for punch in scene.punches:
        if (why := _too_deep(punch, scene.body.thickness_m)) is not None:
            return why
    if problem := unfit(scene.body.surface, scene.body.thickness_m, scene.punches, scene.places_m):
        return Choice(Why.UNFIT, {"problem": problem})
    return unresolvable(scene.flat, material)


def _too_deep(punch: Punch, thickness_m: float) -> Choice | None:
    deepest_m = _DEEPEST * thickness_m
    return None if punch.depth_m is None or punch.depth_m <= deepest_m else Choice(
        Why.TOO_DEEP, {"depth_m": punch.depth_m, "share": _DEEPEST, "deepest_m": deepest_m})


def _why_alone(way: Way) -> Choice | None:
    case, scene = way.case, way.case.scene
    if (why := _too_deep(case.punch, scene.body.thickness_m)) is not None:
        return why
    if way.why is None or way.why.kind is Why.OFF_SKIN or scene.skin.fills:
        return way.why
    return replace(way.why, values={
        "gap_m": case.gap_m, "outline": scene.body.has_outline, "cost": case.by_edges, "allowed": case.allowed,
        "clear_m": least_gap_m(scene), "radius_m": scene.body.edge.size_m})


def _why_neighbours(scene: Scene, together: Sequence[Way]) -> Choice | None:
    body, punches = scene.body, scene.punches
    gap_m, i, j = _closest(scene, range(len(punches)))
    if gap_m <= 0:
        return Choice(Why.OVERLAP, {"gap_m": gap_m, "between": (i, j)})
    allowed = _NEIGHBOUR_SHARE * scene.accuracy.signal
    for way in together:
        if way.why is not None and way.why.kind is Why.OFF_SKIN:
            return way.why
        if way.why is not None:
            gap_m, i, j = _closest(scene, way.case.touches)
            return replace(way.why, values={**way.why.values, "gap_m": gap_m, "between": (i, j),
                                            "cost": expected(body, punches), "allowed": allowed,
                                            "clear_m": gap_for(allowed / (len(punches) - 1), body.thickness_m)})
    return None


def _closest(scene: Scene, group: Sequence[int]) -> tuple[float, int, int]:
    return min((edge_gap_m(scene.punches[i], scene.punches[j]), i, j) for i, j in itertools.combinations(group, 2))
