"""Touches that rub near the rim: solved in three dimensions, against what the rim changes by harmonics of the angle.

Touches drawn from a seed stick or rub by Coulomb's law. Both routes hold the foam where the lone touch holds it, on
meshes and with contacts of their own. Run by `make bench`; writes results/general_friction.csv next to this file.
"""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from conditions import quick, written

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.general.solve_general import solve_general
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Drive, Electrodes, Punch, Skin
from eitsim.simulation.near_edges import solve_near_rim
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array
from touchcal.errors import NotConverged

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
LAW = Conductivity(30.0, [-2, 2, -1], (0.0, 0.4))
TOUCHES, SEED = quick(12, 1), 3


def drawn(rng: np.random.Generator) -> Punch:
    width, gap = rng.uniform(8e-3, 18e-3), rng.uniform(2e-3, 12e-3)
    force = rng.uniform(0.1, 1.0) * (width / 0.014) ** 2
    return Punch(0.1 - gap - width / 2, 0.0, width, force, friction=str(rng.choice(["stick", "coulomb"])),
                 friction_coefficient=rng.uniform(0.2, 0.8))


def signals(punch: Punch, touch: Touch) -> list[Array]:
    return [solve(Body(), Skin(strain=strain), Electrodes(), Drive(), ((punch, touch),), LAW, method="mesh").signal_V
            for strain in STRAINS]


def rows() -> Iterator[dict[str, object]]:
    rng = np.random.default_rng(SEED)
    for number in range(TOUCHES):
        punch, body = drawn(rng), Body()
        try:
            known = solve_near_rim(FOAM, body, punch)
            smooth = solve_near_rim(FOAM, body, replace(punch, friction="none"))
            begun = time.process_time()
            (found,) = solve_general(FOAM, body, [punch]).touches
        except NotConverged as error:
            print(f"touch {number} is left out: {error}")
            continue
        cpu_s = time.process_time() - begun
        expected, got, free = (signals(punch, touch) for touch in (known, found, smooth))
        yield {"touch": number, "friction": punch.friction, "coefficient": punch.friction_coefficient,
               "gap_mm": 1e3 * (0.1 - punch.x_m - punch.diameter_m / 2), "d_mm": 1e3 * punch.diameter_m,
               "F_N": punch.force_N, "depth": found.depth_m / known.depth_m - 1, "depth_stated": found.depth_error,
               **{strain: np.linalg.norm(a - b) / np.linalg.norm(b)
                  for strain, a, b in zip(STRAINS, got, expected, strict=True)},
               **{f"stated_{strain}": error for strain, error in zip(STRAINS, found.signal_errors, strict=True)},
               **{f"stated_by_rim_{strain}": error for strain, error in zip(STRAINS, known.signal_errors, strict=True)},
               **{f"without_{strain}": np.linalg.norm(a - b) / np.linalg.norm(b)
                  for strain, a, b in zip(STRAINS, free, expected, strict=True)},
               "cpu_s": cpu_s}


if __name__ == "__main__":
    table = written(rows(), "general_friction")
    print(table.drop(columns=["versions", "machine", "date", "code"]).to_string())
