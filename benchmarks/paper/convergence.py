"""Convergence of one touch over meshes of the foam, linear and quadratic elements (paper, figure 8), as a table.

Run as `python -m benchmarks.paper.convergence SCENE CARD OUT`, a stage of the paper's report.
"""

import sys
from pathlib import Path

import pandas as pd

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import ELEMENTS, default_element_m, foam_grid
from eitsim.scene.scene import Scene, read_scene
from eitsim.simulation.material import material_of
from matcal.card import read_card
from matcal.laws.law import Law

SIZES = (8.0, 4.0, 2.0, 1.0, 0.5)  # Element sizes over the default one, each half of the one before.


def table(law: Law, scene: Scene) -> pd.DataFrame:
    """One row a mesh: order, element size (mm), elements and unknowns (of the half-plane through the punch's axis),
    depth (mm), mean contact pressure (kPa), CPU time (s). The touch is frictionless and far from the rim."""
    (punch,), default = scene.punches, default_element_m(scene.body, scene.punches[0])
    rows = []
    for order in sorted(ELEMENTS):
        for size in SIZES:
            touch = solve_touch(law, scene.body, punch, element_m=size * default, order=order)
            grid = foam_grid(scene.body, punch, size * default, order)
            rows.append({"order": order, "size_over_default": size, "element_mm": 1e3 * size * default,
                         "elements": len(grid.elements), "unknowns": grid.unknowns, "delta_max_mm": touch.depth_m * 1e3,
                         "sigma_ave_kPa": touch.sigma_ave_Pa / 1e3, "cpu_s": touch.cpu_s})
    return pd.DataFrame(rows)


def main(scene_file: str, card_file: str, out: str) -> None:
    """Write the table of a scene and a card as CSV."""
    scene = read_scene(scene_file)
    table(material_of(scene, read_card(Path(card_file))).law, scene).to_csv(out, index=False)


if __name__ == "__main__":
    main(*sys.argv[1:])
