"""The learned map as arrays: what the map itself says, by NumPy and torch, and what moved electrodes change."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import eitsim
import surrogate
from eitsim.electrics.forward.untouched import conductance_of, untouched_readings
from eitsim.scene.electrodes import middles
from surrogate.data.samples import SweepSamples, take
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import forward_map, polarization
from surrogate.forward_map.electrode_correction import RimEffect
from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.forward_map.map_arrays import map_arrays, signals
from surrogate.forward_map.ring_symmetry import symmetry_of
from surrogate.statistics.coefficient_process import SharedProcess
from surrogate.statistics.matern_process import Matern
from touchcal.arrays import Array


def differs(one: Array, other: Array) -> float:
    """The largest relative difference of rows, 2-norm."""
    return float(np.max(np.linalg.norm(one - other, axis=1) / np.linalg.norm(other, axis=1)))


@pytest.fixture(scope="module")
def interior(ring: Ring, synthetic: Callable[..., tuple[Array, Array]]) -> ForwardMap:
    return forward_map.fit(ring, *synthetic(60, 1, reach_mm=40.0))


def with_rim(known: ForwardMap, replaces: bool) -> ForwardMap:
    """The map with made-up effects of the rim, as large as its signals."""
    rng, zero = np.random.default_rng(3), known.correction
    pairs = 2 * len(polarization.pairs(polarization.RIM[0]))
    answer = SharedProcess(rng.normal(size=(9, 4)), rng.normal(size=4), rng.uniform(1, 2, 4),
                           1e-3 * rng.normal(size=(14, pairs)))
    symmetry = symmetry_of(known.ring)
    metal = RimEffect(symmetry, rng.normal(size=(len(symmetry.turn), len(known.ring.read), 3)),
                      Matern(rng.normal(size=(7, 6)), rng.uniform(1, 3, 6), rng.normal(size=(7, 3))), known.ring,
                      zero.rim.fill)
    return replace(known, correction=replace(zero, polarization=answer, rim=metal, replaces=replaces, step=0.1))


@pytest.mark.parametrize("rim", ["none", "added", "replaces"])
def test_arrays_say_what_the_map_says(rim: str, interior: ForwardMap,
                                      synthetic: Callable[..., tuple[Array, Array]]) -> None:
    known = interior if rim == "none" else with_rim(interior, rim == "replaces")
    touch, _ = synthetic(40, 5, reach_mm=40.0 if rim == "none" else 85.0)
    said = linearise(known, to_unknown(touch, known.p0)).signal_V
    assert differs(signals(map_arrays(known, 0.85), np, touch), said) < 1e-8


def test_the_state_of_a_material_counts_as_in_the_map(ring: Ring,
                                                      synthetic: Callable[..., tuple[Array, Array]]) -> None:
    state = np.random.default_rng(0).normal(size=(90, 1))
    known = forward_map.fit(ring, *synthetic(90, 1, reach_mm=35.0, stiffness=np.exp(0.1 * state[:, 0])), state)
    touch, _ = synthetic(8, 2, reach_mm=35.0)
    arrays, step = map_arrays(known), 1e-3 * np.ones((8, 1))
    slope = (signals(arrays, np, touch, None, step) - signals(arrays, np, touch, None, -step)) / 2e-3
    said = linearise(known, to_unknown(touch, known.p0)).discrepancy[..., -1]
    assert differs(slope, said) < 1e-5


def test_electrodes_turned_together_see_the_touch_turned_back(interior: ForwardMap) -> None:
    arrays, turn = map_arrays(interior), 0.2
    place = np.array([[25.0, 10.0, 14.0, 1.0]])
    back = (place[:, 0] + 1j * place[:, 1]) * np.exp(-1j * turn)
    there = np.column_stack([back.real, back.imag, place[:, 2:]])
    assert differs(signals(arrays, np, place, np.full((1, 16), turn)), signals(arrays, np, there)) < 1e-12


def test_untouched_readings_of_moved_electrodes_are_those_of_the_solver(interior: ForwardMap) -> None:
    scene = eitsim.Scene(electrodes=eitsim.Electrodes(width_m=0.002))
    still = untouched_readings(scene, 1e-3)
    sensor = surrogate.TouchMap(map_arrays(interior), interior.ring, still, interior.bounds, interior.known_mm)
    assert np.array_equal(sensor.untouched(np.zeros((1, 16)))[0], still)
    turned = 0.005 * np.random.default_rng(2).normal(size=16)
    moved = replace(scene, electrodes=replace(scene.electrodes, angles_rad=tuple(middles(scene.electrodes) + turned)))
    change = untouched_readings(moved, conductance_of(scene, still)) - still
    assert differs(sensor.untouched(turned[None]) - still, change[None]) < 0.03


def test_other_models_are_refused(samples: SweepSamples) -> None:
    with pytest.raises(ValueError, match="method is ridge, and only forward"):
        surrogate.touch_map(surrogate.train(take(samples, np.arange(80)), "ridge", "x0,y0,F", seed=1))
