"""The physical limit, on random linear models and on synthetic touches: multipoles of a spot of other conductance."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.polygons import edge_distance_m
from eitsim.scene.scene import Body, Punch, Scene
from eitsim.sweeps.design.card_draws import Cards
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.draws import foam_draws
from surrogate.bounds import cramer_rao
from surrogate.bounds.cramer_rao import covariance_at
from surrogate.bounds.dataset_bound import least_rms
from surrogate.bounds.derivative_table import SlopeTable, at_pressure, derivatives_at
from surrogate.bounds.fisher_information import Prior, Slopes, correlation, information
from surrogate.bounds.material_spread import MaterialSpread, known_material, spread_over
from surrogate.bounds.reading_derivatives import Derivatives
from surrogate.bounds.van_trees import domain, least_error
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import multipole_series
from touchcal.arrays import Array

PRIOR = Prior(100.0, 0.0, (10.0, 18.0), (0.1, 2.0))
STEP = 1e-4


def signal(ring: Ring, touch: Array) -> Array:
    """(n, readings) V of synthetic touches (n, 4): a weak spot's first three multipoles."""
    x, y, d, force = np.asarray(touch, dtype=float).T
    press = force / (d / 14) ** 1.5
    radius, contrast = d / 2 * (1 + 0.06 * press / (1 + press)), 0.55 * press / (press + 1.2)
    powers = (radius[:, None] / ring.radius_mm) ** (2 * np.arange(1, 4)) / np.array([1.0, 2.0, 12.0])
    field = multipole_series.patterns(ring, np.ones(60), (x + 1j * y) / ring.radius_mm, orders=powers.shape[1])
    return 2.65 * multipole_series.combined(multipole_series.basis(*field), contrast[:, None] * powers)


def by_touch(ring: Ring, touch: Array) -> Array:
    """(n, readings, 4) its derivatives, central differences."""
    return np.stack([(signal(ring, touch + step) - signal(ring, touch - step)) / (2 * STEP)
                     for step in STEP * np.eye(4)], axis=-1)


def bare(by: Array) -> Slopes:
    return Slopes(by, np.empty((*by.shape[:-1], 0)))


def test_information_falls_with_the_noise_squared_and_never_grows_by_material() -> None:
    rng = np.random.default_rng(0)
    by, material = rng.normal(size=(5, 30, 4)), rng.normal(size=(5, 30, 3))
    known, open_ = (information(Slopes(by, part), 0.7) for part in (material[..., :0], material))
    assert np.allclose(information(bare(by), 0.35), 4 * known)
    assert np.linalg.eigvalsh(known - open_).min() > -1e-12 * known.max()
    whole = 0.7**2 * np.eye(30) + material @ np.swapaxes(material, -1, -2)
    assert np.allclose(open_, np.swapaxes(by, -1, -2) @ np.linalg.solve(whole, by))


def local_covariance(slopes: Slopes, noise_V: float) -> Array:
    """Covariance of the best estimate of a linear case with a Gaussian prior."""
    return np.linalg.inv(information(slopes, noise_V) + np.diag(1 / PRIOR.variances))


def test_the_limit_turns_with_the_ring_whose_ground_electrode_breaks_the_mirror(ring: Ring) -> None:
    turn = 2 * np.pi / 16
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    place = np.array([31.0, 12.0])
    places = np.stack([place, rotation @ place, place * [1, -1]])
    found = local_covariance(bare(by_touch(ring, np.column_stack([places, np.full((3, 2), [14.0, 0.5])]))), 1e-3)
    turned, mirrored = (seen_by(axes, found[0]) for axes in (rotation, np.diag([1.0, -1.0])))
    assert found[1] == pytest.approx(turned, rel=1e-6, abs=1e-9)
    assert abs(found[2][0, 0] / mirrored[0, 0] - 1) > 0.01


def seen_by(axes: Array, covariance: Array) -> Array:
    whole = np.eye(4)
    whole[:2, :2] = axes
    return whole @ covariance @ whole.T


def test_diameter_and_force_are_confounded(ring: Ring) -> None:
    found = local_covariance(bare(by_touch(ring, np.array([[30.0, 10.0, 14.0, 0.5]]))), 1e-5)[0]
    assert correlation(found, "d", "F") < -0.9
    assert all(abs(correlation(found, place, "F")) < 0.9 for place in ("x0", "y0"))


@pytest.mark.parametrize("u", [0.1, 1.0, 5.0, 20.0])
def test_the_least_error_of_one_uniform_parameter_has_its_closed_form(u: float) -> None:
    half = 0.95
    where = domain((14.0, 14.0), (0.1, 2.0), 32)
    told = np.zeros((*where.points.shape, 2))
    told[..., 1, 1] = (u / half) ** 2
    found = where.mean(least_error(where, told, np.broadcast_to([0.0, 1.0], where.points.shape)))
    assert found == pytest.approx((1 - np.tanh(u) / u) * (half / u) ** 2, rel=2e-3)


def squared_errors(ring: Ring, place: tuple[float, float], noise: float) -> Array:
    """(800, 2) squared errors of the posterior mean of (d, F) at a known place, by a fine grid of punches."""
    rng = np.random.default_rng(2)
    axes = [np.linspace(*ends, 61) for ends in (PRIOR.d_mm, PRIOR.force_N)]
    punch = np.stack([(axis[1:] + axis[:-1]) / 2 for axis in axes])
    d, force = (grid.ravel() for grid in np.meshgrid(*punch, indexing="ij"))
    grid = signal(ring, np.column_stack([np.full_like(d, place[0]), np.full_like(d, place[1]), d, force]))
    onto = np.linalg.svd(grid, full_matrices=False)[2][:3].T
    truth = rng.uniform(*np.transpose([PRIOR.d_mm, PRIOR.force_N]), size=(800, 2))
    read = signal(ring, np.column_stack([np.full((800, 2), place), truth])) @ onto + noise * rng.normal(size=(800, 3))
    apart = np.sum((read[:, None] - grid @ onto) ** 2, axis=-1) / (2 * noise**2)
    weight = np.exp(-(apart - apart.min(axis=1, keepdims=True)))
    mean = weight @ np.column_stack([d, force]) / weight.sum(axis=1, keepdims=True)
    return (mean - truth) ** 2


@pytest.mark.thorough
@pytest.mark.parametrize("noise", [2e-3, 4e-4, 1e-4])
def test_no_posterior_mean_beats_the_least_error_and_it_comes_near(ring: Ring, noise: float) -> None:
    where = domain(PRIOR.d_mm, PRIOR.force_N)
    points = where.points
    touch = np.column_stack([np.full((points[..., 0].size, 2), [40.0, 10.0]), points.reshape(-1, 2)])
    whole = information(bare(by_touch(ring, touch)), noise)[:, 2:, 2:].reshape(*points.shape, 2)
    least = np.array([where.mean(least_error(where, whole, np.broadcast_to(axis, points.shape))) for axis in np.eye(2)])
    found = squared_errors(ring, (40.0, 10.0), noise)
    best, scatter = found.mean(axis=0), found.std(axis=0) / np.sqrt(len(found))
    print(noise, np.sqrt(least), np.sqrt(best), scatter / best / 2)
    assert np.all(least < best + 3 * scatter)
    assert np.all(np.sqrt(least) > 0.85 * np.sqrt(best))


def table(ring: Ring, diameters: int = 3, pressures: int = 9) -> SlopeTable:
    """A table of synthetic touches at two places."""
    d, pressure = np.geomspace(10, 18, diameters), np.geomspace(0.1 / 18**2, 2 / 10**2, pressures)
    touch = np.array([[r, 5.0, one, one**2 * p] for r in (30.0, 60.0) for one in d for p in pressure])
    by = by_touch(ring, touch).reshape(2, diameters, pressures, -1, 4)
    by = at_pressure(np.concatenate([by, 0.1 * touch[:, 3].reshape(2, diameters, pressures, 1, 1) * by[..., 3:]],
                                    axis=-1), d, pressure)
    names = ("x_mm", "y_mm", "d_mm", "F_N", "mu_1_Pa")
    return SlopeTable(np.full(2, 0.5), d, pressure, np.log, names, by, np.ones(by.shape[-2]))


def test_a_table_s_derivatives_between_its_nodes_converge(ring: Ring) -> None:
    punch = np.array([[11.0, 0.3], [15.5, 1.1], [12.0, 1.9]])
    exact = by_touch(ring, np.column_stack([np.full((3, 2), [60.0, 5.0]), punch]))

    def apart(made: SlopeTable) -> float:
        found = derivatives_at(made, 1, *punch.T).by[..., :4]
        return float((np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1)).max())

    coarse, fine = apart(table(ring)), apart(table(ring, 5, 18))
    assert fine < coarse / 6 < 0.01


def test_the_least_error_over_a_prior_grows_with_noise_and_material_up_to_the_prior_s_own(ring: Ring) -> None:
    made, spread = table(ring), MaterialSpread(("mu_1_Pa",), np.array([[1.0]]))
    quiet, loud, deaf = (least_rms(made, PRIOR, noise, known_material()) for noise in (1e-5, 1e-4, 1e3))
    open_ = least_rms(made, PRIOR, 1e-5, spread)
    assert all(quiet[name] < loud[name] <= deaf[name] for name in quiet)
    assert all(open_[name] >= quiet[name] for name in quiet)
    assert open_["F"] > 1.5 * quiet["F"]
    assert [deaf[name] for name in ("d", "F")] == pytest.approx([8 / 12**0.5, 1.9 / 12**0.5], rel=1e-3)


def test_draws_whose_stresses_agree_leave_little_open_however_far_their_moduli_lie_apart() -> None:
    skin = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
    law = Hyperfoam(np.array([14000.0, -4000.0]), np.array([3.0, 2.0]), np.zeros(2))
    rng = np.random.default_rng(3)
    shift = rng.uniform(-0.8, 0.8, 40)
    alpha = np.column_stack([law.alpha[0] + 0 * shift, law.alpha[1] + shift])
    strain = np.linspace(-0.7, 0.3, 21)
    own = nominal_stress(law, "uniaxial", strain)
    one = [np.column_stack([nominal_stress(Hyperfoam(row, a, np.zeros(2)), "uniaxial", strain) for row in np.eye(2)])
           for a in alpha]
    mu = np.array([np.linalg.lstsq(columns, own, rcond=None)[0] for columns in one], np.float64)
    draws = foam_draws(mu, alpha, np.zeros(2), conductivity_S_per_m=np.tile(30.0 * np.r_[1, skin.a], (40, 1)))
    found = spread_over(Cards(MaterialCard("synthetic", law, None, skin), draws, np.arange(40)))
    exact = np.array([nominal_stress(Hyperfoam(*both, np.zeros(2)), "shear", 0.3)
                      for both in zip(mu, alpha, strict=True)])
    slope = np.array([(nominal_stress(Hyperfoam(law.mu_Pa + h, law.alpha + k, np.zeros(2)), "shear", 0.3)
                       - nominal_stress(law, "shear", 0.3)) / 1e-6
                      for h, k in zip(1e-6 * np.eye(4)[:, :2], 1e-6 * np.eye(4)[:, 2:], strict=True)])
    told = np.linalg.norm(slope @ found.factor[:4])
    naive = np.sqrt(slope @ np.cov(np.hstack([mu, alpha]).T) @ slope)
    assert told == pytest.approx(np.std(exact, ddof=1), rel=0.1)
    assert naive > 2 * told


def test_a_map_turns_with_the_ring(ring: Ring, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every place of the map has the limit of a touch there, of synthetic readings."""
    def derivatives(x_mm: float, y_mm: float, punch: Punch) -> Derivatives:
        touch = np.array([[x_mm, y_mm, punch.diameter_m * 1e3, punch.force_N]])
        return Derivatives(("x_mm", "y_mm", "d_mm", "F_N"), by_touch(ring, touch)[0], np.ones(208))

    def of_scene(scene: Scene, card: MaterialCard, *, rim: bool) -> Derivatives:
        (punch,) = scene.punches
        return derivatives(punch.x_m * 1e3, punch.y_m * 1e3, punch)

    monkeypatch.setattr(cramer_rao, "derivatives_of", of_scene)
    scene = replace(Scene(), punches=(Punch(force_N=0.5),))
    card = MaterialCard("synthetic", None, None, None)
    found = cramer_rao.over_disc(scene, card, {"known": known_material()}, [80.0])
    assert len(found) == 1 + 16 * 4 * cramer_rao.RADII
    for _, row in found.iloc[::37].iterrows():
        here = derivatives(row["x_mm"], row["y_mm"], scene.punches[0])
        own = np.sqrt(np.diag(covariance_at(here, known_material(), 80.0)))
        assert row[["sd_x0_mm", "sd_y0_mm", "sd_d_mm", "sd_F_N"]].to_numpy(float) == pytest.approx(own, rel=1e-5)
    assert np.hypot(found["x_mm"], found["y_mm"]).max() == pytest.approx(92.0)
    with pytest.raises(ValueError, match="does not look the same"):
        cramer_rao.places(replace(scene, electrodes=Electrodes(width_m=(0.01, *[0.02] * 15))))


def test_a_map_of_an_outline_has_its_own_places_and_turns_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the centroid outwards, off edges and holes; of synthetic readings that know nothing of a ring."""
    def of_scene(scene: Scene, card: MaterialCard, *, rim: bool) -> Derivatives:
        (punch,) = scene.punches
        by = np.eye(8)[:, :4] * np.array([1 + punch.x_m, 2 + punch.y_m, 3.0, 4.0])
        return Derivatives(("x_mm", "y_mm", "d_mm", "F_N"), by, np.ones(8))

    monkeypatch.setattr(cramer_rao, "derivatives_of", of_scene)
    body = Body(Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((0.03, 0.0, 0.004),)), 0.005)
    scene = Scene(body, (Punch(diameter_m=0.01, force_N=0.5),), electrodes=Electrodes(count=8, width_m=0.006))
    card = MaterialCard("synthetic", None, None, None)
    found = cramer_rao.over_disc(scene, card, {"known": known_material()}, [80.0])
    assert len(found) == cramer_rao.OUTLINED
    at = found[["x_mm", "y_mm"]].to_numpy(float)
    assert edge_distance_m(body.outline, at / 1e3).min() >= 0.005 + 0.25 * 0.005
    assert np.all(np.diff(np.linalg.norm(at, axis=1)) >= 0)
    assert found["sd_x0_mm"].to_numpy(float) * (1 + at[:, 0] / 1e3) == pytest.approx(1e-4, rel=1e-6)
    assert found["sd_y0_mm"].to_numpy(float) * (2 + at[:, 1] / 1e3) == pytest.approx(1e-4, rel=1e-6)
