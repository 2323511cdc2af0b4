"""The `fit` part of a card: errors of every test, derived quantities, standard errors, orders, cross prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import stdtrit

from matcal.fitting.calibrate import FittedLaws, is_curve, labels
from matcal.fitting.conductivity_fit import ConductivityFit
from matcal.fitting.conductivity_laws import numbers_of
from matcal.fitting.hyperfoam.curves import Curve, of_mean_foam
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, relative_rms
from matcal.fitting.hyperfoam.next_specimen import of_modulus
from matcal.fitting.hyperfoam.poisson import NU_BOUNDS
from matcal.fitting.hyperfoam.specimen_factors import specimens
from matcal.fitting.law_choice import LawChoice
from matcal.fitting.relaxation.relaxation_fit import PronyFit
from matcal.fitting.relaxation.spectrum_fit import SpectrumFit
from matcal.fitting.uncertainty.intervals import OF_ONE_FORM, OF_THIS_LAW, Uncertainty
from matcal.fitting.uncertainty.standard_errors import standard_errors
from matcal.laws.conduction_laws import conduction_law
from matcal.laws.law import Law, values_of
from matcal.record.bands import share_inside
from matcal.reduction.experiment import CROSSED_S, Experiment

if TYPE_CHECKING:
    from matcal.posterior.draws import Draws

# how the facts of `matcal.reduction` begin that the card repeats: sizes, replicates, cycles
_REPEATED = ("sweeps", "loading", "specimen_", "stiffness_factor", "shape_scatter", "settling_", "resistance_",
             "residual_", "step_", "direction_", "table_", "clock_left_out", CROSSED_S, "loss_")
# fact of a table of moduli -> symbol of its instantaneous value
_MODULI = {"table_of_E": "E_0", "table_of_G": "G_0", "table_of_modulus": "modulus_0"}


def summary(found: FittedLaws, draws: Draws | None = None) -> dict[str, Any]:
    """Per experiment its errors and, by the draws if there are any, the share of it in the band; then whatever the
    calibration holds besides."""
    out: dict[str, Any] = {}
    for label, experiment in zip(labels(found.experiments), found.experiments, strict=True):
        out[label] = _of_test(found, label, experiment)
        if is_curve(experiment) and found.fit and found.uncertainty:
            out[label]["inside_band"] = share_inside(curve_of(found, label), found.fit.law, draws or found.uncertainty)
    if found.fit and found.uncertainty:
        out["derived"] = {n: {"value": i.value, "sd": i.sd, "lo": i.lo, "hi": i.hi, "sd_from_order": i.form}
                          for n, i in found.uncertainty.derived.items()}
        out["intervals"] = OF_THIS_LAW if found.fit.moves is None else OF_ONE_FORM
        out |= {"nu": _nu_part(found.fit, found.uncertainty)} if found.fit.moves is None else {}
        if found.two_nu is not None:
            out["nu"] |= {"by_lateral_strain": list(found.two_nu.lateral), "without": list(found.two_nu.other),
                          "contradicted": found.two_nu.contradict}
        if (other := found.uncertainty.other_nu) is not None:
            out["other_nu"] = {"parameters": values_of(other), "reach": found.uncertainty.reach}
        out["not_determined"] = list(found.uncertainty.not_determined)
        out["effective_points"] = found.uncertainty.effective_points
        if not found.uncertainty.ridges:  # about a fitted nu nothing is linear
            out |= {"covariance": found.uncertainty.covariance,
                    "neighbours": [values_of(law) for law in found.uncertainty.neighbours]}
        out |= _specimen_part(found, out)
        out |= _choice_part(found.choice) if found.choice else {}
        out |= _law_part(found.fit) | _comparison_part(found)
    if found.spectrum:
        out["prony"] = _spectral_part(found.spectrum, next(e for e in found.experiments if e.kind in ("dma", "creep")))
    if found.prony:
        own = _series_part(found.prony, [e for e in found.experiments if e.kind == "relaxation"])
        out["prony"] = _both_parts(own, out["prony"], found) if found.joint else own
    if (soft := found.softening) is not None:
        out["softening"] = {"sd": soft.sd, "interval": {n: list(ends) for n, ends in soft.interval.items()},
                            "relative_rms": list(soft.relative_rms), "lost": [list(pair) for pair in soft.lost],
                            "softest": soft.softest}
    if found.conductivity:
        out["conductivity"] = _skin_part(found.conductivity)
    return out


def _specimen_part(found: FittedLaws, tests: dict[str, Any]) -> dict[str, Any]:
    """Quantity -> its value, ends of the interval of the mean and of the next specimen; every replicate in `tests`
    gets the share of it that the others hold."""
    assert found.fit is not None
    assert found.uncertainty is not None
    if not found.next_specimens:
        return {}
    for one in found.next_specimens:
        for label, share in one.held.items():
            tests[label]["held_by_others"] = share
    mu_0, reach = found.uncertainty.derived["mu_0_Pa"], specimens(found.fit.curves, found.fit.law).reach
    rows = {"mu_0_Pa": of_modulus(mu_0.value, mu_0.lo, mu_0.hi, reach)}
    return {"next_specimen": rows | {n: row for one in found.next_specimens for n, row in one.rows().items()}}


def _choice_part(choice: LawChoice) -> dict[str, Any]:
    """What the tests were taken for, and every law that was compared: parameters, their covariance, and how it did."""
    out: dict[str, Any] = {"material": {"rubber": choice.kind.rubber, "decided": choice.kind.decided,
                                        "because": choice.kind.because, "by_shape": choice.kind.by_shape}}
    if choice.laws:
        out["laws"] = [
            {"law": row.law.name, "parameters": {p.name: getattr(row.law, p.name) for p in row.law.parameters},
             "covariance": row.covariance, "fitted": row.fitted, "predicted": row.predicted, "weight": row.weight,
             "unstable": list(row.lost), "left_open": list(row.left_open)} for row in choice.laws]
    if choice.deciding:
        out["deciding_test"] = {"mode": choice.deciding[0], "laws_differ_by": choice.deciding[1]}
    return out


def _nu_part(fit: Fit, uncertainty: Uncertainty) -> dict[str, Any]:
    """How the law got its nu, and what mu_0 would be if a stretched material kept its volume; where it was fitted, its
    values with their 95 % intervals and the bounds of the search, one number for all terms or a list of one a term."""
    kept = {} if not fit.kept_volume else {"nearly_incompressible": {
        "nu": list(fit.kept_volume), "mu_0_Pa": list(fit.kept_volume.values())}}
    if not uncertainty.nu:
        return {"how": fit.nu_how, **kept}
    values, ends = [i.value for i in uncertainty.nu], [[i.lo, i.hi] for i in uncertainty.nu]
    one = fit.nu_fitted == "fit"
    return {"how": fit.nu_how, "value": values[0] if one else values, "interval": ends[0] if one else ends,
            "bounds": list(NU_BOUNDS)}


def curve_of(found: FittedLaws, label: str) -> Curve:
    """The weighed curve of a test; the fit may have moved its strain zero."""
    assert found.fit is not None
    return next(c for c in found.fit.curves if c.label == label)


def _record_errors(curve: Curve) -> dict[str, float]:
    """What a record states of its own errors, those of the load as stress, and how long it took where its rate counts.
    """
    facts, out = curve.experiment.facts, {}
    area_m2 = facts.get("area_mm2", np.inf) * 1e-6
    known = {"strain_zero_sd": facts.get("strain_zero_sd", 0.0), "zero_sd_Pa": facts.get("zero_sd_Pa", 0.0),
             "drift_sd_Pa_per_s": facts.get("drift_sd_N_per_s", 0.0) / area_m2}
    if curve.kernel is not None and curve.experiment.time_s is not None:
        out["duration_s"] = float(np.ptp(curve.experiment.time_s))
    return out | {name: float(value) for name, value in known.items() if value > 0}


def _law_part(fit: Fit) -> dict[str, Any]:
    return {"parameters": dict(fit.parameters) or standard_errors(fit),
            "orders": [{"order": r.order, "rms": r.rms, "worst": r.worst, "bic": r.bic, "confluence": r.collinearity}
                       | ({} if r.nu is None else {"nu": r.nu}) for r in fit.orders],
            "cross_prediction": {mode: {**{p.name: getattr(alone.law, p.name) for p in alone.law.parameters},
                                        "relative_rms": dict(alone.relative_rms),
                                        "relative_rms_of": dict(alone.relative_rms_of), "unstable": alone.unstable}
                                 for mode, alone in fit.alone.items()}}


def _comparison_part(found: FittedLaws) -> dict[str, Any]:
    """What the records say about stability, what stability cost, and tests that were predicted; absent parts left out.
    """
    assert found.fit is not None
    out: dict[str, Any] = {"data_stability": [
        {"test": c.label, "criterion": c.criterion, "violated_strain": c.violated, "covered_strain": c.covered}
        for c in found.data_checks]}
    if (free := found.fit.free) is not None:
        out["without_stability"] = {"mu_Pa": free.mu_Pa, "alpha": free.alpha, "nu": free.nu,
                                    "relative_rms_of": {c.label: relative_rms(free, c) for c in found.fit.curves}}
    if found.predicted:
        out["predicted"] = [{"kind": p.curve.experiment.kind, "source": list(p.curve.experiment.source),
                             "n": p.curve.experiment.value.size, "strain_range": _range(p.curve.experiment),
                             "relative_rms": dict(p.relative_rms)} for p in found.predicted]
    return out


def _series_part(prony: PronyFit, relaxing: Sequence[Experiment]) -> dict[str, Any]:
    out = {"g_sd": prony.g_sd, "tau_sd_s": prony.tau_sd_s, "g_infinity_sd": prony.g_infinity_sd,
           "orders": [{"order": row.terms, "rms": row.rms, "bic": row.bic} for row in prony.orders],
           "slowest_s": {"value": prony.slowest.tau_s, "lo": prony.slowest.lo_s, "hi": prony.slowest.hi_s},
           "shortest_s": prony.bounds_s[0]}
    moduli = {}
    for k, experiment in enumerate(relaxing):
        for name, symbol in _MODULI.items():
            if name in experiment.facts:
                value, sd_Pa = prony.start_modulus(k)
                moduli[f"{symbol}_Pa"] = {"value": value, "sd": sd_Pa}
    return out | ({"instantaneous": moduli} if moduli else {})


def _both_parts(holds: dict[str, Any], sweep: dict[str, Any], found: FittedLaws) -> dict[str, Any]:
    """Of one series of holds and a dynamic test: the numbers of the series, all instantaneous moduli, times that either
    sees, and how each test was followed by its own series."""
    assert found.joint is not None
    relaxing = [(label, e) for label, e in zip(labels(found.experiments), found.experiments, strict=True)
                if e.kind == "relaxation"]
    last = [float(e.time_s[-1]) for _, e in relaxing if e.time_s is not None]
    names = (*(label for label, _ in relaxing), "storage", "loss")
    alone = dict(zip(names, found.joint.relative_rms_alone, strict=True))
    return sweep | holds | {
        "instantaneous": sweep.get("instantaneous", {}) | holds.get("instantaneous", {}),
        "seen_s": [sweep["seen_s"][0], max([sweep["seen_s"][1], *last])],
        "joint": {"disagree": found.joint.disagree, "relative_rms_alone": alone}}


def _spectral_part(fit: SpectrumFit, experiment: Experiment) -> dict[str, Any]:
    symbol = next((s for name, s in _MODULI.items() if name in experiment.facts), None)
    channels = ("storage", "loss") if experiment.kind == "dma" else ("compliance",)
    out: dict[str, Any] = {
        "g_sd": fit.g_sd, "g_infinity_sd": fit.g_infinity_sd, "seen_s": list(fit.bounds_s),
        "orders": [{"order": terms, "rms": rms, "bic": bic} for terms, rms, bic in fit.orders],
        "relative_rms": dict(zip(channels, fit.relative_rms, strict=True))}
    if np.any(fit.tau_sd_s):
        out["tau_sd_s"] = fit.tau_sd_s
    if symbol:
        out["instantaneous"] = {f"{symbol}_Pa": {"value": fit.modulus_Pa, "sd": fit.modulus_sd_Pa}}
    if (s := fit.shift) is not None:
        out["shift"] = {"temperature_K": s.temperature_K, "log10_a": s.log10_a, "sd": s.sd, "law_sd": s.law_sd,
                        "misfit_decades": s.misfit_decades, "gaps_K": list(s.gaps), "disagree_K": list(s.disagree)}
    return out


def _skin_part(skin: ConductivityFit) -> dict[str, Any]:
    """Standard errors and 95 % intervals of c_0 and of a, to first order in those of the coefficients b; what the bound
    that keeps the law positive moved them by is in them."""
    law, conducts = skin.law, conduction_law(skin.law.kind)
    free, size = numbers_of(conducts, skin.centre), law.a.size
    by_c0, by_a, scale = (law.c0_S_per_m, 0 * law.a, 1.0) if conducts.logarithmic else (1.0, -law.a, law.c0_S_per_m)
    slope = np.vstack([by_c0 * np.eye(1, 1 + size), np.column_stack([by_a, np.eye(size)]) / scale])
    own = np.sqrt(np.diag(slope @ skin.covariance @ slope.T))
    c0_sd = float(np.hypot(own[0], free[0] - law.c0_S_per_m))
    a_sd = np.hypot(own[1:], free[1:] / free[0] - law.a)
    reach = float(stdtrit(skin.effective_sample_size, 0.975))
    return {"chi_square": skin.chi_square, "freedom": skin.freedom, "c0_sd_S_per_m": c0_sd, "a_sd": a_sd,
            "c0_interval_S_per_m": [law.c0_S_per_m - reach * c0_sd, law.c0_S_per_m + reach * c0_sd],
            "a_interval": np.column_stack([law.a - reach * a_sd, law.a + reach * a_sd]),
            "zero_in_intervals": bool(np.any(skin.zero_covariance)),
            "laws": [asdict(row) for row in skin.compared]}


def _of_test(found: FittedLaws, label: str, experiment: Experiment) -> dict[str, Any]:
    k = int(label.rsplit("_", 1)[1]) - 1
    row: dict[str, Any] = {"kind": experiment.kind, "n": experiment.value.size, "weight": 1.0,
                           "unit": {"conductivity": "S/m", "creep": "1/Pa"}.get(experiment.kind, "Pa"),
                           "source": list(experiment.source), "strain_range": _range(experiment)}
    row |= {name: value for name, value in experiment.facts.items() if name.startswith(_REPEATED)}
    row |= {"layout": experiment.layout} if experiment.layout else {}
    row |= {"standards": list(experiment.standards)} if experiment.standards else {}
    if is_curve(experiment) and found.fit:
        curve = curve_of(found, label)
        row |= _errors(curve.experiment.value, relative_rms(found.fit.law, of_mean_foam(curve)))
        row |= {"rms_at_least_stress": _at_least_stress(curve, found.fit.law), "weight": curve.weight,
                "record": _record_errors(curve)}
        if found.series:
            row |= {"rate_corrected": curve.kernel is not None}
        if curve.factor != 1:
            row |= {"specimen_factor": curve.factor, "relative_rms_of_specimen": relative_rms(found.fit.law, curve)}
    elif experiment.kind == "relaxation" and found.prony:
        row |= _errors(experiment.value, found.prony.relative_rms[k])
        row |= {"compared": "hold", "time_s": float(experiment.time_s[-1]) if experiment.time_s is not None else None}
        if found.prony.holds[k].shape == "law":
            row |= {"stiffness_over_law": found.prony.amplitude[k] * found.prony.prony.g_infinity}
    elif experiment.kind in ("dma", "creep") and found.spectrum:
        row |= _errors(experiment.value, found.spectrum.relative_rms[0])
        if experiment.time_s is not None:
            row |= {"time_s": float(experiment.time_s[-1])}
    elif experiment.kind == "conductivity" and found.conductivity:
        row |= _errors(experiment.value, found.conductivity.relative_rms[k])
    return row


def _errors(value: np.ndarray, relative: float) -> dict[str, float | None]:
    square, variance = float(np.mean(value**2)), float(np.var(value))
    return {"rms": relative * np.sqrt(square), "relative_rms": relative,
            "r2": 1 - relative**2 * square / variance if variance > 0 else None}


def _at_least_stress(curve: Curve, law: Law) -> float:
    """Root mean square residual, Pa, of the quarter of the points with the least stress, which the load cell limits."""
    stress = curve.experiment.value
    least = np.argsort(np.abs(stress))[:max(stress.size // 4, 1)]
    return float(np.sqrt(np.mean((stress - curve.model(law))[least] ** 2)))


def _range(experiment: Experiment) -> list[float]:
    return [float(experiment.strain.min()), float(experiment.strain.max())]
