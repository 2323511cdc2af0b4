"""Whether the estimated errors of touches hold: 104 random profiles against meshes of half the element size whose
contact is four times as stiff.

The first scenes are those that a review found too small, rounded as it printed them; every other is drawn from the seed
(SEED, k) alone: flat, sphere, cone and ellipse in turn, 6 to 20 mm, 0.01 to 2 N evenly in the logarithm, fillets of 0.3
to 1.5 mm, half-angles of 30 to 75 degrees, two laws. Far from the rim and without friction. The signal is the dipole
response, the mechanics' share of it: what the electrics add is in electrics_random.py. A run continues where
results/touch_errors.csv ends, --seconds S starts no scene after S seconds.
"""

import argparse
import csv
import math
import time
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import CONDITIONS, RESULTS, conditions, quick
from random_scenes import LAWS

from eitsim.mechanics.axisymmetric import surface
from eitsim.mechanics.axisymmetric.continuation import carried_over, cold_start
from eitsim.mechanics.axisymmetric.indentation import (
    Equilibrium,
    IndentationProblem,
    equilibrium,
    indentation_problem,
)
from eitsim.mechanics.axisymmetric.solve_axisymmetric import (
    force_unit,
    mesh_hierarchy,
    penalty_errors,
    strain_changes,
    touch_of,
    under_force,
)
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import of_strain
from eitsim.scene.scene import Body, Punch, profile_of
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import NotConverged

SCENES, SEED, BODY, STRAIN = 104, 77, Body(), "normal"
# The reference: element size over the default one, and stiffness of the contact over its default.
FINER, STIFFER = 1 / 2, 4.0
# diameter in mm, force in N, fillet in mm
REVIEWED = (("sphere", 6.6, 0.031, 1.34), ("cone", 7.0, 0.014, 1.39), ("cone", 19.2, 1.14, 0.5),
            ("cone", 11.4, 0.178, 0.5))
LEAST = 1e-3  # the least error of the contact area that two meshes estimate
QUANTITIES = ("depth", "sigma_max", "A_c", "strain", "signal")
COLUMNS = ("scene", "law", "profile", "d_mm", "F_N", "fillet_mm", "half_angle_deg",
           *(f"{name}_{kind}" for name in QUANTITIES for kind in ("estimate", "error")), "A_c_meshes", "strain_meshes",
           "cpu_s", "penalty_cpu_s", "reference_cpu_s", *CONDITIONS)


def scene_of(k: int) -> tuple[str, Punch]:
    """Name of the law, and the punch of scene k."""
    rng, law = np.random.default_rng([SEED, k]), ("Table 1", "stable refit")[k // 4 % 2]
    if k < len(REVIEWED):
        profile, diameter, force, fillet = REVIEWED[k]
        return law, Punch(diameter_m=diameter * 1e-3, force_N=force, profile=profile, fillet_m=fillet * 1e-3)
    profile, diameter = ("flat", "sphere", "cone", "ellipse")[k % 4], rng.uniform(6, 20)
    force, fillet = math.exp(rng.uniform(math.log(0.01), math.log(2))), rng.uniform(0.3, 1.5)
    return law, Punch(diameter_m=diameter * 1e-3, force_N=force, profile=profile, fillet_m=fillet * 1e-3,
                      half_angle_rad=math.radians(rng.uniform(30, 75)))


def errors_of(law: Hyperfoam, punch: Punch) -> dict[str, float]:
    """Estimated errors of a touch and its distance from the reference, what two meshes alone estimate, CPU seconds."""
    assert punch.force_N is not None
    start, force = time.process_time(), punch.force_N / force_unit(law, BODY)
    levels = mesh_hierarchy(law, BODY, punch, None, None)
    states = under_force(levels, force)
    touch = touch_of(law, BODY, levels, states, start)
    solved = time.process_time()
    by_penalty = penalty_errors(levels[-2], states[-2])
    softened, profile = time.process_time(), profile_of(punch)
    fine = Punch(diameter_m=punch.diameter_m, force_N=punch.force_N, profile=punch.profile,
                 fillet_m=profile.edge_radius, half_angle_rad=punch.half_angle_rad)
    usual, stiff = (indentation_problem(law, BODY, fine, FINER * default_element_m(BODY, fine),
                                        more * profile.default_penalty) for more in (1.0, STIFFER))
    exact = equilibrium(stiff, force, _reference(levels[-1], states[-1], usual).x)
    contact = surface.contact_of(stiff, exact.x)
    off = {"depth": touch.depth_m / (exact.depth * BODY.thickness_m),
           "sigma_max": touch.sigma_max_Pa / (contact.pressure.max() * law.mu_0_Pa),
           "A_c": touch.contact_area_m2 / (min(contact.area, np.pi * stiff.punch.profile.radius**2)
                                           * BODY.thickness_m**2),
           "signal": of_strain(surface.dipole_responses(levels[-1], states[-1].x), STRAIN)
                     / of_strain(surface.dipole_responses(stiff, exact.x), STRAIN)}
    before, after = (surface.contact_of(m, s.x).area for m, s in zip(levels[-2:], states[-2:], strict=True))
    true = {name: abs(ratio - 1) for name, ratio in off.items()}
    true["strain"] = of_strain(strain_changes((stiff, exact.x), (levels[-1], states[-1].x)), STRAIN)
    estimate = {"depth": touch.depth_error, "sigma_max": touch.sigma_max_error, "A_c": touch.contact_area_error,
                "strain": of_strain(touch.strain_errors, STRAIN), "signal": of_strain(touch.signal_errors, STRAIN)}
    assert estimate["A_c"] is not None
    assert estimate["strain"] is not None
    return {**{f"{name}_estimate": error for name, error in estimate.items() if error is not None},
            **{f"{name}_error": error for name, error in true.items()},
            "A_c_meshes": max(abs(before / after - 1), LEAST),
            "strain_meshes": estimate["strain"] - of_strain(by_penalty[1], STRAIN),
            "cpu_s": solved - start, "penalty_cpu_s": softened - solved,
            "reference_cpu_s": time.process_time() - softened}


def _reference(model: IndentationProblem, state: Equilibrium, finer: IndentationProblem) -> Equilibrium:
    """A state on a finer mesh; from rest, however long that takes, where it cannot start there."""
    try:
        return carried_over(model, state, finer)
    except NotConverged:
        return cold_start(finer, state.force)


def solve_missing(path: Path, last: int, seconds: float) -> None:
    """Append the scenes before `last` that the table lacks."""
    done = set(pd.read_csv(path)["scene"]) if path.exists() else set()
    begun, fresh = time.perf_counter(), not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if fresh:
            writer.writeheader()
        for k in range(last):
            if k in done or time.perf_counter() - begun > seconds:
                continue
            name, punch = scene_of(k)
            assert punch.force_N is not None
            row = {"scene": k, "law": name, "profile": punch.profile, "d_mm": punch.diameter_m * 1e3,
                   "F_N": punch.force_N, "fillet_mm": punch.fillet_m * 1e3,
                   "half_angle_deg": math.degrees(punch.half_angle_rad), **errors_of(LAWS[name], punch), **conditions()}
            writer.writerow({key: f"{cell:.4g}" if isinstance(cell, float) else cell for key, cell in row.items()})
            file.flush()


def summary(table: pd.DataFrame) -> str:
    """Share of the scenes whose estimate covers the error and the estimate over the error, by quantity; what the
    contact's stiffness adds to the estimates and to the CPU time."""
    over = {name: table[f"{name}_estimate"] / table[f"{name}_error"] for name in QUANTITIES}
    over |= {f"{name}, meshes alone": table[f"{name}_meshes"] / table[f"{name}_error"] for name in ("A_c", "strain")}
    shares = pd.DataFrame({name: {"covered": (ratio >= 1).mean(), "least": ratio.min(), "median": ratio.median()}
                           for name, ratio in over.items()}).T
    grown = {name: (table[f"{name}_estimate"] / table[f"{name}_meshes"]).median() for name in ("A_c", "strain")}
    cost = (table["penalty_cpu_s"] / (table["cpu_s"] - table["penalty_cpu_s"])).median()
    return (f"{len(table)} scenes\n{shares.to_string(float_format=lambda v: f'{v:.3g}')}\nestimates grown by a median "
            f"of {grown['A_c']:.2f} (A_c), {grown['strain']:.2f} (strain), CPU time by {cost:.1%}")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--last", type=int, default=quick(SCENES, 8))
    options.add_argument("--seconds", type=float, default=float("inf"))
    options.add_argument("--out", type=Path, default=RESULTS / "touch_errors.csv")
    given = options.parse_args()
    given.out.parent.mkdir(exist_ok=True, parents=True)
    solve_missing(given.out, given.last, given.seconds)
    print(summary(pd.read_csv(given.out)))


if __name__ == "__main__":
    main()
