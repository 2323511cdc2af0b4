"""A shoe foam's raw files, none edited: is a specimen that was left out within the band for the next one?

`python benchmarks/foams.py FOLDER` with FOLDER the raw files of the LEAP foam (rheometer text and Instron exports,
sizes in leap-MODE-measurements.csv), which are not part of the project. Each specimen in turn is left out of a
hyperfoam fit; the row says how many of its points lie in the 95 % band of the mean foam and of the next specimen, how
far the fitted law is off, and how far lmfit from one start is. Into results/foams.csv.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import lmfit
import numpy as np
from conditions import shown, written

import matcal
from matcal.fitting.uncertainty.intervals import intervals
from matcal.reduction.experiment import Experiment

ALPHA_START = (2.0, 8.0, -2.0)  # of lmfit, with equal moduli
LEAST_STRAIN = 0.02  # where stresses are compared


def read(folder: Path, sizes_in: Path) -> dict[str, Experiment]:
    """Every uniaxial raw file, its sizes the means of the measurement table's row of its number."""
    out = {}
    for path in [*sorted(folder.glob("leap-comp-*.txt")), *sorted(folder.glob("leap-tension-*_1.csv"))]:
        mode, number = path.stem.split("-")[1], int(path.stem.split("-")[2].split("_")[0])
        sizes = _table(folder, mode)[number - 1]
        text = (f"diameter_mm = {sizes[:3].mean()}\nheight_mm = {sizes[3:].mean()}\n" if mode == "comp" else
                f"width_mm = {sizes[3:6].mean()}\ndepth_mm = {sizes[6:9].mean()}\nheight_mm = {sizes[9]}\n")
        toml = sizes_in / f"{mode}_{number}.toml"
        toml.write_text(f"[uniaxial]\n{text}", encoding="utf-8")
        out[f"{mode} {number}"] = matcal.read_test({"uniaxial": path}, specimen=toml)
    return out


def _table(folder: Path, mode: str) -> np.ndarray:
    lines = (folder / f"leap-{mode}-measurements.csv").read_text(encoding="utf-8").splitlines()
    return np.array([[float(cell) for cell in line.split(",")] for line in lines if line.strip()])


def by_lmfit(tests: list[Experiment]) -> matcal.Hyperfoam:
    """Three terms by least squares from one start, nu = 0."""
    strain, stress = (np.concatenate([getattr(test, name) for test in tests]) for name in ("strain", "value"))

    def law(p: lmfit.Parameters) -> matcal.Hyperfoam:
        return matcal.Hyperfoam([1e3 * p[f"m{k}"].value for k in range(3)], [p[f"a{k}"].value for k in range(3)],
                                [0.0] * 3)

    start = lmfit.Parameters()
    for k, alpha in enumerate(ALPHA_START):
        start.add(f"m{k}", 100.0)
        start.add(f"a{k}", alpha, min=-30, max=30)

    def left(p: lmfit.Parameters) -> np.ndarray:
        try:
            return np.nan_to_num(matcal.nominal_stress(law(p), "uniaxial", strain) - stress, nan=1e9)
        except ValueError:
            return np.full(strain.size, 1e9)

    found: Any = lmfit.minimize(left, start)
    return law(found.params)


def row(name: str, tests: dict[str, Experiment]) -> dict[str, object]:
    """One specimen left out."""
    begun = time.process_time()
    others = [test for other, test in tests.items() if other != name]
    found = matcal.fit(others)
    cpu_s = time.process_time() - begun
    out = tests[name]
    use = np.abs(out.strain) > LEAST_STRAIN
    strain, stress = out.strain[use], np.abs(out.value[use])
    known = found.laws.uncertainty
    band = intervals(known, lambda one: {str(k): float(abs(value)) for k, value in
                                         enumerate(matcal.nominal_stress(one, "uniaxial", strain))})
    low, middle, high = np.array([[band[str(k)].lo, band[str(k)].value, band[str(k)].hi]
                                  for k in range(strain.size)]).T
    following = next(one for one in found.laws.next_specimens if one.strain[0] * strain[-1] > 0)
    expected = np.interp(np.abs(strain), np.abs(following.strain), np.abs(following.stress_Pa))
    begun = time.process_time()
    simple = np.abs(matcal.nominal_stress(by_lmfit(others), "uniaxial", strain))
    return {"left_out": name, "points": strain.size,
            "in_mean_band": f"{np.mean((low <= stress) & (stress <= high)):.3f}",
            "in_next_band": f"{np.mean(np.abs(np.log(stress / expected)) <= following.further):.3f}",
            "half_width": f"{following.further:.3f}",
            "error": f"{np.sqrt(np.mean((middle - stress) ** 2) / np.mean(stress**2)):.3f}",
            "error_lmfit": f"{np.sqrt(np.mean((simple - stress) ** 2) / np.mean(stress**2)):.3f}",
            "cpu_s": f"{cpu_s:.2f}", "cpu_s_lmfit": f"{time.process_time() - begun:.2f}"}


def main() -> None:
    """Read, fit and write all rows."""
    with tempfile.TemporaryDirectory() as place:
        tests = read(Path(sys.argv[1]), Path(place))
        shown(written([row(name, tests) for name in tests], "foams"))


if __name__ == "__main__":
    main()
