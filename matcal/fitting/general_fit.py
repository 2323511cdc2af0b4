"""Any law fitted to stress-strain curves by lmfit: least weighted squares over its parameters within their bounds.

Stresses are homogeneous in all moduli together, so that a law brings the ratios of its starts alone. Source: Newville
et al., lmfit, DOI 10.5281/zenodo.598352.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from matcal.fitting.hyperfoam.cross_prediction import alone_sentences, each_alone
from matcal.fitting.hyperfoam.curves import Curve, different_strains, weight_sentence, weighted_model, weighted_stress
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, with_ranges
from matcal.fitting.hyperfoam.variable_projection import Optimum
from matcal.laws.law import Law, moduli_of, scaled
from touchcal.arrays import Array
from touchcal.errors import NotConverged

if TYPE_CHECKING:
    from lmfit import Parameters

_NO_LAW = 1e6  # residual, in scales of the curves, where there is no such law or state
_AT_BOUND = 1e-6  # distance from a bound, over a parameter's size, up to which a parameter lies on it


def fit_law(curves: Sequence[Curve], kind: type[Law], given: Mapping[str, float], thorough: bool = True) -> Fit:
    """Long-term law of a kind with least weighted mean square residual over `curves`; `given`: parameters that are not
    fitted; thorough: each mode alone as well. ValueError for no curves, or fewer different strains than parameters."""
    start, curves = time.process_time(), tuple(curves)
    count = len(kind.parameters) - len(given)
    if not curves:
        raise ValueError("no stress-strain curve to fit: give a uniaxial, biaxial, planar, shear or volumetric file.")
    if count >= different_strains(curves):
        raise ValueError(f"{kind.name} has {count} parameters to fit but there are {different_strains(curves)} "
                         "different strains away from rest. Give more data.")
    law, found = _searched(curves, kind, given)
    free = [p.name not in given and not _at_bound(law, p.name, p.bounds) for p in kind.parameters]
    kept = [p.name for p, moves in zip(kind.parameters, free, strict=True) if not moves and p.name not in given]
    alone = each_alone(curves, lambda own: _searched(own, kind, given)[0]) if thorough else {}
    cost = float(np.sum(found.residual**2))
    return Fit(law, curves, Optimum(np.zeros(0), np.zeros(0), cost, (cost,), int(found.nfev)), (), (), alone,
               (weight_sentence(curves), _sentence(law, given, kept), *alone_sentences(curves, alone, exponents=False)),
               time.process_time() - start, moves=np.eye(len(free))[:, free], parameters=_errors(law, found),
               given=tuple(given))


def _searched(curves: tuple[Curve, ...], kind: type[Law], given: Mapping[str, float]) -> tuple[Law, Any]:
    import lmfit  # takes as long to import as all the rest

    stress = weighted_stress(curves)
    first: Law = kind(**{p.name: given.get(p.name, p.start) for p in kind.parameters})
    model = weighted_model(curves, first)
    first = scaled(first, max(float(model @ stress), 1e-9 * float(stress @ stress)) / float(model @ model))
    unit = _units(first)
    parameters = lmfit.Parameters()
    for p in kind.parameters:
        low, high = (end / unit[p.name] for end in p.bounds)
        parameters.add(p.name, getattr(first, p.name) / unit[p.name], vary=p.name not in given, min=low, max=high)

    def law_at(values: Parameters) -> Law:
        return kind(**{name: values[name].value * size for name, size in unit.items()})

    def miss(values: Parameters) -> Array:
        try:
            return weighted_model(curves, law_at(values)) - stress
        except (ValueError, NotConverged):
            return np.full(stress.size, _NO_LAW)

    with np.errstate(invalid="ignore", divide="ignore"):  # correlations where nothing is left to explain
        found: Any = lmfit.minimize(miss, parameters, method="least_squares", xtol=1e-12, ftol=1e-14, gtol=1e-14)
    for name, size in unit.items():
        found.params[name].user_data = size
    return with_ranges(law_at(found.params), curves), found


def _units(law: Law) -> dict[str, float]:
    """Parameter -> size in which it is searched: mu_0 of moduli, else 1."""
    return {p.name: law.mu_0_Pa if p.name in moduli_of(law) else 1.0 for p in law.parameters}


def _at_bound(law: Law, name: str, bounds: tuple[float, float]) -> bool:
    return min(abs(getattr(law, name) - end) for end in bounds) <= _AT_BOUND * _units(law)[name]


def _errors(law: Law, found: Any) -> dict[str, dict[str, float | None]]:
    """Parameter -> value and lmfit's standard error, None where it has none."""
    errors = {name: value.stderr * value.user_data if value.vary and value.stderr else None
              for name, value in found.params.items()}
    return {name: {"value": float(getattr(law, name)), "stderr": error} for name, error in errors.items()}


def _sentence(law: Law, given: Mapping[str, float], kept: Sequence[str]) -> str:
    said = f"The law is {law.name}, its parameters found by lmfit within their bounds"
    said += f", {', '.join(f'{name} = {value:g}' for name, value in given.items())} given" if given else ""
    return said + (f"; {', '.join(kept)} ended on a bound of the search." if kept else ".")
