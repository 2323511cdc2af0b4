"""What measured readings and stored fields cost, and what first order misses of a contact impedance that has changed.

Table 1's foam under flat punches at four places, one near the rim, on line electrodes, and one place on patches. By
"contact": all impedances change by independent normal numbers between the untouched and the touched frame (mean of 3
draws); effect of that on dV, and what the derivative of the untouched readings misses of it, 2-norms over that of dV
and of the effect; the truth is the touch solved again on the changed electrodes. By "measure": CPU time to measure a
row with every term, 16 bits and one frame. By "fields": CPU time to take all five fields of a row on a grid and to
compress them, and bytes of a row. Run by `make bench`, which pins threads; writes results/measured.csv next to this
file.
"""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from conditions import quick, shown, written

from eitsim.electrics.forward.gridded_fields import QUANTITIES, fields_from, values
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.forward.untouched import by_contact
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.electrodes import Electrodes, contact_impedances
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import untouched_conductance
from eitsim.simulation.near_edges import solve_near_rim
from eitsim.sweeps.dataset.hdf5_fields import encoded
from eitsim.sweeps.measurement.instrument import Measurement, measured
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
SHEET_S = untouched_conductance(LAW, Skin())
PUNCHES = (Punch(), Punch(0.03, -0.02, 0.014, 0.5), Punch(0.06, 0.01, 0.018, 2.0))[:quick(3, 2)]
NEAR_RIM = Punch(0.083, 0.0, 0.014, 1.0)
PATCHES = Electrodes(kind="patch")
EVERY = Measurement(noise_V=1e-4, gain=0.01, offset_V=1e-3, drift=0.01, drift_channel=0.01, drift_V=1e-3,
                    drift_channel_V=1e-3, contact_impedance=0.05, bits=16, full_scale_V=5.0)
GRIDS = ({"side": 64}, {"side": 128}, {"grid": "polar", "rings": 32, "angles": 64})
DRAWS, ROWS = 3, 200


def contact_rows(punch: Punch, touch: Touch, electrodes: Electrodes) -> Iterator[dict[str, object]]:
    slopes, drive = by_contact(Body(), electrodes, Drive(), SHEET_S), Drive()
    before = solve(Body(), Skin(), electrodes, drive, ((punch, touch),), LAW)
    signal = np.linalg.norm(before.signal_V)
    for size in (0.01, 0.05, 0.1, 0.2):
        found = []
        for seed in range(DRAWS):
            change = size * np.random.default_rng(seed).standard_normal(electrodes.count)
            varied = contact_impedances(electrodes) * (1 + change)
            other = replace(electrodes, **{electrodes.impedance_key: tuple(varied.tolist())})
            after = solve(Body(), Skin(), other, drive, ((punch, touch),), LAW)
            effect = (after.touched_V - before.touched_V).ravel()
            found.append((np.linalg.norm(effect), np.linalg.norm(effect - slopes @ change)))
        effect, missed = np.mean(found, axis=0)
        yield {"what": "contact", "electrodes": electrodes.kind, "x_mm": punch.x_m * 1e3, "change": size,
               "effect_over_dV": effect / signal, "missed_over_effect": missed / effect}


def measure_row(touch: Touch) -> dict[str, object]:
    slopes = by_contact(Body(), Electrodes(), Drive(), SHEET_S)
    one = solve(Body(), Skin(), Electrodes(), Drive(), ((PUNCHES[1], touch),), LAW)
    touched, baseline = (np.tile(volts.ravel(), (ROWS, 1)) for volts in (one.touched_V, one.baseline_V))
    begun = time.process_time()
    measured(EVERY, touched, baseline, range(ROWS), by_contact_V=slopes)
    return {"what": "measure", "electrodes": "line", "cpu_ms": (time.process_time() - begun) / ROWS * 1e3}


def fields_row(punch: Punch, touch: Touch, grid: dict[str, object]) -> dict[str, object]:
    stored, scene = fields_from({"names": list(QUANTITIES), **grid}), Scene(punches=(punch,))
    values(stored, scene, [touch], LAW)  # compiles
    begun = time.process_time()
    rows = {scene_number: values(stored, scene, [touch], LAW) for scene_number in range(8)}
    content = encoded(stored, scene.body, rows)
    return {"what": "fields", "x_mm": punch.x_m * 1e3, "grid": stored.grid, "points": int(np.prod(stored.shape)),
            "cpu_ms": (time.process_time() - begun) / 8 * 1e3, "bytes": len(content) / 8}


def main() -> None:
    touches = [solve_touch(FOAM, Body(), punch) for punch in PUNCHES]
    clipped = solve_near_rim(FOAM, Body(), NEAR_RIM)
    pairs = [*zip(PUNCHES, touches, strict=True), (NEAR_RIM, clipped)]
    found = [row for punch, touch in pairs for row in contact_rows(punch, touch, Electrodes())]
    found += contact_rows(PUNCHES[1], touches[1], PATCHES)
    found.append(measure_row(touches[1]))
    found += [fields_row(punch, touch, grid) for punch, touch in (pairs[1], pairs[-1]) for grid in GRIDS]
    shown(written(found, "measured"))


if __name__ == "__main__":
    main()
