"""One scene, end to end: plan, mechanics, skin and electrics, readings."""

from __future__ import annotations

import math
import resource
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from eitsim.approach import BOTTOM, BottomedOut
from eitsim.axisymmetric import Unresolved, solve_touch
from eitsim.electrics import solve
from eitsim.holding import kept, solve_hold
from eitsim.mesh import default_element_m
from eitsim.near_rim import COARSE, FINE, rim_problem, solve_near_rim
from eitsim.neighbours import expected, interaction
from eitsim.plan import law_of, make_plan, near_rim, on_mesh, together
from eitsim.results import Array, Moment, Plan, Readings, Result, Touch
from eitsim.reuse import decision, served
from eitsim.scene import Punch, Scene
from eitsim.table import Table
from eitsim.together import FINEST, solved_together
from matcal.card import MaterialCard, require
from matcal.conductivity import Conductivity
from matcal.errors import NotConverged
from matcal.hyperfoam import Hyperfoam
from matcal.prony import Prony

# Parts of the wanted signal error that the mechanics and the electrics may use up.
MECHANICS_SHARE, ELECTRICS_SHARE = 0.8, 0.2
# Nodes of a mesh that may still be halved: four times as many took 430 MB for 5700.
_MOST_NODES = 6000


def simulate(scene: Scene, card: MaterialCard, *, exact: bool = False, table: Table | None = None) -> Result:
    """Solve a scene with a card; a refusal or a failure of a solver is the result's outcome, told in its message.

    exact: on the finer mesh of the foam, and on a mesh of the skin, from the start, as the plan tells; table: load
    paths that serve the touches they hold to the wanted error (reuse.served), never with exact.
    ValueError where the card lacks a part that the scene needs.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    law = law_of(scene, card)
    skin_law = require(card, "conductivity", "the skin")
    stored = [touch if touch is not None and (touch.rim is not None or _fine_enough([touch], scene)) else None
              for touch in served(None if exact else table, law, scene)]
    plan = make_plan(scene, card, exact=exact, reused=[
        decision(table, touch, scene.body.thickness_m) if table is not None and touch is not None else None
        for touch in stored])
    if plan.refusal:
        return Result("refused", plan, message=plan.refusal, cost=_cost(wall, cpu))
    groups = together(scene, exact=exact)
    try:
        moments = _moments(law, scene, card, skin_law, exact) if scene.hold.time_s else ()
        touches = (moments[-1].touch,) if moments else _touches(law, scene, stored, groups, exact)
        readings = moments[-1].readings if moments else _readings(scene, touches, skin_law, exact)
    except NotConverged as error:
        return Result("bottomed_out" if isinstance(error, BottomedOut) else "not_converged", plan, message=str(error),
                      residuals=error.residuals, load_fraction=error.load_fraction, cost=_cost(wall, cpu))
    deepest = max(touch.depth_m for touch in touches)
    outcome, message = "ok", ""
    if deepest > BOTTOM * scene.body.thickness_m:
        outcome = "bottomed_out"
        message = f"the punch is {deepest * 1e3:.3f} mm deep, beyond {BOTTOM:.0%} of the foam's thickness."
    neighbours = interaction(tuple(zip(scene.punches, touches, strict=True)), groups) if len(touches) > 1 else {}
    planned = expected(scene.body, scene.punches, groups)
    unplanned = {key: max(value - planned, 0.0) for key, value in neighbours.items()}
    numerical = numerical_errors(touches, readings)
    told = errors(plan, numerical, unplanned)
    message = message or _missed(scene.accuracy.signal, told["signal"], numerical["signal"], plan)
    return Result(outcome, plan, touches, readings, moments, message, interaction=neighbours, error_estimate=told,
                  numerical_error=numerical, cost=_cost(wall, cpu))


def _readings(scene: Scene, touches: tuple[Touch, ...], skin_law: Conductivity, exact: bool) -> Readings:
    return solve(scene.body, scene.skin, scene.electrodes, scene.drive,
                 tuple(zip(scene.punches, touches, strict=True)), skin_law,
                 signal=ELECTRICS_SHARE * scene.accuracy.signal,
                 method="mesh" if exact and on_mesh(scene) else "auto")


def _moments(law: Hyperfoam, scene: Scene, card: MaterialCard, skin_law: Conductivity,
             exact: bool) -> tuple[Moment, ...]:
    """A held touch with its readings; one solve serves all times where the strains stay as they were loaded."""
    (punch,) = scene.punches
    held = _held(law, require(card, "prony", "a hold"), scene, punch, exact)
    if scene.hold.keeps_deformation:
        readings = [_readings(scene, (held[0][1],), skin_law, exact)] * len(held)
    else:
        readings = [_readings(scene, (touch,), skin_law, exact) for _, touch in held]
    return tuple(Moment(t, touch, reading) for (t, touch), reading in zip(held, readings, strict=True))


def _touches(law: Hyperfoam, scene: Scene, stored: Sequence[Touch | None], groups: Sequence[tuple[int, ...]],
             exact: bool) -> tuple[Touch, ...]:
    """All touches, each alone, and what those of a group, solved together, change of each other."""
    touches = [kept or _touch(law, scene, punch, exact, paired=any(i in group for group in groups))
               for i, (punch, kept) in enumerate(zip(scene.punches, stored, strict=True))]
    for i, j in groups:
        touches[i], touches[j] = solved_together(
            (touches[i], touches[j]), law, scene.body, (scene.punches[i], scene.punches[j]), strain=scene.skin.strain,
            coarse=FINE if exact else COARSE, fine=FINEST if exact else FINE)
    return tuple(touches)


def _touch(law: Hyperfoam, scene: Scene, punch: Punch, exact: bool, *, paired: bool = False) -> Touch:
    """A touch on the default mesh, and on one of half its element size where that misses the wanted error or is not
    exact; in three dimensions near the rim and, where that is built and no neighbour is solved together with it, to be
    exact."""
    if near_rim(scene, punch) or (exact and not paired and not rim_problem(scene.body, punch)):
        return solve_near_rim(law, scene.body, punch, strain=scene.skin.strain, whole=exact)
    touch = None if exact else _resolved(law, scene, punch)
    if touch is not None and (_fine_enough([touch], scene) or not _refinable(touch, punch)):
        return touch
    return solve_touch(law, scene.body, punch, strain=scene.skin.strain,
                       element_m=default_element_m(scene.body, punch) / 2)


def _refinable(touch: Touch, punch: Punch) -> bool:
    """Whether half the element size is in reach: of the memory, and not at the end of a load path with friction, which
    may have to be loaded again from rest on the finer mesh at fifty times the cost."""
    within_memory = touch.section is None or len(touch.section.nodes_m) <= _MOST_NODES
    return within_memory and punch.friction == "none"


def _resolved(law: Hyperfoam, scene: Scene, punch: Punch) -> Touch | None:
    """The touch on the default mesh; None where that is too coarse to show the foam at the punch's edge or tip."""
    try:
        return solve_touch(law, scene.body, punch, strain=scene.skin.strain)
    except Unresolved:
        return None


def _held(law: Hyperfoam, series: Prony, scene: Scene, punch: Punch, exact: bool) -> list[tuple[float, Touch]]:
    """A held touch as `_touch`, fine enough at the times that the scene asks for."""
    if scene.hold.keeps_deformation:
        return kept(series, scene.hold, _touch(law, scene, punch, exact))
    if not exact:
        held = solve_hold(law, series, scene.body, punch, scene.hold, strain=scene.skin.strain)
        if _fine_enough([touch for _, touch in held[1:]], scene):
            return held
    return solve_hold(law, series, scene.body, punch, scene.hold, strain=scene.skin.strain,
                      element_m=default_element_m(scene.body, punch) / 2)


def _fine_enough(touches: list[Touch], scene: Scene) -> bool:
    return all(touch.signal_error <= MECHANICS_SHARE * scene.accuracy.signal
               or touch.depth_m > BOTTOM * scene.body.thickness_m for touch in touches)


def errors(plan: Plan, numerical: Mapping[str, float], unplanned: Mapping[str, float] | None = None
           ) -> dict[str, float]:
    """`numerical_errors`, with what the plan left out and what neighbours may change beyond that."""
    return {key: value + (plan.strain_bound if key == "strain" else plan.error_bound)
            + (unplanned or {}).get(key, 0.0) for key, value in numerical.items()}


def numerical_errors(touches: tuple[Touch, ...], readings: Readings) -> dict[str, float]:
    """Relative errors of the worst touch by what was solved: "signal", its electrics added, and "depth", and
    "sigma_max", "A_c" and "strain" where every touch tells them."""
    out = {"signal": max(t.signal_error for t in touches) + readings.signal_error,
           "depth": max(t.depth_error for t in touches)}
    for key, told in {"sigma_max": [t.sigma_max_error for t in touches],
                      "A_c": [t.contact_area_error for t in touches],
                      "strain": [t.strain_error for t in touches]}.items():
        known = [error for error in told if error is not None]
        if len(known) == len(told):
            out[key] = max(known)
    return out


def _missed(wanted: float, told: float, numerical: float, plan: Plan) -> str:
    """What keeps the signal's error from the wanted one; empty where nothing does."""
    if told <= wanted:
        return ""
    largest = max(plan.decisions, key=lambda d: d.error_bound)
    return (f"the signal's error may be {told:.2g}, more than the {wanted:g} asked for (signal in [accuracy]): "
            f"{numerical:.2g} is numerical, {plan.error_bound:.2g} what the plan left out, most of that "
            f"\"{largest.decision}\".")


def _cost(wall: float, cpu: float) -> dict[str, float]:
    return {"cpu_s": time.process_time() - cpu, "wall_s": time.perf_counter() - wall,
            "peak_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def as_json(result: Result, scene: Scene, card: MaterialCard) -> dict[str, Any]:
    """A result as plain JSON values with the keys of the command-line contract; several touches give lists."""
    out: dict[str, Any] = {
        "outcome": result.outcome, "message": result.message,
        "plan": decisions(result.plan),
        "cost": dict(result.cost)}
    if result.residuals:
        out["residuals"] = list(result.residuals)
    if result.load_fraction is not None:
        out["load_fraction"] = result.load_fraction
    if result.readings is None:
        return out
    blocks = [mechanical(touch) for touch in result.touches]
    mechanics: Mapping[str, Any] = {key: [block[key] for block in blocks] for key in blocks[0]}
    return out | (blocks[0] if len(blocks) == 1 else mechanics) | {
        "readings_V": _rows(result.readings.touched_V), "baseline_V": _rows(result.readings.baseline_V),
        "impedance_Ohm": _rows(result.readings.impedance_Ohm),
        **({"interaction": dict(result.interaction)} if result.interaction else {}),
        "error_estimate": dict(result.error_estimate), "numerical_error": dict(result.numerical_error),
        "electrics_method": result.readings.method,
        "stability": {"elliptic": all(t.fraction_non_elliptic == 0 for t in result.touches),
                      "fraction_non_elliptic": max(t.fraction_non_elliptic for t in result.touches),
                      "non_elliptic_mm": [non_elliptic_mm(touch) for touch in result.touches],
                      "skin_fraction_extrapolated": result.readings.skin_fraction_extrapolated,
                      **fitted_ranges(result, card)},
        "slip_fraction": [touch.slip_fraction for touch in result.touches],
        "profile": [profile(touch, scene) for touch in result.touches]} | (
            {"times": [moment_block(moment, result.plan) for moment in result.moments]} if result.moments else {})


def _rows(values: Array) -> list[list[float | None]]:
    """A matrix as lists, None where an electrode that it needs is missing."""
    return [[None if math.isnan(value) else value for value in row] for row in values.tolist()]


def decisions(plan: Plan) -> list[dict[str, Any]]:
    """The decisions of a plan as plain JSON values; strain_bound only where it is not the error_bound."""
    return [{"decision": d.decision, "reason": d.reason, "error_bound": d.error_bound}
            | ({} if d.strain_bound is None else {"strain_bound": d.strain_bound}) for d in plan.decisions]


def moment_block(moment: Moment, plan: Plan) -> dict[str, Any]:
    """A held touch at one time as plain JSON values; the keys are those of the result, and the time itself."""
    return {"time_s": moment.time_s, **mechanical(moment.touch), "readings_V": _rows(moment.readings.touched_V),
            "error_estimate": errors(plan, numerical_errors((moment.touch,), moment.readings))}


def non_elliptic_mm(touch: Touch) -> dict[str, list[float]] | None:
    """Where strong ellipticity is lost: least and largest reference radius and depth below the untouched surface."""
    if touch.non_elliptic_m is None:
        return None
    radius, below = (1e3 * touch.non_elliptic_m).tolist()
    return {"radius_mm": radius, "below_mm": below}


def fitted_ranges(result: Result, card: MaterialCard) -> dict[str, Any]:
    """Least through-thickness strain of the surface, and the strains over which foam and skin were fitted.

    Where the least strain lies below them the laws are extrapolated, at a cost that no error estimate here counts.
    """
    least = min(float(np.min(touch.stretch_normal)) for touch in result.touches) - 1
    foam = card.hyperfoam.strain_range.get("uniaxial") if card.hyperfoam else None
    skin = card.conductivity.strain_range if card.conductivity else None
    return {"least_strain": least, "fitted_foam_strain": list(foam) if foam else None,
            "fitted_skin_strain": list(skin) if skin else None}


def mechanical(touch: Touch) -> dict[str, float]:
    """The mechanical outputs of one touch, units in their names."""
    return {"force_N": touch.force_N, "delta_max_mm": touch.depth_m * 1e3, "sigma_max_kPa": touch.sigma_max_Pa / 1e3,
            "sigma_ave_kPa": touch.sigma_ave_Pa / 1e3, "A_c_mm2": touch.contact_area_m2 * 1e6,
            "wall_contact_mm2": touch.wall_contact_m2 * 1e6}


def profile(touch: Touch, scene: Scene) -> dict[str, list[float]]:
    """Surface fields of a touch along the reference radius, out to the disc's radius, units in their names."""
    inside = touch.radius_m <= scene.body.radius_m
    fields = {"radius_mm": touch.radius_m * 1e3, "u_r_mm": touch.u_r_m * 1e3, "u_z_mm": touch.u_z_m * 1e3,
              "pressure_kPa": touch.pressure_Pa / 1e3, "stretch_normal": touch.stretch_normal,
              "stretch_meridian": touch.stretch_meridian, "stretch_hoop": touch.stretch_hoop}
    return {name: np.asarray(values)[inside].tolist() for name, values in fields.items()}
