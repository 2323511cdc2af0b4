"""Patterns that a model of the sensor expects at places of a recording, compressed as recorded ones are: the model
knows them on the disc of radius 1, up to a gain of each reading; how the sensor lies in the coordinates of the labels
is found from labelled presses.

A pose is scored by the part of the patterns' variance that gains times the model's patterns, and a constant of each
reading, leave unexplained. Turn and direction of counting are searched over the whole circle, the middle at the origin
and in the middle of the labels; then turn, middle and radius are refined by least squares, the last two with a prior
about the middle found and the radius that the sensor file says.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from eitsim.sensors.sensor_file import Sensor
from surrogate.recordings.pattern_process import Expected
from surrogate.recordings.patterns import centred, compressed, compression_scale
from surrogate.recordings.physics.disc_sensitivity import DiscSensitivity
from surrogate.recordings.physics.simulated_patterns import read_simulated
from surrogate.recordings.physics.turned_readings import RingSymmetry
from surrogate.statistics.gaussian_process import spread_evenly
from touchcal.arrays import Array, Complex, Index

TURNS = 48  # turns tried, of either direction of counting
MOST_ROWS = 100  # rows that a pose is found from
# Standard deviations of the middle, over the radius, and of the logarithm of the radius that are believed before any
# data; the turn is free, and only scaled. PRIOR: part of the patterns' variance that one of them is worth.
MIDDLE, TURN, LOG_RADIUS, PRIOR = 0.1, 0.1, 0.1, 0.002
MOST_EVALUATIONS = 12
REACH = 0.97  # of the radius: places further out are drawn in to it, for fields of point electrodes are infinite there

Model = Callable[[Complex], Array]  # places (n,) of the disc of radius 1 -> patterns (n, m)


@dataclass(frozen=True, eq=False)
class Pose:
    """How a sensor lies in the coordinates of the labels."""

    middle: complex  # x + i y of its middle, mm
    radius: float  # mm
    turn: float  # angle of electrode 0 from +x, rad
    mirrored: bool  # electrodes count clockwise

    def on_disc(self, place: Array) -> Complex:
        """(n,) places (n, 2), mm, on the disc of radius 1 with electrode 0 at 1."""
        z = (place[:, 0] + 1j * place[:, 1] - self.middle) / self.radius * np.exp(-1j * self.turn)
        z = np.conj(z) if self.mirrored else z
        return z * np.minimum(1, REACH / np.maximum(np.abs(z), REACH))


@dataclass(frozen=True, eq=False)
class Expectation:
    """A model's patterns in a recording, once presses say how the sensor lies."""

    model: Model
    radius: float  # of the sensor, mm
    columns: Index | None = None  # readings of the model that make up a pattern; None: all
    ring: RingSymmetry | None = None

    def taking(self, columns: Index) -> "Expectation":
        """The expectation of patterns of these readings of the model."""
        return replace(self, columns=columns, ring=self.ring and self.ring.taking(columns))

    @property
    def priors(self) -> tuple[Callable[[Array, Array], Expected], ...]:
        """What the model of the sensor expects, and what the symmetry of its ring does."""
        return self.learn, *([self.ring.learn] if self.ring else [])

    def learn(self, pattern: Array, place: Array) -> Expected:
        """What it expects up to gains, learnt from patterns (n, m) at places (n, 2), mm."""
        rows = spread_evenly(len(place), MOST_ROWS)
        pose = self.pose(pattern[rows], place[rows])
        scale = compression_scale(self.patterns(pose, place[rows]))
        return Expected(lambda there: compressed(self.patterns(pose, there), scale))

    def patterns(self, pose: Pose, place: Array) -> Array:
        """(n, m) patterns at places (n, 2), mm."""
        found = self.model(pose.on_disc(place))
        return found if self.columns is None else found[:, self.columns]

    def pose(self, pattern: Array, place: Array) -> Pose:
        """How the sensor lies, by patterns (n, m) at places (n, 2), mm."""
        left = centred(pattern)
        left /= max(float(np.linalg.norm(left)), np.finfo(float).tiny)
        middles = 0j, complex(*((place.min(axis=0) + place.max(axis=0)) / 2))

        def missed(pose: Pose) -> Array:
            expected = self.patterns(pose, place)
            basis = centred(compressed(expected, compression_scale(expected)))
            information = np.sum(basis**2, axis=0)
            return left - np.sum(left * basis, axis=0) / (information + PRIOR * information.mean()) * basis

        start = min((Pose(middle, self.radius, turn, mirrored) for middle in middles for mirrored in (False, True)
                     for turn in 2 * np.pi * np.arange(TURNS) / TURNS), key=lambda one: float(np.sum(missed(one)**2)))

        def moved(by: Array) -> Pose:
            return replace(start, middle=start.middle + MIDDLE * self.radius * (by[0] + 1j * by[1]),
                           radius=self.radius * float(np.exp(LOG_RADIUS * by[2])),
                           turn=start.turn + TURN * float(by[3]))

        found = least_squares(lambda by: np.append(missed(moved(by)), np.sqrt(PRIOR) * by[:3]), np.zeros(4),
                              max_nfev=MOST_EVALUATIONS)
        return moved(found.x)


def expectation_of(sensor: Sensor, simulated: Path | None = None) -> Expectation:
    """What the sensitivity of a uniform disc expects of a sensor's readings, or where a folder is given the touches
    that `eitsim sweep` simulated into it; ValueError where the body is no disc, and errors as read_simulated."""
    return Expectation(read_simulated(simulated, sensor) if simulated else DiscSensitivity(sensor.protocol),
                       sensor.body.radius_m * 1e3, ring=RingSymmetry(sensor.protocol))
