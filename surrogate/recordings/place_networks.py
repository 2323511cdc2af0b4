"""Three families of networks that read places: of the readings alone, of these and of the places by templates, and of
what templates miss."""

from dataclasses import dataclass

import numpy as np

from surrogate.recordings import networks
from surrogate.recordings.networks import Networks
from surrogate.recordings.patterns import Features, learn_features
from surrogate.recordings.waves import Waves, draw_waves
from touchcal.arrays import Array, Index

FAMILIES = ("networks", "networks on templates", "corrected templates")


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
