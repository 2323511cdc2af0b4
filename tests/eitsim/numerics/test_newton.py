"""The minimiser and the linear solvers that it needs."""

import numpy as np
import pytest

from eitsim.numerics.linear_solvers import Indefinite, bordered, factorise_band
from eitsim.numerics.newton import minimise
from touchcal.errors import NotConverged


def band_of(matrix, width):
    """Lower band (n, width + 1) of a matrix."""
    band = np.zeros((len(matrix), width + 1))
    for offset in range(width + 1):
        band[:len(matrix) - offset, offset] = np.diagonal(matrix, -offset)
    return band


def banded_matrix(shift):
    rng = np.random.default_rng(0)
    lower = np.tril(rng.standard_normal((30, 30))) * (np.subtract.outer(range(30), range(30)) < 5)
    return lower @ lower.T * 0.1 + shift * np.eye(30)


def test_band_and_border_solve_what_a_dense_solver_solves():
    matrix, border = banded_matrix(1.0), np.linspace(-1, 1, 30)
    whole = np.block([[matrix, border[:, None]], [border[None], np.array([[40.0]])]])
    load = np.arange(31.0)
    solve = factorise_band(band_of(matrix, 8))
    assert np.allclose(solve(load[:-1]), np.linalg.solve(matrix, load[:-1]), rtol=1e-12)
    assert np.allclose(bordered(solve, border, 40.0)(load), np.linalg.solve(whole, load), rtol=1e-10)


def test_indefinite_matrices_are_told():
    with pytest.raises(Indefinite):
        factorise_band(band_of(banded_matrix(-1.0), 8))
    with pytest.raises(Indefinite):
        bordered(factorise_band(band_of(banded_matrix(1.0), 8)), np.ones(30), 0.0)


def double_well(x):
    """(x0^2 - 1)^2 + x1^2: a saddle between two minima."""
    return float((x[0]**2 - 1)**2 + x[1]**2)


def system(x, share):
    gradient = np.array([4 * x[0] * (x[0]**2 - 1), 2 * x[1]])
    bend = 12 * x[0]**2 - 4 * share
    return gradient, lambda: factorise_band(np.array([[bend, 0.0], [2.0, 0.0]]))


@pytest.mark.parametrize("start", [0.01, -0.3, 3.0])
def test_a_minimum_is_found_across_negative_curvature(start):
    found = minimise(double_well, system, np.array([start, 0.7]), scale=1.0)
    assert np.allclose(found.x, [np.sign(start), 0.0], atol=1e-9)
    assert found.residuals[-1] <= 1e-10


def test_the_end_is_quadratic():
    residuals = minimise(double_well, system, np.array([1.3, 0.7]), scale=1.0).residuals
    assert residuals[-1] < 30 * residuals[-2]**2


def test_what_converges_at_the_limit_is_not_cut_off():
    whole = minimise(double_well, system, np.array([1.3, 0.7]), scale=1.0).residuals
    assert minimise(double_well, system, np.array([1.3, 0.7]), scale=1.0, limit=len(whole) - 1).residuals == whole
    with pytest.raises(NotConverged, match="2 iterations"):
        minimise(double_well, system, np.array([1.3, 0.7]), scale=1.0, limit=2)


def test_a_long_concave_slope_is_left_by_long_steps():
    """2 - cos from near its top, its Hessian split as 4 - (4 - cos): damped steps alone grow by a factor below two."""
    def slope(x, share):
        return np.array([np.sin(x[0])]), lambda: factorise_band(np.array([[4 - share * (4 - np.cos(x[0]))]]))

    found = minimise(lambda x: 2 - float(np.cos(x[0])), slope, np.array([np.pi - 1e-6]), scale=1.0, limit=15)
    assert np.cos(found.x) == pytest.approx(1)


def test_a_saddle_is_told_from_slow_progress():
    def level(x, share):
        return np.array([4 * x[0] * (x[0]**2 - 1), 2 * x[1]]), lambda: factorise_band(
            np.array([[12 * x[0]**2 + 1 - 5 * share, 0.0], [2.0, 0.0]]))

    with pytest.raises(NotConverged, match="not stable"):
        minimise(double_well, level, np.array([0.0, 0.7]), scale=1.0)


def test_failure_carries_state_and_history():
    def downhill(x, share):
        return np.array([-1.0]), lambda: factorise_band(np.array([[1e-3]]))

    with pytest.raises(NotConverged, match="20 iterations") as caught:
        minimise(lambda x: -float(x[0]), downhill, np.zeros(1), scale=1.0, limit=20)
    assert len(caught.value.residuals) == 20
    assert caught.value.estimate[0] > 0
    with pytest.raises(NotConverged, match="not admissible"):
        minimise(lambda x: np.inf, downhill, np.zeros(1), scale=1.0)
