"""Error against run time of one hyperfoam fit: starts and tolerance, and lmfit's own least squares on the same curves.

Run by `make bench`, which pins threads; writes results/calibration.csv next to this file. The curves are the synthetic
plain files, whose truth is known.
"""

import json
import time
from collections.abc import Callable
from pathlib import Path

import lmfit
import numpy as np
from conditions import quick, shown, written
from materials import TABLE_1

from matcal.fitting.hyperfoam.curves import Curve, weigh
from matcal.fitting.hyperfoam.exponent_search import pose, search
from matcal.fitting.hyperfoam.hyperfoam_fit import fit, modelled, relative_rms
from matcal.fitting.hyperfoam.variable_projection import least_moduli
from matcal.laws.hyperfoam import Hyperfoam
from matcal.reduction.reduce import reduce_tests

HERE = Path(__file__).parent
RAW = HERE.parent / "data_raw"
REPEATS = quick(5, 2)


def curves() -> tuple[Curve, ...]:
    inputs = [("uniaxial", (RAW / "uniaxial.csv",)), ("shear", (RAW / "shear.csv",))]
    return weigh(reduce_tests(inputs))


def by_variable_projection(data: tuple[Curve, ...], starts: int, tolerance: float) -> Hyperfoam:
    found = search(pose(data, 0.0), 3, starts, least_moduli, tolerance=tolerance)
    return Hyperfoam(found.mu_Pa, found.alpha, np.zeros(3))


def as_users_do(data: tuple[Curve, ...]) -> Hyperfoam:
    """The fit with every start, each mode alone and one more term, as the command line makes it."""
    return fit(data, order=3).law


def by_lmfit(data: tuple[Curve, ...], start: Hyperfoam, tolerance: float) -> Hyperfoam:
    """All six parameters at once by Levenberg-Marquardt from one start, as a hand-written script would do it."""
    parameters = lmfit.Parameters()
    for i, (mu, alpha) in enumerate(zip(start.mu_Pa, start.alpha, strict=True)):
        parameters.add(f"mu_{i}", mu)
        parameters.add(f"alpha_{i}", alpha, min=-25, max=25)

    def law(p: lmfit.Parameters) -> Hyperfoam:
        return Hyperfoam([p[f"mu_{i}"].value for i in range(3)], [p[f"alpha_{i}"].value for i in range(3)], [0, 0, 0])

    def residual(p: lmfit.Parameters) -> np.ndarray:
        try:
            model = law(p)
        except ValueError:  # mu_0 <= 0 on the way: a large residual sends the search back
            return np.concatenate([np.full(c.experiment.value.size, 1e3) for c in data])
        return np.concatenate([(c.experiment.value - modelled(model, c)) / c.scale_Pa * c.weight**0.5 for c in data])

    found = lmfit.minimize(residual, parameters, method="leastsq", xtol=tolerance, ftol=tolerance)
    return law(found.params)  # pyright: ignore[reportAttributeAccessIssue]


def distance(law: Hyperfoam, best: Hyperfoam, data: tuple[Curve, ...]) -> float:
    """RMS of the stress by which a law misses the best fit's, over the RMS of the best fit's, in the mode where it
    misses more: the error that a search leaves, next to that of noisy data."""
    fitted = [(modelled(law, curve), modelled(best, curve)) for curve in data]
    return max(float(np.linalg.norm(own - aim) / np.linalg.norm(aim)) for own, aim in fitted)


def row(method: str, setting: str, run: Callable[[], Hyperfoam], data: tuple[Curve, ...], truth: float,
        best: Hyperfoam) -> dict:
    seconds = []
    for _ in range(REPEATS):
        begun = time.process_time()
        law = run()
        seconds.append(time.process_time() - begun)
    return {"method": method, "setting": setting,
            "distance_from_best": distance(law, best, data), "relative_rms_uniaxial": relative_rms(law, data[0]),
            "relative_rms_shear": relative_rms(law, data[1]), "mu_0_error": law.mu_0_Pa / truth - 1,
            "cpu_s": float(np.median(seconds))}


def main() -> None:
    data = curves()
    best = by_variable_projection(data, 60, 1e-13)
    truth = 1e3 * json.loads((RAW / "truth.json").read_text())["longterm"]["mu_0_kPa"]
    rows = [row("variable projection", f"{n} starts, tolerance {t:g}",
                lambda n=n, t=t: by_variable_projection(data, n, t), data, truth, best)
            for n in (1, 3, 8, 20) for t in (1e-2, 1e-4, 1e-9)]
    rows.append(row("variable projection", "default, each mode alone and one more term too", lambda: as_users_do(data),
                    data, truth, best))
    starts = {"alpha 1, 4, 8": Hyperfoam([5e3, 5e3, 5e3], [1.0, 4.0, 8.0], [0, 0, 0]),
              "alpha -2, 2, 6": Hyperfoam([5e3, 5e3, 5e3], [-2.0, 2.0, 6.0], [0, 0, 0]),
              "Table 1": TABLE_1}
    rows += [row("lmfit leastsq", f"from {name}, tolerance {t:g}", lambda s=start, t=t: by_lmfit(data, s, t), data,
                 truth, best) for name, start in starts.items() for t in (1e-4, 1.5e-8)]
    shown(written(rows, "calibration", 6))


if __name__ == "__main__":
    main()
