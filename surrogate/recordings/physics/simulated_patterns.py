"""Patterns of simulated touches as a model of the sensor: a process over the rows of a sweep gives the mean pattern at
each place, whatever the force and the punch of the rows."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from eitsim.sensors.sensor_file import Sensor
from surrogate.data.samples import read_samples
from surrogate.data.sensor_ring import Ring
from surrogate.recordings.pattern_process import Process, choose, matern
from surrogate.recordings.patterns import direction
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Complex
from touchcal.errors import InputFileError

MOST_ROWS = 400  # rows of the sweep that are kept, evenly spread


@dataclass(frozen=True, eq=False)
class SimulatedPatterns:
    """The mean pattern of a sweep's touches by their place."""

    place: Array  # (k, 2) on the disc of radius 1, electrode 0 at (1, 0) and the others counter-clockwise
    pattern: Array  # (k, m) directions of the signals
    process: Process  # its length over the radius

    @cached_property
    def weights(self) -> Array:
        """(k, m) weights of the kernels about the places."""
        kernel = matern(self.place, self.place, self.process.length) + self.process.noise * np.eye(len(self.place))
        return np.linalg.solve(kernel, self.pattern - self.pattern.mean(axis=0))

    def __call__(self, place: Complex) -> Array:
        """(n, m) patterns at places (n,) of the disc of radius 1."""
        there = np.stack([place.real, place.imag], axis=1)
        return self.pattern.mean(axis=0) + matern(there, self.place, self.process.length) @ self.weights


def read_simulated(folder: Path, sensor: Sensor) -> SimulatedPatterns:
    """The patterns of a folder that `eitsim sweep` wrote, for the readings of a sensor; InputFileError where it is no
    such folder, holds no row of one touch, or has other electrodes, another number of readings or another protocol."""
    samples = read_samples(folder)
    _check_protocol(folder, samples.ring, sensor)
    rows = spread_evenly(len(samples), MOST_ROWS)
    x, y = samples.targets(["x0", "y0"])[rows].T / samples.ring.radius_mm
    turned = (x + 1j * y) * np.exp(-1j * samples.ring.angle_rad[0])
    place, pattern = np.stack([turned.real, turned.imag], axis=1), direction(samples.signal_V[rows])
    return SimulatedPatterns(place, pattern, choose(pattern, place, np.zeros_like(pattern)))


def _check_protocol(folder: Path, ring: Ring, sensor: Sensor) -> None:
    count, asked = sensor.electrodes.count, sensor.protocol
    readings = asked.weights.reshape(-1, count)
    fix = "Sweep a design whose [electrodes] and [drive] are those of the sensor file."
    if len(ring.angle_rad) != count:
        raise InputFileError(folder, f"it simulates {len(ring.angle_rad)} electrodes, and the sensor has {count}. "
                                     f"{fix}")
    if len(ring.read) != len(readings):
        raise InputFileError(folder, f"it simulates {len(ring.read)} readings a frame, and the sensor's drive makes "
                                     f"{len(readings)}. {fix}")
    unit, currents = np.eye(count), np.repeat(asked.currents_A, asked.shape[1], axis=0)
    other = (np.abs(unit[ring.source] - unit[ring.sink]
                    - currents / np.abs(currents).max(axis=1, keepdims=True)).max(axis=1) > 1e-9)
    other |= np.abs(unit[ring.read] - unit[ring.ground] - readings).max(axis=1) > 1e-9
    if other.any():
        first = int(other.argmax())
        raise InputFileError(folder, f"its protocol is another: reading {first} is a current from electrode "
                                     f"{ring.source[first]} to {ring.sink[first]}, read from {ring.read[first]} to "
                                     f"{ring.ground[first]} (from 0), which the sensor's reading {first} is not. {fix}")
