"""The error of a result: what is numerical of it, what the plan left out, and what misses the requested one."""

from collections.abc import Mapping, Sequence

import numpy as np

from eitsim.scene.results import ConductorPart, Plan, Readings, Touch, of_strain
from touchcal.arrays import Array

_INSULATED = ConductorPart(1.0, 0.0, 0.0)
_CANCELS = 2.0  # how many times larger a part than the signal that it is said


def error_budget(plan: Plan, numerical: Mapping[str, float], unplanned: Mapping[str, float] | None = None,
                 readings: Readings | None = None) -> dict[str, float]:
    """`numerical_errors`, with what the plan left out and what neighbours may change more than that. Where the parts of
    skin and conducting punches nearly cancel in the readings, what the plan left out counts as much more."""
    bounds = {"signal": plan.error_bound * _grown(readings), "strain": plan.strain_bound}
    return {key: value + bounds.get(key, plan.error_bound) + (unplanned or {}).get(key, 0.0)
            for key, value in numerical.items()}


def _grown(readings: Readings | None) -> float:
    return readings.conductors.grown if readings is not None and readings.conductors is not None else 1.0


def numerical_errors(touches: tuple[Touch, ...], readings: Readings, strain: str) -> dict[str, float]:
    """Relative errors by what was solved, under a skin driven by this strain: "signal", its electrics, the ends of
    conducting punches' contacts and what the skin's law leaves open added, and of the worst touch "depth", and
    "sigma_max", "A_c" and "strain" where every touch has them."""
    part = readings.conductors or _INSULATED
    electric = part.end_error + readings.signal_error + readings.past_law
    out = {"signal": by_mechanics(touches, readings, strain) + electric,
           "depth": max(t.depth_error for t in touches)}
    for key, error_estimate in {"sigma_max": [t.sigma_max_error for t in touches],
                                "A_c": [t.contact_area_error for t in touches],
                                "strain": [None if t.strain_errors is None else of_strain(t.strain_errors, strain)
                                           for t in touches]}.items():
        known = [error for error in error_estimate if error is not None]
        if len(known) == len(error_estimate):
            out[key] = max(known)
    return out


def by_mechanics(touches: Sequence[Touch], readings: Readings, strain: str) -> float:
    """Relative error of dV by the touches' mechanics: sqrt(sum_ij e_i e_j |dV_i . dV_j|) / |dV| where it is known what
    part dV_i touches that were solved together, or one by itself, make of it, each off by e_i either way; else that of
    the worst touch. Touches' errors are of insulated punches, and count as much of dV as these make."""
    errors = [of_strain(touch.signal_errors, strain) for touch in touches]
    if readings.parts is None:
        return (readings.conductors or _INSULATED).insulated * max(errors)
    worst = np.array([max(errors[i] for i in group) for group in readings.parts.groups])
    return float(np.sqrt(worst @ readings.parts.overlaps @ worst))


def signal_overlaps(whole_V: Array, each_V: Sequence[Array]) -> Array:
    """(n, n) |dV_i . dV_j| / |dV|^2 of n parts of a signal, and of the signal, V."""
    parts = np.array([np.nan_to_num(signal_V).ravel() for signal_V in each_V])
    return np.abs(parts @ parts.T) / np.linalg.norm(np.nan_to_num(whole_V)) ** 2


def signal_change(one: Readings, other: Readings) -> float:
    """|dV - dV'| / |dV'| of two readings of one touched skin."""
    of, against = (np.nan_to_num(each.signal_V) for each in (one, other))
    return float(np.linalg.norm(of - against) / np.linalg.norm(against))


def explain_excess(requested: float, error_estimate: float, numerical: float, plan: Plan, readings: Readings) -> str:
    """What keeps the signal's error from the requested one, and what to write where the largest part of that does not
    hold; empty where nothing keeps it."""
    if error_estimate <= requested:
        return ""
    largest, part = max(plan.decisions, key=lambda d: d.error_bound), readings.conductors
    against = "" if part is None or part.grown <= _CANCELS else (
        f" Skin and conductor nearly cancel: without conducting the signal would be {part.insulated:.2g} times as "
        "large, and errors of either part count as much more.")
    past = "" if not readings.past_law else (
        f" Places where the skin's law is no longer positive leave {readings.past_law:.3g} of that open: press less, "
        "or measure the skin at larger strains.")
    left_out = plan.error_bound * _grown(readings)
    floor = "" if numerical < 1 else " The signal is below what is resolved here, and may as well be 0."
    return (f"the signal's error may be {error_estimate:.3g}, more than the {requested:g} asked for (signal in "
            f"[accuracy]): {numerical:.3g} is numerical, {left_out:.3g} what the plan left out, most of that "
            f"\"{largest.decision}\".{largest.remedy and ' ' + largest.remedy}{against}{past}{floor}")
