"""Rubber laws on measured tests in three modes: error of each fit, of published constants, and what the band holds.

Usage: treloar.py NAME=FOLDER ... Each folder has UT.txt, PS.txt and ET.txt, uniaxial, planar and equibiaxial: nominal
stress in MPa and stretch, as those of Treloar, Trans. Faraday Soc. 40 (1944) 59, DOI 10.1039/TF9444000059, and Meunier
et al., Polym. Test. 27 (2008) 765; Chongran-Zhao/Hyperelastic-fitting on GitHub has them as stress_stretch.txt. Tables
of others are not in this repository. Rows of laws: relative RMS of the fit to all modes, each mode counting the same,
and the least that any constants of the law can leave, by a search of its own over their whole range:
linear constants by least squares, the others by differential evolution (Storn & Price, DOI
10.1023/A:1008202821328). Rows with a source: that of constants which others state for Treloar's rubber, and of the fit
here, on the same points, of all modes or of one; of Mooney-Rivlin's five constants, Yeoh, Gent and Arruda-Boyce none
were found where they can be looked up. Rows of bands: the share of the points of a mode that the 95 % band over laws
holds, fitted to uniaxial tests alone. CPU times are of one fit, or of the ranking of all. Writes results/treloar.csv.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from conditions import shown, written
from scipy.optimize import differential_evolution, lsq_linear

import matcal
from matcal.fitting.general_fit import fit_law
from matcal.fitting.hyperfoam.curves import Curve, weigh, weighted_model, weighted_stress
from matcal.fitting.law_ranking import band_over, ranked
from matcal.laws.known_laws import LAWS, law_of, law_type
from matcal.laws.law import Law, Parameter, has_terms
from touchcal.arrays import Array

MODES = {"uniaxial": "UT.txt", "planar": "PS.txt", "biaxial": "ET.txt"}
TERMS, NU = 3, [0.5]  # terms of a law that has them, as published
NO_LAW = 1e6  # error of constants with which the law cannot reach the stretches of the tests
KGF_PER_CM2, MPA = 98066.5, 1e6


def of_ogden(unit_Pa: float, *terms: tuple[float, float]) -> Law:
    """The law of (mu_p, alpha_p) as Ogden writes them, which are mu_p alpha_p / 2 and alpha_p here."""
    return law_of("ogden", [[unit_Pa * mu * alpha / 2 for mu, alpha in terms], [alpha for _, alpha in terms], NU])


STEINMANN = "Steinmann, Hossain & Possart 2012, DOI 10.1007/s00419-012-0610-z, in simcoon's examples/hyperelasticity"
HYPERFIT = "Chongran-Zhao/Calibration-Hyperelasticity, tests/baseline.json"
# (source, mode or all, law): constants as others state them for Treloar's rubber
PUBLISHED = [
    *((STEINMANN, mode, law_of("neo_hooke", [[mu * MPA], NU]))
      for mode, mu in (("uniaxial", 0.5673), ("planar", 0.3360), ("biaxial", 0.4104))),
    *((STEINMANN, mode, law_of("mooney_rivlin", [[c10 * MPA], [c01 * MPA], NU]))
      for mode, c10, c01 in (("uniaxial", 0.2588, -0.0449), ("planar", 0.2348, -0.065), ("biaxial", 0.1713, 0.0047))),
    ("Ogden 1972, DOI 10.1098/rspa.1972.0026", "all", of_ogden(KGF_PER_CM2, (6.3, 1.3), (0.012, 5.0), (-0.1, -2.0))),
    (HYPERFIT, "uniaxial", law_of("neo_hooke", [[2 * 0.2853882625511521 * MPA], NU])),
    (HYPERFIT, "all", of_ogden(
        MPA, (-0.51048743, -0.72085475), (0.11166755, 2.56802037), (2.22271168e-6, 7.97875812))),
    ("FElupe, extended_tube, after Kaliske & Heinrich, DOI 10.5254/1.3538822", "all", law_of("extended_tube", [
        [0.1867 * MPA], [0.09693], [0.2169 * MPA], [0.2], NU]))]


def read(folder: Path) -> list[matcal.Experiment]:
    tests = []
    for mode, name in MODES.items():
        stress_MPa, stretch = np.loadtxt(folder / name).T
        away = stretch != 1.0
        tests.append(matcal.Experiment(mode, stretch[away] - 1, 1e6 * stress_MPa[away]))
    return tests


def of_laws(name: str, curves: tuple[Curve, ...]) -> list[dict[str, object]]:
    rows = []
    for law in LAWS:
        kind, begun = law_type(law), time.process_time()
        if law == "neo_hooke" or kind.keeps_volume:
            rows.append({"data": name, "law": law, "error_percent": error_percent(curves, law),
                         "cpu_s": time.process_time() - begun, "least_error_percent": least_error_percent(curves, law)})
    return rows


def error_percent(curves: tuple[Curve, ...], law: str) -> float:
    """Of the fit of a law."""
    kind = law_type(law)
    found = fit_law(curves, kind, {"nu": 0.5}, TERMS if has_terms(kind) else "auto", thorough=False)
    return 100 * float(found.optimum.cost) ** 0.5


def least_error_percent(curves: tuple[Curve, ...], law: str) -> float:
    """Of any constants of a law within its bounds."""
    searched = [p for p in law_type(law).parameters if p.name not in (*law_type(law).linear_parameters, "nu")]
    if not searched:
        return 100 * _left(curves, law, ())
    bounds = [p.bounds for p in searched for _ in range(_count(p))]
    found = differential_evolution(lambda x: _left(curves, law, x), bounds, rng=0, maxiter=300, popsize=20, tol=1e-8)
    return 100 * float(found.fun)


def _left(curves: tuple[Curve, ...], law: str, searched: Sequence[float]) -> float:
    """Relative RMS left by the best linear constants, the others being given."""
    kind, rest = law_type(law), iter(searched)
    linear = [p for p in kind.parameters if p.name in kind.linear_parameters for _ in range(_count(p))]
    given = [[next(rest) for _ in range(_count(p))] for p in kind.parameters
             if p.name not in (*kind.linear_parameters, "nu")]

    def model(moduli: Array) -> Array:
        left, others = iter(moduli), iter(given)
        return weighted_model(curves, law_of(law, [NU if p.name == "nu" else [next(left) for _ in range(_count(p))]
                                                   if p in linear else next(others) for p in kind.parameters]))

    first, steps = np.full(len(linear), MPA), MPA * np.eye(len(linear))
    matrix = np.column_stack([model(first + step) - model(first) for step in steps])
    if not np.all(np.isfinite(matrix)):
        return NO_LAW
    bounds = np.array([p.bounds for p in linear]).T
    return float(np.sqrt(2 * lsq_linear(matrix, weighted_stress(curves), bounds).cost))


def _count(parameter: Parameter) -> int:
    """Constants of one parameter."""
    return TERMS if parameter.each_term else 1


def of_published(name: str, curves: tuple[Curve, ...]) -> list[dict[str, object]]:
    rows = []
    for source, mode, law in PUBLISHED:
        seen = weigh([c.experiment for c in curves if mode in ("all", c.experiment.kind)])
        miss = weighted_model(seen, law) - weighted_stress(seen)
        rows.append({"data": name, "law": law.name, "mode": mode, "source": source,
                     "published_error_percent": 100 * float(np.linalg.norm(miss)),
                     "fit_error_percent": error_percent(seen, law.name)})
    return rows


def of_bands(name: str, curves: tuple[Curve, ...]) -> list[dict[str, object]]:
    begun = time.process_time()
    laws = ranked(weigh([c.experiment for c in curves if c.experiment.kind == "uniaxial"]), {})
    spent, rows = time.process_time() - begun, []
    for mode in ("planar", "biaxial"):
        (test,) = (c.experiment for c in curves if c.experiment.kind == mode)
        low, high = band_over(laws, mode, test.strain)
        inside = (low <= test.value) & (test.value <= high)
        rows.append({"data": name, "mode": mode, "points": test.value.size, "held_percent": 100 * float(inside.mean()),
                     "half_width_percent": 50 * float(np.median((high - low) / test.value)), "cpu_s": spent,
                     "laws": " ".join(f"{r.law.name}:{r.weight:.2g}" for r in laws if r.weight > 0.005)})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", metavar="NAME=FOLDER")
    rows = []
    for given in parser.parse_args().folders:
        name, _, folder = given.partition("=")
        curves = weigh(read(Path(folder)))
        rows += [*of_laws(name, curves), *(of_published(name, curves) if name == "Treloar" else []),
                 *of_bands(name, curves)]
    shown(written(rows, "treloar"))


if __name__ == "__main__":
    main()
