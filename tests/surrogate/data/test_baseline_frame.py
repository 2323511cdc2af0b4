"""An untouched frame next to the training's: what differs beyond noise, and the factors that take it out."""

from dataclasses import replace

import numpy as np
import pytest

from surrogate.data.baseline_frame import compared
from surrogate.data.sensor_ring import Ring
from touchcal.arrays import Array

NOISE_V = 1e-5


def noisy(volts: Array) -> Array:
    return volts + NOISE_V * np.random.default_rng(0).normal(size=volts.shape)


def adjacent(ring: Ring) -> Ring:
    """The ring read between neighbours that carry no current."""
    every = np.array([(a, (a + 1) % 16, (a + step) % 16, (a + step + 1) % 16) for a in range(16)
                      for step in range(2, 15)]).T
    return replace(ring, **dict(zip(("source", "sink", "read", "ground"), every, strict=True)))


def worn(ring: Ring, turn: int = 0, way: int = 1) -> Array:
    """Readings, V, of electrodes that all differ, numbered from another one or the other way round."""
    half = np.random.default_rng(1).normal(size=(16, 16))
    to = (way * np.arange(16) + turn) % 16
    impedance_ohm = (half + half.T)[np.ix_(to, to)]
    unit = np.eye(16)
    return np.asarray(np.einsum("ra,ab,rb->r", unit[ring.source] - unit[ring.sink], impedance_ohm,
                                unit[ring.read] - unit[ring.ground]))


def test_noise_is_no_difference(untouched_V: Array, ring: Ring) -> None:
    found = compared(untouched_V, ring, noisy(untouched_V), NOISE_V)
    assert found.words == ""
    assert np.array_equal(found.gain, np.ones(208))
    assert compared(untouched_V, ring, noisy(untouched_V) + 3e-3 * np.abs(untouched_V), NOISE_V).words


def test_what_fits_is_named(untouched_V: Array, ring: Ring) -> None:
    channel = (ring.read == 4) & (ring.ground == 5)
    one, single = np.where(channel, 1.03, 1.0), np.where(np.arange(208) == 17, 0.9, 1.0)
    gains = 1 + 0.03 * np.random.default_rng(2).normal(size=(16, 16))
    gains = (np.triu(gains) + np.triu(gains, 1).T)[ring.read, ring.ground]
    for given, words in ((1.05 * untouched_V, "all readings are 1.05 times"), (one * untouched_V, "electrodes 4 and 5"),
                         (single * untouched_V, "reading 17 alone"), (gains * untouched_V, "channels have gains"),
                         (1e3 * untouched_V, "in volts"), (-untouched_V, "leads of the current or of the voltmeter")):
        found = compared(untouched_V, ring, noisy(given), NOISE_V, "no")
        assert words in found.words, found.words
        assert np.array_equal(found.gain, np.ones(208))


@pytest.mark.parametrize(("turn", "way", "words"), [(3, 1, "from another one, 3 further"), (5, -1, "the other way")])
def test_a_turned_ring_is_named_and_never_scaled(ring: Ring, turn: int, way: int, words: str) -> None:
    pairs = adjacent(ring)
    for noise_V in (0.0, NOISE_V):
        given = worn(pairs, turn, way)
        found = compared(worn(pairs), pairs, noisy(given) if noise_V else given, noise_V)
        assert words in found.words
        assert np.array_equal(found.gain, np.ones(208))


def test_gains_are_taken_out(untouched_V: Array, ring: Ring) -> None:
    gains = 1 + 0.03 * np.random.default_rng(3).normal(size=208)
    given = gains * untouched_V
    found = compared(untouched_V, ring, given)
    np.testing.assert_allclose(found.gain * given, untouched_V, rtol=1e-12)
    assert "multiplied" in found.words
    assert "no one factor" in found.words
    given[3] = np.nan
    found = compared(untouched_V, ring, given)
    assert found.gain[3] == 1
    assert np.sqrt(np.mean(found.gain**2)) == pytest.approx(1, abs=0.02)


def test_large_factors_are_taken_out_when_asked_for(untouched_V: Array, ring: Ring) -> None:
    assert np.all(compared(untouched_V, ring, 1e3 * untouched_V).gain == 1)
    assert compared(untouched_V, ring, 1e3 * untouched_V, 0.0, "yes").gain == pytest.approx(1e-3)
    with pytest.raises(ValueError, match="0 V"):
        compared(untouched_V, ring, np.where(np.arange(208) == 5, 0.0, untouched_V), 0.0, "yes")
    with pytest.raises(ValueError, match="auto, yes, no"):
        compared(untouched_V, ring, untouched_V, 0.0, "maybe")
