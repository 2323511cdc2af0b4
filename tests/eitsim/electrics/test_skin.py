"""From stretches to the sheet's conductance."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from eitsim.electrics.cem.assembly import SkinMesh, impedance, quadrature_points
from eitsim.mechanics.harmonics.arcs import OffsetDisc
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import STRAINS, Body, Punch, Skin
from eitsim.sheet.layer_conductivity import referred_conductivity
from eitsim.sheet.sheet_conductance import (
    FoldedSkin,
    areal_stretch,
    changes,
    conductance_of,
    driving_strain,
    extrapolated_fraction,
    extrapolated_share,
    local_axes,
    moved,
    principal_conductances,
    sheet_conductance,
    stretches,
    surface_metric,
    untouched_conductance,
)
from matcal.laws.conductivity import Conductivity, conductivity, strip_conductivity

LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
SKIN = Skin(strain="normal")


def touch(radius, meridian, hoop, normal) -> Touch:
    """Synthetic surface stretches; what the mechanics adds is left at nought."""
    r = np.asarray(radius, dtype=float)
    fields = [np.broadcast_to(np.asarray(f, dtype=float), r.shape) for f in (meridian, hoop, normal)]
    return Touch(r, 0 * r, 0 * r, *fields, 0 * r, 7e-3, *[0.0] * 9, 0, (), 0.0)


def strip(length: float, width: float, cells: int = 6) -> SkinMesh:
    """Quadrilaterals of a strip with an electrode on either end."""
    x, y = np.meshgrid(np.linspace(0, length, 2 * cells + 1), np.linspace(0, width, 5), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    corners = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
    cells_ = np.column_stack([number[i: i + 2 * cells - 1: 2, j: j + 3: 2].ravel() for i, j in corners])
    ends = np.concatenate([np.column_stack([n[:-1:2], n[2::2], n[1::2]]) for n in (number[0], number[-1])])
    return SkinMesh(np.column_stack([x.ravel(), y.ravel()]), cells_, ends, np.array([0, 0, 1, 1]), 2, "Q2")


@pytest.mark.parametrize("strain", ["principal", "areal"])
@pytest.mark.parametrize("e", [0.0, 0.1, 0.35])
def test_a_stretched_strip_has_the_resistance_that_calibration_read(strain, e):
    """Uniaxial tension without contraction, length L_0 and width w at rest, contacts taken off the reading."""
    length, width, thickness, contact = 0.075, 0.025, 20e-6, 0.5
    mesh = strip(length, width)
    along, across = principal_conductances(LAW, Skin(thickness_m=thickness, strain=strain), 1 + e, 1.0, 1.0)
    tensor = np.broadcast_to(np.diag([float(along), float(across)]), (*quadrature_points(mesh).shape[:2], 2, 2))
    z = impedance(mesh, tensor, contact)
    resistance = z[0, 0] + z[1, 1] - z[0, 1] - z[1, 0] - 2 * contact / width
    read = float(strip_conductivity(resistance, e, length, width * thickness))
    assert read == pytest.approx(float(conductivity(LAW, e)), rel=1e-10)


def test_the_determinant_of_the_conductance_knows_no_stretch():
    along, across = principal_conductances(LAW, SKIN, 1.7, 0.6, 0.5)
    assert along * across == pytest.approx((float(conductivity(LAW, -0.5)) * 20e-6) ** 2, rel=1e-14)
    assert along / across == pytest.approx((0.6 / 1.7) ** 2, rel=1e-14)


def test_the_tensor_turns_with_the_direction_from_the_punch():
    pressed = touch([0.0, 0.05], 1.5, 0.9, 0.8)
    punch = Punch(x_m=0.01, y_m=-0.02)
    along, across = principal_conductances(LAW, SKIN, 1.5, 0.9, 0.8)
    for angle in (0.0, 0.7, 2.5):
        direction = np.array([math.cos(angle), math.sin(angle)])
        tensor = sheet_conductance(np.array([0.01, -0.02]) + 0.02 * direction, punch, pressed, SKIN, LAW)
        np.testing.assert_allclose(tensor, tensor.T)
        np.testing.assert_allclose(tensor @ direction, along * direction, rtol=1e-13)
        assert np.trace(tensor) == pytest.approx(float(along + across))


def test_interpolation_keeps_the_kink_of_an_edge_and_ends_at_rest():
    r = np.array([0.0, 2e-3, 6e-3, 7e-3, 7.2e-3, 9e-3])
    normal = np.array([0.6, 0.6, 0.5, 0.3, 1.0, 1.0])
    points = np.column_stack([np.linspace(0, 0.012, 500), np.zeros(500)])
    tensor = sheet_conductance(points, Punch(), touch(r, 1.0, 1.0, normal), SKIN, LAW)
    low, high = (float(conductivity(LAW, e)) * 20e-6 for e in (0.0, -0.7))
    assert tensor[..., 0, 0].min() >= low * (1 - 1e-14)
    assert tensor[..., 0, 0].max() <= high * (1 + 1e-14)
    np.testing.assert_allclose(tensor[points[:, 0] >= 7.2e-3] / low - np.eye(2), 0, atol=1e-14)
    np.testing.assert_allclose(tensor[points[:, 0] <= 2e-3, 0, 0], float(conductivity(LAW, -0.4)) * 20e-6, rtol=1e-14)


def test_the_strain_is_a_choice():
    assert driving_strain("normal", 1.2, 0.9, 0.7) == pytest.approx(-0.3)
    assert driving_strain("principal", 1.2, 0.9, 0.7) == pytest.approx(0.2)
    assert driving_strain("areal", 1.2, 0.9, 0.7) == pytest.approx(0.08)
    with pytest.raises(ValueError, match="known: normal, principal, areal"):
        driving_strain("hoop", 1.0, 1.0, 1.0)


def test_a_conductivity_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match="not positive"):
        principal_conductances(Conductivity(30.0, np.array([2.0, 0.0, 0.0])), SKIN, 1.0, 1.0, 0.4)


@pytest.mark.parametrize("x_m", [0.0, 0.06])
def test_the_extrapolated_area_is_that_of_the_compressed_disc(x_m):
    r = np.array([0.0, 0.01, 0.0100001, 0.09])
    pressed = touch(r, 1.0, 1.0, np.array([0.7, 0.7, 1.0 - 1e-6, 1.0]))
    fraction = extrapolated_fraction(Body(), Punch(x_m=x_m), pressed, SKIN, LAW)
    assert fraction == pytest.approx(0.01, rel=3e-3)
    assert extrapolated_fraction(Body(), Punch(x_m=x_m), pressed, Skin(strain="areal"), LAW) == 0
    assert untouched_conductance(LAW, SKIN) == pytest.approx(6e-4)


def test_the_extrapolated_share_of_the_signal_is_that_of_the_dipole_moment():
    """A pressed disc is the whole signal; of a disc in a stretched ring it is what closed forms of the moment give."""
    r = np.array([0.0, 0.01, 0.0100001, 0.02, 0.0200001, 0.09])
    pressed = touch(r, 1.0, 1.0, np.array([0.7, 0.7, 1.0, 1.0, 1.0, 1.0]))
    assert extrapolated_fraction(Body(), Punch(), pressed, SKIN, LAW) == pytest.approx(0.01, rel=3e-3)
    assert extrapolated_share([pressed], SKIN, LAW) > 0.999
    assert extrapolated_share([pressed], Skin(strain="principal"), LAW) == 0
    ringed = touch(r, 1.0, 1.0, np.array([0.7, 0.7, 1.2, 1.2, 1.0, 1.0]))
    inner, ring = (conductivity(LAW, e) / LAW.c0_S_per_m for e in (-0.3, 0.2))
    # f = r inside 10 mm and b r + c/r outside, its potential and current continuous there
    parts = abs(inner - 1), abs(ring - 1) * (1 + inner / ring) / 2 * (4 - 1)
    assert extrapolated_share([ringed], SKIN, LAW) == pytest.approx(parts[0] / sum(parts), rel=2e-3)
    assert extrapolated_share([touch([0.0, 0.1], 1.0, 1.0, 1.0)], SKIN, LAW) == 0


def test_an_area_beyond_the_rim_does_not_count():
    pressed = touch([0.0, 0.3], 1.0, 1.0, 0.7)
    assert extrapolated_fraction(Body(), Punch(x_m=0.05), pressed, SKIN, LAW) == pytest.approx(1.0, abs=1e-3)


def rim_field(towards: np.ndarray | None) -> RimField:
    """Rough changes on circles that the rim, 20 mm away from the axis, cuts from there on."""
    rng = np.random.default_rng(8)
    radius, share = np.array([1e-3, 5e-3, 12e-3, 25e-3, 40e-3]), np.linspace(0, 1, 7)**1.3
    metric = np.array([1.0, 0.0, 1.0]) + 0.2 * rng.uniform(-1, 1, (5, 7, 3))
    return RimField(radius, share, 1e-3 * rng.normal(size=(5, 7, 3)), metric, 1 + 0.2 * rng.uniform(-1, 1, (5, 7)),
                    0.1, 0.08, towards, neighbour=towards is not None)


def sampled(rim: RimField, local: np.ndarray, samples: np.ndarray, unchanged: np.ndarray) -> np.ndarray:
    """Array by array, what the compiled loop does point by point."""
    radius = np.linalg.norm(local, axis=-1)
    start, angle = OffsetDisc(rim.disc_m, rim.offset_m).start(radius), np.arctan2(np.abs(local[..., 1]), local[..., 0])
    share = np.clip((angle - start) / (np.pi - start), 0, 1)
    on_circles = np.moveaxis(CubicSpline(rim.share, samples, axis=1)(share), 0, -2)
    inside = np.clip(radius, *rim.radius_m[[0, -1]])
    ring = np.clip(np.searchsorted(rim.radius_m, inside, side="right"), 1, len(rim.radius_m) - 1) - 1
    way = ((inside - rim.radius_m[ring]) / np.diff(rim.radius_m)[ring])[:, None]
    at = np.arange(len(local))
    found = (1 - way) * on_circles[at, ring] + way * on_circles[at, ring + 1]
    none = radius > rim.radius_m[-1]
    return np.where((none if not rim.neighbour else none | (angle < start - 1e-9))[:, None], unchanged, found)


@pytest.mark.parametrize("towards", [None, np.array([0.6, 0.8])])
def test_the_compiled_metric_is_that_of_whole_arrays(towards):
    punch, rng = Punch(0.048, -0.064), np.random.default_rng(9)
    rim, radius = rim_field(towards), np.linspace(0, 50e-3, 30)
    pressed = replace(touch(radius, 1 + 0.3 * np.cos(90 * radius), 1 - 0.2 * np.cos(70 * radius), 1.1), rim=rim)
    points = np.vstack([[[punch.x_m, punch.y_m]], np.array([punch.x_m, punch.y_m])
                        + 30e-3 * rng.uniform(-1, 1, (400, 2)) * [1, 1.6]])
    axes = local_axes(punch, pressed)
    local = (points - points[0]) @ axes.T
    sign = np.where(local[:, 1] < 0, -1, 1)
    xx, xy, yy, factor = sampled(rim, local, np.concatenate([rim.metric, rim.normal[..., None]], axis=-1),
                                 np.array([1.0, 0, 1, 1])).T
    change = np.moveaxis(np.array([[xx, sign * xy], [sign * xy, yy]]), -1, 0)
    np.testing.assert_allclose(changes(rim, local)[0], change, rtol=0, atol=1e-13)
    shift = sampled(rim, local, rim.displacement_m, np.zeros(3)) * np.column_stack([sign**2, sign, sign**2])
    np.testing.assert_allclose(moved(rim, local), shift, rtol=0, atol=1e-15)
    meridian, hoop, normal = stretches(pressed, np.linalg.norm(local, axis=1))
    radial = np.where(local.any(axis=1)[:, None], local, [1.0, 0.0])
    radial /= np.linalg.norm(radial, axis=1)[:, None]
    stretch = hoop[:, None, None] * np.eye(2) + (meridian - hoop)[:, None, None] * radial[:, :, None] * radial[:, None]
    metric, stretch_normal = surface_metric(points, punch, pressed)
    np.testing.assert_allclose(metric, axes.T @ stretch @ change @ stretch @ axes, rtol=0, atol=1e-13)
    np.testing.assert_allclose(stretch_normal, normal * factor, rtol=0, atol=1e-13)
    assert 0 < np.mean(xx == 1) < 0.5


def test_the_metric_of_a_touch_far_from_the_rim_has_its_stretches_as_axes():
    """C_s n = l_m^2 n away from the punch and C_s t = l_h^2 t across."""
    pressed, punch = touch([0.0, 0.05], 1.5, 0.9, 0.8), Punch(x_m=0.01, y_m=-0.02)
    for angle in (0.0, 0.7, 2.5):
        away = np.array([math.cos(angle), math.sin(angle)])
        metric, normal = surface_metric(np.array([0.01, -0.02]) + 0.02 * away, punch, pressed)
        np.testing.assert_allclose(metric @ away, 1.5**2 * away, atol=1e-13)
        np.testing.assert_allclose(metric @ [-away[1], away[0]], 0.9**2 * np.array([-away[1], away[0]]), atol=1e-13)
        assert normal == pytest.approx(0.8)


def test_a_surface_that_turns_over_is_refused_by_name():
    """A metric of negative determinant has no area; one of a stretched surface has the product of its stretches."""
    stretched = np.diag([1.2**2, 0.9**2])[None]
    assert areal_stretch(stretched) == pytest.approx(1.2 * 0.9)
    folded = np.array([[0.93, 0.43], [0.43, 0.17]])[None]
    with pytest.raises(FoldedSkin, match=r"folds at 1 of 2 points.*Move the punch inwards"):
        areal_stretch(np.concatenate([stretched, folded]))


def test_a_layer_conducts_along_its_stretches_on_its_untouched_shape() -> None:
    """A stretched block of lengths l_k carries s_k l_i l_j/l_k, and axes turn with it; without any piezoresistance it
    conducts as a body of constant conductivity."""
    rng = np.random.default_rng(4)
    before, after = np.linalg.qr(rng.normal(size=(2, 5, 3, 3)))[0]
    stretch = rng.uniform(0.6, 1.5, (5, 3))
    gradient = after * stretch[:, None] @ np.swapaxes(before, 1, 2)
    still, log = Conductivity(30.0, np.zeros(3), (0.0, 0.4)), np.log(stretch)
    for along, across in ((0.0, 0.0), (3.0, -1.2)):
        skin = Skin(strain="piezoresistive", along=along, across=across)
        relative = 30 * np.exp(-along * log - across * (log.sum(axis=1, keepdims=True) - log))
        shape = stretch.prod(axis=1, keepdims=True) / stretch**2
        expected = before * (relative * shape)[:, None] @ np.swapaxes(before, 1, 2)
        assert referred_conductivity(still, skin, gradient) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    for strain in ("volume", "principal"):
        found = referred_conductivity(still, Skin(strain=strain), gradient)
        assert found == pytest.approx(referred_conductivity(still, Skin(strain="piezoresistive"), gradient), rel=1e-9)
        e = stretch.prod(axis=1) - 1 if strain == "volume" else stretch.max(axis=1) - 1
        ratio = referred_conductivity(LAW, Skin(strain=strain), gradient) / found
        assert ratio == pytest.approx(np.broadcast_to((conductivity(LAW, e) / 30)[:, None, None], (5, 3, 3)), rel=1e-8)


@pytest.mark.parametrize("strain", STRAINS)
def test_a_metric_conducts_by_the_stretches_along_its_axes(strain: str) -> None:
    """Along each axis of C_s = l_1^2 a a' + l_2^2 b b' what `principal_conductances` says of l_1 and l_2."""
    rng = np.random.default_rng(0)
    stretch, normal, skin = rng.uniform(0.7, 1.4, (6, 2)), rng.uniform(0.6, 1.1, 6), Skin(strain=strain)
    axes = np.array([[[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]] for a in rng.uniform(0, np.pi, 6)])
    found = conductance_of(np.einsum("nik,nk,njk->nij", axes, stretch**2, axes), normal, skin, LAW)
    expected = np.stack(principal_conductances(LAW, skin, *stretch.T, normal), axis=-1)
    assert found == pytest.approx(np.einsum("nik,nk,njk->nij", axes, expected, axes), rel=1e-12)
