"""Adjoint sensitivities of the impedance matrix: against differences of solutions, by homogeneity, by symmetry."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from eitsim.electrics.cem.adjoint import (
    impedance_by_conductance,
    impedance_by_contact,
    impedance_by_field,
    readings_by,
)
from eitsim.electrics.cem.assembly import SkinMesh, impedance, potentials, quadrature_points
from eitsim.electrics.mesh.ring_mesh import patch_radii, rim_angles, ring_mesh
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.scene import Body, Electrodes

Z = 0.7


@lru_cache(maxsize=1)
def mesh() -> SkinMesh:
    angles, electrode = rim_angles(Body(), Electrodes(), 1)
    return ring_mesh(np.linspace(0, 0.1, 7), np.zeros((7, 2)), angles, electrode, 16)


def tensors() -> np.ndarray:
    """Positive definite tensors (cells, q, 2, 2) that vary from cell to cell, and within."""
    rng = np.random.default_rng(1)
    root = np.eye(2) + 0.3 * rng.standard_normal((*quadrature_points(mesh()).shape[:2], 2, 2))
    return 6e-4 * (root @ root.swapaxes(-1, -2) + 0.1 * np.eye(2))


def slope(of: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """Derivative at 0 by differences of fourth order."""
    return (8 * (of(step) - of(-step)) - (of(2 * step) - of(-2 * step))) / (12 * step)


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


@pytest.mark.parametrize("cell", [0, 130, 350])
def test_jacobian_of_conductance_is_that_of_differences(cell: int):
    sheet = 6e-4 * np.exp(0.5 * np.random.default_rng(0).standard_normal(len(mesh().cells)))
    jacobian = impedance_by_conductance(mesh(), potentials(mesh(), sheet, Z))

    def changed(by: float) -> np.ndarray:
        return impedance(mesh(), sheet * np.where(np.arange(len(sheet)) == cell, 1 + by, 1), Z)

    assert distance(jacobian[cell], slope(changed, 3e-3) / sheet[cell]) < 1e-6


@pytest.mark.parametrize("direction", [[[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 1], [1, 0]]])
def test_jacobian_of_tensor_components_is_that_of_differences(direction: list):
    sheet, cell = tensors(), 200
    here = (np.arange(len(sheet)) == cell)[:, None, None, None] * np.array(direction)
    jacobian = impedance_by_field(mesh(), potentials(mesh(), sheet, Z), np.broadcast_to(here, sheet.shape))
    assert distance(jacobian, slope(lambda by: impedance(mesh(), sheet + by * here, Z), 1e-6)) < 1e-6


def test_jacobian_of_contact_impedance_is_that_of_differences():
    sheet = tensors()
    jacobian = impedance_by_contact(mesh(), potentials(mesh(), sheet, Z), Z)
    assert distance(jacobian.sum(axis=0), slope(lambda by: impedance(mesh(), sheet, Z + by), 1e-3)) < 1e-8
    assert np.argmax(np.einsum("ekk->ek", jacobian), axis=0).tolist() == list(range(16))


def test_patches_and_lines_obey_the_same_rule():
    body, patches = Body(), Electrodes(kind="patch")
    angles, electrode = rim_angles(body, patches, 1)
    radii = np.concatenate([np.linspace(0, 1, 6)[:-1] * patch_radii(body, patches)[0], patch_radii(body, patches)])
    covered = len(patch_radii(body, patches)) - 1
    on = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, 16, covered=covered)
    sheet, z = np.full(len(on.cells), 6e-4), np.linspace(1e-3, 1e-2, 16)
    potential = potentials(on, sheet, z)
    by_contact = np.tensordot(z, impedance_by_contact(on, potential, z), 1)
    by_cell = np.tensordot(sheet, impedance_by_conductance(on, potential), 1)
    assert distance(by_contact - by_cell, impedance(on, sheet, z)) < 1e-11


def test_impedance_is_homogeneous_of_degree_one_in_resistances():
    sheet = tensors()
    potential = potentials(mesh(), sheet, Z)
    by_contact = impedance_by_contact(mesh(), potential, Z).sum(axis=0)
    whole = impedance(mesh(), sheet, Z)
    assert distance(Z * by_contact - impedance_by_field(mesh(), potential, sheet), whole) < 1e-12
    scalar = np.full(len(mesh().cells), 6e-4)
    potential = potentials(mesh(), scalar, Z)
    by_cell = np.tensordot(scalar, impedance_by_conductance(mesh(), potential), 1)
    by_contact = impedance_by_contact(mesh(), potential, np.full(16, Z)).sum(axis=0)
    assert distance(Z * by_contact - by_cell, impedance(mesh(), scalar, Z)) < 1e-12


def test_jacobian_is_reciprocal_and_sums_to_nothing():
    jacobian = impedance_by_conductance(mesh(), potentials(mesh(), tensors(), Z))
    size = np.abs(jacobian).max()
    assert np.abs(jacobian - jacobian.swapaxes(-1, -2)).max() < 1e-12 * size
    assert np.abs(jacobian.sum(axis=-1)).max() < 1e-12 * size
    assert np.all(np.einsum("ekk->ek", jacobian) < 0)


def test_regions_add_up_and_a_field_over_one_is_its_column():
    sheet = tensors()
    potential = potentials(mesh(), sheet, Z)
    region = (quadrature_points(mesh())[..., 0] > 0.01).astype(int)
    by_cell, halves = impedance_by_conductance(mesh(), potential), impedance_by_conductance(mesh(), potential, region)
    assert distance(halves.sum(axis=0), by_cell.sum(axis=0)) < 1e-13
    field = region[..., None, None] * np.eye(2)
    assert distance(impedance_by_field(mesh(), potential, field), halves[1]) < 1e-13


@pytest.mark.parametrize("pattern", ["adjacent", "opposite", "skip-2"])
def test_readings_follow_the_impedance_linearly(pattern: str):
    drive = replace(Drive(), pattern=pattern)
    jacobian = impedance_by_contact(mesh(), potentials(mesh(), tensors(), Z), Z)
    weights = np.random.default_rng(2).standard_normal(16)
    together = read_out(drive, np.tensordot(weights, jacobian, 1)).ravel()
    assert distance(readings_by(drive, jacobian) @ weights, together) < 1e-12
