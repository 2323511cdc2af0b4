"""Error against run time of whole scenes: plan, mechanics, skin and electrics, by the error that is asked for.

Touches of 14 mm at three forces, far from the rim and near it, each solved at several `[accuracy] signal` and with
every omission taken back (`exact`); dv_error is the distance of the 208 signals dV (2-norm) from a finer solution
that takes the rim into account (`finely_solved`), reference_error what that tells of itself, told_error what the result
states without the plan's bounds. Run by `make bench`, which pins threads; writes results/scenes.csv next to this file.
"""

import time
from collections.abc import Iterator

import numpy as np
from conditions import quick, shown, written
from finer import finely_solved
from materials import SKIN_LAW, TABLE_1

from eitsim.scene.results import Result
from eitsim.scene.scene import Accuracy, Punch, Scene
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard

CARD = MaterialCard("Table 1", TABLE_1, conductivity=SKIN_LAW)
PLACES = quick({"far from the rim": (0.02, -0.01), "18 mm from the rim": (0.06, 0.045)},
               {"far from the rim": (0.02, -0.01)})
FORCES_N = quick((0.3, 1.0, 2.0), (1.0,))
WANTED = (0.1, 0.03, 0.01, 0.003)


def solved(punch: Punch, wanted: float, exact: bool) -> tuple[Result, float]:
    begun = time.process_time()
    result = simulate(Scene(punches=(punch,), accuracy=Accuracy(wanted)), CARD, exact=exact)
    return result, time.process_time() - begun


def rows(place: str, punch: Punch) -> Iterator[dict[str, object]]:
    touch, reference = finely_solved(Scene(punches=(punch,)), CARD, rim=True)
    expected = reference.signal_V
    for method, exact in (("as planned", False), ("nothing left out", True)):
        for wanted in WANTED:
            result, seconds = solved(punch, wanted, exact)
            readings = result.readings
            missed = np.linalg.norm(readings.signal_V - expected) / np.linalg.norm(expected) if readings else np.nan
            yield {"scene": f"{place}, d = 14 mm, {punch.force_N:g} N", "method": method, "wanted": wanted,
                   "outcome": result.outcome, "dv_error": missed, "told_error": result.numerical_error.get("signal"),
                   "reference_error": touch.signal_errors[0] + reference.signal_error, "cpu_s": seconds}


def main() -> None:
    solved(Punch(force_N=0.1), 0.3, False)  # compiles the kernels
    solved(Punch(0.07, 0.0, force_N=0.1), 0.3, False)
    found = []
    for place, (x_m, y_m) in PLACES.items():
        for force_N in FORCES_N:
            found += rows(place, Punch(x_m, y_m, 0.014, force_N))
            table = written(found, "scenes")
    shown(table)


if __name__ == "__main__":
    main()
