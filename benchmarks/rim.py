"""What the rim changes of a touch, by its distance from the punch's edge, and the error and cost of telling it.

Relative changes of depth, of the surface's strains (2-norm over the disc, and largest over the largest) and of the 208
touch signals (2-norm) when the rim is taken into account; the plan's bound is their envelope. Beside them the same
differences to a finer solution in three dimensions, and the estimates. Run by `make bench`, which pins threads; writes
results/rim.csv beside this file.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from eitsim.axisymmetric import solve_touch
from eitsim.electrics import solve
from eitsim.near_rim import COARSE, FINE, Fineness, changed, corrected, rim_change
from eitsim.results import RimField, Touch
from eitsim.scene import STRAINS, Body, Drive, Electrodes, Punch, Skin
from eitsim.skin import changes, driving_strain, stretches
from matcal.conductivity import Conductivity
from matcal.hyperfoam import Hyperfoam

RESULTS = Path(__file__).parent / "results"
TABLE_1 = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
SKIN_LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
CASES = ((0.014, 3.0), (0.014, 1.0), (0.008, 0.3))
GAPS_M = (0.0005, 0.002, 0.005, 0.01, 0.02, 0.03, 0.04)
# touches whose solution is compared with a finer one: diameter, force, gap; m, N, m
COMPARED = ((0.014, 1.0, 0.005), (0.018, 0.5, 0.002))
FINER = Fineness(2.0, 9, 18)


def at(diameter_m: float, force_N: float, gap_m: float) -> Punch:
    return Punch(x_m=Body().radius_m - diameter_m / 2 - gap_m, diameter_m=diameter_m, force_N=force_N)


def no_change(field: RimField) -> RimField:
    return replace(field, displacement_m=0 * field.displacement_m, metric=0 * field.metric + [1.0, 0.0, 1.0],
                   normal=0 * field.normal + 1)


def strains(touch: Touch, field: RimField) -> tuple[np.ndarray, np.ndarray]:
    """Driving strains (3, n) in the order of STRAINS at points of the disc, and their weights (n,)."""
    edges = np.union1d(np.linspace(0, 0.05, 401), np.linspace(0.9, 1.1, 101) * touch.contact_radius_m)
    radius, angle = np.meshgrid((edges[1:] + edges[:-1]) / 2, (np.arange(40) + 0.5) / 40 * np.pi, indexing="ij")
    weight = radius * np.diff(edges)[:, None]
    points = radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    inside = np.hypot(points[..., 0] + field.offset_m, points[..., 1]) < field.disc_m
    meridian, hoop, normal = (s[:, None, None] for s in stretches(touch, radius[inside]))
    out = points[inside] / radius[inside][:, None]
    old = hoop * np.eye(2) + (meridian - hoop) * out[:, :, None] * out[:, None]
    metric, factor = changes(field, points[inside])
    first, second = np.sqrt(np.linalg.eigvalsh(old @ metric @ old).T)
    return np.stack([driving_strain(s, first, second, normal[:, 0, 0] * factor) for s in STRAINS]), weight[inside]


def signal(punch: Punch, touch: Touch, strain: str) -> np.ndarray:
    return solve(Body(), Skin(strain=strain), Electrodes(), Drive(), ((punch, touch),), SKIN_LAW, signal=0.1,
                 method="mesh").signal_V


def apart(punch: Punch, touch: Touch, reference: Touch) -> dict[str, float]:
    """Relative differences of two touches with fields of the rim."""
    assert touch.rim is not None
    assert reference.rim is not None
    (one, _), (other, weight) = strains(touch, touch.rim), strains(reference, reference.rim)
    out = {"depth": touch.depth_m / reference.depth_m - 1}
    for name, a, b in zip(STRAINS, one, other, strict=True):
        out[f"{name}_L2"] = float(np.sqrt(np.sum(weight * (a - b) ** 2) / np.sum(weight * b**2)))
        out[f"{name}_max"] = float(np.abs(a - b).max() / np.abs(b).max())
        if name == "principal":
            continue
        first, second = (signal(punch, t, name) for t in (touch, reference))
        out[f"dV_{name}"] = float(np.linalg.norm(first - second) / np.linalg.norm(second))
    return out


def effect(diameter_m: float, force_N: float) -> list[dict[str, object]]:
    far = solve_touch(TABLE_1, Body(), at(diameter_m, force_N, 0.05))
    out = []
    for gap in GAPS_M:
        punch, begun = at(diameter_m, force_N, gap), time.process_time()
        change = rim_change(TABLE_1, Body(), punch)
        seconds, near = time.process_time() - begun, changed(far, change)
        plain = replace(far, rim=no_change(change.field))
        out.append({"what": "effect", "d_mm": diameter_m * 1e3, "force_N": force_N, "gap_mm": gap * 1e3,
                    **apart(punch, plain, near), "depth": change.depth_m / far.depth_m, "cpu_s": seconds})
        print(pd.DataFrame(out[-1:]).to_string(index=False, header=len(out) == 1), flush=True)
    return out


def error(diameter_m: float, force_N: float, gap_m: float) -> list[dict[str, object]]:
    punch = at(diameter_m, force_N, gap_m)
    far, out = solve_touch(TABLE_1, Body(), punch), []
    reference = changed(far, rim_change(TABLE_1, Body(), punch, FINER))
    for what, coarse, fine in (("error", COARSE, FINE),):
        touch = corrected(far, TABLE_1, Body(), punch, coarse=coarse, fine=fine)
        out.append({"what": what, "d_mm": diameter_m * 1e3, "force_N": force_N, "gap_mm": gap_m * 1e3,
                    **apart(punch, touch, reference), "cpu_s": touch.cpu_s,
                    "depth_estimate": touch.depth_error - far.depth_error,
                    "signal_estimate": touch.signal_error - far.signal_error})
        print(pd.DataFrame(out[-1:]).to_string(index=False, header=False), flush=True)
    return out


def main() -> None:
    rows = [row for case in CASES for row in effect(*case)] + [row for case in COMPARED for row in error(*case)]
    table = pd.DataFrame(rows)
    RESULTS.mkdir(exist_ok=True)
    table.to_csv(RESULTS / "rim.csv", index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
