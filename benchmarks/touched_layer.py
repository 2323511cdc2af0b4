"""A ball of 8 mm pressed 30 % into 3 mm of rubber, and what the layer then reads, next to an independent solution.

The peer has its own mechanics (`peers/rubber_layer.py`, mixed axisymmetric elements) and quadratic tetrahedra of the
whole disc in three dimensions (`peers/disc_volume.py`); it shares no code with eitsim. A disc of 40 mm, 16 electrodes
on the whole rim, the ball off its middle; two conductivities of the volume. "off" is the relative difference of all
signals (2-norm) by eitsim, as a sheet of resultants and in its volume, from the peer's on each mesh. Run by `make
bench`, which pins threads; adds to results/touched_layer.csv the meshes that it lacks.
"""

import time
from dataclasses import dataclass

import numpy as np
import pandas as pd
from conditions import conditions, earlier, quick, shown, written
from peers.disc_volume import changed
from peers.rubber_layer import Pressed, Problem, pressed

import matcal
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.section_gradient import gradient_at
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.pressing import Punch, Skin
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Scene
from eitsim.simulation.layers.layer_readings import layer_readings
from matcal.laws.known_laws import law_of
from matcal.laws.volumetric import bulk_modulus, nearly_incompressible

MU, NU = 1e5, 0.4995
BODY, AT_M, Z = Body(Disc(0.04), 0.003), 0.012, 0.05
PUNCH = Punch(AT_M, 0.0, 0.008, depth_m=9e-4, profile="sphere")
ELECTRODES = Electrodes(count=16, width_m=0.006, contact_impedance_Ohm_m=Z)
LAW = matcal.Conductivity(5.0, [-2.0, 2.0, -1.0], (-0.3, 1.0))
ALONG, ACROSS = 5.0, 1.0
SKINS = {"principal": Skin(BODY.thickness_m, "principal", "layer"),
         "piezoresistive": Skin(BODY.thickness_m, "piezoresistive", "layer", ALONG, ACROSS)}
# Size of the peer's elements about the contact, mm, and layers of them, both 0 where its electrics takes eitsim's
# deformation; of its tetrahedra, and their levels.
MESHES = quick(((0, 0, 0.9, 3), (0, 0, 0.6, 4), (0, 0, 0.4, 6), (0.4, 6, 0.9, 3), (0.4, 6, 0.6, 4), (0.2, 12, 0.6, 4)),
               ((0, 0, 1.2, 3),))


def by_largest(f: np.ndarray) -> np.ndarray:
    """The cubic law of the largest principal strain."""
    e = np.linalg.svd(f, compute_uv=False)[:, 0] - 1
    a = LAW.a
    return (LAW.c0_S_per_m * (1 + a[0] * e + a[1] * e**2 + a[2] * e**3))[:, None, None] * np.eye(3)


def by_stretch(f: np.ndarray) -> np.ndarray:
    """Resistivity that changes with the logarithmic strains along the current and across it."""
    axes, stretch, _ = np.linalg.svd(f)
    h = np.log(stretch)
    rho = np.exp(ALONG * h + ACROSS * (h.sum(axis=1, keepdims=True) - h)) / LAW.c0_S_per_m
    return (axes / rho[:, None, :]) @ axes.swapaxes(1, 2)


@dataclass(frozen=True)
class Own:
    """The deformation that eitsim finds, for the peer's electrics alone."""

    touch: Touch

    def gradient(self, radius: np.ndarray, height: np.ndarray) -> np.ndarray:
        """F (n, 3, 3) along r, z and around at radii and heights (n,), mm."""
        assert self.touch.section is not None
        return gradient_at(self.touch.section, radius / 1e3, height / 1e3)


def main() -> None:
    touch = solve_touch(nearly_incompressible(law_of("neo_hooke", [[MU], [0.5]])), BODY, PUNCH)
    ours = {(name, how): layer_readings(Scene(BODY, (PUNCH,), skin, ELECTRODES), (touch,), LAW, asked, exact=exact)
            for name, skin in SKINS.items() for how, asked, exact in (("sheet", 1.0, False), ("volume", 0.01, True))}
    table = earlier("touched_layer")
    for element, layers, fine, levels in MESHES:
        mesh = f"{element:g} {layers} {fine:g} {levels}"
        if len(table) and mesh in set(table["peer_mesh"]):
            continue
        begun = time.process_time()
        given = Problem(MU / 1e3, float(bulk_modulus(MU, NU)) / 1e3, 3.0, 4.0, 0.9, element=element, layers=layers)
        found = pressed(given) if layers else Own(touch)
        rest, changes = changed(found, 1e3 * BODY.thickness_m, 40.0, 1e3 * AT_M, 16, 6.0, 1e3 * Z * BODY.thickness_m,
                                LAW.c0_S_per_m, [by_largest, by_stretch], fine=fine, levels=levels)
        spent, baseline = time.process_time() - begun, read_out(Drive(), rest)
        rows = []
        for (name, how), one in ours.items():
            peer = read_out(Drive(), changes[[*SKINS].index(name)])
            rows.append({"skin": name, "by": how, "method": one.method, "peer_mesh": mesh,
                         "off": np.linalg.norm(one.signal_V - peer) / np.linalg.norm(peer), "stated": one.signal_error,
                         "baseline_off": np.linalg.norm(one.baseline_V - baseline) / np.linalg.norm(baseline),
                         "force_mN": 1e3 * touch.force_N,
                         "peer_force_mN": found.force if isinstance(found, Pressed) else None,
                         "cpu_s": one.cpu_s, "peer_cpu_s": spent, **conditions()})
        table = written(pd.concat([table, pd.DataFrame(rows)], ignore_index=True), "touched_layer")
        shown(pd.DataFrame(rows))


if __name__ == "__main__":
    main()
