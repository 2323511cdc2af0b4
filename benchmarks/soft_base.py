"""Layers on soft bases: next to an independent solution, in their limits, and what the rim changes of them.

Touch k is drawn from (SEED, k): a rubber of 1.5 to 4 mm on 3 to 8 mm of a base 30 times softer to 3 times stiffer, of a
Poisson's ratio of 0.2 to 0.4995, a ball of 6 to 12 mm, 10 to 35 % of the layer deep. The peer has its own mechanics
(`peers/rubber_layer.py`, two mixed regions) and quadratic tetrahedra of the whole layer (`peers/disc_volume.py`).
"force_off" and "off" are the relative differences of the force and of all signals (2-norm); "equal_off" that of the
force on a base of the layer's own law from one thick body, "stiff_off" on a base STIFF times as stiff from the layer on
a plate. results/soft_base.csv. Further touches as a sheet of resultants and by their volume, as in `layers`:
results/soft_base_sheets.csv.

"rim" is what a rim all around the punch at a gap changes of the dipole moment of the layer's conductance, by the
largest principal strain and by volume, "bound" what a plan counts for an edge as near in each of the four quarters
about it. results/soft_base_rim.csv. Run by `make bench`, which pins threads.
"""

import time
from dataclasses import dataclass, replace

import numpy as np
from conditions import conditions, quick, shown, written
from layers import compared, skins
from peers.disc_volume import changed
from peers.rubber_layer import Problem, pressed
from touched_layer import LAW, by_largest

import matcal
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.bonded_laws import Bonded
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.pressing import Punch, Skin
from eitsim.scene.scene import Body, Scene
from eitsim.sheet.sheet_conductance import dipole
from eitsim.simulation.edge_effects import effect_of_edges
from eitsim.simulation.layers.layer_readings import layer_readings
from eitsim.simulation.layers.layer_section import layer_section
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law, scaled
from matcal.laws.volumetric import bulk_modulus

TOUCHES, SHEETS, SEED, DISC_M, AT_M, Z = quick(3, 1), quick(12, 1), 50, 0.04, 0.008, 0.05
MU, NU, STIFF = 1e5, 0.4995, 1e4
# Peer: size of its elements about the contact, mm, layers of them, size of its tetrahedra and their levels.
PEER = quick((0.5, 6, 0.8, 4), (0.8, 4, 1.2, 3))
LAYERS = quick([(h, c) for h in (1e-3, 3e-3) for c in (10, 100, 1000)], [(3e-3, 10)])
GAPS = quick((1, 2, 3), (1,))  # from the ball's edge to the rim, in thicknesses of layer and base
UNDER_M = 0.01


@dataclass(frozen=True)
class Drawn:
    """A layer on a base, and a ball above it."""

    layer_m: float
    base_m: float
    mu_Pa: float  # of the base
    nu: float
    d_m: float
    depth_m: float

    @property
    def punch(self) -> Punch:
        return Punch(AT_M, 0.0, self.d_m, depth_m=self.depth_m, profile="sphere")

    @property
    def base(self) -> Law:
        return law_of("neo_hooke", [[self.mu_Pa], [self.nu]])

    @property
    def body(self) -> Body:
        return Body(Disc(DISC_M), self.layer_m + self.base_m, self.base_m)

    @property
    def skin(self) -> Skin:
        return Skin(self.layer_m, "principal", "layer", base_m=self.base_m, base_card="base.json")


def drawn(k: int) -> Drawn:
    rng = np.random.default_rng((SEED, k))
    layer, base = rng.uniform(1.5e-3, 4e-3), rng.uniform(3e-3, 8e-3)
    d_m, depth = rng.uniform(6e-3, 12e-3), layer * rng.uniform(0.1, 0.35)
    return Drawn(layer, base, MU * np.exp(rng.uniform(np.log(1 / 30), np.log(3))), rng.uniform(0.2, NU), d_m, depth)


RUBBER = law_of("neo_hooke", [[MU], [NU]])


def row(k: int) -> dict[str, object]:
    """One touch next to the peer, and its limits."""
    one, begun = drawn(k), time.process_time()
    electrodes = Electrodes(count=16, width_m=0.006, contact_impedance_Ohm_m=Z, soft=True)
    touch = solve_touch(Bonded(RUBBER, one.base), one.body, one.punch)
    mechanics = time.process_time() - begun
    found = layer_readings(Scene(one.body, (one.punch,), one.skin, electrodes), (touch,), LAW, 0.01, exact=True)
    same, whole = (solve_touch(law, body, one.punch).force_N for law, body in (
        (Bonded(RUBBER, RUBBER), one.body), (RUBBER, Body(Disc(DISC_M), one.body.thickness_m))))
    stiff, plate = (solve_touch(law, body, one.punch).force_N for law, body in (
        (Bonded(RUBBER, scaled(RUBBER, STIFF)), one.body), (RUBBER, Body(Disc(DISC_M), one.layer_m))))
    element, layers, fine, levels = PEER
    begun = time.process_time()
    peer = pressed(Problem(MU / 1e3, bulk_modulus(MU, NU) / 1e3, 1e3 * one.layer_m, 500 * one.d_m,
                           1e3 * one.depth_m, 1e3 * DISC_M, element, layers,
                           (one.mu_Pa / 1e3, bulk_modulus(one.mu_Pa, one.nu) / 1e3, 1e3 * one.base_m), free=True))
    _, (change,) = changed(peer, 1e3 * one.layer_m, 1e3 * DISC_M, 1e3 * AT_M, 16, 6.0, 1e3 * Z * one.layer_m,
                           LAW.c0_S_per_m, [by_largest], fine=fine, levels=levels)
    theirs = read_out(Drive(), change)
    return {"touch": k, "layer_mm": 1e3 * one.layer_m, "base_mm": 1e3 * one.base_m, "stiffer": MU / one.mu_Pa,
            "base_nu": one.nu, "d_mm": 1e3 * one.d_m, "deep": one.depth_m / one.layer_m,
            "force_N": touch.force_N, "peer_force_N": peer.force / 1e3,
            "force_off": touch.force_N / peer.force * 1e3 - 1,
            "off": np.linalg.norm(found.signal_V - theirs) / np.linalg.norm(theirs), "stated": found.signal_error,
            "equal_off": same / whole - 1, "stiff_off": stiff / plate - 1, "mechanics_cpu_s": mechanics,
            "cpu_s": found.cpu_s, "peer_cpu_s": time.process_time() - begun, **conditions()}


def sheet_rows(k: int) -> list[dict[str, object]]:
    """A touch as a sheet and by its volume, with four conductivities."""
    one, along = drawn(k), float(np.random.default_rng((SEED, k, 1)).uniform(1, 8))
    touch = solve_touch(Bonded(RUBBER, one.base), one.body, one.punch,
                        element_m=2 * default_element_m(one.body, one.punch))
    on_base = [replace(skin, base_m=one.base_m, base_card="base.json") for skin in skins(one.layer_m, along)]
    return [{"touch": k, "base_mm": 1e3 * one.base_m, "stiffer": MU / one.mu_Pa, **each}
            for each in compared(one.body, one.punch, touch, on_base)]


def rim_rows(layer_m: float, stiffer: float) -> list[dict[str, object]]:
    """What the rim changes around a ball of 8 mm, 1 mm deep in a layer so many times as stiff as the foam under it."""
    foam, punch = matcal.Hyperfoam([3e4], [4.0], [0.2]), Punch(0, 0, 0.008, depth_m=1e-3, profile="sphere")
    laws, thickness = Bonded(law_of("neo_hooke", [[stiffer * foam.mu_0_Pa], [NU]]), foam), layer_m + UNDER_M
    skins = [Skin(layer_m, strain, "layer", base_m=UNDER_M, base_card="base.json")
             for strain in ("principal", "volume")]

    def moments(body: Body) -> list[float]:
        touch = solve_touch(laws, body, punch, element_m=3 * default_element_m(body, punch))
        return [dipole(*layer_section(touch, skin, LAW).resultants()) for skin in skins]

    far, out = moments(Body(Disc(0.2), thickness, UNDER_M)), []
    for gap in GAPS:
        body = Body(Disc(punch.diameter_m / 2 + gap * thickness), thickness, UNDER_M)
        out += [{"layer_mm": 1e3 * layer_m, "base_mm": 1e3 * UNDER_M, "stiffer": stiffer, "skin": skin.strain,
                 "gap": gap, "rim": abs(one / whole - 1),
                 "bound": 4 * effect_of_edges(Scene(body, (punch,), skin), punch, stiffer), **conditions()}
                for skin, one, whole in zip(skins, moments(body), far, strict=True)]
    return out


def main() -> None:
    shown(written([row(k) for k in range(TOUCHES)], "soft_base"))
    sheets = written([one for k in range(TOUCHES, TOUCHES + SHEETS) for one in sheet_rows(k)], "soft_base_sheets")
    print(f"the sheet's stated error holds in {(sheets['off'] <= sheets['stated']).mean():.0%} of {len(sheets)}")
    table = written([row for one in LAYERS for row in rim_rows(*one)], "soft_base_rim")
    shown(table)
    print(f"the bound holds in {(table['rim'] <= table['bound']).mean():.0%} of {len(table)}")


if __name__ == "__main__":
    main()
