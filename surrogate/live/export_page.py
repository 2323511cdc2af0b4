"""The page as one file: the learned map in the browser presses the skin and is inverted there, without a server."""

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from surrogate.forward_map import electrode_correction, multipole_series, polarization, rim_correction, rim_zone
from surrogate.forward_map.forward_map import ForwardMap, strength_discrepancy
from surrogate.forward_map.inversion import changed_contacts
from surrogate.forward_map.inversion.multipole_location import (
    BACK,
    MARGIN,
    MARGIN_MM,
    RIM,
    least_from_edges_mm,
    spiral,
)
from surrogate.live.controls import Limits
from surrogate.live.messages import hello
from surrogate.live.skins import limits_of, usual_noise_V
from surrogate.live.whole_page import page_with
from surrogate.model.assumed_punch import of_trained_profile
from surrogate.model.predict import WEAK
from surrogate.model.simulated.touch_map import forward_of
from surrogate.model.sweep_model import SweepModel
from surrogate.model.trained import interval_scale
from surrogate.statistics.conformal import COVERAGE, normal
from surrogate.statistics.gaussian_process import GaussianProcess
from touchcal.whole_file import written

MOST_BYTES = 5_000_000  # largest file that is written
# Candidate places of a touch, and places and loads whose strengths' errors are averaged.
CANDIDATES, SAMPLED = 400, 64
# Part of a disc's radius from its rim within which no press is made: errors of the map there go together, which the
# browser's reader does not count, and places differ from those of `predict` by millimetres.
RIM_LEFT = 0.15
UNFLAGGED = "another punch is not flagged on this page"
MISFIT_FACTOR = 3.0  # misfit over the worst validation row's from which the page calls a frame unlike a touch


def export_page(model: SweepModel, path: Path | str) -> None:
    """Write one HTML file in which presses are made by a forward model's learned map S = f(x, y, log d, g) and read by
    Gauss-Newton on it, with no server and no network.

    Parameters
    ----------
    model : SweepModel
        Of the method forward, with the outputs x0, y0, d and F.
    path : path
        File to write, at most MOST_BYTES.

    Raises
    ------
    ValueError
        For another method or other outputs, or where the map is too large.

    Examples
    --------
    >>> export_page(surrogate.load("model"), "page.html")
    """
    model = of_trained_profile(model)
    greeting = hello(model, pressable(model), "exported", usual_noise_V(model))
    data = {"hello": greeting | {"assumes": f"{greeting['assumes']}; {UNFLAGGED}"}, "map": document(model)}
    text = page_with(json.dumps(data, allow_nan=False)).encode()
    if len(text) > MOST_BYTES:
        raise ValueError(f"the page would have {len(text) / 1e6:.1f} MB, at most {MOST_BYTES / 1e6:g} are written. "
                         "Train on fewer scenes.")
    with written(Path(path)) as file:
        file.write(text)


def pressable(model: SweepModel) -> Limits:
    """What may be pressed on the page: what was trained, but of a disc nothing within RIM_LEFT of its rim."""
    limits = limits_of(model)
    if model.ring.sheet is not None:
        return limits
    return replace(limits, gap_mm=max(limits.gap_mm, RIM_LEFT * model.ring.radius_mm))


def document(model: SweepModel) -> dict[str, Any]:
    """A forward model's map and what inverting it needs, as JSON; arrays as base64 of little-endian numbers."""
    forward = forward_of(model)
    ring, places = forward.ring, spiral(forward, SAMPLED)
    unknown = np.column_stack([places, np.tile(forward.mean[2:], (SAMPLED, 1))])
    k, scale = [model.names.index(name) for name in ("x0", "y0", "d", "F")], interval_scale(model)
    return {
        "ring": {"radius_mm": ring.radius_mm, "origin_mm": ring.origin_mm.tolist(),
                 "angle_rad": _packed(ring.angle_rad), "copies": float(ring.copies)} | {
            name: getattr(ring, name).tolist() for name in ("source", "sink", "read", "ground")},
        "sheet": _sheet(forward),
        "field": _packed(forward.field), "orders": multipole_series.ORDERS, "interior": forward.interior,
        "size": {"centre": _packed(forward.size.centre), "weights": _packed(forward.size.weights)},
        "strengths": [_process(one) for one in forward.strengths],
        "strength_sd": np.median(strength_discrepancy(forward, unknown), axis=0).tolist(),
        "high_end": None if ring.sheet is not None and forward.near_edges is None else list(forward.zones.high_end),
        "kept_orders": rim_zone.ORDERS, "zone": list(forward.zones.learned),
        "p0": forward.p0, "floor": forward.floor, "shift_mm": forward.shift_mm, "mean": forward.mean.tolist(),
        "sd": forward.sd.tolist(), "bounds": forward.bounds.tolist(), "margin_mm": MARGIN_MM, "margin": MARGIN,
        "most_radius": RIM, "candidates": _packed(spiral(forward, CANDIDATES)),
        "rim": _rim(forward) if rim_correction.teaches(forward.correction) else None,
        "contacts": _contacts(forward),
        "weakest_V": WEAK * model.trained.weakest_V, "misfit": MISFIT_FACTOR * max(model.trained.misfit, 1.0),
        "interval": np.maximum(scale.factor[:, k], normal(COVERAGE)).tolist(),
        "unsure_from": np.minimum(scale.edge[k], np.finfo(float).max).tolist(),
        "normal": normal(COVERAGE), "ellipse": float(np.sqrt(-2 * np.log1p(-COVERAGE)))}


def _contacts(forward: ForwardMap) -> dict[str, Any] | None:
    """Unit directions in which a changed contact moves the readings; None on a skin with an outline."""
    along = changed_contacts.directions(forward.ring)
    return {"directions": [_packed(one / np.linalg.norm(one)) for one in along.T], "changed": changed_contacts.CHANGED,
            "most": changed_contacts.FAR * changed_contacts.CHANGED} if along.size else None


def _sheet(forward: ForwardMap) -> dict[str, Any] | None:
    """Poles of the fields of a skin with an outline, and how far from its edges touches are sought, mm."""
    sheet = forward.ring.sheet
    if sheet is None:
        return None
    return {"pole": _packed(sheet.pole.view(np.float64)),
            "strength": _packed(np.ascontiguousarray(sheet.strength).view(np.float64)),
            "least_mm": least_from_edges_mm(forward), "back": BACK}


def _process(process: GaussianProcess) -> dict[str, Any]:
    return {"nodes": _packed(process.nodes), "centre": _packed(process.centre), "lengths": _packed(process.lengths),
            "weights": _packed(process.amplitude**2 * process.weights), "trend": _packed(process.trend)}


def _rim(forward: ForwardMap) -> dict[str, Any]:
    """What an edge adds: the skin's answer, on a disc what electrodes add, and how large the error is."""
    fitted = forward.correction
    answer, metal, error = fitted.polarization, fitted.rim, fitted.error
    return {
        "replaces": bool(fitted.replaces), "step": fitted.step if np.isfinite(fitted.step) else None,
        "answer": {name: _packed(getattr(answer, name)) for name in ("nodes", "centre", "lengths", "weights")},
        "answer_soft": polarization.SOFT, "answer_orders": polarization.orders_of(answer.weights.shape[1]),
        "metal": None if not electrode_correction.teaches(metal) else {
                  "turn": [[one.real, one.imag] for one in metal.symmetry.turn.tolist()],
                  "mirrored": metal.symmetry.mirrored.tolist(), "directions": _packed(metal.directions, "<f4"),
                  "components": metal.directions.shape[2], "nodes": _packed(metal.process.nodes),
                  "lengths": _packed(metal.process.lengths), "weights": _packed(metal.process.weights)},
        "shared": metal.directions.shape[2] or error.directions,
        "metal_soft": electrode_correction.SOFT, "along": electrode_correction.ALONG,
        "error": {name: getattr(error, name).tolist() for name in ("gap", "load", "error")}}


def _packed(values: ArrayLike, kind: str = "<f8") -> dict[str, str]:
    return {"kind": kind, "base64": base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()}
