"""Laws that are weighted means of a few: exact where stresses are, distinguished by shape alone, refused outside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.load_paths.reduced_basis import reduced_basis
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")


def mixed(count: int, spread: float = 0.01, seed: int = 0) -> list[Hyperfoam]:
    """Laws whose moduli differ, whose exponents do not: stresses over mu_0 have two directions."""
    rng = np.random.default_rng(seed)
    mu = FOAM.mu_Pa * np.exp(spread * rng.standard_normal((count, 3)))
    return [replace(FOAM, mu_Pa=row * np.exp(rng.standard_normal())) for row in mu]


def test_laws_that_differ_in_stiffness_alone_are_one() -> None:
    span = reduced_basis([replace(FOAM, mu_Pa=FOAM.mu_Pa * factor) for factor in (1.0, 0.5, 30.0)])
    assert (span.chosen, span.held_out) == ((), ())
    weights = span.weights(replace(FOAM, mu_Pa=7 * FOAM.mu_Pa))
    assert weights is not None
    assert weights.shape == (0,)


def test_a_weighted_mean_has_the_stress_of_its_law() -> None:
    laws = mixed(30)
    span = reduced_basis(laws)
    assert len(span.chosen) == 2
    assert span.missed < 1e-9
    strain = np.random.default_rng(1).uniform(-1, 0.3, (5, 3))

    def stress(law: Hyperfoam) -> np.ndarray:
        return law.kirchhoff(strain) / law.mu_0_Pa

    for law in laws:
        weights = span.weights(law)
        assert weights is not None
        mean = stress(span.central) + sum(w * (stress(one) - stress(span.central))
                                          for w, one in zip(weights, span.chosen, strict=True))
        np.testing.assert_allclose(mean, stress(law), rtol=1e-7)
        assert np.abs(weights).max() <= span.heaviest < 2


def test_a_wider_posterior_takes_more_laws_and_tells_what_it_misses() -> None:
    rng = np.random.default_rng(2)
    laws = [replace(law, alpha=law.alpha * np.exp(0.02 * rng.standard_normal(3))) for law in mixed(60)]
    span, narrow = reduced_basis(laws), reduced_basis(mixed(60, 1e-5))
    assert len(narrow.chosen) < 2 < len(span.chosen) <= 6
    assert 0 < span.missed < 5e-3
    used = (span.central, *span.chosen)
    assert 2 <= len(span.held_out) <= 4
    assert not any(law is one for law in span.held_out for one in used)


def test_a_law_farther_off_is_none() -> None:
    span = reduced_basis(mixed(30))
    assert span.weights(replace(FOAM, alpha=FOAM.alpha * 1.01)) is None
    assert span.weights(replace(FOAM, mu_Pa=FOAM.mu_Pa * [1.2, 1, 1])) is None


def test_where_every_law_is_chosen_they_tell_the_error_themselves() -> None:
    span = reduced_basis(mixed(3))
    assert len(span.chosen) == 2
    assert set(map(id, span.held_out)) == set(map(id, span.chosen))


def test_no_law_is_no_span() -> None:
    with pytest.raises(ValueError, match="none of the drawn cards"):
        reduced_basis([])
