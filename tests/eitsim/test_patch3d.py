"""The three-dimensional correction near the rim."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from skfem import Basis, ElementHex2

from eitsim import patch_base, solid3d
from eitsim.axisymmetric import solve_state
from eitsim.near_rim import COARSE, FINE, outline_of, patch_problem, solve_near_rim
from eitsim.patch3d import correction, energy, make_patch, system
from eitsim.patch_base import base_of
from eitsim.patch_mesh import Fineness, Outline, patch_mesh
from eitsim.results import RimField
from eitsim.scene import Body, Punch, Skin
from eitsim.skin import changes, sheet_conductance
from matcal import hyperfoam
from matcal.conductivity import Conductivity
from matcal.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([14.42e3, 16.78e3, -21.67e3]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
BODY = Body()
SKIN = Conductivity(30.0, (-2.0, 0.0, 0.0), (-0.5, 0.5))
TINY = Fineness(core=1, inner=1, edge=1, outer=2, layers=(-1.0, 0.0))


def at_gap(gap_m: float, force_N: float = 0.1) -> Punch:
    return Punch(x_m=0.093 - gap_m, force_N=force_N)


@pytest.fixture(scope="module")
def touch():
    return solve_state(FOAM, BODY, Punch(force_N=0.1), 0.1)


@pytest.fixture(scope="module")
def base(touch):
    return base_of(*touch[1:])


@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (0.4, 1.1, 1.1 + 1e-9), (0.3, 0.9, 2.0)])
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_stress_and_tangent_are_derivatives_of_the_energy(stretch, nu):
    law, rng = replace(FOAM, nu=np.full(3, nu)), np.random.default_rng(1)
    turn, other = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
    gradient = turn @ np.diag(stretch) @ other * np.linalg.det(turn @ other)
    step = 1e-6 * np.eye(9).reshape(9, 3, 3)

    def stored(f):
        return hyperfoam.energy(law, np.log(np.linalg.svd(f, compute_uv=False)))

    def stress(f):
        return solid3d.stress(law, solid3d.principal(f))

    at = solid3d.principal(gradient)
    by_energy = np.array([stored(gradient + s) - stored(gradient - s) for s in step]) / 2e-6
    by_stress = np.array([stress(gradient + s) - stress(gradient - s) for s in step]) / 2e-6
    tangent = solid3d.tangent(law, at)
    assert np.abs(by_energy - solid3d.stress(law, at)).max() < 1e-5 * law.mu_0_Pa
    assert np.abs(by_stress - tangent).max() < 1e-7 * np.abs(tangent).max()
    assert np.linalg.eigvalsh(solid3d.tangent(law, at, 0.0)).min() > -1e-9 * np.abs(tangent).max()


def test_the_kernel_does_what_numpy_does(base):
    patch, rng = make_patch(base, outline_of(BODY, at_gap(0.005)), TINY), np.random.default_rng(2)
    foam = patch.foam
    stiff = rng.normal(size=(*foam.weight.shape, 9, 9))
    stiff, force = stiff + np.swapaxes(stiff, -1, -2), rng.normal(size=(*foam.weight.shape, 9))
    sums = []
    for assemble in (solid3d.assemble, solid3d.assemble_plainly):
        gradient, data = np.zeros(patch.traction.size), np.zeros(patch.pattern.nnz)
        assemble(foam.shape, force, stiff, foam.numbers, foam.places, gradient, data)
        sums.append((gradient, data))
    for one, other in zip(*sums, strict=True):
        assert np.abs(one - other).max() < 1e-12 * np.abs(one).max()


@pytest.mark.parametrize(("gap", "part"), [(0.0005, 2e-3), (0.02, 1e-4)])
def test_the_mesh_fills_the_patch_up_to_the_curved_rim(gap, part):
    outline = outline_of(BODY, at_gap(gap))
    mesh = patch_mesh(outline, COARSE)
    angle = (np.arange(20000) + 0.5) / 20000 * np.pi
    area = np.mean(np.minimum(outline.rim(angle), outline.reach) ** 2) * np.pi / 2
    x, y, _ = mesh.doflocs
    assert np.hypot(x + outline.offset, y).max() < outline.disc * (1 + 1e-12)
    basis = Basis(mesh, ElementHex2(), intorder=5)
    assert basis.dx.min() > 0
    assert basis.dx.sum() == pytest.approx(area, rel=part)


def test_gradient_and_hessian_belong_to_the_energy(base):
    patch, rng = make_patch(base, outline_of(BODY, at_gap(0.002)), TINY), np.random.default_rng(3)
    x = correction(patch).x + 1e-4 * rng.normal(size=patch.traction.size + 1)
    gradient, factorise = system(patch, x)
    along = gradient / np.linalg.norm(gradient)
    step = 1e-7 * along
    slope = (energy(patch, x + step) - energy(patch, x - step)) / 2e-7
    assert slope == pytest.approx(float(gradient @ along), rel=1e-6)
    back = factorise()((system(patch, x + step)[0] - system(patch, x - step)[0]) / 2)
    assert np.linalg.norm(back - step) < 1e-6 * np.linalg.norm(step)


def test_no_rim_no_correction(base):
    patch = make_patch(base, Outline(100.0, 1.0, 0.7, 0.05, 3.5), COARSE)
    assert np.abs(correction(patch).x).max() < 1e-12


def test_without_a_rim_the_correction_carries_one_axisymmetric_touch_to_another():
    (low, *state), (high, *_) = (solve_state(FOAM, BODY, Punch(), force) for force in (0.95, 1.0))
    patch = make_patch(base_of(*state), Outline(10.0, 0.01, 0.7, 0.05, 3.5), FINE)
    patch = replace(patch, reaction=patch.reaction / 0.95)
    x = correction(patch).x
    reached = low.depth_m + float(x[-1]) * BODY.thickness_m
    print(f"depth {reached * 1e3:.4f} mm, axisymmetric {high.depth_m * 1e3:.4f} mm")
    assert abs(reached - high.depth_m) < 0.005 * high.depth_m


def test_the_rim_deepens_a_touch_the_more_the_nearer(base):
    added = [float(correction(make_patch(base, outline_of(BODY, at_gap(gap)), COARSE)).x[-1])
             for gap in (0.002, 0.008, 0.02)]
    print([f"{a / base.state.x[-1]:.2%}" for a in added])
    assert all(a > 2 * b for a, b in itertools.pairwise(added))
    assert added[0] > 0.01 * base.state.x[-1]
    assert 0 < added[2] < 0.002 * base.state.x[-1]


def test_a_touch_near_the_rim_tells_its_error_and_ends_smoothly(touch):
    got, before = solve_near_rim(FOAM, BODY, at_gap(0.008)), touch[0]
    assert got.rim is not None
    assert got.force_N == before.force_N
    assert before.depth_m < got.depth_m < 1.01 * before.depth_m
    assert got.depth_error < 0.003
    assert got.rim.jump < 0.003


def test_what_the_rim_does_not_allow_is_named():
    assert patch_problem(BODY, at_gap(0.005)) == ""
    for punch, named in ((at_gap(-0.001), "beyond the rim"), (replace(at_gap(0.005), profile="sphere"), "flat"),
                         (replace(at_gap(0.005), fillet_m=0.0065), "fillet_mm")):
        assert named in patch_problem(BODY, punch)
        with pytest.raises(ValueError, match=named):
            outline_of(BODY, punch)
    assert "larger" in patch_problem(Body(radius_m=0.02), Punch(x_m=0.01))


def test_the_skin_takes_the_rims_metric_as_it_is(touch):
    rng = np.random.default_rng(4)
    line = np.stack(np.meshgrid(np.linspace(-0.04, 0.04, 17), np.linspace(0, 0.04, 9)), axis=-1).reshape(-1, 2)
    one = RimField(line, np.zeros((len(line), 3)), np.tile([1.0, 0.0, 1.0], (len(line), 1)), np.ones(len(line)), 0.04,
                   0.0, 0.0)
    punch, points = Punch(x_m=0.03, y_m=0.04), np.array([0.03, 0.04]) + rng.uniform(-0.02, 0.02, (50, 2))
    plain = sheet_conductance(points, punch, touch[0], Skin(), SKIN)
    same = sheet_conductance(points, punch, replace(touch[0], rim=one), Skin(), SKIN)
    assert np.abs(same - plain).max() < 1e-12 * np.abs(plain).max()
    skewed = replace(one, metric=np.tile([1.1, 0.05, 0.9], (len(line), 1)))
    metric, _ = changes(skewed, np.array([[0.01, 0.01], [0.01, -0.01]]))
    assert metric[0] == pytest.approx(np.array([[1.1, 0.05], [0.05, 0.9]]))
    assert metric[1] == pytest.approx(np.array([[1.1, -0.05], [-0.05, 0.9]]))


def test_gradients_between_gauss_points_stay_those_of_the_solution(base):
    points = np.array([[0.3, 0.0, -0.3], [0.0, 0.3, -0.3]])
    first, second = patch_base.gradient(base, points)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert second == pytest.approx(turn @ first @ turn.T, abs=1e-12)
