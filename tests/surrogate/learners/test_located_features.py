"""Signals on a curved skin are located where the touch that makes them is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import surrogate
from eitsim.scene.curved.curved_scene import CurvedScene, curved_scene
from surrogate.data.sensor_ring import Ring, ring_of_curved, same_ring
from surrogate.learners import located_features
from surrogate.learners.located_features import located
from surrogate.live.pictured import pictured
from touchcal.arrays import Array

RADIUS_MM = 40.0


@pytest.fixture(scope="module")
def scene() -> CurvedScene:
    turn = np.pi / 4 * np.arange(8)
    rings = [[RADIUS_MM * np.cos(rise) * np.cos(a), RADIUS_MM * np.cos(rise) * np.sin(a), RADIUS_MM * np.sin(rise)]
             for rise in (0.5, -0.5) for a in turn]
    return curved_scene({"body": {"surface": "sphere", "radius_mm": RADIUS_MM, "thickness_mm": 8},
                         "punch": {"at_mm": [0, 0, RADIUS_MM]}, "electrodes": {"at_mm": rings, "width_mm": 8}}, Path())


@pytest.fixture(scope="module")
def ring(scene: CurvedScene) -> Ring:
    return ring_of_curved(scene)


def places(count: int, seed: int) -> Array:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    points[:, 2] /= 2  # about the electrodes
    return RADIUS_MM * points / np.linalg.norm(points, axis=1, keepdims=True)


def test_fields_stand_for_the_whole_sheet(ring: Ring) -> None:
    assert ring.curved is not None
    assert ring.curved.areas_mm2.sum() == pytest.approx(4 * np.pi * RADIUS_MM**2, rel=2e-4)
    np.testing.assert_allclose(ring.curved.slopes.sum(axis=2), 0, atol=1e-6 * np.abs(ring.curved.slopes).max())
    assert same_ring(ring, ring)


def test_the_page_which_is_flat_refuses_it(ring: Ring, inner_model: surrogate.Model) -> None:
    with pytest.raises(ValueError, match=r"this model's is curved\. Read its frames"):
        pictured(replace(inner_model, ring=ring))


@pytest.mark.thorough
def test_the_place_and_the_force_of_a_touch_are_found_from_what_it_makes_to_first_order(ring: Ring) -> None:
    """Signals of rings' changes that grow with the force, as the products of fields make them."""
    assert ring.curved is not None
    where, force = places(160, 1), np.random.default_rng(2).uniform(0.3, 1.5, 160)
    diameter = np.full(160, 12.0)
    blank = located(ring, where, force, diameter, np.random.default_rng(0).normal(size=(160, len(ring.read))))
    made = located_features._integrated(blank, where, np.eye(18)[[0, 3, 10]])
    share = np.column_stack([force, np.sqrt(force), 0.3 * force**1.5])
    signal = sum(share[:, [k]] * each for k, each in enumerate(made)) @ blank.axes.T
    taught = np.arange(160) < 120
    found = located(ring, where[taught], force[taught], diameter[taught], signal[taught]).features(signal[~taught])
    missed = np.linalg.norm(found[:, :3] - where[~taught], axis=1)
    assert np.median(missed) < 0.4
    assert np.quantile(missed, 0.9) < 1
    assert np.median(np.abs(np.exp(found[:, 4]) / force[~taught] - 1)) < 0.03
