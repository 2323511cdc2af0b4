"""The layer's energy: gradient and Hessian against differences, and a uniform deformation held exactly."""

import numpy as np
import pytest

from eitsim.mechanics.contact.punch_contact import RigidPunch
from eitsim.mechanics.general.layer import equilibrium_of_many as many
from eitsim.mechanics.general.layer import solid_assembly
from eitsim.mechanics.general.layer.equilibrium_of_many import LayerProblem, Press
from eitsim.mechanics.general.layer.layer_field import LayerField
from eitsim.mechanics.general.meshing.levels import Level, layer_mesh
from eitsim.mechanics.general.meshing.section import Zone
from eitsim.scene.edges.disc import Disc
from eitsim.scene.profiles.rounded_cone import Flat
from eitsim.scene.scene import Body
from matcal.laws.hyperfoam import Hyperfoam

LAW = Hyperfoam(np.array([0.6, 0.4]), np.array([2.0, 4.0]), np.array([0.2, 0.1]))
BODY = Body(Disc(0.025))


@pytest.fixture(scope="module")
def layer() -> LayerProblem:
    centres = np.array([[-1.0, 0.2], [1.0, 0.0]])
    mesh = layer_mesh(BODY, centres, (Zone(0.4, 0.5, 0.5),) * 2, (0.05,) * 2, Level(16.0, 1.5, 1.0, 0.8, 6))
    rigid = RigidPunch(Flat(0.5, 0.05), 500.0, 0.05)
    return LayerProblem(LAW, mesh, (Press(rigid, centres[0], 0.3, 0.3), Press(rigid, centres[1], None, 0.3)))


def _state(layer: LayerProblem) -> np.ndarray:
    """Pressed into both punches, with a little disorder."""
    rng, z = np.random.default_rng(0), layer.mesh.nodes[:, 2]
    moved = np.column_stack([0 * z, 0 * z, -0.02 * (1 + z)]) + 1e-3 * rng.normal(size=(len(z), 3))
    return np.append(moved[layer.mesh.unknown >= 0], [0.021, 0.0211])


@pytest.mark.thorough
def test_gradient_and_hessian_are_derivatives_of_the_energy(layer: LayerProblem) -> None:
    x, rng = _state(layer), np.random.default_rng(1)
    gradient, factorised = many.system(layer, x)
    way = np.append(1e-3 * rng.normal(size=layer.mesh.unknowns), [1e-3, 0.0])
    step = 1e-4
    by_energy = (many.energy(layer, x + step * way) - many.energy(layer, x - step * way)) / (2 * step)
    assert by_energy == pytest.approx(gradient @ way, rel=1e-4)
    change = (many.system(layer, x + step * way)[0] - many.system(layer, x - step * way)[0]) / (2 * step)
    assert factorised()(change) == pytest.approx(way, abs=2e-3 * np.abs(way).max())


@pytest.mark.thorough
def test_factors_of_another_state_give_newtons_step_until_they_no_longer_serve(layer: LayerProblem) -> None:
    x, factors = _state(layer), []
    many.system(layer, 0.9 * x, 1.0, factors)[1]()
    gradient, factorised = many.system(layer, x)
    exact, near = factorised()(gradient), many.system(layer, x, 1.0, factors)[1]()(gradient)
    assert len(factors) == 1
    assert np.abs(near - exact).max() < 0.03 * np.abs(exact).max()
    poor = [lambda b: b]
    many.system(layer, x, 1.0, poor)[1]()
    assert poor == []


def test_a_uniform_deformation_is_held_exactly(layer: LayerProblem) -> None:
    f = np.array([[1.1, 0.05, 0.1], [-0.05, 0.95, 0.0], [0.02, 0.1, 0.8]])
    moved = layer.mesh.nodes @ (f - np.eye(3)).T
    found = solid_assembly.displacement_gradient(layer.mesh, moved)
    assert found == pytest.approx(np.broadcast_to((f - np.eye(3)).ravel()[:, None], found.shape), abs=1e-12)
    field = LayerField(layer.mesh, moved, BODY.thickness_m, ())
    rng = np.random.default_rng(2)
    angle, radius = rng.uniform(0, 2 * np.pi, 500), 0.025 * np.sqrt(rng.uniform(0, 1, 500))
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    metric, normal = field.metric(points)
    areal = np.linalg.norm(np.cross(f[:, 0], f[:, 1]))
    assert metric == pytest.approx(np.broadcast_to((f.T @ f)[:2, :2], metric.shape), abs=1e-9)
    assert normal == pytest.approx(np.full(500, np.linalg.det(f) / areal), abs=1e-9)
    expected = np.column_stack([points, np.zeros(500)]) @ (f - np.eye(3)).T
    assert field.displacement(points) == pytest.approx(expected, abs=1e-12)


def test_a_held_punch_leaves_its_depth_alone(layer: LayerProblem) -> None:
    gradient, _ = many.system(layer, _state(layer))
    assert gradient[-1] == 0
    assert many.reactions(layer, _state(layer)).min() > 0


def test_a_layer_turned_inside_out_has_no_energy(layer: LayerProblem) -> None:
    x = _state(layer)
    x[:-2] *= 100
    assert many.energy(layer, x) == np.inf
