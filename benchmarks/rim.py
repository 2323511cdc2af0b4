"""What the rim changes of a touch, by its distance from the punch's edge, and the error and cost of solving it.

"effect": relative changes of depth, of the surface's strains (2-norm over the disc, and largest over the largest), of
the radial displacement (2-norm) and of the 208 touch signals (2-norm) when the rim is taken into account; the plan's
bound is their envelope. "hand-over": the same at the gap from which the plan leaves the rim out, the jump there.
"error": the same differences to a finer solution in three dimensions, and the estimates. "series": those to a fine
solution on the whole disc, the punch's centre 40, 25, 15 and 10 mm from the rim. Run by `make bench`, which pins
threads; writes results/rim.csv next to this file.
"""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from conditions import quick, shown, written
from materials import SKIN_LAW, TABLE_1
from scipy.interpolate import RegularGridInterpolator

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.harmonics.arcs import OffsetDisc
from eitsim.mechanics.rim.correction import apply_correction, no_correction
from eitsim.mechanics.rim.solve_near_rim import COARSE, FINE, Resolution, on_two_meshes, rim_change
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import STRAINS, Body, Drive, Electrodes, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import changes, driving_strain, stretches
from eitsim.simulation.near_edges import with_signal_errors
from eitsim.simulation.routes.route import Case

CASES = quick(((0.014, 3.0), (0.014, 1.0), (0.008, 0.3), (0.02, 2.0)), ((0.014, 1.0),))
HANDED_OVER = quick(((0.014, 1.0), (0.014, 3.0)), ((0.014, 1.0),))
GAPS_M = quick((0.0005, 0.002, 0.005, 0.01, 0.02, 0.03, 0.04), (0.005, 0.02))
# touches whose solution is compared with a finer one: diameter, force, gap; m, N, m
COMPARED = quick(((0.014, 1.0, 0.005), (0.018, 0.5, 0.002)), ((0.014, 1.0, 0.005),))
FINER = Resolution(2.0, 9, 18)
# 14 mm, 1 N: distances of the punch's centre from the rim, m, and the solution on the whole disc
SERIES_M = quick((0.04, 0.025, 0.015, 0.01), (0.04,))
WHOLE_DISC = replace(FINER, out_to=np.inf)


def at(diameter_m: float, force_N: float, gap_m: float) -> Punch:
    return Punch(x_m=Body().radius_m - diameter_m / 2 - gap_m, diameter_m=diameter_m, force_N=force_N)


def places(touch: Touch, field: RimField) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) of the disc about the punch, and their weights (n,)."""
    edges = np.union1d(np.linspace(0, 0.05, 401), np.linspace(0.9, 1.1, 101) * touch.contact_radius_m)
    radius, angle = np.meshgrid((edges[1:] + edges[:-1]) / 2, (np.arange(40) + 0.5) / 40 * np.pi, indexing="ij")
    weight = radius * np.diff(edges)[:, None]
    points = radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    inside = np.hypot(points[..., 0] + field.offset_m, points[..., 1]) < field.disc_m
    return points[inside], weight[inside]


def strains(touch: Touch, field: RimField, points: np.ndarray) -> np.ndarray:
    """Driving strains (3, n) in the order of STRAINS."""
    radius = np.hypot(*points.T)
    meridian, hoop, normal = (s[:, None, None] for s in stretches(touch, radius))
    out = points / radius[:, None]
    old = hoop * np.eye(2) + (meridian - hoop) * out[:, :, None] * out[:, None]
    metric, factor = changes(field, points)
    first, second = np.sqrt(np.linalg.eigvalsh(old @ metric @ old).T)
    return np.stack([driving_strain(s, first, second, normal[:, 0, 0] * factor) for s in STRAINS])


def moved_outwards(touch: Touch, field: RimField, points: np.ndarray) -> np.ndarray:
    """Radial displacement (n,), m."""
    radius, angle = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    start = OffsetDisc(field.disc_m, field.offset_m).start(radius)
    at = np.column_stack([np.clip(radius, *field.radius_m[[0, -1]]), (angle - start) / (np.pi - start)])
    added = RegularGridInterpolator((field.radius_m, field.share), field.displacement_m[..., :2])(at)
    added = np.sum(added * points, axis=1) / radius * (radius <= field.radius_m[-1])
    return np.interp(radius, touch.radius_m, touch.u_r_m) + added


def signal(punch: Punch, touch: Touch, strain: str) -> np.ndarray:
    return solve(Body(), Skin(strain=strain), Electrodes(), Drive(), ((punch, touch),), SKIN_LAW, signal=0.1,
                 method="mesh").signal_V


def two_norm(values: np.ndarray, weight: np.ndarray) -> float:
    return float(np.sqrt(np.sum(weight * values**2)))


def apart(punch: Punch, touch: Touch, reference: Touch) -> dict[str, float]:
    """Relative differences of two touches with fields of the rim."""
    assert touch.rim is not None
    assert reference.rim is not None
    points, weight = places(reference, reference.rim)
    pair = ((touch, touch.rim), (reference, reference.rim))
    a, b = (moved_outwards(t, field, points) for t, field in pair)
    out = {"depth": touch.depth_m / reference.depth_m - 1, "u_r": two_norm(a - b, weight) / two_norm(b, weight)}
    one, other = (strains(t, field, points) for t, field in pair)
    for name, a, b in zip(STRAINS, one, other, strict=True):
        out[f"{name}_L2"] = two_norm(a - b, weight) / two_norm(b, weight)
        out[f"{name}_max"] = float(np.abs(a - b).max() / np.abs(b).max())
        first, second = (signal(punch, t, name) for t in (touch, reference))
        out[f"dV_{name}"] = float(np.linalg.norm(first - second) / np.linalg.norm(second))
    return out


def hand_over_m(diameter_m: float) -> float:
    """Least gap, m, at which the plan of a default scene leaves the rim out."""
    gaps = np.arange(0.001, 0.08, 0.0001)
    return float(next(g for g in gaps if not Case(Scene(punches=(at(diameter_m, 1.0, float(g)),))).near))


def effect(diameter_m: float, force_N: float, gaps_m: Sequence[float] = GAPS_M,
           what: str = "effect") -> list[dict[str, object]]:
    far = solve_touch(TABLE_1, Body(), at(diameter_m, force_N, 0.05))
    out = []
    for gap in gaps_m:
        punch, begun = at(diameter_m, force_N, gap), time.process_time()
        change = rim_change(TABLE_1, Body(), punch)
        seconds, near = time.process_time() - begun, apply_correction(far, change)
        plain = replace(far, rim=no_correction(change.field))
        out.append({"what": what, "d_mm": diameter_m * 1e3, "force_N": force_N, "gap_mm": gap * 1e3,
                    **apart(punch, plain, near), "depth": change.depth_m / far.depth_m, "cpu_s": seconds})
        print(pd.DataFrame(out[-1:]).to_string(index=False, header=len(out) == 1), flush=True)
    return out


def error(diameter_m: float, force_N: float, gap_m: float) -> list[dict[str, object]]:
    punch = at(diameter_m, force_N, gap_m)
    far = solve_touch(TABLE_1, Body(), punch)
    return compared("error", punch, far, apply_correction(far, rim_change(TABLE_1, Body(), punch, FINER)))


def series(centre_m: float) -> list[dict[str, object]]:
    punch = at(0.014, 1.0, centre_m - 0.007)
    far = solve_touch(TABLE_1, Body(), punch)
    fine = solve_touch(TABLE_1, Body(), punch, element_m=default_element_m(Body(), punch) / 2)
    return compared("series", punch, far, apply_correction(fine, rim_change(TABLE_1, Body(), punch, WHOLE_DISC)))


def compared(what: str, punch: Punch, far: Touch, reference: Touch) -> list[dict[str, object]]:
    touch = with_signal_errors(on_two_meshes(far, TABLE_1, Body(), punch, coarse=COARSE, fine=FINE))
    force_N = punch.force_N
    gap_m = Body().radius_m - punch.x_m - punch.diameter_m / 2
    row = {"what": what, "d_mm": punch.diameter_m * 1e3, "force_N": force_N, "gap_mm": gap_m * 1e3,
           **apart(punch, touch, reference), "cpu_s": touch.cpu_s,
           "depth_estimate": touch.depth_error - far.depth_error,
           "signal_estimate": touch.signal_errors[0] - far.signal_errors[0]}
    print(pd.DataFrame([row]).to_string(index=False, header=False), flush=True)
    return [row]


def main() -> None:
    rows = [row for case in CASES for row in effect(*case)]
    rows += [row for d, force in HANDED_OVER for row in effect(d, force, [hand_over_m(d)], "hand-over")]
    rows += [row for case in COMPARED for row in error(*case)] + [row for centre in SERIES_M for row in series(centre)]
    shown(written(rows, "rim"))


if __name__ == "__main__":
    main()
