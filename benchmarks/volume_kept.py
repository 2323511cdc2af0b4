"""What a bonded rubber changes from nu = 0.499 to 0.49999: eitsim against linear elasticity.

Usage: python benchmarks/volume_kept.py. Writes results/volume_kept.csv. A frictionless sphere under a small force that
stays; `peers/elastic_layer.py` is exact where strains are small. Columns, per cent: how the depth, the largest pressure
and the areal strain of the surface change in both, and the difference; of strains the L2 norm over the surface,
over that of the strain.
"""

from typing import Any

import numpy as np
from conditions import quick, written
from peers.elastic_layer import pressed

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.pressing import Punch
from eitsim.scene.scene import Body
from matcal.laws.neo_hooke import NeoHooke

THICKNESS_M, MU_PA, RATIOS = 0.01, 1e4, (0.499, 0.49999)
TOUCHES = ((0.5, 0.1), (2.0, 1.0), (1.0, 0.1), (1.0, 0.01))  # radius of the sphere and force, thicknesses and mu
REACH = 4.0  # radius of the surface that is compared


def row(sphere: float, force: float) -> dict[str, Any]:
    """One touch."""
    punch = Punch(diameter_m=2 * sphere * THICKNESS_M, profile="sphere", force_N=force * MU_PA * THICKNESS_M**2)
    soft, stiff = (solve_touch(NeoHooke(MU_PA, nu), Body(thickness_m=THICKNESS_M), punch) for nu in RATIOS)
    radius = soft.radius_m / THICKNESS_M
    kept = (radius > 0) & (radius < REACH)
    radius = radius[kept]
    other, true = (pressed(nu, sphere, force, radius) for nu in RATIOS)
    areal, least = ((touch.stretch_meridian * touch.stretch_hoop - 1)[kept] for touch in (stiff, soft))

    def norm(strain: np.ndarray) -> float:
        return float(np.sqrt(np.trapezoid(strain**2 * radius, radius)))

    change, expected = least - areal, other.areal_strain - true.areal_strain
    depth, pressure = soft.depth_m / stiff.depth_m, soft.sigma_max_Pa / stiff.sigma_max_Pa
    true_depth, true_pressure = other.depth / true.depth, other.largest_pressure / true.largest_pressure
    return {"sphere": sphere, "force": force, "depth": true.depth, "contact": true.contact,
            "depth_change": 100 * (depth - 1), "true_depth_change": 100 * (true_depth - 1),
            "depth_change_off": 100 * abs(depth - true_depth), "pressure_change": 100 * (pressure - 1),
            "true_pressure_change": 100 * (true_pressure - 1),
            "pressure_change_off": 100 * abs(pressure - true_pressure),
            "strain_change": 100 * norm(change) / norm(areal), "true_strain_change": 100 * norm(expected) / norm(areal),
            "strain_change_off": 100 * norm(change - expected) / norm(areal)}


def main() -> None:
    table = written((row(*one) for one in quick(TOUCHES, TOUCHES[-1:])), "volume_kept")
    print(table.iloc[:, :13].T)


if __name__ == "__main__":
    main()
