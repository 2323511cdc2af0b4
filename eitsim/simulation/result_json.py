"""A result as plain JSON values: the keys of `result.json`, units in their names."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.curved.curved_scene import AnyScene, CurvedScene, curved_tables
from eitsim.scene.results import Array, Moment, Plan, Result, Touch
from eitsim.scene.scene import Scene, scene_tables
from eitsim.simulation.error_budget import error_budget, numerical_errors
from matcal.card import MaterialCard, as_card, cards_identity
from touchcal.provenance import versions


def result_document(result: Result, scene: AnyScene, card: MaterialCard | Path | str) -> dict[str, Any]:
    """The document that `eitsim run --out` writes of a result: plain JSON values, units in the names of the keys.

    Parameters
    ----------
    result
        What `simulate` returned.
    scene, card
        What it was made from.

    Returns
    -------
    dict
        Keys as in `result.json`: the scene's tables, the card's name and hash, versions, plan, outputs and errors.

    Examples
    --------
    >>> import eitsim
    >>> import matcal
    >>> foam = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
    >>> card = matcal.MaterialCard("foam", foam, conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    >>> scene = eitsim.Scene(punches=[eitsim.Punch(force_N=0.2)], accuracy=eitsim.Accuracy(0.05))
    >>> eitsim.result_document(eitsim.simulate(scene, card), scene, card)["outcome"]
    'ok'
    """
    card = as_card(card)
    tables = curved_tables(scene) if isinstance(scene, CurvedScene) else scene_tables(scene)
    return {"schema": 1, "scene": tables, "card": cards_identity(card, scene.skin.base_card),
            "versions": versions()} | as_json(result, scene, card)


def as_json(result: Result, scene: AnyScene, card: MaterialCard) -> dict[str, Any]:
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
    return out | dict(_of_touches(result.touches)) | {
        "readings_V": _rows(result.readings.touched_V), "baseline_V": _rows(result.readings.baseline_V),
        "impedance_Ohm": _rows(result.readings.impedance_Ohm),
        **({"interaction": dict(result.interaction)} if result.interaction else {}),
        "error_estimate": dict(result.error_estimate), "numerical_error": dict(result.numerical_error),
        "electrics_method": result.readings.method,
        "stability": {"elliptic": all(t.fraction_non_elliptic == 0 for t in result.touches),
                      "fraction_non_elliptic": max(t.fraction_non_elliptic for t in result.touches),
                      "non_elliptic_mm": [non_elliptic_mm(touch) for touch in result.touches],
                      "skin_fraction_extrapolated": result.readings.skin_fraction_extrapolated,
                      **({"signal_past_law": past} if (past := result.readings.past_law) else {}),
                      **fitted_ranges(result, scene, card)},
        "slip_fraction": [touch.slip_fraction for touch in result.touches],
        "profile": [profile(touch, scene) for touch in result.touches]} | (
            {"layer": _currents(result, scene, card)} if scene.skin.fills else {}) | (
            {"as_if_flat": dict(_of_touches(result.as_if_flat))} if result.as_if_flat else {}) | (
            {"times": [moment_block(moment, result.plan, scene.skin.strain) for moment in result.moments]}
            if result.moments else {})


def _currents(result: Result, scene: AnyScene, card: MaterialCard) -> list[dict[str, Any]]:
    """The current through the thickness under every touch of a layer that conducts in its volume."""
    from eitsim.simulation.layers.layer_current import current_blocks  # reports need no finite elements
    from eitsim.simulation.layers.layer_readings import TouchedLayer

    assert isinstance(scene, Scene)
    assert card.conductivity
    return current_blocks(TouchedLayer(scene, result.touches, card.conductivity).sections, result.touches)


def _of_touches(touches: Sequence[Touch]) -> Mapping[str, Any]:
    """The mechanical outputs of one touch; lists of those of several."""
    blocks = [mechanical(touch) for touch in touches]
    return blocks[0] if len(blocks) == 1 else {key: [block[key] for block in blocks] for key in blocks[0]}


def _rows(values: Array) -> list[list[float | None]]:
    """A matrix as lists, None where an electrode that it needs is missing."""
    return [[None if math.isnan(value) else value for value in row] for row in values.tolist()]


def decisions(plan: Plan) -> list[dict[str, Any]]:
    """The decisions of a plan as plain JSON values; strain_bound only where it is not the error_bound, touch
    (from 1) where it is of one of several."""
    return [{"kind": d.kind, "decision": d.decision, "reason": d.reason, "error_bound": d.error_bound,
             "unbounded": d.unbounded}
            | ({} if d.strain_bound is None else {"strain_bound": d.strain_bound})
            | ({} if d.touch is None else {"touch": d.touch}) for d in plan.decisions]


def moment_block(moment: Moment, plan: Plan, strain: str) -> dict[str, Any]:
    """Held touches at one time as plain JSON values; the keys are those of the result, and the time itself."""
    return {"time_s": moment.time_s, **_of_touches(moment.touches), "readings_V": _rows(moment.readings.touched_V),
            "error_estimate": error_budget(plan, numerical_errors(moment.touches, moment.readings, strain),
                                           readings=moment.readings)}


def non_elliptic_mm(touch: Touch) -> dict[str, list[float]] | None:
    """Where strong ellipticity is lost: least and largest reference radius and depth below the untouched surface."""
    if touch.non_elliptic_m is None:
        return None
    radius, below = (1e3 * touch.non_elliptic_m).tolist()
    return {"radius_mm": radius, "below_mm": below}


def fitted_ranges(result: Result, scene: AnyScene, card: MaterialCard) -> dict[str, Any]:
    """Least through-thickness strain of the surface, the card's law, the strains over which it and the skin's were
    fitted, and the share of the signal that comes from skin outside them.

    Where the least strain lies below them the laws are extrapolated, at a cost that no error estimate here counts.
    """
    from eitsim.simulation.layers.layer_readings import share_extrapolated  # reports need no finite elements

    least = min(float(np.min(touch.stretch_normal)) for touch in result.touches) - 1
    fitted = card.law.strain_range.get("uniaxial") if card.law else None
    skin = card.conductivity.strain_range if card.conductivity else None
    return {"least_strain": least, "law": card.law.name if card.law else None,
            "fitted_law_strain": list(fitted) if fitted else None,
            "fitted_skin_strain": list(skin) if skin else None,
            **({"signal_share_extrapolated": share_extrapolated(scene, result.touches, card.conductivity)}
               if card.conductivity else {})}


# key of a mechanical output -> what it is called, its unit
MECHANICS = {"force_N": ("Force on the punch", "N"), "delta_max_mm": ("Depth of the punch face", "mm"),
             "sigma_max_kPa": ("Peak contact pressure, facet average", "kPa"),
             "sigma_ave_kPa": ("Mean contact pressure, force over contact area", "kPa"),
             "A_c_mm2": ("Contact area on the punch face", "mm²"),
             "wall_contact_mm2": ("Contact area on the side of the punch", "mm²")}
# key of an error estimate -> what it is the error of
ERRORS = {"signal": "signal", "depth": "depth", "sigma_max": "largest pressure", "A_c": "contact area",
          "strain": "surface strain"}


def mechanical(touch: Touch) -> dict[str, float]:
    """The mechanical outputs of one touch, units in their names."""
    return {"force_N": touch.force_N, "delta_max_mm": touch.depth_m * 1e3, "sigma_max_kPa": touch.sigma_max_Pa / 1e3,
            "sigma_ave_kPa": touch.sigma_ave_Pa / 1e3, "A_c_mm2": touch.contact_area_m2 * 1e6,
            "wall_contact_mm2": touch.wall_contact_m2 * 1e6}


def profile(touch: Touch, scene: AnyScene) -> dict[str, list[float]]:
    """Surface fields of a touch along the reference radius, out to the disc's radius, units in their names."""
    inside = touch.radius_m <= scene.body.size_m
    fields = {"radius_mm": touch.radius_m * 1e3, "u_r_mm": touch.u_r_m * 1e3, "u_z_mm": touch.u_z_m * 1e3,
              "pressure_kPa": touch.pressure_Pa / 1e3, "stretch_normal": touch.stretch_normal,
              "stretch_meridian": touch.stretch_meridian, "stretch_hoop": touch.stretch_hoop}
    return {name: np.asarray(values)[inside].tolist() for name, values in fields.items()}
