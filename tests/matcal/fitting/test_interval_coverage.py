"""Coverage of 95 % intervals on fresh data of known truths, as benchmarks/interval_coverage.py measures it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[3] / "benchmarks" / "interval_coverage.py"


@pytest.fixture(scope="module")
def benchmark_module():
    spec = importlib.util.spec_from_file_location("interval_coverage", BENCHMARK)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARK.parent)
        spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize(("case", "replicas", "widest"), [("plain", 40, 2.0), ("correlated", 40, 3.5),
                                                          ("machine", 30, 2.5)])
def test_intervals_cover_the_truth_and_are_not_much_too_wide(benchmark_module, case: str, replicas: int,
                                                             widest: float) -> None:
    table = benchmark_module.summary(benchmark_module.run((case,), replicas, False))
    print(table.to_string(index=False))
    assert (table["covered"] >= 0.9 * replicas).all()
    assert (table["width_over_spread"] < widest).all()


def test_the_benchmarks_foam_is_consistent(benchmark_module) -> None:
    """Its slope at rest is the modulus that it is said to have, in tension, shear and volume."""
    stress, small = benchmark_module.other_stress, 1e-6
    assert stress("uniaxial", small) / small == pytest.approx(benchmark_module.E_0, rel=1e-4)
    assert stress("shear", small) / small == pytest.approx(benchmark_module.E_0 / 2, rel=1e-4)
    assert stress("volumetric", 1 + small) / small == pytest.approx(benchmark_module.E_0 / 3, rel=1e-4)
