"""Touches on hidden sensors read by a model of the ideal sensor: as they are, scaled, and calibrated.

Usage: python benchmarks/sensor_bench.py. Writes results/sensor_bench.csv, a row a sensor and way.
Synthetic: the hidden sensors of sensor_fit.py with 16 electrodes, one untouched frame, 20 labelled touches and 100
others within 80 mm of the centre, 0.3 to 2 N, noise 80 dB below the untouched frame's r.m.s. A touch changes the
conductance of the sheet smoothly about its place (5 mm, one standard deviation) by a moment of 34 mm^2 (F / 1 N)^0.8, a
14 mm punch's; its signal is of first order in that and exact in the sensor, on a finite-element mesh. Place and force
are those of least squares against signals of the ideal sensor, whose one number fitted is the sheet's conductance;
"known" takes the signals of the hidden sensor itself. Ways: "as read"; "scaled", readings times V0_ideal / V0; and
"calibrated", the map of `eitsim sensor correct`, made from the untouched frame alone; with "labels" one factor of the
moment from the 20 labelled touches too.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from conditions import quick, written
from scipy.optimize import least_squares
from sensor_fit import NOISE_DB, hidden

from eitsim.electrics.imaging.gauss_newton import Pixels, pixel_signals, pixels
from eitsim.scene.channels import Channels
from eitsim.sensors.calibration.calibrate import calibrate
from eitsim.sensors.calibration.calibration_file import CalibratedSensor
from eitsim.sensors.calibration.ideal_frames import to_ideal
from eitsim.sensors.calibration.instrument_model import Instrument, sources
from touchcal.arrays import Array

SENSORS, LABELLED, UNSEEN = 30, 20, 100
WITHIN_M, FORCES_N = 0.08, (0.3, 2.0)
MOMENT_M2, EXPONENT, SPREAD_M = 34e-6, 0.8, 5e-3
SEARCHED_M = 0.09
RINGS, GRID = 14, 12  # of pixels; places of the first search along the radius


@dataclass(frozen=True)
class Reader:
    """Place and force of signals by those of a sensor (m, t), in the few directions that these span."""

    mosaic: Pixels
    basis: Array  # (m, r)
    signals: Array  # (r, t)
    places_m: Array  # (g, 2) of the first search
    first: Array  # (g, r) V by a moment of 1 m^2 at them

    def of(self, place_m: Array) -> Array:
        """(r,) V by a moment of 1 m^2 at a place."""
        return self.signals @ spread(self.mosaic, place_m)

    def read(self, signal: Array) -> tuple[Array, float]:
        """Place, m, and force, N, of a signal (m,)."""
        seen = self.basis.T @ signal
        along = self.first @ seen
        best = np.argmax(np.sign(along) * along**2 / np.sum(self.first**2, axis=1))
        size = np.linalg.norm(seen)

        def left(place: Array) -> Array:
            model = self.of(inside(place))
            return (seen - (model @ seen) / (model @ model) * model) / size

        place = least_squares(left, self.places_m[best], x_scale=1e-3, diff_step=1e-3, ftol=1e-10, xtol=1e-10,
                              max_nfev=20).x
        place = inside(place)
        model = self.of(place)
        moment = max(float((model @ seen) / (model @ model)), 1e-12)
        return place, (moment / MOMENT_M2) ** (1 / EXPONENT)


def spread(mosaic: Pixels, place_m: Array) -> Array:
    """(t,) relative change of conductance on each pixel by a moment of 1 m^2 at a place."""
    weight = np.exp(-np.sum((mosaic.centre_m - place_m) ** 2, axis=1) / (2 * SPREAD_M**2)) * mosaic.area_m2
    return weight / (weight @ mosaic.area_m2)


def inside(place_m: Array) -> Array:
    """The place, or the nearest one that is no further from the centre than touches are searched."""
    return place_m * min(1.0, SEARCHED_M / max(float(np.hypot(*place_m)), 1e-12))


def reader(mosaic: Pixels, signals: Array, radius_m: float) -> Reader:
    """A reader by the signals (m, t) of a sensor."""
    left, value, _ = np.linalg.svd(signals, full_matrices=False)
    basis = left[:, value > 1e-6 * value[0]]
    axis = np.linspace(-1, 1, 2 * GRID + 1) * radius_m
    places = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    places, seen = places[np.hypot(*places.T) < SEARCHED_M], basis.T @ signals
    return Reader(mosaic, basis, seen, places, np.stack([seen @ spread(mosaic, place) for place in places]))


def touches(rng: np.random.Generator) -> tuple[Array, Array]:
    """Places (n, 2), m, and forces (n,), N."""
    count = LABELLED + UNSEEN
    radius, angle = WITHIN_M * np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), rng.uniform(*FORCES_N, count)


def rows_of(seed: int) -> Iterator[dict[str, Any]]:
    """One row for each way to read the touches of a hidden sensor."""
    one = hidden(seed, (16,))
    sensor, asked = one.sensor, one.sensor.protocol
    mosaic, rng = pixels(sensor.body.radius_m, RINGS), np.random.default_rng([24, seed])
    held = Instrument(sensor.body, sensor.electrodes, sources(asked), 1e-3)
    rest = one.recording.readings[0]
    true = pixel_signals(sensor.body, held.built(one.truth), sensor.drive, held.channels(one.truth), mosaic)
    places, forces = touches(rng)
    clean = np.stack([MOMENT_M2 * force**EXPONENT * (true @ spread(mosaic, place))
                      for place, force in zip(places, forces, strict=True)])
    noise = np.sqrt(np.mean(rest**2)) * 10 ** (-NOISE_DB / 20)
    signal = clean + noise * (rng.standard_normal(clean.shape) + rng.standard_normal(rest.shape))
    begun = time.process_time()
    found = calibrate(sensor, one.recording)
    assert found.fit is not None
    assert found.instrument is not None
    real = CalibratedSensor(sensor, found.instrument, found.fit.state, found.fit.misfit,
                            np.sqrt(np.diag(found.fit.covariance)))
    made = to_ideal(real)
    spent = time.process_time() - begun
    ideal_rest = made.untouched_V
    sheet = real.instrument.channels(real.state).conductance_S[0]
    ratio = float(ideal_rest @ rest / (ideal_rest @ ideal_rest))  # a uniform sheet's one number, from V0 alone
    even = pixel_signals(sensor.body, sensor.electrodes, sensor.drive, Channels(conductance_S=(sheet,)), mosaic)
    ideal, known = reader(mosaic, even, sensor.body.radius_m), reader(mosaic, true, sensor.body.radius_m)
    ways = {"known": (known, signal), "as read": (ideal, signal / ratio), "scaled": (ideal, signal * ideal_rest / rest),
            "calibrated": (ideal, signal @ made.matrix.T)}
    for way, (by, seen) in ways.items():
        answers = [by.read(each) for each in seen]
        at, force = np.stack([place for place, _ in answers]), np.array([value for _, value in answers])
        factor = float(np.exp(np.mean(np.log(force[:LABELLED] / forces[:LABELLED]))))
        for labels, value in (("", force), (" and labels", force / factor)):
            yield {"sensor": seed, "way": way + labels, **errors(at, value, places, forces), "held_out":
                   found.stages[found.kept[-1]].held_out, "map_left": made.left, "cpu_s": spent}


def errors(at: Array, force: Array, places: Array, forces: Array) -> dict[str, float]:
    """Of the unseen touches: r.m.s. of x and y, mm, and of the force over the true one, and medians."""
    off = 1e3 * (at - places)[LABELLED:]
    share = (force / forces - 1)[LABELLED:]
    return {"x_rmse_mm": np.sqrt(np.mean(off[:, 0] ** 2)), "y_rmse_mm": np.sqrt(np.mean(off[:, 1] ** 2)),
            "F_rmse_share": np.sqrt(np.mean(share**2)), "distance_median_mm": np.median(np.hypot(*off.T)),
            "F_median_share": np.median(np.abs(share))}


def main() -> None:
    """Write the table and print its summary."""
    table = written((row for seed in range(quick(SENSORS, 2)) for row in rows_of(seed)), "sensor_bench")
    print(table.groupby("way", sort=False)[["x_rmse_mm", "y_rmse_mm", "F_rmse_share", "distance_median_mm",
                                            "F_median_share"]].median())


if __name__ == "__main__":
    main()
