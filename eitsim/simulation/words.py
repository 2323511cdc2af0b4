"""Choices in words: the lines of a plan, and why a scene cannot be solved. Nothing reads these sentences back. Those of
a route stand in its file.

A template is filled with a choice's values, lengths in mm next to those in m.
"""

import math
from collections.abc import Callable
from typing import Any

from eitsim.scene.choices import Kind, Why
from eitsim.scene.results import Decision
from eitsim.simulation.routes import known_routes
from eitsim.simulation.routes.route import Values, Words
from touchcal.choice import Choice

# Dipole moment of the touch, over the square of the punch's radius, by the strain that drives the skin: 14 mm,
# insulated, under DIPOLE_FORCES_N, on Table 1's foam.
DIPOLE_FORCES_N = (0.1, 1.0, 2.0)
DIPOLE = {"normal": (-0.04, -0.42, -0.38), "principal": (0.04, 0.69, 1.42), "areal": (0.00, 0.49, 0.96)}
_DRIVEN_BY = {"normal": "its strain through the thickness", "principal": "its largest strain in plane",
              "areal": "its change of area"}
_STAYS = "; exact does not change it, since nothing that does without it is built"
_REMEDIES: dict[str, str] = {
    Kind.SOFT_ELECTRODES: "Where yours give way, as paint, foil and thin wires do, write soft = true in [electrodes]."}

# What electrodes are where they do not give way: lines along the edge, or patches.
_BODIES = {True: "stiff plates that stand on the base and hold the side as high as the layer",
           False: "stiff pads bonded to the surface, which move with it"}

_LINES: dict[Kind, Words] = {
    Kind.FROM_REST: ("solved from rest at the force itself", "no load path is stored or interpolated"),
    Kind.INSULATED: ("no conduction through the punch", "conductor is false in [punch]"),
    Kind.FLOATING: (
        "a conducting punch floats on the whole of its contact", "one contact impedance; the contact ends "
        "where the layer's mesh resolves it, and what a nearer end would change of dV counts in the result's "
        "own error. Where strains in plane nearly cancel what the punch shunts, this and all bounds here "
        "count as many times as the larger part is of dV"),
    Kind.END_BY_NEIGHBOUR: (
        "a conducting punch touches where it would alone", "what its neighbour changes of the contact's end is not "
        "built; the cost is unknown and not in the bound"),
    Kind.END_BY_EDGE: (
        "a conducting punch touches where it would without the rim", "what the rim changes of the contact's end is not "
        "built; with the contact of the three-dimensional solution dV changed by up to 1.9 % (flat, gaps of 3 to 20 "
        "mm) and 9.4 % (sphere, 5 mm)"),
    Kind.HOLD_KEPT: (
        "a hold at constant depth, without steps in time", "at a kept deformation every stress falls by G(t)/G_0, and "
        "with it the force on a rigid punch; strains and readings stay"),
    Kind.HOLD_STEPPED: (
        "a hold at constant {control}, stepped in time", "the deformation goes on, which no formula tells; halving the "
        "steps tells their error, which counts in the result's own"),
    Kind.HOLD_ELASTIC: (
        "a hold at constant {control}, as elastic touches", "near edges, together and at given depths with friction "
        "nothing is stepped in time: each touch alone is, upright, where a depth is given without friction, and an "
        "elastic one under the force that makes it as deep stands for it at every time. What the strains of these two "
        "differ by over the surface counts in the result's own error (benchmarks/elastic_holds.py)"),
    Kind.YIELDING_ELECTRODES: (
        "electrodes give way with a curved skin", "they are parts of its sheet alone; what stiff ones would change of "
        "a touch next to them is not built there, its cost unknown and not in the bound"),
    Kind.LOADED_AT_ONCE: ("loaded at once", "loading_s in [hold] is 0; instantaneous moduli"),
    Kind.LOADED_OVER: (
        "loaded over {loading_s:g} s at a constant rate (loading_s in [hold])",
        "stepped in time; instantaneous moduli at its start"),
    Kind.ONE_RELAXATION: (
        "shear and bulk relax in the same way", "the card has one Prony series; for nu other than 0 the cost is "
        "unknown and not in the bound"),
    Kind.NO_MEMORY: (
        "the skin's conductivity has no memory", "it follows the strain of the moment; the card's law knows no time"),
    Kind.OUTSIDE_FITS: (
        "laws used outside their fits", "touches strain the skin and may compress the layer further than their tests "
        "did, through the thickness in compression where the skin's law was fitted in tension; the result holds both "
        "strains, the cost is unknown and not in the bound"),
    Kind.POSITIVE_IN_PART: (
        "the skin's law is positive over part of what touches reach", "it is 0 at the strain {strain:.3g}; "
        "whether the touch compresses the skin that far is known once its mechanics is solved, and refused then"),
    Kind.ONE_CARD: (
        "one card, not its uncertainty", "the card's own laws are taken as exact; not in the bound"),
    Kind.NO_FRICTION: (
        "no friction", "friction is none in [punch]; a punch that sticks stands up to 6 % less and 1 % deeper "
        "(Table 1, 10 to 18 mm, 0.1 to 3 N); the signal's cost is unknown and not in the bound"),
    Kind.FIXED_CHOICES: (
        "coating of constant thickness, real currents", "fixed choices of this version; the bound does not hold them"),
    Kind.RIGID_PUNCH: ("rigid punch", "steel is {ratio:.0e} times stiffer than the layer"),
    Kind.NO_LOAD_IN_SKIN: (
        "the skin carries no load", "a sprayed layer; the card has no stiffness for it, so the cost is unknown and not "
        "in the bound"),
    Kind.SHEET: (
        "the skin is a sheet, solved on the surface", "its thickness is {over_fillet:.2f} of the punch's fillet, the "
        "shortest length over which it changes; the cost is of second order in that"),
    Kind.LAYER_BASE: (
        "the layer lies on a soft base of {base_mm:g} mm, bonded to it and to a rigid plate", "the base does not "
        "conduct; its law is that of card '{card}', {moduli} moduli, the layer's mu_0 {stiffer:.3g} times its. Its "
        "strains are not compared with those of its tests. A stiff layer carries strain further: what edges then "
        "change more than of one material counts here (benchmarks/soft_base.py)"),
    Kind.LAYER_TOUCH: (
        "the touched layer is a sheet of its resultants, or solved in its volume", "without current across the layer "
        "it conducts as a sheet; of random touches that was up to {sheet:.0%} off in dV. The first harmonics of each "
        "touch, solved in the volume, show the error: it counts in the result's own, and where it is more than a tenth "
        "of the requested one the volume's harmonics take the sheet's place. The untouched layer is the sheet"),
    Kind.LAYER_ELECTRODES: (
        "the layer is solved in three dimensions", "electrodes do not cover the whole height of the rim; untouched and "
        "touched on one mesh. Fewer layers of it show the error, with {plane:.1%} for the mesh of the plane, and count "
        "in the result's own"),
    Kind.UNTOUCHED_TRIANGLES: (
        "untouched readings by triangles that their own solution refines", "until halving them once more would change "
        "the readings by less than {readings:g}; the signal does not hold that error"),
    Kind.PATCH_AREA: (
        "patches conduct by their untouched area", "their contact impedance does not follow what a touch on or next to "
        "them stretches; the cost is unknown and not in the bound"),
    Kind.EVEN_SHEET: (
        "the calibrated sheet is taken as even", "sheet_modes in [channels] say how the logarithm of its conductance "
        "varies, by up to {largest:.2g} a mode; readings do without, and so differ from the sensor's by about as much "
        "of the signal"),
    Kind.SHEET_CONDUCTANCE: (
        "the untouched skin has the calibrated sheet conductance of {conductance_S:.4g} S", "conductance_S in "
        "[channels]; thickness in [skin] and c0 of the card have no effect, the card says how strain changes it"),
    Kind.SCATTER: (
        "touches of this sensor scatter about its model", "labelled presses that a fit left out were off by "
        "{error:.2g} of the signal's size, r.m.s. (size_error in [channels]); the bound is {sds:g} times that, and "
        "models of a sweep count it in their intervals"),
    Kind.CHANNELS: (
        "readings through the channels of a calibrated sensor", "gains against ground, source currents and leaks act "
        "outside the body, so that its impedance matrix holds all they need; exact for touched readings too. Their "
        "intervals are not in the bound; impedance_Ohm and maps of the skin are those of the body without them"),
    Kind.ONE_MATRIX: (
        "one impedance matrix serves all {patterns} patterns", "every pattern is a linear read-out of it"),
    Kind.FINER_MESH: (
        "exact: a finer mesh of the layer", "half the default element size, whatever accuracy is asked for"),
    Kind.EXACT_SKIN: (
        "exact: the skin is solved on a mesh that follows the touch", "nothing is taken from rings; the mesh's "
        "estimate counts in the result's own error"),
}


def _stored(of: Values) -> Words:
    ends = [f"{d * 1e3:g}" for d in of["diameters_m"]]
    where = f"{ends[0]} to {ends[-1]} mm" if of["spans"] else f"{', '.join(ends)} mm"
    rim = "" if of["rim"] is None else (
        f"; what the rim changes, from a table too, was at most {of['rim'][0]:.1e} off in depth and {of['rim'][1]:.1e} "
        "in signal about this gap and depth")
    return "load path reused", (
        f"depth, pressure and surface are cubics along stored paths of punches of {where}; of {of['checks']} touches "
        f"solved anew between its nodes the depth was at most {of['depth']:.1e} off, the dipole response "
        f"{of['signal']:.1e}, and the surface's stretches {of['strain']:.1e} in L2{rim}; the bound is "
        f"{of['safety']:g} times the larger of depth and response; the table took {of['cpu_s']:.0f} CPU s, once, not "
        "counted in the cost of a touch")


def _alone(of: Values) -> Words:
    alone, others = (("those not solved together as if each were alone", " of these") if of["pairs"]
                     else ("each solved as if it were alone", ""))
    return (f"{of['count']} touches, {alone}",
            f"the closest two{others} have {of['gap_mm']:.1f} mm between their edges, "
            f"{of['gap_m'] / of['thickness_m']:.1f} thicknesses; their strains add up in the skin, whose electrics is "
            "solved for all together. Where the solved fields reach further than this bound, the result's own error "
            "grows")


def _no_viscoelasticity(of: Values) -> Words:
    reason = f"the scene asks for no hold; {of['moduli']} moduli{' as the card labels them' if of['by_card'] else ''}"
    if of["left"] is not None:
        reason += f" (a touch held to equilibrium needs {of['left']:.2f} of the force: set moduli in [hold])"
    return "no viscoelasticity", reason


def _strain(of: Values) -> Words:
    sizes = {strain: ", ".join(f"{moment:.2f}" for moment in moments) for strain, moments in DIPOLE.items()}
    own, forces = of["strain"], ", ".join(f"{force:g}" for force in DIPOLE_FORCES_N)
    others = "; ".join(f"{sizes[strain]} by strain = \"{strain}\"" for strain in DIPOLE if strain != own)
    shunted = "; a conducting punch lowers it by up to 0.8, and the place of a touch whose moment is near 0 is " \
              "hardly seen" if of["conducts"] else ""
    return (f"the skin's conductivity follows {_DRIVEN_BY[own]}", "a coating is measured against the stretch in its "
            f"plane; the dipole moment of an insulated 14 mm punch at {forces} N, over its radius squared, is "
            f"{sizes[own]}; {others}{shunted} (Table 1); the cost is unknown and not in the bound")


def _layer(of: Values) -> Words:
    by = {"principal": "the largest principal strain at every place", "volume": "the change of volume at every place",
          "piezoresistive": f"strain along the current ({of['along']:g}) and across it ({of['across']:g}), as changes "
          "of the logarithm of the resistivity by logarithmic strain"}
    return (f"the layer conducts in its volume and follows {by[of['strain']]}", "it is bonded to what is under it; "
            "what of a measured law holds under compression is unknown, and not in the bound")


def _friction(of: Values) -> Words:
    near = ("; what edges and other punches change is taken at the end of that way alone, with what sticks stuck and "
            "what slips under its largest shear. In 16 or 8 increments of it, at three touches that stick, the added "
            "depth was at most 2 % and the added movement 10 % different: that part of it counts in the result's own "
            "error too") if of["near"] else ""
    return "friction, loaded in increments", (
        "what the layer sticks to depends on the way there, a straight rise of the force; half as many increments tell "
        f"the error, which counts in the result's own; on the default mesh, whatever accuracy is asked for{near}")


def _soft_electrodes(of: Values) -> Words:
    return "electrodes do not stiffen the layer", (
        f"{_BODIES[of['plates']]} would change the signal by so much at most, by the gap from the punch's edge to the "
        "nearest (benchmarks/stiff_electrodes.py). Where a touch's dipole nearly vanishes it is a larger part of its "
        "signal; soft = true in [electrodes] says that they give way")


def _stiff_electrodes(of: Values) -> Words:
    return "electrodes are stiff bodies", (
        f"{_BODIES[of['plates']]} are part of what is solved in three dimensions; soft = true in [electrodes] says "
        "that they give way")


def _mesh(of: Values) -> Words:
    why = "electrodes lie on it" if of["outline"] else "patch electrodes cover part of it"
    return ("the skin is solved on a mesh that follows the touch",
            f"{why}; the mesh's estimate counts in the result's own error")


def _rings(of: Values) -> Words:
    how = ("the touch is solved by what its rings scatter, and the edges of the untouched skin send back"
           if of["outline"] else "the untouched skin is solved on its rim, the touch by what its rings scatter")
    return how, ("where the strain is not axisymmetric about the punch, or the estimate misses the requested error, a "
                 "mesh that follows the touch takes over; the estimate counts in the result's own error")


def _missing(of: Values) -> Words:
    gone = of["electrodes"]
    return (f"without electrode{'s' if len(gone) > 1 else ''} {', '.join(map(str, gone))} (from 0)", "missing in "
            "[electrodes]: no current passes; readings that need one are null")


_SPECIMENS = {True: "each that of a further specimen, as those tested scatter",
              False: "all of the mean of the specimens tested, since specimen is false in [material]",
              None: "how specimens differ is not in it"}


def _drawn_cards(of: Values) -> Words:
    return f"{of['count']} cards drawn from the posterior", (
        f"{_SPECIMENS[of['further']]}; {of['varying']} vary as its draws do, other parts are the card's own and taken "
        f"as exact; a mean over cards is off by 1/sqrt({of['count']}) = {of['spread']:.2g} of their spread, what the "
        "posterior does not hold by what is unknown; not in the bound")


_MADE: dict[str, Callable[[Values], Words]] = {
    Kind.DRAWN_CARDS: _drawn_cards,
    Kind.STORED: _stored, Kind.ALONE: _alone,
    Kind.NO_VISCOELASTICITY: _no_viscoelasticity, Kind.STRAIN: _strain, Kind.FRICTION: _friction,
    Kind.SOFT_ELECTRODES: _soft_electrodes, Kind.STIFF_ELECTRODES: _stiff_electrodes, Kind.MESH: _mesh,
    Kind.RINGS: _rings, Kind.MISSING: _missing, Kind.LAYER: _layer}


def decision(choice: Choice) -> Decision:
    """A choice of a plan as a line of it."""
    kind, of = choice.kind, _in_mm(choice.values)
    made = _MADE | {route.kind: route.words for route in known_routes.ROUTES}
    what, why = made[kind](of) if kind in made else (part.format_map(of) for part in _LINES[Kind(kind)])
    return Decision(kind, what, why + (_STAYS if of.get("stays") else ""), choice.cost or 0.0, choice.cost is None,
                    of.get("strain_bound"), _REMEDIES.get(kind, ""), of.get("touch"))


def _in_mm(values: Values) -> dict[str, Any]:
    """Values with every length, m, in mm too."""
    return {**values, **{f"{name}m": 1e3 * value for name, value in values.items()
                         if name.endswith("_m") and isinstance(value, float)}}


_REFUSALS = {
    Why.ELECTRODES: "{problem}",
    Why.UNFIT: "{problem}",
    Why.LAYER_EDGE: (
        "the punch's edge is {gap_mm:.1f} mm from the nearest edge of a layer that conducts in its volume; its inside "
        "is known where a touch is axisymmetric, from a gap of one thickness on: {thickness_mm:g} mm. Move the punch "
        "inwards; only a coating, kind = \"sheet\" in [skin], is solved nearer to edges."),
    Why.LAYER_TILT: (
        "tilt_deg and shape in [punch]: the inside of a layer that conducts in its volume is known where a touch is "
        "axisymmetric; leave them out."),
    Why.LAYER_TOGETHER: (
        "touches this close change each other, and the inside of a layer that conducts in its volume is known where "
        "each is axisymmetric; move them from each other, or ask for less accuracy (a larger signal in [accuracy])."),
    Why.CONDUCTIVITY_UNIT: (
        "c0_S_per_m = {c0_S_per_m:g} in the conductivity of card '{card}': {least:g} to {most:g} S/m is solved; check "
        "its unit, or fit the conductivity again."),
    Why.TOO_SHALLOW: (
        "depth_mm = {depth_mm:g} in [punch] is so little that rounding hides the touch; give at least {least_mm:g}."),
    Why.TOO_DEEP: (
        "depth_mm = {depth_mm:g} in [punch] is above {share:.0%} of the layer's thickness, which squeezes it flat; "
        "give at most {deepest_mm:g}.")}


def refusal(why: Choice) -> str:
    """Why a scene cannot be solved, with the nearest that can, in words."""
    kind, of = why.kind, _in_mm(why.values)
    problems = {own: clause for route in known_routes.ROUTES for own, clause in route.problems.items()}
    touch = f"touch {of['touch'] + 1}: " if "touch" in of else ""
    if kind in _REFUSED:
        return touch + _REFUSED[kind](of)
    if kind in problems:
        problem = problems[kind].format_map(of)
        return touch + (_too_close(of, problem) if "between" in of else _near_edge(of, problem))
    return touch + _REFUSALS[Why(kind)].format_map(of)


def _too_thin(of: Values) -> str:
    least = of["thickness_m"] * of["count"] / of["most"] * 1e3
    return (f"thickness_mm = {of['thickness_mm']:g} in [body] is so little under a punch of diameter_mm = "
            f"{of['diameter_mm']:g} that the layer's mesh needs {of['count']:.2g} elements across, at most "
            f"{of['most']} are solved; give a thickness of {least:.2g} mm or more, or a smaller punch.")


def _too_light(of: Values) -> str:
    digits = 10.0 ** (math.floor(math.log10(of["least_N"])) - 1)
    return (f"force_N = {of['force_N']:g} in [punch] is so little that rounding hides the touch; this layer needs at "
            f"least {math.ceil(of['least_N'] / digits) * digits:.2g}.")


def _off_skin(of: Values) -> str:
    gap_m, least_m = of["gap_m"], of["least_m"]
    if of["diameter_m"] + 2 * least_m > of["across_m"]:
        return (f"the punch is {of['diameter_m'] * 1e3:.3g} mm wide and the skin {of['across_m'] * 1e3:.3g} mm, so "
                "that it fits nowhere; take a smaller punch or a larger skin.")
    edge, off, onto = (("the nearest edge of the skin", "reaches {:.1f} mm past", "onto the skin")
                       if of["outline"] else ("the rim of the disc", "lies {:.1f} mm outside", "inwards"))
    where = off.format(-gap_m * 1e3) if gap_m <= -5e-5 else "lies on"
    further = (math.floor((least_m - gap_m) * 1e5) + 1) / 100
    return (f"the punch's edge {where} {edge}; change x_mm and y_mm so that the punch lies {further:.2f} mm further "
            f"{onto}.")


def _near_edge(of: Values, problem: str) -> str:
    near, edge = ("the nearest edge of the skin", "edges") if of["outline"] else ("the rim", "the rim")
    inwards = f"move the punch inwards to a gap of {of['clear_mm']:.0f} mm or " if (
        of["clear_m"] < of["radius_m"]) else ""
    return (f"the punch's edge is {of['gap_mm']:.1f} mm from {near}, where the touch is not axisymmetric: neglecting "
            f"{edge} may cost {of['cost']:.2g} of the signal, allowed is {of['allowed']:.2g} (part of signal in "
            f"[accuracy]). There, {problem}; {inwards}ask for less accuracy (a larger signal in [accuracy]).")


def _overlap(of: Values) -> str:
    return (f"{_edges_of(of)} overlap by {max(-of['gap_m'], 0.0) * 1e3:.1f} mm; move the punches from each other by "
            "that and 3 % of the layer's thickness more.")


def _too_close(of: Values, problem: str) -> str:
    return (f"{of['gap_mm']:.1f} mm lie between {_edges_of(of)}: solving each touch as if it were alone may cost "
            f"{of['cost']:.2g} of the signal, allowed is {of['allowed']:.2g} (half of signal in [accuracy]), and "
            f"{problem}. Leave {of['clear_mm']:.0f} mm between them or ask for less accuracy (a larger signal in "
            "[accuracy]).")


def _edges_of(of: Values) -> str:
    i, j = of["between"]
    return f"the edges of touches {i + 1} and {j + 1}"


_REFUSED: dict[str, Callable[[Values], str]] = {
    Why.TOO_THIN: _too_thin, Why.TOO_LIGHT: _too_light, Why.OFF_SKIN: _off_skin, Why.OVERLAP: _overlap}
