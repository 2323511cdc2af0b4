"""Hidden sensors with an outline calibrated to one untouched frame: intervals, what is unexplained, time.

Usage: python benchmarks/outlined_sensor_fit.py. Writes results/outlined_sensor_fit.csv, a row a sensor and group of
parameters as results/sensor_fit.csv.
Synthetic: a rectangle of 120 x 80 mm with 16 line electrodes of 10 mm or 32 of 6 mm, and an L of 120 x 120 mm with a
hole and 24 of 8 mm.
Unknown to the fit: contact impedances (30 %, one standard deviation), widths of the electrodes (5 %), places along the
edge (0.5 mm), channel gains against ground (3 %), leaks to ground (half normal, 30 uS), and the sheet's conductance;
the sheet is even. White noise lies 60, 70 or 80 dB below the frame's r.m.s. Frames are solved on meshes made for the
hidden electrodes, to 5e-6 of the readings, which no fit takes.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from conditions import quick, written
from sensor_fit import Hidden, described, recorded, rows_of, state_of

from eitsim.electrics.outline.adapted_mesh import solve_untouched
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Scene
from eitsim.sensors.calibration.instrument_model import Instrument, instrument_readings, sources
from eitsim.sensors.sensor_file import Sensor

RECTANGLE = Body(Outline("rectangle", width_m=0.12, height_m=0.08))
L = Body(Outline("polygon", holes_m=((-0.03, -0.02, 0.008),), points_m=(
    (-0.06, -0.06), (0.06, -0.06), (0.06, 0.0), (0.0, 0.0), (0.0, 0.06), (-0.06, 0.06))))
# name, body, electrodes, their width, m, noise below the frame's r.m.s., dB, and how many sensors
CASES = (("rectangle", RECTANGLE, 16, 0.01, 60.0, 8), ("rectangle", RECTANGLE, 16, 0.01, 80.0, 1),
         ("rectangle", RECTANGLE, 32, 0.006, 70.0, 3), ("L with a hole", L, 24, 0.008, 60.0, 3),
         ("L with a hole", L, 24, 0.008, 80.0, 1))
CONTACT, WIDTH, PLACE_M, GAIN, LEAK_S = 0.3, 0.05, 0.5e-3, 0.03, 30e-6
CONDUCTANCES_S = (3e-4, 3e-3)
_SOLVED = 5e-6


def outlined(body: Body, count: int, width_m: float) -> Sensor:
    """The sensor of `sensor_fit`, its electrodes at even steps along an outline."""
    ring = described(count)
    scene = Scene(body=body, electrodes=Electrodes(count=count, width_m=width_m), drive=ring.drive)
    return replace(ring, body=body, electrodes=scene.electrodes)


def hidden(sensor: Sensor, noise_dB: float, seed: int) -> Hidden:
    """A hidden sensor by chance."""
    rng, asked, count = np.random.default_rng([29, seed]), sensor.protocol, sensor.electrodes.count
    sheet = float(np.exp(rng.uniform(*np.log(CONDUCTANCES_S))))
    instrument = Instrument(sensor.body, sensor.electrodes, sources(asked), sheet)
    width = WIDTH * rng.standard_normal(count)
    drawn = {"contacts": CONTACT * rng.standard_normal(count), "width": width.mean(), "widths": width,
             "positions": PLACE_M * rng.standard_normal(count), "gains": GAIN * rng.standard_normal(count),
             "leaks": LEAK_S * np.abs(rng.standard_normal(count))}
    truth = state_of(instrument, drawn)
    body = solve_untouched(sensor.body.outline, instrument.built(truth), sheet, _SOLVED).impedance_Ohm
    clean = instrument_readings(instrument, asked, truth, np.asarray(np.linalg.pinv(body), dtype=float)).ravel()
    return Hidden(sensor, truth, recorded(clean, noise_dB, rng))


def rows() -> Iterator[dict[str, Any]]:
    """The rows of each case."""
    for name, body, count, width, noise, sensors in quick(CASES, CASES[:1]):
        for drawn in range(quick(sensors, 1)):
            seed = int(noise) + count + 1000 * drawn
            for row in rows_of(hidden(outlined(body, count, width), noise, seed), seed):
                yield {"case": name, "noise_dB": noise, **row}


def main() -> None:
    """Write the table and print its summary."""
    table = written(rows(), "outlined_sensor_fit")
    for case, own in table.groupby(["case", "electrodes", "noise_dB"]):
        inside, count, spent = own["inside_95"].sum(), own["parameters"].sum(), own["cpu_s"].max()
        print(f"{case}: {inside} of {count} inside 95 %; {spent:.1f} s of CPU time")


if __name__ == "__main__":
    main()
