"""Work against precision of two touches: every mesh and order of ours, CalculiX and FElupe on the same problems.

Flat: d = 14 mm, fillet 0.5 mm, 1 N; sphere: d = 14 mm, 0.5 N; Table 1's foam, frictionless. Errors in depth and in the
surface's strains (L2 over its area; peers print displacements, from which the strains in the plane follow) against our
finest mesh; CPU seconds of the solve, for CalculiX of its whole process, for FElupe without its imports. CalculiX runs
with axisymmetric elements, which it turns into a sector of solids itself; with hyperfoam everywhere it fails, and so it
gets a linear elastic far field. FElupe has no filleted punch, so it solves the sphere alone. A peer that is not
installed is left out with a note; FELUPE_PYTHON may name an interpreter that has FElupe. Run by `make bench`, which
pins threads; writes results/peers_mechanics.csv next to this file.
"""

import itertools
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import quick, written
from materials import TABLE_1
from peers import calculix

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_path, solve_touch
from eitsim.mechanics.solid.grid import ELEMENTS, default_element_m, foam_grid
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch
from touchcal.errors import NotConverged

BODY = Body()
FLAT, SPHERE = Punch(diameter_m=0.014, force_N=1.0), Punch(diameter_m=0.014, force_N=0.5, profile="sphere")
TOUCHES = {"flat, d = 14 mm, 1 N": (FLAT, 0.25), "sphere, d = 14 mm, 0.5 N": (SPHERE, 0.5)}
SIZES, REPEATS = quick((4.0, 2.0, 1.0, 0.5), (4.0, 2.0, 1.0)), quick(3, 1)
# A whole path: twelve even forces, N, up to three, on meshes down to this size.
PATH_N = np.linspace(0.25, 3.0, 12)
FINEST_PATH = 1.0
# Element, size over the default, contact, kPa/mm, radius from which the foam is linear elastic, mm.
NODES, FACES = "NODE TO SURFACE", "SURFACE TO SURFACE"
CALCULIX = (("CAX4", 4.0, NODES, 1e4, 12.0), ("CAX4", 2.0, NODES, 1e4, 12.0), ("CAX4", 2.0, NODES, 1e4, 9.0),
            ("CAX4", 4.0, NODES, 1e4, np.inf), ("CAX4", 2.0, FACES, 1e4, 12.0), ("CAX8R", 4.0, FACES, 1e4, 12.0))
# Largest steps of CalculiX, tried in turn until one reaches the force; whether it does is a matter of luck.
STEPS = (0.1, 0.093, 0.05)
# CPU seconds that a run of a peer may take.
LIMIT_S = quick(90, 40)
COLUMNS = ["touch", "method", "setting", "element_um", "depth_mm", "depth_error", "normal_strain_error_L2",
           "plane_strain_error_L2", "cpu_s", "outcome"]
# Size over the default and penalty at a node, mN/mm, beta and steps to the depth.
FELUPE = ((8.0, 1e4, 1e-3, 40), (4.0, 1e4, 1e-3, 40), (2.0, 1e4, 1e-3, 40), (2.0, 1e4, 1e-4, 40))


def element_m(punch: Punch, size: float) -> float:
    return size * default_element_m(BODY, punch)


def strain_error(radius: np.ndarray, stretches: np.ndarray, reference: Touch, names: tuple[str, ...]) -> float:
    """Relative L2 error over the surface of stretches (names, points) at reference radii, m."""
    r = reference.radius_m
    expected = np.stack([getattr(reference, name) for name in names]) - 1
    difference = np.stack([np.interp(r, radius, s) for s in stretches]) - 1 - expected
    return float(np.sqrt(np.trapezoid((difference**2).sum(axis=0) * r, r)
                         / np.trapezoid((expected**2).sum(axis=0) * r, r)))


def of_touch(touch: Touch, reference: Touch) -> dict[str, object]:
    normal, plane = (("stretch_normal",), ("stretch_meridian", "stretch_hoop"))
    errors = [strain_error(touch.radius_m, np.stack([getattr(touch, n) for n in names]), reference, names)
              for names in (normal, plane)]
    return {"depth_mm": touch.depth_m * 1e3, "depth_error": abs(touch.depth_m / reference.depth_m - 1),
            "normal_strain_error_L2": errors[0], "plane_strain_error_L2": errors[1], "outcome": "ok"}


def ours(punch: Punch, reference: Touch, sizes: Sequence[float]) -> Iterator[dict[str, object]]:
    """Rows of single forces from rest, and of each mesh's share of a whole path for the flat punch."""
    for order in ELEMENTS:
        for size in sizes:
            keys = {"element_m": element_m(punch, size), "order": order}
            touches = [solve_touch(TABLE_1, BODY, punch, **keys) for _ in range(REPEATS)]
            row = {"method": "ours, one force from rest", "setting": f"order {order}", "element_um":
                   keys["element_m"] * 1e6, "cpu_s": float(np.median([t.cpu_s for t in touches]))}
            yield row | of_touch(touches[0], reference)
            if punch.profile == "flat" and size >= FINEST_PATH:
                yield row | whole_path(punch, reference, **keys)


def whole_path(punch: Punch, reference: Touch, element_m: float, order: int) -> dict[str, object]:
    """A path's time, and its errors at the reference's force."""
    begun, found = time.process_time(), dict[str, object]()
    try:
        path = solve_path(TABLE_1, BODY, punch, list(PATH_N), element_m=element_m, order=order)
        (there,) = (t for t in path if abs(t.force_N / reference.force_N - 1) < 1e-9)
        found = of_touch(there, reference)
    except NotConverged as error:
        found["outcome"] = f"not converged: {error}"
    return found | {"method": f"ours, path of {len(PATH_N)} forces to 3 N", "cpu_s": time.process_time() - begun}


def of_path(depth: np.ndarray, force: np.ndarray, radius_m: np.ndarray, moved_m: np.ndarray, wanted_N: float,
            reference: Touch) -> dict[str, object]:
    """Errors of a peer at a force between its steps: depth and the strains in the plane of straight facets."""
    beyond = np.flatnonzero(force >= wanted_N)
    if not beyond.size or beyond[0] == 0:
        return {}
    k = int(beyond[0])
    share = (wanted_N - force[k - 1]) / (force[k] - force[k - 1])
    found = depth[k - 1] + share * (depth[k] - depth[k - 1])
    now = (1 - share) * moved_m[k - 1] + share * moved_m[k] + np.column_stack([radius_m, np.zeros(len(radius_m))])
    meridian = np.hypot(*np.diff(now, axis=0).T) / np.diff(radius_m)
    middle = (radius_m[1:] + radius_m[:-1]) / 2
    stretches = np.stack([meridian, (now[1:, 0] + now[:-1, 0]) / 2 / middle])
    return {"depth_mm": found, "depth_error": abs(found / (reference.depth_m * 1e3) - 1), "plane_strain_error_L2":
            strain_error(middle, stretches, reference, ("stretch_meridian", "stretch_hoop"))}


def by_calculix(punch: Punch, reference: Touch) -> Iterator[dict[str, object]]:
    if shutil.which("ccx") is None or punch.profile != "flat":
        print("CalculiX: not installed" if punch.profile == "flat" else "CalculiX: the flat punch only")
        return
    version = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout.split()[-1]
    for element, size, pairing, penalty, beyond in CALCULIX[:quick(None, 1)]:
        settings = calculix.Settings(element, element_m(punch, size), pairing, penalty, beyond)
        run, found = calculix_attempts(punch, reference, settings)
        far = "hyperfoam everywhere" if np.isinf(beyond) else f"linear elastic beyond {beyond:g} mm"
        yield {"method": f"CalculiX {version}", "setting": f"{element}, {pairing.lower()}, {penalty:g} kPa/mm, {far}",
               "element_um": settings.size_m * 1e6, "cpu_s": run.cpu_s, "outcome": run.outcome} | found


def calculix_attempts(punch: Punch, reference: Touch,
                      settings: calculix.Settings) -> tuple[calculix.Run, dict[str, object]]:
    """The first run that reaches the force, or the last one; its time is its own alone."""
    tried = []
    for step in STEPS:
        run = calculix.run(TABLE_1, BODY, punch, reference.depth_m * 1e3, replace(settings, step=step), LIMIT_S)
        found = of_path(run.depth, run.force, run.radius * 1e-3, run.surface * 1e-3, punch.force_N or 0.0, reference)
        tried.append("ends below the force" if run.outcome == "ok" and not found else run.outcome)
        if found:
            break
    return replace(run, outcome="; then ".join(tried)), found


def by_felupe(punch: Punch, reference: Touch) -> Iterator[dict[str, object]]:
    python = os.environ.get("FELUPE_PYTHON", sys.executable)
    if subprocess.run([python, "-c", "import felupe, tensortrax"], capture_output=True, check=False).returncode:
        print("FElupe: not installed (FELUPE_PYTHON may name an interpreter that has it)")
        return
    if punch.profile != "sphere":
        print("FElupe: the sphere only, it has no filleted punch")
        return
    for size, penalty, beta, steps in FELUPE[:quick(None, 2)]:
        yield felupe_row(python, punch, reference, size, penalty, beta, steps)


def felupe_row(python: str, punch: Punch, reference: Touch, size: float, penalty: float, beta: float,
               steps: int) -> dict[str, object]:
    rounded = replace(punch, fillet_m=punch.diameter_m / 2)
    grid, unit = foam_grid(BODY, rounded, element_m(punch, size), 1), BODY.thickness_m * 1e3
    surface = np.unique(grid.top)
    near = surface[grid.nodes[surface, 0] * unit < punch.diameter_m * 500 + 2]
    depths = np.linspace(0, 1.06 * reference.depth_m * 1e3, steps + 1)[1:]
    row: dict[str, object] = {"setting": f"bilinear, {penalty:g} mN/mm at a node, beta {beta:g}, {steps} steps",
                              "element_um": element_m(punch, size) * 1e6}
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "problem.npz", nodes=grid.nodes * unit, cells=grid.counter_clockwise, top=near,
                 surface=surface, depths=depths, radius=punch.diameter_m * 500, penalty=penalty, beta=beta,
                 mu=TABLE_1.mu_Pa / 1e3, alpha=TABLE_1.alpha)
        script = Path(__file__).parent / "peers" / "felupe_sphere.py"
        done = subprocess.run([python, str(script), folder], capture_output=True, text=True, check=False)
        if done.returncode:
            return row | {"method": "FElupe", "outcome": f"failed: {done.stderr.strip().splitlines()[-1]}"}
        found = np.load(Path(folder) / "found.npz")
        errors = of_path(depths, found["force"] / 1e3, grid.nodes[surface, 0] * BODY.thickness_m,
                         found["surface"] * 1e-3, punch.force_N or 0.0, reference)
        return row | {"method": f"FElupe {found['version']}", "cpu_s": float(found["cpu_s"]), "outcome": "ok"} | errors


def main() -> None:
    solve_touch(TABLE_1, BODY, FLAT, element_m=element_m(FLAT, 8.0))  # compiles the kernels
    rows: list[dict[str, object]] = []
    for name, (punch, finest) in TOUCHES.items():
        reference = solve_touch(TABLE_1, BODY, punch, element_m=element_m(punch, finest))
        for row in itertools.chain(ours(punch, reference, [size for size in SIZES if size > finest]),
                                   by_calculix(punch, reference), by_felupe(punch, reference)):
            rows.append({"touch": name, **row})
            print({key: row[key] for key in ("method", "setting", "cpu_s", "outcome") if key in row}, flush=True)
            written(pd.DataFrame(rows).reindex(columns=COLUMNS), "peers_mechanics")


if __name__ == "__main__":
    main()
