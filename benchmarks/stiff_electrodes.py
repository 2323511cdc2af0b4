"""What electrodes that are bodies change of a touch: stiff plates on the side of the foam, on random skins.

Touch k is drawn from (SEED, k): a disc or a rectangle, 4 to 16 mm thick, with 8, 16 or 32 electrodes of 2 to 12 mm, one
punch whose edge lies 0.05 to 3 thicknesses from the edge of the skin. It is solved in three dimensions with the
electrodes as plates that stand on the base and hold the side, and without, on the same sizes of elements.
"normal", "principal" and "areal" are the relative differences of all touch signals (2-norm), skins driven by that
strain; gaps are from the punch's edge to the skin's edge and to the nearest electrode, over the thickness. Run by
`make bench`, which pins threads; writes results/stiff_electrodes.csv.
"""

import time

import numpy as np
import pandas as pd
from conditions import quick, shown, written
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.general.mesh_errors import corrected
from eitsim.mechanics.general.meshing.bodies import NO_BODIES, bodies_of
from eitsim.mechanics.general.meshing.levels import COARSE, ROUGH, Level
from eitsim.mechanics.general.solved_layer import equilibrium, lone_touches, problem
from eitsim.mechanics.general.touch_of_field import touch_about
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Drive, Scene, Skin, scene_from
from eitsim.simulation.edge_effects import electrode_gap_m, rim_effect
from touchcal.errors import NotConverged

TOUCHES, SEED, SIGNAL = quick(36, 2), 48, 0.01


def drawn(k: int) -> Scene:
    rng = np.random.default_rng((SEED, k))
    thickness, diameter = rng.uniform(4, 16), rng.uniform(6, 20)
    gap = thickness * np.exp(rng.uniform(np.log(0.05), np.log(3)))
    inwards, force = gap + diameter / 2, rng.uniform(0.1, 1.5) * (diameter / 14) ** 2
    punch = {"diameter_mm": diameter, "force_N": force,
             "profile": str(rng.choice(["flat", "sphere", "cone", "ellipse"]))}
    body: dict[str, object] = {"thickness_mm": thickness}
    if rng.random() < 0.6:
        radius, angle = rng.uniform(50, 120), rng.uniform(0, 2 * np.pi)
        body |= {"radius_mm": radius}
        at = (radius - inwards) * np.array([np.cos(angle), np.sin(angle)])
    else:
        width, height = rng.uniform(100, 200), rng.uniform(100, 140)
        body |= {"outline": "rectangle", "width_mm": width, "height_mm": height}
        at = np.array([rng.uniform(-0.5, 0.5) * (width - 2 * inwards), height / 2 - inwards])
    electrodes = {"count": int(rng.choice([8, 16, 32])), "width_mm": rng.uniform(2, min(12, 2 * thickness))}
    electrodes["width_mm"] = min(electrodes["width_mm"], 8.0) if electrodes["count"] == 32 else electrodes["width_mm"]
    return scene_from({"body": body, "electrodes": electrodes,
                       "punch": punch | {"x_mm": float(at[0]), "y_mm": float(at[1])}})


def touches(scene: Scene, level: Level) -> list[Touch]:
    """The touch with sides that are free, and with plates."""
    body, law = scene.body, TABLE_1
    lone, out = lone_touches(law, body, scene.punches), []
    (punch,) = scene.punches
    places, least = np.array([[punch.x_m, punch.y_m]]), np.array([punch.diameter_m / 2])
    for bodies in (NO_BODIES, bodies_of(body, scene.electrodes, places, least)):
        found = corrected(equilibrium(problem(law, body, scene.punches, lone, level, bodies=bodies), lone,
                                      body.thickness_m), lone, level)
        out.append(touch_about(0, found, found, law, body))
    return out


def effect(scene: Scene, strain: str, bare: Touch, plated: Touch) -> float:
    """Relative difference of the signals, a skin driven by a strain; NaN where its cubic is not positive."""
    try:
        dv, other = (solve(scene.body, Skin(strain=strain), scene.electrodes, Drive(), ((scene.punches[0], touch),),
                           SKIN_LAW, signal=SIGNAL).signal_V for touch in (bare, plated))
    except ValueError:
        return np.nan
    return float(np.linalg.norm(other - dv) / np.linalg.norm(other))


def row(k: int, level: Level = ROUGH) -> dict[str, object]:
    scene, begun = drawn(k), time.process_time()
    (punch,), body = scene.punches, scene.body
    bare, plated = touches(scene, level)
    unit, gap_m = body.thickness_m, float(body.edge.gap_m([punch.x_m, punch.y_m])) - punch.diameter_m / 2
    out = {"touch": k, "level": "rough" if level is ROUGH else "coarse", "thickness_mm": unit * 1e3,
           "d_mm": punch.diameter_m * 1e3, "profile": punch.profile, "depth": bare.depth_m / unit,
           "count": scene.electrodes.count, "width": float(np.max(scene.electrodes.width_m)) / unit,
           "gap": gap_m / unit,
           "electrode_gap": electrode_gap_m(scene, punch) / unit,
           "depth_effect": abs(plated.depth_m / bare.depth_m - 1),
           **{strain: effect(scene, strain, bare, plated) for strain in STRAINS},
           **{f"rim_{name}": rim_effect(gap_m, unit, name) for name in STRAINS},
           "cpu_s": time.process_time() - begun}
    print(pd.DataFrame([out]).to_string(index=False, header=k == 0), flush=True)
    return out


def main() -> None:
    table = []
    for k, level in [*((k, ROUGH) for k in range(TOUCHES)), *((k, COARSE) for k in range(TOUCHES // 18))]:
        try:
            table.append(row(k, level))
        except NotConverged as error:
            print(k, error, flush=True)
    shown(written(table, "stiff_electrodes"))


if __name__ == "__main__":
    main()
