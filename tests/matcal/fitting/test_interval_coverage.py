"""Coverage of 95 % intervals on fresh data of known truths, as benchmarks/interval_coverage.py measures it."""

from collections.abc import Callable
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def study(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    """The benchmark as a module."""
    return benchmark_module("interval_coverage")


@pytest.mark.slow
@pytest.mark.parametrize(("case", "replicas", "widest"), [("plain", 40, 2.0), ("correlated", 40, 3.5),
                                                          ("machine", 30, 2.5)])
def test_intervals_cover_the_truth_and_are_not_much_too_wide(study, case: str, replicas: int,
                                                             widest: float) -> None:
    table = study.summary(study.run((case,), replicas, False))
    print(table.to_string(index=False))
    assert (table["covered"] >= 0.9 * replicas).all()
    assert (table["width_over_spread"] < widest).all()


def test_the_benchmarks_foam_is_consistent(study) -> None:
    """Its slope at rest is the modulus that it is said to have, in tension, shear and volume."""
    stress, small = study.other_stress, 1e-6
    assert stress("uniaxial", small) / small == pytest.approx(study.E_0, rel=1e-4)
    assert stress("shear", small) / small == pytest.approx(study.E_0 / 2, rel=1e-4)
    assert stress("volumetric", 1 + small) / small == pytest.approx(study.E_0 / 3, rel=1e-4)
