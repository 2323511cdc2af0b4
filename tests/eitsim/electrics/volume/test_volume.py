"""The complete electrode model in a volume: series solutions, another formulation on the same mesh, the thin limit."""

import itertools

import numpy as np
import pytest
from skfem import MeshTet

from eitsim.electrics.cem.assembly import SkinMesh
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.mesh.ring_mesh import patch_radii, rim_angles, ring_mesh
from eitsim.electrics.volume.extruded_mesh import extruded, graded_heights
from eitsim.electrics.volume.volume_cem import VolumeMesh, volume_impedance
from eitsim.scene.edges.disc import Disc
from eitsim.scene.scene import Body, Electrodes

SIGMA = 7.0  # S/m
SIZE_M, THICK_M = (0.06, 0.04), 0.005
WIDE_M = 0.006
PLACES_M = np.array([[0.013, 0.013], [0.047, 0.013], [0.013, 0.029], [0.043, 0.029]])


def lines(places: np.ndarray, size: float, between: int = 7) -> np.ndarray:
    """Lines across a slab, finer towards the ends of electrodes."""
    stops = np.unique(np.concatenate([[0.0, size], places - WIDE_M / 2, places + WIDE_M / 2]).round(9))
    fine = (1 - np.cos(np.pi * np.linspace(0, 1, between + 1)[:-1])) / 2
    return np.append(np.concatenate([a + (b - a) * fine for a, b in itertools.pairwise(stops)]), size)


def slab() -> SkinMesh:
    """Quadrilaterals of a slab with square electrodes on it."""
    x, y = (lines(np.unique(PLACES_M[:, i]), SIZE_M[i]) for i in (0, 1))
    fine = [np.interp(np.arange(2 * len(v) - 1) / 2, np.arange(len(v)), v) for v in (x, y)]
    nodes = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(nodes)).reshape(len(fine[0]), len(fine[1]))
    corners = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
    cells = np.column_stack([number[i:i + 2 * len(x) - 3:2, j:j + 2 * len(y) - 3:2].ravel() for i, j in corners])
    middle = nodes[cells[:, 8]]
    inside = np.all(np.abs(middle[:, None] - PLACES_M) < WIDE_M / 2, axis=2)
    cell, electrode = np.nonzero(inside)
    return SkinMesh(nodes, cells, cells[cell], electrode, len(PLACES_M), "Q2")


def series(places_m: np.ndarray, thick_m: float, modes: int = 500) -> np.ndarray:
    """Mean potentials (n, n), Ohm, under square electrodes on a slab by an even current density of 1 A into each, less
    a constant."""
    k = [np.pi * np.arange(modes) / size for size in SIZE_M]
    gamma = np.hypot(k[0][:, None], k[1])
    gamma[0, 0] = 1.0
    factor = np.where(np.arange(modes) > 0, 2.0, 1.0)
    weight = factor[:, None] * factor / (SIGMA * np.prod(SIZE_M) * gamma)
    weight /= np.tanh(gamma * thick_m)
    weight[0, 0] = 0.0
    mean = [np.cos(np.outer(places_m[:, i], k[i])) * np.sinc(k[i] * WIDE_M / 2 / np.pi) for i in (0, 1)]
    return np.einsum("am,an,mn,bm,bn->ab", *mean, weight, *mean, optimize=True)


@pytest.mark.thorough
def test_a_slab_with_two_and_four_electrodes_has_the_readings_of_a_series():
    # contacts so poor that the current density under them is even; what they add to a reading is known exactly
    z = 5e4 * WIDE_M / SIGMA
    mesh = extruded(slab(), np.append(-THICK_M * (1 - np.sin(np.pi * np.arange(5) / 10)), 0.0), "top")
    found = volume_impedance(mesh, np.full(len(mesh.cells), SIGMA), z) - z / WIDE_M**2 * np.eye(4)
    exact, drive = series(PLACES_M, THICK_M), np.array([1.0, -1, 0, 0])
    for reading in (drive, [0, 0, 1, -1], [0, 1, 0, -1], [1, 0, -1, 0]):
        assert reading @ found @ drive == pytest.approx(reading @ exact @ drive, rel=1e-3)


def eidors_matrix(mesh: VolumeMesh, sigma: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Impedance matrix by linear tetrahedra as EIDORS forms it: gradients from the inverse of [1 x y z], contact
    matrices area/12 [[2 1 1] ...]/z, the mean of the electrodes at 0."""
    n, count = len(mesh.nodes_m), mesh.count
    whole = np.zeros((n + count, n + count))
    for cell, s in zip(mesh.cells, sigma, strict=True):
        corners = np.column_stack([np.ones(4), mesh.nodes_m[cell]])
        slope = np.linalg.inv(corners)[1:]
        whole[np.ix_(cell, cell)] += s * abs(np.linalg.det(corners)) / 6 * slope.T @ slope
    for face, k in zip(mesh.under, mesh.electrode, strict=True):
        a, b, c = mesh.nodes_m[face]
        area = np.linalg.norm(np.cross(b - a, c - a)) / 2
        whole[np.ix_(face, face)] += area / z[k] / 12 * (np.ones((3, 3)) + np.eye(3))
        whole[face, n + k] -= area / z[k] / 3
        whole[n + k, face] -= area / z[k] / 3
        whole[n + k, n + k] += area / z[k]
    bordered = np.zeros((n + count + 1,) * 2)
    bordered[:-1, :-1] = whole
    bordered[-1, n:-1] = bordered[n:-1, -1] = 1
    currents = np.zeros((n + count + 1, count))
    currents[n:-1] = np.eye(count) - 1 / count
    return np.linalg.solve(bordered, currents)[n:-1]


@pytest.mark.parametrize("seed", [0, 1])
def test_tetrahedra_of_a_thick_disc_agree_with_eidors_formulation(seed: int):
    t = np.linspace(-1, 1, 8)
    cube = MeshTet.init_tensor(t, t, np.linspace(-0.4, 0, 4))
    x, y, height = cube.p
    nodes = 0.05 * np.column_stack([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2), height])
    facets = cube.boundary_facets()
    faces = cube.facets[:, facets].T
    outer = np.max(np.abs(cube.p[:2, :][:, faces]), axis=0).min(axis=1) > 1 - 1e-9
    faces = faces[outer]
    angle = np.arctan2(*nodes[faces].mean(axis=1)[:, 1::-1].T) % (2 * np.pi)
    electrode = np.floor(angle / (2 * np.pi) * 8).astype(int)
    kept = np.random.default_rng(seed).uniform(size=len(faces)) < 0.7
    mesh = VolumeMesh(nodes, cube.t.T, faces[kept], electrode[kept], 8)
    rng = np.random.default_rng(seed)
    sigma, z = rng.uniform(0.5, 5, len(mesh.cells)), rng.uniform(1e-4, 1e-2, 8)
    exact = eidors_matrix(mesh, sigma, z)
    np.testing.assert_allclose(volume_impedance(mesh, sigma, z), exact, atol=1e-9 * np.abs(exact).max())


def disc(body: Body, electrodes: Electrodes, level: int, rings: int) -> SkinMesh:
    """Rings that narrow towards the rim, or the inner ends of patches."""
    angles, electrode = rim_angles(body, electrodes, level)
    patches = patch_radii(body, electrodes, level)
    radii = np.concatenate([patches[0] * (1 - np.geomspace(1, 4e-3, rings)), patches])
    return ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, electrodes.count, covered=len(patches) - 1)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["line", "patch"])
@pytest.mark.parametrize("seed", [3, 4])
def test_a_thin_layer_is_the_sheet(kind: str, seed: int):
    rng = np.random.default_rng(seed)
    thin, z = 2e-5, rng.uniform(1e-5, 1e-3)
    body = Body(Disc(rng.uniform(0.03, 0.1)))
    electrodes = Electrodes(kind, 8, width_m=0.01, length_m=0.006, contact_impedance_Ohm_m=z / thin,
                            contact_impedance_Ohm_m2=z)
    level, place = (3, "rim") if kind == "line" else (6, "top")
    mesh = extruded(disc(body, electrodes, level, 16), np.array([-thin, 0.0]), place)
    found = volume_impedance(mesh, np.full(len(mesh.cells), SIGMA), z)
    drive = np.eye(8) - np.roll(np.eye(8), 1, axis=1)
    readings, of_sheet = (np.roll(drive, 2, axis=0) @ one @ drive.T for one in (
        found, untouched_impedance(body, electrodes, SIGMA * thin)))
    assert np.linalg.norm(readings - of_sheet) <= 1e-3 * np.linalg.norm(of_sheet)


@pytest.mark.thorough
def test_electrodes_on_part_of_the_rim_resist_more_and_a_layer_may_be_turned_over():
    body, thick, z, heights = Body(Disc(0.03)), 0.004, 1e-4, graded_heights(0.004, 4)
    flat = disc(body, Electrodes("line", 4, width_m=0.008), 1, 8)
    whole, upper, lower = (volume_impedance(
        mesh := extruded(flat, heights, "rim", between), np.full(len(mesh.cells), SIGMA), z)
        for between in (None, (-thick / 2, 0.0), (-thick, -thick / 2)))
    assert upper[0, 0] > 1.1 * whole[0, 0]
    np.testing.assert_allclose(upper, lower, rtol=1e-9)
    flat = disc(body, Electrodes("patch", 4, width_m=0.008, length_m=0.004), 1, 8)
    top, bottom = (volume_impedance(mesh := extruded(flat, heights, place), np.full(len(mesh.cells), SIGMA), z)
                   for place in ("top", "bottom"))
    np.testing.assert_allclose(top, bottom, rtol=1e-9)
