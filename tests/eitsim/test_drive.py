"""Electrode positions, current patterns and the order of the readings."""

from __future__ import annotations

import numpy as np
import pytest

from eitsim.drive import read_electrodes, read_out, stride
from eitsim.electrodes import arcs
from eitsim.scene import Body, Drive, Electrodes


def test_adjacent_reads_the_papers_electrodes_in_its_order():
    order = read_electrodes(Drive(), 16)
    assert order.shape == (16, 13)
    assert order[0].tolist() == list(range(2, 15))
    assert order[15].tolist() == [(15 + k) % 16 for k in range(2, 15)]


@pytest.mark.parametrize(("pattern", "step"), [("adjacent", 1), ("opposite", 8), ("skip-0", 1), ("skip-3", 4)])
def test_a_pattern_reads_every_electrode_but_source_sink_and_reference(pattern, step):
    drive = Drive(pattern=pattern)
    assert stride(drive, 16) == step
    for k, row in enumerate(read_electrodes(drive, 16)):
        assert sorted([*row.tolist(), k, (k + step) % 16, (k - 1) % 16]) == list(range(16))


@pytest.mark.parametrize("pattern", ["adjacent", "opposite", "skip-2"])
def test_readings_are_potentials_against_the_reference(pattern):
    drive = Drive(current_A=2e-3, pattern=pattern)
    root = np.random.default_rng(3).normal(size=(8, 8))
    z, step = root @ root.T, stride(drive, 8)
    readings = read_out(drive, z)
    for k in range(8):
        current = np.zeros(8)
        current[[k, (k + step) % 8]] = 2e-3, -2e-3
        potential = z @ current
        expected = (potential - potential[k - 1])[read_electrodes(drive, 8)[k]]
        np.testing.assert_allclose(readings[k], expected, rtol=0, atol=1e-15)


def test_reciprocity_leaves_104_independent_readings_of_208():
    rng = np.random.default_rng(0)
    rows = []
    for _ in range(150):
        root = rng.normal(size=(16, 16))
        rows.append(read_out(Drive(), root + root.T).ravel())
    assert np.linalg.matrix_rank(np.array(rows)) == 104


@pytest.mark.parametrize(("pattern", "count", "message"), [
    ("opposit", 16, "known: adjacent, opposite, skip-N"), ("skip-x", 16, "unknown"), ("opposite", 15, "even number"),
    ("skip-14", 16, "at most 13")])
def test_wrong_patterns_are_refused(pattern, count, message):
    with pytest.raises(ValueError, match=message):
        stride(Drive(pattern=pattern), count)


def test_line_electrodes_are_centred_counter_clockwise():
    ends = arcs(Body(), Electrodes(first_angle_rad=0.1))
    np.testing.assert_allclose(ends.mean(axis=1), 0.1 + np.pi / 8 * np.arange(16))
    np.testing.assert_allclose(np.diff(ends, axis=1), 0.1)


def test_electrodes_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="patch"):
        arcs(Body(), Electrodes(kind="patch"))
    with pytest.raises(ValueError, match="no gap"):
        arcs(Body(), Electrodes(width_m=0.04))
