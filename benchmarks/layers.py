"""How far the sheet of a layer's resultants is off its volume, and what it states, on random touches.

Touch k is drawn from (SEED, k): a disc of 30 to 80 mm, a layer of 1 to 6 mm of a rubber that nearly keeps its volume or
of a foam that does not, a sphere, a flat punch or a cone of 5 to 16 mm, 5 to 30 % deep, anywhere at least 1.5
thicknesses from the rim. Every touch is read with four conductivities of the volume, through 16 electrodes over the
whole rim: "off" is the relative difference of all signals (2-norm) by the sheet from those that the volume scatters,
"stated" what the plan's error of the sheet is. CPU times follow the mechanics. Run by `make bench`, which pins threads;
writes results/layers.csv.
"""

import time

import numpy as np
from conditions import conditions, quick, shown, written

import matcal
from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.pressing import Punch, Skin
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Scene
from eitsim.sheet.layer_conductivity import sheet_law, sheet_skin
from eitsim.simulation.layers.layer_readings import TouchedLayer
from matcal.laws.known_laws import law_of
from matcal.laws.volumetric import nearly_incompressible
from touchcal.errors import NotConverged

TOUCHES, SEED = quick(25, 2), 50
LAWS = {"rubber": nearly_incompressible(law_of("neo_hooke", [[1e5], [0.5]])),
        "foam": matcal.Hyperfoam([3e4], [4.0], [0.2])}
BY_STRAIN = matcal.Conductivity(5.0, [-2.0, 2.0, -1.0], (-0.3, 1.0))


def drawn(k: int) -> tuple[str, Body, Punch, float]:
    rng = np.random.default_rng((SEED, k))
    thickness, radius, diameter = rng.uniform(1, 6) / 1e3, rng.uniform(30, 80) / 1e3, rng.uniform(5, 16) / 1e3
    reach, angle = radius - diameter / 2 - 1.5 * thickness, rng.uniform(0, 2 * np.pi)
    away = reach * np.sqrt(rng.random())
    punch = Punch(away * np.cos(angle), away * np.sin(angle), diameter, depth_m=rng.uniform(0.05, 0.3) * thickness,
                  profile=str(rng.choice(["sphere", "flat", "cone"])), fillet_m=min(0.001, thickness / 4),
                  half_angle_rad=np.radians(70))
    return str(rng.choice(list(LAWS))), Body(Disc(radius), thickness), punch, float(rng.uniform(1, 8))


def skins(thickness_m: float, along: float) -> list[Skin]:
    return [Skin(thickness_m, "principal", "layer"), Skin(thickness_m, "volume", "layer"),
            Skin(thickness_m, "piezoresistive", "layer", along, along / 4),
            Skin(thickness_m, "piezoresistive", "layer", -along / 2, along / 4)]


def rows(k: int) -> list[dict[str, object]]:
    name, body, punch, along = drawn(k)
    touch = solve_touch(LAWS[name], body, punch, element_m=1.5 * default_element_m(body, punch))
    return [{"touch": k, "law": name, **one} for one in
            compared(body, punch, touch, skins(body.thickness_m, along))]


def compared(body: Body, punch: Punch, touch: Touch, own: list[Skin]) -> list[dict[str, object]]:
    """A touch read with each of the skins, as a sheet and by its volume."""
    out: list[dict[str, object]] = []
    for i, skin in enumerate(own):
        layer = TouchedLayer(Scene(body, (punch,), skin, Electrodes(soft=True)), (touch,), BY_STRAIN)
        electrodes = Electrodes(width_m=0.1 * body.edge.size_m, contact_impedance_Ohm_m=0.02)
        begun, found = time.process_time(), []
        stated = layer.sheet_error
        times = [time.process_time() - begun]
        for touches in (layer.sheets, layer.volumes()):
            begun = time.process_time()
            found.append(solve(body, sheet_skin(skin), electrodes, Drive(), touches, sheet_law(BY_STRAIN),
                               method="multipole").signal_V)
            times.append(time.process_time() - begun)
        off = np.linalg.norm(found[0] - found[1]) / np.linalg.norm(found[1])
        out.append({"skin": f"{skin.strain} {i}", "profile": punch.profile,
                    "thickness_mm": skin.thickness_m * 1e3, "d_mm": punch.diameter_m * 1e3,
                    "deep": (punch.depth_m or 0.0) / skin.thickness_m, "off": off, "stated": stated,
                    "sheet_cpu_s": times[0] + times[1], "volume_cpu_s": times[2], **conditions()})
    return out


def main() -> None:
    found: list[dict[str, object]] = []
    for k in range(TOUCHES):
        try:
            found += rows(k)
        except NotConverged as error:
            print(f"touch {k}: {error}")
    table = written(found, "layers")
    shown(table.groupby("skin").agg(touches=("off", "size"), median=("off", "median"), most=("off", "max"),
                                    stated=("stated", "median"), sheet_cpu_s=("sheet_cpu_s", "max"),
                                    volume_cpu_s=("volume_cpu_s", "max")).reset_index())
    print(f"stated errors hold in {(table['off'] <= table['stated']).mean():.0%} of {len(table)}")


if __name__ == "__main__":
    main()
