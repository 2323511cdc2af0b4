"""Replicates: between-specimen scatter is told as it was made, and only like is compared with like."""

from pathlib import Path

import numpy as np
import pytest

from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import reduce_tests
from matcal.reduction.replicates import scatter, with_scatter

DATA = Path(__file__).parents[3] / "data_raw"


def _specimen(factor: float, deepest: float = -0.6, kind: str = "uniaxial") -> Experiment:
    e = np.linspace(0, deepest, 80)
    return Experiment(kind, e, factor * (3e4 * e + 5e4 * e**3))


def test_stiffness_factors_and_pointwise_scatter() -> None:
    factors = np.random.default_rng(0).normal(1.0, 0.08, 40)
    found = scatter([_specimen(f, -0.5 - 0.005 * k) for k, f in enumerate(factors)], "uniaxial")
    assert found is not None
    np.testing.assert_allclose(found.factor, factors / factors.mean(), rtol=1e-3)
    assert found.factor_sd == pytest.approx(np.std(factors / factors.mean(), ddof=1), rel=1e-3)
    np.testing.assert_allclose(found.sd[:-1], np.abs(found.mean[:-1]) * found.factor_sd, rtol=2e-3)
    assert found.shape_sd < 1e-3
    assert found.strain[0] == pytest.approx(-0.5)


def test_only_like_is_compared() -> None:
    pulled = _specimen(1.0, 0.3)
    out = with_scatter([_specimen(0.9), pulled, _specimen(1.1), _specimen(1.0, 0.5, "shear")])
    assert [e.facts.get("replicates") for e in out] == [2.0, None, 2.0, None]
    assert out[0].facts["stiffness_factor"] == pytest.approx(0.9, rel=1e-6)
    assert "One of 2 uniaxial specimens: its values are 1.100 times" in out[2].decisions[-1]
    assert "say little" in out[2].decisions[-1]
    assert scatter([pulled], "uniaxial") is None


def test_repeated_files_say_so(tmp_path: Path) -> None:
    file, other = DATA / "uniaxial.csv", tmp_path / "uniaxial_2.csv"
    other.write_text(file.read_text() + "\n")
    got = reduce_tests([(None, (file,)), (None, (other,))])
    assert all(e.facts["stiffness_factor_sd"] == pytest.approx(0.0, abs=1e-12) for e in got)
