"""Peak memory of one touch in a process of its own, over the extremes of fillet, size, thickness and force.

The default scene and the largest reduced ones: small fillets make small elements, wide punches many of them. `added`
is what the touch needs beyond an interpreter that has imported the solver and loaded its kernels; compiling them first
takes some 80 MB more, so run it again after a change of them. Run by `make bench`, which pins threads; writes
results/memory.csv next to this file.
"""

from __future__ import annotations

import multiprocessing
import resource
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from conditions import quick, written
from materials import SKIN_LAW, TABLE_1

from eitsim.scene.scene import Accuracy, Body, Punch, Scene
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard

CARD = MaterialCard("Table 1", TABLE_1, conductivity=SKIN_LAW)
LIMIT_MB = 500.0
WARM = Scene(punches=(Punch(force_N=0.01),), accuracy=Accuracy(0.2))


@dataclass(frozen=True)
class Case:
    """One scene and whether it is solved exactly."""

    name: str
    scene: Scene
    exact: bool = False


def scene(thickness_mm: float = 10.0, **keys: object) -> Scene:
    return Scene(body=Body(thickness_m=thickness_mm * 1e-3), punches=(Punch(**keys),))


CASES = (
    Case("default: d = 14 mm, 1 N", scene()),
    Case("exact: d = 14 mm, 1 N", scene(), True),
    Case("fillet 0.05 mm", scene(fillet_m=5e-5)),
    Case("d = 20 mm, 3 N", scene(diameter_m=0.02, force_N=3.0)),
    Case("d = 20 mm, 3 N, 5 mm thick", scene(5.0, diameter_m=0.02, force_N=3.0)),
    Case("d = 20 mm, 3 N, 20 mm thick", scene(20.0, diameter_m=0.02, force_N=3.0)),
    Case("sphere, d = 14 mm, 0.5 N", scene(profile="sphere", force_N=0.5)),
    Case("sphere, d = 20 mm, 1 N, 5 mm thick", scene(5.0, profile="sphere", diameter_m=0.02, force_N=1.0)),
    Case("cone, d = 14 mm, 0.5 N", scene(profile="cone", force_N=0.5)),
    Case("near the rim, gap 3 mm", scene(x_m=0.09)),
    Case("near the rim, d = 20 mm, 3 N, gap 0.5 mm", scene(x_m=0.0895, diameter_m=0.02, force_N=3.0)),
    Case("near the rim, d = 14 mm, 1 N, gap 3 mm, sticking", scene(x_m=0.09, friction="stick")),
    Case("fillet 0.1 mm, d = 20 mm, 3 N, 20 mm thick", scene(20.0, fillet_m=1e-4, diameter_m=0.02, force_N=3.0)),
    Case("fillet 0.05 mm, d = 20 mm, 3 N", scene(fillet_m=5e-5, diameter_m=0.02, force_N=3.0)),
    Case("fillet 0.05 mm, d = 20 mm, 3 N, 20 mm thick", scene(20.0, fillet_m=5e-5, diameter_m=0.02, force_N=3.0)),
    Case("exact: fillet 0.05 mm, d = 20 mm, 3 N", scene(fillet_m=5e-5, diameter_m=0.02, force_N=3.0), True),
)


def peak_MB() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measured(case: Case) -> dict[str, object]:
    """A row of one case, run in this process."""
    simulate(WARM, CARD)
    before = peak_MB()
    result = simulate(case.scene, CARD, exact=case.exact)
    return {"case": case.name, "outcome": result.outcome, "peak_MB": peak_MB(), "added_MB": peak_MB() - before,
            "within_limit": peak_MB() <= LIMIT_MB, "cpu_s": result.cost["cpu_s"]}


def main() -> None:
    rows: list[dict[str, object]] = []
    for case in [*CASES][:quick(None, 2)]:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            rows.append(pool.submit(measured, case).result())
        print({key: rows[-1][key] for key in ("case", "outcome", "peak_MB", "added_MB", "cpu_s")}, flush=True)
        written(rows, "memory")


if __name__ == "__main__":
    main()
