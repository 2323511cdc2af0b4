"""Classical standard errors of the raw parameters, by lmfit, beside the intervals of derived quantities.

They take residuals as independent and the law as exact, and they are linear: read them as a warning about which
parameters a test can see at all, and read mu_0, E_0 and stresses from `matcal.fitting.uncertainty.intervals`. Exponents
that the fit keeps at a bound, or at their least distance from the one before, are kept there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from lmfit import Parameters, minimize

from matcal.fitting.hyperfoam.curves import weighted_design, weighted_model, weighted_stress
from matcal.fitting.hyperfoam.exponent_search import allowed_exponents
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.laws.hyperfoam import Hyperfoam


def standard_errors(fit: Fit) -> dict[str, dict[str, float | None]]:
    """{mu_0_Pa, mu_i_Pa, alpha_i: {value, stderr}} about the fit; stderr None where lmfit finds no covariance."""
    law, n = fit.law, fit.law.mu_Pa.size
    start = Parameters()
    for k, (mu, alpha) in enumerate(zip(law.mu_Pa, law.alpha, strict=True), 1):
        start.add(f"mu_{k}", value=mu / law.mu_0_Pa)
        start.add(f"alpha_{k}", **_exponent(fit, k - 1, float(alpha)))
    start.add("mu_0", expr=" + ".join(f"mu_{k}" for k in range(1, n + 1)))
    target = weighted_stress(fit.curves)

    def residual(p: Parameters) -> np.ndarray:
        mu = law.mu_0_Pa * np.array([p[f"mu_{k}"].value for k in range(1, n + 1)])
        alpha = np.array([p[f"alpha_{k}"].value for k in range(1, n + 1)])
        if np.ptp(law.nu) == 0:
            return weighted_design(fit.curves, alpha, float(law.nu[0])) @ mu - target
        return weighted_model(fit.curves, Hyperfoam(mu, alpha, law.nu)) - target

    found = minimize(residual, start, method="leastsq", max_nfev=200)
    known = found.errorbars  # pyright: ignore[reportAttributeAccessIssue]
    errors = {name: p.stderr if known else None
              for name, p in found.params.items()}  # pyright: ignore[reportAttributeAccessIssue]
    out = {"mu_0_Pa": _row(law.mu_0_Pa, errors["mu_0"], law.mu_0_Pa)}
    for k in range(1, n + 1):
        out[f"mu_{k}_Pa"] = _row(float(law.mu_Pa[k - 1]), errors[f"mu_{k}"], law.mu_0_Pa)
        out[f"alpha_{k}"] = _row(float(law.alpha[k - 1]), errors[f"alpha_{k}"], 1.0)
    return out


def _exponent(fit: Fit, k: int, value: float) -> dict[str, Any]:
    """How exponent k (from 0) may move: freely, with the one before, or not at all."""
    allowed, alpha = allowed_exponents(fit.curves, float(fit.law.nu.mean())), fit.law.alpha
    if k > 0 and alpha[k] - alpha[k - 1] < 1.01 * allowed.gap:
        return {"expr": f"alpha_{k} + {float(alpha[k] - alpha[k - 1])!r}"}
    return {"value": value, "vary": bool(allowed.low + 1e-3 < value < allowed.high - 1e-3)}


def _row(value: float, stderr: float | None, unit: float) -> dict[str, float | None]:
    known = stderr is not None and np.isfinite(stderr)
    return {"value": value, "stderr": float(stderr) * unit if known and stderr is not None else None}
