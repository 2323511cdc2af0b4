"""Effective draws per CPU second: the marginalised sampler against lmfit's emcee and plain emcee on raw parameters.

Run by `make bench`, which pins threads; writes results/sampler.csv next to this file. Same data (the synthetic plain
files, three terms), same likelihood (independent noise, as many effective points), for the other methods the CPU time
of ours and SHARES of it.
Raw parameters are scaled to the fit and started in a small ball about it, which is kinder than a blind start.
"""

import time
import warnings
from pathlib import Path

import arviz
import emcee
import lmfit
import numpy as np
import pandas as pd
from conditions import quick, shown, written

from matcal.fitting.hyperfoam.curves import weigh, weighted_design, weighted_stress
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, allowed_exponents, fit
from matcal.fitting.uncertainty.intervals import Uncertainty, linearised
from matcal.posterior.derived_quantities import derived_of
from matcal.posterior.sample import sample
from matcal.reduction.reduce import reduce_tests

HERE = Path(__file__).parent
RAW = HERE.parent / "data_raw"
WALKERS, CHUNK = 32, 100
# CPU time of each other method over ours
SHARES = quick((0.3, 1.0, 3.0), (1.0,))


def data() -> tuple[Fit, Uncertainty]:
    curves = weigh(reduce_tests([("uniaxial", (RAW / "uniaxial.csv",)), ("shear", (RAW / "shear.csv",))]))
    found = fit(curves, 3)
    return found, linearised(found)


def log_density(found: Fit, points: float, x: np.ndarray) -> float:
    """Raw parameters (mu_i/mu_0, alpha_i, ln sigma) under the prior of the marginalised sampler."""
    n = found.law.alpha.size
    mu, alpha, allowed = x[:n], x[n:2 * n], allowed_exponents(found.curves)
    if (alpha[0] < allowed.low or alpha[-1] > allowed.high or np.any(np.diff(alpha) < allowed.gap) or mu.sum() <= 0
            or abs(x[-1]) > 20):
        return -np.inf
    miss = weighted_design(found.curves, alpha, 0.0) @ mu * found.law.mu_0_Pa - weighted_stress(found.curves)
    return float(-points * x[-1] - 0.5 * points * (miss @ miss) * np.exp(-2 * x[-1]) - 0.5 * np.sum((mu / 100) ** 2))


def start(found: Fit) -> np.ndarray:
    law = found.law
    return np.r_[law.mu_Pa / law.mu_0_Pa, law.alpha, 0.5 * np.log(found.optimum.cost)]


def ours(found: Fit, uncertainty: Uncertainty) -> tuple[dict, float]:
    begun = time.process_time()
    drawn = sample(found, uncertainty, None, None, seed=0)
    spent = time.process_time() - begun
    mu_0 = derived_of(drawn.draws)["mu_0_Pa"]
    return {"method": "matcal, moduli marginalised", "rhat_mu_0": drawn.quantities["mu_0_Pa"]["rhat"],
            "rhat_worst": drawn.checks["rhat"], "ess_mu_0": drawn.quantities["mu_0_Pa"]["ess"],
            "ess_worst": drawn.checks["ess"], "mu_0_Pa": np.median(mu_0), "sd_mu_0_Pa": mu_0.std(),
            "cpu_s": spent}, spent


def plain(found: Fit, points: float, budget_s: float) -> dict:
    """emcee's default moves on the raw parameters, two ensembles."""
    rng = np.random.default_rng(0)
    centre, chains, begun = start(found), [], time.process_time()
    for _ in range(2):
        sampler = emcee.EnsembleSampler(WALKERS, centre.size, lambda x: log_density(found, points, x))
        state = emcee.State(centre + 1e-3 * rng.normal(size=(WALKERS, centre.size)))
        own = time.process_time()
        while time.process_time() - own < budget_s / 2:
            state = sampler.run_mcmc(state, CHUNK, skip_initial_state_check=True)
        chains.append(sampler.get_chain(discard=sampler.iteration // 3))
    return _row("emcee, raw parameters", chains, found, time.process_time() - begun)


def by_lmfit(found: Fit, points: float, budget_s: float) -> dict:
    """lmfit.Minimizer.emcee on the raw parameters, weighted residuals and its own noise parameter, two runs."""
    n, unit, target = found.law.alpha.size, found.law.mu_0_Pa, weighted_stress(found.curves)
    allowed, centre = allowed_exponents(found.curves), start(found)
    parameters = lmfit.Parameters()
    for k in range(n):
        parameters.add(f"mu_{k}", centre[k], min=-300, max=300)
        parameters.add(f"alpha_{k}", centre[n + k], min=allowed.low, max=allowed.high)
    parameters.add("__lnsigma", centre[-1], min=-20, max=0)
    scale = np.sqrt(target.size / points)

    def residual(p: lmfit.Parameters) -> np.ndarray:
        mu, alpha = (np.array([p[f"{name}_{k}"].value for k in range(n)]) for name in ("mu", "alpha"))
        return (weighted_design(found.curves, alpha, 0.0) @ mu * unit - target) * np.sqrt(target.size) / scale

    def run(steps: int, seed: int) -> np.ndarray:
        out = lmfit.Minimizer(residual, parameters).emcee(steps=steps, nwalkers=WALKERS, burn=steps // 3, seed=seed,
                                                          is_weighted=False, progress=False)
        return np.asarray(out.chain)

    begun = time.process_time()
    run(30, 0)
    steps = max(60, int(budget_s / 2 / ((time.process_time() - begun) / 30)))
    begun = time.process_time()
    chains = [run(steps, seed)[..., [0, 2, 4, 1, 3, 5, 6]] for seed in (1, 2)]
    return _row("lmfit emcee, raw parameters", chains, found, time.process_time() - begun)


def _row(method: str, chains: list[np.ndarray], found: Fit, spent: float) -> dict:
    """Checks over ensembles, as the marginalised sampler has them: whole ensembles against each other."""
    length = min(len(c) for c in chains)
    stacked = np.stack([c[-length:] for c in chains])
    n = found.law.alpha.size
    mu_0 = stacked[..., :n].sum(axis=-1) * found.law.mu_0_Pa
    values = {"mu_0": mu_0, **{f"x_{k}": stacked[..., k] for k in range(stacked.shape[-1])}}
    rhat = {name: float(np.asarray(arviz.rhat(v.reshape(len(chains), -1)))) for name, v in values.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        times = {name: max(float(emcee.autocorr.integrated_time(e[..., None], tol=0, has_walkers=True)[0]) for e in v)
                 for name, v in values.items()}
    ess = {name: mu_0.size / max(t, 1.0) for name, t in times.items()}
    return {"method": method, "rhat_mu_0": rhat["mu_0"], "rhat_worst": max(rhat.values()), "ess_mu_0": ess["mu_0"],
            "ess_worst": min(ess.values()), "mu_0_Pa": float(np.median(mu_0)), "sd_mu_0_Pa": float(mu_0.std()),
            "cpu_s": spent, "autocorrelation_steps": max(times.values()), "steps": length}


def main() -> None:
    found, uncertainty = data()
    first, budget = ours(found, uncertainty)
    points = uncertainty.effective_points
    others = [by(found, points, share * budget) for share in SHARES for by in (plain, by_lmfit)]
    table = pd.DataFrame([first, *others])
    table["mean_error_over_sd"] = table["ess_worst"] ** -0.5
    table["ess_mu_0_per_cpu_s"] = table["ess_mu_0"] / table["cpu_s"]
    table["ess_worst_per_cpu_s"] = table["ess_worst"] / table["cpu_s"]
    shown(written(table, "sampler", 5))


if __name__ == "__main__":
    main()
