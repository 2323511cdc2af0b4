"""Patterns of simulated touches as a model of the sensor: a process over the rows of a sweep, which goes on from the
sensitivity of a uniform disc, gives the mean pattern at each place, whatever the force and the punch of the rows."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitsim.scene.drive import Protocol
from eitsim.sensors.sensor_file import Sensor
from surrogate.data.samples import SweepSamples, read_samples, take
from surrogate.data.sensor_ring import Ring
from surrogate.recordings.pattern_process import Conditioned, choose, conditioned
from surrogate.recordings.patterns import direction
from surrogate.recordings.physics.disc_sensitivity import DiscSensitivity
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Complex
from touchcal.errors import InputFileError

MOST_ROWS = 400  # rows of the sweep that are kept, evenly spread


@dataclass(frozen=True, eq=False)
class SimulatedPatterns:
    """The mean pattern of a sweep's touches by their place: gains times the sensitivity of a uniform disc, and a
    process."""

    linear: DiscSensitivity
    found: Conditioned  # at places on the disc of radius 1, electrode 0 at (1, 0) and the others counter-clockwise

    def __call__(self, place: Complex) -> Array:
        """(n, m) patterns at places (n,) of the disc of radius 1."""
        return self.found.at(_plane(place), self.linear(place))


def read_simulated(folder: Path, sensor: Sensor) -> SimulatedPatterns:
    """The patterns of a folder that `eitsim sweep` wrote, for the readings of a sensor; InputFileError where it is no
    such folder, holds no row of one touch, or has other electrodes, another number of readings or another protocol."""
    samples = read_samples(folder)
    _check_protocol(folder, samples.ring, sensor)
    return simulated_patterns(take(samples, spread_evenly(len(samples), MOST_ROWS)), sensor.protocol)


def simulated_patterns(samples: SweepSamples, asked: Protocol) -> SimulatedPatterns:
    """The patterns of samples whose readings are those of a protocol."""
    x, y = samples.targets(["x0", "y0"]).T / samples.ring.radius_mm
    place = (x + 1j * y) * np.exp(-1j * samples.ring.angle_rad[0])
    linear, pattern = DiscSensitivity(asked), direction(samples.signal_V)
    process = choose(pattern, _plane(place), linear(place))
    return SimulatedPatterns(linear, conditioned(process, pattern, _plane(place), linear(place)))


def _plane(place: Complex) -> Array:
    return np.stack([place.real, place.imag], axis=1)


def _check_protocol(folder: Path, ring: Ring, sensor: Sensor) -> None:
    count, asked = sensor.electrodes.count, sensor.protocol
    readings = asked.weights.reshape(-1, count)
    fix = "Sweep a design whose [electrodes] and [drive] are those of the sensor file."
    if ring.sheet is not None:
        raise InputFileError(folder, "its skin has an outline, and patterns are simulated on discs. Leave it out: a "
                                     "reader learns skins of any outline from presses alone.")
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
