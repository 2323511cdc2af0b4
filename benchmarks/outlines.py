"""Skins with an outline: error, error estimate, CPU seconds and nodes of the untouched readings, and of touches' dV.

Untouched readings (adjacent drive, 2-norm) are compared with an integral equation on the rim (a disc given as a polygon
of 400 corners), with a cosine series (a rectangle of 120 x 80 mm with 32 electrodes, 928 readings), with conformal maps
to the disc (an ellipse given as a polygon of 400 corners, and a square), and with their own mesh of the least error
asked for (an L with a hole; a grid of electrodes on the surface); on the same linear triangles, with EIDORS' formulas.
dV of random touches is compared with that by rings on the disc, or on triangles outside which untouched readings are
known to 1e-4, halved once (twice with electrodes on the surface); that of circles of 1.5 times the conductance, with
conformal maps. "near an edge" are touches 0.5 to 15 mm from a straight edge of the rectangle, solved in three
dimensions. Run by `make bench`; writes results/outlines.csv next to this file.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from conditions import quick, shown, written
from conformal_maps import Complex, Mapped, Patch, ellipse, mapped_impedance, square
from eidors_formulas import impedance_by_eidors_formulas
from scipy.special import spherical_jn

from eitsim.electrics.cem.assembly import dissection, impedance, quadrature_points
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.outline.adapted_mesh import READINGS, solve_untouched
from eitsim.electrics.outline.ringed_mesh import outlined_mesh
from eitsim.electrics.outline.triangles import skin_mesh
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.drive import as_tuples, read_out
from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import stretches_along
from eitsim.scene.electrodes import Electrodes, contact_impedances
from eitsim.scene.outline_edge import places_along
from eitsim.scene.polygons import edge_distance_m
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import principal_conductances, touched_conductance
from eitsim.simulation.near_edges import solve_near_rim
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array

S = 6e-4  # Sheet conductance, S, of the default skin.
LAW = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4))
FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "longterm")  # paper, table 1
PITCH_M = 0.4 / 32
TURN = 2 * np.pi * np.arange(400) / 400
HALF_M = (0.06, 0.04)  # Half axes of the ellipse; the first is half the side of the square.
BODIES = {
    "disc of 400 corners": Body(Outline("polygon",
        points_m=as_tuples(0.1 * np.column_stack([np.cos(TURN), np.sin(TURN)])))),
    "rectangle": Body(Outline("rectangle", width_m=0.12, height_m=0.08), 0.005),
    "L with a hole": Body(Outline("polygon", holes_m=((0.035, 0.14, 0.01),), points_m=(
        (0.0, 0.0), (0.2, 0.0), (0.2, 0.08), (0.08, 0.08), (0.08, 0.2), (0.0, 0.2))), 0.005),
    "grid on the surface": Body(Outline("rectangle", width_m=0.2, height_m=0.14)),
    "ellipse": Body(Outline("polygon", points_m=as_tuples(np.column_stack([HALF_M[0] * np.cos(TURN),
                                                                           HALF_M[1] * np.sin(TURN)])))),
    "square": Body(Outline("rectangle", width_m=2 * HALF_M[0], height_m=2 * HALF_M[0]))}
ELECTRODES = {
    "disc of 400 corners": Electrodes(),
    "rectangle": Electrodes(count=32, width_m=0.006, positions_m=as_tuples(PITCH_M * (np.arange(32) + 0.5))),
    "L with a hole": Electrodes(count=24, width_m=0.008),
    "grid on the surface": Electrodes(kind="surface", count=24, width_m=0.005,
                                      x_m=as_tuples(np.tile(0.03 * np.arange(6) - 0.075, 4)),
                                      y_m=as_tuples(np.repeat(0.03 * np.arange(4) - 0.045, 6))),
    "ellipse": Electrodes(width_m=0.008),
    "square": Electrodes(width_m=0.008, positions_m=as_tuples(HALF_M[0] / 2 * (np.arange(16) + 0.5)))}
MAPS: dict[str, Mapped] = {"ellipse": ellipse(*HALF_M), "square": square(2 * HALF_M[0])}
COMPARED = tuple(name for name in BODIES if name not in MAPS)


def sensor(name: str) -> tuple[Body, Electrodes]:
    """A body and its electrodes, as a scene holds them."""
    scene = Scene(BODIES[name], electrodes=ELECTRODES[name])
    return scene.body, scene.electrodes


def rectangle_impedance(width_m: float, height_m: float, positions_m: Array, electrode_m: float, contact_Ohm_m: float,
                        conductance_S: float, *, degree: int = 24, modes: int = 12000, mixed: int = 3000) -> Array:
    """Impedance matrix (N, N), Ohm, of line electrodes of one width on a uniform rectangle, by the cosine series of its
    Neumann function, which has no mesh.

    The current density on every electrode is a sum of Legendre polynomials up to `degree`, z j + u = U is tested by the
    same (Galerkin). A cosine along a side has with a polynomial the product 2 i^n j_n, a spherical Bessel function.
    Series along one side have `modes` terms, those between sides that meet `mixed` times `mixed`. positions_m (N,):
    middles along the edge, counter-clockwise from the middle of the right side; none may lie on a corner.
    """
    a, b, half = width_m, height_m, electrode_m / 2
    corners = np.cumsum([b / 2, a, b, a])
    side = np.searchsorted(corners, positions_m) % 4  # right, top, left, bottom
    along = np.choose(side, [b / 2 + np.where(positions_m > corners[3], positions_m - corners[3] - b / 2, positions_m),
                             a - (positions_m - corners[0]), b - (positions_m - corners[1]), positions_m - corners[2]])
    order = np.arange(degree + 1)

    def products(k: int, count: int) -> Array:
        """(polynomials, terms) products of the cosines along side k with the polynomials of its electrodes."""
        wave = np.pi / (a if k % 2 else b) * np.arange(count)
        bessel = spherical_jn(order[:, None], wave * half)
        phase = np.exp(1j * wave * along[side == k, None])
        return np.concatenate([2 * half * np.real(1j ** order[:, None] * one) * bessel for one in phase])

    which = [np.flatnonzero(side == k) for k in range(4)]
    rows = [(w[:, None] * len(order) + order).ravel() for w in which]
    kernel = np.zeros((len(positions_m) * len(order),) * 2)
    for k in range(4):
        length, depth = (a, b) if k % 2 else (b, a)
        wave = np.pi / length * np.arange(modes)
        near = np.empty(modes)
        far = np.empty(modes)
        near[0], far[0] = depth / 3, -depth / 6
        near[1:] = 1 / np.tanh(wave[1:] * depth) / wave[1:]
        far[1:] = 1 / np.sinh(np.minimum(wave[1:] * depth, 300)) / wave[1:]
        weight = np.where(np.arange(modes) > 0, 2.0, 1.0) / length
        own, facing = products(k, modes), products((k + 2) % 4, modes)
        kernel[np.ix_(rows[k], rows[k])] = own * (weight * near) @ own.T
        kernel[np.ix_(rows[k], rows[(k + 2) % 4])] = own * (weight * far) @ facing.T
    m = np.arange(mixed)
    x, y = np.pi / a * m, np.pi / b * m
    double = np.where(m > 0, 2.0, 1.0)
    both = np.divide(np.outer(double, double) / (a * b), x[:, None] ** 2 + y**2,
                     out=np.zeros((mixed, mixed)), where=np.add.outer(m, m) > 0)
    for k in (1, 3):  # top and bottom; y is b on top
        for other in (0, 2):  # right and left; x is a on the right
            at = both * np.outer((-1.0) ** m if other == 0 else m**0.0, (-1.0) ** m if k == 1 else m**0.0)
            block = products(k, mixed) @ at @ products(other, mixed).T
            kernel[np.ix_(rows[k], rows[other])] = block
            kernel[np.ix_(rows[other], rows[k])] = block.T
    mass = np.tile(2 * half / (2 * order + 1), len(positions_m))
    into = np.kron(np.eye(len(positions_m)), np.eye(len(order))[:, :1]) * 2 * half
    admittance = into.T @ np.linalg.solve(np.diag(contact_Ohm_m * mass) + kernel / conductance_S, into)
    count = len(positions_m)
    z = np.linalg.solve(admittance, np.eye(count) - 1 / count)
    return z - z.mean(axis=0)


def reference(name: str) -> tuple[Array, str]:
    """The impedance matrix that a case is compared with, and what it is."""
    body, electrodes = sensor(name)
    if name == "disc of 400 corners":
        return untouched_impedance(Body(), Electrodes(), S), "integral equation"
    if name == "rectangle":
        return rectangle_impedance(0.12, 0.08, np.array(electrodes.positions_m), 0.006, 1.0, S), "cosine series"
    return solve_untouched(body.outline, electrodes, S, quick(3e-6, 1e-5)).impedance_Ohm, "least error asked for"


def apart(one: Array, other: Array) -> float:
    """Relative difference, 2-norm, of the readings of two impedance matrices by the default drive."""
    first, second = (read_out(Drive(), z) for z in (one, other))
    return float(np.linalg.norm(first - second) / np.linalg.norm(second))


def untouched(name: str) -> Iterator[dict[str, object]]:
    body, electrodes = sensor(name)
    known, by = reference(name)
    for asked in quick((1e-3, 1e-4, 1e-5, 1e-6), (1e-3, 1e-4)):
        if by == "least error asked for" and asked < 1e-5:
            continue
        solve_untouched.cache_clear()
        begun = time.process_time()
        found = solve_untouched(body.outline, electrodes, S, asked)
        yield {"case": name, "what": "untouched", "reference": by, "asked": asked,
               "error": apart(found.impedance_Ohm, known), "estimate": found.error,
               "cpu_s": time.process_time() - begun, "nodes": found.nodes}


def touches(name: str, count: int) -> Iterator[tuple[Punch, Touch]]:
    """Random touches at least 35 mm, or seven thicknesses of a thin foam, from all edges."""
    rng, (body, _) = np.random.default_rng(7), sensor(name)
    low, high = body.edge.box_m
    box = high - low
    while count:
        x, y = (low + box * rng.random(2)).tolist()
        punch = Punch(x, y, diameter_m=float(rng.uniform(0.008, 0.018)), force_N=float(rng.uniform(0.1, 2.0)))
        if edge_distance_m(body.outline, (x, y)) - punch.diameter_m / 2 > min(0.035, 3.5 * body.thickness_m):
            count -= 1
            yield punch, solve_touch(FOAM, body, punch)


def touched(name: str) -> Iterator[dict[str, object]]:
    body, electrodes = sensor(name)
    untouched_impedance(body, electrodes, S)
    for punch, touch in touches(name, quick(10 if name == "disc of 400 corners" else 6, 2)):
        found = solve(body, Skin(), electrodes, Drive(), ((punch, touch),), LAW)
        if name == "disc of 400 corners":
            known = solve(Body(), Skin(), Electrodes(), Drive(), ((punch, touch),), LAW, signal=1e-4).signal_V
        else:
            known = finer(body, electrodes, punch, touch)
        yield {"case": name, "what": f"dV of {punch.diameter_m * 1e3:.1f} mm, {punch.force_N:.2f} N",
               "reference": "disc" if name == "disc of 400 corners" else "finer mesh", "method": found.method,
               "error": float(np.linalg.norm(found.signal_V - known) / np.linalg.norm(known)),
               "estimate": found.signal_error, "cpu_s": found.cpu_s, "nodes": found.unknowns}


def near_an_edge(count: int) -> Iterator[dict[str, object]]:
    """dV of random touches near one of the longer sides of the rectangle."""
    rng, (body, electrodes) = np.random.default_rng(8), sensor("rectangle")
    for gap in rng.uniform(0.0005, 0.015, count).tolist():
        diameter, force = rng.uniform(0.006, 0.012), rng.uniform(0.05, 0.4)
        punch = Punch(float(rng.uniform(-0.02, 0.02)), 0.04 - gap - diameter / 2, diameter, force_N=force)
        touch = solve_near_rim(FOAM, body, punch)
        found = solve(body, Skin(), electrodes, Drive(), ((punch, touch),), LAW)
        known = finer(body, electrodes, punch, touch)
        yield {"case": "near an edge", "what": f"dV of {diameter * 1e3:.1f} mm, {force:.2f} N, {gap * 1e3:.1f} mm off",
               "reference": "finer mesh", "method": found.method,
               "error": float(np.linalg.norm(found.signal_V - known) / np.linalg.norm(known)),
               "estimate": found.signal_error, "cpu_s": found.cpu_s, "nodes": found.unknowns}


def finer(body: Body, electrodes: Electrodes, punch: Punch, touch: Touch) -> Array:
    """dV (patterns, readings), V, on the touch's mesh outside which untouched readings are known to 1e-4, halved once;
    twice where electrodes lie on the surface, as the touch's own mesh is that one."""
    mesh = uniform_refinement(outlined_mesh(body, electrodes, S, ((punch, touch),), 1e-4))
    if electrodes.kind == "surface":
        mesh = uniform_refinement(mesh)
    z, order = contact_impedances(electrodes), dissection(mesh)
    sheet = touched_conductance(quadrature_points(mesh), ((punch, touch),), Skin(), LAW)
    change = impedance(mesh, sheet, z, order=order) - impedance(mesh, np.full(len(mesh.cells), S), z, order=order)
    return read_out(Drive(), change)


def circle_of(radius_m: float) -> Touch:
    """A touch that presses the skin to 0.8 of its thickness in a circle and leaves it alone outside."""
    radius, rest = np.array([0.0, radius_m * (1 - 1e-9), radius_m * (1 + 1e-9), 2 * radius_m]), np.ones(4)
    normal, pressure = np.array([0.8, 0.8, 1.0, 1.0]), np.array([1e4, 1e4, 0.0, 0.0])
    parts: list[Any] = [radius, 0 * rest, 0 * rest, rest, rest, normal, pressure, radius_m, *[0.0] * 9, 0, (), 0.0]
    return Touch(*parts)


def electrode_ends(name: str) -> Complex:
    """Ends (N, 2) of the line electrodes of a body, m, as complex numbers; those of the ellipse on it."""
    body, electrodes = sensor(name)
    ends = places_along(body.outline, stretches_along(body.outline, electrodes)) @ np.array([1, 1j])
    turn = np.angle(ends.real / HALF_M[0] + 1j * ends.imag / HALF_M[1])
    on_ellipse = HALF_M[0] * np.cos(turn) + 1j * HALF_M[1] * np.sin(turn)
    return np.asarray(on_ellipse if name == "ellipse" else ends, dtype=np.complex128)


def mapped(name: str) -> Iterator[dict[str, object]]:
    """Untouched readings, and dV of circles of another conductance, of a body whose map to the disc is known."""
    (body, electrodes), ends, region = sensor(name), electrode_ends(name), MAPS[name]
    rest = mapped_impedance(region, ends, 1.0, S)
    for asked in quick((1e-3, 1e-4, 1e-5), (1e-4,)):
        solve_untouched.cache_clear()
        begun = time.process_time()
        found = solve_untouched(body.outline, electrodes, S, asked)
        yield {"case": name, "what": "untouched", "reference": "conformal map", "asked": asked,
               "error": apart(found.impedance_Ohm, rest), "estimate": found.error,
               "cpu_s": time.process_time() - begun, "nodes": found.nodes}
    skin, away = Skin(strain="normal"), HALF_M[1] if name == "ellipse" else HALF_M[0]
    share = float(principal_conductances(LAW, skin, 1.0, 1.0, 0.8)[0]) / S
    for x, y, radius in quick(((0.01, 0.005, 0.01), (0.02, 0.0, 0.007), (0.0, away - 0.015, 0.008),
                               (0.0, away - 0.009, 0.007)), ((0.01, 0.005, 0.01),)):
        change = mapped_impedance(region, ends, 1.0, S, Patch(complex(x, y), radius, share)) - rest
        known, touches = read_out(Drive(), change), ((Punch(x, y, 2 * radius), circle_of(radius)),)
        for method in ("auto", "mesh"):
            found = solve(body, skin, electrodes, Drive(), touches, LAW, method=method)
            off_mm = (away - y - radius) * 1e3
            yield {"case": name, "what": f"dV of a circle of {radius * 1e3:.0f} mm, {off_mm:.0f} mm off an edge",
                   "reference": "conformal map", "method": found.method,
                   "error": float(np.linalg.norm(found.signal_V - known) / np.linalg.norm(known)),
                   "estimate": found.signal_error, "cpu_s": found.cpu_s, "nodes": found.unknowns}


def same_triangles(name: str) -> dict[str, object]:
    """Readings of random conductances on the linear triangles of an untouched body, by EIDORS' formulas."""
    body, electrodes = sensor(name)
    mesh = skin_mesh(solve_untouched(body.outline, electrodes, S, READINGS).triangles, electrodes, "P1")
    sheet, z = S * np.exp(np.random.default_rng(2).normal(size=len(mesh.cells))), contact_impedances(electrodes)
    begun = time.process_time()
    found = impedance(mesh, sheet, z)
    return {"case": name, "what": "the same linear triangles", "reference": "EIDORS' formulas",
            "error": apart(found, impedance_by_eidors_formulas(mesh, sheet, z)),
            "cpu_s": time.process_time() - begun, "nodes": len(mesh.nodes_m)}


def main() -> None:
    solve_untouched(*sensor("rectangle"), S, 1e-2)  # compiles
    rows = [row for name in COMPARED for row in untouched(name)]
    rows += [row for name in COMPARED for row in touched(name)]
    rows += near_an_edge(quick(8, 1))
    rows += [row for name in MAPS for row in mapped(name)]
    rows += [same_triangles(name) for name in ("rectangle", "L with a hole")]
    shown(written(rows, "outlines", 3))


if __name__ == "__main__":
    main()
