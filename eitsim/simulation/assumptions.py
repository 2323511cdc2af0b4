"""Everything that the solution of a scene decides, assumes and leaves out, as choices in the order of a plan."""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from eitsim.electrics.outline.adapted_mesh import READINGS
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.interaction import edge_gap_m, expected
from eitsim.scene.choices import Kind
from eitsim.scene.drive import protocol
from eitsim.scene.results import Touch, of_strain
from eitsim.scene.scene import Hold, Scene
from eitsim.simulation.choose import Chosen, Way
from eitsim.simulation.layers.layer_readings import PLANE
from eitsim.simulation.routes.route import Route
from eitsim.simulation.validity import positive_from
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.choice import Choice

STEEL_E_PA = 210e9
_SDS = 3.0  # standard deviations that a bound states; surrogates take it back
# What a touch from a table may be off over the largest deviation that was measured when it was made: of 40 random
# touches 35 were within once the largest, 39 within twice.
_SAFETY = 2.0
# Largest errors of dV of a layer's sheet of resultants on random touches, by the law (benchmarks/layers.py).
SHEET_ERROR = {"principal": 0.03, "volume": 0.3, "piezoresistive": 0.7}


def choices(chosen: Chosen) -> Iterator[Choice]:
    """The choices of a scene; of an exact run with what it turns off."""
    if not chosen.exact:
        yield from _choices(chosen)
        return
    yield Choice(Kind.FINER_MESH)
    for made in _choices(chosen):
        if made.kind is Kind.RINGS:
            yield Choice(Kind.EXACT_SKIN)
        else:
            yield made if made.cost == 0 else Choice(made.kind, {**made.values, "stays": True}, made.cost)


def _choices(chosen: Chosen) -> Iterator[Choice]:
    scene, law, card = chosen.scene, chosen.material.law, chosen.material.card
    paired = {i for group in chosen.groups for i in group}
    for i, way in enumerate(chosen.ways):
        solving = chosen.way_of(i)
        route = solving.route.of_touch(solving.case)
        own = {"cost_s": way.cost_s} if solving is way else {}
        of = [Choice(route.kind, {**route.values(way.case, way.touch), **own}, route.leaves_out(way.case))]
        if way.touch is not None and chosen.table is not None:
            of.append(stored_choice(chosen.table, way.touch, scene))
        elif way.case.punch.force_N is not None:
            of.append(Choice(Kind.FROM_REST))
        yield from _numbered(chosen, i, [*of, *_conductor(way, solving.route, i in paired)])
    yield from _neighbours(chosen)
    yield from hold_choices(scene.hold, law, elastic=chosen.elastic) if scene.hold.time_s else (
        moduli_choice(scene.hold, law, card.prony),)
    yield Choice(Kind.OUTSIDE_FITS, cost=None)
    if card.conductivity is not None and (least := positive_from(card.conductivity)) is not None:
        yield Choice(Kind.POSITIVE_IN_PART, {"strain": least})
    yield from _layer(chosen) if scene.skin.fills else (Choice(Kind.STRAIN, {
        "strain": scene.skin.strain, "conducts": any(p.conductor for p in scene.punches)}, None),)
    yield Choice(Kind.ONE_CARD, cost=None)
    for i, way in enumerate(chosen.ways):
        yield from _numbered(chosen, i, [
            Choice(Kind.NO_FRICTION, cost=None) if way.case.punch.friction == "none" else Choice(
                Kind.FRICTION, {"near": way.case.near or chosen.way_of(i).route.spatial})])
    if not scene.skin.fills:
        yield Choice(Kind.FIXED_CHOICES, cost=None)
    yield Choice(Kind.RIGID_PUNCH, {"ratio": STEEL_E_PA / law.E_0_Pa}, law.E_0_Pa / STEEL_E_PA)
    if not scene.electrodes.soft:
        yield from _bodies(chosen)
    if not scene.skin.fills:
        yield Choice(Kind.NO_LOAD_IN_SKIN, cost=None)
        over_fillet = scene.skin.thickness_m / min(p.fillet_m for p in scene.punches)
        yield Choice(Kind.SHEET, {"over_fillet": over_fillet}, over_fillet**2)
    yield from _electrodes(scene)
    yield Choice(Kind.ONE_MATRIX, {"patterns": protocol(scene.drive, scene.electrodes.count).shape[0]})


def _numbered(chosen: Chosen, i: int, of: list[Choice]) -> list[Choice]:
    """The choices of touch i, which say that they are its where there are several."""
    if len(chosen.ways) == 1:
        return of
    return [replace(choice, values={**choice.values, "touch": i + 1}) for choice in of]


def _layer(chosen: Chosen) -> Iterator[Choice]:
    """Of a layer that conducts in its volume."""
    scene, base, skin = chosen.scene, chosen.material.base, chosen.scene.skin
    yield Choice(Kind.LAYER, {"strain": skin.strain, "along": skin.along, "across": skin.across}, None)
    if base is not None:
        stiffer = chosen.material.stiffer
        yield Choice(Kind.LAYER_BASE, {
            "base_m": skin.base_m, "card": Path(skin.base_card).name, "moduli": base.moduli, "stiffer": stiffer},
            chosen.ways[0].case.by_edges_of(stiffer) - chosen.ways[0].case.by_edges)
    yield Choice(Kind.LAYER_TOUCH, {"sheet": SHEET_ERROR[scene.skin.strain]}) if scene.electrodes.over_thickness else (
        Choice(Kind.LAYER_ELECTRODES, {"plane": PLANE}))


def stored_choice(table: Table, touch: Touch, scene: Scene) -> Choice:
    """What a touch from a table may cost, as measured when it was made."""
    error, rim = table.error, None if touch.rim is None else touch.rim.error_estimate
    signal = error.signal(scene.skin.strain)
    by_rim = None if rim is None else (float(rim[0]), of_strain(rim[1:], scene.skin.strain))
    bound = max(error.depth, signal) + (0.0 if by_rim is None else max(by_rim))
    return Choice(Kind.STORED, {
        "diameters_m": [d * scene.body.thickness_m for d in table.shape.diameters], "spans": table.shape.spans,
        "checks": table.checks, "depth": error.depth, "signal": signal, "strain": error.strain, "rim": by_rim,
        "safety": _SAFETY, "cpu_s": table.whole_cpu_s, "strain_bound": _SAFETY * error.strain}, _SAFETY * bound)


def _bodies(chosen: Chosen) -> Iterator[Choice]:
    """Electrodes that do not give way: as bodies for touches that are solved so, left out for the others."""
    left_out = [way.case.by_electrodes for i, way in enumerate(chosen.ways)
                if way.case.on_pad or not chosen.way_of(i).route.spatial]
    if len(left_out) < len(chosen.ways):
        yield Choice(Kind.STIFF_ELECTRODES, {"plates": chosen.scene.electrodes.along_edge})
    if left_out:
        yield Choice(Kind.SOFT_ELECTRODES, {"plates": chosen.scene.electrodes.along_edge}, max(left_out))


def _conductor(way: Way, route: Route, paired: bool) -> Iterator[Choice]:
    if not way.case.punch.conductor:
        yield Choice(Kind.INSULATED)
        return
    yield Choice(Kind.FLOATING)
    if route.spatial:
        return
    if paired:
        yield Choice(Kind.END_BY_NEIGHBOUR, cost=None)
    elif way.case.near:
        yield Choice(Kind.END_BY_EDGE, cost=way.case.by_contact_end)


def _neighbours(chosen: Chosen) -> Iterator[Choice]:
    scene, groups = chosen.scene, chosen.groups
    punches, thickness_m = scene.punches, scene.body.thickness_m
    for way in chosen.clusters:
        gap_m = min(edge_gap_m(one, other) for one, other in itertools.combinations(way.case.punches, 2))
        yield Choice(way.route.kind, {"between": way.case.touches, "thickness_m": thickness_m, "gap_m": gap_m,
                                      "cost_s": way.cost_s})
    gaps_m = [edge_gap_m(punches[i], punches[j]) for i, j in itertools.combinations(range(len(punches)), 2)
              if not any(i in group and j in group for group in groups)]
    if gaps_m:
        yield Choice(Kind.ALONE, {"count": len(punches), "pairs": bool(groups), "gap_m": min(gaps_m),
                                  "thickness_m": thickness_m}, expected(scene.body, punches, groups))


def moduli_choice(hold: Hold, law: Law, series: Prony | None) -> Choice:
    """Without a hold."""
    relaxes = law.moduli == "instantaneous" and series is not None
    return Choice(Kind.NO_VISCOELASTICITY, {
        "moduli": law.moduli, "by_card": hold.moduli == "card",
        "left": series.g_infinity if relaxes and series is not None else None})


def hold_choices(hold: Hold, law: Law, *, elastic: bool) -> Iterator[Choice]:
    """Of a hold, by elastic touches or not."""
    if elastic:
        yield Choice(Kind.HOLD_ELASTIC, {"control": hold.control})
    else:
        yield Choice(Kind.HOLD_KEPT) if hold.keeps_deformation else Choice(Kind.HOLD_STEPPED, {"control": hold.control})
    yield Choice(Kind.LOADED_OVER, {"loading_s": hold.loading_s}) if hold.loading_s else Choice(Kind.LOADED_AT_ONCE)
    if law.hencky_ratio != (0.0, True):
        yield Choice(Kind.ONE_RELAXATION, cost=None)
    yield Choice(Kind.NO_MEMORY, cost=None)


def _electrodes(scene: Scene) -> Iterator[Choice]:
    outline, patches = scene.body.has_outline, not scene.electrodes.along_edge
    if not scene.skin.fills or scene.electrodes.over_thickness:
        if patches:
            yield Choice(Kind.MESH, {"outline": outline})
        if outline:
            yield Choice(Kind.UNTOUCHED_TRIANGLES, {"readings": READINGS})
        if not scene.skin.fills:
            yield Choice(Kind.PATCH_AREA, cost=None) if patches else Choice(Kind.RINGS, {"outline": outline})
    yield from _channels(scene)
    if scene.electrodes.missing:
        yield Choice(Kind.MISSING, {"electrodes": scene.electrodes.missing})


def _channels(scene: Scene) -> Iterator[Choice]:
    channels = scene.channels
    if any(channels.sheet_modes):
        yield Choice(Kind.EVEN_SHEET, {"largest": max(map(abs, channels.sheet_modes))}, None)
    if channels.conductance_S:
        yield Choice(Kind.SHEET_CONDUCTANCE, {"conductance_S": channels.conductance_S[0]})
    if channels.size_error:
        yield Choice(Kind.SCATTER, {"error": channels.size_error[0], "sds": _SDS}, _SDS * channels.size_error[0])
    if channels.there:
        yield Choice(Kind.CHANNELS, cost=None)
