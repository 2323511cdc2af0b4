"""Do 95 % intervals cover? Fresh noise on synthetic truths, again and again: share covered, width against true spread.

Run by `make bench` with 100 replicas a case (some 15 CPU minutes), or by hand with REPLICAS [CASE ...];
`20 plain machine --posterior` does the same for the intervals of the sampled posterior. Writes
results/coverage.csv next to this file. Cases:

plain       the plain files of data_raw, six-term truth, fitted by BIC
machine     its load-frame files through the whole reduction, with relaxation; gap, load zero and drift drawn anew
correlated  plain, noise of correlation 0.9 from point to point
order       plain, two terms asked for where three are needed
other       a separable foam that is no hyperfoam of any order (knee by tanh, densification by a rational term)
"""

import argparse
import importlib.util
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written

from matcal.fitting.calibrate import FittedLaws, calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.uncertainty.intervals import PLATEAU_STRAIN, intervals
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.derived_quantities import derived_of, stress_of
from matcal.posterior.sample import sample
from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import NotConverged

HERE = Path(__file__).parent
RAW = HERE.parent / "data_raw"
STRESSES = {"uniaxial": (-0.1, -0.3, -0.6, -0.75), "shear": (0.1, 0.5, 0.95), "biaxial": (-0.3,), "planar": (-0.3,),
            "volumetric": (0.6,)}
CASES = ("plain", "machine", "correlated", "order", "other")
# kPa: slope at rest, stress at the knee and its strain, stress of densification
E_0, KNEE, DENSE = 20e3, 0.3, 1e3
Truth = Callable[[str, float], float]


def generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("generate", RAW / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def of_law(law: Hyperfoam) -> dict[str, float]:
    """Every quantity that is watched."""
    return _named(law.mu_0_Pa, law.E_0_Pa, lambda mode, e: float(nominal_stress(law, mode, e)))


def other_stress(mode: str, e: float | np.ndarray) -> np.ndarray:
    """Nominal stress, Pa, of the separable foam W = sum w(lambda_k), w' = p."""
    def p(stretch: np.ndarray) -> np.ndarray:
        x = stretch - 1
        return E_0 * KNEE * np.tanh(x / KNEE) + DENSE * x**3 / stretch**2

    e = np.asarray(e, dtype=float)
    if mode == "shear":
        x = np.arcsinh(e / 2)
        return (np.exp(x) * p(np.exp(x)) - np.exp(-x) * p(np.exp(-x))) / (2 * np.sqrt(1 + e**2 / 4))
    return p(np.cbrt(e)) / np.cbrt(e) ** 2 if mode == "volumetric" else p(1 + e)


def replica(case: str, seed: int, generate: ModuleType) -> tuple[FittedLaws, dict[str, float]]:
    """One calibration of fresh data and the truth behind them."""
    rng = np.random.default_rng([CASES.index(case), seed])
    truth = of_law(Hyperfoam(1e3 * generate.MU, generate.ALPHA, np.zeros(generate.MU.size)))
    if case == "machine":
        return calibrate(_machine_tests(generate, rng)), truth
    if case == "other":
        strains = {"uniaxial": -np.arange(1, 81) / 100, "shear": np.arange(1, 51) / 50}
        curves = {kind: (e, other_stress(kind, e)) for kind, e in strains.items()}
        truth = _named(E_0 / 2, E_0, lambda mode, e: float(other_stress(mode, e)))
    else:
        curves = {kind: (e, 1e3 * p) for kind, (e, p) in generate.step_and_hold().items()}
    noise = 1e3 * generate.ERRORS["plain_noise_kPa"]
    tests = [Experiment(kind, e, p + noise * _noise(e.size, 0.9 if case == "correlated" else 0.0, rng))
             for kind, (e, p) in curves.items()]
    return calibrate(tests, FitOptions(order=2 if case == "order" else "auto")), truth


def linear(found: FittedLaws, truth: Mapping[str, float], case: str, seed: int) -> list[dict]:
    """Rows of the linearised intervals."""
    assert found.uncertainty is not None
    assert found.fit is not None
    out = intervals(found.uncertainty, of_law)
    return [{"case": case, "method": "linearised", "seed": seed, "quantity": name, "truth": truth[name],
             "value": i.value, "sd": i.sd, "covered": i.lo < truth[name] < i.hi, "width": i.hi - i.lo,
             "order": found.fit.law.alpha.size} for name, i in out.items()]


def sampled(found: FittedLaws, truth: Mapping[str, float], case: str, seed: int) -> list[dict]:
    """Rows of the posterior's middle 95 %."""
    assert found.fit is not None
    try:
        drawn = sample(found.fit, found.uncertainty, found.prony, None, seed)
    except NotConverged as error:
        drawn = error.estimate
    draws, values = drawn.draws, derived_of(drawn.draws)
    columns = _named_columns(values["mu_0_Pa"], values["E_0_Pa"], lambda mode, e: stress_of(draws, mode, [e])[:, 0])
    out = []
    for name, column in columns.items():
        low, middle, high = np.quantile(column, [0.025, 0.5, 0.975])
        out.append({"case": case, "method": "posterior", "seed": seed, "quantity": name, "truth": truth[name],
                    "value": middle, "sd": column.std(), "covered": low < truth[name] < high, "width": high - low,
                    "order": found.fit.law.alpha.size})
    return out


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Per case, method and quantity: replicas, covered, rms of (value - truth)/sd, width over that of the true spread
    about the truth, bias and width in per cent of the truth."""
    def one(group: pd.DataFrame) -> pd.Series:
        off, size = group["value"] - group["truth"], abs(group["truth"].iloc[0])
        spread = float(np.sqrt(np.mean(off**2)))
        return pd.Series({"replicas": len(group), "covered": int(group["covered"].sum()),
                          "z_rms": float(np.sqrt(np.mean((off / group["sd"]) ** 2))),
                          "width_over_spread": group["width"].mean() / (3.92 * spread),
                          "bias_percent": 100 * off.mean() / size, "width_percent": 100 * group["width"].mean() / size})

    return rows.groupby(["case", "method", "quantity"], sort=False)[list(rows.columns)].apply(one).reset_index()


def run(cases: tuple[str, ...], replicas: int, posterior: bool) -> pd.DataFrame:
    """All rows of some cases."""
    generate, rows = generator(), []
    for case in cases:
        for seed in range(replicas):
            begun = time.process_time()
            found, truth = replica(case, seed, generate)
            new = sampled(found, truth, case, seed) if posterior else linear(found, truth, case, seed)
            spent = time.process_time() - begun
            rows += [row | {"cpu_s": spent} for row in new]
    return pd.DataFrame(rows)


def _named(mu_0: float, young: float, stress: Truth) -> dict[str, float]:
    return {"mu_0": mu_0, "E_0": young, "plateau": -stress("uniaxial", PLATEAU_STRAIN),
            **{f"{mode} at {e:g}": stress(mode, e) for mode, strains in STRESSES.items() for e in strains}}


def _named_columns(mu_0: np.ndarray, young: np.ndarray,
                   stress: Callable[[str, float], np.ndarray]) -> dict[str, np.ndarray]:
    return {"mu_0": mu_0, "E_0": young, "plateau": -stress("uniaxial", PLATEAU_STRAIN),
            **{f"{mode} at {e:g}": stress(mode, e) for mode, strains in STRESSES.items() for e in strains}}


def _machine_tests(generate: ModuleType, rng: np.random.Generator) -> list[Experiment]:
    """Compression, lap shear and relaxation with a gap, a load zero and a drift of their own."""
    for name in ("uniaxial", "shear", "relaxation"):
        setup = generate.SETUP[name]
        setup |= {"zero_N": rng.normal(), "drift_N_per_s": 7e-4 * rng.normal()}
        setup["gap_mm"] = 0.0 if name == "shear" else rng.uniform(0.1, 0.5)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        for name in ("uniaxial", "relaxation"):
            (path / f"mts_{name}.txt").write_text(generate.compression(name, rng)[0], encoding="utf-8")
        (path / "mts_shear.txt").write_text(generate.lap_shear(rng)[0], encoding="utf-8")
        (path / "specimen.toml").write_text(generate.specimen_text(), encoding="utf-8")
        files = [(None, (path / f"mts_{n}.txt",)) for n in ("uniaxial", "shear", "relaxation")]
        return list(reduce_tests(files, path / "specimen.toml"))


def _noise(n: int, correlation: float, rng: np.random.Generator) -> np.ndarray:
    out = rng.normal(size=n)
    for k in range(1, n):
        out[k] = correlation * out[k - 1] + np.sqrt(1 - correlation**2) * out[k]
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("replicas", nargs="?", type=int, default=quick(100, 3))
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--posterior", action="store_true")
    asked = parser.parse_args()
    if unknown := set(asked.cases) - set(CASES):
        parser.error(f"unknown case {', '.join(sorted(unknown))}; known: {', '.join(CASES)}")
    rows = run(tuple(asked.cases), asked.replicas, asked.posterior)
    table = summary(rows)
    old = earlier("coverage")
    if len(old):  # keep the other cases and the other method
        fresh = set(zip(table["case"], table["method"], strict=True))
        kept = old[[(c, m) not in fresh for c, m in zip(old["case"], old["method"], strict=True)]]
        table = pd.concat([kept, table], ignore_index=True)
    shown(written(table, "coverage"))
    print(f"{rows.groupby(['case', 'seed'])['cpu_s'].first().sum():.0f} CPU s")


if __name__ == "__main__":
    main()
