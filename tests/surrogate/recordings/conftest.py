"""Synthetic presses, no skin measured: first-order signals in the harmonic fields of the uniform disc, with noise."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from eitsim.sensors.labels import PLACE, Labels
from surrogate.data.sensor_ring import ring_of_design
from surrogate.forward_map.multipole_series import electrode_fields
from surrogate.recordings import networks, templates
from surrogate.recordings.presses import Presses
from touchcal.arrays import Array

RING = ring_of_design({})
RADIUS_MM = 100.0


@contextmanager
def short_networks() -> Iterator[None]:
    """Few, short networks, and templates on a grid of three quarters as many points across: for what does not depend on
    how well they learn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(networks, "MOST_STEPS", 40)
        patch.setattr(networks, "HIDDEN", (32,))
        patch.setattr(templates, "ACROSS", 60)
        yield


def synthetic_signal(place_mm: Array, depth: Array) -> Array:
    """(n, 208) depth times the product of the driving and the reading field at places (n, 2)."""
    z = (place_mm[:, 0] + 1j * place_mm[:, 1]) / RADIUS_MM
    fields = electrode_fields(RING, RING.modes, z, 1)[0]
    drive = fields[:, RING.source] - fields[:, RING.sink]
    read = fields[:, RING.read] - fields[:, RING.ground]
    return depth[:, None] * (drive * read.conj()).real


def synthetic_places(rng: np.random.Generator, count: int) -> Array:
    """(count, 2) places evenly over a disc of 60 mm, mm."""
    radius, angle = 60 * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def synthetic_presses(seed: int, count: int, noise: float = 0.3) -> tuple[Presses, Array]:
    """Presses of differences and their places; noise over the mean size of a reading."""
    rng = np.random.default_rng(seed)
    place = synthetic_places(rng, count)
    signal = synthetic_signal(place, rng.uniform(0.7, 1.3, count))
    signal += noise * np.abs(signal).mean() * rng.standard_normal(signal.shape)
    return Presses(np.arange(count).astype(np.str_), np.arange(count), signal, np.full_like(signal, np.nan),
                   np.zeros(count), np.empty((0, signal.shape[1])), np.empty(0),
                    np.arange(float(count))), place


def labels_at(place: Array, **others: Array) -> Labels:
    """Labels of synthetic presses: their places (n, 2), mm, and others (n,) by name."""
    values = np.column_stack([place, *others.values()])
    return Labels(np.arange(len(place)).astype(np.str_), (*PLACE, *others), values)


@pytest.fixture(scope="session")
def presses() -> tuple[Presses, Array]:
    return synthetic_presses(1, 60)
