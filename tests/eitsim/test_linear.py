"""Factorisations are interchangeable values."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest
from scipy.sparse import csc_matrix, diags, kronsum

from eitsim.axisymmetric import solve_touch
from eitsim.cem import impedance
from eitsim.linear import Indefinite, factorise, factorise_band, factorise_pardiso
from eitsim.mesh import default_element_m
from eitsim.scene import Body, Electrodes, Punch
from eitsim.template import template
from matcal.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
PARDISO = importlib.util.find_spec("pypardiso") is not None
needs_pardiso = pytest.mark.skipif(not PARDISO, reason="pypardiso is not installed")
FACTORISATIONS = [factorise, pytest.param(factorise_pardiso, marks=needs_pardiso)]


def laplacian(n: int = 12) -> csc_matrix:
    line = diags([-1.0, 2.01, -1.0], [-1, 0, 1], shape=(n, n))
    return csc_matrix(kronsum(line, line))


@pytest.mark.parametrize("factorised", FACTORISATIONS)
def test_solves_one_and_several_right_hand_sides(factorised):
    matrix = laplacian()
    expected = np.random.default_rng(1).normal(size=(matrix.shape[0], 3))
    solve = factorised(matrix)
    np.testing.assert_allclose(solve(matrix @ expected), expected, rtol=0, atol=1e-11)
    np.testing.assert_allclose(solve(matrix @ expected[:, 0]), expected[:, 0], rtol=0, atol=1e-11)


@needs_pardiso
def test_pardiso_refuses_what_is_not_definite():
    with pytest.raises(Indefinite):
        factorise_pardiso(csc_matrix(laplacian() - 3 * diags(np.ones(144))))


@pytest.mark.skipif(PARDISO, reason="pypardiso is installed")
def test_a_missing_pardiso_is_named_with_the_mend():
    with pytest.raises(ValueError, match=r"touchcal\[pardiso\]"):
        factorise_pardiso(laplacian())


def test_a_band_gives_what_the_sparse_matrix_gives():
    matrix = laplacian()
    dense, width = matrix.toarray(), 12
    band = np.zeros((len(dense), width + 1))
    for k in range(width + 1):
        band[: len(dense) - k, k] = np.diagonal(dense, -k)
    b = np.random.default_rng(2).normal(size=len(dense))
    np.testing.assert_allclose(factorise_band(band)(b), factorise(matrix)(b), rtol=0, atol=1e-12)


@pytest.mark.parametrize("factorised", FACTORISATIONS)
def test_an_impedance_matrix_does_not_depend_on_the_factorisation(factorised):
    punch = Punch(x_m=0.03)
    touch = solve_touch(FOAM, Body(), punch, element_m=4 * default_element_m(Body(), punch))
    mesh = template(Body(), Electrodes(), punch, touch, 1)
    matrices = [impedance(mesh, np.full(len(mesh.cells), 6e-4), 1.0, factorised=f) for f in (factorise, factorised)]
    np.testing.assert_allclose(matrices[1], matrices[0], rtol=1e-9, atol=1e-9)
