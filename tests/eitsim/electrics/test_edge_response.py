"""What the edges of an outline send back to circles: the disc's, converging, free of a choice of circle."""

import itertools

import numpy as np
import pytest

from eitsim.electrics.cem.boundary_integral import HARMONICS, solve_rim
from eitsim.electrics.cem.ring_scattering import Coupling, impedance_change, on_disc
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.outline.adapted_mesh import solve_untouched
from eitsim.electrics.outline.edge_response import coupling, edge_responses, order_of_halving, response_on
from eitsim.electrics.outline.triangles import refined, skin_mesh, triangulated
from eitsim.scene.drive import as_tuples
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.scene import Body, Electrodes, Scene

S, ORDERS = 6e-4, 8
TURN = 2 * np.pi * np.arange(1000) / 1000
POLYGON = Body(Outline("polygon", points_m=as_tuples(0.1 * np.column_stack([np.cos(TURN), np.sin(TURN)]))))
EVEN = Scene(POLYGON).electrodes
PAIR = [(0.04 + 0.02j, 0.03), (-0.03 - 0.01j, 0.025)]


def off(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def parts(found: Coupling) -> tuple[np.ndarray, ...]:
    return found.incoming, found.same, found.crossed


@pytest.mark.slow
def test_edges_of_a_polygon_couple_circles_as_the_rim_of_the_disc_does():
    disc = on_disc(solve_rim(Body(), Electrodes(), S), Body(), Electrodes(), PAIR, ORDERS, HARMONICS)
    best, ((rougher, _), _) = edge_responses(POLYGON.outline, EVEN, S)
    coarse, fine = (coupling(one, PAIR, ORDERS) for one in (rougher, best))
    for rough, found, known in zip(parts(coarse), parts(fine), parts(disc), strict=True):
        print(f"{off(rough, known):.1e} {off(found, known):.1e}")
        assert off(found, known) < 1e-4
    np.testing.assert_array_equal(fine.order, disc.order)


@pytest.mark.slow
def test_the_mesh_of_the_edges_converges_about_a_circle_that_touches_one():
    """The mesh leaves less than a third of what a rougher one does of the change of the impedance matrix."""
    body = Body(Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((-0.03, 0.0, 0.006),)))
    electrodes, circles = Electrodes(count=12, width_m=0.006), [(0.02 + 0.02j, 0.02)]
    tau = np.array([-0.5 * 0.16**m for m in range(1, ORDERS + 1)])
    best, ((arrives, share), (returns, left)) = edge_responses(body.outline, electrodes, S)
    roughly, first, second = (impedance_change(coupling(one, circles, ORDERS), S, tau)
                              for one in (arrives, returns, best))
    known = on_finer(body, electrodes, circles, tau)
    stated = share * off(roughly, second) + left * off(first, second)
    print(f"{off(roughly, known):.1e} {off(first, known):.1e} {off(second, known):.1e}, stated {stated:.1e}")
    assert off(second, known) < min(2e-4, off(roughly, known) / 3, 2 * stated)
    np.testing.assert_allclose(second, second.T, atol=1e-9 * np.abs(second).max())


def on_finer(body: Body, electrodes: Electrodes, circles: list[tuple[complex, float]], tau: np.ndarray) -> np.ndarray:
    mesh = skin_mesh(solve_untouched(body.outline, electrodes, S, 3e-6).triangles, electrodes)
    response = response_on(uniform_refinement(mesh), mesh, S, contact_impedances(electrodes))
    return impedance_change(coupling(response, circles, len(tau)), S, tau)


@pytest.mark.parametrize("reach", [0.03, 0.02, 0.012])
def test_a_circle_of_any_size_about_a_scatterer_has_its_change(reach):
    """tau_m of a disc inside goes as reach^-2m."""
    body, electrodes = Body(Outline("rectangle", width_m=0.12, height_m=0.08)), Electrodes(count=12, width_m=0.006)
    response, m = edge_responses(body.outline, electrodes, S)[0], np.arange(1, ORDERS + 1)
    one, other = (impedance_change(coupling(response, [(0.01 + 0.005j, r)], ORDERS), S,
                                   np.array(-0.6 * (0.01 / r) ** (2 * m), float)) for r in (reach, 0.025))
    np.testing.assert_allclose(one, other, atol=1e-10 * np.abs(other).max())


L = Body(Outline("polygon", points_m=((0, 0), (0.12, 0), (0.12, 0.05), (0.05, 0.05), (0.05, 0.12), (0, 0.12))))


@pytest.mark.parametrize(("body", "order"), [
    (Body(Outline("rectangle", width_m=0.12, height_m=0.08)), 2.0), (POLYGON, 2.0), (L, 4 / 3),
    (Body(Outline("rectangle", width_m=0.12, height_m=0.08,
        holes_m=(((0.0, 0.0), (0.02, 0.0), (0.0, 0.02)),))), 8 / 7)])
def test_the_sharpest_corner_gives_the_order_of_halving(body, order):
    assert order_of_halving(body.outline) == pytest.approx(order, rel=1e-12)


def test_even_meshes_of_an_l_converge_as_its_corner_asks():
    """What comes back to a circle, on a mesh and halved once and twice: the changes fall as the order says."""
    lines = Scene(L, electrodes=Electrodes(count=8, width_m=0.006)).electrodes
    z, circle = contact_impedances(lines), [(0.035 + 0.035j, 0.018)]
    meshes = [skin_mesh(refined(triangulated(L.outline, lines), lambda places_m: np.full(len(places_m), 2e-5)), lines)]
    for _ in range(2):
        meshes.append(uniform_refinement(meshes[-1]))
    found = [coupling(response_on(meshes[0], mesh, S, z), circle, ORDERS).same for mesh in meshes]
    first, second = (np.linalg.norm(fine - coarse) for coarse, fine in itertools.pairwise(found))
    print(f"{first / second:.2f}, {2 ** order_of_halving(L.outline):.2f}")
    assert first / second == pytest.approx(2 ** order_of_halving(L.outline), rel=0.25)
