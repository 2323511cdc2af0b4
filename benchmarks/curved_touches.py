"""Touches on curved bodies against triquadratic bricks of scikit-fem (`peers/hexahedra.py`).

A ball of 10 mm radius, 3 mm deep in 10 mm of neo-Hooke (nu = 0.25), on top of a sphere, a cylinder and a saddle; and a
flat punch of 14 mm with a round edge of 2 mm that leans by `tilt_deg`, on a flat layer, and there an egg, a file of
triangles, of 22 and 14 mm (blunt and sharp halves of 11 and 7 mm). Bricks are 2 mm wide under the
ball and end 52 mm from the apex (1.1 radii of a saddle at most), 1.8 and 32 mm under the other; ends are free.

force_mu_mm2 is the force over mu; force_difference is to the bricks: on the flat layer, upright, it is what those leave
of the axisymmetric solution. signal_difference is that of the integral of what a nominal skin driven by the principal
strain changes. as_if_flat is the force of an upright punch on a flat layer at this depth over this one. unknowns are of
the finer mesh and those of the punch alone, 0 where the touch is solved about its axis.
Run by `make bench`, which pins threads; writes results/curved_touches.csv next to this file.
"""

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from conditions import quick, shown, written
from materials import SKIN_LAW
from peers.hexahedra import Egg, Pressed, RoundedDisc, press

import eitsim
from eitsim.mechanics.curved.solve_on_cap import solve_on_cap
from eitsim.mechanics.curved.solve_on_surface import solve_on_surface
from eitsim.mechanics.general.layer.layer_surface import principal_stretches
from eitsim.mechanics.general.meshing.layer_layout import ChartLayout, in_space
from eitsim.mechanics.general.solve_general import solve_general
from eitsim.mechanics.solid.grid import spread
from eitsim.scene.edges.disc import Disc
from eitsim.scene.scene import Body, Punch
from eitsim.scene.surfaces.curved_surface import CurvedSurface
from eitsim.scene.surfaces.cylinder import Cylinder
from eitsim.scene.surfaces.saddle import Saddle
from eitsim.scene.surfaces.sphere import Sphere
from matcal.card import MaterialCard
from matcal.laws.neo_hooke import NeoHooke

LAW, THICKNESS_M, SENSITIVITY = NeoHooke(1e4, 0.25), 0.01, -2.0
BALL = Punch(profile="sphere", diameter_m=0.02, depth_m=0.003)
LEANING = Punch(diameter_m=0.014, fillet_m=0.002, depth_m=0.003, tilt_rad=np.deg2rad(5))
EGG, CUTS = Egg(7.0, 11.0, 7.0), 96
RADII_M = (0.04, 0.1, 0.3)
SIZE_MM, SIZE_LEANING_MM = quick((2.0, 1.8), (2.5, 2.5))
END_MM = 52.0
PER_FORCE = 1e6 / LAW.mu_0_Pa  # mu mm^2 per N


def bricks(place: Callable[[np.ndarray], np.ndarray], punch: RoundedDisc | Egg, size: float, end: float,
           tilt: float = 0.0) -> Pressed:
    u = np.append(0.0, spread(0.0, end, lambda x: size * (1 + np.maximum(x - 7, 0) / 2)))
    w = np.append(-10.0, spread(-10.0, 0.0, lambda z: size * (1 - z / 8)))
    lines = (np.append(-u[:0:-1], u) if tilt else u, u, w)
    return press(place, lines, punch, LAW.nu, np.linspace(0, 3, 13)[1:], tilt)


def signal(gradient: np.ndarray, normal: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Integral (2, 2) of what the touch changes of the conductance of a nominal skin, mm^2."""
    first = np.array([1.0, 0, 0]) - normal[:, :1] * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    along = gradient @ np.stack([first, np.cross(normal, first)], axis=-1)
    metric = np.swapaxes(along, 1, 2) @ along
    one, other = principal_stretches(metric)
    sheet = np.exp(SENSITIVITY * np.log(one)) / (one * other)
    adjugate = np.stack([metric[:, 1, 1], -metric[:, 0, 1], -metric[:, 0, 1], metric[:, 0, 0]], -1).reshape(-1, 2, 2)
    return np.einsum("n,nij->ij", area, sheet[:, None, None] * adjugate - np.eye(2))


def row(what: str, radius_m: float, force_N: float, found: Pressed, flat: float, **more: Any) -> dict[str, Any]:
    force = force_N * PER_FORCE
    return {"what": what, "radius_mm": radius_m * 1e3, "tilt_deg": 0.0, "force_mu_mm2": force,
            "force_difference": force / found.force - 1, "as_if_flat": flat / force, **more}


def curved(what: str, surface: CurvedSurface, radius_m: float, top_m: float, flat: float) -> dict[str, Any]:
    top = np.array([0.0, 0.0, top_m])
    layout = ChartLayout(surface.chart_about(top), 1e-3)
    end = END_MM if top_m else min(END_MM, 1.1e3 * radius_m)
    found = bricks(lambda c: in_space(layout, c) - top * 1e3, RoundedDisc(0.0, 10.0), SIZE_MM, end)
    solution = solve_on_surface(LAW, surface, THICKNESS_M, [BALL], top[None])
    (touch,) = solution.touches
    ours = signal(solution.field.deformation_gradient(found.points * 1e-3 + top), found.normals, found.areas)
    theirs = signal(found.gradient, found.normals, found.areas)
    return row(what, radius_m, touch.force_N, found, flat,
               signal_difference=float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)),
               depth_estimate=touch.depth_error, signal_estimate=float(touch.signal_errors[1]),
               unknowns=sum(group.unknowns for group in solution.groups), cpu_s=touch.cpu_s)


def rows() -> Iterator[dict[str, Any]]:
    touch, _ = solve_on_cap(LAW, THICKNESS_M, BALL, 0.0)
    flat = touch.force_N * PER_FORCE
    level = bricks(lambda c: c, RoundedDisc(0.0, 10.0), SIZE_MM, END_MM)
    yield row("flat", np.inf, touch.force_N, level, flat, unknowns=0, cpu_s=touch.cpu_s)
    for radius in RADII_M:
        yield curved("sphere", Sphere(radius), radius, radius, flat)
        yield curved("cylinder", Cylinder(radius, 0.3), radius, radius, flat)
        yield curved("saddle", Saddle(radius, -radius), radius, 0.0, flat)
    found = bricks(lambda c: c, RoundedDisc(5.0, 2.0), SIZE_LEANING_MM, 32.0, LEANING.tilt_rad)
    (touch,) = (solution := solve_general(LAW, Body(Disc(0.1)), [LEANING])).touches
    upright = bricks(lambda c: c, RoundedDisc(5.0, 2.0), SIZE_LEANING_MM, 32.0)
    straight, _ = solve_on_cap(LAW, THICKNESS_M, Punch(diameter_m=0.014, fillet_m=0.002, depth_m=0.003), 0.0)
    straight_N = straight.force_N
    yield row("flat punch", np.inf, straight_N, upright, straight_N * PER_FORCE, unknowns=0, cpu_s=straight.cpu_s)
    yield row("flat punch", np.inf, touch.force_N, found, straight_N * PER_FORCE, depth_estimate=touch.depth_error,
              signal_estimate=float(touch.signal_errors[1]), unknowns=solution.unknowns, cpu_s=touch.cpu_s) | {
                  "tilt_deg": float(np.rad2deg(LEANING.tilt_rad))}
    for tilt_deg in quick((0.0, 5.0), (0.0,)):
        yield egg(tilt_deg)


def egg(tilt_deg: float) -> dict[str, Any]:
    found = bricks(lambda c: c, EGG, SIZE_LEANING_MM, 36.0, np.deg2rad(tilt_deg) or 1e-9)
    card = MaterialCard("neo-Hooke", LAW, conductivity=SKIN_LAW)
    with tempfile.TemporaryDirectory() as folder:
        eggs(Path(folder) / "egg.stl")
        scene = Path(folder) / "scene.toml"
        scene.write_text(f'[punch]\nshape = "egg.stl"\ndepth_mm = 3\ntilt_deg = {tilt_deg}\n')
        result = eitsim.simulate(eitsim.read_scene(scene), card)
    force = result.touches[0].force_N
    return row("egg", np.inf, force, found, force * PER_FORCE, depth_estimate=result.error_estimate["depth"],
               signal_estimate=result.error_estimate["signal"], cpu_s=result.cost["cpu_s"]) | {
                   "tilt_deg": tilt_deg, "as_if_flat": np.nan}


def eggs(path: Path) -> None:
    """Write the egg's triangles, its lowest point at the origin."""
    around, down = 2 * np.pi * np.arange(CUTS) / CUTS, np.linspace(0, np.pi, CUTS // 2 + 1)
    nodes = np.stack([np.outer(np.sin(down), np.cos(around)), np.outer(np.sin(down), np.sin(around)),
                      np.repeat(1 - np.cos(down), CUTS).reshape(-1, CUTS)], axis=-1)
    nodes *= EGG.half_width
    nodes[..., 0] *= np.where(nodes[..., 0] > 0, EGG.sharp, EGG.blunt) / EGG.half_width
    k, j = np.indices((CUTS // 2, CUTS))
    a, b, c, d = k * CUTS + j, k * CUTS + (j + 1) % CUTS, (k + 1) * CUTS + (j + 1) % CUTS, (k + 1) * CUTS + j
    cells = np.concatenate([np.stack([a, b, c], -1)[1:].reshape(-1, 3), np.stack([a, c, d], -1)[:-1].reshape(-1, 3)])
    meshio.write(path, meshio.Mesh(nodes.reshape(-1, 3), [("triangle", cells)]))


def main() -> None:
    found: list[dict[str, Any]] = []
    for each in rows():
        found.append(each)
        table = written(found, "curved_touches")
    shown(table)


if __name__ == "__main__":
    main()
