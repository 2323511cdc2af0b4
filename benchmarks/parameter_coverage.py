"""Do 95 % intervals of fitted numbers hold? Moduli of foams (with nu fitted) and of rubbers (and stress in a mode that
was not tested), c_0 and a_i of a conductivity; fresh noise.

Run by `make bench`, or by hand with REPLICAS [CASE ...]; writes results/parameter_coverage.csv next to this file, where
cases that were not run keep their earlier rows. Noise is a share of the rms stress, or 0.03 S/m, white or correlated
from point to point (ar), or grows with the value (proportional); zero: the strain's zero of each test but a volumetric
one is off by a normal error of this standard deviation; offset: the load's zero, by one of 2 % of the rms stress;
assumed offset: by one of 2 % of the largest stress, as fits assume; zeros known: the fit takes both as exact. Per case,
method and quantity: replicas, share of them whose interval holds the truth, and half its width in per cent of the truth
(of 1 for nu).
"""

import argparse
import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written

import matcal
from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.uncertainty.intervals import intervals
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law, has_terms

STRAINS = {"uniaxial": np.linspace(0, -0.5, 50), "shear": np.linspace(0, 0.7, 50),
           "volumetric": np.linspace(1, 0.6, 40), "planar": np.linspace(0, 0.5, 40)}
C_0, A, STRETCH = 30.0, np.array([-2.0, 2.0, -1.0]), 0.4


@dataclass(frozen=True)
class Foam:
    """Tests of a foam whose nu is fitted."""

    mu_Pa: Sequence[float]
    alpha: Sequence[float]
    nu: float
    modes: Sequence[str]
    noise: float = 0.005
    ar: float = 0.0
    zero: float = 0.0


@dataclass(frozen=True)
class Rubber:
    """A uniaxial and a biaxial test of a rubber."""

    law: str
    values: Sequence[Sequence[float]]
    noise: float = 0.01
    ar: float = 0.0
    offset: float = 0.0
    assumed: bool = False
    known: bool = False


@dataclass(frozen=True)
class Skin:
    """A conductivity test."""

    points: int = 100
    ar: float = 0.0
    proportional: bool = False
    posterior: bool = False


TWO = ([18e3, 2e3], [8.0, -1.8])
STRETCHED = {"uniaxial": np.linspace(0.02, 2.5, 80), "biaxial": np.linspace(0.02, 1.2, 60)}
RUBBERS = {"mooney_rivlin": [[9e4], [2e4]], "yeoh": [[1e5], [-1e3], [60.0]], "ogden": [[1.5e5, 4e3], [1.7, 5.0]],
           "gent": [[2e5], [40.0]], "arruda_boyce": [[2e5], [3.0]], "extended_tube": [[1e5], [0.15], [1e5], [0.4]]}
OF_RUBBERS = {"white": {}, "white, zeros known": {"known": True}, "correlated": {"ar": 0.85},
              "correlated, zeros known": {"ar": 0.85, "known": True},
              "offset": {"offset": 0.02}, "correlated, assumed offset": {"ar": 0.85, "assumed": True}}
CASES: dict[str, Foam | Rubber | Skin] = {
    "uniaxial, shear, nu 0.2": Foam(*TWO, 0.2, ("uniaxial", "shear")),
    "uniaxial, shear, nu 0.1": Foam(*TWO, 0.1, ("uniaxial", "shear")),
    "uniaxial, shear, nu 0.4": Foam(*TWO, 0.4, ("uniaxial", "shear")),
    "uniaxial, shear, soft, nu 0.3": Foam([6e3, 8e3], [2.0, 7.0], 0.3, ("uniaxial", "shear")),
    "uniaxial, shear, nu 0.2, ar 0.9": Foam(*TWO, 0.2, ("uniaxial", "shear"), ar=0.9),
    "uniaxial, shear, nu 0.2, zero": Foam(*TWO, 0.2, ("uniaxial", "shear"), zero=0.003),
    "uniaxial, planar, nu 0.2, zero": Foam(*TWO, 0.2, ("uniaxial", "planar"), zero=0.003),
    "uniaxial, shear, volumetric, nu 0.2": Foam(*TWO, 0.2, ("uniaxial", "shear", "volumetric")),
    "uniaxial, planar, nu 0.2": Foam(*TWO, 0.2, ("uniaxial", "planar")),
    "uniaxial, planar, nu 0.4, 1 %": Foam(*TWO, 0.4, ("uniaxial", "planar"), 0.01),
    "skin": Skin(), "skin, ar 0.5": Skin(ar=0.5), "skin, ar 0.9": Skin(ar=0.9), "skin, 12 points": Skin(12),
    "skin, proportional": Skin(proportional=True), "skin, posterior": Skin(posterior=True),
    "skin, ar 0.5, posterior": Skin(ar=0.5, posterior=True), "skin, ar 0.9, posterior": Skin(ar=0.9, posterior=True),
    **{f"{law}, {kind}": Rubber(law, values, **how)
       for (law, values), (kind, how) in itertools.product(RUBBERS.items(), OF_RUBBERS.items())}}


def errors(count: int, ar: float, rng: np.random.Generator) -> np.ndarray:
    """Errors of unit size (count,), correlated by `ar` from point to point."""
    fresh = rng.normal(size=count)
    out = fresh.copy()
    for k in range(1, count):
        out[k] = ar * out[k - 1] + np.sqrt(1 - ar**2) * fresh[k]
    return out


def foam_rows(case: Foam, rng: np.random.Generator) -> dict[str, tuple[float, float, float]]:
    """Quantity -> (truth, ends of its interval)."""
    law = matcal.Hyperfoam(case.mu_Pa, case.alpha, [case.nu] * len(case.mu_Pa))
    tests = []
    for mode in case.modes:
        off = rng.normal(scale=case.zero) if case.zero and mode != "volumetric" else 0.0
        stress = matcal.nominal_stress(law, mode, STRAINS[mode] + off)
        size = case.noise * np.sqrt(np.mean(stress**2))
        tests.append({mode: (STRAINS[mode], stress + size * errors(stress.size, case.ar, rng))})
    found = matcal.fit(tests, poisson="fit").card.fit
    plateau = -float(matcal.nominal_stress(law, "uniaxial", -0.4))
    truth = {"mu_0_Pa": law.mu_0_Pa, "E_0_Pa": law.E_0_Pa, "plateau_Pa": plateau}
    return {"nu": (case.nu, *found["nu"]["interval"])} | {
        name: (truth[name], row["lo"], row["hi"]) for name, row in found["derived"].items()}


def rubber_rows(case: Rubber, rng: np.random.Generator) -> dict[str, tuple[float, float, float]]:
    """Quantity -> (truth, ends of its interval)."""
    law = law_of(case.law, [*case.values, [0.5]])
    tests = []
    for mode, strain in STRETCHED.items():
        stress = matcal.nominal_stress(law, mode, strain)
        size = np.sqrt(np.mean(stress**2))
        zero = 0.02 * np.abs(stress).max() if case.assumed else case.offset * size
        off = size * case.noise * errors(strain.size, case.ar, rng) + zero * rng.normal()
        test = matcal.read_test({mode: (strain, stress + off)})
        tests.append(replace(test, facts={}) if case.known else test)
    terms = len(case.values[0]) if has_terms(type(law)) else "auto"
    about = calibrate(tests, FitOptions(law=case.law, order=terms)).uncertainty

    def watched(one: Law) -> dict[str, float]:
        return {"mu_0_Pa": one.mu_0_Pa, "planar_Pa": float(matcal.nominal_stress(one, "planar", 1.0))}

    return {name: (truth, found.lo, found.hi) for (name, truth), found in zip(
        watched(law).items(), intervals(about, watched).values(), strict=True)}


def skin_rows(case: Skin, rng: np.random.Generator) -> dict[str, tuple[float, float, float]]:
    """Quantity -> (truth, ends of its interval)."""
    e = np.linspace(0, STRETCH, case.points)
    value = C_0 * (1 + A[0] * e + A[1] * e**2 + A[2] * e**3)
    noise = 0.03 * errors(e.size, case.ar, rng) * (value / value.mean() if case.proportional else 1.0)
    card = matcal.fit([{"conductivity": (e, value + noise)}], posterior=case.posterior, conduction="cubic").card
    truth = {"c0_S_per_m": C_0} | {f"a_{k + 1}": a for k, a in enumerate(A)}
    if case.posterior:
        drawn = card.posterior["derived"]
        return {name: (t, drawn[name]["lo"], drawn[name]["hi"]) for name, t in truth.items()}
    part = card.fit["conductivity"]
    ends = [part["c0_interval_S_per_m"], *part["a_interval"]]
    return {name: (t, *pair) for (name, t), pair in zip(truth.items(), ends, strict=True)}


def run(name: str, replicas: int, seed: int = 0) -> list[dict]:
    """Rows of one case."""
    case, begun = CASES[name], time.process_time()
    rows = {Foam: foam_rows, Rubber: rubber_rows, Skin: skin_rows}[type(case)]
    each = [rows(case, np.random.default_rng([seed, k])) for k in range(replicas)]
    spent = (time.process_time() - begun) / replicas
    out = []
    for quantity in each[0]:
        truth, low, high = np.array([rows[quantity] for rows in each if quantity in rows]).T
        size = 1.0 if quantity == "nu" else np.abs(truth)
        out.append({"case": name, "quantity": quantity, "replicas": truth.size,
                    "covered_percent": 100 * float(np.mean((low <= truth) & (truth <= high))),
                    "half_width_percent": 100 * float(np.median((high - low) / 2 / size)), "cpu_s": spent})
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("replicas", nargs="?", type=int, default=quick(100, 2))
    parser.add_argument("cases", nargs="*", default=list(CASES))
    asked = parser.parse_args()
    if unknown := set(asked.cases) - set(CASES):
        parser.error(f"unknown case {', '.join(sorted(unknown))}; known: {'; '.join(CASES)}")
    table = pd.DataFrame([row for name in asked.cases for row in run(name, asked.replicas)])
    old = earlier("parameter_coverage")
    if len(old):
        table = pd.concat([old[~old["case"].isin(asked.cases)], table], ignore_index=True)
    shown(written(table, "parameter_coverage"))


if __name__ == "__main__":
    main()
