"""Quantities that follow from draws of whole parameter sets: moduli, plateau, stresses in the tested modes."""

from collections.abc import Mapping

import numpy as np

from matcal.fitting.uncertainty.intervals import PLATEAU_STRAIN
from matcal.posterior.drawn_laws import moduli_of, stress_of
from matcal.posterior.draws import Draws
from touchcal.arrays import Array

_WATCHED = (0.3, 0.65, 1.0)  # shares of the fitted range at which stresses are watched


def derived_of(draws: Draws) -> dict[str, Array]:
    """mu_0_Pa, E_0_Pa, plateau_Pa; nu where it was sampled; with a series g_infinity and mu_0_instantaneous_Pa; with
    replicates the value for a new specimen, mu_0_new_specimen_Pa; with a skin c0_S_per_m and a_i; each
    (D,)."""
    out: dict[str, Array] = {}
    if len(draws) == 0:
        return out
    if draws.law:
        mu_0, E_0 = moduli_of(draws)
        out = {"mu_0_Pa": mu_0, "E_0_Pa": E_0, "plateau_Pa": -stress_of(draws, "uniaxial", [PLATEAU_STRAIN])[:, 0]}
        nu = draws.law.get("nu")
        if nu is not None and np.ptp(nu) > 0 and not np.any(np.ptp(nu, axis=1)):
            out["nu"] = nu[:, 0]
    if draws.g is not None:
        out["g_infinity"] = 1 - draws.g.sum(axis=1)
        if "mu_0_Pa" in out:
            out["mu_0_instantaneous_Pa"] = out["mu_0_Pa"] / out["g_infinity"]
    if draws.omega is not None and "mu_0_Pa" in out:
        same = np.random.default_rng(0).normal(size=draws.omega.size)  # the same numbers every time
        out["mu_0_new_specimen_Pa"] = out["mu_0_Pa"] * np.exp(draws.omega * same)
        out["omega"] = draws.omega
    if draws.conductivity_S_per_m is not None:
        c0, *rest = draws.conductivity_S_per_m.T
        out |= {"c0_S_per_m": c0, **{f"a_{k}": column / c0 for k, column in enumerate(rest, 1)}}
    return out


def watched(draws: Draws, ranges: Mapping[str, tuple[float, float]]) -> dict[str, Array]:
    """`derived_of` and the stresses at some strains of each fitted range, each (D,)."""
    out = derived_of(draws)
    for mode, (low, high) in ranges.items():
        rest = 1.0 if mode == "volumetric" else 0.0
        far = low if rest - low > high - rest else high
        strain = [rest + share * (far - rest) for share in _WATCHED]
        for e, column in zip(strain, stress_of(draws, mode, strain).T, strict=True):
            out[f"{mode} stress at {e:.3g}"] = column
    if draws.tau_s is not None:
        out |= {f"ln tau_{k + 1}": np.log(column) for k, column in enumerate(draws.tau_s.T)}
    return out
