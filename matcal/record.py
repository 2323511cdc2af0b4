"""What a calibration leaves behind: the card, and beside it a folder with the reduced tests and their fitted curves.

The folder (card.json -> card.d) holds KIND_i.parquet for every test, with strain, the measured value, time_s where
the test has a clock, fit_* for the fitted law along the test's own history and, for stress, longterm_* for the law
without rate effects; decisions.json, label -> sentences; and posterior.nc where a posterior was sampled.
"""

from __future__ import annotations

import hashlib
import platform
import shutil
import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from matcal.calibrate import Calibration, is_curve, labels
from matcal.card import MaterialCard, write_card, write_json
from matcal.conductivity import conductivity
from matcal.curves import Curve
from matcal.draws import FILE, law_of, write_draws
from matcal.experiment import Experiment
from matcal.fit import modelled, relative_rms
from matcal.modes import nominal_stress
from matcal.stability import stability
from matcal.standard_errors import standard_errors
from matcal.uncertainty import derived_quantities

if TYPE_CHECKING:
    from matcal.posterior import Posterior

_PACKAGES = ("touchcal", "numpy", "scipy", "lmfit", "emcee", "arviz")


def make_card(found: Calibration, out: Path, files: Sequence[Path], seed: int,
              posterior: Posterior | None = None) -> MaterialCard:
    """The card of a calibration from `files`, to be written to `out`."""
    law = found.fit.law if found.fit else None
    decisions = [s for label, e in zip(labels(found.experiments), found.experiments, strict=True)
                 for s in (f"{label}: {d}" for d in e.decisions)]
    spent = dict(found.cpu_s) | ({"posterior": posterior.checks["cpu_s"]} if posterior else {})
    provenance = {"files": [{"name": p.name, "sha256": hashlib.sha256(p.read_bytes()).hexdigest()} for p in files],
                  "versions": {"python": platform.python_version()} | {p: version(p) for p in _PACKAGES},
                  "synthetic": any("synthetic" in d.lower() for d in decisions), "seed": seed,
                  "date": datetime.now(UTC).isoformat(timespec="seconds"),
                  "decisions": [*decisions, *found.decisions], "cpu_s": spent}
    return MaterialCard(out.stem, law, found.prony.prony if found.prony else None,
                        found.conductivity.law if found.conductivity else None, fit=_fit_part(found),
                        stability=stability(law) if law else {}, provenance=provenance, data=folder_of(out).name,
                        posterior=_posterior_part(posterior, folder_of(out).name) if posterior else {})


def write_record(card: MaterialCard, found: Calibration, out: Path, posterior: Posterior | None = None) -> Path:
    """Write the card to `out` and its folder beside it; what stood there before stays whole until both are ready."""
    folder = folder_of(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(dir=out.parent, prefix=folder.name, suffix=".part"))
    try:
        write_card(card, fresh / out.name)
        (fresh / "data").mkdir()
        _write_folder(found, posterior, fresh / "data")
        if folder.exists():
            shutil.rmtree(folder)
        (fresh / "data").rename(folder)
        (fresh / out.name).replace(out)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return folder


def _write_folder(found: Calibration, posterior: Posterior | None, folder: Path) -> None:
    tests = list(zip(labels(found.experiments), found.experiments, strict=True))
    for label, experiment in tests:
        _table(found, label, experiment).to_parquet(folder / f"{label}.parquet", index=False)
    write_json({label: list(e.decisions) for label, e in tests}, folder / "decisions.json")
    if posterior is not None:
        write_draws(posterior.draws, folder / FILE)


def folder_of(card: Path) -> Path:
    """card.json -> card.d; ValueError for a card that would be called like its folder."""
    if card.suffix == ".d":
        raise ValueError(f"{card}: the ending .d is that of the folder beside a card. Call the card {card.stem}.json.")
    return card.with_suffix(".d")


def _table(found: Calibration, label: str, experiment: Experiment) -> pd.DataFrame:
    if experiment.kind == "conductivity" and found.conductivity:
        law = found.conductivity.law
        columns = {"strain": experiment.strain, "conductivity_S_per_m": experiment.value,
                   "fit_conductivity_S_per_m": conductivity(law, experiment.strain)}
    elif is_curve(experiment) and found.fit:
        curve = _curve(found, label)
        columns = {"strain": curve.experiment.strain, "stress_Pa": curve.experiment.value,
                   "fit_stress_Pa": modelled(found.fit.law, curve),
                   "longterm_stress_Pa": nominal_stress(found.fit.law, experiment.kind, curve.experiment.strain)}
    else:
        columns = {"strain": experiment.strain, "stress_Pa": experiment.value}
        if found.prony:
            columns["fit_stress_Pa"] = found.prony.stress_Pa[int(label.rsplit("_", 1)[1]) - 1]
    if experiment.time_s is not None:
        columns["time_s"] = experiment.time_s
    return pd.DataFrame(columns)


def _curve(found: Calibration, label: str) -> Curve:
    assert found.fit is not None
    return next(c for c in found.fit.curves if c.label == label)


def _fit_part(found: Calibration) -> dict[str, Any]:
    """Per experiment its errors; then derived quantities, standard errors, orders tried and cross prediction."""
    out: dict[str, Any] = {}
    for label, experiment in zip(labels(found.experiments), found.experiments, strict=True):
        out[label] = _goodness(found, label, experiment)
    if found.fit and found.uncertainty:
        out["derived"] = {n: {"value": i.value, "sd": i.sd, "lo": i.lo, "hi": i.hi, "sd_from_order": i.form}
                          for n, i in found.uncertainty.derived.items()}
        out["parameters"] = standard_errors(found.fit)
        out["orders"] = [{"order": r.order, "rms": r.rms, "bic": r.bic, "confluence": r.confluence}
                         for r in found.fit.orders]
        out["cross_prediction"] = {
            mode: {"mu_Pa": alone.law.mu_Pa, "alpha": alone.law.alpha, "nu": alone.law.nu,
                   "relative_rms": dict(alone.relative_rms)} for mode, alone in found.fit.alone.items()}
    if found.prony:
        sd = np.sqrt(np.diag(found.prony.covariance))
        terms = found.prony.prony.g.size
        out["prony"] = {"g_sd": sd[:terms], "tau_sd_s": sd[terms:]}
    if found.conductivity:
        c = found.conductivity
        out["conductivity"] = {"chi_square": c.chi_square, "freedom": c.freedom,
                               "coefficient_sd_S_per_m": np.sqrt(np.diag(c.covariance))}
    return out


def _posterior_part(posterior: Posterior, folder: str) -> dict[str, Any]:
    draws = posterior.draws
    values = [derived_quantities(law_of(draws, k)) for k in range(len(draws))]
    derived = {}
    for name in values[0]:
        column = np.array([v[name] for v in values])
        lo, middle, hi = np.quantile(column, [0.025, 0.5, 0.975])
        derived[name] = {"median": middle, "sd": column.std(), "lo": lo, "hi": hi}
    return {"file": f"{folder}/{FILE}", "n": len(draws), "checks": dict(posterior.checks), "prior": posterior.prior,
            "derived": derived}


def _goodness(found: Calibration, label: str, experiment: Experiment) -> dict[str, Any]:
    k = int(label.rsplit("_", 1)[1]) - 1
    row: dict[str, Any] = {"kind": experiment.kind, "n": experiment.value.size, "weight": 1.0,
                           "unit": "S/m" if experiment.kind == "conductivity" else "Pa",
                           "source": list(experiment.source), "strain_range": _range(experiment)}
    if is_curve(experiment) and found.fit:
        curve = _curve(found, label)
        share = relative_rms(found.fit.law, curve)
        row |= _errors(curve.experiment.value, share) | {"weight": curve.weight}
    elif experiment.kind == "relaxation" and found.prony:
        row |= _errors(experiment.value, found.prony.relative_rms[k])
        row |= {"compared": "hold", "stiffness_over_law": found.prony.amplitude[k] * found.prony.prony.g_infinity}
    elif experiment.kind == "conductivity" and found.conductivity:
        row |= _errors(experiment.value, found.conductivity.relative_rms[k])
    return row


def _errors(value: np.ndarray, relative: float) -> dict[str, float | None]:
    square, variance = float(np.mean(value**2)), float(np.var(value))
    return {"rms": relative * np.sqrt(square), "relative_rms": relative,
            "r2": 1 - relative**2 * square / variance if variance > 0 else None}


def _range(experiment: Experiment) -> list[float]:
    return [float(experiment.strain.min()), float(experiment.strain.max())]
