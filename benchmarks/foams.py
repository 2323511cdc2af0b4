"""A shoe foam's raw files, none edited: is a specimen that was left out within the band for the next one, and a mode
that was left out within the band over laws?

`python benchmarks/foams.py FOLDER` with FOLDER the raw files of the LEAP foam (rheometer text and Instron exports,
sizes in leap-MODE-measurements.csv), and next to it the workbook of mean curves of that foam and of a second one; none
is part of the project.

results/foams.csv: each specimen in turn is left out of a hyperfoam fit; the row says how many of its points lie in the
95 % band of the mean foam and of the next specimen, how far the fitted law is off, and how far those of others are
(`peers/foam_fits.py`, which says what to install for them).
results/foam_shares.csv: what shares a right interval gives, by specimens drawn as those measured scatter (synthetic).
results/foam_modes.csv: compression, tension and shear left out in turn, of both foams and of synthetic ones whose nu is
not given; the share of the mode within the band, without and with what the assumed nu hides; for the real ones the
errors of others, too.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from conditions import quick, shown, written
from peers.foam_fits import PEERS

import matcal
from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.hyperfoam.next_specimen import next_specimens
from matcal.fitting.uncertainty.intervals import intervals
from matcal.record.bands import band_in
from matcal.reduction.experiment import Experiment

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


def errors_of_others(tests: list[Experiment], out: Experiment, use: np.ndarray) -> dict[str, object]:
    """Root mean square over that of the stress, of each peer's law."""
    found, value = {}, out.value[use]
    for name, fitted in PEERS.items():
        begun = time.process_time()
        off = fitted(tests, out)[use] - value
        found |= {f"error_{name}": f"{np.sqrt(np.mean(off**2) / np.mean(value**2)):.3g}",
                  f"cpu_s_{name}": f"{time.process_time() - begun:.2f}"}
    return found


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
    return {"left_out": name, "points": strain.size,
            "in_mean_band": f"{np.mean((low <= stress) & (stress <= high)):.3f}",
            "in_next_band": f"{np.mean(np.abs(np.log(stress / expected)) <= following.further):.3f}",
            "half_width": f"{following.further:.3f}",
            "error": f"{np.sqrt(np.mean((middle - stress) ** 2) / np.mean(stress**2)):.3f}",
            "cpu_s": f"{cpu_s:.2f}", **errors_of_others(others, out, use)}


def shares(tests: dict[str, Experiment], sets: int) -> dict[str, object]:
    """Of sets of as many specimens, ln stress normal with the covariance of those measured: how many points of a
    specimen that is left out the others hold, over one set; and how many of further specimens are held in all."""
    rng, law, parts = np.random.default_rng(52), matcal.Hyperfoam([3e5], [6.0], [0.0]), []
    for mode in ("comp", "tension"):
        of = [test for name, test in tests.items() if name.startswith(mode)]
        far = min((test.strain for test in of), key=lambda e: float(np.abs(e).max()))
        strain = np.linspace(np.sign(far[-1]) * LEAST_STRAIN, far[-1], 60)
        ln = np.array([np.log(np.interp(np.abs(strain), np.abs(t.strain), np.abs(t.value))) for t in of])
        parts.append((strain, ln.mean(axis=0), (ln - ln.mean(axis=0)) / np.sqrt(len(of) - 1)))
    held, further = [], []
    for _ in range(sets):
        drawn = [[mean + rng.normal(size=len(root)) @ root for _ in root] for _, mean, root in parts]
        made = [Experiment("uniaxial", strain, np.sign(strain) * np.exp(ln))
                for (strain, *_), each in zip(parts, drawn, strict=True) for ln in each]
        found = next_specimens(weigh(made), law)
        held.append(np.mean([share for one in found for share in one.held.values()]))
        for one, (strain, mean, root) in zip(found, parts, strict=True):
            ln = mean + rng.normal(size=len(root)) @ root
            off = np.interp(np.abs(one.strain), np.abs(strain), ln) - np.log(np.abs(one.stress_Pa))
            further.append(np.mean(np.abs(off) <= one.further))
    measured = np.mean([s for one in next_specimens(weigh([*tests.values()]), law) for s in one.held.values()])
    low, high = np.quantile(held, (0.05, 0.95))
    return {"sets": sets, "specimens": len(tests), "held_measured": f"{measured:.3f}",
            "held_mean": f"{np.mean(held):.3f}", "held_5": f"{low:.3f}", "held_95": f"{high:.3f}",
            "sets_above_98": f"{np.mean(np.array(held) > 0.98):.3f}",
            "sets_90_to_98": f"{np.mean((np.array(held) >= 0.9) & (np.array(held) <= 0.98)):.3f}",
            "further_held": f"{np.mean(further):.3f}"}


def mean_curves(workbook: Path, foam: str) -> dict[str, Experiment]:
    """Compression, tension and shear of one foam of the workbook, means of five specimens with their deviations."""
    whole, shear = (matcal.read_test({kind: workbook}, columns=[
        f"{name}={foam}-{what}-{name},stress={foam}-{what}-stress:kPa,deviation={foam}-{what}-stddev:kPa"])
        for kind, what, name in (("uniaxial", "comten", "stretch"), ("shear", "shr", "strain")))
    return {"compression": _side(whole, -1), "tension": _side(whole, 1), "shear": shear}


def _side(test: Experiment, sign: int) -> Experiment:
    rows = np.flatnonzero(sign * test.strain > 0)
    rows = rows[np.argsort(np.abs(test.strain[rows]))]
    deviation = None if test.deviation is None else test.deviation[rows]
    return Experiment(test.kind, test.strain[rows], test.value[rows], deviation=deviation)


def drawn(number: int) -> dict[str, Experiment]:
    """A synthetic foam of one to three terms and a nu of 0 to 0.4: 1 % noise, 3 % from specimen to specimen."""
    rng = np.random.default_rng([521, number])
    terms, nu = int(rng.integers(1, 4)), float(rng.uniform(0, 0.4))
    alpha, share = np.sort(rng.uniform(-6, 14, terms)), rng.dirichlet(np.ones(terms))
    law, out = matcal.Hyperfoam((2e4 * share).tolist(), alpha.tolist(), [nu] * terms), {}
    for mode, kind, end in (("compression", "uniaxial", -0.6), ("tension", "uniaxial", 0.3), ("shear", "shear", 0.3)):
        strain = np.linspace(0.0, end, 80)[1:]
        noise = (1 + 0.01 * rng.normal(size=strain.size)) * np.exp(0.03 * rng.normal())
        out[mode] = Experiment(kind, strain, matcal.nominal_stress(law, kind, strain) * noise)
    return out


def mode_row(tests: dict[str, Experiment], left: str) -> dict[str, object]:
    """One mode left out of a fit to the others, nu not given."""
    begun, others = time.process_time(), [test for mode, test in tests.items() if mode != left]
    found = matcal.fit(others)
    known, out = found.laws.uncertainty, tests[left]
    use = np.abs(out.strain) > LEAST_STRAIN
    value, row = out.value[use], {}
    for name, about in (("of_one_nu", None), ("over_nu", known)):
        stress, low, high, _ = band_in(known.law, out.kind, out.strain[use], known, about)
        row |= {f"in_band_{name}": f"{np.mean((low <= value) & (value <= high)):.3f}",
                f"half_width_{name}": f"{np.median((high - low) / 2 / np.abs(stress)):.3f}"}
    return {"left_out": left, "points": int(use.sum()), **row,
            "law_over_measured": f"{np.median(stress / value):.3g}",
            "error": f"{np.sqrt(np.mean((stress - value) ** 2) / np.mean(value**2)):.3g}",
            "cpu_s": f"{time.process_time() - begun:.2f}"}


def main() -> None:
    """Read, fit and write all tables."""
    folder = Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as place:
        tests = read(folder, Path(place))
        shown(written([row(name, tests) for name in tests], "foams"))
    shown(written([shares(tests, quick(1000, 20))], "foam_shares"))
    book = folder.parent / "foam_leap" / "foam_leap_Foam.xlsx"
    foams = [*((name, 0, mean_curves(book, name)) for name in ("leap", "turbo")),
             *(("synthetic", number, drawn(number)) for number in range(quick(20, 1)))]
    shown(written([{"foam": name, "number": number, **mode_row(modes, left),
                    **(errors_of_others([test for mode, test in modes.items() if mode != left], modes[left],
                                        np.abs(modes[left].strain) > LEAST_STRAIN) if name != "synthetic" else {})}
                   for name, number, modes in foams for left in modes], "foam_modes"))


if __name__ == "__main__":
    main()
