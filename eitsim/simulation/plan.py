"""What a scene needs, decided before anything is solved, with the reason and the error each decision may cost."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from eitsim.electrics.cem.boundary_integral import unsolvable
from eitsim.electrics.outline.adapted_mesh import READINGS
from eitsim.electrics.sheet.sheet_conductance import untouched_conductance
from eitsim.mechanics.rim.interaction import clusters, edge_gap_m, expected, gap_for
from eitsim.mechanics.rim.solve_near_rim import FINE, LEAST_GAP, rim_problem
from eitsim.mechanics.rim.two_punches import pair_problem
from eitsim.scene.drive import protocol
from eitsim.scene.electrodes import lengths, present
from eitsim.scene.nearest_edge import STRAIGHT_M, nearest_edge
from eitsim.scene.results import Decision, Plan
from eitsim.scene.scene import Punch, Scene, rim_gap_m
from eitsim.simulation.edge_effects import (
    RIM_SHARE,
    effect_of_edges,
    least_gap_m,
    near_rim,
    other_edges_effect,
    several_edges,
    stiffening,
)
from eitsim.simulation.material import Material, material_of
from eitsim.simulation.validity import positive_from, unresolvable
from matcal.card import MaterialCard
from matcal.laws.law import Law

ONE_CARD = "one card, not its uncertainty"  # What scenes with one card leave out, whatever it is.
_NEIGHBOUR_SHARE = 0.5  # Part of the requested signal error that solving touches separately may use up.
STEEL_E_PA = 210e9
_SDS = 3.0  # standard deviations that a bound states; surrogates take it back
# Part of the rim's effect that the end of a conducting punch's contact, kept as it is without the rim, may cost of dV:
# above all that were measured, 14 mm under 0.1 and 1 N.
_CONTACT_SHARE = 0.6
# Dipole moment of the touch, over the square of the punch's radius, by the strain that drives the skin: 14 mm,
# insulated, under DIPOLE_FORCES_N, on Table 1's foam.
DIPOLE_FORCES_N = (0.1, 1.0, 2.0)
DIPOLE = {"normal": (-0.04, -0.42, -0.38), "principal": (0.04, 0.69, 1.42), "areal": (0.00, 0.49, 0.96)}
_DRIVEN_BY = {"normal": "its strain through the thickness", "principal": "its largest strain in plane",
              "areal": "its change of area"}
# Prescribed depth over the thickness up to which equilibria are found in seconds.
_DEEPEST = 0.97
_RINGS = "the untouched skin is solved on its rim, the touch by what its rings scatter"
_EDGES = "the touch is solved by what its rings scatter, and the edges of the untouched skin send back"


def make_plan(scene: Scene, card: MaterialCard | Material, *, exact: bool = False,
              reused: Sequence[Decision | None] = ()) -> Plan:
    """The plan of a scene with a card or its material; what cannot be solved is a refusal in it, never an exception.

    exact: turn off every omission that can be, and say of the others that they stay; reused: for each punch what a
    stored load path may cost, None where it is solved.
    """
    material = material_of(scene, card)
    decisions = _decisions(scene, material, reused or [None] * len(scene.punches), exact)
    refusal = unresolvable(scene, material)
    if (not refusal and scene.electrodes.kind == "line" and not scene.body.has_outline
            and material.card.conductivity is not None):
        refusal = unsolvable(scene.body, present(scene.electrodes), untouched_conductance(material.skin, scene.skin))
    return Plan(tuple(_exactly(decisions) if exact else decisions), refusal or _refusal(scene))


def _exactly(decisions: Iterable[Decision]) -> Iterator[Decision]:
    yield Decision("exact: a finer mesh of the foam", "half the default element size, whatever accuracy is asked for",
                   0.0)
    for made in decisions:
        if made.decision in (_RINGS, _EDGES):
            yield Decision("exact: the skin is solved on a mesh that follows the touch", "nothing is taken from rings; "
                           "the mesh's estimate counts in the result's own error", 0.0)
        elif made.error_bound > 0 or made.unbounded:
            yield replace(made, reason=f"{made.reason}; exact does not change it, since nothing that does without it "
                          "is built")
        else:
            yield made


def _refusal(scene: Scene) -> str:
    """Why the scene cannot be solved yet, with the nearest thing that can; empty where it can."""
    problems = [_punch_refusal(scene, punch) for punch in scene.punches]
    if len(problems) == 1:
        return problems[0]
    named = (f"touch {i}: {problem}" for i, problem in enumerate(problems, 1) if problem)
    return next(named, "") or _neighbour_refusal(scene)


def _neighbour_refusal(scene: Scene) -> str:
    pairs = itertools.combinations(range(len(scene.punches)), 2)
    gap, i, j = min((edge_gap_m(scene.punches[i], scene.punches[j]), i, j) for i, j in pairs)
    where = f"the edges of touches {i + 1} and {j + 1}"
    if gap <= 0:
        return (f"{where} overlap by {max(-gap, 0.0) * 1e3:.1f} mm; move the punches from each other by that and, for "
                "punches solved together, a gap of 3 mm more.")
    if scene.hold.time_s:
        return (f"a hold (time_s in [hold]) is built for one touch, {len(scene.punches)} are given; give one [punch] "
                "or leave out time_s.")
    problems = ((group, pair_problem(scene.body, [scene.punches[i] for i in group])) for group in _clusters(scene))
    return next((_apart_refusal(scene, group, problem) for group, problem in problems if problem), "")


def _clusters(scene: Scene) -> tuple[tuple[int, ...], ...]:
    return clusters(scene.body, scene.punches, _NEIGHBOUR_SHARE * scene.accuracy.signal)


def _apart_refusal(scene: Scene, group: Sequence[int], problem: str) -> str:
    gap, i, j = min((edge_gap_m(scene.punches[i], scene.punches[j]), i, j)
                    for i, j in itertools.combinations(group, 2))
    allowed = _NEIGHBOUR_SHARE * scene.accuracy.signal
    separation = gap_for(allowed / (len(scene.punches) - 1), scene.body.thickness_m) * 1e3
    return (f"{gap * 1e3:.1f} mm lie between the edges of touches {i + 1} and {j + 1}: solving each touch as if it "
            f"were alone may cost {expected(scene.body, scene.punches):.2g} of the signal, allowed is {allowed:.2g} "
            f"(half of signal in [accuracy]), and {problem}. Leave {separation:.0f} mm between them or ask for less "
            "accuracy (a larger signal in [accuracy]).")


def together(scene: Scene, *, exact: bool = False) -> tuple[tuple[int, ...], ...]:
    """Numbers of the touches, two each, that are solved together: those that must be, with exact any two that can, far
    from edges."""
    if len(scene.punches) < 2 or scene.hold.time_s:
        return ()
    two = exact and len(scene.punches) == 2 and not near_edges(scene, (0, 1))
    groups = ((0, 1),) if two else _clusters(scene)
    return tuple(group for group in groups if not pair_problem(scene.body, [scene.punches[i] for i in group]))


def near_edges(scene: Scene, group: Sequence[int]) -> bool:
    """Whether any of these touches is so near to the rim, or to edges of an outline, that they count."""
    return any(near_rim(scene, scene.punches[i]) for i in group)


def _punch_refusal(scene: Scene, punch: Punch) -> str:
    if punch.depth_m is not None and punch.depth_m > _DEEPEST * scene.body.thickness_m:
        return (f"depth_mm = {punch.depth_m * 1e3:g} in [punch] is above {_DEEPEST:.0%} of the foam's thickness, "
                f"which squeezes it flat; give at most {_DEEPEST * scene.body.thickness_m * 1e3:g}.")
    length_m = float(lengths(scene.electrodes)[0])
    if scene.electrodes.kind == "patch" and (onto := length_m - rim_gap_m(scene.body, punch)) >= 0:
        return (f"the punch's edge reaches {onto * 1e3:.1f} mm into the ring of {length_m * 1e3:g} mm "
                "that the patch electrodes lie on, where touches are not built; move the punch inwards by more than "
                "that, or make length_mm in [electrodes] smaller.")
    if punch.friction != "none" and scene.hold.time_s and not scene.hold.keeps_deformation:
        return (f"friction = \"{punch.friction}\" in [punch] is built for holds that keep the deformation only: "
                "control = \"depth\" and loading_s = 0 in [hold]. Ask for such a hold, or for friction = \"none\".")
    return rim_refusal(scene, punch)


def rim_refusal(scene: Scene, punch: Punch) -> str:
    """Why a touch near the rim cannot be solved, with the nearest thing that can; empty where it can, or is not near.
    """
    if not near_rim(scene, punch):
        return ""
    problem = rim_problem(scene.body, punch)
    if not problem and scene.hold.time_s and not scene.hold.keeps_deformation:
        problem = ("holds (time_s in [hold]) that keep the deformation alone are built: control = \"depth\" and "
                   "loading_s = 0")
    gap, allowed = rim_gap_m(scene.body, punch), RIM_SHARE * scene.accuracy.signal
    if not problem or gap < LEAST_GAP * scene.body.edge.size_m:
        return problem and f"{problem}."
    near, edge = ("the nearest edge of the skin", "edges") if scene.body.has_outline else ("the rim", "the rim")
    return (f"the punch's edge is {gap * 1e3:.1f} mm from {near}, where the touch is not axisymmetric: neglecting "
            f"{edge} may cost {effect_of_edges(scene, punch):.2g} of the signal, allowed is {allowed:.2g} (half "
            f"of signal in [accuracy]). There, {problem}; {_advice(scene)}.")


def _advice(scene: Scene) -> str:
    gap = least_gap_m(scene)
    inwards = f"move the punch inwards to a gap of {gap * 1e3:.0f} mm or " if gap < scene.body.edge.size_m else ""
    return f"{inwards}ask for less accuracy (a larger signal in [accuracy])"


def _decisions(scene: Scene, material: Material, reused: Sequence[Decision | None],
               exact: bool) -> Iterator[Decision]:
    card, law, groups = material.card, material.law, together(scene, exact=exact)
    for i, (punch, stored) in enumerate(zip(scene.punches, reused, strict=True)):
        grouped = any(i in group and near_edges(scene, group) for group in groups)
        yield _all_edges_decision(scene, punch) if grouped else _rim_decision(
            scene, punch, exact and not any(i in group for group in groups))
        if stored is not None:
            yield stored
        elif punch.force_N is not None:
            yield Decision("solved from rest at the force itself", "no load path is stored or interpolated", 0.0)
        yield from _conductor_decisions(scene, punch, any(i in group for group in groups))
    yield from (_together_decision(scene, group) for group in groups)
    if len(scene.punches) > 2 or (len(scene.punches) == 2 and not groups):
        yield _neighbour_decision(scene, groups)
    yield from _hold_decisions(scene, law) if scene.hold.time_s else [_moduli_decision(scene, material)]
    yield Decision("laws used outside their fits", "touches strain the skin and may compress the foam further than "
                   "their tests did, through the thickness in compression where the skin's law was fitted in tension; "
                   "the result holds both strains, the cost is unknown and not in the bound", 0.0, unbounded=True)
    if card.conductivity is not None and (least := positive_from(card.conductivity)) is not None:
        yield Decision("the skin's law is positive over part of what touches reach", f"its cubic is 0 at the strain "
                       f"{least:.3g}; whether the touch compresses the skin that far is known once its mechanics is "
                       "solved, and refused then", 0.0)
    yield _strain_decision(scene)
    yield Decision(ONE_CARD, "the card's own laws are taken as exact; not in the bound", 0.0, unbounded=True)
    yield from (_friction_decision(punch, near_rim(scene, punch)) for punch in scene.punches)
    yield Decision("coating of constant thickness, real currents", "fixed choices of this version; the bound does not "
                   "hold them", 0.0, unbounded=True)
    yield Decision("rigid punch", f"steel is {STEEL_E_PA / law.E_0_Pa:.0e} times stiffer than the foam",
                   law.E_0_Pa / STEEL_E_PA)
    if not scene.electrodes.soft:
        yield Decision("electrodes do not stiffen the rim", "rigid ones up to half as high as the foam changed the "
                       "signal by at most what the rim does, as high as the foam and fixed to the ground by up to 1.7 "
                       "times as much (benchmarks/rim_electrodes.py). Where a touch's dipole nearly vanishes both are "
                       "larger parts of its signal than the bound; soft = true in [electrodes] says that they give way"
                       + ("; holes carry none" if scene.electrodes.kind == "line" and
                          len(scene.body.edge.loops) > 1 else ""),
                       max(stiffening(scene, punch) for punch in scene.punches),
                       remedy="Where yours give way, as paint, foil and thin wires do, write soft = true in "
                              "[electrodes].")
    yield Decision("the skin carries no load", "a sprayed layer; the card has no stiffness for it, so the cost is "
                   "unknown and not in the bound", 0.0, unbounded=True)
    sharpest = min(p.fillet_m for p in scene.punches)
    yield Decision("the skin is a sheet, solved on the surface",
                   f"its thickness is {scene.skin.thickness_m / sharpest:.2f} of the punch's fillet, the shortest "
                   "length over which it changes; the cost is of second order in that",
                   (scene.skin.thickness_m / sharpest) ** 2)
    yield from _electrode_decisions(scene)
    patterns, _ = protocol(scene.drive, scene.electrodes.count).shape
    yield Decision(f"one impedance matrix serves all {patterns} patterns", "every pattern is a linear read-out of it",
                   0.0)


def _strain_decision(scene: Scene) -> Decision:
    """What the choice of the strain does to the signal."""
    sizes = {strain: ", ".join(f"{moment:.2f}" for moment in moments) for strain, moments in DIPOLE.items()}
    own, forces = scene.skin.strain, ", ".join(f"{force:g}" for force in DIPOLE_FORCES_N)
    others = "; ".join(f"{sizes[strain]} by strain = \"{strain}\"" for strain in DIPOLE if strain != own)
    shunted = "" if not any(punch.conductor for punch in scene.punches) else (
        "; a conducting punch lowers it by up to 0.8, and the place of a touch whose moment is near 0 is hardly seen")
    return Decision(f"the skin's conductivity follows {_DRIVEN_BY[own]}", "a coating is measured against the stretch "
                    f"in its plane; the dipole moment of an insulated 14 mm punch at {forces} N, over its radius "
                    f"squared, is {sizes[own]}; {others}{shunted} (Table 1); the cost is unknown and not in the "
                    "bound", 0.0, unbounded=True)


def _conductor_decisions(scene: Scene, punch: Punch, paired: bool) -> Iterator[Decision]:
    if not punch.conductor:
        yield Decision("no conduction through the punch", "conductor is false in [punch]", 0.0)
        return
    yield Decision("a conducting punch floats on the whole of its contact", "one contact impedance; the contact ends "
                   "where the foam's mesh resolves it, and what a nearer end would change of dV counts in the result's "
                   "own error. Where strains in plane nearly cancel what the punch shunts, this and all bounds here "
                   "count as many times as the larger part is of dV", 0.0)
    if paired:
        yield Decision("a conducting punch touches where it would alone", "what its neighbour changes of the contact's "
                       "end is not built; the cost is unknown and not in the bound", 0.0, unbounded=True)
    elif near_rim(scene, punch):
        yield Decision("a conducting punch touches where it would without the rim", "what the rim changes of the "
                       "contact's end is not built; with the contact of the three-dimensional solution dV changed by "
                       "up to 1.9 % (flat, gaps of 3 to 20 mm) and 9.4 % (sphere, 5 mm)",
                       _CONTACT_SHARE * effect_of_edges(scene, punch))


def _electrode_decisions(scene: Scene) -> Iterator[Decision]:
    if scene.electrodes.kind != "line":
        why = "electrodes lie on it" if scene.body.has_outline else "patch electrodes cover part of it"
        yield Decision("the skin is solved on a mesh that follows the touch", f"{why}; the mesh's estimate counts in "
                       "the result's own error", 0.0)
    if scene.body.has_outline:
        yield Decision("untouched readings by triangles that their own solution refines", "until halving them once "
                       f"more would change the readings by less than {READINGS:g}; the signal does not hold that error",
                       0.0)
    if scene.electrodes.kind != "line":
        yield Decision("patches conduct by their untouched area", "their contact impedance does not follow what a "
                       "touch on or next to them stretches; the cost is unknown and not in the bound", 0.0,
                       unbounded=True)
    else:
        yield Decision(_EDGES if scene.body.has_outline else _RINGS, "where the strain is not axisymmetric about the "
                       "punch, or the estimate misses the requested error, a mesh that follows the touch takes over; "
                       "the estimate counts in the result's own error", 0.0)
    yield from _channel_decisions(scene)
    if scene.electrodes.missing:
        yield Decision(f"without electrode{'s' if len(scene.electrodes.missing) > 1 else ''} "
                       f"{', '.join(map(str, scene.electrodes.missing))} (from 0)", "missing in [electrodes]: no "
                       "current passes; readings that need one are null", 0.0)


def _channel_decisions(scene: Scene) -> Iterator[Decision]:
    channels = scene.channels
    if any(channels.sheet_modes):
        yield Decision("the calibrated sheet is taken as even", "sheet_modes in [channels] say how the logarithm of "
                       f"its conductance varies, by up to {max(map(abs, channels.sheet_modes)):.2g} a mode; readings "
                       "do without, and so differ from the sensor's by about as much of the signal",
                       0.0, unbounded=True)
    if channels.conductance_S:
        yield Decision(f"the untouched skin has the calibrated sheet conductance of {channels.conductance_S[0]:.4g} S",
                       "conductance_S in [channels]; thickness in [skin] and c0 of the card have no effect, the card "
                       "says how strain changes it", 0.0)
    if channels.size_error:
        yield Decision("touches of this sensor scatter about its model", "labelled presses that a fit left out were "
                       f"off by {channels.size_error[0]:.2g} of the signal's size, r.m.s. (size_error in [channels]); "
                       f"the bound is {_SDS:g} times that, and models of a sweep count it in their intervals",
                       _SDS * channels.size_error[0])
    if channels.there:
        yield Decision("readings through the channels of a calibrated sensor", "gains against ground, source currents "
                       "and leaks act outside the body, so that its impedance matrix holds all they need; exact for "
                       "touched readings too. Their intervals are not in the bound; impedance_Ohm and maps of the skin "
                       "are those of the body without them", 0.0, unbounded=True)


def _from_edge(scene: Scene, punch: Punch) -> str:
    gap = rim_gap_m(scene.body, punch)
    edge = "nearest edge or hole of the skin" if scene.body.has_outline else "rim"
    return f"the punch's edge is {gap * 1e3:.1f} mm from the {edge}, {gap / scene.body.thickness_m:.1f} thicknesses"


def _all_edges_decision(scene: Scene, punch: Punch) -> Decision:
    edges, outline = ("several edges", "outline") if scene.body.has_outline else ("the rim", "rim")
    return Decision(f"mechanics in three dimensions near {edges}, as a change of the axisymmetric touch",
                    f"{_from_edge(scene, punch)}; circles about the punch are cut where the {outline} cuts them; a "
                    "coarser mesh with fewer harmonics tells the error, which counts in the result's own; the bound is "
                    f"of edges further away than {FINE.out_to:g} thicknesses",
                    other_edges_effect(scene, punch, FINE.out_to) if scene.body.has_outline else 0.0)


def _rim_decision(scene: Scene, punch: Punch, exact: bool) -> Decision:
    if several_edges(scene, punch):
        return _all_edges_decision(scene, punch)
    where = _from_edge(scene, punch)
    if scene.body.has_outline and near_rim(scene, punch):
        nearest = nearest_edge(scene.body.outline, (punch.x_m, punch.y_m))
        straight = nearest.disc_m == STRAIGHT_M
        kind = "a straight one" if straight else f"part of a circle of {nearest.disc_m * 1e3:.0f} mm"
        return Decision("mechanics in three dimensions near one edge, as a change of the axisymmetric touch",
                        f"{where}, taken as {kind}; a coarser mesh with fewer harmonics tells the error, which counts "
                        "in the result's own; the bound is of the other edges", other_edges_effect(scene, punch))
    if scene.body.has_outline:
        where += ("; solved on the disc of the outline's area, and bounded by what rims of discs change that are as "
                  "near as the edges in each quarter about it")
    creeps = bool(scene.hold.time_s) and not scene.hold.keeps_deformation
    if exact and not creeps and not scene.body.has_outline and not rim_problem(scene.body, punch):
        return Decision("exact: mechanics in three dimensions on the whole disc, as a change of the axisymmetric touch",
                        f"{where}; a coarser mesh with fewer harmonics tells the error, which counts in the result's "
                        "own", 0.0)
    if near_rim(scene, punch):
        return Decision("mechanics in three dimensions near the rim, as a change of the axisymmetric touch",
                        f"{where}; a coarser mesh with fewer harmonics tells the error, which counts in the result's "
                        "own", 0.0)
    return Decision("mechanics axisymmetric about the punch", where, effect_of_edges(scene, punch))


def _friction_decision(punch: Punch, rim: bool) -> Decision:
    if punch.friction == "none":
        return Decision("no friction", "friction is none in [punch]; a punch that sticks stands up to 6 % less and 1 % "
                        "deeper (Table 1, 10 to 18 mm, 0.1 to 3 N); the signal's cost is unknown and not in the "
                        "bound", 0.0, unbounded=True)
    reason = ("what the foam sticks to depends on the way there, a straight rise of the force; half as many increments "
              "tell the error, which counts in the result's own; on the default mesh, whatever accuracy is asked for")
    if rim:
        reason += ("; what the rim changes is taken at the end of that way alone, with what sticks stuck. In 16 or 8 "
                   "increments of it, at three touches, the added depth was at most 2 % and the added movement 10 % "
                   "different: that part of it counts in the result's own error too")
    return Decision("friction, loaded in increments", reason, 0.0)


def _together_decision(scene: Scene, group: Sequence[int]) -> Decision:
    gap = edge_gap_m(*(scene.punches[i] for i in group))
    named = " and ".join(str(i + 1) for i in group)
    return Decision(f"touches {named} solved together in three dimensions",
                    f"{gap * 1e3:.1f} mm lie between their edges, {gap / scene.body.thickness_m:.1f} thicknesses; a "
                    "coarser mesh with fewer harmonics and the last pass over both tell the error, which counts in the "
                    "result's own", 0.0)


def _neighbour_decision(scene: Scene, groups: Sequence[Sequence[int]]) -> Decision:
    separation = [(i, j) for i, j in itertools.combinations(range(len(scene.punches)), 2)
                  if not any(i in group and j in group for group in groups)]
    gap = min(edge_gap_m(scene.punches[i], scene.punches[j]) for i, j in separation)
    others = " not solved together" if groups else ""
    return Decision(f"{len(scene.punches)} touches, each{others} solved as if it were alone",
                    f"the closest two{others} have {gap * 1e3:.1f} mm between their edges, "
                    f"{gap / scene.body.thickness_m:.1f} thicknesses; their strains add up in the skin, whose "
                    "electrics is solved for all together. Where the solved fields reach further than this bound, the "
                    "result's own error grows", expected(scene.body, scene.punches, groups))


def _moduli_decision(scene: Scene, material: Material) -> Decision:
    law, series = material.law, material.card.prony
    reason = f"the scene asks for no hold; {law.moduli} moduli"
    if scene.hold.moduli == "card":
        reason += " as the card labels them"
    if law.moduli == "instantaneous" and series is not None:
        reason += f" (a touch held to equilibrium needs {series.g_infinity:.2f} of the force: set moduli in [hold])"
    return Decision("no viscoelasticity", reason, 0.0)


def _hold_decisions(scene: Scene, law: Law) -> Iterator[Decision]:
    hold = scene.hold
    if hold.keeps_deformation:
        yield Decision("a hold at constant depth, without steps in time", "at a kept deformation every stress falls by "
                       "G(t)/G_0, and with it the force on a rigid punch; strains and readings stay", 0.0)
    else:
        yield Decision(f"a hold at constant {hold.control}, stepped in time", "the deformation goes on, which no "
                       "formula tells; halving the steps tells their error, which counts in the result's own", 0.0)
    ramp = f"over {hold.loading_s:g} s at a constant rate (loading_s in [hold])"
    yield Decision("loaded at once" if hold.loading_s == 0 else "loaded " + ramp,
                   "loading_s in [hold] is 0; instantaneous moduli" if hold.loading_s == 0 else
                   "stepped in time; instantaneous moduli at its start", 0.0)
    if law.hencky_ratio != (0.0, True):
        yield Decision("shear and bulk relax in the same way", "the card has one Prony series; for nu other than 0 "
                       "the cost is unknown and not in the bound", 0.0, unbounded=True)
    yield Decision("the skin's conductivity has no memory", "it follows the strain of the moment; the card's law knows "
                   "no time", 0.0, unbounded=True)
