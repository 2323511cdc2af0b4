"""Several touches: their electrics on two independent ways, superposition, symmetry, what is refused."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import gradients, impedance, quadrature_points
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.mesh.graded_mesh import triangulation
from eitsim.electrics.mesh.ring_mesh import template
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.drive import read_out
from eitsim.scene.results import Readings, Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import (
    principal_conductances,
    sheet_conductance,
    surface_metric,
    touched_conductance,
)
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
SKIN, SHEET = Skin(), 6e-4
Touches = tuple[tuple[Punch, Touch], ...]


@lru_cache(maxsize=4)
def solved(diameter_m: float, force_N: float) -> Touch:
    return solve_touch(FOAM, Body(), Punch(diameter_m=diameter_m, force_N=force_N))


def at(x_mm: float, y_mm: float, diameter_m: float = 0.014, force_N: float = 1.0) -> tuple[Punch, Touch]:
    return Punch(x_mm / 1e3, y_mm / 1e3, diameter_m, force_N), solved(diameter_m, force_N)


def readings(*touches: tuple[Punch, Touch], method: str = "auto", signal: float = 0.002,
             skin: Skin = SKIN) -> Readings:
    return solve(Body(), skin, Electrodes(), Drive(), touches, LAW, signal=signal, method=method)


def on_triangles(touches: Touches, level: int, conductance: np.ndarray | None = None, *,
                 skin: Skin = SKIN) -> np.ndarray:
    """dV from two solutions on one triangulation."""
    mesh = triangulation(Body(), Electrodes(), touches, level)
    if conductance is None:
        conductance = touched_conductance(quadrature_points(mesh), touches, skin, LAW)
    rest = np.full(len(mesh.cells), SHEET)
    return read_out(Drive(), impedance(mesh, conductance, 1.0, refinements=0) - impedance(mesh, rest, 1.0,
                                                                                          refinements=0))


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


PAIRS = {"apart": ((-40, 10), (40, -20, 0.010, 2.0)), "close": ((-8, 0), (8, 3)),
         "near the rim": ((84, 0), (-20, 0, 0.010, 2.0)), "three": ((0, 50), (-40, -20), (30, 0))}


def pair(name: str) -> Touches:
    return tuple(at(*touch) for touch in PAIRS[name])


@pytest.mark.parametrize("name", PAIRS)
def test_the_triangulation_covers_the_disc_with_circles_at_the_contacts(name):
    touches = pair(name)
    mesh = triangulation(Body(), Electrodes(), touches, 1)
    _, area = gradients(mesh, np.zeros((len(mesh.nodes_m), 1)))
    assert area.min() > 0
    assert area.sum() == pytest.approx(np.pi * 0.01, rel=1e-6)
    np.testing.assert_allclose(np.linalg.norm(mesh.nodes_m[mesh.under], axis=-1), 0.1, rtol=1e-14)
    for punch, _ in touches:
        radius = np.hypot(*(mesh.nodes_m - [punch.x_m, punch.y_m]).T)
        assert np.sum(np.abs(radius - punch.diameter_m / 2) < 1e-12) >= 64


def test_triangles_agree_with_the_rings_of_one_touch():
    touch = at(30, 10)
    mesh = template(Body(), Electrodes(), *touch, 4)
    tensor = sheet_conductance(quadrature_points(mesh), *touch, SKIN, LAW)
    rings = read_out(Drive(), impedance(mesh, tensor, 1.0) - impedance(mesh, np.full(len(mesh.cells), SHEET), 1.0))
    errors = [distance(on_triangles((touch,), level), rings) for level in (1, 2)]
    print("triangles of two levels against rings", errors)
    assert errors[1] < 0.002
    assert errors[0] > 2 * errors[1]


@pytest.mark.parametrize(("strain", "near"), [("normal", 0.002), ("principal", 0.004)])
def test_two_touches_scatter_as_on_a_mesh_and_each_estimate_is_honest(strain, near):
    """Strain in plane reaches further from a punch than that through the thickness."""
    skin = Skin(strain=strain)
    for gap_mm, bound in ((20, near), (45, 5e-4)):
        touches = at(-7 - gap_mm / 2, 10), at(7 + gap_mm / 2, 10)
        got, mesh = readings(*touches, method="multipole", skin=skin), on_triangles(touches, 3, skin=skin)
        alone = np.sum([readings(t, skin=skin).signal_V for t in touches], axis=0)
        true = distance(got.signal_V, mesh)
        print(f"gap {gap_mm} mm: {true:.1e} off, estimate {got.signal_error:.1e}; the sum of single touches is "
              f"{distance(alone, mesh):.1e} off")
        assert true < bound
        assert true / 2 < got.signal_error < 5 * true
        assert distance(alone, mesh) > 5 * true


def test_the_sum_of_single_signals_is_approached_with_the_square_of_the_distance():
    """Each touch turns the field about the other by its dipole, which falls as distance^-2."""
    gaps = []
    for x in (20.0, 40.0):
        touches = at(-x, 0), at(x, 0)
        together = readings(*touches, method="multipole").signal_V
        gaps.append(distance(np.sum([readings(t).signal_V for t in touches], axis=0), together))
    print(gaps)
    assert 2.5 < gaps[0] / gaps[1] < 6


def test_the_order_of_touches_does_not_matter():
    one, other = at(-30, 10), at(25, -20, 0.010, 2.0)
    first, second = readings(one, other), readings(other, one)
    np.testing.assert_allclose(first.impedance_Ohm, second.impedance_Ohm, rtol=1e-11)
    assert first.skin_fraction_extrapolated == pytest.approx(second.skin_fraction_extrapolated)


@pytest.mark.parametrize("method", ["multipole", "mesh"])
def test_two_equal_touches_facing_each_other_give_mirrored_readings(method):
    got = readings(at(30, 20), at(30, -20), method=method, signal=0.05).impedance_Ohm
    mirror = -np.arange(16) % 16
    assert distance(got[np.ix_(mirror, mirror)], got) < 1e-5
    assert np.abs(got - got.T).max() < 1e-12 * np.abs(got).max()


def test_close_touches_and_several_near_the_rim_take_the_mesh():
    assert readings(at(-9, 0), at(9, 0), signal=0.01).method == "mesh"
    near = readings(at(88, 0), at(-20, 0), signal=0.005)
    assert near.method == "mesh"
    assert near.signal_error < 0.005


def test_two_conducting_punches_shunt_like_metal_discs():
    touches = tuple((Punch(p.x_m, p.y_m, p.diameter_m, p.force_N, conductor=True, contact_impedance_Ohm_m2=1e-9), t)
                    for p, t in (at(-25, 0), at(25, 10)))
    got = readings(*touches)
    mesh = triangulation(Body(), Electrodes(), touches, 2)
    points = quadrature_points(mesh)
    tensor = touched_conductance(points, touches, SKIN, LAW)
    for punch, touch in touches:
        distance_m = np.hypot(points[..., 0] - punch.x_m, points[..., 1] - punch.y_m)
        tensor[distance_m < touch.contact_radius_m] += 1e2 * np.eye(2)
    assert distance(got.signal_V, on_triangles(touches, 2, tensor)) < 0.01


def test_the_surfaces_metric_conducts_as_its_stretches_do():
    touch = at(20, 30)
    points = np.random.default_rng(0).uniform(-0.05, 0.05, (200, 2))
    metric, normal = surface_metric(points, *touch)
    first, second = np.moveaxis(np.sqrt(np.linalg.eigvalsh(metric)), -1, 0)
    tensor = sheet_conductance(points, *touch, SKIN, LAW)
    sheets = np.sort(principal_conductances(LAW, SKIN, first, second, normal), axis=0)
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor), sheets.T, rtol=1e-12)
    product = metric @ tensor
    np.testing.assert_allclose(product, np.swapaxes(product, -1, -2), atol=1e-15)


def test_touches_that_overlap_are_refused():
    with pytest.raises(ValueError, match="overlap by"):
        readings(at(-5, 0), at(5, 0))
    with pytest.raises(ValueError, match="overlap by"):
        readings(at(-5, 0), at(5, 0), method="mesh")
    with pytest.raises(ValueError, match="no touch"):
        readings()


@pytest.mark.parametrize("gap_m", [0.0, 1e-12])
def test_no_mesh_is_sought_without_end_where_a_punch_touches_the_rim(gap_m: float) -> None:
    touching = at(93, 0)
    touching = replace(touching[0], x_m=0.1 - 0.007 - gap_m), touching[1]
    with pytest.raises(ValueError, match="touches the rim"):
        triangulation(Body(), Electrodes(), (touching,), 1)
