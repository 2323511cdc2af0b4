"""Three families of networks that read places: of the readings alone, of these and of the places by templates, and of
what templates miss. To networks a place is itself and waves over the plane: random Fourier features of two Gaussian
kernels (Rahimi and Recht, Random features for large-scale kernel machines, NIPS 2007)."""

from dataclasses import dataclass

import numpy as np

from surrogate.recordings import networks
from surrogate.recordings.networks import Networks
from surrogate.recordings.patterns import Features, learn_features
from touchcal.arrays import Array, Index

LENGTHS = (0.5, 0.2)  # of the kernels, over the spread of the training places
EACH = 64  # waves a kernel
NEAR = 3.0  # factor of the place itself, over the spread: it counts as several inputs
FAMILIES = ("networks", "networks on templates", "corrected templates")


@dataclass(frozen=True, eq=False)
class Waves:
    """sqrt(2) cos(p . frequency + phase) of places p about a middle, over their spread."""

    middle: Array  # (2,) mm
    spread: float  # mm
    frequency: Array  # (2, q)
    phase: Array  # (q,)

    def of(self, place: Array) -> Array:
        """(n, 2 + q) the places (n, 2) in mm over the spread, times NEAR, and the waves there."""
        scaled = (place - self.middle) / self.spread
        return np.concatenate([NEAR * scaled, np.sqrt(2) * np.cos(scaled @ self.frequency + self.phase)], axis=1)


@dataclass(frozen=True, eq=False)
class PlaceNetworks:
    """The networks of the three families."""

    features: Features
    waves: Waves  # of the places by both templates: further inputs
    alone: Networks
    on_templates: Networks
    correction: Networks  # of the place by the templates of readings

    def read(self, signal: Array, direction: Array, compressed: Array) -> list[Array]:
        """Places (n, 2), mm, by each family, of signals (n, m) whose places by both templates are these (n, 2)."""
        inputs, further = self._inputs(signal, direction, compressed)
        return [self.alone.read_each(inputs).mean(axis=0), self.on_templates.read_each(further).mean(axis=0),
                compressed + self.correction.read_each(further).mean(axis=0)]

    def held_out(self, signal: Array, blocks: Index) -> Array:
        """(n, 2) what the networks of readings alone say of training presses, as seen in signals (n, m), that were
        trained without the block of each."""
        return networks.held_out(self.alone, self.features.of(signal), blocks)

    def _inputs(self, signal: Array, direction: Array, compressed: Array) -> tuple[Array, Array]:
        inputs = self.features.of(signal)
        return inputs, np.hstack([inputs, self.waves.of(direction), self.waves.of(compressed)])


def fit(signal: Array, place: Array, direction: Array, compressed: Array, blocks: Index,
        seed: int) -> tuple[PlaceNetworks, list[Array]]:
    """Networks of signals (n, m) at places (n, 2), mm, that templates read as these when they were held out; and what
    each family says of rows that were held out."""
    features, waves = learn_features(signal), draw_waves(place, seed)
    inputs = features.of(signal)
    further = np.hstack([inputs, waves.of(direction), waves.of(compressed)])
    alone, of_alone = networks.fit(inputs, place, blocks, seed)
    refined, of_refined = networks.fit(further, place, blocks, seed + 1)
    correction, missing = networks.fit(further, place - compressed, blocks, seed + 2)
    return (PlaceNetworks(features, waves, alone, refined, correction), [of_alone, of_refined, compressed + missing])


def draw_waves(place: Array, seed: int) -> Waves:
    """Waves for places (n, 2) in mm."""
    rng = np.random.default_rng(seed)
    frequency = np.concatenate([rng.standard_normal((2, EACH)) / length for length in LENGTHS], axis=1)
    spread = max(float(place.std(axis=0).mean()), np.finfo(float).tiny)
    return Waves(place.mean(axis=0), spread, frequency, rng.uniform(0, 2 * np.pi, frequency.shape[1]))
