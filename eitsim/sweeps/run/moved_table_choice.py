"""When the touches of a sweep on a cylinder are moved to their places from a table, and which."""

import numpy as np

from eitsim.mechanics.curved.moved_touches import MovedShape, MovedTable, Run
from eitsim.scene.curved.curved_scene import CurvedScene
from eitsim.scene.scene import STRAINS
from eitsim.scene.surfaces.cylinder import Cylinder
from eitsim.simulation.curved.moved_tables import moved_table
from eitsim.simulation.material import material_of
from eitsim.sweeps.design.card_draws import Cards, foam_varies
from eitsim.sweeps.design.design import Design, drawn_keys, representative_scene, varied_keys
from touchcal.errors import NotConverged

# Drawn keys that one table serves.
_SERVED = {("punch", key) for key in ("u", "v", "at_mm", "force_N", "depth_mm", "diameter_mm")} | {
    ("skin", "thickness_um"), ("accuracy", "signal")}
_LOADS = {"force_N": 1.0, "depth_mm": 1e-3}


WHAT = "a table of touches to be moved"


def moved_repays(design: Design, shape: MovedShape) -> bool:
    """Whether solving a design's touches directly costs more than the table."""
    return design.scenes >= len(shape.load_nodes) * len(shape.diameter_nodes)


def curved_table(design: Design, cards: Cards, run: Run) -> tuple[MovedTable | None, str]:
    """The table of a design on a cylinder, and a note; none where a touch of it has no equilibrium."""
    try:
        return moved_table(moved_shape(design, cards), run)
    except NotConverged as error:
        return None, f"no table: {error}"


def described(table: MovedTable, strain: str) -> str:
    """How touches are solved, in words."""
    depth, signal = table.error[0], table.error[1 + STRAINS.index(strain)]
    return (f"touches moved to their places from a table of {table.paths} diameters ({table.cpu_s:.0f} CPU s, once, "
            f"not counted in the rows' cpu_s), at most {depth:.1e} off in depth and {signal:.1e} in signal between its "
            "loads; those near ends or outside the table directly")


def moved_shape(design: Design, cards: Cards) -> MovedShape:
    """What serves every row of a design; ValueError where nothing does."""
    first = representative_scene(design)
    assert isinstance(first, CurvedScene), "only curved designs come here"
    surface, (punch,) = first.body.surface, first.punches
    if not isinstance(surface, Cylinder):
        raise ValueError("touches are moved along cylinders alone: those on a sphere are quick to solve, and other "
                         "surfaces differ from place to place.")
    if foam_varies(cards):
        raise ValueError("[material] draws a law for each row, and a table holds one.")
    if first.hold.time_s or not punch.axisymmetric:
        raise ValueError("touches that are held in time or lean, or of a punch with a shape, are not moved.")
    if wrong := [where for where in drawn_keys(design) if where not in _SERVED]:
        raise ValueError(f"{wrong[0][1]} in [{wrong[0][0]}] is drawn, and a table of touches holds one value of it.")
    ends = {v.key: v.distribution for v in varied_keys(design) if v.table == "punch"}
    if {"force_N", "depth_mm"} <= ends.keys() or not all(
            np.isfinite(ends[key].ends).all() for key in (*_LOADS, "diameter_mm") if key in ends):
        raise ValueError("force_N, depth_mm and diameter_mm need ranges or lists, of a force or a depth.")
    key = "force_N" if punch.force_N is not None else "depth_mm"
    given = "force_N" if key == "force_N" else "depth_m"
    low, high = ends[key].ends if key in ends else (getattr(punch, given) / _LOADS[key],) * 2
    if not low > 0:
        raise ValueError(f"{key} in [punch] is drawn from {low:g}, and loads of a table are above 0.")
    diameters = ends.get("diameter_mm")
    values = (punch.diameter_m,) if diameters is None else tuple(sorted({1e-3 * d for d in (
        diameters.values or diameters.ends)}))
    spans = diameters is not None and not diameters.values and len(values) > 1
    material = material_of(first.flat, cards.card)
    return MovedShape(material.law, surface.radius_m, first.body.thickness_m, punch, given,
                      (low * _LOADS[key], high * _LOADS[key]), values, spans)

