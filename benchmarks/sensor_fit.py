"""Hidden sensors calibrated to one untouched frame: parameters inside their intervals, what is unexplained, time.

Usage: python benchmarks/sensor_fit.py. Writes results/sensor_fit.csv, a row a sensor and group of parameters.
Synthetic: discs with line electrodes on the rim, drives from electrodes into one at ground, readings between
neighbours. Unknown to the fit: sheet conductance and how it varies (five smooth modes of its logarithm, 5 % each, which
makes a coating uneven by some 10 %), contact impedances (a factor of 3 either way, one standard deviation), widths of
the electrodes (5 %), places along the rim (0.5 mm), channel gains against ground (3 %), leaks to ground (half normal,
30 uS), white noise 80 dB below the frame's r.m.s. Frames are made by the solver that the fit takes, so that neither the
error of a mesh nor what the modes leave out is in them; currents are exact.
"""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from conditions import quick, written

from eitsim.scene.drive import Drive
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Skin
from eitsim.sensors.calibration.calibrate import calibrate
from eitsim.sensors.calibration.calibration_file import parameters_of
from eitsim.sensors.calibration.instrument_model import GROUPS, Instrument, sources, voltages
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor
from touchcal.arrays import Array

SENSORS = 30
# Hidden standard deviations, and the noise below the r.m.s. of a frame
CONTACT, WIDTH, PLACE_M, GAIN, LEAK_S, NOISE_DB = np.log(3.0), 0.05, 0.5e-3, 0.03, 30e-6, 80.0
COATING = 0.05  # of each mode of the sheet
CONDUCTANCES_S = (3e-4, 3e-3)  # of the sheets, uniform in the logarithm
INSIDE = 1.959963984540054  # standard deviations of a 95 % interval


@dataclass(frozen=True)
class Hidden:
    """A sensor as its file describes it, what it is, and its one untouched frame."""

    sensor: Sensor
    truth: Array  # (p,) state of its instrument
    recording: Recording


def described(count: int) -> Sensor:
    """A sensor that drives opposite and next but one electrodes both ways, and reads all neighbours."""
    unit = np.eye(count)
    ends = [(k, (k + step) % count) for step in (2, count // 2) for k in range(count)]
    drive = Drive(1e-3, currents=tuple(unit[a] - unit[b] for a, b in ends),
                  measurements=tuple(unit[:-1] - unit[1:]))
    return Sensor(Body(), Skin(), Electrodes(count=count), drive)


def hidden(seed: int, counts: tuple[int, ...] = (8, 16)) -> Hidden:
    """A hidden sensor by chance, of one of these numbers of electrodes."""
    rng = np.random.default_rng([23, seed])
    sensor = described(int(rng.choice(counts)))
    asked, count = sensor.protocol, sensor.electrodes.count
    instrument = Instrument(sensor.body, sensor.electrodes, sources(asked),
                            float(np.exp(rng.uniform(*np.log(CONDUCTANCES_S)))))
    width = WIDTH * rng.standard_normal(count)
    drawn = {"contacts": CONTACT * rng.standard_normal(count), "width": width.mean(), "widths": width,
             "sheet": COATING * rng.standard_normal(len(instrument.numbers("sheet"))),
             "positions": PLACE_M * rng.standard_normal(count), "gains": GAIN * rng.standard_normal(count),
             "leaks": LEAK_S * np.abs(rng.standard_normal(count))}
    truth = state_of(instrument, drawn)
    return Hidden(sensor, truth, recorded(voltages(instrument, asked, truth).ravel(), NOISE_DB, rng))


def state_of(instrument: Instrument, drawn: Mapping[str, Any]) -> np.ndarray:
    """The state whose groups of parameters are so far from their prior mean, without what no reading determines."""
    change = np.zeros(instrument.size)
    for group, values in drawn.items():
        change[instrument.places[group]] = values
    return instrument.prior_mean + instrument.gauged(change)


def recorded(clean: np.ndarray, noise_dB: float, rng: np.random.Generator) -> Recording:
    """One frame of readings (readings,), V, with white noise so far below their r.m.s."""
    noise = np.sqrt(np.mean(clean**2)) * 10 ** (-noise_dB / 20) * rng.standard_normal(clean.size)
    return Recording((clean + noise)[None], np.array([0]), None, np.array([""]), "voltage", Path("synthetic"))


def rows_of(one: Hidden, seed: int) -> Iterator[dict[str, Any]]:
    """One row for each group of parameters of a hidden sensor."""
    begun = time.process_time()
    found = calibrate(one.sensor, one.recording)
    spent = time.process_time() - begun
    assert found.instrument is not None
    fitted = parameters_of(found)
    values, sd, prior = (np.array([each[key] for each in fitted.values()]) for key in ("value", "sd", "prior_sd"))
    off = (values - one.truth * found.instrument.units) / sd
    for group in GROUPS:
        own = found.instrument.places[group]
        yield {"sensor": seed, "electrodes": one.sensor.electrodes.count, "group": group,
               "kept": group in found.kept, "parameters": len(off[own]),
               "inside_95": int(np.sum(np.abs(off[own]) < INSIDE)), "rms_off_over_sd": np.sqrt(np.mean(off[own] ** 2)),
               "median_sd_over_prior_sd": np.median(sd[own] / prior[own]),
               "held_out": found.stages[group].held_out, "misfit": found.fit.misfit if found.fit else np.nan,
               "cpu_s": spent}


def main() -> None:
    """Write the table and print its summary."""
    table = written((row for seed in range(quick(SENSORS, 3)) for row in rows_of(hidden(seed), seed)), "sensor_fit")
    for group in GROUPS:
        own = table[table["group"] == group]
        print(f"{group}: {own['inside_95'].sum() / own['parameters'].sum():.3f} inside 95 %")
    print(f"all: {table['inside_95'].sum() / table['parameters'].sum():.3f} of {table['parameters'].sum()}; "
          f"a fit takes {table['cpu_s'].median():.1f} s, at most {table['cpu_s'].max():.1f} s of CPU time")


if __name__ == "__main__":
    main()
