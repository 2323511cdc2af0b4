"""The error of a result: what is numerical of it, what the plan left out, and what misses the requested one."""

from collections.abc import Mapping

from eitsim.scene.results import Plan, Readings, Touch, of_strain


def error_budget(plan: Plan, numerical: Mapping[str, float], unplanned: Mapping[str, float] | None = None
                 ) -> dict[str, float]:
    """`numerical_errors`, with what the plan left out and what neighbours may change more than that."""
    return {key: value + (plan.strain_bound if key == "strain" else plan.error_bound)
            + (unplanned or {}).get(key, 0.0) for key, value in numerical.items()}


def numerical_errors(touches: tuple[Touch, ...], readings: Readings, strain: str) -> dict[str, float]:
    """Relative errors of the worst touch by what was solved, under a skin driven by this strain: "signal", its
    electrics added, and "depth", and "sigma_max", "A_c" and "strain" where every touch has them."""
    out = {"signal": max(of_strain(t.signal_errors, strain) for t in touches) + readings.signal_error,
           "depth": max(t.depth_error for t in touches)}
    for key, error_estimate in {"sigma_max": [t.sigma_max_error for t in touches],
                                "A_c": [t.contact_area_error for t in touches],
                                "strain": [None if t.strain_errors is None else of_strain(t.strain_errors, strain)
                                           for t in touches]}.items():
        known = [error for error in error_estimate if error is not None]
        if len(known) == len(error_estimate):
            out[key] = max(known)
    return out


def explain_excess(requested: float, error_estimate: float, numerical: float, plan: Plan) -> str:
    """What keeps the signal's error from the requested one, and what to write where the largest part of that does not
    hold; empty where nothing keeps it."""
    if error_estimate <= requested:
        return ""
    largest = max(plan.decisions, key=lambda d: d.error_bound)
    return (f"the signal's error may be {error_estimate:.3g}, more than the {requested:g} asked for (signal in "
            f"[accuracy]): {numerical:.3g} is numerical, {plan.error_bound:.3g} what the plan left out, most of that "
            f"\"{largest.decision}\".{largest.remedy and ' ' + largest.remedy}")
