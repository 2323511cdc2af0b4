"""Error of the signal of a touch against CPU time: eitsim, EIDORS and pyEIT on the same meshes, and eitsim on its own.

The touch is a smooth fall of an isotropic conductance, S exp(-2 exp(-r^2/w^2)) with w = 7 mm, at two places of a disc
of 0.1 m with 16 electrodes and adjacent patterns; pyEIT does not take the tensors that a stretched skin has. dV of the
208 readings is compared, in the 2-norm, with that of quadratic elements on a fine template; reference_change is its
difference from the next coarser one. On an unstructured mesh of linear triangles, finer and finer, cpu_s is that of one
set of readings for a new conductance, what is kept of the mesh not counted; on eitsim's own mesh, which follows the
place, everything counts. pyEIT's point electrodes are another model, whose error is in its own. Which peers are run,
`electric_peers` says. Run by `make bench`, which pins threads; writes results/peers_signal.csv next to this file.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from conditions import quick, shown, written
from electric_peers import CONTACT_OHM_M, ELECTRODES, RADIUS_M, mesh_of, peers
from materials import TABLE_1
from timing import least_cpu_s

from eitsim.electrics.cem.assembly import SkinMesh, dissection, impedance, quadrature_points
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.mesh.ring_mesh import template
from eitsim.electrics.mesh.symmetric_mesh import alike_mesh
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.drive import read_out
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch

BODY, DRIVE = Body(), Drive(current_A=1.0, reading="differential")
# a quarter of the rim, as on the peers' meshes
ON_RIM = Electrodes(count=ELECTRODES, width_m=2 * np.pi * RADIUS_M / ELECTRODES / 4)
PLACES = {"inside, 49 mm from the rim": Punch(0.05, 0.01), "18 mm from the rim": Punch(-0.05, 0.065)}
WIDTH_M, UNTOUCHED_S, FALL = 7e-3, 1e-3, 2.0
CIRCLES, HALVINGS = quick((14, 28, 55, 109), (14, 28)), quick(("not halved", "halved once", "halved twice"),
                                                              ("not halved",))
# levels of the reference, and of what tells its error
FINEST, FINER = quick((8, 6), (4, 2))


def conductance(mesh: SkinMesh, place: Punch) -> np.ndarray:
    """S at the mesh's quadrature points; on linear triangles their mean in each."""
    away = np.hypot(*np.moveaxis(quadrature_points(mesh) - np.array([place.x_m, place.y_m]), -1, 0))
    found = UNTOUCHED_S * np.exp(-FALL * np.exp(-((away / WIDTH_M) ** 2)))
    return found.mean(axis=1) if mesh.element == "P1" else found


def untouched(mesh: SkinMesh) -> np.ndarray:
    return np.full(len(mesh.cells), UNTOUCHED_S)


def following(place: Punch, touch: Touch, halvings: int) -> SkinMesh:
    """The program's own curved quadratic triangles that follow a touch, halved."""
    mesh = alike_mesh(BODY, ON_RIM, ((place, touch),))
    for _ in range(halvings):
        mesh = uniform_refinement(mesh)
    return mesh


def solved(mesh: SkinMesh, place: Punch) -> list[np.ndarray]:
    """Impedance matrices with the touch and without, Ohm."""
    order = dissection(mesh)
    return [impedance(mesh, s, CONTACT_OHM_M, order=order) for s in (conductance(mesh, place), untouched(mesh))]


def off(signal: np.ndarray, exact: np.ndarray) -> float:
    return float(np.linalg.norm(signal - exact) / np.linalg.norm(exact))


def followed(place: Punch, touch: Touch, exact: np.ndarray) -> Iterator[dict[str, object]]:
    for n, setting in enumerate(HALVINGS):
        after, before = solved(following(place, touch, n), place)
        yield {"method": "eitsim, a mesh that follows the touch", "setting": setting,
               "dv_error": off(read_out(DRIVE, after - before), exact),
               "cpu_s": least_cpu_s(lambda n=n: solved(following(place, touch, n), place))}


def on_mesh(circles: int, references: Mapping[str, list[np.ndarray]]) -> Iterator[dict[str, object]]:
    """Rows of every place by every program that solves linear triangles."""
    mesh = mesh_of(circles)
    order = dissection(mesh)
    setting: dict[str, object] = {"setting": f"{len(mesh.cells)} triangles"}
    cases = np.column_stack([untouched(mesh), *(conductance(mesh, place) for place in PLACES.values())])
    first, *others = (impedance(mesh, case, CONTACT_OHM_M, order=order) for case in cases.T)
    seconds = least_cpu_s(lambda: impedance(mesh, cases[:, 1], CONTACT_OHM_M, order=order))
    for (name, (after, before)), own in zip(references.items(), others, strict=True):
        yield setting | {"touch": name, "method": "eitsim, the peers' mesh", "cpu_s": seconds, "dv_error":
                         off(read_out(DRIVE, own - first), read_out(DRIVE, after - before))}
    for peer in peers(mesh, cases):
        for (name, (after, before)), own in zip(references.items(), peer.readings.T[1:], strict=True):
            yield setting | {"touch": name, "method": peer.method, "peer": peer.version, "cpu_s":
                             float(np.median(peer.seconds[1:])),
                             "dv_error": off(own - peer.readings[:, 0], peer.of(after) - peer.of(before))}


def main() -> None:
    rows: list[dict[str, object]] = []
    references, changes = {}, {}
    for name, place in PLACES.items():
        touch = solve_touch(TABLE_1, BODY, place)
        finer, references[name] = (solved(template(BODY, ON_RIM, place, touch, level), place)
                                   for level in (FINER, FINEST))
        exact, other = (read_out(DRIVE, after - before) for after, before in (references[name], finer))
        changes[name] = off(other, exact)
        rows += [{"touch": name} | row for row in followed(place, touch, exact)]
    rows += [row for circles in CIRCLES for row in on_mesh(circles, references)]
    shown(written([row | {"reference_change": changes[str(row["touch"])]} for row in rows], "peers_signal"))


if __name__ == "__main__":
    main()
