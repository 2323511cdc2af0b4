from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from surrogate.data.samples import SweepSamples, take
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import forward_map, load_coordinates
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion import known_diameters
from surrogate.forward_map.inversion.invert import invert
from surrogate.model.train import train
from surrogate.statistics.levenberg_marquardt import Minimum
from touchcal.arrays import Array

Synthetic = Callable[..., tuple[Array, Array]]
KNOWN_MM = (10, 14, 18)


@pytest.fixture(scope="module")
def learned(ring: Ring, synthetic: Synthetic) -> ForwardMap:
    return forward_map.fit(ring, *synthetic(180, 0, KNOWN_MM, 40.0))


def test_punches_are_known_where_many_rows_share_few_diameters() -> None:
    assert load_coordinates.known_mm(np.repeat([14.0, 10.0], 50)).tolist() == [10.0, 14.0]
    for others in (np.linspace(10, 18, 500), np.full(200, 12.0), np.repeat([10.0, 14.0], [200, 7])):
        assert not len(load_coordinates.known_mm(others))


def test_a_known_punch_is_found_to_its_diameter_in_noise(learned: ForwardMap, synthetic: Synthetic) -> None:
    """Free diameters are off by several tenths of a millimetre there."""
    touch, signal = synthetic(30, 1, KNOWN_MM, 40.0)
    noisy = signal + 2e-7 * np.random.default_rng(2).normal(size=signal.shape)
    error = np.abs(invert(learned, noisy, 2e-7).touch[:, 2] - touch[:, 2])
    print("diameters off by", np.quantile(error, [0.5, 0.9, 1.0]), "mm")
    assert np.quantile(error, 0.9) < 0.01


def test_an_unknown_punch_is_not_taken_for_a_known_one(learned: ForwardMap, synthetic: Synthetic) -> None:
    touch, signal = synthetic(30, 3, (12,), 40.0)
    found = invert(learned, signal)
    print("diameters read:", np.quantile(found.touch[:, 2], [0.1, 0.5, 0.9]), "mm")
    assert np.quantile(np.abs(found.touch[:, 2] - touch[:, 2]), 0.8) < 0.3


@pytest.mark.thorough
def test_a_punch_between_those_of_a_list_is_in_the_intervals(samples: SweepSamples, synthetic: Synthetic) -> None:
    """Unless the list is said to be whole."""
    touch, signal = synthetic(180, 0, (10, 12, 14, 16, 18), 40.0)
    rows = take(samples, np.arange(len(samples)) < len(touch))
    rows = replace(rows, signal_V=signal, target=np.column_stack([touch, rows.target[:, 4:]]))
    noise_V = 2e-6
    held, wrong = {}, {}
    _, volts = synthetic(60, 3, (13,), 40.0)
    base = samples.baseline_V[0]
    noisy = base + volts + noise_V * np.random.default_rng(4).normal(size=volts.shape)
    for known in (False, True):
        model = train(rows, "forward", outputs="x0,y0,d,F", seed=1, exact_signals=True, known_punches=known)
        found = model.predict(noisy, base, noise_V=noise_V)
        low, high = 1e3 * found["d_lo90_m"], 1e3 * found["d_hi90_m"]
        plain = found["flag"] == ""
        held[known] = float(((low <= 13) & (high >= 13))[plain].mean())
        wrong[known] = float(((np.abs(1e3 * found["d_m"] - 13) > high - low) & plain).mean())
    print("held, silently wrong:", held, wrong)
    assert held[False] > 0.8
    assert wrong[False] < 0.05


def test_branches_of_one_punch_are_all_weighed_and_one_minimum_counts_once() -> None:
    """Two minima of equal evidence share the probability, however many starts ended in each."""
    ends = np.zeros((4, 5))
    ends[2:, 3] = 1.0
    normal = np.tile(np.eye(5) * 400.0, (4, 1, 1))
    branches = Minimum(ends, np.zeros(4), normal, np.zeros((4, 6)))
    free = Minimum(np.zeros((1, 5)), np.full(1, 40.0), normal[:1], np.zeros((1, 6)))
    selected = known_diameters.select(free, branches, 1, 1e-3)
    print("probabilities:", selected.probability)
    assert selected.probability[0] == pytest.approx([0.0, 0.5, 0.0, 0.5, 0.0], abs=1e-12)


def test_a_fit_that_ends_between_two_punches_has_both_tried() -> None:
    """The normal matrix of a poor minimum is far too sure of its diameter."""
    state = np.zeros((1, 5))
    state[0, known_diameters.LOG_D] = 0.3
    end = Minimum(state, np.zeros(1), np.eye(5)[None] * 1e8, np.zeros((1, 6)))
    for log_d, tried in (([-1.0, 0.0, 1.0, 2.0], [False, True, True, False]), ([-1.0, 0.0], [False, True])):
        assert known_diameters.worth_trying(end, end, np.array(log_d)).tolist() == [tried]
