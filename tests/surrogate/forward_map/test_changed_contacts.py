"""A contact that changed between the untouched and the touched frame: its direction, and intervals that hold."""

from collections.abc import Callable

import numpy as np
import pytest

import surrogate
from eitsim.electrics.forward.untouched import by_contact
from eitsim.scene.scene import scene_from
from surrogate.data.sensor_ring import ring_of
from surrogate.forward_map.inversion import changed_contacts
from surrogate.forward_map.inversion.changed_contacts import directions
from surrogate.model.simulated.touch_map import forward_of
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array

NOISE_V, CHANGE = 2e-5, 4.0


@pytest.mark.parametrize("width_mm", [10.0, 20.0])
def test_directions_are_those_of_the_complete_electrode_model(width_mm: float) -> None:
    """Against derivatives of solved readings: what an electrode shunts is most of what its contact does."""
    scene = scene_from({"electrodes": {"width_mm": width_mm}})
    exact = by_contact(scene.body, scene.electrodes, scene.drive, 6e-4)
    both = [one / np.linalg.norm(one, axis=0) for one in (exact, directions(ring_of(scene)))]
    along = both[0].T @ both[1]
    assert np.sqrt(1 - np.diag(along) ** 2).max() < 0.2
    assert np.abs(along - np.diag(np.diag(along))).max() < 0.5


@pytest.mark.thorough
def test_places_hold_where_one_contact_changed(inner_model: surrogate.SweepModel,
                                               synthetic: Callable[..., tuple[Array, Array]]) -> None:
    """A change of four standard deviations of the noise, of the contact of each electrode in turn: without counting it
    some three in four intervals hold the place. Frames without one keep their errors."""
    forward, rng = forward_of(inner_model), np.random.default_rng(5)
    touch, signal = synthetic(160, 78, reach_mm=45.0)
    clean = signal + NOISE_V * rng.standard_normal(signal.shape)
    unit = directions(forward.ring) / np.linalg.norm(directions(forward.ring), axis=0)
    changed = clean + CHANGE * NOISE_V * unit.T[np.arange(len(touch)) % 16]

    def held(frames: Array) -> tuple[float, float]:
        found = inner_model.learner.estimate(frames, NOISE_V)
        k = [inner_model.names.index(name) for name in ("x0", "y0")]
        off = np.abs(found.value[:, k] - touch[:, :2]) / found.sd[:, k]
        return float(np.mean(off < normal(COVERAGE))), float(np.median(found.sd[:, k]))

    (with_one, _), (without, wide) = held(changed), held(clean)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(changed_contacts, "CHANGED", 1e-6)
        (blind, _), (_, narrow) = held(changed), held(clean)
    assert blind < 0.82
    assert with_one > blind + 0.06
    assert with_one > 0.85
    assert without > 0.87
    assert wide < 1.1 * narrow
