"""The law of hidden layers that conduct in their volume, fitted to labelled presses.

Usage: python benchmarks/layer_fit.py [SENSOR ...]. Writes results/layer_fit.csv, a row a sensor; rows that are there
are kept.
Synthetic: discs of 100 or 160 mm, 8 or 16 electrodes over the whole height of the rim, contacts, widths and gains
hidden as in sensor_fit.py; layers of rubber, driven by the largest strain, and of foam, by the change of volume, both
piezoresistive where PIEZO says so, 2 to 4 mm thick, on a rigid plate and on a soft base. The skin differs from the
card as in skin_fit.py: its law's amplitude, or both coefficients, by up to 20 %, its moduli by up to 15 %, its shape by
0.1, the origin of the labels by 0.5 mm; and from the sensor file by its thickness, 5 %, one standard deviation. 16
presses of 5 to 30 kPa by punches of 6, 10 and 14 mm, within 28 mm of the centre, each with an untouched frame before
it, white noise 100 dB below that, as of many frames averaged. Every press is a scene of the hidden card as `eitsim run`
solves it, from rest on its own mesh, on to half the element size where it misses its error of 2 %; the fit takes paths
of touches on a coarser mesh. Instrument and electrics are of one formulation.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from conditions import RESULTS, quick, written
from sensor_fit import CONTACT, GAIN, WIDTH, described, state_of
from skin_fit import AMPLITUDES, INSIDE_95, MODULI, OFFSET_MM, SHAPE_SD

from eitsim.scene.edges.disc import Disc
from eitsim.scene.fitted_layer import ACROSS, THICKNESS
from eitsim.scene.fitted_layer import PIEZO as LARGER
from eitsim.scene.scene import Accuracy, Body, Punch, Skin
from eitsim.sensors.calibration.calibrate import calibrate
from eitsim.sensors.calibration.instrument_model import Instrument, sources, voltages
from eitsim.sensors.calibration.skin_law import AMPLITUDE, MODULUS, OFFSETS, SHAPES, THICKNESS_SD, changed, fitted_skin
from eitsim.sensors.labels import Labels
from eitsim.sensors.recording import Recording
from eitsim.simulation.simulate import solve_scene
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.neo_hooke import NeoHooke

SENSORS, PRESSES, WITHIN_M, NOISE_DB = 10, 16, 0.028, 100.0
PIEZO, ALONG_ACROSS = (8, 9), (3.0, 1.0)  # sensors that are piezoresistive, and their coefficients
DISCS_M = 0.05, 0.08  # on a rigid plate and on a soft base, through which edges reach further
DIAMETERS_MM, THICKNESSES_MM, MEAN_PRESSURES_PA = (6.0, 10.0, 14.0), (2.0, 4.0), (5e3, 3e4)
RUBBER, FOAM = NeoHooke(2.5e4, 0.5), Hyperfoam(np.array([2e4]), np.array([4.0]), np.array([0.2]))
# The base's thickness over the layer's, and its card
BASE, BASE_CARD = 1.5, MaterialCard("base", Hyperfoam(np.array([1.5e4]), np.array([6.0]), np.array([0.1])))
CONDUCTION = Conductivity(0.5, np.array([-1.2, 0.7, -0.15]), (-0.4, 0.8))


def card_of(seed: int) -> tuple[MaterialCard, str]:
    """The card of a sensor, and what drives its layer."""
    law: Law = FOAM if seed % 2 else RUBBER
    strain = "piezoresistive" if seed in PIEZO else "volume" if seed % 2 else "principal"
    return MaterialCard("layer", law, conductivity=CONDUCTION), strain


def row_of(seed: int) -> dict[str, Any]:
    """What a hidden layer's presses gave."""
    rng, (card, strain) = np.random.default_rng([51, seed]), card_of(seed)
    soft, count = seed % 4 > 1, int(rng.choice((8, 16)))
    thickness_m = 1e-3 * rng.uniform(*THICKNESSES_MM)
    base = Path(tempfile.gettempdir()) / "layer_fit_base.json"
    write_card(BASE_CARD, base)
    skin = Skin(thickness_m, strain, "layer", base_m=BASE * thickness_m if soft else 0.0,
                base_card=str(base) if soft else "", **dict(
                    zip(("along", "across"), ALONG_ACROSS if seed in PIEZO else (0.0, 0.0), strict=True)))
    plain = described(count)
    sensor = replace(plain, body=Body(Disc(DISCS_M[soft])), skin=skin, electrodes=replace(plain.electrodes, soft=True))
    sensor = replace(sensor, body=sensor.scene.body)
    asked = sensor.protocol
    held = Instrument(sensor.body, sensor.electrodes, sources(asked), CONDUCTION.c0_S_per_m * thickness_m)
    width = WIDTH * rng.standard_normal(count)
    state = state_of(held, {"contacts": CONTACT * rng.standard_normal(count), "width": width.mean(), "widths": width,
                            "gains": GAIN * rng.standard_normal(count)})
    truth = {AMPLITUDE: np.log1p(rng.uniform(-AMPLITUDES, AMPLITUDES)), MODULUS: np.log1p(rng.uniform(-MODULI, MODULI)),
             **dict(zip(SHAPES, SHAPE_SD * rng.standard_normal(2), strict=True)),
             **dict(zip(OFFSETS, OFFSET_MM * rng.standard_normal(2), strict=True))}
    truth[THICKNESS] = THICKNESS_SD * np.random.default_rng([52, seed]).standard_normal()
    if seed in PIEZO:
        truth |= {LARGER: truth[AMPLITUDE], ACROSS: truth[SHAPES[0]]}
    radius, angle = WITHIN_M * np.sqrt(rng.uniform(size=PRESSES)), rng.uniform(0, 2 * np.pi, PRESSES)
    d_mm, (low, high) = rng.choice(DIAMETERS_MM, PRESSES), np.log(MEAN_PRESSURES_PA)
    force_N = np.exp(rng.uniform(low, high, PRESSES)) * np.pi / 4 * (1e-3 * d_mm) ** 2
    labels = Labels(np.array([f"p{k:02d}" for k in range(PRESSES)]), ("x_mm", "y_mm", "d_mm", "F_N"), np.column_stack([
        1e3 * radius * np.cos(angle), 1e3 * radius * np.sin(angle), d_mm, force_N]))
    scene = replace(sensor.scene, electrodes=held.built(state), channels=held.channels(state), accuracy=Accuracy(0.02),
                    skin=fitted_skin(skin, truth))
    hidden, begun, clean, depths = changed(card, truth), time.process_time(), [], []
    for x_mm, y_mm, *size in labels.values.tolist():
        x, y = (1e-3 * (at + truth[name]) for at, name in zip((x_mm, y_mm), OFFSETS, strict=True))
        solved = solve_scene(replace(scene, punches=(Punch(x, y, 1e-3 * size[0], size[1]),)), hidden)
        assert solved.readings is not None, solved.message
        clean.append(solved.readings.signal_V.ravel())
        depths.append(solved.touches[0].depth_m / scene.skin.thickness_m)
    solving = time.process_time() - begun
    rest = voltages(held, asked, state).ravel()
    noise = np.sqrt(np.mean(rest**2)) * 10 ** (-NOISE_DB / 20)
    frames = np.empty((2 * PRESSES, rest.size))
    frames[::2] = rest + noise * rng.standard_normal((PRESSES, rest.size))
    frames[1::2] = rest + np.array(clean) + noise * rng.standard_normal((PRESSES, rest.size))
    touch = np.array([name for one in labels.touch.tolist() for name in ("", one)])
    begun = time.process_time()
    found = calibrate(sensor, Recording(frames, np.arange(2 * PRESSES), None, touch, "voltage", Path("synthetic")),
                      labels, card)
    spent = time.process_time() - begun
    assert found.skin is not None, found.reason
    fit, skin_fit = found.skin.fit, found.skin
    sd = np.sqrt(np.diag(fit.covariance))
    origin_mm: dict[str, float] = dict(zip(OFFSETS, 1e3 * skin_fit.lies.placed(np.zeros((1, 2)))[0], strict=True))
    row: dict[str, Any] = {
        "sensor": seed, "layer": card.law.name if card.law else "", "base": "soft" if soft else "rigid",
        "strain": strain, "electrodes": count, "thickness_mm": 1e3 * thickness_m, "least_depth": min(depths),
        "most_depth": max(depths), "presses": skin_fit.presses, "kept": " ".join(fit.kept), "before": fit.before,
        "after": fit.after, "size_error": fit.size_error, "pattern_error": fit.pattern_error, "cpu_s": spent,
        "presses_cpu_s": solving}
    for k, name in enumerate(fit.names):
        off = fit.value[k] + origin_mm.get(name, 0.0) - truth[name]
        row |= {f"{name}_off": off, f"{name}_sd": sd[k], f"{name}_inside": int(abs(off) < INSIDE_95 * sd[k])}
    return row


def main() -> None:
    """Write the table after each sensor, rows that are there kept as they are, and print its summary."""
    path = RESULTS / "layer_fit.csv"
    table = pd.read_csv(path) if path.exists() else pd.DataFrame({"sensor": [], "base": []})
    for seed in [int(one) for one in sys.argv[1:]] or range(quick(SENSORS, 1)):
        if seed not in set(table["sensor"]):
            table = written(pd.concat([table, pd.DataFrame([row_of(seed)])], ignore_index=True), "layer_fit")
    inside = [name for name in table.columns if name.endswith("_inside")]
    print(table.groupby(["layer", "base"])[[*inside, "before", "after", "size_error", "cpu_s"]].mean())


if __name__ == "__main__":
    main()
