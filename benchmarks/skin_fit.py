"""The skin of hidden sensors fitted to labelled presses, and presses that were not labelled read by it.

Usage: python benchmarks/skin_fit.py. Writes results/skin_fit.csv, a row a sensor; rows that are there are kept.
Synthetic: the hidden sensors of sensor_fit.py, 8 or 16 electrodes, every other sheet uneven, and a skin that differs
from the card: the law's amplitude by up to 20 %, the foam's moduli by up to 15 %, uniformly; the law's shape by 0.1,
one standard deviation, and the origin of the labels by 0.5 mm along x and y. 20 labelled presses and 8 others of a
14 mm punch, 0.3 to 2 N, within 70 mm of the centre, each with an untouched frame before it, white noise 80 dB below the
untouched frame's r.m.s. Signals are solved on meshes, on the hidden electrodes and through the hidden channels; the fit
takes ring stacks. What an uneven sheet changes of a signal is of first order in the touch. Mechanics are those of one
table of load paths for both, so that its error is in none of these figures.

Place and force of the other presses are those of least squares against the signals of the calibrated sensor, by the
card as it is and by the calibrated one, from 3 mm and 20 % off. Intervals of the force hold what readings scatter by:
noise alone by the card as it is; by the calibrated one noise with what the fit leaves of presses that it did not see,
their size and pattern, and the covariance of what it found.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from conditions import RESULTS, quick, written
from scipy.optimize import least_squares
from sensor_fit import NOISE_DB, hidden

from eitsim.electrics.imaging.gauss_newton import pixel_signals, pixels
from eitsim.scene.scene import Punch
from eitsim.sensors.calibration.calibrate import calibrate
from eitsim.sensors.calibration.instrument_model import Instrument, sources, voltages
from eitsim.sensors.calibration.placement import Placement
from eitsim.sensors.calibration.skin_fit import SkinFit
from eitsim.sensors.calibration.skin_law import AMPLITUDE, MODULUS, OFFSETS, SHAPES, SkinPresses, changed, skin_presses
from eitsim.sensors.labels import Labels
from eitsim.sensors.recording import Recording
from eitsim.simulation.material import material_of
from eitsim.simulation.simulate import readings_of
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array

SENSORS, LABELLED, UNSEEN = 12, 20, 8
AMPLITUDES, MODULI, SHAPE_SD, OFFSET_MM = 0.2, 0.15, 0.1, 0.5
WITHIN_M, FORCES_N, DIAMETER_MM = 0.07, (0.3, 2.0), 14.0
RINGS, SPREAD_M = 14, 7e-3  # of pixels, and how far a touch's change of conductance reaches, one standard deviation
INSIDE_95, INSIDE_90 = 1.959963984540054, 1.6448536269514722
CARD = MaterialCard("foam", Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm"),
                    conductivity=Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4)))


@dataclass(frozen=True, eq=False)
class Bench:
    """A hidden sensor, what it is, its recording, and its presses, the labelled ones first."""

    sensor: Any
    truth: dict[str, float]
    recording: Recording
    labels: Labels
    signal: Array  # (n, m) as read


def made(seed: int, *, even: bool) -> Bench:
    """A hidden sensor by chance."""
    one, rng = hidden(seed), np.random.default_rng([26, seed])
    sensor, asked = one.sensor, one.sensor.protocol
    held = Instrument(sensor.body, sensor.electrodes, sources(asked), 1e-3)
    state = one.truth.copy()
    if even:
        state[held.places["sheet"]] = 0.0
    rest = voltages(held, asked, state).ravel()
    noise = np.sqrt(np.mean(rest**2)) * 10 ** (-NOISE_DB / 20)
    truth = {AMPLITUDE: np.log1p(rng.uniform(-AMPLITUDES, AMPLITUDES)), MODULUS: np.log1p(rng.uniform(-MODULI, MODULI)),
             **dict(zip(SHAPES, SHAPE_SD * rng.standard_normal(2), strict=True)),
             **dict(zip(OFFSETS, OFFSET_MM * rng.standard_normal(2), strict=True))}
    count = LABELLED + UNSEEN
    radius, angle = WITHIN_M * np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * np.pi, count)
    place_mm = 1e3 * np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    force = rng.uniform(*FORCES_N, count)
    labels = Labels(np.array([f"p{k:02d}" for k in range(count)]), ("x_mm", "y_mm", "d_mm", "F_N"),
                    np.column_stack([place_mm, np.full(count, DIAMETER_MM), force]))
    scene = replace(sensor.scene, electrodes=held.built(state), channels=held.channels(state))
    presses = skin_presses(scene, CARD, labels, 1e-3 * place_mm)
    assert len(presses.rows) == count
    clean = by_mesh(presses, truth)
    if not even:
        clean = clean + uneven(presses, truth, clean)
    frames = np.empty((2 * count, rest.size))
    frames[::2] = rest + noise * rng.standard_normal(clean.shape)
    frames[1::2] = rest + clean + noise * rng.standard_normal(clean.shape)
    touch = np.array([name for one in labels.touch.tolist() for name in ("", one)])
    recording = Recording(frames, np.arange(2 * count), None, touch, "voltage", Path("synthetic"))
    return Bench(sensor, truth, recording, labels, frames[1::2] - frames[::2])


def by_mesh(presses: SkinPresses, values: dict[str, float]) -> Array:
    """Signals (k, m), V, of a skin, solved on meshes that follow the touches."""
    skin = material_of(presses.scene, changed(presses.card, values)).skin
    return np.array([readings_of(scene, (touch,), skin, exact=True).signal_V.ravel()
                     for scene, touch in presses.touches(values)])


def uneven(presses: SkinPresses, values: dict[str, float], clean: Array) -> Array:
    """(k, m) what the sheet's modes change of signals, for touches of first order of the same size."""
    scene = presses.scene
    mosaic = pixels(scene.body.radius_m, RINGS)
    flat = replace(scene.channels, sheet_modes=())
    both = [pixel_signals(scene.body, scene.electrodes, scene.drive, channels, mosaic)
            for channels in (flat, scene.channels)]
    out = []
    for (one, _), signal in zip(presses.touches(values), clean, strict=True):
        away = np.sum((mosaic.centre_m - [one.punches[0].x_m, one.punches[0].y_m])**2, axis=1)
        weight = np.exp(-away / (2 * SPREAD_M**2)) * mosaic.area_m2
        even, true = (one @ weight for one in both)
        out.append((even @ signal) / (even @ even) * (true - even))
    return np.array(out)


@dataclass(frozen=True, eq=False)
class Reader:
    """Presses on a calibrated sensor by a card."""

    presses: SkinPresses
    values: dict[str, float]

    def signal(self, x_mm: float, y_mm: float, force_N: float, values: dict[str, float] | None = None) -> Array:
        """(m,) V of one press."""
        punch = Punch(1e-3 * x_mm, 1e-3 * y_mm, 1e-3 * DIAMETER_MM, force_N)
        return replace(self.presses, punches=(punch,)).signals(values or self.values)[0]

    def read(self, signal: Array, start: Array) -> tuple[Array, Array]:
        """(3,) x, mm, y, mm, and ln F / N, with (m, 3) derivatives of the signal."""
        size = np.linalg.norm(signal)
        found = least_squares(lambda at: (self.signal(at[0], at[1], np.exp(at[2])) - signal) / size, start,
                              x_scale=(1.0, 1.0, 0.1), diff_step=3e-3, ftol=1e-5, xtol=1e-4, max_nfev=12)
        return found.x, size * found.jac

    def by_values(self, at: Array, names: tuple[str, ...], steps: Array) -> Array:
        """(m, p) derivatives of a press's signal by the skin's parameters."""
        here = self.signal(at[0], at[1], np.exp(at[2]))
        return np.stack([(self.signal(at[0], at[1], np.exp(at[2]), self.values | {name: self.values[name] + step})
                          - here) / step for name, step in zip(names, steps, strict=True)], axis=1)


def row_of(seed: int, *, even: bool) -> dict[str, Any]:
    """What a hidden sensor's presses gave."""
    one = made(seed, even=even)
    labels = Labels(one.labels.touch[:LABELLED], one.labels.names, one.labels.values[:LABELLED])
    begun = time.process_time()
    found = calibrate(one.sensor, one.recording, labels, CARD)
    spent = time.process_time() - begun
    assert found.skin is not None
    assert found.instrument is not None
    assert found.fit is not None
    fit, state = found.skin.fit, found.fit.state
    sd, skin = np.sqrt(np.diag(fit.covariance)), found.skin
    origin_mm: dict[str, float] = dict(zip(OFFSETS, 1e3 * skin.lies.placed(np.zeros((1, 2)))[0], strict=True))
    off = np.array([fit.value[k] + origin_mm.get(name, 0.0) - one.truth[name] for k, name in enumerate(fit.names)]) / sd
    row = {"sensor": seed, "sheet": "even" if even else "uneven", "kept": " ".join(fit.kept), "before": fit.before,
           "after": fit.after, "size_error": fit.size_error, "pattern_error": fit.pattern_error, "cpu_s": spent}
    for k, name in enumerate(fit.names):
        row |= {f"{name}_off": sd[k] * off[k], f"{name}_sd": sd[k], f"{name}_inside": int(abs(off[k]) < INSIDE_95)}
    scene = replace(one.sensor.scene, electrodes=found.instrument.built(state),
                    channels=replace(found.instrument.channels(state), sheet_modes=()))
    held = skin_presses(scene, CARD, one.labels, skin.lies.placed(1e-3 * one.labels.values[:, :2]))
    rest = one.recording.readings[0]
    noise = np.sqrt(2 * np.mean(rest**2)) * 10 ** (-NOISE_DB / 20)
    zero = dict.fromkeys(fit.names, 0.0)
    return (row | reads(one, Reader(held, zero), "card", noise, Placement())
            | reads(one, Reader(held, fit.values), "fitted", noise, skin.lies, fit))


def reads(one: Bench, by: Reader, way: str, noise: float, lies: Placement,
          fit: SkinFit | None = None) -> dict[str, float]:
    """Errors of place and force of the presses that were not labelled, which lie on the sensor as labels do, and the
    part inside 90 % intervals of force."""
    off, inside = [], []
    labels = one.labels.values[LABELLED:].copy()
    labels[:, :2] = 1e3 * lies.placed(1e-3 * labels[:, :2])
    for truth, signal in zip(labels, one.signal[LABELLED:], strict=True):
        start = np.array([truth[0] + 3.0, truth[1], np.log(1.2 * truth[3])])
        at, slope = by.read(signal, start)
        gain = np.linalg.pinv(slope)[2]
        variance = noise**2 * gain @ gain
        if fit is not None:
            model = by.signal(at[0], at[1], np.exp(at[2]))
            skin = gain @ by.by_values(at, fit.names, 0.1 * fit.prior_sd)
            variance = (max(fit.pattern_V, noise)**2 * gain @ gain + (fit.size_error * (gain @ model))**2
                        + skin @ fit.covariance @ skin)
        off.append(at - [truth[0], truth[1], np.log(truth[3])])
        inside.append(abs(off[-1][2]) < INSIDE_90 * np.sqrt(variance))
    away = np.array(off)
    return {f"{way}_place_mm": float(np.median(np.hypot(away[:, 0], away[:, 1]))),
            f"{way}_F_rmse_share": float(np.sqrt(np.mean(np.expm1(away[:, 2])**2))),
            f"{way}_F_inside_90": float(np.mean(inside))}


def main() -> None:
    """Write the table after each sensor, rows that are there kept as they are, and print its summary."""
    path = RESULTS / "skin_fit.csv"
    table = pd.read_csv(path) if path.exists() else pd.DataFrame({"sensor": [], "sheet": []})
    for seed in range(quick(SENSORS, 1)):
        if seed not in set(table["sensor"]):
            row = row_of(seed, even=seed % 2 == 0)
            table = written(pd.concat([table, pd.DataFrame([row])], ignore_index=True), "skin_fit")
    inside = [name for name in table.columns if name.endswith("_inside")]
    print(table.groupby("sheet")[[*inside, "size_error", "card_F_rmse_share", "fitted_F_rmse_share", "card_F_inside_90",
                                  "fitted_F_inside_90", "cpu_s"]].mean())


if __name__ == "__main__":
    main()
