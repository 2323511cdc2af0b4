"""The mesh of the foam: sizes where they are promised, quadrature that sums to the volume, numbers of a narrow band."""

import math

import numpy as np
import pytest

from eitsim.mechanics.solid.grid import (
    _DOWNWARDS,
    _OUTWARDS,
    _WIDEST,
    _WIDEST_UNDER_TIP,
    default_element_m,
    feature_m,
    foam_grid,
    lagrange,
    spread,
    tensor_grid,
)
from eitsim.scene.edges.disc import Disc
from eitsim.scene.scene import Body, Punch

BODY, PUNCH, ELEMENT_m = Body(), Punch(), 0.12e-3


def test_an_element_at_the_edge_of_the_punch_is_as_large_as_asked_for() -> None:
    """The lines lie at the edge and its radius inwards; the columns next to the edge and the topmost row measure
    element_m there, a little less for rounding the count up and a little more for their own growth."""
    radii, heights = foam_grid(BODY, PUNCH, ELEMENT_m, order=1).lines
    size, edge = ELEMENT_m / BODY.thickness_m, PUNCH.diameter_m / 2 / BODY.thickness_m
    at = int(np.argmin(np.abs(radii - edge)))
    assert radii[at] == pytest.approx(edge, abs=1e-12)
    assert np.abs(radii - (edge - PUNCH.fillet_m / BODY.thickness_m)).min() < 1e-12
    steps = np.diff(radii)
    assert 0.8 * size < steps[at - 1] <= 1.001 * size
    assert steps[at] == pytest.approx(size, rel=0.25)
    assert -heights[-2] == pytest.approx(size, rel=0.25)
    assert (radii[0], radii[-1]) == (0.0, pytest.approx(BODY.radius_m / BODY.thickness_m))
    assert (heights[0], heights[-1]) == (-1.0, 0.0)


def test_elements_widen_with_the_distance_and_all_halve_together() -> None:
    """Half the size, twice the elements between any two lines, to rounding; outwards and downwards none is smaller than
    the one before."""
    grids = [foam_grid(BODY, PUNCH, ELEMENT_m / k, order=1).lines for k in (1, 2, 4)]
    edge = PUNCH.diameter_m / 2 / BODY.thickness_m
    for part in (lambda r, z: r[r < edge - 1e-9], lambda r, z: r[r > edge + 1e-9], lambda r, z: z):
        one, two, four = (part(*lines).size for lines in grids)
        assert two == pytest.approx(2 * one, abs=3)
        assert four == pytest.approx(4 * one, abs=7)
    radii, heights = grids[0]
    assert np.all(np.diff(np.diff(radii[radii >= edge - 1e-9])) > 0)
    assert np.all(np.diff(np.diff(heights)) < 0)


def test_elements_beyond_the_edge_double_where_the_grid_says() -> None:
    """Widths h (1 + x/w) at x from the edge, where they double over w: w ln(1 + L/w)/h of them fill L."""
    radii, heights = foam_grid(BODY, PUNCH, ELEMENT_m, order=1).lines
    size, feature = ELEMENT_m / BODY.thickness_m, feature_m(BODY, PUNCH) / BODY.thickness_m
    edge = PUNCH.diameter_m / 2 / BODY.thickness_m
    rows, columns = (math.ceil(w * math.log1p(far / w) / size - 1e-3) for w, far in (
        (_DOWNWARDS * feature, 1.0), (_OUTWARDS * feature, radii[-1] - edge)))
    assert heights.size - 1 == rows
    assert np.count_nonzero(radii > edge + 1e-9) == columns


def test_even_elements_lie_outside_the_edge_before_they_widen() -> None:
    """Over a feature of 0.5 mm as many as its length over the element size, rounded up, none wider; inside the edge
    nothing changes."""
    plain, even = (foam_grid(BODY, PUNCH, ELEMENT_m, order=1, even=e).lines for e in (0.0, 1.0))
    size, feature = ELEMENT_m / BODY.thickness_m, feature_m(BODY, PUNCH) / BODY.thickness_m
    edge = PUNCH.diameter_m / 2 / BODY.thickness_m
    assert np.array_equal(plain[1], even[1])
    before, inside = (r[r < edge + 1e-9] for r in (plain[0], even[0]))
    assert np.array_equal(before, inside)
    outside = even[0][even[0] > edge - 1e-9]
    widths = np.diff(outside)
    assert np.allclose(widths[outside[1:] < edge + feature], size, rtol=0.03)
    assert np.all(np.diff(widths[outside[1:] > edge + feature]) > 0)


@pytest.mark.parametrize(("profile", "widest"), [("flat", _WIDEST), ("cone", _WIDEST_UNDER_TIP)])
@pytest.mark.parametrize("base", [0.0, 0.6])
def test_elements_under_a_large_punch_are_as_wide_as_they_may_be_in_foam_of_any_size(profile: str, widest: float,
                                                                                    base: float) -> None:
    grids = []
    for k in (1.0, 7.0):
        body = Body(Disc(0.1 * k), 0.01 * k, 0.01 * k * base)
        punch = Punch(diameter_m=0.1 * k, fillet_m=0.001 * k, profile=profile)
        grids.append(foam_grid(body, punch, default_element_m(body, punch), order=1))
    one, other = (grid.lines for grid in grids)
    steps = np.diff(one[0][one[0] < 4.9])
    assert 0.85 * widest * (1 - base) < steps.max() < 1.001 * widest * (1 - base)
    for here, there in zip(one, other, strict=True):
        assert there == pytest.approx(here, rel=1e-9, abs=1e-12)


def test_elements_are_least_where_the_contact_ends() -> None:
    """Even over half a feature on either side of a known end, wider elsewhere, inside a sixteenth of its radius at
    most; all halve together."""
    punch, end_m = Punch(profile="sphere", fillet_m=PUNCH.diameter_m / 2), 3.3e-3
    size, feature, end = (length / BODY.thickness_m for length in (0.06e-3, feature_m(BODY, punch), end_m))
    plain, radii, halved = (foam_grid(BODY, punch, element_m, order=1, end_m=at).lines[0] for element_m, at in (
        (0.06e-3, None), (0.06e-3, end_m), (0.03e-3, end_m)))
    middle, widths = (radii[1:] + radii[:-1]) / 2, np.diff(radii)
    about = np.abs(middle - end) < feature / 2 - size
    assert np.allclose(widths[about], size, rtol=0.03)
    assert np.all(widths[~about] > 0.97 * size)
    assert widths[middle < end].max() < 1.03 * end / 16
    assert widths[0] > 2 * size
    assert radii.size < 0.6 * plain.size
    assert halved.size - 1 == pytest.approx(2 * (radii.size - 1), abs=4)


def test_the_feature_is_the_fillet_or_a_twentieth_of_the_thickness() -> None:
    assert feature_m(BODY, Punch(fillet_m=0.2e-3)) == 0.2e-3
    assert feature_m(Body(thickness_m=4e-3), Punch(fillet_m=0.4e-3)) == pytest.approx(0.2e-3)
    assert default_element_m(BODY, Punch(fillet_m=0.2e-3)) == pytest.approx(0.4 * default_element_m(BODY, PUNCH))


@pytest.mark.parametrize("plane", [True, False])
@pytest.mark.parametrize("order", [1, 2])
def test_quadrature_sums_to_the_volume_and_gradients_are_exact(order: int, plane: bool) -> None:
    """Of u = r^p z: volume pi r^2 h or r h, N_,r, N_,z and N/r give its derivatives and u/r at the Gauss points."""
    r, z = np.array([0.0, 0.3, 0.7]), np.array([-0.2, 0.5, 1.3])
    grid = tensor_grid(r, z, plane=plane, order=order)
    assert grid.weight.sum() == pytest.approx(0.7 * 1.5 if plane else np.pi * 0.7**2 * 1.5)
    assert grid.order == order
    radius, height = (grid.nodes[grid.elements][..., k] for k in (0, 1))
    slope = np.einsum("eqnk,en->eqk", grid.gradient, radius**order * height)
    low, high = height.min(axis=1), height.max(axis=1)
    by_height = np.einsum("eqnk,en->eqk", grid.gradient, height)
    assert by_height[..., 1] == pytest.approx(np.ones_like(by_height[..., 1]))
    assert by_height[..., 0] == pytest.approx(np.zeros_like(by_height[..., 0]), abs=1e-10)
    first = np.einsum("eqnk,en->eqk", grid.gradient, radius**order)[..., 0]
    if not plane:
        hoop = np.einsum("eqnk,en->eqk", grid.gradient, radius)[..., 2]
        assert hoop == pytest.approx(np.ones_like(hoop))
        assert slope[..., 0] / slope[..., 2] == pytest.approx(np.full(slope.shape[:2], order))
    assert np.all((slope[..., 0] / first > low[:, None]) & (slope[..., 0] / first < high[:, None]))


@pytest.mark.parametrize("order", [1, 2])
def test_numbers_and_band(order: int) -> None:
    """Unknowns count up over what is free, the bottom and the axis' radial parts are not; the band is the largest
    distance within an element."""
    grid = tensor_grid(np.linspace(0, 1, 4), np.linspace(-1, 0, 3), order=order)
    held = grid.nodes[:, 1] == -1
    assert np.all(grid.unknown[held] == -1)
    assert np.all(grid.unknown[~held & (grid.nodes[:, 0] == 0), 0] == -1)
    free = grid.unknown[grid.unknown >= 0]
    assert free.tolist() == list(range(grid.unknowns))
    assert grid.unknowns == 2 * len(grid.nodes) - 2 * (3 * order + 1) - 2 * order
    inside = grid.unknown[grid.elements[:, 8:]].ravel()
    assert sorted([*grid.outer, *inside]) == list(range(grid.unknowns))
    assert grid.outer[grid.place[grid.place >= 0]].tolist() == free[~np.isin(free, inside)].tolist()
    spans = [np.ptp(places[places >= 0]) for places in grid.place[grid.elements].reshape(len(grid.elements), -1)]
    assert grid.bandwidth == max(spans)
    assert np.all(grid.nodes[grid.top, 1] == 0)
    assert grid.nodes[grid.top[:, 0], 0].tolist() == pytest.approx([0, 1 / 3, 2 / 3])
    corners = grid.nodes[grid.counter_clockwise[:, :4]]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1]
    assert np.all(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] > 0)
    free_grid = tensor_grid(np.linspace(0, 1, 4), np.linspace(-1, 0, 3), order=order, free=True)
    assert free_grid.unknowns == 2 * len(free_grid.nodes)


@pytest.mark.parametrize("order", [1, 2])
def test_shape_functions_interpolate_polynomials(order: int) -> None:
    t = np.linspace(-0.9, 0.8, 5)
    value, slope = lagrange(order, t)
    nodes = np.linspace(-1, 1, order + 1)
    for power in range(order + 1):
        assert value @ nodes**power == pytest.approx(t**power)
        assert slope @ nodes**power == pytest.approx(power * t ** max(power - 1, 0), abs=1e-12)


def test_points_are_spread_in_proportion_to_a_width() -> None:
    """Width 0.1 (1 + x) from 0 to 3: 10 ln 4 = 13.9 steps, so 14 in a geometric row; whole counts stay whole."""
    found = spread(0.0, 3.0, lambda x: 0.1 * (1 + x))
    assert found == pytest.approx(4.0 ** (np.arange(1, 15) / 14) - 1, abs=1e-5)
    assert spread(1.0, 2.0, lambda x: np.full_like(x, 0.25)) == pytest.approx([1.25, 1.5, 1.75, 2.0])
    assert spread(1.0, 2.0, lambda x: np.full_like(x, 5.0)).tolist() == [2.0]
