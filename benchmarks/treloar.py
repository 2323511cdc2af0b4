"""Rubber laws on measured tests in three modes: error of each fit, of published constants, and what the band holds.

Usage: treloar.py NAME=FOLDER ... Each folder has UT.txt, PS.txt and ET.txt, uniaxial, planar and equibiaxial: nominal
stress in MPa and stretch, as those of Treloar, Trans. Faraday Soc. 40 (1944) 59, DOI 10.1039/TF9444000059, and Meunier
et al., Polym. Test. 27 (2008) 765. Tables of others are not in this repository. Rows of laws: relative RMS of the fit
to all modes, each mode counting the same, and of the constants that were published for Treloar's rubber, on the same
points. Rows of bands: the share of the points of a mode that the 95 % band over laws holds, fitted to uniaxial tests
alone. CPU times are of one law, or of the ranking of all. Writes results/treloar.csv.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from conditions import shown, written

import matcal
from matcal.fitting.general_fit import fit_law
from matcal.fitting.hyperfoam.curves import Curve, weigh, weighted_model, weighted_stress
from matcal.fitting.law_ranking import band_over, ranked
from matcal.laws.known_laws import LAWS, law_of, law_type
from matcal.laws.law import has_terms

MODES = {"uniaxial": "UT.txt", "planar": "PS.txt", "biaxial": "ET.txt"}
TERMS, NU = 3, [0.5]  # terms of a law that has them, as published
KGF_PER_CM2 = 98066.5
# constants of Ogden, Proc. R. Soc. A 326 (1972) 565, mu_p alpha_p / 2 in this convention
PUBLISHED = {
    "ogden": law_of("ogden", [[KGF_PER_CM2 * mu * alpha / 2 for mu, alpha in ((6.3, 1.3), (0.012, 5.0), (-0.1, -2.0))],
                              [1.3, 5.0, -2.0], NU])}


def read(folder: Path) -> list[matcal.Experiment]:
    tests = []
    for mode, name in MODES.items():
        stress_MPa, stretch = np.loadtxt(folder / name).T
        away = stretch != 1.0
        tests.append(matcal.Experiment(mode, stretch[away] - 1, 1e6 * stress_MPa[away]))
    return tests


def of_laws(name: str, curves: tuple[Curve, ...], published: bool) -> list[dict[str, object]]:
    rows = []
    for law in LAWS:
        kind, begun = law_type(law), time.process_time()
        if law != "neo_hooke" and not kind.keeps_volume:
            continue
        found = fit_law(curves, kind, {"nu": 0.5}, TERMS if has_terms(kind) else "auto", thorough=False)
        row = {"data": name, "law": law, "error_percent": 100 * found.optimum.cost**0.5,
               "cpu_s": time.process_time() - begun}
        if published and law in PUBLISHED:
            miss = weighted_model(curves, PUBLISHED[law]) - weighted_stress(curves)
            row["published_error_percent"] = 100 * float(np.linalg.norm(miss))
        rows.append(row)
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
        rows += [*of_laws(name, curves, name == "Treloar"), *of_bands(name, curves)]
    shown(written(rows, "treloar"))


if __name__ == "__main__":
    main()
