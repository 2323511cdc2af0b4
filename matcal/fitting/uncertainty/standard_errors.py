"""Classical standard errors of the raw parameters, next to the intervals of derived quantities.

They take residuals as independent and the law as exact, and they are linear: read them as a warning about which
parameters a test can see at all, and read mu_0, E_0 and stresses from `matcal.fitting.uncertainty.intervals`. An
exponent that the fit keeps at a bound stays there; one at its least distance from the one before moves with it.
"""

import numpy as np

from matcal.fitting.hyperfoam.curves import weighted_design, weighted_model, weighted_stress
from matcal.fitting.hyperfoam.exponent_search import allowed_exponents
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array

# step of the central differences, in mu_0 and in exponents; least singular value over the largest that a test sees
_STEP, _SEEN = 1e-5, 1e-13


def standard_errors(fit: Fit) -> dict[str, dict[str, float | None]]:
    """{mu_0_Pa, mu_i_Pa, alpha_i: {value, stderr}}: roots of the diagonal of s^2 (J^T J)^-1 with J the derivative of
    the weighted residuals and s^2 their sum of squares over n - p; stderr None where nothing is seen or it is kept."""
    law, n = fit.law, fit.law.mu_Pa.size
    moves = _moves(fit)
    jacobian = np.column_stack([(_stress(fit, _STEP * m) - _stress(fit, -_STEP * m)) / (2 * _STEP) for m in moves])
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    size, right = np.linalg.svd(jacobian / scale, full_matrices=False)[1:]
    size[size <= _SEEN * size[0]] = np.nan
    misfit = np.linalg.norm(_stress(fit, np.zeros(2 * n)) - weighted_stress(fit.curves))
    spread = misfit / np.sqrt(len(jacobian) - len(moves)) * (moves.T / scale) @ right.T / size
    unit = np.r_[np.full(n, law.mu_0_Pa), np.ones(n), law.mu_0_Pa]
    sd = unit * np.linalg.norm(np.vstack([spread, spread[:n].sum(axis=0)]), axis=1)
    names = [f"{name}_{k}{si}" for name, si in (("mu", "_Pa"), ("alpha", "")) for k in range(1, n + 1)] + ["mu_0_Pa"]
    return {name: {"value": float(value), "stderr": float(error) if error > 0 else None}
            for name, value, error in zip(names, [*law.mu_Pa, *law.alpha, law.mu_0_Pa], sd, strict=True)}


def _stress(fit: Fit, move: Array) -> Array:
    """Weighted stresses (n,) of the law with its moduli, in units of mu_0, and its exponents moved by `move` (2 N,)."""
    law, n = fit.law, fit.law.mu_Pa.size
    mu, alpha = law.mu_Pa + law.mu_0_Pa * move[:n], law.alpha + move[n:]
    if np.ptp(law.nu) == 0:
        return weighted_design(fit.curves, alpha, float(law.nu[0])) @ mu
    return weighted_model(fit.curves, Hyperfoam(mu, alpha, law.nu))


def _moves(fit: Fit) -> Array:
    """Ways (m, 2 N) in which parameters may move: a modulus or exponent alone, or exponents that have merged together.
    """
    allowed, alpha, n = allowed_exponents(fit.curves, float(fit.law.nu.mean())), fit.law.alpha, fit.law.alpha.size
    free = (alpha > allowed.low + 1e-3) & (alpha < allowed.high - 1e-3)
    first = np.diff(alpha, prepend=-np.inf) >= 1.01 * allowed.gap
    group = np.cumsum(first) - 1
    together = (group == np.arange(first.sum())[:, None]).astype(float)[free[first]]
    return np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((len(together), n)), together]])
