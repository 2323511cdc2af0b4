"""The clipped disc: its discretisation, its equilibria, and what it changes of a touch near the rim."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric import friction_increments
from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit, mesh_hierarchy, solve_touch, under_force
from eitsim.mechanics.contact.punch_contact import pressure
from eitsim.mechanics.harmonics.arcs import OffsetDisc, circles
from eitsim.mechanics.harmonics.clipped_disc import amplitudes, clipped_disc, unknowns_of
from eitsim.mechanics.harmonics.equilibrium import contact_state, energy, linearised, product, seen, solve
from eitsim.mechanics.harmonics.fourier_fields import Points, apply_tangent, forces, gradients, operators
from eitsim.mechanics.rim import solve_near_rim as near_rim_solver
from eitsim.mechanics.rim.correction import _LEAST_ERROR, RimCorrection, _added, apply_correction, within_face
from eitsim.mechanics.rim.solve_near_rim import (
    COARSE,
    FINE,
    ONE_EDGE,
    ONE_EDGE_FINER,
    Resolution,
    on_two_meshes,
    rim_change,
    set_up,
)
from eitsim.mechanics.solid import spatial_response
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import RimField
from eitsim.scene.scene import Body, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import changes, sheet_conductance, stretches
from eitsim.simulation.edge_effects import rim_effect
from eitsim.simulation.near_edges import solve_near_rim, with_signal_errors
from eitsim.simulation.plan import make_plan
from eitsim.simulation.routes.route import Case
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import sinh_ratio
from touchcal.errors import NotConverged

FOAM = Hyperfoam(np.array([14.42e3, 16.78e3, -21.67e3]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
BODY = Body()
SKIN = Conductivity(30.0, np.array([-2.0, 0.0, 0.0]), (-0.5, 0.5))
TINY, NARROW = Resolution(12.0, 4, 9), Resolution(4.0, 5, 10)


def at_gap(gap_m: float, force_N: float = 0.1) -> Punch:
    return Punch(x_m=0.093 - gap_m, force_N=force_N)


def disc_at(gap_m: float, fineness: Resolution, force_N: float = 0.1, reach: float = 4.0, *, sticks: bool = False):
    (model,) = mesh_hierarchy(FOAM, BODY, Punch(), fineness.element * 6e-5, None)[-1:]
    force = force_N / force_unit(FOAM, BODY)
    if sticks:
        _, found = friction_increments.loaded(model, np.inf, friction_increments.at_rest(model), force)
        model, state = replace(model, springs=found.springs), found.state
    else:
        (state,) = under_force([model], force)
    return clipped_disc(model, state, OffsetDisc(10.0, 9.3 - gap_m * 100), fineness.harmonics, fineness.angles, reach)


def strains(*gradient):
    return np.stack([np.asarray(g).reshape(9) - np.eye(3).ravel() for g in gradient], axis=-1)[None]


@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (0.4, 1.1, 1.1 + 1e-9), (0.3, 0.9, 2.0)])
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_stress_and_tangent_are_derivatives_of_the_energy(stretch, nu):
    law, rng = replace(FOAM, nu=np.full(3, nu)), np.random.default_rng(1)
    turn, other = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
    gradient = turn @ np.diag(stretch) @ other * np.linalg.det(turn @ other)
    step = 1e-6 * np.eye(9).reshape(9, 3, 3)

    def stored(f):
        return law.energy(spatial_response.principal(strains(*f)).log)[0]

    def answer(f, scale=1.0):
        at = spatial_response.principal(strains(*f))
        stress, upper = spatial_response.stress_and_tangent(law, at, np.ones((1, len(f))), scale)
        tangent = np.zeros((9, 9))
        tangent[spatial_response.UPPER] = upper[0, :, 0]
        return stress[0], tangent + np.triu(tangent, 1).T

    by_energy = (stored(gradient + step) - stored(gradient - step)) / 2e-6
    by_stress = (answer(gradient + step)[0] - answer(gradient - step)[0]) / 2e-6
    stress, tangent = answer(gradient[None])
    assert np.abs(by_energy - stress[:, 0]).max() < 1e-5 * law.mu_0_Pa
    assert np.abs(by_stress - tangent).max() < 1e-7 * np.abs(tangent).max()
    assert np.linalg.eigvalsh(answer(gradient[None], 0.0)[1]).min() > -1e-9 * np.abs(tangent).max()


def gradients_plainly(at: Points, amplitude: np.ndarray) -> np.ndarray:
    """What `gradients` does, in numpy."""
    still, turning = operators(at.shape)
    order = np.arange(amplitude.shape[2])
    parts = np.einsum("pkac,pacm->pkm", still, amplitude[at.nodes])
    parts = parts + np.einsum("pkac,pacm,m->pkm", turning, amplitude[at.nodes], order)
    tables = np.stack([at.circles.cosine, at.circles.sine])[np.arange(9) % 2]
    return np.einsum("pkm,kpmj->pkj", parts, tables[:, at.circle])


def forces_plainly(at: Points, stress: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    """What `forces` does, in numpy."""
    still, turning = operators(at.shape)
    tables = np.stack([at.circles.cosine, at.circles.sine])[np.arange(9) % 2]
    parts = np.einsum("pkj,kpmj->pkm", stress, tables[:, at.circle])
    out = np.zeros_like(amplitude)
    np.add.at(out, at.nodes, np.einsum("pkac,pkm->pacm", still, parts)
              + np.einsum("pkac,pkm,m->pacm", turning, parts, np.arange(amplitude.shape[2])))
    return out


@pytest.mark.thorough
def test_the_kernels_do_what_numpy_does():
    disc, rng = disc_at(0.002, TINY), np.random.default_rng(2)
    amplitude = disc.base + 0.01 * amplitudes(disc, rng.normal(size=disc.unknowns))
    strain = gradients(disc.foam, amplitude)
    assert np.abs(strain - gradients_plainly(disc.foam, amplitude)).max() < 1e-12
    at = spatial_response.principal(strain)
    stress, tangent = spatial_response.stress_and_tangent(disc.law, at, disc.weight, 0.5)
    for one, other in zip((stress, tangent), stress_and_tangent_plainly(disc.law, strain, 0.5, disc.weight),
                          strict=True):
        assert np.abs(one - other).max() < 1e-10 * np.abs(one).max()
    force = forces(disc.foam, stress, amplitude)
    assert np.abs(force - forces_plainly(disc.foam, stress, amplitude)).max() < 1e-12 * np.abs(force).max()
    full = np.zeros((len(tangent), 9, 9, tangent.shape[2]))
    row, column = spatial_response.UPPER
    full[:, row, column] = full[:, column, row] = tangent
    pulled = forces_plainly(disc.foam, np.einsum("pklj,plj->pkj", full, strain), amplitude)
    assert np.abs(apply_tangent(disc.foam, tangent, amplitude) - pulled).max() < 1e-12 * np.abs(pulled).max()


def stress_and_tangent_plainly(law, strain, scale, weight):
    """What `spatial_response` makes of F = 1 + strain, in numpy."""
    left, stretch, right = np.linalg.svd(np.eye(3) + np.moveaxis(strain, 1, 2).reshape(len(strain), -1, 3, 3))
    log, pairs = np.log(stretch), ((0, 1), (0, 2), (1, 2))
    tau, inverse = law.kirchhoff(log), np.exp(-log)
    block = law.tangent(log) - tau[..., None] * np.eye(3)
    value, vector = np.linalg.eigh(block * inverse[..., None] * inverse[..., None, :])
    block = (vector * (np.where(value < 0, scale, 1.0) * value)[..., None, :]) @ vector.swapaxes(-1, -2)
    flips, twists = [], []
    for i, j in pairs:
        mean, half = (log[..., i] + log[..., j]) / 2, (log[..., i] - log[..., j]) / 2
        slope, middle = law.difference(mean, half, 0.0), (tau[..., i] + tau[..., j]) / 2
        flips.append(np.exp(-2 * mean) * (slope * np.cosh(half) / sinh_ratio(half) - middle))
        twists.append(np.exp(-2 * mean) * (middle - slope * half * np.tanh(half)))
    rest = np.stack(flips + twists, axis=-1)
    rest = np.where(rest < 0, scale, 1.0) * rest
    outer = np.swapaxes(left, -1, -2)[..., :, None, :, None] * right[..., None, :, None, :]
    parts = [outer[..., k, k, :, :] for k in range(3)]
    parts += [(outer[..., i, j, :, :] + outer[..., j, i, :, :]) / np.sqrt(2) for i, j in pairs]
    parts += [(outer[..., i, j, :, :] - outer[..., j, i, :, :]) / np.sqrt(2) for i, j in pairs]
    modes = np.stack(parts, axis=-3).reshape(*log.shape[:-1], 9, 9)
    along, other = modes[..., :3, :], modes[..., 3:, :]
    stress = ((tau * inverse)[..., None, :] @ along)[..., 0, :]
    tangent = along.swapaxes(-1, -2) @ block @ along + (other.swapaxes(-1, -2) * rest[..., None, :]) @ other
    upper = tangent[..., spatial_response.UPPER[0], spatial_response.UPPER[1]]
    return np.moveaxis(stress * weight[..., None], -1, 1), np.moveaxis(upper * weight[..., None], -1, 1)


def test_cut_circles_fill_the_disc():
    outline = OffsetDisc(10.0, 9.2)
    t, w = np.polynomial.legendre.leggauss(400)
    edges = [0.0, 0.8, 19.2]
    area = 0.0
    for a, b in itertools.pairwise(edges):
        radius = (a + b) / 2 - (b - a) / 2 * np.cos(np.pi / 2 * (t + 1))
        speed = (b - a) / 2 * np.pi / 2 * np.sin(np.pi / 2 * (t + 1))
        area += float(np.sum(w * speed * 2 * np.pi * radius * circles(outline, radius, 1, 8).inside))
    assert area == pytest.approx(np.pi * 100, rel=1e-6)


def test_homogeneous_deformations_are_exact_on_the_clipped_disc():
    disc, (first, second) = disc_at(0.001, TINY), (-0.1, 0.25)
    radius = np.repeat(disc.columns, len(disc.base) // len(disc.columns))
    mean, half, root = (first + second) / 2, (first - second) / 2, np.sqrt(2)
    amplitude = np.zeros(disc.base.shape)
    amplitude[:, 0, 0] = mean * radius
    amplitude[:, 0, 2], amplitude[:, 1, 2] = half * radius / root, -half * radius / root
    strain = gradients(disc.foam, amplitude)
    angle = np.arccos(np.clip(disc.foam.circles.cosine[:, 1] / root, -1, 1))[disc.foam.circle]
    expected = np.zeros_like(strain)
    expected[:, 0], expected[:, 4] = mean + half * np.cos(2 * angle), mean - half * np.cos(2 * angle)
    expected[:, 1] = expected[:, 3] = -half * np.sin(2 * angle)
    assert np.abs(strain - expected).max() < 1e-12
    assert np.allclose(spatial_response.principal(strain).log.max(axis=-1), np.log1p(second))
    turn = np.zeros(disc.base.shape)
    turn[:, 0, 1], turn[:, 1, 1] = 0.3 / root, -0.3 / root
    assert np.abs(gradients(disc.foam, turn)).max() < 1e-12


@pytest.mark.thorough
@pytest.mark.parametrize("sticks", [False, True])
def test_gradient_and_hessian_belong_to_the_energy(sticks):
    disc, rng = disc_at(0.002, TINY, 0.5, sticks=sticks), np.random.default_rng(3)
    x = solve(disc).x + 1e-6 * rng.normal(size=disc.unknowns + 1)
    gradient, tangents = linearised(disc, x)
    along = gradient / np.linalg.norm(gradient)
    step = 1e-6 * along
    slope = (energy(disc, x + step) - energy(disc, x - step)) / 2e-6
    assert slope == pytest.approx(float(gradient @ along), rel=1e-5)
    change = (linearised(disc, x + step)[0] - linearised(disc, x - step)[0]) / 2e-6
    assert np.linalg.norm(product(disc, tangents, along) - change) < 1e-4 * np.linalg.norm(change)


def test_at_the_centre_the_disc_finds_the_axisymmetric_touch_from_another_one():
    fineness = Resolution(4.0, 4, 9)
    low, high = (disc_at(0.093, fineness, force, reach=10.0) for force in (0.4, 0.5))
    found = solve(replace(low, force=high.force)).x
    u = low.base + amplitudes(low, found[:-1])
    print("depth", low.depth + found[-1], high.depth)
    assert low.depth + found[-1] == pytest.approx(high.depth, rel=1e-6)
    assert np.abs(u - high.base).max() < 1e-6 * np.abs(high.base).max()
    strain, expected = (gradients(high.foam, a) for a in (u, high.base))
    assert np.abs(strain - expected).max() < 1e-5 * np.abs(expected).max()


def test_at_the_centre_what_sticks_returns_to_the_axisymmetric_touch_from_a_wrong_start():
    disc, rng = disc_at(0.093, TINY, 0.5, sticks=True), np.random.default_rng(6)
    assert np.linalg.norm(linearised(disc, np.zeros(disc.unknowns + 1))[0]) < 1e-9 * disc.force
    found = solve(disc, 1e-4 * rng.normal(size=disc.unknowns + 1)).x
    assert np.abs(amplitudes(disc, found[:-1])).max() < 1e-8
    assert abs(found[-1]) < 1e-8


def test_what_sticks_slips_far_less_near_the_rim():
    slipped = {}
    for sticks in (True, False):
        disc = disc_at(0.002, TINY, 0.5, sticks=sticks)
        x = solve(disc).x
        if sticks:
            springs, held = disc.springs, disc.springs.stiffness[:, 0, 0] > 0
        change = springs.direction @ (seen(disc, x) - seen(disc, np.zeros_like(x)))
        slipped[sticks] = np.sqrt(np.mean(change[held] ** 2))
    print("root mean square slip that the rim adds, thicknesses", slipped)
    assert slipped[True] < 0.1 * slipped[False]


@pytest.mark.slow
def test_the_rim_deepens_a_touch_the_more_the_nearer():
    added = {}
    for gap in (0.002, 0.005, 0.012):
        disc = disc_at(gap, NARROW, 1.0, reach=5.7)
        found = solve(disc).x
        added[gap] = float(found[-1]) / disc.depth
        at = contact_state(disc, found)
        reaction = float(np.sum(disc.facing.weight * pressure(disc.punch, at.penetration) * at.normal[:, 2]))
        assert reaction == pytest.approx(disc.force, rel=1e-8)
    print({gap: f"{part:.2%}" for gap, part in added.items()})
    # the same touch by another method, hexahedra on a patch, in percent of the depth
    for (_, part), other in zip(added.items(), (4.9, 1.5, 0.25), strict=True):
        assert 100 * part == pytest.approx(other, abs=0.06 + 0.05 * other)


@pytest.mark.slow
@pytest.mark.parametrize(("gap_m", "depth_m"), [(0.002, 3.8186e-3), (0.005, 3.6999e-3)])
def test_a_straight_edge_deepens_a_touch_as_hexahedra_in_three_dimensions_have_it(gap_m, depth_m):
    """benchmarks/edge_touches.py, whose peer knows these depths to 0.01 %; without the edge they are 1 to 5 % less."""
    body = Body(Outline("rectangle", width_m=0.24, height_m=0.2))
    punch = Punch(x_m=0.12 - gap_m - 0.007, diameter_m=0.014, force_N=1.0)
    assert solve_near_rim(FOAM, body, punch).depth_m == pytest.approx(depth_m, rel=1.5e-3)
    assert solve_touch(FOAM, body, punch).depth_m < 0.99 * depth_m


@pytest.mark.parametrize("fineness", [ONE_EDGE, ONE_EDGE_FINER])
def test_near_one_edge_elements_are_split_by_their_distance_from_the_fillet(fineness):
    def lines(fineness: Resolution) -> np.ndarray:
        model, _ = set_up(FOAM, BODY, Punch(force_N=1.0), fineness)
        return model.grid.lines[0][::model.grid.order]

    def steepest(r: np.ndarray) -> float:
        """Largest width of an element over the distance of the farther end of the unsplit one that it is part of."""
        whole, edge = lines(replace(fineness, grading=np.inf, widest=np.inf, parts=1)), Punch(force_N=1.0)
        outer = edge.diameter_m / 2 / BODY.thickness_m
        away = np.maximum(whole[1:] - outer, outer - edge.fillet_m / BODY.thickness_m - whole[:-1])
        part_of = np.searchsorted(whole, (r[1:] + r[:-1]) / 2) - 1
        counts = (away[part_of] > 1e-9) & (whole[part_of] < outer + fineness.out_to)
        return float(np.max(np.diff(r)[counts] / away[part_of][counts]))

    assert steepest(lines(fineness)) <= fineness.grading * (1 + 1e-9)
    assert steepest(lines(replace(fineness, grading=np.inf))) > fineness.grading * (1 + 1e-9)


def test_harmonics_converge_geometrically():
    added = [float(solve(disc_at(0.003, Resolution(8.0, count, 16))).x[-1]) for count in (3, 5, 7, 9)]
    steps = np.abs(np.diff(added)) / added[-1]
    print("relative steps of the added depth", steps)
    assert np.all(steps[1:] < steps[:-1] / 3)


def test_a_touch_near_the_rim_tells_its_error_and_ends_smoothly():
    touch = solve_touch(FOAM, BODY, Punch(force_N=0.1))
    got = with_signal_errors(on_two_meshes(touch, FOAM, BODY, at_gap(0.008), coarse=TINY, fine=COARSE))
    assert got.rim is not None
    assert got.force_N == touch.force_N
    assert touch.depth_m < got.depth_m < 1.01 * touch.depth_m
    assert got.depth_error < 0.003
    last = got.rim.metric[-1] - [1, 0, 1]
    assert np.abs(last).max() < 1e-3
    assert np.abs(got.rim.normal[-1] - 1).max() < 1e-3


@pytest.fixture(scope="module")
def on_coarse_meshes():
    """A touch far from the rim, its punch at the rim, and the touch there on two meshes."""
    touch, punch = solve_touch(FOAM, BODY, Punch(force_N=0.1)), at_gap(0.001)
    return touch, punch, with_signal_errors(on_two_meshes(touch, FOAM, BODY, punch, coarse=TINY, fine=COARSE))


@pytest.mark.thorough
@pytest.mark.parametrize("because", ["it takes many iterations", "the finer one is not found"])
def test_a_hard_touch_takes_the_coarse_mesh_and_its_error_from_a_rough_one(because, on_coarse_meshes, monkeypatch):
    def lost(law, body, punch, outline, fineness, before=None):
        if fineness is FINE:
            raise NotConverged("lost", estimate=np.zeros(1))
        return found(law, body, punch, outline, fineness, before)

    found, (touch, punch, same) = near_rim_solver._found, on_coarse_meshes
    if because.startswith("it"):
        monkeypatch.setattr(near_rim_solver, "_HARD", 0)
    else:
        monkeypatch.setattr(near_rim_solver, "_found", lost)
    got = with_signal_errors(on_two_meshes(touch, FOAM, BODY, punch, rough=TINY, coarse=COARSE))
    assert got.depth_m == pytest.approx(same.depth_m, rel=1e-6)
    added, usual = (one.signal_errors - touch.signal_errors for one in (got, same))
    np.testing.assert_allclose(added, 1.5 * usual, rtol=1e-3)


def test_where_the_rim_is_left_out_the_field_jumps_by_less_than_the_plan_says():
    gaps = np.arange(0.02, 0.06, 0.0001)
    gap = float(next(g for g in gaps if not Case(Scene(punches=(at_gap(float(g)),))).near))
    touch = solve_touch(FOAM, BODY, Punch(force_N=1.0))
    change = rim_change(FOAM, BODY, at_gap(gap, 1.0), COARSE)
    radius, share = change.field.radius_m, 1 - OffsetDisc(0.1, 0.093 - gap).start(change.field.radius_m) / np.pi
    weight = (radius * np.gradient(radius) * share)[:, None]
    before = stretches(touch, radius)[2][:, None]
    jump = np.sqrt(np.sum(weight * (before * (change.field.normal - 1)) ** 2)
                   / np.sum(weight * np.ones(change.field.normal.shape) * (before - 1) ** 2))
    bound = rim_effect(gap, BODY.thickness_m, "normal")
    print(f"gap {gap * 1e3:.1f} mm: depth {change.depth_m / touch.depth_m:.1e}, strain {jump:.1e}, bound {bound:.1e}")
    assert 0 < change.depth_m / touch.depth_m < bound
    assert 0 < jump < bound


def test_a_given_depth_takes_the_force_that_reaches_it():
    punch = at_gap(0.002, 0.2)
    by_force = rim_change(FOAM, BODY, punch, COARSE)
    touch = solve_touch(FOAM, BODY, Punch(force_N=0.2), element_m=3.6e-4)
    depth = touch.depth_m + by_force.depth_m
    by_depth = rim_change(FOAM, BODY, replace(punch, force_N=None, depth_m=depth), COARSE)
    deeper = solve_touch(FOAM, BODY, Punch(force_N=None, depth_m=depth), element_m=3.6e-4)
    assert by_depth.depth_m == 0
    assert deeper.force_N * by_depth.force == pytest.approx(0.2, rel=0.002)
    assert np.abs(by_depth.field.normal - by_force.field.normal).max() < 0.02


def test_fields_of_all_gaps_share_their_samples():
    fields = [rim_change(FOAM, BODY, at_gap(gap), TINY).field for gap in (0.001, 0.01)]
    assert np.array_equal(fields[0].radius_m, fields[1].radius_m)
    assert np.array_equal(fields[0].share, fields[1].share)


@pytest.mark.parametrize("profile", ["sphere", "cone"])
def test_other_profiles_deepen_near_the_rim(profile):
    punch = replace(at_gap(0.002, 0.2), profile=profile)
    change = rim_change(FOAM, BODY, punch, COARSE)
    far = rim_change(FOAM, BODY, replace(punch, x_m=0.04), COARSE)
    assert change.depth_m > 5e-6
    assert abs(far.depth_m) < 0.01 * change.depth_m


def refusal(punch):
    return make_plan(Scene(body=BODY, punches=(punch,)), MaterialCard("foam", FOAM)).refusal


def test_what_the_rim_does_not_allow_is_named():
    assert refusal(at_gap(0.005)) == ""
    assert refusal(replace(at_gap(0.005), friction="coulomb", friction_coefficient=0.5)) == ""
    assert "outside the rim" in refusal(at_gap(-0.001))


@pytest.mark.parametrize(("gap", "named"), [
    (0.0, "on the rim"), (5e-7, "on the rim"), (-1e-5, "on the rim"), (-1e-3, "1.0 mm outside the rim")])
def test_an_edge_on_the_rim_is_told_how_far_to_move(gap, named):
    problem = refusal(at_gap(gap))
    assert named in problem
    (inwards,) = re.findall(r"x_mm and y_mm .* (\S+) mm further inwards", problem)
    assert refusal(at_gap(gap + float(inwards) / 1e3)) == ""


def test_the_skin_takes_the_rims_metric_as_it_is():
    touch, rng = solve_touch(FOAM, BODY, Punch(force_N=0.1)), np.random.default_rng(4)
    radius, share = np.linspace(0.001, 0.05, 20), np.linspace(0, 1, 9)
    none = np.tile([1.0, 0.0, 1.0], (20, 9, 1))
    one = RimField(radius, share, np.zeros((20, 9, 3)), none, np.ones((20, 9)), 0.1, 0.05)
    punch, points = Punch(x_m=0.03, y_m=0.04), np.array([0.03, 0.04]) + rng.uniform(-0.02, 0.02, (50, 2))
    plain = sheet_conductance(points, punch, touch, Skin(), SKIN)
    same = sheet_conductance(points, punch, replace(touch, rim=one), Skin(), SKIN)
    assert np.abs(same - plain).max() < 1e-12 * np.abs(plain).max()
    skewed = replace(one, metric=np.tile([1.1, 0.05, 0.9], (20, 9, 1)))
    metric, _ = changes(skewed, np.array([[0.01, 0.01], [0.01, -0.01], [0.06, 0.0]]))
    assert metric[0] == pytest.approx(np.array([[1.1, 0.05], [0.05, 0.9]]))
    assert metric[1] == pytest.approx(np.array([[1.1, -0.05], [-0.05, 0.9]]))
    assert metric[2] == pytest.approx(np.eye(2))


def test_forces_are_the_adjoint_of_the_amplitudes():
    disc, rng = disc_at(0.002, TINY), np.random.default_rng(5)
    x, force = rng.normal(size=disc.unknowns), rng.normal(size=disc.base.shape)
    assert np.sum(amplitudes(disc, x) * force) == pytest.approx(float(x @ unknowns_of(disc, force)))


def test_a_contact_is_no_larger_than_the_face_and_the_excess_is_told():
    far = solve_touch(FOAM, Body(), Punch(force_N=0.1), element_m=0.24e-3)
    wide = replace(far, contact_area_m2=1.1 * np.pi * 0.007**2, contact_area_error=0.01)
    kept = within_face(wide, Punch(diameter_m=0.014))
    assert kept.contact_area_m2 == pytest.approx(np.pi * 0.007**2, rel=1e-12)
    assert kept.contact_area_error == pytest.approx(0.11)
    assert kept.sigma_ave_Pa == pytest.approx(far.force_N / kept.contact_area_m2)


def test_a_change_adds_its_depth_and_multiplies_what_it_gives_as_a_ratio():
    far = replace(solve_touch(FOAM, Body(), Punch(force_N=0.1), element_m=0.24e-3), wall_contact_m2=1e-6)
    field = RimField(np.linspace(0, 0.02, 3), np.array([0.5]), np.zeros((3, 1, 3)),
                     np.tile([1.0, 0.0, 1.0], (3, 1, 1)), np.ones((3, 1)), 0.1, 0.09)
    near = apply_correction(far, RimCorrection(field, 2e-4, 1.3, 1.2, 1.5, 0.0, (), 1.1))
    numbers = (near.depth_m - far.depth_m, *(getattr(near, name) / getattr(far, name) for name in (
        "sigma_max_Pa", "contact_area_m2", "force_N", "sigma_ave_Pa")))
    assert numbers == pytest.approx((2e-4, 1.3, 1.2, 1.1, 1.1 / 1.2))
    assert near.wall_contact_m2 == pytest.approx(1.5e-6)
    assert near.rim is field


def test_a_failure_near_the_rim_tells_its_likely_cause():
    punch = Punch(0.0332501, 0.0854838, 0.0157779, 4.78751, friction="stick")
    error_estimate = r"Likely cause: .*0\.39 mm from the rim, \d\.\d\d mm deep.* move it inwards"
    touch = solve_touch(FOAM, BODY, replace(punch, friction="none"), element_m=0.24e-3)
    with pytest.raises(NotConverged, match=error_estimate):
        with_signal_errors(on_two_meshes(touch, FOAM, BODY, punch, coarse=TINY, fine=COARSE))


def test_an_error_grows_by_the_difference_of_two_ratios_and_at_least_by_a_part_of_the_change() -> None:
    assert _added(None, 1.1, 1.2) is None
    assert _added(0.01, 1.2, 1.5) == pytest.approx(0.01 + 0.2)
    assert _added(0.01, 1.5, 1.5) == pytest.approx(0.01 + _LEAST_ERROR * 0.5)
