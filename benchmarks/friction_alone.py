"""Friction of touches near the rim added as it is alone, against friction in the solution near the rim itself.

Touches drawn from a seed stick or rub by Coulomb's law. The change by the rim is solved with friction, and without; to
the second what friction changes of the touch alone is added, as is done for touches that are solved together. Run by
`make bench`; writes results/friction_alone.csv next to this file.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from conditions import quick, written

from eitsim.electrics.forward.sheet_fields import surface_displacement
from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.general.friction_alone import with_friction
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Drive, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import surface_metric
from eitsim.simulation.near_edges import solve_near_rim
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array
from touchcal.errors import NotConverged

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
LAW = Conductivity(30.0, [-2, 2, -1], (0.0, 0.4))
TOUCHES, SEED = quick(12, 1), 3


@dataclass(frozen=True, eq=False)
class NearRim:
    """The field of a touch near the rim."""

    punch: Punch
    touch: Touch

    def metric(self, points_m: Array) -> tuple[Array, Array]:
        return surface_metric(points_m, self.punch, self.touch)

    def displacement(self, points_m: Array) -> Array:
        return surface_displacement(points_m, [(self.punch, self.touch)])


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
        punch, body, begun = drawn(rng), Body(), time.process_time()
        smooth = replace(punch, friction="none")
        try:
            solved, without = solve_near_rim(FOAM, body, punch), solve_near_rim(FOAM, body, smooth)
            (added,) = with_friction([replace(without, surface=NearRim(smooth, without))], FOAM, body, [punch])
        except NotConverged as error:
            print(f"touch {number} is left out: {error}")
            continue
        known, got, free = (signals(punch, touch) for touch in (solved, added, without))
        yield {"touch": number, "friction": punch.friction, "coefficient": punch.friction_coefficient,
               "gap_mm": 1e3 * (0.1 - punch.x_m - punch.diameter_m / 2), "d_mm": 1e3 * punch.diameter_m,
               "F_N": punch.force_N, "depth": added.depth_m / solved.depth_m - 1,
               **{strain: np.linalg.norm(a - b) / np.linalg.norm(b)
                  for strain, a, b in zip(STRAINS, got, known, strict=True)},
               **{f"without_{strain}": np.linalg.norm(a - b) / np.linalg.norm(b)
                  for strain, a, b in zip(STRAINS, free, known, strict=True)},
               "cpu_s": time.process_time() - begun}


if __name__ == "__main__":
    table = written(rows(), "friction_alone")
    print(table.drop(columns=["versions", "machine", "date", "code"]).to_string())
