"""The foam element: closed forms on one element, tangents, objectivity, the compiled kernel against its numpy twin."""

from __future__ import annotations

import numpy as np
import pytest

from eitsim.mechanics.solid import axisymmetric_assembly, meridian_response
from eitsim.mechanics.solid.grid import foam_grid, tensor_grid
from eitsim.mechanics.solid.meridian_response import ByVolume, energy_density, response
from eitsim.numerics.linear_solvers import Indefinite
from eitsim.scene.scene import Body, Punch
from matcal.laws.deformation_modes import log_stretches, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import sinh_ratio

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
LAWS = {"Table 1": TABLE_1, "nu = 0.3": Hyperfoam([8e3], [6.0], [0.3]),
        "mixed nu": Hyperfoam([8e3, 3e3], [2.0, -1.5], [0.0, 0.2])}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("strain", [-0.8, -0.4, 0.0, 1e-9, 0.5])
def test_one_element_in_uniaxial_compression_is_the_closed_form(name, strain, order):
    law = LAWS[name]
    grid = tensor_grid(np.array([0.0, 0.7]), np.array([0.0, 1.3]), free=True, order=order)
    axial, lateral, _ = np.exp(log_stretches(law, "uniaxial", np.array([strain]))[0])
    force = forces(law, grid, np.array([lateral - 1, 0.0, 0.0, axial - 1]))
    top, side = grid.nodes[:, 1] == 1.3, grid.nodes[:, 0] == 0.7
    scale = law.mu_0_Pa * np.pi * 0.7**2
    expected = nominal_stress(law, "uniaxial", strain) / law.mu_0_Pa
    assert force[top, 1].sum() / scale == pytest.approx(expected, abs=1e-10)
    assert np.abs(force[side, 0]).max() / scale < 1e-10


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("gamma", [1e-9, 0.1, 0.5, 1.0, 2.5])
def test_one_element_in_simple_shear_is_the_closed_form(name, gamma):
    law = LAWS[name]
    grid = tensor_grid(np.array([0.0, 0.7]), np.array([0.0, 1.3]), plane=True, free=True)
    force = forces(law, grid, np.array([0.0, gamma, 0.0, 0.0]))
    measured = force[grid.nodes[:, 1] == 1.3, 0].sum() / 0.7
    assert measured / law.mu_0_Pa == pytest.approx(nominal_stress(law, "shear", gamma) / law.mu_0_Pa, abs=1e-10)


def forces(law, grid, slope):
    """Nodal forces (nodes, 2) that hold the displacement with gradient (rr, rz, zr, zz)."""
    u = grid.nodes @ slope.reshape(2, 2).T
    gradient, _ = axisymmetric_assembly.residual_and_tangent(law, grid, u.ravel()[np.argsort(grid.unknown.ravel())])
    return gradient[grid.unknown]


STATES = {"at rest": [0, 0, 0, 0, 0], "triple": [-0.6, 0, 0, -0.6, -0.6], "double in plane": [-0.3, 0, 0, -0.3, 0.2],
          "double with the hoop": [0.4, 0, 0, -0.5, 0.4], "nearly double": [-0.3, 1e-9, 0, -0.3 + 1e-8, 0.1],
          "single": [0.5, 0.3, -0.7, -0.4, 0.9], "flat": [1.5, 0.4, 0.1, -0.9, 0.1]}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("state", STATES)
def test_tangent_equals_differences(name, state):
    law, strain, step = LAWS[name], np.array(STATES[state], dtype=float), 1e-6
    ends = strain + step * np.concatenate([np.eye(5), -np.eye(5)])
    stress = response(law, ends).stress
    differences = ((stress[:5] - stress[5:]) / (2 * step)).T
    tangent = response(law, strain).tangent
    assert np.abs(tangent - differences).max() < 1e-7 * np.abs(tangent).max()
    assert np.allclose(tangent, tangent.T, rtol=0, atol=1e-12 * np.abs(tangent).max())


@pytest.mark.parametrize("state", STATES)
def test_stress_is_the_derivative_of_the_energy(state):
    grid = tensor_grid(np.array([0.0, 0.7]), np.array([0.0, 1.3]), plane=True, free=True)
    rng, step = np.random.default_rng(1), 1e-6
    slope = np.array(STATES[state][:4], dtype=float).reshape(2, 2)
    u = (grid.nodes @ slope.T).ravel()[np.argsort(grid.unknown.ravel())]
    direction = rng.standard_normal(u.size)
    gradient, band = axisymmetric_assembly.residual_and_tangent(TABLE_1, grid, u)
    rise = axisymmetric_assembly.energy(TABLE_1, grid, u + step * direction) - axisymmetric_assembly.energy(
        TABLE_1, grid, u - step * direction
    )
    curved = direction @ full(grid, band()) @ direction
    assert rise / (2 * step) == pytest.approx(gradient @ direction, rel=1e-7, abs=1e-8 * abs(curved))


def test_stress_turns_with_the_foam():
    strain, angle = np.array([0.5, 0.3, -0.7, -0.4, 0.9]), 2.0
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = turn @ (np.eye(2) + strain[:4].reshape(2, 2)) - np.eye(2)
    before = response(TABLE_1, strain).stress
    after = response(TABLE_1, np.append(turned.ravel(), strain[4])).stress
    assert np.allclose(after[:4].reshape(2, 2), turn @ before[:4].reshape(2, 2), atol=1e-9 * TABLE_1.mu_0_Pa)
    assert after[4] == pytest.approx(before[4])


@pytest.mark.parametrize("state", STATES)
def test_second_piola_is_objective_and_gives_the_first(state):
    strain, angle = np.array(STATES[state], dtype=float), 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = turn @ (np.eye(2) + strain[:4].reshape(2, 2)) - np.eye(2)
    piola = axisymmetric_assembly.second_piola(TABLE_1, strain)
    scale = TABLE_1.mu_0_Pa + np.abs(piola).max()
    assert np.allclose(
        axisymmetric_assembly.second_piola(TABLE_1, np.append(turned.ravel(), strain[4])), piola, atol=1e-10 * scale
    )
    assert np.allclose(
        axisymmetric_assembly.green_lagrange(np.append(turned.ravel(), strain[4])),
        axisymmetric_assembly.green_lagrange(strain),
    )
    assert np.allclose(
        axisymmetric_assembly.push_forward(piola, strain), response(TABLE_1, strain).stress,
        atol=1e-10 * scale,
    )


def test_a_prestress_is_the_derivative_of_its_potential_and_its_stiffness_of_it():
    grid = tensor_grid(np.array([0.3, 0.7, 1.0]), np.array([0.0, 0.8, 1.3]), free=True)
    rng, step = np.random.default_rng(2), 1e-6
    u, direction = (scale * rng.standard_normal(grid.unknowns) for scale in (0.02, 1.0))
    prestress = TABLE_1.mu_0_Pa * rng.standard_normal((*grid.weight.shape, 4))

    def at(length):
        return axisymmetric_assembly.residual_and_tangent(TABLE_1, grid, u + length * direction, prestress=prestress)

    gradient, band = at(0.0)
    ends = [axisymmetric_assembly.energy(TABLE_1, grid, u + length * direction, prestress) for length in (step, -step)]
    assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(gradient @ direction, rel=1e-6)
    change = (at(step)[0] - at(-step)[0]) / (2 * step)
    assert np.linalg.norm(full(grid, band()) @ direction - change) < 1e-7 * np.linalg.norm(change)


def test_scaling_a_prestress_to_zero_leaves_no_negative_part():
    prestress = np.random.default_rng(3).standard_normal((20, 4))
    values = np.linalg.eigvalsh(axisymmetric_assembly.geometric_stiffness(prestress, 1.0))
    scaled = np.linalg.eigvalsh(axisymmetric_assembly.geometric_stiffness(prestress, 0.0))
    assert values.min() < -0.1
    assert np.allclose(scaled, np.maximum(values, 0.0), atol=1e-14)


def test_scaling_removes_negative_curvature_and_nothing_else():
    states = np.array(list(STATES.values()), dtype=float)
    stiff, scaled = (response(TABLE_1, states, scale).tangent for scale in (1.0, 0.0))
    least = np.linalg.eigvalsh(stiff)[:, 0]
    assert least.min() < -100
    assert np.linalg.eigvalsh(scaled)[:, 0].min() > -1e-9 * TABLE_1.mu_0_Pa
    assert np.allclose(scaled[least > 0], stiff[least > 0])


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("scale", [1.0, 0.3, 0.0])
def test_the_compiled_stress_and_tangent_equal_their_numpy_twins(name, scale):
    """At rest, near it, at coinciding and at far stretches."""
    law, rng = LAWS[name], np.random.default_rng(5)
    strain = rng.normal(0, 0.5, (3000, 5))
    strain[:100], strain[100:200] = 0.0, 1e-9 * strain[100:200]
    strain[200:300, 1:3], strain[300:400, 3] = 0.0, strain[300:400, 0]
    strain = strain[axisymmetric_assembly.admissible(strain)]
    at = response(law, strain, scale)
    stress, tangent = at.stress, at.tangent
    log, modes = meridian_response.log_stretches(strain), modes_of(strain)
    expected = np.swapaxes(modes, -1, -2) @ scaled_stiffness(law, log, scale) @ modes
    size = np.abs(expected).max(axis=(1, 2))
    assert np.all(np.abs(tangent - expected).max(axis=(1, 2)) < 1e-12 * size)
    force = law.kirchhoff(log) * np.exp(-log)
    assert np.all(np.abs(stress - (force[:, None] @ modes[:, :3])[:, 0]).max(axis=1) < 1e-12 * size)
    assert np.allclose(energy_density(law, strain), law.energy(log), rtol=1e-12, atol=0)


def modes_of(strain):
    """Modes (..., 5, 5), stretch 1, 2, 3, flip, twist, of F = 1 + strain (..., 5) in its parts, orthonormal rows."""
    rr, rz, zr, zz, _ = np.moveaxis(strain, -1, 0)
    cd, sd = direction(2 + rr + zz, zr - rz)
    cs, ss = direction(rr - zz, rz + zr)
    modes = np.zeros((*rr.shape, 5, 5))
    modes[..., 0, :4] = np.stack([cd + cs, ss - sd, ss + sd, cd - cs], -1) / 2
    modes[..., 1, :4] = np.stack([cd - cs, -ss - sd, sd - ss, cd + cs], -1) / 2
    modes[..., 2, 4] = 1
    modes[..., 3, :4] = np.stack([-ss, cs, cs, ss], -1) / np.sqrt(2)
    modes[..., 4, :4] = np.stack([sd, cd, -cd, sd], -1) / np.sqrt(2)
    return modes


def direction(x, y):
    """Cosine and sine of the direction (x, y); (1, 0) where there is none."""
    length = np.hypot(x, y)
    none = length == 0
    length = np.where(none, 1.0, length)
    return np.where(none, 1.0, x / length), y / length


def scaled_stiffness(law, log, scale):
    """d2U/dmode2 (..., 5, 5) at logarithmic stretches (..., 3), its negative parts scaled."""
    tau, inverse = law.kirchhoff(log), np.exp(-log)
    mean, half = (log[..., 0] + log[..., 1]) / 2, (log[..., 0] - log[..., 1]) / 2
    slope = law.difference(mean, half, 0.0)
    middle, shrink = (tau[..., 0] + tau[..., 1]) / 2, np.exp(-2 * mean)
    block = law.tangent(log) - tau[..., None] * np.eye(3)
    value, vector = np.linalg.eigh(block * inverse[..., None] * inverse[..., None, :])
    out = np.zeros((*mean.shape, 5, 5))
    out[..., :3, :3] = (vector * (np.where(value < 0, scale, 1.0) * value)[..., None, :]) @ vector.swapaxes(-1, -2)
    flip = shrink * (slope * np.cosh(half) / sinh_ratio(half) - middle)
    twist = shrink * (middle - slope * half * np.tanh(half))
    out[..., 3, 3], out[..., 4, 4] = (np.where(mode < 0, scale, 1.0) * mode for mode in (flip, twist))
    return out


@pytest.mark.parametrize("order", [1, 2])
def test_the_assembly_equals_that_by_definition(order):
    grid = foam_grid(Body(), Punch(), 1e-3, order)
    rng = np.random.default_rng(0)
    force = rng.standard_normal((*grid.weight.shape, 5))
    roots = rng.standard_normal((*grid.weight.shape, 5, 5))
    tangent = roots @ np.swapaxes(roots, -1, -2)
    gradient = axisymmetric_assembly.assembled_load(grid, force)
    band = axisymmetric_assembly.assembled_stiffness(grid, tangent)
    force, tangent = force * grid.weight[..., None], tangent * grid.weight[..., None, None]

    parts = np.zeros((*grid.gradient.shape[:-1], 2, 5))
    parts[..., 0, [0, 1, 4]] = grid.gradient
    parts[..., 1, [2, 3]] = grid.gradient[..., :2]
    loads = np.einsum("eqaik,eqk->eai", parts, force)
    blocks = np.einsum("eqaik,eqkl,eqbjl->eaibj", parts, tangent, parts, optimize=True)
    number = grid.unknown[grid.elements]
    twin, matrix = np.zeros(grid.unknowns + 1), np.zeros((grid.unknowns + 1, grid.unknowns + 1))
    np.add.at(twin, number, loads)
    np.add.at(matrix, (number[:, :, :, None, None], number[:, None, None]), blocks)
    assert np.allclose(gradient, twin[:-1], rtol=0, atol=1e-12 * np.abs(twin).max())
    assert np.allclose(full(grid, band), matrix[:-1, :-1], rtol=0, atol=1e-12 * np.abs(matrix).max())


@pytest.mark.parametrize("coupled", [False, True])
def test_arrays_assemble_what_compiled_loops_do(coupled):
    grid = foam_grid(Body(), Punch(), 1e-3, 2)
    rng, shape = np.random.default_rng(1), grid.weight.shape
    roots = rng.standard_normal((*shape, 5, 5))
    tangent = roots @ np.swapaxes(roots, -1, -2)
    by_volume = ByVolume(*rng.standard_normal((2, *shape, 5)), rng.standard_normal(shape)) if coupled else None
    compiled = axisymmetric_assembly.assembled_stiffness(grid, tangent, by_volume)
    again = axisymmetric_assembly.stiffness_by_arrays(grid, tangent, by_volume)
    for part in ("band", "inner", "across"):
        expected = getattr(compiled, part)
        assert np.allclose(getattr(again, part), expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_nodes_are_numbered_column_after_column_whatever_the_rounding():
    """With the first punch the middle of an element is rounded to different sides in different rows."""
    for diameter_m in (0.017860241375218175, *np.random.default_rng(1).uniform(0.008, 0.02, 6)):
        grid = foam_grid(Body(), Punch(diameter_m=diameter_m), 0.06e-3)
        radii, heights = grid.lines
        assert np.allclose(grid.nodes.reshape(radii.size, heights.size, 2)[..., 0], radii[:, None], rtol=0, atol=1e-12)
        assert np.allclose(grid.nodes.reshape(radii.size, heights.size, 2)[..., 1], heights, rtol=0, atol=1e-12)


def test_orders_that_are_not_built_are_refused():
    with pytest.raises(ValueError, match="order 3 are not built; known: 1, 2"):
        foam_grid(Body(), Punch(), 1e-3, 3)


def full(grid, stiffness):
    """Dense symmetric matrix of a stiffness, what was eliminated from its band included."""
    count, band = grid.unknowns, stiffness.band
    out = np.zeros((count + 1, count + 1))
    for offset in range(min(band.shape[1], len(band))):
        index = np.arange(len(band) - offset)
        out[grid.outer[index + offset], grid.outer[index]] = out[grid.outer[index], grid.outer[index + offset]] = band[
            index, offset]
    outer = np.append(grid.outer, count)[grid.numbers]
    for e, (inner, across) in enumerate(zip(stiffness.inner, stiffness.across, strict=True)):
        out[np.ix_(outer[e], outer[e])] += across @ np.linalg.solve(inner, across.T)
        out[np.ix_(outer[e], grid.inner[e])], out[np.ix_(grid.inner[e], outer[e])] = across, across.T
        out[np.ix_(grid.inner[e], grid.inner[e])] = inner
    return out[:count, :count]


@pytest.mark.parametrize("order", [1, 2])
def test_factors_solve_with_the_whole_stiffness_and_say_where_it_is_not_positive(order):
    grid = tensor_grid(np.array([0.0, 0.3, 0.7, 1.2]), np.array([-1.0, -0.4, 0.0]), order=order)
    rng, count = np.random.default_rng(order), grid.unknowns
    roots = rng.standard_normal((*grid.weight.shape, 5, 5))
    tangent = roots @ np.swapaxes(roots, -1, -2)
    matrix = full(grid, axisymmetric_assembly.assembled_stiffness(grid, tangent))
    load = rng.standard_normal(count)
    found = axisymmetric_assembly.factorised(grid, axisymmetric_assembly.assembled_stiffness(grid, tangent))(load)
    assert matrix @ found == pytest.approx(load, abs=1e-9 * np.abs(matrix).max() * np.abs(found).max())
    tangent[3] *= -1
    with pytest.raises(Indefinite):
        axisymmetric_assembly.factorised(grid, axisymmetric_assembly.assembled_stiffness(grid, tangent))


@pytest.mark.parametrize(("law", "squeeze"), [
    (TABLE_1, -1.5), (Hyperfoam([-1e3, 4e3], [-90.0, -80.0], [0, 0]), -1 + 1e-6)])
def test_foam_turned_inside_out_or_beyond_numbers_has_infinite_energy(law, squeeze):
    grid = tensor_grid(np.array([0.0, 1.0]), np.array([0.0, 1.0]), free=True)
    u = (grid.nodes @ np.diag([0.0, squeeze])).ravel()[np.argsort(grid.unknown.ravel())]
    assert axisymmetric_assembly.energy(law, grid, u) == np.inf
