"""The physical limit over the disc: what readings at 60 dB can tell of a touch, by place.

Cramer-Rao standard deviations, without a prior, of the place along the radius and across it, of diameter and of force,
for d = 14 mm at 0.3 and 1 N, noise 60 dB below the RMS of the baseline, with a known material and with what a posterior
leaves open of it. Near 1 N the signal of this punch is largest and falls under more force, so that the force is told
worst there. Places are those of one sector, as in `surrogate limit --map`. Mechanics is axisymmetric: what the
rim changes of it is left out; the last rows tell what that costs at one place, 20 mm from the rim. Give a card with a
posterior: python benchmarks/limits.py card.json; writes results/limits.csv next to this file.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import quick, written

from eitsim.scene.scene import Punch, Scene
from matcal.card import MaterialCard, read_card
from surrogate.bounds.cramer_rao import ANGLES, RADII, covariance_at, places, solved, turned
from surrogate.bounds.fisher_information import correlation
from surrogate.bounds.material_spread import MaterialSpread, known_material, spread_of

NOISE_DB = 60.0
DIAMETER_MM, FORCES_N = 14.0, quick((0.3, 1.0), (1.0,))
GRID = quick((RADII, ANGLES), (1, 1))
BESIDE_RIM = (73.0, 0.1)


def rows(scene: Scene, card: MaterialCard, where: list[tuple[float, float]], spreads: dict[str, MaterialSpread],
         rim: bool = False) -> Iterator[dict[str, object]]:
    """One row a place, radius in mm and angle in rad, and material."""
    (punch,) = scene.punches
    for place in where:
        begun = time.process_time()
        (one,) = solved(scene, card, [place], rim=rim)
        cpu_s = time.process_time() - begun
        for material, spread in spreads.items():
            covariance = turned(covariance_at(one.derivatives, spread, NOISE_DB), -one.angle)
            sd = np.sqrt(np.diag(covariance))
            yield {"radius_mm": one.radius_mm, "angle_deg": np.degrees(one.angle), "d_mm": punch.diameter_m * 1e3,
                   "force_N": punch.force_N, "noise_db": NOISE_DB, "material": material, "rim": rim,
                   "sd_radial_mm": sd[0], "sd_tangential_mm": sd[1], "sd_d_mm": sd[2], "sd_F_N": sd[3],
                   "correlation_d_F": float(correlation(covariance, "d", "F")), "cpu_s": cpu_s}


def main() -> None:
    if len(sys.argv) != 2:
        raise SystemExit("limits.py: give a card with a posterior, from `matcal fit --posterior`.")
    path = Path(sys.argv[1])
    card = read_card(path)
    spreads, found = {"known": known_material(), "posterior": spread_of(card, path)}, []
    for force in FORCES_N:
        scene = replace(Scene(), punches=(Punch(diameter_m=DIAMETER_MM / 1e3, force_N=force),))
        found += rows(scene, card, places(scene, *GRID), spreads)
        for rim in (True, False):
            found += rows(scene, card, [BESIDE_RIM], spreads, rim)
    told = pd.pivot_table(written(found, "limits"), index=["force_N", "material", "rim", "radius_mm"],
                          values=["sd_radial_mm", "sd_tangential_mm", "sd_d_mm", "sd_F_N", "correlation_d_F"])
    print(told.to_string(float_format="%.3g"))


if __name__ == "__main__":
    main()
