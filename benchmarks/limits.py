"""Maps of the physical limit over the disc: what readings at 60 dB can tell of a touch, by place.

Cramer-Rao standard deviations, without a prior, of the place along the radius and across it, of diameter and of force,
for d = 14 mm at 0.3 and 1 N, noise 60 dB below the RMS of the baseline, with a known material and with what a posterior
leaves open of it. Places lie on a polar grid of one sector from an electrode to the next, which is the whole disc by
the ring's turns. Mechanics is axisymmetric: what the rim changes of it is left out; the last rows
tell what that costs at one place, 20 mm from the rim. Give a card with a posterior:
python benchmarks/limits.py card.json; writes results/limits.csv beside this file.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import RESULTS, conditions, quick

from eitsim.scene import Punch, Scene
from matcal.card import MaterialCard, read_card
from surrogate.limit import correlation
from surrogate.limit_material import MaterialSpread, known_material, spread_of
from surrogate.limit_slopes import derivatives_of
from surrogate.limit_touch import covariance_at

NOISE_DB = 60.0
DIAMETER_MM, FORCES_N = 14.0, quick((0.3, 1.0), (1.0,))
RADII_MM, ANGLES = quick((0.0, 15.0, 30.0, 45.0, 60.0, 73.0, 83.0), (0.0, 45.0)), quick(4, 1)


def rows_at(radius_mm: float, angle: float, force_N: float, card: MaterialCard, spreads: dict[str, MaterialSpread],
            rim: bool = False) -> list[dict[str, object]]:
    """One row a material."""
    x_m, y_m = radius_mm * np.cos(angle) / 1e3, radius_mm * np.sin(angle) / 1e3
    punch = Punch(float(x_m), float(y_m), DIAMETER_MM / 1e3, force_N)
    started = time.process_time()
    found = derivatives_of(replace(Scene(), punches=(punch,)), card, rim=rim)
    cpu_s = time.process_time() - started
    rows: list[dict[str, object]] = []
    for material, spread in spreads.items():
        covariance = covariance_at(found, spread, NOISE_DB)
        along = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([-along[1], along[0]])
        place = covariance[:2, :2]
        rows.append({"radius_mm": radius_mm, "angle_deg": np.degrees(angle), "d_mm": DIAMETER_MM, "force_N": force_N,
                     "noise_db": NOISE_DB, "material": material, "rim": rim,
                     "sd_radial_mm": np.sqrt(along @ place @ along),
                     "sd_tangential_mm": np.sqrt(across @ place @ across),
                     "sd_d_mm": np.sqrt(covariance[2, 2]), "sd_F_N": np.sqrt(covariance[3, 3]),
                     "correlation_d_F": float(correlation(covariance, "d", "F")), "cpu_s": cpu_s})
    return rows


def places() -> list[tuple[float, float]]:
    """Radius in mm and angle in rad, the centre once."""
    sector = 2 * np.pi / Scene().electrodes.count
    angles = sector * np.arange(ANGLES) / ANGLES
    return [(0.0, 0.0), *((radius, float(angle)) for radius in RADII_MM[1:] for angle in angles)]


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    if path is None:
        raise SystemExit("limits.py: give a card with a posterior, from `matcal fit --posterior`.")
    card = read_card(path)
    spreads = {"known": known_material(), "posterior": spread_of(card, path)}
    rows = [row for force in FORCES_N for place in places() for row in rows_at(*place, force, card, spreads)]
    rows += [row for force in FORCES_N for row in rows_at(73.0, 0.1, force, card, spreads, rim=True)]
    rows += [row for force in FORCES_N for row in rows_at(73.0, 0.1, force, card, spreads)]
    table = pd.DataFrame(rows).assign(**conditions())
    table.to_csv(RESULTS / "limits.csv", index=False, float_format="%.4g")
    shown = ["sd_radial_mm", "sd_tangential_mm", "sd_d_mm", "sd_F_N", "correlation_d_F"]
    print(table.groupby(["force_N", "material", "rim", "radius_mm"])[shown].mean().to_string(float_format="%.3g"))


if __name__ == "__main__":
    main()
