"""Convergence of the axisymmetric touch on four meshes and two orders of elements, against a finer one.

Depth, contact area, largest pressure (a facet's average, for the fillet stated) and the surface's strains: through the
thickness, and in its plane (meridian and hoop together), in L2 over the area of the contact and outside it, each over
the norm on the whole surface, as the skin reads them from a touch. The reference has quadratic elements of half the
least size listed. Rates are fitted to the changes from one mesh to the next, which no reference can flatter. Each
touch's last row has ten times the default penalty of the contact. Run by `make bench`,
which pins threads; writes results/convergence.csv and results/convergence_rates.csv next to this file.
"""

import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd
from conditions import quick, shown, written
from materials import TABLE_1

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import ELEMENTS, default_element_m
from eitsim.scene.profiles.rounded_cone import Flat
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch

# Touches and the reference's element size over the default one; a sphere's elements are small all over its face.
TOUCHES = {"d = 10 mm, 2 N": (Punch(diameter_m=0.010, force_N=2.0), 0.25),
           "d = 14 mm, 1 N": (Punch(diameter_m=0.014, force_N=1.0), 0.25),
           "d = 18 mm, 0.5 N": (Punch(diameter_m=0.018, force_N=0.5), 0.25),
           "sphere, d = 14 mm, 0.5 N": (Punch(diameter_m=0.014, force_N=0.5, profile="sphere"), 0.5)}
# Element sizes over the reference's.
COARSER = (16.0, 8.0, 4.0, 2.0)
STRAINS = ("normal_contact_L2", "normal_outside_L2", "plane_contact_L2", "plane_outside_L2")
SCALARS = ("depth", "area", "sigma_max")


def solved(punch: Punch, size: float, order: int, penalty: float = Flat.default_penalty) -> Touch:
    return solve_touch(TABLE_1, Body(), punch, element_m=size * default_element_m(Body(), punch), order=order,
                       penalty=penalty)


def differences(touch: Touch, other: Touch) -> dict[str, float]:
    """Relative differences of a touch from another, finer one."""
    scalars = [abs(a / b - 1) for a, b in ((touch.depth_m, other.depth_m),
                                          (touch.contact_area_m2, other.contact_area_m2),
                                          (touch.sigma_max_Pa, other.sigma_max_Pa))]
    normal = strain_difference(touch, other, ("stretch_normal",))
    plane = strain_difference(touch, other, ("stretch_meridian", "stretch_hoop"))
    return dict(zip(SCALARS + STRAINS, (*scalars, *normal, *plane), strict=True))


def strain_difference(touch: Touch, other: Touch, names: Sequence[str]) -> tuple[float, float]:
    """L2 norms over the contact and outside it of the difference in these strains, over the whole norm."""
    r = np.union1d(touch.radius_m, other.radius_m)
    ours, theirs = (np.stack([np.interp(r, t.radius_m, getattr(t, name)) for name in names]) for t in (touch, other))
    square, whole = ((ours - theirs) ** 2).sum(axis=0) * r, ((theirs - 1) ** 2).sum(axis=0) * r
    size, inside = np.trapezoid(whole, r), r <= other.contact_radius_m
    return (float(np.sqrt(np.trapezoid(square[inside], r[inside]) / size)),
            float(np.sqrt(np.trapezoid(square[~inside], r[~inside]) / size)))


def row(name: str, punch: Punch, size: float, order: int, penalty: float, touch: Touch,
        reference: Touch) -> dict[str, object]:
    fillet = punch.diameter_m / 2 if punch.profile == "sphere" else punch.fillet_m
    errors = {f"{key}_error": value for key, value in differences(touch, reference).items()}
    return {"touch": name, "fillet_mm": fillet * 1e3, "order": order,
            "element_um": size * default_element_m(Body(), punch) * 1e6,
            "penalty_over_default": penalty / Flat.default_penalty,
            "depth_mm": touch.depth_m * 1e3, "A_c_mm2": touch.contact_area_m2 * 1e6,
            "sigma_max_kPa": touch.sigma_max_Pa / 1e3, **errors, "iterations": touch.iterations,
            "cpu_s": touch.cpu_s}


def study(name: str, punch: Punch, finest: float) -> tuple[list[dict[str, object]], list[dict[str, object]]]:
    """Rows of errors and of fitted rates for one touch."""
    reference = solved(punch, finest, max(ELEMENTS))
    rows, rates, sizes = [], [], [finest * coarser for coarser in COARSER]
    for order in ELEMENTS:
        touches = [solved(punch, size, order) for size in sizes]
        rows += [row(name, punch, size, order, Flat.default_penalty, touch, reference)
                 for size, touch in zip(sizes, touches, strict=True)]
        changes = pd.DataFrame([differences(a, b) for a, b in itertools.pairwise(touches)])
        rates.append({"touch": name, "order": order, **{key: rate(changes[key].to_numpy()) for key in changes}})
    stiff = solved(punch, 1.0, max(ELEMENTS), 10 * Flat.default_penalty)
    return [*rows, row(name, punch, 1.0, max(ELEMENTS), 10 * Flat.default_penalty, stiff, reference)], rates


def rate(changes: np.ndarray) -> float:
    """Power of the element size in changes from one mesh to the next, each of half the size of the one before."""
    return -float(np.polyfit(np.arange(len(changes)), np.log2(changes), 1)[0])


def main() -> None:
    solved(Punch(), 8.0, 1)  # compiles the kernels
    studies = [study(name, punch, finest) for name, (punch, finest) in [*TOUCHES.items()][:quick(None, 1)]]
    for part, name in enumerate(("convergence", "convergence_rates")):
        shown(written([line for rows in studies for line in rows[part]], name))


if __name__ == "__main__":
    main()
