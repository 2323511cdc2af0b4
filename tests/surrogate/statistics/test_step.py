import numpy as np
import pytest
from scipy.optimize import brentq

from surrogate.statistics import change_point, matern_process


def test_more_evidence_lies_with_the_lengths_that_made_the_data() -> None:
    """Draws of a process: its own lengths and noise are likelier than half and twice as large."""
    rng = np.random.default_rng(0)
    x = rng.random((150, 2)) / 0.4
    covariance = matern_process._kernel(matern_process._root(x, x)) + 0.05**2 * np.eye(150)
    y = np.linalg.cholesky(covariance) @ rng.normal(size=(150, 6))
    here = matern_process.log_evidence(x, y, 0.05)
    assert here > max(matern_process.log_evidence(factor * x, y, 0.05) for factor in (0.5, 2.0))
    assert here > max(matern_process.log_evidence(x, y, factor * 0.05) for factor in (0.3, 3.0))


@pytest.mark.parametrize("where", [0.37, 0.62])
def test_a_step_is_found_where_it_is(where: float) -> None:
    rng = np.random.default_rng(1)
    x = np.column_stack([rng.random(500), rng.random(500)])
    smooth = np.column_stack([np.sin(4 * x[:, 0] + x[:, 1]), np.cos(3 * x[:, 1]), x[:, 0] * x[:, 1]])
    stepped = smooth + 0.02 * (x[:, :1] < where) * (1 + smooth)
    noisy = stepped + 1e-3 * rng.normal(size=stepped.shape)
    gaps = np.sort(x[:, 0])
    between = gaps[np.searchsorted(gaps, where) + np.array([-2, 1])]
    assert between[0] <= change_point.locate(x / 0.5, noisy, x[:, 0], 1e-2) <= between[1]
    assert change_point.locate(x / 0.5, noisy - stepped + smooth, x[:, 0], 1e-2) == change_point.NONE


def test_few_rows_show_no_step() -> None:
    x = np.random.default_rng(2).random((50, 2))
    assert change_point.locate(x, (x[:, :1] < 0.5).astype(float), x[:, 0], 1e-2) == change_point.NONE
    assert np.array_equal(change_point.side(x[:, 0], change_point.NONE), np.zeros(50))


def test_a_step_is_worth_its_input_from_15_of_log_evidence_for_each_quantity() -> None:
    """However many there are: the same one six times gains six times as much, and decides the same."""
    rng = np.random.default_rng(3)
    x = np.sort(rng.random(160))[:, None]
    smooth, noise = np.sin(4 * x), 1e-2 * rng.normal(size=(160, 1))

    def gain(size: float, times: int) -> float:
        y = np.tile(smooth + noise + size * (x < 0.5), times)
        return change_point._best(x / 0.5, y, np.argsort(x[:, 0]), np.arange(60, 100), 1e-2)[1] / times

    def found(size: float, times: int) -> bool:
        y = np.tile(smooth + noise + size * (x < 0.5), times)
        return change_point.locate(x / 0.5, y, x[:, 0], 1e-2) != change_point.NONE

    below, above = (brentq(lambda size, wanted=wanted: gain(size, 1) - wanted, 0.0, 0.2, xtol=1e-6)
                    for wanted in (14.5, 15.5))
    for times in (1, 6):
        assert gain(above, times) == pytest.approx(15.5, abs=0.01)
        assert (found(below, times), found(above, times)) == (False, True)
    assert change_point.locate(x[:120] / 0.5, smooth[:120] + 9 * (x[:120] < 0.3), x[:120, 0], 1e-2) == change_point.NONE
    assert change_point.locate(x[:122] / 0.5, smooth[:122] + 9 * (x[:122] < x[61]), x[:122, 0], 1e-2) == pytest.approx(
        x[60:62].mean())
