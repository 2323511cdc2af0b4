"""Error against run time of one set of 208 readings: linear and quadratic elements, meshes that know nothing of the
touch and meshes that follow it, direct solutions and updates condensed to the touched part, and rings that scatter.

Run by `make bench`, which pins threads; writes results/electrics.csv next to this file. dV is compared with that on a
mesh of a family of its own (circles of Apollonius, `electrics_random`); reference_change is what dV on the finest
template, of yet another family, is off from it. The touches are solved with Table 1's foam and are axisymmetric also
near the rim, so that every method solves the same problem.

cpu_ms is the least CPU time of a run, over batches after the first, and counts all that another touch at another place
costs; for a fixed mesh not its order of elimination and the untouched skin, for a condensed update only what another
conductance of the same touched part costs. kept_ms is what was left out so.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from condensed import condensed
from conditions import quick, shown, written
from electrics_random import BODY, DRIVE, ELECTRODES, FINEST, SKIN, distance, reference_mesh, signal_on
from materials import SKIN_LAW, TABLE_1
from timing import least_cpu_s

from eitsim.electrics.cem.assembly import SkinMesh, dissection, impedance, quadrature_points
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh, template
from eitsim.electrics.mesh.symmetric_mesh import alike_mesh
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.drive import read_out
from eitsim.scene.results import Touch
from eitsim.scene.scene import Punch
from eitsim.sheet.sheet_conductance import sheet_conductance, untouched_conductance

CENTRAL = (Punch(), Punch(0.05, 0.01, 0.010, 2.0), Punch(0.06, -0.02, 0.018, 0.5))[:quick(3, 1)]
NEAR_RIM = (Punch(-0.05, 0.065),)[:quick(1, 0)]
Z_OHM_M = ELECTRODES.contact_impedance_Ohm_m
FIXED_LEVELS, TEMPLATE_LEVELS, HALVINGS, FINEST_TEMPLATE = (2, 4, 8), (1, 2, 4), (0, 1, 2), 6
# A condensed update takes the conductance to change out to where it last does by this part.
CHANGED = 1e-4
REPEATS = quick(3, 1)


@dataclass(frozen=True)
class Way:
    """One way to dV."""

    method: str
    setting: str
    elements: int
    unknowns: int
    # dV, V, and what of the work is not done again
    run: Callable[[], np.ndarray]
    kept_ms: float = 0.0


def fixed_mesh(level: int) -> SkinMesh:
    """Quadratic triangles on concentric rings that know nothing of the touch."""
    angles, electrode = rim_angles(BODY, ELECTRODES, level)
    radii = np.linspace(0, BODY.radius_m, 5 * level + 1)
    rings = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, ELECTRODES.count)
    inmost, outer = rings.cells[:len(angles)], rings.cells[len(angles):]
    cells = np.concatenate([inmost[:, [0, 1, 2, 4, 5, 6]], outer[:, [0, 1, 2, 4, 5, 8]], outer[:, [0, 2, 3, 8, 6, 7]]])
    used, cells = np.unique(cells, return_inverse=True)
    return replace(rings, nodes_m=rings.nodes_m[used], cells=cells.reshape(-1, 6),
                   under=np.searchsorted(used, rings.under), element="P2")


def linear(mesh: SkinMesh) -> SkinMesh:
    """Four linear triangles on the nodes of each quadratic one."""
    cells = mesh.cells[:, [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)]].reshape(-1, 3)
    edges = mesh.under[:, [(0, 2), (2, 1)]].reshape(-1, 2)
    return replace(mesh, cells=cells, under=edges, electrode=np.repeat(mesh.electrode, 2), element="P1")


def conductance(mesh: SkinMesh, punch: Punch, touch: Touch) -> np.ndarray:
    return sheet_conductance(quadrature_points(mesh), punch, touch, SKIN, SKIN_LAW)


def untouched(mesh: SkinMesh) -> np.ndarray:
    return np.full(len(mesh.cells), untouched_conductance(SKIN_LAW, SKIN))


def direct(mesh: SkinMesh, punch: Punch, touch: Touch, method: str, setting: str) -> Way:
    """On a mesh that stays: its order of elimination and the untouched skin are kept."""
    kept = 1e3 * least_cpu_s(lambda: impedance(mesh, untouched(mesh), Z_OHM_M, order=dissection(mesh)), 2)
    order = dissection(mesh)
    before = impedance(mesh, untouched(mesh), Z_OHM_M, order=order)
    return Way(method, setting, len(mesh.cells), len(mesh.nodes_m) + mesh.count - 1, lambda: read_out(
        DRIVE, impedance(mesh, conductance(mesh, punch, touch), Z_OHM_M, order=order) - before), kept)


def update(made: Callable[[], SkinMesh], punch: Punch, touch: Touch, method: str, setting: str) -> Way:
    """Condensed to the cells about the touch; the untouched skin is updated in the same way."""
    mesh, same = made(), untouched_conductance(SKIN_LAW, SKIN)
    inside = changed_cells(mesh, punch, touch)
    kept = 1e3 * least_cpu_s(lambda: condensed(made(), inside, same, Z_OHM_M), 2)
    patch, to_impedance = condensed(mesh, inside, same, Z_OHM_M)
    before = to_impedance(untouched(patch))
    return Way(method, setting, len(patch.cells), len(np.unique(patch.cells)) + mesh.count - 1, lambda: read_out(
        DRIVE, to_impedance(conductance(patch, punch, touch)) - before), kept)


def changed_cells(mesh: SkinMesh, punch: Punch, touch: Touch) -> np.ndarray:
    """(cells,) those in a circle about the punch beyond which the conductance changes by less than CHANGED."""
    away = np.hypot(*(quadrature_points(mesh).mean(axis=1) - np.array([punch.x_m, punch.y_m])).T)
    change = np.abs(conductance(mesh, punch, touch) / untouched_conductance(SKIN_LAW, SKIN) - np.eye(2))
    return away <= away[change.max(axis=(1, 2, 3)) > CHANGED].max()


def following(punch: Punch, touch: Touch, method: str, setting: str, made: Callable[[], SkinMesh]) -> Way:
    """On a mesh made for this touch: everything counts."""
    mesh = made()
    return Way(method, setting, len(mesh.cells), len(mesh.nodes_m) + mesh.count - 1,
               lambda: signal_on(made(), punch, touch))


def lean(punch: Punch, touch: Touch, halvings: int) -> SkinMesh:
    """The default near the rim: curved triangles that follow the touch, halved."""
    mesh = alike_mesh(BODY, ELECTRODES, ((punch, touch),))
    for _ in range(halvings):
        mesh = uniform_refinement(mesh)
    return mesh


def scattering(punch: Punch, touch: Touch) -> Way:
    given = (BODY, SKIN, ELECTRODES, DRIVE, ((punch, touch),), SKIN_LAW)
    return Way("rings that scatter", "16 harmonics", 0, solve(*given, method="multipole").unknowns,
               lambda: solve(*given, method="multipole").signal_V)


def ways(punch: Punch, touch: Touch) -> Iterator[Way]:
    for level in FIXED_LEVELS:
        mesh, setting = fixed_mesh(level), f"{5 * level} rings"
        for element, one in (("P1", linear(mesh)), ("P2", mesh)):
            yield direct(one, punch, touch, f"{element}, fixed", setting)
            yield update(lambda one=one: one, punch, touch, f"{element}, fixed, condensed", setting)
    for n in HALVINGS:
        setting = "not halved" if n == 0 else "halved once" if n == 1 else f"halved {n} times"
        yield following(punch, touch, "P1 that follows", setting, lambda n=n: linear(lean(punch, touch, n)))
        yield following(punch, touch, "P2 that follows", setting, lambda n=n: lean(punch, touch, n))
        yield update(lambda n=n: lean(punch, touch, n), punch, touch, "P2 that follows, condensed", setting)
    for level in TEMPLATE_LEVELS:
        yield following(punch, touch, "Q2 that follows", f"level {level}",
                        lambda n=level: template(BODY, ELECTRODES, punch, touch, n))
    yield scattering(punch, touch)


def rows(punch: Punch, place: str) -> Iterator[dict[str, object]]:
    touch = solve_touch(TABLE_1, BODY, punch)
    exact = signal_on(reference_mesh(punch, touch, FINEST), punch, touch)
    change = distance(signal_on(template(BODY, ELECTRODES, punch, touch, FINEST_TEMPLATE), punch, touch), exact)
    gap = BODY.radius_m - np.hypot(punch.x_m, punch.y_m) - punch.diameter_m / 2
    problem = f"{place}, d = {punch.diameter_m * 1e3:g} mm, {punch.force_N:g} N, {gap * 1e3:.0f} mm from the rim"
    for way in ways(punch, touch):
        signal = way.run()
        yield {"touch": problem, "method": way.method, "setting": way.setting, "elements": way.elements,
               "unknowns": way.unknowns, "dv_error": distance(signal, exact),
               "cpu_ms": 1e3 * least_cpu_s(way.run, REPEATS), "kept_ms": way.kept_ms, "reference_change": change}


def sensor() -> dict[str, object]:
    """What a new card costs once: the untouched skin."""
    conductances = (6e-4 * (1 + 0.01 * k) for k in itertools.count())
    return {"touch": "untouched, once a card", "method": "rim integral equation",
            "cpu_ms": 1e3 * least_cpu_s(lambda: solve_rim(BODY, ELECTRODES, next(conductances)), REPEATS)}


def main() -> None:
    places = [*((punch, "inside") for punch in CENTRAL), *((punch, "near the rim") for punch in NEAR_RIM)]
    table = pd.DataFrame([*(row for punch, place in places for row in rows(punch, place)), sensor()])
    table = table.astype({"elements": "Int64", "unknowns": "Int64"})
    shown(written(table, "electrics"))


if __name__ == "__main__":
    main()
